//! A run: its curve, its pieces, its switches.

use filippov::{Keep, Problem};
use serde_json::{json, Value};

use crate::curve::curve;
use crate::model::Model;
use crate::refusal::Refusal;
use crate::reply::Reply;
use crate::request::Request;
use crate::run_request::RunRequest;
use crate::words::{set_outcome, switch_of};

/// How far a drawn curve may be from the curve, as a share of its extent.
const TOLERANCE: f64 = 1e-3;

pub fn run(model: &Model, request: &Request) -> Result<Reply, Refusal> {
    let wanted = RunRequest::read(model, request, Keep::Steps)?;
    let tolerance = request.number("tolerance")?.unwrap_or(TOLERANCE);
    if !(1e-9..=1.0).contains(&tolerance) {
        return Err(request.wrong("tolerance", "must be from 1e-9 to 1"));
    }
    let ready = model.ready(&wanted.params, wanted.t_span.0, &wanted.y0)?;
    let (system, mut actions) = (ready.system(), ready.actions());
    // The discrete states that another run has left.
    if let Some(before) = request.numbers("memory")? {
        let at = (wanted.t_span.0, &wanted.y0[..]);
        model.go_on(&mut actions, &wanted.params, at, &before)?;
    }
    let solution = Problem::new(system, wanted.t_span, &wanted.y0)
        .options(&wanted.options)
        .actions(&actions)
        .solve()?;
    let curve = curve(system, &solution, tolerance)?;
    let n_visible = model.n_visible();
    let pieces = curve.pieces.iter().map(|piece| {
        let mode = piece.mode.first(n_visible);
        let kind = match mode.codimension() {
            0 => "region",
            _ => "sliding",
        };
        json!({"mode": mode.to_string(), "first": piece.first, "last": piece.last, "kind": kind})
    });
    let switches = solution.switches_of_first(n_visible);
    let switches = switches.map(|switch| switch_of(model, system, &solution, &switch));
    let mut reply = Reply::new("run");
    set_outcome(&mut reply, model, system, &solution);
    reply.set("pieces", pieces.collect::<Vec<Value>>());
    reply.set("switches", switches.collect::<Result<Vec<Value>, _>>()?);
    reply.set("end", solution.last_state().to_vec());
    reply.set("nfev", solution.stats.n_field_evaluations);
    reply.set("steps", solution.stats.n_steps);
    let count = curve.t.len();
    reply.array("t", &[count], &curve.t);
    reply.array("y", &[count, model.n()], &curve.y);
    Ok(reply)
}
