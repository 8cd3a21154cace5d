//! The call of the integrator.

use std::sync::Arc;
use std::time::{Duration, Instant};

use filippov::action::{Action, ActionMap, Actions, Clock, Trigger};
use filippov::{
    solve_with_actions, Keep, Kind, Method, Mode, NonUnique, Options, SlidingRule, TracedMap,
    UserEvent, UserFunction,
};
use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::callbacks::{CalledEvent, CalledMap, CompiledEvent};
use crate::run::Run;
use crate::systems::{core_of, n_visible_of, raised, CoreSystem, TracedSystem};

/// How often the interpreter is asked for signals and told the progress.
const POLL_EVERY: Duration = Duration::from_millis(20);

/// The options of a run, read once; `filippov.solve_ivp` checks them before.
#[pyclass(frozen, module = "filippov._core")]
pub struct RunOptions {
    options: Options,
    progress: Option<Py<PyAny>>,
}

#[pymethods]
impl RunOptions {
    #[new]
    fn new(given: &Bound<'_, PyDict>) -> PyResult<Self> {
        let (options, progress) = read_options(given)?;
        Ok(RunOptions { options, progress })
    }
}

/// Integrates a system; `filippov.solve_ivp` checks the arguments before.
#[pyfunction]
#[pyo3(signature = (system, t0, t1, y0, p, options, events, actions=Vec::new()))]
#[allow(clippy::too_many_arguments)]
pub fn solve(
    py: Python<'_>,
    system: Bound<'_, PyAny>,
    t0: f64,
    t1: f64,
    y0: PyReadonlyArray1<'_, f64>,
    p: PyReadonlyArray1<'_, f64>,
    options: &RunOptions,
    events: Vec<(Py<PyAny>, f64, u64, String)>,
    actions: Vec<ActionRow>,
) -> PyResult<Run> {
    let traced = system.cast::<TracedSystem>().ok();
    let y0 = y0.as_slice()?.to_vec();
    let mut laws = Vec::new();
    let mut discrete = Vec::new();
    let mut compiled = None;
    let core = match traced {
        Some(traced) => {
            let own = Arc::new(traced.get().with(&p)?);
            discrete = traced.get().laws.start(&own, t0, &y0).map_err(raised)?;
            laws = traced.get().laws.actions(y0.len(), own.parameters());
            compiled = Some(Arc::clone(&own));
            own as CoreSystem
        }
        None => core_of(&system, &p, t0, &y0)?,
    };
    let n_visible = n_visible_of(&system, &*core);
    let mut functions: Vec<(Box<dyn UserFunction + Send + Sync>, f64, u64)> = Vec::new();
    for (g, direction, terminal, _name) in events {
        let handle: Option<usize> = g.extract(py).ok();
        let function: Box<dyn UserFunction + Send + Sync> = match (handle, traced, &compiled) {
            (Some(handle), Some(traced), Some(own)) => {
                let expression = traced
                    .get()
                    .event_expression(handle)
                    .ok_or_else(|| PyValueError::new_err(format!("no event {handle}")))?;
                Box::new(CompiledEvent {
                    expression,
                    system: Arc::clone(own),
                })
            }
            _ => Box::new(CalledEvent(g)),
        };
        functions.push((function, direction, terminal));
    }
    let given = read_actions(py, actions, &p)?;
    let RunOptions { options, progress } = options;
    let mut completed = None;
    if !options.choices.is_empty() && n_visible < core.n_surfaces() {
        let options = completed.insert(options.clone());
        for choice in &mut options.choices {
            let mut entries = choice.entries().to_vec();
            entries.resize(core.n_surfaces(), 1);
            *choice = Mode::new(entries);
        }
    }
    let options = completed.as_ref().unwrap_or(options);
    let names = traced.map_or_else(Vec::new, |t| t.get().law_names());
    let is_native = traced.is_some_and(|t| t.get().system.is_native());
    let solution = py
        .detach(|| {
            let events: Vec<UserEvent> = functions
                .iter()
                .map(|(function, direction, terminal)| UserEvent {
                    function: &**function,
                    direction: *direction,
                    terminal: *terminal,
                })
                .collect();
            let list = given.iter().map(|(map, trigger, name)| Action {
                kind: Some(match trigger {
                    Trigger::Surface { .. } => Kind::Reset,
                    _ => Kind::Clock,
                }),
                trigger: trigger.clone(),
                map: &**map,
                name: name.clone(),
            });
            // What the user gives comes first: a sample at a tick sees the ramp before it drops.
            let mut list: Vec<Action> = list.collect();
            list.extend(laws.iter().map(|law| Action {
                trigger: law.trigger.clone(),
                map: &law.map,
                name: names.get(law.index).cloned().unwrap_or_default(),
                kind: law.kind,
            }));
            let actions = Actions { list, discrete };
            let mut asked = Instant::now();
            let mut interrupt = |t: f64| {
                if asked.elapsed() < POLL_EVERY {
                    return false;
                }
                asked = Instant::now();
                Python::attach(|py| {
                    let reported = progress.as_ref().map(|report| report.call1(py, (t,)));
                    py.check_signals().is_err() || matches!(reported, Some(Err(_)))
                })
            };
            let interrupt = &mut interrupt;
            solve_with_actions(&*core, (t0, t1), &y0, options, &events, &actions, interrupt)
        })
        .map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(Run::new(core, solution, is_native, n_visible))
}

/// When, numbers that say so, the map (traced, or a callable), and the name of an action.
type ActionRow = (String, Vec<f64>, Py<PyAny>, String);

type SharedMap = Box<dyn ActionMap + Send + Sync>;

fn read_actions(
    py: Python<'_>,
    rows: Vec<ActionRow>,
    p: &PyReadonlyArray1<'_, f64>,
) -> PyResult<Vec<(SharedMap, Trigger, String)>> {
    let read = |(when, numbers, map, name): ActionRow| {
        let trigger = match (when.as_str(), &numbers[..]) {
            ("surface", &[index, direction]) => Trigger::Surface {
                index: index as usize,
                direction: direction as i8,
            },
            ("times", times) => Trigger::Times(times.to_vec()),
            ("clock", &[period, phase]) => Trigger::Clock {
                clock: Clock { period, phase },
                at_start: true,
            },
            _ => return Err(PyValueError::new_err(format!("unknown trigger {when:?}"))),
        };
        let map: SharedMap = match map.bind(py).cast::<TracedSystem>() {
            Ok(traced) => Box::new(TracedMap::new(traced.get().with(p)?)),
            Err(_) => Box::new(CalledMap(map)),
        };
        Ok((map, trigger, name))
    };
    rows.into_iter().map(read).collect()
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
            "kappa" => options.kappa = value.extract()?,
            "choices" => {
                let choices: Vec<Vec<i8>> = value.extract()?;
                options.choices = choices.into_iter().map(Mode::new).collect();
            }
            "sliding" => options.sliding = sliding_rule(&value.extract::<String>()?)?,
            "t_eval" => options.t_eval = value.extract()?,
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
    match name {
        "auto" => Ok(Method::Auto),
        "DOPRI5" => Ok(Method::Dopri5),
        "Taylor" => Ok(Method::Taylor),
        _ => Err(PyValueError::new_err(format!(
            "method: unknown method {name:?}"
        ))),
    }
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
