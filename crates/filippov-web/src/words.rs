//! What a run is, in the words of its table of switches and its warnings.

use filippov::{message_of, FieldError, PiecewiseSystem, Solution, Switch, Warning};
use serde_json::{json, Value};

use crate::model::Model;
use crate::reply::Reply;

/// Adds how a run ended, and what it warned of.
pub fn set_outcome(
    reply: &mut Reply,
    model: &Model,
    system: &dyn PiecewiseSystem,
    solution: &Solution,
) {
    let stop = &solution.stop;
    reply.set("status", stop.status());
    reply.set("success", stop.is_success());
    reply.set("reason", stop.name());
    reply.set("message", message_of(system, solution, model.n_visible()));
    reply.set("t_last", solution.t_last);
    let warnings = solution.warnings.iter();
    let warnings: Vec<Value> = warnings.map(|warning| warning_of(model, warning)).collect();
    reply.set("warnings", warnings);
}

/// A switch, as a row of the table.
pub fn switch_of(
    model: &Model,
    system: &dyn PiecewiseSystem,
    solution: &Solution,
    switch: &Switch,
) -> Result<Value, FieldError> {
    let n = model.n_visible();
    let surfaces = switch.surfaces.iter().filter(|&&j| j < n);
    Ok(json!({
        "t": switch.t,
        "kind": switch.kind.name(),
        "surfaces": surfaces.map(|&j| model.surface(j)).collect::<Vec<_>>(),
        "from": switch.mode_before.first(n).to_string(),
        "to": switch.mode_after.first(n).to_string(),
        "before": &switch.y_before[..],
        "y": &switch.y_after[..],
        "note": switch.note,
        "rule": switch.rule,
        "kink": solution.is_kink(system, switch)?,
    }))
}

fn warning_of(model: &Model, warning: &Warning) -> Value {
    let n = model.n_visible();
    let surfaces = warning.surfaces.iter().filter(|&&j| j < n);
    let candidates = warning.candidates.iter();
    json!({
        "t": warning.t,
        "code": warning.code.name(),
        "message": warning.text,
        "surfaces": surfaces.map(|&j| model.surface(j)).collect::<Vec<_>>(),
        "candidates": candidates.map(|mode| mode.first(n).to_string()).collect::<Vec<_>>(),
    })
}
