//! The returns of a run to a section.

use filippov::{Keep, Problem};

use crate::model::Model;
use crate::refusal::Refusal;
use crate::reply::Reply;
use crate::request::Request;
use crate::run_request::RunRequest;
use crate::section_request::SectionRequest;
use crate::words::set_outcome;

pub fn section(model: &Model, request: &Request) -> Result<Reply, Refusal> {
    let mut wanted = RunRequest::read(model, request, Keep::Last)?;
    let section = SectionRequest::read(model, request)?;
    if let (Some(duration), None) = (section.duration(0), request.get("t_span")) {
        wanted.t_span.1 = wanted.t_span.0 + duration;
    }
    let ready = model.ready(&wanted.params, wanted.t_span.0, &wanted.y0)?;
    let (system, actions) = (ready.system(), ready.actions());
    let mut solution = Problem::new(system, wanted.t_span, &wanted.y0)
        .options(&wanted.options)
        .actions(&actions)
        .solve_to_section(&section.section(0), &mut |_| false)?;
    let returns = solution.returns.take().unwrap_or_default();
    let mut reply = Reply::new("section");
    set_outcome(&mut reply, model, system, &solution);
    reply.set("returns", returns.count);
    let kept = &returns.kept;
    let t: Vec<f64> = kept.iter().map(|found| found.t).collect();
    let y: Vec<f64> = kept.iter().flat_map(|found| &found.y).copied().collect();
    reply.array("t", &[t.len()], &t);
    reply.array("y", &[t.len(), model.n()], &y);
    Ok(reply)
}
