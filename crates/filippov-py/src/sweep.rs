//! Many runs from section to section, each with its own parameters and span; what they leave as arrays.

use std::sync::Arc;

use filippov::action::Clock;
use filippov::section::{Cycle, Place, Returns, Section};
use filippov::{
    message_of, Error, Kind, Piece, Reached, Side, SlidingRule, Solution, Stop, UserFunction,
    Warning, WarningCode,
};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::{PyException, PyKeyError, PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::callbacks::{CalledEvent, CompiledEvent, EventExpression, Signal};
use crate::prepared_run::{ActionRow, PreparedRun};
use crate::run::{is_interruption, take_error};
use crate::solve::RunOptions;
use crate::systems::TracedSystem;
use crate::threads::{on_threads, Report, CHUNK_PER_THREAD};

type Outcome = Result<Solution, Error>;

/// Integrates from many initial states, the rows of `y0`, over the spans in the rows of `spans`, with the parameters
/// in the rows of `p`; a run that cannot even start has a status like any other. Where a signal raised, the exception
/// stands under `raised`, and the runs that were not begun have the reason `not_run`. The rows of `memory` are discrete states that
/// other runs left; those of the last return, or of the end, are under `memory_last`.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn solve_points<'py>(
    py: Python<'py>,
    system: Bound<'py, PyAny>,
    spans: PyReadonlyArray2<'py, f64>,
    y0: PyReadonlyArray2<'py, f64>,
    p: PyReadonlyArray2<'py, f64>,
    options: &RunOptions,
    actions: Vec<ActionRow>,
    section: Option<Bound<'py, PyDict>>,
    outputs: Vec<(Bound<'py, TracedSystem>, Vec<usize>)>,
    threads: usize,
    memory: Option<PyReadonlyArray2<'py, f64>>,
) -> PyResult<Bound<'py, PyDict>> {
    let memory = memory.as_ref().map(|memory| memory.as_array());
    let (spans, y0, p) = (spans.as_array(), y0.as_array(), p.as_array());
    let section = section.map(|given| SectionSpec::read(&system, &given));
    let mut section = section.transpose()?;
    let traced = system.cast::<TracedSystem>();
    let has_memory = traced.is_ok_and(|traced| traced.get().laws.have_memory());
    if let Some(section) = &mut section {
        section.keeps_pieces = !outputs.is_empty() || has_memory;
    }
    let outputs = outputs
        .iter()
        .map(Output::read)
        .collect::<PyResult<Vec<_>>>()?;
    let rows: Vec<usize> = (0..y0.nrows()).collect();
    let mut points = Points::new(y0.ncols(), outputs.len());
    for chunk in rows.chunks(CHUNK_PER_THREAD * threads.max(1)) {
        let prepare = |&row: &usize| {
            let (y0, p) = (y0.row(row).to_vec(), p.row(row).to_vec());
            let mut run = PreparedRun::new(&system, spans[[row, 0]], y0, p, &[], &actions)?;
            if let Some(memory) = &memory {
                run = run.going_on(spans[[row, 0]], &memory.row(row).to_vec())?;
            }
            let place = section.as_ref().map(|section| section.at(&run, row));
            Ok((run, place, (spans[[row, 0]], spans[[row, 1]])))
        };
        let jobs = chunk.iter().map(prepare).collect::<PyResult<Vec<_>>>()?;
        let go = |(run, place, span): &(PreparedRun, Option<OwnPlace>, (f64, f64)),
                  interrupt: &mut dyn FnMut(Reached) -> bool|
         -> Outcome {
            match (place, &section) {
                (Some(place), Some(section)) => {
                    let section = section.section(place);
                    run.run_to_section(*span, &options.options, &section, interrupt)
                }
                _ => run.run(*span, &options.options, interrupt),
            }
        };
        let is_last = |outcome: &Outcome| outcome.as_ref().is_ok_and(is_interruption);
        let report = Report {
            function: options.progress.as_ref(),
            before: points.status.len(),
        };
        let done = py.detach(|| on_threads(&jobs, threads, &report, go, is_last));
        for (((run, _, span), outcome), row) in jobs.iter().zip(done.results).zip(chunk) {
            let signals = Signals {
                outputs: &outputs,
                p: &p.row(*row).to_vec(),
            };
            points.take(py, run, &signals, *span, outcome);
        }
        let signalled = done.raised.or_else(|| py.check_signals().err());
        if let Some(raised) = signalled {
            points.raised = Some(raised);
        }
        if points.raised.is_some() {
            let first_left = points.status.len();
            for &row in &rows[first_left..] {
                points.leave_out(spans[[row, 0]]);
            }
            break;
        }
    }
    points.into_dict(py)
}

