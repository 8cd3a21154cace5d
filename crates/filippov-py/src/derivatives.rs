//! Derivatives of a run by what a user names.

use std::sync::Arc;

use filippov::derivative::{
    Borders, Column, Derivatives, Differentiated, DifferentiatedRun, EventGradient, Extension,
    OneSided, Tangents, Term, Trail, WayBack, When,
};
use filippov::{Error, FieldError, Options, Problem, Reached, ReplayError, Side, Solution};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::itineraries::{instant_row, TrailRows};
use crate::prepared_run::PreparedRun;
use crate::systems::{raised, refused};

/// The columns, each a kind (0: a component of the initial state, 1: the initial time, 2: a parameter) with a place; the parameters by
/// which is differentiated; the order of the derivatives, 0 where the run is kept for gradients of costs instead; and how many bytes
/// of memory its record may need then.
pub type Wanted = (Vec<(u8, usize)>, Vec<usize>, u8, Option<usize>);

/// Time, derivative of the time, saltation matrix, its part by parameters, condition, why derivatives end there, the matrices by
/// sides, the coefficient of a square root, and the second derivatives of the time.
pub type InstantRow<'py> = (
    f64,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    f64,
    &'static str,
    Vec<SideRow<'py>>,
    Option<Bound<'py, PyArray1<f64>>>,
    Option<Bound<'py, PyArray1<f64>>>,
);

/// The surfaces in their order, the saltation matrix, and its part by parameters.
pub type SideRow<'py> = (
    Vec<usize>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

/// The surfaces on which a run starts; the time of an action that puts it on surfaces, and these; is an action done at the initial
/// time, does a clock tick there, is a law at its threshold, from which time does a multiplier stay at its end, at
/// which time is an action where its map has sides, and does the run end at an instant that moves?
pub type BordersRow = (
    Vec<usize>,
    Option<(f64, Vec<usize>)>,
    bool,
    bool,
    bool,
    Option<f64>,
    Option<f64>,
    bool,
);

/// The same, for Python.
pub fn borders_row(borders: &Borders) -> BordersRow {
    (
        borders.starts_on.clone(),
        borders.lands_on.clone(),
        borders.starts_at_action,
        borders.starts_at_tick,
        borders.starts_at_threshold,
        borders.stays_at_end,
        borders.acts_at_sides,
        borders.ends_at_instant,
    )
}

/// The derivatives of a run, or what they need on the way back; and what they are continued with between steps.
pub struct RunDerivatives {
    found: Derivatives,
    trail: Option<Trail>,
    kinds: Vec<Column>,
    parameters: Vec<usize>,
    extension: Arc<Extension>,
    options: Options,
    t_span: (f64, f64),
    /// How many bytes the record of a run that is kept for gradients may need.
    memory: usize,
    /// How many rows a column has: the states, and the named discrete states behind them.
    n: usize,
}

/// A term of a cost: the function, the time at which it counts, or else the surface at whose switches it does, or neither for the
/// end; and the function whose zero is at that time, if one is.
pub type TermRow<'py> = (
    Bound<'py, crate::systems::TracedSystem>,
    Option<f64>,
    Option<usize>,
    Option<Bound<'py, crate::systems::TracedSystem>>,
);

/// Runs a traced system, and follows its derivatives.
pub fn run_with_derivatives(
    problem: Problem<'_>,
    (system, extension, actions): (
        &filippov::TracedSystem,
        &Arc<Extension>,
        &filippov::action::Actions<'_>,
    ),
    options: &Options,
    t_span: (f64, f64),
    (kinds, parameters, order, memory): &Wanted,
    interrupt: &mut dyn FnMut(Reached) -> bool,
) -> Result<(Solution, RunDerivatives), Failure> {
    let kinds: Vec<Column> = kinds
        .iter()
        .map(|&(kind, place)| column(kind, place))
        .collect();
    let extended = extension.at(system.parameters(), actions)?;
    let extended = extended.ok_or(Failure::CalledMap)?;
    let impacts = extended.impacts();
    let memory = memory.unwrap_or(usize::MAX);
    let (solution, found, trail) = if *order == 0 {
        let trail = Trail::of(&extended);
        let (solution, trail) = problem.solve_with_trail(trail, memory, interrupt)?;
        (solution, Derivatives::default(), Some(trail))
    } else {
        let span = t_span.1 - t_span.0;
        let mut tangents = Tangents::new(&extended, &impacts, kinds.clone(), options, span);
        if *order == 2 {
            tangents = tangents.with_second();
        }
        let solution = problem.solve_observed(&mut tangents, interrupt)?;
        (solution, tangents.finish()?, None)
    };
    Ok((
        solution,
        RunDerivatives {
            found,
            trail,
            t_span,
            memory,
            n: extended.n_rows(),
            kinds,
            parameters: parameters.clone(),
            extension: Arc::clone(extension),
            options: options.clone(),
        },
    ))
}

