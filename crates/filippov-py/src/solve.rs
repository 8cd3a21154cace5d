//! The call of the integrator.

use std::sync::Arc;

use filippov::derivative::Extension;
use filippov::{
    Clock, Keep, Method, Mode, NonUnique, Options, Reached, SlidingRule, Stabilization,
};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::clock::ManualClock;
use crate::derivatives::Wanted;
use crate::prepared_run::{ActionRow, EventRow, PreparedRun};
use crate::run::Run;
use crate::runs::{Finished, Runs};
use crate::systems::TracedSystem;
use crate::threads::{on_threads, Report, CHUNK_PER_THREAD, POLL_EVERY};

/// The options of a run, read once; `filippov.solve_ivp` checks them before.
#[pyclass(frozen, module = "filippov._core")]
pub struct RunOptions {
    pub options: Options,
    pub progress: Option<Py<PyAny>>,
}

#[pymethods]
impl RunOptions {
    #[new]
    fn new(given: &Bound<'_, PyDict>) -> PyResult<Self> {
        let (options, progress) = read_options(given)?;
        Ok(RunOptions { options, progress })
    }
}

/// Integrates a system; `filippov.solve_ivp` checks the arguments before. Where another motion ends at the start, `before` is what it
/// has left in the discrete states.
#[pyfunction]
#[pyo3(signature = (system, t0, t1, y0, p, options, events, actions=Vec::new(), wrt=None, before=None))]
#[allow(clippy::too_many_arguments)]
pub fn solve(
    py: Python<'_>,
    system: Bound<'_, PyAny>,
    t0: f64,
    t1: f64,
    y0: PyReadonlyArray1<'_, f64>,
    p: PyReadonlyArray1<'_, f64>,
    options: &RunOptions,
    events: Vec<EventRow>,
    actions: Vec<ActionRow>,
    wrt: Option<Wanted>,
    before: Option<Vec<f64>>,
) -> PyResult<Run> {
    let (y0, p) = (y0.as_slice()?.to_vec(), p.as_slice()?.to_vec());
    let mut prepared = PreparedRun::new(&system, t0, y0, p, &events, &actions)?;
    if let Some(before) = before {
        prepared = prepared.going_on(t0, &before)?;
    }
    let RunOptions { options, progress } = options;
    let extension = extension_of(&system, wrt.as_ref())?;
    let wanted = extension.as_ref().zip(wrt.as_ref());
    let (solution, derivatives) = py
        .detach(|| {
            let mut asked = options.clock.now();
            let mut interrupt = |reached: Reached| {
                let now = options.clock.now();
                if now - asked < POLL_EVERY {
                    return false;
                }
                asked = now;
                Python::attach(|py| {
                    let reported = progress
                        .as_ref()
                        .map(|report| report.call1(py, (reached.t, reached.n_switches_here)));
                    py.check_signals().is_err() || matches!(reported, Some(Err(_)))
                })
            };
            prepared.run_differentiated((t0, t1), options, wanted, &mut interrupt)
        })
        .map_err(PyErr::from)?;
    Ok(prepared.result(solution, derivatives))
}

/// The extension of a system by the parameters by which is differentiated; none if nothing is, or the system is not traced.
fn extension_of(
    system: &Bound<'_, PyAny>,
    wrt: Option<&Wanted>,
) -> PyResult<Option<Arc<Extension>>> {
    let traced = system.cast::<TracedSystem>().ok();
    let extension = wrt.zip(traced);
    let extension = extension.map(|(wanted, traced)| traced.get().extension(&wanted.1));
    extension.transpose()
}