/// A quantity that is wanted of every run.
struct Output {
    expression: EventExpression,
    /// The surfaces whose contact accelerations it reads.
    contacts: Vec<usize>,
}

impl Output {
    /// The first component of the field of a system is the expression.
    fn read((system, contacts): &(Bound<'_, TracedSystem>, Vec<usize>)) -> PyResult<Self> {
        let own = &system.get().system;
        let node = own.field_nodes().first();
        let node = *node.ok_or_else(|| PyValueError::new_err("outputs: no expression"))?;
        let expression = EventExpression::compile(own.graph(), node, &[], 0);
        Ok(Output {
            expression: expression.map_err(|e| PyValueError::new_err(e.to_string()))?,
            contacts: contacts.clone(),
        })
    }
}

/// The outputs of one run.
struct Signals<'a> {
    outputs: &'a [Output],
    p: &'a [f64],
}

impl Signals<'_> {
    /// Their values at a point; NaN where a function of the user raises.
    fn values(
        &self,
        run: &PreparedRun,
        rule: SlidingRule,
        (t, y): (f64, &[f64]),
        mut piece: Piece,
    ) -> Vec<f64> {
        let followed = run.follow_idle(&mut piece, (t, y));
        let held = followed.and_then(|()| piece.held(&**run.core(), &run.actions(), rule, (t, y)));
        let velocity = run.velocity_in_region(&piece, (t, y));
        let value = |output: &Output| match &held {
            Ok(held) => {
                let signal = Signal {
                    expression: &output.expression,
                    velocity: velocity.as_deref(),
                    side: Side::Right,
                    contacts: &output.contacts,
                };
                signal.value((t, y), self.p, &piece, held)
            }
            Err(_) => f64::NAN,
        };
        self.outputs.iter().map(value).collect()
    }
}

/// A section as it comes from Python.
struct SectionSpec {
    place: PlaceSpec,
    transient: u64,
    most: u64,
    cycle: Option<Cycle>,
    keeps_pieces: bool,
}

enum PlaceSpec {
    Called(Py<PyAny>, f64),
    Compiled(Arc<EventExpression>, f64),
    Surface(usize, i8, Option<Kind>),
    /// Period and phase of each row.
    Ticks(Vec<Clock>),
}

/// The section of one run.
enum OwnPlace {
    Function(Box<dyn UserFunction + Send + Sync>, f64),
    Surface(usize, i8, Option<Kind>),
    Ticks(Clock),
}

type CycleRow = (f64, Vec<f64>, Vec<f64>, usize, bool);

impl SectionSpec {
    fn read(system: &Bound<'_, PyAny>, given: &Bound<'_, PyDict>) -> PyResult<Self> {
        let cycle: Option<CycleRow> = item(given, "cycle")?.extract()?;
        let cycle = cycle.map(|(rtol, atol, moduli, longest, ends_run)| Cycle {
            rtol,
            atol,
            moduli,
            longest,
            ends_run,
        });
        Ok(SectionSpec {
            place: PlaceSpec::read(system, given)?,
            transient: item(given, "transient")?.extract()?,
            most: item(given, "most")?.extract()?,
            cycle,
            keeps_pieces: false,
        })
    }