/// Why there are no derivatives.
#[derive(Debug)]
pub enum Failure {
    /// The arguments of the run are wrong.
    Refused(Error),
    /// A function raised.
    Raised(FieldError),
    /// The map of a reset is called, not traced.
    CalledMap,
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Failure::Refused(error)
    }
}

impl From<FieldError> for Failure {
    fn from(error: FieldError) -> Self {
        Failure::Raised(error)
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Refused(error) => refused(error),
            Failure::Raised(error) => raised(error),
            Failure::CalledMap => PyValueError::new_err("wrt: the map of a reset is not traced"),
        }
    }
}

fn unknown(t: f64) -> PyErr {
    PyValueError::new_err(format!("t = {t} has no derivative here"))
}

fn column(kind: u8, place: usize) -> Column {
    match kind {
        0 => Column::State(place),
        1 => Column::Start,
        _ => Column::Parameter(place),
    }
}

/// The time at which there is no derivative, and why.
pub type LostAt = (f64, &'static str);

/// The gradient by the columns, where and why there is none, where it is that of one side, and where terms count: the term, the time
/// and the state before.
type GradientRow = (
    Vec<f64>,
    Option<LostAt>,
    BordersRow,
    Vec<(usize, f64, Vec<f64>, (f64, bool))>,
);

/// What a run computed, and its actions.
type RunOf<'r> = (&'r Solution, &'r filippov::action::Actions<'r>);

