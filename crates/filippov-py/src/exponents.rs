//! The growth of small changes along many runs.

use std::sync::Arc;

use filippov::action::Actions;
use filippov::derivative::{Exponents, Extension, Growth};
use filippov::{Options, Problem, Reached, Solution, Stop};
use numpy::{PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::exceptions::{PyException, PyKeyboardInterrupt};
use pyo3::prelude::*;

use crate::derivatives::Failure;
use crate::prepared_run::{ActionRow, PreparedRun};
use crate::run::{is_interruption, message_of, status_of, take_error};
use crate::solve::RunOptions;
use crate::systems::TracedSystem;
use crate::threads::{on_threads, CHUNK_PER_THREAD};

/// Status, reason, message and last time of a run; the times at which the growth is known, the logarithms of the growth at each of
/// them, and how many directions are gone; the time from which on it is not known, with the reason; and the kinds
/// of its warnings.
type GrowthRow<'py> = (
    i32,
    String,
    String,
    f64,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    usize,
    Option<(f64, &'static str)>,
    Vec<&'static str>,
);

type Outcome = Result<(Solution, Growth), Failure>;

/// Follows the growth of small changes from many initial states, the rows of `y0`, at the times in the rows of `spans`, with the
/// parameters in the rows of `p`. Growth is counted from the first of the times in `marks` on, and kept at each of them. Where a signal
/// raised, the rows are the first ones, and the exception stands beside them.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn growth_many<'py>(
    py: Python<'py>,
    system: Bound<'py, TracedSystem>,
    spans: PyReadonlyArray2<'py, f64>,
    y0: PyReadonlyArray2<'py, f64>,
    p: PyReadonlyArray2<'py, f64>,
    marks: Vec<Vec<f64>>,
    options: &RunOptions,
    actions: Vec<ActionRow>,
    threads: usize,
) -> PyResult<(Vec<GrowthRow<'py>>, Option<Py<PyAny>>)> {
    let (spans, y0, p) = (spans.as_array(), y0.as_array(), p.as_array());
    let extension = system.get().extension(&[])?;
    let mut found = Vec::with_capacity(y0.nrows());
    let rows: Vec<usize> = (0..y0.nrows()).collect();
    for chunk in rows.chunks(CHUNK_PER_THREAD * threads.max(1)) {
        let prepare = |&row: &usize| {
            let (y0, p) = (y0.row(row).to_vec(), p.row(row).to_vec());
            let span = (spans[[row, 0]], spans[[row, 1]]);
            let run = PreparedRun::new(system.as_any(), span.0, y0, p, &[], &actions)?;
            Ok((run, span, &marks[row]))
        };
        let jobs = chunk.iter().map(prepare).collect::<PyResult<Vec<_>>>()?;
        let go = |(run, span, marks): &(PreparedRun, (f64, f64), &Vec<f64>),
                  interrupt: &mut dyn FnMut(Reached) -> bool|
         -> Outcome {
            run.run_with_growth(*span, marks, (&options.options, &extension), interrupt)
        };
        let is_last =
            |outcome: &Outcome| outcome.as_ref().is_ok_and(|(run, _)| is_interruption(run));
        let done = py.detach(|| on_threads(&jobs, threads, go, is_last));
        let mut raised = done.raised.or_else(|| py.check_signals().err());
        for ((run, span, _), outcome) in jobs.iter().zip(done.results) {
            let row = match outcome {
                Ok((solution, growth)) => row_of(py, run, solution, growth, &mut raised)?,
                Err(Failure::Refused(error)) => {
                    let nothing = PyArray2::zeros(py, [0, y0.ncols()], false);
                    let (reason, text) = ("wrong_input".to_owned(), error.to_string());
                    let no_time = PyArray1::from_slice(py, &[]);
                    let none = Vec::new();
                    (-1, reason, text, span.0, no_time, nothing, 0, None, none)
                }
                Err(failure) => return Err(failure.into()),
            };
            found.push(row);
        }
        if let Some(raised) = raised {
            return Ok((found, Some(raised.into_value(py).into_any())));
        }
    }
    Ok((found, None))
}

fn row_of<'py>(
    py: Python<'py>,
    run: &PreparedRun,
    mut solution: Solution,
    growth: Growth,
    raised: &mut Option<PyErr>,
) -> PyResult<GrowthRow<'py>> {
    let error = take_error(&mut solution);
    let mut message = message_of(&**run.core(), &solution, run.n_visible());
    if matches!(solution.stop, Stop::Interrupted) {
        raised.get_or_insert_with(|| PyKeyboardInterrupt::new_err(()));
    }
    if let Some(error) = error {
        message = format!("{message} {error}");
        if !error.is_instance_of::<PyException>(py) {
            raised.get_or_insert(error);
        }
    }
    let sums = match growth.sums.is_empty() {
        true => PyArray2::zeros(py, [0, solution.n_states], false),
        false => PyArray2::from_vec2(py, &growth.sums)?,
    };
    Ok((
        status_of(&solution.stop),
        solution.stop.name().to_owned(),
        message,
        solution.t_last,
        PyArray1::from_slice(py, &growth.t),
        sums,
        growth.n_gone,
        growth.lost.map(|(t, lost)| (t, lost.name())),
        solution.warnings.iter().map(|w| w.code.name()).collect(),
    ))
}

/// Runs a traced system, and follows the growth of small changes.
pub fn run_with_growth(
    problem: Problem<'_>,
    (system, extension, actions): (&filippov::TracedSystem, &Arc<Extension>, &Actions<'_>),
    options: &Options,
    marks: &[f64],
    interrupt: &mut dyn FnMut(Reached) -> bool,
) -> Result<(Solution, Growth), Failure> {
    let extended = extension.at(system.parameters(), actions)?;
    let extended = extended.ok_or(Failure::CalledMap)?;
    let impacts = extended.impacts();
    let mut exponents = Exponents::new(&extended, &impacts, options, marks);
    let solution = problem.solve_observed(&mut exponents, interrupt)?;
    Ok((solution, exponents.finish()?))
}