    fn at(&self, run: &PreparedRun, row: usize) -> OwnPlace {
        match (&self.place, run.traced()) {
            (PlaceSpec::Called(function, direction), _) => {
                let function = Python::attach(|py| function.clone_ref(py));
                OwnPlace::Function(Box::new(CalledEvent(function)), *direction)
            }
            (PlaceSpec::Compiled(expression, direction), Some(system)) => {
                let function = CompiledEvent {
                    expression: Arc::clone(expression),
                    system: Arc::clone(system),
                };
                OwnPlace::Function(Box::new(function), *direction)
            }
            (PlaceSpec::Compiled(..), None) => unreachable!("only traced systems have expressions"),
            (PlaceSpec::Surface(j, direction, kind), _) => OwnPlace::Surface(*j, *direction, *kind),
            (PlaceSpec::Ticks(clocks), _) => OwnPlace::Ticks(clocks[row]),
        }
    }

    fn section<'a>(&self, place: &'a OwnPlace) -> Section<'a> {
        let place = match place {
            OwnPlace::Function(function, direction) => Place::Function {
                function: &**function,
                direction: *direction,
            },
            OwnPlace::Surface(index, direction, kind) => Place::Surface {
                index: *index,
                direction: *direction,
                kind: *kind,
            },
            OwnPlace::Ticks(clock) => Place::Ticks(*clock),
        };
        Section {
            place,
            transient: self.transient,
            most: self.most,
            cycle: self.cycle.clone(),
            keeps_pieces: self.keeps_pieces,
        }
    }
}

impl PlaceSpec {
    fn read(system: &Bound<'_, PyAny>, given: &Bound<'_, PyDict>) -> PyResult<Self> {
        let form: String = item(given, "form")?.extract()?;
        let traced = system.cast::<TracedSystem>().ok();
        let refused = |text: &str| PyValueError::new_err(text.to_owned());
        let compiled = |graph: &filippov_expr::Graph, node| {
            let expression = EventExpression::compile(graph, node, &[], 0);
            expression.map_err(|e| PyValueError::new_err(e.to_string()))
        };
        match form.as_str() {
            "function" => {
                let direction = item(given, "direction")?.extract()?;
                let function = item(given, "function")?;
                match (function.cast::<TracedSystem>(), traced) {
                    (Ok(own), Some(_)) => {
                        let own = &own.get().system;
                        let node = *own
                            .field_nodes()
                            .first()
                            .ok_or_else(|| refused("section: no function"))?;
                        let expression = compiled(own.graph(), node)?;
                        Ok(PlaceSpec::Compiled(Arc::new(expression), direction))
                    }
                    (Ok(_), None) => Err(refused("section: the system is not traced")),
                    _ => Ok(PlaceSpec::Called(function.unbind(), direction)),
                }
            }
            "tangency" => {
                let direction = item(given, "direction")?.extract()?;
                let index: usize = item(given, "surface")?.extract()?;
                let signs: Vec<f64> = item(given, "signs")?.extract()?;
                let traced = traced.ok_or_else(|| refused("section: the system is not traced"))?;
                let own = &traced.get().system;
                let mut graph = own.graph().clone();
                // Those of surfaces that the user does not see follow from the discrete states.
                let signs: Vec<Option<f64>> = signs.into_iter().map(Some).collect();
                let h = graph.surface(index as u32);
                let h = graph.at_signs(&[h], &signs)[0];
                let field = graph.at_signs(own.field_nodes(), &signs);
                let rate = graph.directional(h, &field);
                Ok(PlaceSpec::Compiled(
                    Arc::new(compiled(&graph, rate)?),
                    direction,
                ))
            }
            "surface" => {
                let name: Option<String> = item(given, "kind")?.extract()?;
                let kind = match name {
                    Some(name) => Some(Kind::named(&name).ok_or_else(|| refused("section: kind"))?),
                    None => None,
                };
                Ok(PlaceSpec::Surface(
                    item(given, "surface")?.extract()?,
                    item(given, "direction")?.extract()?,
                    kind,
                ))
            }
            "ticks" => {
                let rows: PyReadonlyArray2<f64> = item(given, "clocks")?.extract()?;
                let rows = rows.as_array();
                let clocks = rows.rows().into_iter().map(|row| Clock {
                    period: row[0],
                    phase: row[1],
                });
                Ok(PlaceSpec::Ticks(clocks.collect()))
            }
            _ => Err(refused("section: unknown form")),
        }
    }
}

