//! Basins: where motions from a window of starts are at the end of their span.
//!
//! The ends of some rows of cells are a request of their own, so that several engines can share the work; one of them groups all.

use std::ops::Range;

use filippov::{Keep, Problem};

use crate::clusters::clusters;
use crate::dimensions::Window;
use crate::model::Model;
use crate::refusal::Refusal;
use crate::reply::Reply;
use crate::request::Request;
use crate::run_request::RunRequest;

const CELLS: usize = 40;
/// Most steps of the run of a cell, unless the request has others.
const MAX_STEPS: u64 = 20_000;
/// Ends that differ by at most this share of their extent, in every state, are one; and this share of the window's sides at least.
const NEAR: f64 = 0.02;

/// The states at the end of the motions from the cells of some rows, `rows: [first, last)`: NaN where the run failed.
pub fn ends(model: &Model, request: &Request) -> Result<Reply, Refusal> {
    let window = Window::read(model, request, CELLS)?;
    let cells = window.cells;
    let rows = request.exactly::<2>("rows")?.unwrap_or([0.0, cells as f64]);
    let is_row = |row: &f64| row.fract() == 0.0 && (0.0..=cells as f64).contains(row);
    if !rows.iter().all(is_row) || rows[0] >= rows[1] {
        let requirement = format!("[first, last) with whole numbers from 0 to {cells} is needed");
        return Err(request.wrong("rows", &requirement));
    }
    let rows = rows.map(|row| row as usize);
    let ends = ends_of(model, request, &window, rows[0]..rows[1])?;
    let failed = || vec![f64::NAN; model.n()];
    let values: Vec<f64> = ends
        .iter()
        .flat_map(|end| end.clone().unwrap_or_else(failed))
        .collect();
    let mut reply = Reply::new("ends");
    reply.array("end", &[ends.len(), model.n()], &values);
    Ok(reply)
}

/// The groups of the ends of all cells: of those in `ends`, one state after another with `null` where a run failed, or else of
/// motions that are computed here.
pub fn basins(model: &Model, request: &Request) -> Result<Reply, Refusal> {
    let window = Window::read(model, request, CELLS)?;
    let n = model.n();
    let cells = window.cells;
    let (targets, is_given) = match request.get("targets") {
        Some(_) => (targets_of(model, request)?, true),
        None => (Vec::new(), false),
    };
    let ends = match request.get("ends") {
        Some(_) => given_ends(request, cells * cells, n)?,
        None => ends_of(model, request, &window, 0..cells)?,
    };
    let good: Vec<Vec<f64>> = ends.iter().flatten().cloned().collect();
    let reach = reach_of(&window, &good, n);
    let (groups, names) = match is_given {
        true => {
            let nearest = |end: &Vec<f64>| nearest(&targets, end, &reach);
            let groups: Vec<usize> = good.iter().map(nearest).collect();
            (
                groups,
                sentences(model, &targets.iter().map(|t| vec![t]).collect::<Vec<_>>()),
            )
        }
        false => {
            let groups = clusters(&good, &reach);
            let count = groups.iter().max().map_or(0, |last| last + 1);
            let members = |group: usize| {
                let pairs = good.iter().zip(&groups);
                pairs
                    .filter(|(_, &own)| own == group)
                    .map(|(end, _)| end)
                    .collect()
            };
            let members: Vec<Vec<&Vec<f64>>> = (0..count).map(members).collect();
            (groups, sentences(model, &members))
        }
    };
    let mut groups = groups.into_iter();
    let labels = ends.iter().map(|end| match end {
        Some(_) => groups.next().map_or(-1.0, |group| group as f64),
        None => -1.0,
    });
    let labels: Vec<f64> = labels.collect();
    let mut reply = Reply::new("basins");
    reply.set("labels", names);
    reply.set("failed", ends.iter().filter(|end| end.is_none()).count());
    reply.array("label", &[cells, cells], &labels);
    Ok(reply)
}

