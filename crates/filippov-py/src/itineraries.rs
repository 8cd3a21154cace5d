//! Motions that are held in a mode, and the instants of a run: what cycles and their continuation are made of.

use std::sync::Arc;

use filippov::action::Actions;
use filippov::derivative::{Extended, Extension, HeldMotion};
use filippov::motion::{Guard, RootEnd};
use filippov::{
    equations, state_after, Dip, Equations, GuardRates, InstantRecord, ItineraryLeg, LegEnd,
    LegError, Mode, Options, Passage, Reached, Unknowns,
};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::prepared_run::{ActionRow, PreparedRun};
use crate::solve::RunOptions;
use crate::systems::{raised, refused, TracedSystem};

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Rows<'py> = Bound<'py, PyArray2<f64>>;
type Cube<'py> = Bound<'py, PyArray3<f64>>;
type Given<'py> = PyReadonlyArray1<'py, f64>;

/// What ends a motion: its kind, the surface (-1: none), and the end of the multiplier (0: none).
pub type GuardRow = (&'static str, isize, i8);

/// An instant: both times, both states, both modes, both lists of discrete states, the guards that vanish, and the actions done.
pub type InstantRow<'py> = (
    [f64; 2],
    [Vector<'py>; 2],
    [Vec<i8>; 2],
    [Vec<f64>; 2],
    Vec<GuardRow>,
    Vec<usize>,
);

/// The mode and the discrete states at a start, and the instants that follow.
pub type TrailRows<'py> = (Vec<i8>, Vec<f64>, Vec<InstantRow<'py>>);

/// A guard as a row.
pub fn guard_row(guard: Guard) -> GuardRow {
    match guard {
        Guard::Surface(j) => ("surface", j as isize, 0),
        Guard::Multiplier { surface, end } => ("multiplier", surface as isize, end),
        Guard::Force(j) => ("force", j as isize, 0),
        Guard::Root(RootEnd::Fold) => ("fold", -1, 0),
        Guard::Root(_) => ("stability", -1, 0),
    }
}

fn read_guard(kind: &str, surface: isize, end: i8) -> PyResult<Guard> {
    match kind {
        "surface" => Ok(Guard::Surface(surface as usize)),
        "multiplier" => Ok(Guard::Multiplier {
            surface: surface as usize,
            end,
        }),
        "force" => Ok(Guard::Force(surface as usize)),
        "fold" => Ok(Guard::Root(RootEnd::Fold)),
        "stability" => Ok(Guard::Root(RootEnd::Stability)),
        _ => Err(PyValueError::new_err(format!(
            "guard: unknown kind {kind:?}"
        ))),
    }
}

/// Asks for signals: an error is left for the caller to take.
fn interrupt(py: Python<'_>) -> impl FnMut(Reached) -> bool + '_ {
    move |_| {
        py.check_signals().is_err_and(|raised| {
            raised.restore(py);
            true
        })
    }
}

/// The equations of an itinerary as arrays.
fn rows_of<'py>(py: Python<'py>, found: Equations) -> PyResult<EquationRows<'py>> {
    let passages = &found.passages;
    let (m, n, size) = (
        passages.len(),
        passages[0].after.len(),
        found.residual.len(),
    );
    let table = |values: Vec<f64>, rows: usize| {
        let columns = values.len() / rows;
        PyArray1::from_vec(py, values).reshape([rows, columns])
    };
    let all = |of: fn(&Passage) -> &[f64]| passages.iter().flat_map(of).copied().collect();
    let width = found.jacobian.len() / size - size + 1 + n;
    let unknown = vec![f64::NAN; width];
    let row = |passage: &Passage| passage.row.clone().unwrap_or_else(|| unknown.clone());
    let by_state: Vec<f64> = all(|passage| passage.leg.by_state());
    let velocities: Vec<f64> = passages
        .iter()
        .flat_map(|passage| passage.leg.velocities.concat())
        .collect();
    let map = |passage: &Passage| {
        let rows = passage.map.as_ref()?;
        Some(PyArray2::from_vec2(py, rows).map_err(Into::into))
    };
    let maps: PyResult<_> = passages.iter().map(|p| map(p).transpose()).collect();
    let rows = (
        passages.iter().map(|passage| passage.t).collect(),
        table(all(|passage| &passage.leg.x), m)?,
        PyArray1::from_vec(py, by_state).reshape([m, n, n])?,
        PyArray1::from_vec(py, velocities).reshape([m, 2, n])?,
        table(passages.iter().flat_map(row).collect(), m)?,
        table(all(|passage| &passage.after), m)?,
        maps?,
        passages.iter().map(|passage| passage.q.clone()).collect(),
        passages
            .iter()
            .map(|passage| passage.sides.clone())
            .collect(),
    );
    let dip = |dip: &Dip| (dip.leg, dip.guard, dip.number, dip.times);
    Ok((
        PyArray1::from_slice(py, &found.residual),
        table(found.jacobian, size)?,
        table(found.monodromy, n)?,
        rows,
        found.dips.iter().map(dip).collect(),
    ))
}