fn item<'py>(given: &Bound<'py, PyDict>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    given
        .get_item(name)?
        .ok_or_else(|| PyKeyError::new_err(name.to_owned()))
}

/// The kinds of warnings, in the order of their bits in the column `warnings` of a sweep.
#[pyfunction]
pub fn warning_codes() -> Vec<&'static str> {
    WarningCode::ALL.map(WarningCode::name).to_vec()
}

/// What the runs leave, in columns.
#[derive(Default)]
struct Points {
    n_states: usize,
    n_surfaces: usize,
    n_outputs: usize,
    /// The outputs at the ends of the runs, and at the returns.
    outputs_last: Vec<f64>,
    outputs: Vec<f64>,
    status: Vec<i8>,
    reason: Vec<&'static str>,
    message: Vec<String>,
    t_last: Vec<f64>,
    y_last: Vec<f64>,
    /// The discrete states at the last return, or at the end.
    memory_last: Vec<Vec<f64>>,
    n_steps: Vec<i64>,
    n_switches: Vec<i64>,
    n_warnings: Vec<i64>,
    /// Their kinds, a bit of each.
    warnings: Vec<i32>,
    n_returns: Vec<i64>,
    period: Vec<i64>,
    row_size: Vec<i64>,
    t: Vec<f64>,
    y: Vec<f64>,
    duration: Vec<f64>,
    sliding: Vec<f64>,
    n_pieces: Vec<i32>,
    modes: Vec<i8>,
    /// What ended the sweep before its end.
    raised: Option<PyErr>,
}

impl Points {
    fn new(n_states: usize, n_outputs: usize) -> Self {
        Points {
            n_states,
            n_outputs,
            ..Points::default()
        }
    }

    fn take(
        &mut self,
        py: Python<'_>,
        run: &PreparedRun,
        signals: &Signals,
        span: (f64, f64),
        outcome: Outcome,
    ) {
        self.n_surfaces = run.n_visible();
        let mut solution = match outcome {
            Ok(solution) => solution,
            Err(error) => {
                self.end(-1, "wrong_input", error.to_string());
                self.nothing(span.0);
                return;
            }
        };
        let error = take_error(&mut solution);
        let mut message = message_of(&**run.core(), &solution, run.n_visible());
        let (status, reason) = (solution.stop.status(), solution.stop.name());
        if matches!(solution.stop, Stop::Interrupted) {
            self.raised = Some(PyKeyboardInterrupt::new_err(()));
        }
        if let Some(error) = error {
            message = format!("{message} {error}");
            if !error.is_instance_of::<PyException>(py) {
                self.raised = Some(error);
            }
        }
        self.end(status, reason, message);
        self.t_last.push(solution.t_last);
        self.y_last.extend_from_slice(solution.last_state());
        let returns = solution.returns.take().unwrap_or_default();
        let last = returns.kept.last().map(|kept| kept.piece.as_deref());
        let last = last.map_or_else(
            || solution.last_piece().discrete,
            |piece| piece.map_or_else(Vec::new, |piece| piece.discrete.clone()),
        );
        self.memory_last.push(last);
        if self.n_outputs > 0 {
            let end = (solution.t_last, solution.last_state());
            let last = signals.values(run, solution.sliding, end, solution.last_piece());
            self.outputs_last.extend(last);
            for kept in &returns.kept {
                let at = (kept.t, &kept.y[..]);
                let piece = kept.piece.as_deref().cloned().unwrap_or_default();
                let values = signals.values(run, solution.sliding, at, piece);
                self.outputs.extend(values);
            }
        }
        let stats = &solution.stats;
        self.count(stats.n_steps as i64, stats.n_switches as i64);
        self.note_warnings(&solution.warnings);
        self.returns(&returns);
    }

    /// A run that was not begun.
    fn leave_out(&mut self, t0: f64) {
        self.end(-1, "not_run", "Not run: the sweep was interrupted.".into());
        self.nothing(t0);
    }

