//! Decisions of a run as Python dictionaries, and back.

use filippov::motion::{Guard, RootEnd};
use filippov::{DecisionCause, DecisionOutcome, DecisionPoint, DecisionRecord, Mode};
use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::prepared_run::{ActionRow, PreparedRun};
use crate::solve::RunOptions;
use crate::systems::{raised, CoreSystem};

/// The name of a guard, and the number of its surface if it has one, else 0.
type GuardRow = (String, usize);

/// What was asked and what was decided, in one dictionary each.
pub fn record_as_pair<'py>(
    py: Python<'py>,
    record: &DecisionRecord,
) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>)> {
    Ok((
        point_as_dict(py, &record.point)?,
        outcome_as_dict(py, &record.outcome)?,
    ))
}

/// Repeats the decision at a point of a recorded run.
#[pyfunction]
#[pyo3(signature = (system, p, options, actions, point))]
pub fn replay_decision<'py>(
    py: Python<'py>,
    system: Bound<'py, PyAny>,
    p: PyReadonlyArray1<'py, f64>,
    options: &RunOptions,
    actions: Vec<ActionRow>,
    point: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyDict>> {
    let (p, point) = (p.as_slice()?.to_vec(), read_point(point)?);
    let prepared = PreparedRun::new(&system, point.t, point.x.clone(), p, &[], &actions)?;
    check_point(&point, prepared.core())?;
    let outcome = prepared.replay(&options.options, &point).map_err(raised)?;
    outcome_as_dict(py, &outcome)
}

/// Checks that a point is one of this system.
fn check_point(point: &DecisionPoint, system: &CoreSystem) -> PyResult<()> {
    let n = system.n_surfaces();
    let wrong = |text: String| Err(PyValueError::new_err(format!("point: {text}")));
    let mut surfaces = [&point.resting[..], &point.departing, &point.passing].concat();
    let mut modes = vec![&point.mode];
    match &point.cause {
        DecisionCause::Start => {}
        DecisionCause::Anew(memory) => modes.push(memory),
        DecisionCause::Event { functions, .. } => {
            surfaces.extend(functions.iter().map(|&guard| guard_as_row(guard).1));
        }
        DecisionCause::Limit(meeting) => surfaces.extend(meeting),
    }
    let fits = modes.iter().all(|mode| mode.entries().len() == n);
    let n_states = system.n_states();
    if !fits || point.x.len() != n_states || point.velocity.len() != n_states {
        return wrong("mode or x does not fit the system".into());
    }
    match surfaces.iter().find(|&&j| j >= n) {
        Some(j) => wrong(format!("no surface {j}")),
        None => Ok(()),
    }
}

fn mode_as_tuple<'py>(py: Python<'py>, mode: &Mode) -> PyResult<Bound<'py, PyTuple>> {
    PyTuple::new(py, mode.entries())
}