/// An instant as a row.
pub fn instant_row<'py>(py: Python<'py>, record: &InstantRecord) -> InstantRow<'py> {
    (
        record.t,
        record.x.map(|x| PyArray1::from_slice(py, x)),
        record.mode.map(|mode| mode.entries().to_vec()),
        record.discrete.map(<[f64]>::to_vec),
        record
            .guards
            .iter()
            .map(|guard| guard_row(*guard))
            .collect(),
        record.acts.iter().map(|act| act.index).collect(),
    )
}

/// A leg. What ends it is a guard, or that it has its share of a motion, or a known time; where all three are missing, nothing does.
type LegRow = (
    // Its mode.
    Vec<i8>,
    // The discrete states.
    Vec<f64>,
    // The guard that ends it.
    Option<(String, isize, i8)>,
    // The actions that are done at its end.
    Vec<usize>,
    // How many times as long as the next leg it lasts, if that goes on with it; else NaN.
    f64,
    // The time of its end, if that is known; else NaN.
    f64,
);

/// The legs with what happens at their ends. Each list or array has one entry per leg.
type PassageRows<'py> = (
    // The times of the ends.
    Vec<f64>,
    // The states there.
    Rows<'py>,
    // The columns of their derivatives by the states at the starts.
    Cube<'py>,
    // The velocities at both ends.
    Cube<'py>,
    // The derivatives of the equations of the ends by the time, the states and the parameters; NaN if nothing ends a leg.
    Rows<'py>,
    // The states behind the ends.
    Rows<'py>,
    // The derivatives of these by the time, the states before and the parameters, where an action changes the state.
    Vec<Option<Rows<'py>>>,
    // The discrete states behind the ends.
    Vec<Vec<f64>>,
    // The values and rates of the guards before the ends and behind them, if they were asked for.
    Vec<Option<[GuardRates; 2]>>,
);

/// A minimum of a guard near zero: its leg, its guard, its number, and the times before it, of it and behind it.
type DipRow = (usize, usize, usize, [f64; 3]);

/// The residual, its derivatives, the monodromy matrix, what happens to the legs, and the minima of guards.
type EquationRows<'py> = (
    Vector<'py>,
    Rows<'py>,
    Rows<'py>,
    PassageRows<'py>,
    Vec<DipRow>,
);

/// The legs of an itinerary.
#[pyclass(frozen, module = "filippov._core")]
pub struct HeldItinerary {
    legs: Vec<ItineraryLeg>,
}

#[pymethods]
impl HeldItinerary {
    #[new]
    fn new(rows: Vec<LegRow>) -> PyResult<Self> {
        let leg = |(mode, q, guard, acts, share, time): LegRow| -> PyResult<ItineraryLeg> {
            let end = match guard {
                Some((kind, surface, end)) => LegEnd::Guard(read_guard(&kind, surface, end)?),
                None if !share.is_nan() => LegEnd::Cut(share),
                None if !time.is_nan() => LegEnd::Time(time),
                None => LegEnd::Open,
            };
            let mode = Mode::new(mode);
            Ok(ItineraryLeg { mode, q, end, acts })
        };
        let legs: PyResult<_> = rows.into_iter().map(leg).collect();
        Ok(HeldItinerary { legs: legs? })
    }
}

/// The motions of a system with these parameters, held in any mode.
#[pyclass(frozen, module = "filippov._core")]
pub struct HeldMotions {
    prepared: PreparedRun,
    extension: Arc<Extension>,
    options: Options,
}

#[pymethods]
impl HeldMotions {
    #[new]
    fn new(
        system: &Bound<'_, PyAny>,
        t0: f64,
        y0: Given<'_>,
        p: Given<'_>,
        options: &RunOptions,
        actions: Vec<ActionRow>,
        parameters: Vec<usize>,
    ) -> PyResult<Self> {
        let traced = system
            .cast::<TracedSystem>()
            .map_err(|_| PyValueError::new_err("system: it is not traced"))?;
        let extension = traced.get().extension(&parameters)?;
        let (y0, p) = (y0.as_slice()?.to_vec(), p.as_slice()?.to_vec());
        Ok(HeldMotions {
            prepared: PreparedRun::new(system, t0, y0, p, &[], &actions)?,
            extension,
            options: options.options.clone(),
        })
    }