    fn nothing(&mut self, t0: f64) {
        self.t_last.push(t0);
        self.memory_last.push(Vec::new());
        self.y_last
            .resize(self.y_last.len() + self.n_states, f64::NAN);
        self.outputs_last
            .resize(self.outputs_last.len() + self.n_outputs, f64::NAN);
        self.count(0, 0);
        self.note_warnings(&[]);
        self.returns(&Returns::default());
    }

    fn end(&mut self, status: i32, reason: &'static str, message: String) {
        self.status.push(status as i8);
        self.reason.push(reason);
        self.message.push(message);
    }

    fn count(&mut self, n_steps: i64, n_switches: i64) {
        self.n_steps.push(n_steps);
        self.n_switches.push(n_switches);
    }

    fn note_warnings(&mut self, warnings: &[Warning]) {
        self.n_warnings.push(warnings.len() as i64);
        let kinds = warnings.iter().map(|warning| warning.code.bit());
        self.warnings.push(kinds.fold(0, |all, bit| all | bit));
    }

    fn returns(&mut self, returns: &Returns) {
        self.n_returns.push(returns.count as i64);
        self.period.push(returns.period as i64);
        self.row_size.push(returns.kept.len() as i64);
        for kept in &returns.kept {
            self.t.push(kept.t);
            self.y.extend_from_slice(&kept.y);
            self.duration.push(kept.duration);
            self.sliding.push(kept.sliding);
            self.n_pieces.push(kept.modes.len() as i32);
            let entries = kept.modes.iter();
            let entries = entries.flat_map(|mode| &mode.entries()[..self.n_surfaces]);
            self.modes.extend(entries);
        }
    }

    fn into_dict(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let dict = PyDict::new(py);
        let n_kept = self.t.len();
        let n_pieces: i64 = self.n_pieces.iter().map(|&n| i64::from(n)).sum();
        let n_points = self.status.len();
        let table = |values: Vec<f64>, rows: usize, columns: usize| {
            PyArray1::from_vec(py, values).reshape([rows, columns])
        };
        dict.set_item("y_last", table(self.y_last, n_points, self.n_states)?)?;
        dict.set_item("memory_last", self.memory_last)?;
        dict.set_item("y", table(self.y, n_kept, self.n_states)?)?;
        let outputs_last = table(self.outputs_last, n_points, self.n_outputs)?;
        dict.set_item("outputs_last", outputs_last)?;
        dict.set_item("outputs", table(self.outputs, n_kept, self.n_outputs)?)?;
        let modes = PyArray1::from_vec(py, self.modes);
        dict.set_item(
            "modes",
            modes.reshape([n_pieces as usize, self.n_surfaces])?,
        )?;
        let raised = self.raised.map(|raised| raised.into_value(py));
        dict.set_item("raised", raised)?;
        dict.set_item("status", PyArray1::from_vec(py, self.status))?;
        dict.set_item("reason", self.reason)?;
        dict.set_item("message", self.message)?;
        dict.set_item("t_last", PyArray1::from_vec(py, self.t_last))?;
        dict.set_item("n_steps", PyArray1::from_vec(py, self.n_steps))?;
        dict.set_item("n_switches", PyArray1::from_vec(py, self.n_switches))?;
        dict.set_item("n_warnings", PyArray1::from_vec(py, self.n_warnings))?;
        dict.set_item("warnings", PyArray1::from_vec(py, self.warnings))?;
        dict.set_item("n_returns", PyArray1::from_vec(py, self.n_returns))?;
        dict.set_item("period", PyArray1::from_vec(py, self.period))?;
        dict.set_item("row_size", PyArray1::from_vec(py, self.row_size))?;
        dict.set_item("t", PyArray1::from_vec(py, self.t))?;
        dict.set_item("duration", PyArray1::from_vec(py, self.duration))?;
        dict.set_item("sliding", PyArray1::from_vec(py, self.sliding))?;
        dict.set_item("n_pieces", PyArray1::from_vec(py, self.n_pieces))?;
        Ok(dict)
    }
}
