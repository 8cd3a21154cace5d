//! The states of a run at given times.

use filippov::{Keep, Problem, Side};

use crate::model::Model;
use crate::refusal::Refusal;
use crate::reply::Reply;
use crate::request::Request;
use crate::run_request::RunRequest;
use crate::words::set_outcome;

pub fn sample(model: &Model, request: &Request) -> Result<Reply, Refusal> {
    let wanted = RunRequest::read(model, request, Keep::Steps)?;
    let times = request.needed("times", request.numbers("times")?)?;
    let ready = model.ready(&wanted.params, wanted.t_span.0, &wanted.y0)?;
    let (system, actions) = (ready.system(), ready.actions());
    let solution = Problem::new(system, wanted.t_span, &wanted.y0)
        .options(&wanted.options)
        .actions(&actions)
        .solve()?;
    let (mut t, mut y) = (Vec::new(), Vec::new());
    let mut state = vec![0.0; model.n()];
    for &time in &times {
        let (t0, t1) = wanted.t_span;
        if !(t0..=t1).contains(&time) {
            let requirement = format!("{time} is outside of t_span = [{t0}, {t1}]");
            return Err(request.wrong("times", &requirement));
        }
        // A run that ended early has the states up to its end.
        let found = solution.evaluate(system, time, Side::Right, &mut state)?;
        if found.is_some() {
            t.push(time);
            y.extend_from_slice(&state);
        }
    }
    let mut reply = Reply::new("sample");
    set_outcome(&mut reply, model, system, &solution);
    reply.array("t", &[t.len()], &t);
    reply.array("y", &[t.len(), model.n()], &y);
    Ok(reply)
}