    /// The state to which a motion leads in a time.
    fn leg<'py>(
        &self,
        py: Python<'py>,
        mode: Vec<i8>,
        q: Vec<f64>,
        t0: f64,
        x: Given<'_>,
        t1: f64,
    ) -> PyResult<Vector<'py>> {
        let (mode, x) = (Mode::new(mode), x.as_slice()?.to_vec());
        let mut actions = self.prepared.actions();
        actions.discrete = q;
        let of = (self.system()?, &actions);
        let found = state_after(of, &self.options, &mode, ((t0, t1), &x), &mut interrupt(py));
        Ok(PyArray1::from_vec(py, self.checked(py, found)?))
    }

    /// The equations of an itinerary at these unknowns: the states at the starts of its legs one after the other, how long they
    /// last, and when the first one starts.
    #[allow(clippy::too_many_arguments)]
    fn equations<'py>(
        &self,
        py: Python<'py>,
        itinerary: &HeldItinerary,
        starts: Given<'_>,
        durations: Given<'_>,
        t0: f64,
        is_free_in_time: bool,
        places: usize,
    ) -> PyResult<EquationRows<'py>> {
        let at = Unknowns {
            starts: starts.as_slice()?,
            durations: durations.as_slice()?,
            t0,
            is_free_in_time,
            places,
        };
        let legs = &itinerary.legs;
        let found = self.with(&[], |system, extended, actions| {
            let of = (system, extended, actions);
            let found = equations(of, &self.options, legs, at, &mut interrupt(py));
            self.checked(py, found)
        })?;
        rows_of(py, found)
    }

    /// The guards of a motion.
    fn guards(&self, mode: Vec<i8>, q: Vec<f64>) -> PyResult<Vec<GuardRow>> {
        self.held(mode, &q, |motion| {
            Ok(motion
                .guards()
                .iter()
                .map(|guard| guard_row(*guard))
                .collect())
        })
    }

    /// The velocity of a motion at a place, its multipliers, the values of its guards, and their derivatives: a row for each, by
    /// the time, the states and the parameters.
    #[allow(clippy::type_complexity)]
    fn at<'py>(
        &self,
        py: Python<'py>,
        mode: Vec<i8>,
        q: Vec<f64>,
        t: f64,
        x: Given<'_>,
    ) -> PyResult<(Vector<'py>, Vector<'py>, Vector<'py>, Rows<'py>)> {
        let x = x.as_slice()?.to_vec();
        self.held(mode, &q, |motion| {
            let velocity = motion.velocity(t, &x).map_err(raised)?;
            let multipliers = motion.multipliers();
            let found = motion.guards_at(t, &x).map_err(raised)?;
            let values: Vec<f64> = found.iter().map(|guard| guard.value).collect();
            let rows = found.iter().map(|guard| guard.gradient.by_all());
            let rows: Vec<Vec<f64>> = rows.collect();
            let gradients = match rows.is_empty() {
                true => PyArray2::zeros(py, [0, 1 + velocity.len()], false),
                false => PyArray2::from_vec2(py, &rows)?,
            };
            Ok((
                PyArray1::from_slice(py, &velocity[..x.len()]),
                PyArray1::from_slice(py, &multipliers),
                PyArray1::from_slice(py, &values),
                gradients,
            ))
        })
    }

    /// The state that an action makes of a place.
    fn act<'py>(
        &self,
        py: Python<'py>,
        index: usize,
        mode: Vec<i8>,
        q: Vec<f64>,
        t: f64,
        x: Given<'_>,
    ) -> PyResult<Vector<'py>> {
        let (mode, x) = (Mode::new(mode), x.as_slice()?.to_vec());
        self.with(&q, |_, extended, actions| {
            let found = extended.act((actions, index), &mode, (t, &x, &q));
            Ok(PyArray1::from_vec(py, found.map_err(raised)?.x))
        })
    }
}

impl HeldMotions {
    fn system(&self) -> PyResult<&filippov::TracedSystem> {
        let system = self.prepared.traced().map(|system| &**system);
        system.ok_or_else(|| PyValueError::new_err("system: it is not traced"))
    }

    /// What was found, or why it was not.
    fn checked<R>(&self, py: Python<'_>, found: Result<R, LegError>) -> PyResult<R> {
        if let Some(raised) = PyErr::take(py) {
            return Err(raised);
        }
        found.map_err(|error| match error {
            LegError::Argument(error) => refused(error),
            LegError::Raised(error) => raised(error),
            LegError::NoGuard => PyValueError::new_err("the motion of a piece has no such end"),
            LegError::Stopped { mode, t, stop } => {
                let name = |j: usize| self.prepared.core().surface_name(j);
                PyValueError::new_err(stop.message(t, &mode, name))
            }
        })
    }

    fn with<R>(
        &self,
        q: &[f64],
        ask: impl FnOnce(&filippov::TracedSystem, &Extended, &Actions) -> PyResult<R>,
    ) -> PyResult<R> {
        let system = self.system()?;
        let mut actions = self.prepared.actions();
        actions.discrete = q.to_vec();
        let extended = self.extension.at(system.parameters(), &actions);
        let extended = extended.map_err(|e| PyValueError::new_err(e.to_string()))?;
        let extended =
            extended.ok_or_else(|| PyValueError::new_err("the map of a reset is not traced"))?;
        ask(system, &extended, &actions)
    }

    fn held<R>(
        &self,
        mode: Vec<i8>,
        q: &[f64],
        ask: impl FnOnce(&mut HeldMotion) -> PyResult<R>,
    ) -> PyResult<R> {
        let mode = Mode::new(mode);
        self.with(q, |system, extended, _| {
            let impacts = extended.impacts();
            let mut motion = HeldMotion::new((system, extended), &impacts, &self.options, &mode, q);
            ask(&mut motion)
        })
    }
}
