//! A bifurcation diagram by brute force: returns to a section for many values of a parameter.

use filippov::{message_of, Keep, Problem};
use serde_json::{json, Value};

use crate::model::Model;
use crate::refusal::Refusal;
use crate::reply::Reply;
use crate::request::Request;
use crate::run_request::RunRequest;
use crate::section_request::SectionRequest;

pub fn diagram(model: &Model, request: &Request) -> Result<Reply, Refusal> {
    let wanted = RunRequest::read(model, request, Keep::Last)?;
    let section = SectionRequest::read(model, request)?;
    let names: Vec<String> = model
        .description
        .params
        .iter()
        .map(|p| p.name.clone())
        .collect();
    let parameter = request.needed("parameter", request.choice("parameter", &names)?)?;
    if model.description.is_pinned {
        let requirement = "the model was traced for one value and holds for no other";
        return Err(request.wrong("parameter", requirement));
    }
    let values = request.needed("values", request.numbers("values")?)?;
    if section
        .n_periods()
        .is_some_and(|n| n > 1 && n != values.len())
    {
        let requirement = "section.period: as many periods as values are needed, or one";
        return Err(Refusal::request(requirement));
    }
    let coordinate = request.choice("coordinate", &model.description.states)?;
    let coordinate = coordinate.unwrap_or(0);
    let carries = request.flag("carry")?.unwrap_or(false);
    let (mut params, mut start) = (wanted.params, wanted.y0);
    let (t0, t1) = wanted.t_span;
    let mut t_start = t0;
    // The discrete states that the last run has left.
    let mut memory = request.numbers("memory")?;
    let mut points = [Vec::new(), Vec::new(), Vec::new()];
    let (mut statuses, mut messages): (Vec<i32>, Vec<Value>) = (Vec::new(), Vec::new());
    for (index, &value) in values.iter().enumerate() {
        params[parameter] = value;
        let span = section.duration(index).unwrap_or(t1 - t0);
        // The state that a run leaves belongs to a tick: the next one starts at a tick of its own clock.
        let tick = section.first_tick(index, t0).filter(|_| memory.is_some());
        let from = tick.unwrap_or(t_start);
        let ready = model.ready(&params, from, &start)?;
        let (system, mut actions) = (ready.system(), ready.actions());
        if let Some(before) = &memory {
            model.go_on(&mut actions, &params, (from, &start), before)?;
        }
        let solution = Problem::new(system, (from, from + span), &start)
            .options(&wanted.options)
            .actions(&actions)
            .solve_to_section(&section.section(index), &mut |_| false);
        let solution = match solution {
            Ok(solution) => solution,
            // A value at which the run cannot even start is a gap in the diagram.
            Err(error) => {
                statuses.push(-1);
                messages.push(json!({"value": value, "message": error.to_string()}));
                continue;
            }
        };
        statuses.push(solution.stop.status());
        if !solution.stop.is_success() {
            let message = message_of(system, &solution, model.n_visible());
            messages.push(json!({"value": value, "message": message}));
        }
        for found in solution.returns.iter().flat_map(|returns| &returns.kept) {
            let row = [value, found.y[coordinate], index as f64];
            points
                .iter_mut()
                .zip(row)
                .for_each(|(list, entry)| list.push(entry));
        }
        if carries && solution.stop.is_success() {
            t_start = if section.n_periods().is_some() {
                t0
            } else {
                solution.t_last
            };
            start = solution.last_state().to_vec();
            memory = Some(solution.discrete);
        }
    }
    let mut reply = Reply::new("diagram");
    if carries {
        // Where a request for further values begins.
        reply.set("t", t_start);
        reply.array("end", &[start.len()], &start);
        if let Some(memory) = &memory {
            reply.array("memory", &[memory.len()], memory);
        }
    }
    reply.set("done", statuses.len());
    reply.set("status", statuses);
    reply.set("messages", messages);
    for (name, list) in ["value", "y", "index"].into_iter().zip(&points) {
        reply.array(name, &[list.len()], list);
    }
    Ok(reply)
}