/// Integrates a system from many initial states, the rows of `y0`, with the parameters in the rows of `p`, on some
/// threads, and adds them to `runs`. The result of each is that of a run of its own. Where a signal raised, the runs are the first
/// ones, and the exception is returned.
#[pyfunction]
#[pyo3(signature = (runs, system, t0, t1, y0, p, options, events, actions, threads, wrt=None))]
#[allow(clippy::too_many_arguments)]
pub fn solve_many(
    py: Python<'_>,
    runs: &Runs,
    system: Bound<'_, PyAny>,
    t0: f64,
    t1: f64,
    y0: PyReadonlyArray2<'_, f64>,
    p: PyReadonlyArray2<'_, f64>,
    options: &RunOptions,
    events: Vec<EventRow>,
    actions: Vec<ActionRow>,
    threads: usize,
    wrt: Option<Wanted>,
) -> PyResult<Option<Py<PyAny>>> {
    let (y0, p) = (y0.as_array(), p.as_array());
    let extension = extension_of(&system, wrt.as_ref())?;
    let wanted = extension.as_ref().zip(wrt.as_ref());
    let first = runs.len();
    runs.begin(&system, t0, y0.nrows());
    let rows: Vec<usize> = (0..y0.nrows()).collect();
    for chunk in rows.chunks(CHUNK_PER_THREAD * threads.max(1)) {
        let prepare = |&row: &usize| {
            let (y0, p) = (y0.row(row).to_vec(), p.row(row).to_vec());
            PreparedRun::new(&system, t0, y0, p, &events, &actions)
        };
        let prepared = chunk.iter().map(prepare).collect::<PyResult<Vec<_>>>()?;
        let run = |job: &PreparedRun, interrupt: &mut dyn FnMut(Reached) -> bool| {
            let outcome = job.run_differentiated((t0, t1), &options.options, wanted, interrupt);
            Finished::of(job, outcome)
        };
        let report = Report {
            function: options.progress.as_ref(),
            before: runs.len() - first,
        };
        let done =
            py.detach(|| on_threads(&prepared, threads, &report, run, Finished::is_interruption));
        let is_cut = done.results.len() < prepared.len();
        for ((prepared, finished), &row) in prepared.into_iter().zip(done.results).zip(chunk) {
            runs.push(py, prepared, finished, p.row(row).to_vec())?;
        }
        let raised = done.raised.or_else(|| py.check_signals().err());
        let raised = raised.or_else(|| {
            let interrupted = runs.was_interrupted(first);
            (is_cut || interrupted).then(|| PyKeyboardInterrupt::new_err(()))
        });
        if let Some(raised) = raised {
            return Ok(Some(raised.into_value(py).into_any()));
        }
    }
    Ok(None)
}

fn read_options(given: &Bound<'_, PyDict>) -> PyResult<(Options, Option<Py<PyAny>>)> {
    let mut options = Options::default();
    let mut progress = None;
    for (key, value) in given {
        let key: String = key.extract()?;
        match key.as_str() {
            "rtol" => options.rtol = value.extract()?,
            "atol" => {
                options.atol = match value.extract::<f64>() {
                    Ok(single) => vec![single],
                    Err(_) => value.extract()?,
                }
            }
            "first_step" => options.first_step = value.extract()?,
            "max_step" => options.max_step = value.extract()?,
            "max_steps" => options.max_steps = value.extract()?,
            "max_events" => options.max_events = value.extract()?,
            "max_wall_time" => options.max_wall_time = value.extract()?,
            "clock" => {
                let clock: Option<PyRef<'_, ManualClock>> = value.extract()?;
                options.clock = clock.map_or(Clock::Computer, |clock| clock.as_clock());
            }
            "nonunique" => {
                options.nonunique = match value.extract::<String>()?.as_str() {
                    // The tree of all solutions is made of runs with the choices of each.
                    "regularize" | "branch" => NonUnique::Regularize,
                    "error" => NonUnique::Error,
                    other => {
                        return Err(PyValueError::new_err(format!(
                            "nonunique: unknown policy {other:?}"
                        )))
                    }
                }
            }
            "stabilization" => {
                options.stabilization = match value.extract::<Option<f64>>()? {
                    None => Stabilization::Projection,
                    Some(factor) => Stabilization::Restoring(factor),
                }
            }
            "kappa" => options.kappa = value.extract()?,
            "choices" => {
                let choices: Vec<Vec<i8>> = value.extract()?;
                options.choices = choices.into_iter().map(Mode::new).collect();
            }
            "sliding" => options.sliding = sliding_rule(&value.extract::<String>()?)?,
            "t_eval" => options.t_eval = value.extract()?,
            "keep_decisions" => options.keep_decisions = value.extract()?,
            "dense_output" => options.dense_output = value.extract()?,
            "progress" if !value.is_none() => progress = Some(value.unbind()),
            "method" => options.method = method(&value.extract::<String>()?)?,
            "keep" => options.keep = keep(&value.extract::<String>()?)?,
            "progress" | "max_branches" => {}
            other => {
                return Err(PyValueError::new_err(format!(
                    "options: unknown key {other:?}"
                )))
            }
        }
    }
    Ok((options, progress))
}

fn method(name: &str) -> PyResult<Method> {
    Method::ALL
        .into_iter()
        .find(|method| method.name() == name)
        .ok_or_else(|| PyValueError::new_err(format!("method: unknown method {name:?}")))
}

fn keep(name: &str) -> PyResult<Keep> {
    match name {
        "steps" => Ok(Keep::Steps),
        "switches" => Ok(Keep::Switches),
        "last" => Ok(Keep::Last),
        _ => Err(PyValueError::new_err(format!("keep: unknown {name:?}"))),
    }
}

fn sliding_rule(name: &str) -> PyResult<SlidingRule> {
    let rules = [
        SlidingRule::Canopy,
        SlidingRule::Moments,
        SlidingRule::DieciLopez,
        SlidingRule::MinimumNorm,
    ];
    let known = rules.into_iter().find(|rule| rule.name() == name);
    known.ok_or_else(|| PyValueError::new_err(format!("sliding: unknown rule {name:?}")))
}