impl RunDerivatives {
    /// The derivative of the state at these times, n rows of one entry per column for each; NaN if the run took no step.
    pub fn at<'py>(
        &self,
        py: Python<'py>,
        system: &filippov::TracedSystem,
        (solution, actions): RunOf<'_>,
        (times, side): (&[f64], Side),
    ) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let n = self.n;
        if self.found.t.is_empty() {
            return Ok(times.iter().map(|_| self.not_known(py)).collect());
        }
        self.with(system, (solution, actions), |run| {
            let at = |&t: &f64| {
                let values = run.at(t, side).map_err(raised)?;
                let values = values.ok_or_else(|| unknown(t))?;
                Ok(transposed(py, &values, self.kinds.len(), n))
            };
            times.iter().map(at).collect()
        })
    }

    /// The mixed second derivatives at these times, for each those of the state by every pair of columns (a, b) with b <= a.
    pub fn second_at<'py>(
        &self,
        py: Python<'py>,
        system: &filippov::TracedSystem,
        run: RunOf<'_>,
        (times, side): (&[f64], Side),
    ) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let n = self.n;
        let n_pairs = self.kinds.len() * (self.kinds.len() + 1) / 2;
        self.with(system, run, |run| {
            let at = |&t: &f64| {
                let values = run.second_at(t, side).map_err(raised)?;
                let values = values.unwrap_or_else(|| vec![f64::NAN; n * n_pairs]);
                Ok(transposed(py, &values, n_pairs, n))
            };
            times.iter().map(at).collect()
        })
    }

    /// The same at the end of the run.
    pub fn second_at_end<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let n = self.n;
        let n_pairs = self.kinds.len() * (self.kinds.len() + 1) / 2;
        let last = self.found.second.len().checked_sub(n * n_pairs);
        let known = last.map(|last| &self.found.second[last..]);
        let unknown = vec![f64::NAN; n * n_pairs];
        transposed(py, known.unwrap_or(&unknown), n_pairs, n)
    }

    /// From when on second derivatives are not known, why, and whether those of some columns are.
    pub fn second_lost(&self) -> Vec<(f64, &'static str, bool)> {
        let lost = self.found.second_lost.iter();
        lost.map(|lost| (lost.t, lost.why.name(), lost.n_known > 0))
            .collect()
    }

    /// The derivatives of the times of zeros of a function, the first component of a system: a row for each.
    pub fn of_zeros(
        &self,
        system: &filippov::TracedSystem,
        run: RunOf<'_>,
        function: &filippov::TracedSystem,
        times: &[f64],
    ) -> PyResult<Vec<Vec<f64>>> {
        let gradient = EventGradient::new(function, self.extension.rules(), &self.parameters);
        let gradient = gradient.map_err(|e| PyValueError::new_err(e.to_string()))?;
        self.with(system, run, |run| {
            let of_zero = |&t: &f64| {
                let found = run.time_of_zero(&gradient, t).map_err(raised)?;
                found.ok_or_else(|| unknown(t))
            };
            times.iter().map(of_zero).collect()
        })
    }

    fn with<R>(
        &self,
        system: &filippov::TracedSystem,
        (solution, actions): RunOf<'_>,
        ask: impl FnOnce(&mut Differentiated) -> PyResult<R>,
    ) -> PyResult<R> {
        let extended = self.extension.at(system.parameters(), actions);
        let extended = extended.map_err(|e| PyValueError::new_err(e.to_string()))?;
        let extended = extended.ok_or_else(|| PyValueError::new_err("maps that are not traced"))?;
        let impacts = extended.impacts();
        ask(&mut Differentiated::new(DifferentiatedRun {
            solution,
            found: &self.found,
            kinds: &self.kinds,
            systems: (system, &extended),
            impacts: &impacts,
            options: &self.options,
        }))
    }

    /// Was the record of the run too large, so that gradients repeat it?
    pub fn is_to_repeat(&self) -> bool {
        self.trail.as_ref().is_some_and(Trail::is_closed)
    }

    /// The gradient of a sum of terms, an entry for each column; where and why there is none, if so; the surfaces that the run
    /// starts on and leaves; and where terms at instants count. A run whose record was too large is repeated.
    pub fn gradient(
        &self,
        py: Python<'_>,
        system: &filippov::TracedSystem,
        (solution, actions): RunOf<'_>,
        (prepared, terms): (&PreparedRun, &[TermRow<'_>]),
    ) -> PyResult<GradientRow> {
        let wrong = |e: Error| PyValueError::new_err(e.to_string());
        let trail = self.trail.as_ref();
        let trail = trail.ok_or_else(|| PyValueError::new_err("the run has no trail"))?;
        let extended = self.extension.at(system.parameters(), actions);
        let extended = extended.map_err(wrong)?;
        let extended = extended.ok_or_else(|| PyValueError::new_err("maps that are not traced"))?;
        let gradient_of = |function: &Bound<'_, crate::systems::TracedSystem>| {
            let function = function.get().with(system.parameters());
            EventGradient::new(&function, self.extension.rules(), &self.parameters)
        };
        let mut functions = Vec::with_capacity(terms.len());
        for (cost, _, _, zero) in terms {
            let zero = zero.as_ref().map(gradient_of).transpose().map_err(wrong)?;
            functions.push((gradient_of(cost).map_err(wrong)?, zero));
        }
        let rows = terms.iter().zip(&functions);
        let terms: Vec<Term> = rows
            .map(|((_, t, surface, _), (cost, zero))| Term {
                cost,
                at: match (t, surface, zero) {
                    (Some(t), _, Some(zero)) => When::Zero(*t, zero),
                    (Some(t), _, None) => When::Time(*t),
                    (None, Some(surface), _) => When::Surface(*surface),
                    (None, None, zero) => When::End(zero.as_ref()),
                },
            })
            .collect();
        let impacts = extended.impacts();
        let way = WayBack {
            systems: (system, &extended),
            impacts: &impacts,
            kinds: &self.kinds,
            options: &self.options,
            t_span: self.t_span,
        };
        let found = if trail.is_closed() {
            let options = Options {
                max_wall_time: None,
                ..self.options.clone()
            };
            let events = prepared.user_events();
            let problem = prepared.problem(system, self.t_span, (&options, &events, actions));
            let mut signal = None;
            let mut interrupt = |_: Reached| {
                signal = py.check_signals().err();
                signal.is_some()
            };
            let kept = (solution, self.memory);
            let of = (&way, Trail::of(&extended), &terms[..]);
            let found = problem.gradient_within(kept, of, &mut interrupt);
            found.map_err(|error| signal.take().unwrap_or_else(|| not_repeated(error)))?
        } else {
            way.gradient((solution, trail), &terms).map_err(raised)?
        };
        let entries = self.kinds.iter().map(|&kind| found.by(kind)).collect();
        let points = found.points.into_iter();
        let points = points
            .map(|point| (point.term, point.t, point.x, (point.value, point.has_sides)))
            .collect();
        Ok((entries, found.lost, borders_row(&found.borders), points))
    }

    /// The derivative of the state at the end; NaN if the run took no step.
    pub fn at_end<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let size = self.n * self.kinds.len();
        match self.found.values.len().checked_sub(size) {
            Some(last) => transposed(py, &self.found.values[last..], self.kinds.len(), self.n),
            None => self.not_known(py),
        }
    }

    fn not_known<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let k = self.kinds.len();
        transposed(py, &vec![f64::NAN; self.n * k], k, self.n)
    }

    /// The mode and the discrete states at the start of a run that was kept for the way back, and its instants.
    pub fn trail_rows<'py>(&self, py: Python<'py>) -> Option<TrailRows<'py>> {
        let trail = self.trail.as_ref()?;
        let (mode, q) = trail.first()?;
        let rows = trail.instants().map(|record| instant_row(py, &record));
        Some((mode.entries().to_vec(), q.to_vec(), rows.collect()))
    }

    /// Where the derivatives are those of one side.
    pub fn borders(&self) -> &Borders {
        &self.found.borders
    }

    /// Where derivatives end, and why.
    pub fn lost(&self) -> Option<(f64, &'static str)> {
        self.found.lost.map(|(t, lost)| (t, lost.name()))
    }

    /// The derivatives of all instants.
    pub fn instants<'py>(&self, py: Python<'py>) -> Vec<InstantRow<'py>> {
        let (n, m) = (self.n, self.parameters.len());
        let rows = |values: &[f64], width: usize| {
            let rows: Vec<Vec<f64>> = (0..n)
                .map(|r| values[r * width..(r + 1) * width].to_vec())
                .collect();
            PyArray2::from_vec2(py, &rows)
                .unwrap_or_else(|_| PyArray2::zeros(py, [n, width], false))
        };
        let instants = self.found.instants.iter();
        instants
            .map(|found| {
                let root = !found.square_root.is_empty();
                let bends = !found.second_dt.is_empty();
                let side = |side: &OneSided| {
                    let order = side.order.clone();
                    (
                        order,
                        rows(&side.saltation, n),
                        rows(&side.by_parameters, m),
                    )
                };
                (
                    found.t,
                    PyArray1::from_slice(py, &found.dt),
                    rows(&found.saltation, n),
                    rows(&found.by_parameters, m),
                    found.condition,
                    found.lost.map_or("", filippov::derivative::Lost::name),
                    found.sides.iter().map(side).collect(),
                    root.then(|| PyArray1::from_slice(py, &found.square_root)),
                    bends.then(|| PyArray1::from_slice(py, &found.second_dt)),
                )
            })
            .collect()
    }
}

/// Why there is no gradient of a run that was to be repeated.
fn not_repeated(error: ReplayError) -> PyErr {
    match error {
        ReplayError::Raised(error) => raised(error),
        ReplayError::Refused(error) => refused(error),
        ReplayError::TooSmall(needed) => PyValueError::new_err(format!(
            "memory: this run needs at least {needed} bytes to be repeated piece by piece"
        )),
        ReplayError::Interrupted => PyRuntimeError::new_err("the run was interrupted"),
        ReplayError::Differs => PyRuntimeError::new_err(
            "memory: the run was repeated and took other steps: does one of its functions keep a state of its own?",
        ),
    }
}

/// Columns of n states that stand one after the other, as an array of n rows.
fn transposed<'py>(
    py: Python<'py>,
    values: &[f64],
    k: usize,
    n: usize,
) -> Bound<'py, PyArray2<f64>> {
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|r| (0..k).map(|c| values[c * n + r]).collect())
        .collect();
    let empty = || PyArray2::zeros(py, [n, k], false);
    PyArray2::from_vec2(py, &rows).unwrap_or_else(|_| empty())
}
