//! What a run computed, as a Python object.

use std::sync::{Mutex, PoisonError};

use filippov::{
    as_multiplier, message_of, not_finite, Held, Method, Mode, Segment, Side, Solution, Stats, Stop,
};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::callbacks::{Signal, TracedEvent};
use crate::conversion::columns;
use crate::decisions::record_as_pair;
use crate::derivatives::{borders_row, BordersRow, InstantRow, LostAt, RunDerivatives, TermRow};
use crate::itineraries::TrailRows;
use crate::prepared_run::PreparedRun;
use crate::systems::{raised, CoreSystem, TracedSystem};

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type SwitchRow<'py> = (
    f64,
    Vector<'py>,
    Vector<'py>,
    &'static str,
    Bound<'py, PyTuple>,
    Bound<'py, PyTuple>,
    Bound<'py, PyTuple>,
    String,
    &'static str,
    bool,
);
type SegmentRow<'py> = (
    f64,
    f64,
    Bound<'py, PyTuple>,
    usize,
    usize,
    Vector<'py>,
    Vector<'py>,
);

type GradientRow<'py> = (
    Vector<'py>,
    Option<LostAt>,
    BordersRow,
    Vec<(usize, f64, Vector<'py>, (f64, bool))>,
);

type DecisionRow<'py> = (Bound<'py, PyDict>, Bound<'py, PyDict>);

type WarningRow<'py> = (
    f64,
    &'static str,
    String,
    Vec<Bound<'py, PyTuple>>,
    Vec<usize>,
    &'static str,
);

/// What a run computed.
#[pyclass(frozen, module = "filippov._core")]
pub struct Run {
    /// What was run: evaluations ask it for the forces of its contacts.
    prepared: PreparedRun,
    solution: Mutex<Solution>,
    error: Option<PyErr>,
    /// The surfaces that a user sees are the first so many.
    n_visible: usize,
    derivatives: Option<Box<RunDerivatives>>,
}

impl Run {
    pub fn new(
        prepared: PreparedRun,
        mut solution: Solution,
        derivatives: Option<RunDerivatives>,
    ) -> Self {
        let error = take_error(&mut solution);
        Run {
            n_visible: prepared.n_visible(),
            prepared,
            solution: Mutex::new(solution),
            error,
            derivatives: derivatives.map(Box::new),
        }
    }

    fn system(&self) -> &CoreSystem {
        self.prepared.core()
    }

    fn solution(&self) -> std::sync::MutexGuard<'_, Solution> {
        self.solution.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Did the caller stop it?
    pub fn was_interrupted(&self) -> bool {
        matches!(self.solution().stop, Stop::Interrupted)
    }

    /// The last time reached.
    pub fn last_time(&self) -> f64 {
        self.solution().t_last
    }

    /// The state there.
    pub fn last_state(&self) -> Vec<f64> {
        self.solution().last_state().to_vec()
    }

    /// How it ended.
    pub fn status_code(&self) -> i32 {
        self.solution().stop.status()
    }

    /// How many warnings it has.
    pub fn count_warnings(&self) -> usize {
        self.solution().warnings.len()
    }

    /// A mode as a user sees it.
    fn mode<'py>(&self, py: Python<'py>, mode: &Mode) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &mode.entries()[..self.n_visible])
    }

    fn modes<'py>(&self, py: Python<'py>, modes: &[Mode]) -> PyResult<Vec<Bound<'py, PyTuple>>> {
        modes.iter().map(|mode| self.mode(py, mode)).collect()
    }

    /// The accelerations that contacts give, one per surface that a user sees.
    fn contact_row(&self, held: &Held) -> Vec<f64> {
        let mut row = vec![0.0; self.n_visible];
        for &(j, value) in &held.contacts {
            if let Some(entry) = row.get_mut(j) {
                *entry = value;
            }
        }
        row
    }

    /// The multiplier vector at a time; NaN for surfaces not slid on.
    fn multiplier_vector(&self, solution: &Solution, t: f64, side: Side) -> PyResult<Vec<f64>> {
        let mut out = vec![f64::NAN; self.n_visible];
        let actions = self.prepared.actions();
        let held = solution.held(&**self.system(), &actions, t, side);
        let values = held.map_err(raised)?.multipliers;
        for (j, value) in values.into_iter().filter(|(j, _)| *j < self.n_visible) {
            out[j] = value;
        }
        Ok(out)
    }

    fn multipliers_at_ends(
        &self,
        solution: &Solution,
        segment: &Segment,
    ) -> PyResult<(Vec<f64>, Vec<f64>)> {
        if segment.t_end > segment.t_start {
            return Ok((
                self.multiplier_vector(solution, segment.t_start, Side::Right)?,
                self.multiplier_vector(solution, segment.t_end, Side::Left)?,
            ));
        }
        // A segment without duration is not what the limits of the solution at its time belong to.
        let mut out = vec![f64::NAN; self.n_visible];
        let values = segment.mode.sliding_set().zip(&segment.multipliers);
        for (j, &value) in values.filter(|(j, _)| *j < self.n_visible) {
            out[j] = as_multiplier(value);
        }
        Ok((out.clone(), out))
    }
}