fn ends_of(
    model: &Model,
    request: &Request,
    window: &Window,
    rows: Range<usize>,
) -> Result<Vec<Option<Vec<f64>>>, Refusal> {
    let mut wanted = RunRequest::read(model, request, Keep::Last)?;
    if request.get("max_steps").is_none() {
        wanted.options.max_steps = MAX_STEPS;
    }
    let mut ends = Vec::with_capacity(rows.len() * window.cells);
    for row in rows {
        for column in 0..window.cells {
            let start = window.state(window.centre(column, row, window.cells));
            let ready = model.ready(&wanted.params, wanted.t_span.0, &start)?;
            let actions = ready.actions();
            let solution = Problem::new(ready.system(), wanted.t_span, &start)
                .options(&wanted.options)
                .actions(&actions)
                .solve()?;
            let is_good = solution.stop.is_success();
            ends.push(is_good.then(|| solution.last_state().to_vec()));
        }
    }
    Ok(ends)
}

fn given_ends(request: &Request, count: usize, n: usize) -> Result<Vec<Option<Vec<f64>>>, Refusal> {
    let requirement = format!("a list of {count} states with {n} numbers each is needed");
    let wrong = || request.wrong("ends", &requirement);
    let list = request.get("ends").and_then(|value| value.as_array());
    let list = list
        .filter(|list| list.len() == count * n)
        .ok_or_else(wrong)?;
    let states = list
        .chunks(n)
        .map(|state| state.iter().map(serde_json::Value::as_f64).collect());
    Ok(states.collect())
}

/// Two ends that differ by this in every state count as neighbours.
fn reach_of(window: &Window, ends: &[Vec<f64>], n: usize) -> Vec<f64> {
    let mut reach: Vec<f64> = (0..n)
        .map(|i| {
            let values = || ends.iter().map(|end| end[i]);
            let extent =
                values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min);
            NEAR * extent.max(f64::MIN_POSITIVE)
        })
        .collect();
    for (k, &axis) in window.axes.iter().enumerate() {
        reach[axis] = reach[axis].max(NEAR * (window.high[k] - window.low[k]));
    }
    for value in &mut reach {
        *value = value.max(1e-9);
    }
    reach
}

fn targets_of(model: &Model, request: &Request) -> Result<Vec<Vec<f64>>, Refusal> {
    let n = model.n();
    let requirement = format!("a list of states, {n} numbers each, is needed");
    let wrong = || request.wrong("targets", &requirement);
    let list = request.get("targets").and_then(|value| value.as_array());
    let list = list.filter(|list| !list.is_empty()).ok_or_else(wrong)?;
    let state = |value: &serde_json::Value| {
        let entries = value.as_array()?.iter().map(serde_json::Value::as_f64);
        entries
            .collect::<Option<Vec<f64>>>()
            .filter(|state| state.len() == n)
    };
    let states: Option<Vec<Vec<f64>>> = list.iter().map(state).collect();
    states.ok_or_else(wrong)
}

fn nearest(targets: &[Vec<f64>], end: &[f64], reach: &[f64]) -> usize {
    let distance = |target: &[f64]| {
        let components = target.iter().zip(end).zip(reach);
        let shares = components.map(|((a, b), reach)| ((a - b) / reach).abs());
        shares.fold(0.0, f64::max)
    };
    let nearer = |best: usize, k: usize| match distance(&targets[k]) < distance(&targets[best]) {
        true => k,
        false => best,
    };
    (0..targets.len()).fold(0, nearer)
}

/// Where each group of ends is, in words.
fn sentences(model: &Model, groups: &[Vec<&Vec<f64>>]) -> Vec<String> {
    let states = &model.description.states;
    let sentence = |members: &Vec<&Vec<f64>>| {
        let words = states.iter().enumerate().map(|(i, name)| {
            let values = || members.iter().map(|end| end[i]);
            let low = values().fold(f64::INFINITY, f64::min);
            let high = values().fold(f64::NEG_INFINITY, f64::max);
            match high - low <= 1e-3 * (1.0 + high.abs()) {
                true => format!("{name} = {:.4}", 0.5 * (low + high)),
                false => format!("{name} from {low:.4} to {high:.4}"),
            }
        });
        format!("ends at {}", words.collect::<Vec<_>>().join(", "))
    };
    groups.iter().map(sentence).collect()
}