/// The name of a kind of guard, and the guard of that kind at a surface.
type GuardKind = (&'static str, fn(usize) -> Guard);

const GUARDS: [GuardKind; 6] = [
    ("surface", Guard::Surface),
    ("multiplier_minus", |j| Guard::ends(j)[0]),
    ("multiplier_plus", |j| Guard::ends(j)[1]),
    ("force", Guard::Force),
    ("fold", |_| Guard::Root(RootEnd::Fold)),
    ("stability", |_| Guard::Root(RootEnd::Stability)),
];

fn guard_as_row(guard: Guard) -> GuardRow {
    let j = match guard {
        Guard::Surface(j) | Guard::Multiplier { surface: j, .. } | Guard::Force(j) => j,
        Guard::Root(_) => 0,
    };
    let row = GUARDS.iter().find(|(_, make)| make(j) == guard);
    (row.map_or("", |row| row.0).into(), j)
}

fn read_guard((name, surface): GuardRow) -> PyResult<Guard> {
    let unknown = || PyValueError::new_err(format!("point: unknown function {name:?}"));
    let row = GUARDS.iter().find(|row| row.0 == name);
    row.map(|(_, make)| make(surface)).ok_or_else(unknown)
}

fn point_as_dict<'py>(py: Python<'py>, point: &DecisionPoint) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    match &point.cause {
        DecisionCause::Start => dict.set_item("cause", "start")?,
        DecisionCause::Anew(mode) => {
            dict.set_item("cause", "anew")?;
            dict.set_item("memory", mode_as_tuple(py, mode)?)?;
        }
        DecisionCause::Event {
            functions,
            touch,
            vanishing,
            at_two_fold,
        } => {
            dict.set_item("cause", "event")?;
            let rows = functions.iter().map(|&guard| guard_as_row(guard));
            dict.set_item("functions", rows.collect::<Vec<_>>())?;
            dict.set_item("touch", touch)?;
            dict.set_item("vanishing", vanishing.to_vec())?;
            dict.set_item("at_two_fold", at_two_fold)?;
        }
        DecisionCause::Limit(surfaces) => {
            dict.set_item("cause", "limit")?;
            dict.set_item("surfaces", surfaces.clone())?;
        }
    }
    dict.set_item("t", point.t)?;
    dict.set_item("x", point.x.clone())?;
    dict.set_item("q", point.q.clone())?;
    dict.set_item("mode", mode_as_tuple(py, &point.mode)?)?;
    dict.set_item("multipliers", point.multipliers.clone())?;
    dict.set_item("oscillates", point.oscillates)?;
    dict.set_item("velocity", point.velocity.clone())?;
    dict.set_item("sides", point.sides.clone())?;
    dict.set_item("resting", point.resting.clone())?;
    dict.set_item("departing", point.departing.clone())?;
    dict.set_item("residuals", point.residuals.clone())?;
    dict.set_item("passing", point.passing.clone())?;
    dict.set_item("n_choices", point.n_choices)?;
    Ok(dict)
}

fn read_point(dict: &Bound<'_, PyDict>) -> PyResult<DecisionPoint> {
    let get = |key: &str| {
        let missing = || PyValueError::new_err(format!("point: {key} is missing"));
        dict.get_item(key)?.ok_or_else(missing)
    };
    let cause: String = get("cause")?.extract()?;
    let cause = match cause.as_str() {
        "start" => DecisionCause::Start,
        "anew" => DecisionCause::Anew(Mode::new(get("memory")?.extract()?)),
        "event" => {
            let rows: Vec<GuardRow> = get("functions")?.extract()?;
            let functions = rows.into_iter().map(read_guard);
            DecisionCause::Event {
                functions: functions.collect::<PyResult<_>>()?,
                touch: get("touch")?.extract()?,
                vanishing: get("vanishing")?.extract()?,
                at_two_fold: get("at_two_fold")?.extract()?,
            }
        }
        "limit" => DecisionCause::Limit(get("surfaces")?.extract()?),
        _ => {
            return Err(PyValueError::new_err(format!(
                "point: unknown cause {cause:?}"
            )))
        }
    };
    Ok(DecisionPoint {
        t: get("t")?.extract()?,
        x: get("x")?.extract()?,
        q: get("q")?.extract()?,
        cause,
        mode: Mode::new(get("mode")?.extract()?),
        multipliers: get("multipliers")?.extract()?,
        oscillates: get("oscillates")?.extract()?,
        velocity: get("velocity")?.extract()?,
        sides: get("sides")?.extract()?,
        resting: get("resting")?.extract()?,
        departing: get("departing")?.extract()?,
        residuals: get("residuals")?.extract()?,
        passing: get("passing")?.extract()?,
        n_choices: get("n_choices")?.extract()?,
    })
}

fn outcome_as_dict<'py>(
    py: Python<'py>,
    outcome: &DecisionOutcome,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let mode = outcome.mode.as_ref().map(|mode| mode_as_tuple(py, mode));
    let candidates = outcome.candidates.iter();
    let candidates: PyResult<Vec<_>> = candidates.map(|mode| mode_as_tuple(py, mode)).collect();
    let zeros = outcome.zeros.iter();
    let zeros = zeros.map(|zero| (guard_as_row(zero.guard), zero.order, zero.sign));
    dict.set_item("mode", mode.transpose()?)?;
    dict.set_item("stop", outcome.stop)?;
    dict.set_item("rule", outcome.rule)?;
    dict.set_item("leaf", outcome.leaf)?;
    dict.set_item("candidates", candidates?)?;
    dict.set_item("multipliers", outcome.multipliers.clone())?;
    dict.set_item("spirals", outcome.spirals)?;
    dict.set_item("zeros", zeros.collect::<Vec<_>>())?;
    Ok(dict)
}