/// Takes the exception of a user's function out of a solution; Ctrl-C in there is an interruption like any other.
pub fn take_error(solution: &mut Solution) -> Option<PyErr> {
    let Stop::FieldRaised(payload) = &mut solution.stop else {
        return None;
    };
    let error = raised(std::mem::replace(payload, filippov::FieldError::new(())));
    if Python::attach(|py| error.is_instance_of::<PyKeyboardInterrupt>(py)) {
        solution.stop = Stop::Interrupted;
        return None;
    }
    Some(error)
}

/// Was a run ended by Ctrl-C in a function of the user?
pub fn is_interruption(solution: &Solution) -> bool {
    let Stop::FieldRaised(error) = &solution.stop else {
        return false;
    };
    let raised = error.0.downcast_ref::<PyErr>();
    raised.is_some_and(|e| Python::attach(|py| e.is_instance_of::<PyKeyboardInterrupt>(py)))
}

#[pymethods]
impl Run {
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Vector<'py> {
        PyArray1::from_slice(py, &self.solution().t)
    }

    #[getter]
    fn y<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let solution = self.solution();
        columns(py, &solution.y, solution.n_states)
    }

    /// The last time reached.
    #[getter]
    fn t_last(&self) -> f64 {
        self.solution().t_last
    }

    /// The state there.
    #[getter]
    fn y_last<'py>(&self, py: Python<'py>) -> Vector<'py> {
        PyArray1::from_slice(py, self.solution().last_state())
    }

    /// The mode at the end.
    #[getter]
    fn mode_last<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        self.mode(py, &self.solution().mode)
    }

    /// How many switches there are.
    #[getter]
    fn n_switches(&self) -> usize {
        self.solution().switches_of_first(self.n_visible).count()
    }

    /// Their times.
    #[getter]
    fn switch_times<'py>(&self, py: Python<'py>) -> Vector<'py> {
        let solution = self.solution();
        let times = solution.switches_of_first(self.n_visible).map(|s| s.t);
        PyArray1::from_vec(py, times.collect())
    }

    #[getter]
    fn switches<'py>(&self, py: Python<'py>) -> PyResult<Vec<SwitchRow<'py>>> {
        let solution = self.solution();
        solution
            .switches_of_first(self.n_visible)
            .map(|s| {
                let visible = s.surfaces.iter().filter(|&&j| j < self.n_visible);
                let visible: Vec<usize> = visible.copied().collect();
                Ok((
                    s.t,
                    PyArray1::from_slice(py, &s.y_before),
                    PyArray1::from_slice(py, &s.y_after),
                    s.kind.name(),
                    PyTuple::new(py, visible)?,
                    self.mode(py, &s.mode_before)?,
                    self.mode(py, &s.mode_after)?,
                    s.note.clone(),
                    s.rule,
                    solution.is_kink(&**self.system(), &s).map_err(raised)?,
                ))
            })
            .collect()
    }

    /// How many segments there are.
    #[getter]
    fn n_segments(&self) -> usize {
        self.solution().segments.len()
    }

    /// The times at which they begin, and those at which they end.
    #[getter]
    fn segment_times<'py>(&self, py: Python<'py>) -> (Vector<'py>, Vector<'py>) {
        let solution = self.solution();
        let segments = || solution.segments.iter();
        let starts = segments().map(|s| s.t_start).collect();
        let ends = segments().map(|s| s.t_end).collect();
        (PyArray1::from_vec(py, starts), PyArray1::from_vec(py, ends))
    }

    #[getter]
    fn segments<'py>(&self, py: Python<'py>) -> PyResult<Vec<SegmentRow<'py>>> {
        let solution = self.solution();
        solution
            .segments
            .iter()
            .map(|s| {
                let (start, end) = self.multipliers_at_ends(&solution, &s)?;
                Ok((
                    s.t_start,
                    s.t_end,
                    self.mode(py, &s.mode)?,
                    s.steps.0,
                    s.steps.1,
                    PyArray1::from_vec(py, start),
                    PyArray1::from_vec(py, end),
                ))
            })
            .collect()
    }

    #[getter]
    fn t_events<'py>(&self, py: Python<'py>) -> Vec<Vector<'py>> {
        let times = |zeros: &Vec<filippov::UserZero>| zeros.iter().map(|z| z.t).collect();
        self.solution()
            .user_zeros
            .iter()
            .map(|z| PyArray1::from_vec(py, times(z)))
            .collect()
    }

    #[getter]
    fn y_events<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let solution = self.solution();
        solution
            .user_zeros
            .iter()
            .map(|zeros| {
                if zeros.is_empty() {
                    return Ok(PyArray2::zeros(py, [0, solution.n_states], false));
                }
                let rows: Vec<Vec<f64>> = zeros.iter().map(|z| z.y.clone()).collect();
                PyArray2::from_vec2(py, &rows).map_err(|e| PyValueError::new_err(e.to_string()))
            })
            .collect()
    }

    #[getter]
    fn status(&self) -> i32 {
        self.solution().stop.status()
    }

    #[getter]
    fn reason(&self) -> &'static str {
        self.solution().stop.name()
    }

    #[getter]
    fn message(&self) -> String {
        message_of(&**self.system(), &self.solution(), self.n_visible)
    }

    /// Time and state where the field is not finite, if the run ended there.
    #[getter]
    fn not_finite<'py>(&self, py: Python<'py>) -> Option<(f64, Vector<'py>)> {
        let solution = self.solution();
        if !matches!(solution.stop, Stop::NotFinite) {
            return None;
        }
        let end = solution.last_state();
        let (t, q) = (solution.t_last, &solution.discrete);
        let place = not_finite(&**self.system(), t, end, q, &solution.mode)?;
        Some((place.t, PyArray1::from_vec(py, place.x)))
    }

    #[getter]
    fn error(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.error
            .as_ref()
            .map(|e| e.clone_ref(py).into_value(py).into_any())
    }

    #[getter]
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let stats = self.solution().stats;
        let dict = PyDict::new(py);
        dict.set_item("method", methods(&stats))?;
        for method in Method::ALL.into_iter().filter(|m| *m != Method::Auto) {
            let key = format!("n_steps_{}", method.name().to_lowercase());
            dict.set_item(key, stats.n_steps_of(method))?;
        }
        if let Some(since) = stats.stiff_since {
            dict.set_item("stiff_since", since)?;
        }
        dict.set_item("native", self.prepared.is_native())?;
        dict.set_item("nfev", stats.n_field_evaluations)?;
        dict.set_item("njev", stats.n_jacobians)?;
        dict.set_item("nlu", stats.n_factorisations)?;
        dict.set_item("n_surface_evaluations", stats.n_surface_evaluations)?;
        dict.set_item("n_steps", stats.n_steps)?;
        dict.set_item("n_rejected", stats.n_rejected)?;
        dict.set_item("n_steps_sliding", stats.n_steps_sliding)?;
        dict.set_item("n_rejected_sliding", stats.n_rejected_sliding)?;
        dict.set_item("n_extensions", stats.n_extensions)?;
        dict.set_item("n_events", stats.n_events)?;
        Ok(dict)
    }

    #[getter]
    fn n_warnings(&self) -> usize {
        self.solution().warnings.len()
    }

    #[getter]
    fn warnings<'py>(&self, py: Python<'py>) -> PyResult<Vec<WarningRow<'py>>> {
        self.solution()
            .warnings
            .iter()
            .map(|w| {
                let candidates = self.modes(py, &w.candidates)?;
                let surfaces = w.surfaces.clone();
                Ok((
                    w.t,
                    w.code.name(),
                    w.text.clone(),
                    candidates,
                    surfaces,
                    w.rule,
                ))
            })
            .collect()
    }

    /// What was asked and what was decided, of as many decisions as the option `keep_decisions` names.
    fn decisions<'py>(&self, py: Python<'py>) -> PyResult<Vec<DecisionRow<'py>>> {
        let solution = self.solution();
        let records = solution.decisions.iter();
        records.map(|record| record_as_pair(py, record)).collect()
    }

    /// The continuations where the run ended at a non-unique point; else empty.
    #[getter]
    fn candidates<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyTuple>>> {
        match &self.solution().stop {
            Stop::NonUnique { candidates, .. } => self.modes(py, candidates),
            _ => Ok(Vec::new()),
        }
    }

    /// States at the times `t`, shape (n_states, len(t)).
    #[pyo3(signature = (t, left=false))]
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, f64>,
        left: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let solution = self.solution();
        let n = solution.n_states;
        let times = t.as_slice()?;
        let mut out = vec![0.0; n * times.len()];
        for (&t, y) in times.iter().zip(out.chunks_exact_mut(n)) {
            let found = solution.evaluate(&**self.system(), t, side_of(left), y);
            found
                .map_err(raised)?
                .ok_or_else(|| outside(&solution, t))?;
        }
        Ok(columns(py, &out, n))
    }

    /// Derivatives in time of the continuous extension at the times `t`, shape (n, len(t)).
    fn rates<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, f64>,
        left: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let solution = self.solution();
        let n = solution.n_states;
        let times = t.as_slice()?;
        let mut out = vec![0.0; n * times.len()];
        for (&t, dy) in times.iter().zip(out.chunks_exact_mut(n)) {
            let known = solution.rate(t, side_of(left), dy);
            known.ok_or_else(|| outside(&solution, t))?;
        }
        Ok(columns(py, &out, n))
    }

    /// An expression along the solution, at the times `t`: while sliding the combination of its values on the sides of the
    /// surfaces, by their multipliers. Behind the states it reads the accelerations that the contacts at these surfaces give.
    fn signal<'py>(
        &self,
        py: Python<'py>,
        expression: &TracedEvent,
        t: PyReadonlyArray1<'py, f64>,
        p: PyReadonlyArray1<'py, f64>,
        left: bool,
        contacts: Vec<usize>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (solution, side) = (self.solution(), side_of(left));
        let (system, actions) = (&**self.system(), self.prepared.actions());
        let mut y = vec![0.0; solution.n_states];
        let (mut velocity, mut out) = (y.clone(), Vec::new());
        for &t in t.as_slice()? {
            let found = solution.evaluate(system, t, side, &mut y).map_err(raised)?;
            found.ok_or_else(|| outside(&solution, t))?;
            let rate = solution.rate(t, side, &mut velocity);
            let piece = solution.piece_at(system, t, side).map_err(raised)?;
            let mut piece = piece.unwrap_or_default();
            let followed = self.prepared.follow_idle(&mut piece, (t, &y));
            followed.map_err(raised)?;
            let held = piece.held(system, &actions, solution.sliding, (t, &y));
            let signal = Signal {
                expression: &expression.expression,
                velocity: rate.map(|()| &velocity[..]),
                side,
                contacts: &contacts,
            };
            out.push(signal.value((t, &y), p.as_slice()?, &piece, &held.map_err(raised)?));
        }
        Ok(PyArray1::from_vec(py, out))
    }

    /// The expression at the end of the run, which needs no continuous extension.
    fn signal_at_end(
        &self,
        expression: &TracedEvent,
        p: PyReadonlyArray1<'_, f64>,
        contacts: Vec<usize>,
    ) -> PyResult<f64> {
        let solution = self.solution();
        let mut piece = solution.last_piece();
        let at = (solution.t_last, solution.last_state());
        let followed = self.prepared.follow_idle(&mut piece, at);
        followed.map_err(raised)?;
        let actions = self.prepared.actions();
        let held = piece.held(&**self.system(), &actions, solution.sliding, at);
        let velocity = self.prepared.velocity_in_region(&piece, at);
        let signal = Signal {
            expression: &expression.expression,
            velocity: velocity.as_deref(),
            side: Side::Right,
            contacts: &contacts,
        };
        Ok(signal.value(at, p.as_slice()?, &piece, &held.map_err(raised)?))
    }

    /// The accelerations of the switching functions that contacts give at the times `t`, shape (n_surfaces, len(t)); 0 without
    /// contact.
    fn contacts<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, f64>,
        left: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (solution, side) = (self.solution(), side_of(left));
        let actions = self.prepared.actions();
        let mut out = Vec::new();
        for &t in t.as_slice()? {
            let held = solution.held(&**self.system(), &actions, t, side);
            out.extend(self.contact_row(&held.map_err(raised)?));
        }
        Ok(columns(py, &out, self.n_visible))
    }

    /// The same at the end of the run, which needs no continuous extension.
    fn contacts_at_end<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        let solution = self.solution();
        let (piece, actions) = (solution.last_piece(), self.prepared.actions());
        let at = (solution.t_last, solution.last_state());
        let held = piece.held(&**self.system(), &actions, solution.sliding, at);
        let row = self.contact_row(&held.map_err(raised)?);
        Ok(PyArray1::from_vec(py, row))
    }

    /// The derivatives of the state at the times `t`, each of shape (n, columns).
    fn derivatives<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, f64>,
        left: bool,
    ) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let (Some(derivatives), Some(system)) = (&self.derivatives, self.prepared.traced()) else {
            return Ok(Vec::new());
        };
        let when = (t.as_slice()?, side_of(left));
        let run = (&*self.solution(), &self.prepared.actions());
        derivatives.at(py, system, run, when)
    }

    /// The derivatives of the times of zeros of a function, the first component of a system, shape (zeros, columns).
    fn zero_derivatives<'py>(
        &self,
        py: Python<'py>,
        function: &TracedSystem,
        t: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Vec<Vector<'py>>> {
        let (Some(derivatives), Some(system)) = (&self.derivatives, self.prepared.traced()) else {
            return Ok(Vec::new());
        };
        let run = (&*self.solution(), &self.prepared.actions());
        let function = function.with(system.parameters());
        let found = derivatives.of_zeros(system, run, &function, t.as_slice()?)?;
        Ok(found
            .into_iter()
            .map(|row| PyArray1::from_vec(py, row))
            .collect())
    }

    /// The mode and the discrete states at the start, and the instants of a run that was kept for them.
    fn kept_instants<'py>(&self, py: Python<'py>) -> Option<TrailRows<'py>> {
        self.derivatives.as_ref()?.trail_rows(py)
    }

    /// The gradient of a cost, a sum of terms; at which time and why there is none, if so; and where terms at instants count.
    fn cost_gradient<'py>(
        &self,
        py: Python<'py>,
        terms: Vec<TermRow<'py>>,
    ) -> PyResult<GradientRow<'py>> {
        let (Some(derivatives), Some(system)) = (&self.derivatives, self.prepared.traced()) else {
            return Err(PyValueError::new_err("the run has no derivatives"));
        };
        let run = (&*self.solution(), &self.prepared.actions());
        let of = (&self.prepared, &terms[..]);
        let (entries, lost, borders, points) = derivatives.gradient(py, system, run, of)?;
        let points = points.into_iter();
        let points = points.map(|(term, t, x, value)| (term, t, PyArray1::from_vec(py, x), value));
        Ok((
            PyArray1::from_vec(py, entries),
            lost,
            borders,
            points.collect(),
        ))
    }

    /// The same at the end of the run.
    fn derivatives_at_end<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let derivatives = self.derivatives.as_ref();
        derivatives.map(|derivatives| derivatives.at_end(py))
    }

    /// Where the derivatives are those of one side: the surfaces on which the run starts, whether an action is done or a clock ticks
    /// at the initial time, and whether the run ends at an instant that moves.
    fn borders(&self) -> BordersRow {
        let derivatives = self.derivatives.as_ref();
        derivatives.map_or_else(Default::default, |d| borders_row(d.borders()))
    }

    /// The mixed second derivatives of the state at the times `t`, each of shape (n, pairs of columns); at the end without times.
    #[pyo3(signature = (t, left))]
    fn second_derivatives<'py>(
        &self,
        py: Python<'py>,
        t: Option<PyReadonlyArray1<'py, f64>>,
        left: bool,
    ) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let (Some(derivatives), Some(system)) = (&self.derivatives, self.prepared.traced()) else {
            return Ok(Vec::new());
        };
        let solution = self.solution();
        let Some(t) = t else {
            return Ok(vec![derivatives.second_at_end(py)]);
        };
        let run = (&*solution, &self.prepared.actions());
        let when = (t.as_slice()?, side_of(left));
        derivatives.second_at(py, system, run, when)
    }

    /// From when on second derivatives are not known, why, and whether those of some columns are.
    fn second_lost(&self) -> Vec<(f64, &'static str, bool)> {
        let derivatives = self.derivatives.as_ref();
        derivatives.map_or_else(Vec::new, |found| found.second_lost())
    }

    /// Do derivatives end, or are they those of one side?
    #[getter]
    fn warns_of_derivatives(&self) -> bool {
        let derivatives = self.derivatives.as_ref();
        derivatives.is_some_and(|found| {
            let ends = found.lost().is_some() || !found.second_lost().is_empty();
            ends || !found.borders().is_empty()
        })
    }

    /// The time at which derivatives end, and why.
    fn derivatives_lost(&self) -> Option<LostAt> {
        self.derivatives.as_ref()?.lost()
    }

    /// The derivatives of all instants.
    fn instants<'py>(&self, py: Python<'py>) -> Vec<InstantRow<'py>> {
        let derivatives = self.derivatives.as_ref();
        derivatives.map_or_else(Vec::new, |derivatives| derivatives.instants(py))
    }

    /// The first `n` discrete states at the times `t`, shape (n, len(t)); those at the end if no segments are kept.
    fn discrete<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, f64>,
        n: usize,
        left: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let solution = self.solution();
        let mut out = Vec::new();
        let (times, at_t) = (t.as_slice()?, &solution.discrete_at_t);
        let width = at_t.len() / solution.t.len().max(1);
        if width > 0 && *times == solution.t[..] {
            let rows = at_t.chunks_exact(width);
            rows.for_each(|row| out.extend_from_slice(&row[..n]));
            return Ok(columns(py, &out, n));
        }
        for &t in times {
            let segment = solution.segment_at(t, side_of(left));
            let of_segment = segment.map(|segment| segment.discrete);
            let states = of_segment.as_ref().unwrap_or(&solution.discrete);
            let named = states.get(..n);
            out.extend(named.ok_or_else(|| PyValueError::new_err("n: too many"))?);
        }
        Ok(columns(py, &out, n))
    }

    /// Multipliers at the times `t`, shape (n_surfaces, len(t)); NaN for surfaces not slid on.
    fn multipliers<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let solution = self.solution();
        let mut out = Vec::new();
        for &t in t.as_slice()? {
            out.extend(self.multiplier_vector(&solution, t, Side::Right)?);
        }
        Ok(columns(py, &out, self.n_visible))
    }
}

fn side_of(left: bool) -> Side {
    match left {
        true => Side::Left,
        false => Side::Right,
    }
}

fn outside(solution: &Solution, t: f64) -> PyErr {
    let first = solution.segments.first().map_or(f64::NAN, |s| s.t_start);
    PyValueError::new_err(format!(
        "t = {t} is outside of the solution, which covers [{first}, {}], or dense_output was off",
        solution.t_last
    ))
}

/// The methods that took steps, the first of which the run preferred.
fn methods(stats: &Stats) -> String {
    let mut names: Vec<&str> = Method::ALL
        .into_iter()
        .rev()
        .filter(|method| stats.n_steps_of(*method) > 0)
        .map(Method::name)
        .collect();
    if names.is_empty() {
        names.push("none");
    }
    names.join(", ")
}
