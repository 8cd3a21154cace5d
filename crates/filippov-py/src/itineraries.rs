//! Motions that are held in a mode, and the instants of a run: what cycles and their continuation are made of.

use std::sync::Arc;

use filippov::derivative::{Extended, Extension, HeldMotion};
use filippov::motion::{Guard, RootEnd};
use filippov::{leg, Gradient, InstantRecord, LegError, Mode, Options, Over, Reached, Stop};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::conversion::columns;
use crate::prepared_run::{ActionRow, PreparedRun};
use crate::solve::RunOptions;
use crate::systems::{raised, refused, TracedSystem};

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Rows<'py> = Bound<'py, PyArray2<f64>>;
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

/// The derivatives of a function of the end of a motion, by the states and the time at its start, its duration and the parameters.
fn along(gradient: &Gradient, end: &[Vec<f64>]) -> Vec<f64> {
    let n = end.len();
    let (by_state, by_parameters) = gradient.state.split_at(n);
    let itself = std::iter::repeat_n(&0.0, n)
        .chain([&gradient.time; 2])
        .chain(by_parameters);
    let through = |column: usize| -> f64 {
        let entries = by_state.iter().zip(end);
        entries.map(|(entry, row)| entry * row[column]).sum()
    };
    itself
        .enumerate()
        .map(|(column, own)| own + through(column))
        .collect()
}

fn by_time_and_state(gradient: &Gradient) -> Vec<f64> {
    [&[gradient.time], &gradient.state[..]].concat()
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

    /// The motion over a time: the state at its end; its derivative by the states and the time at its start, its duration and the
    /// parameters; the velocities at both ends; times with the values of the guards there; and the guard of a number at its end,
    /// with its derivatives by the time, the states and the parameters. Its derivatives by what the motion depends on are then a
    /// last row below those of the state.
    #[allow(clippy::type_complexity, clippy::too_many_arguments)]
    #[pyo3(signature = (mode, q, t0, x, t1, places=0, ending=None))]
    fn leg<'py>(
        &self,
        py: Python<'py>,
        mode: Vec<i8>,
        q: Vec<f64>,
        t0: f64,
        x: Given<'_>,
        t1: f64,
        places: usize,
        ending: Option<usize>,
    ) -> PyResult<(
        Vector<'py>,
        Rows<'py>,
        [Vector<'py>; 2],
        Vector<'py>,
        Rows<'py>,
        Option<(f64, Vector<'py>)>,
    )> {
        let (mode, x) = (Mode::new(mode), x.as_slice()?.to_vec());
        let found = self.with(&q, |system, extended, actions| {
            let over = Over {
                span: (t0, t1),
                start: &x,
                places,
                ending,
            };
            let of = (system, extended, actions);
            let mut interrupt = |_: Reached| {
                py.check_signals().is_err_and(|raised| {
                    raised.restore(py);
                    true
                })
            };
            let found = leg(of, &self.options, (&mode, &q), over, &mut interrupt);
            found.map_err(|error| match error {
                LegError::Argument(error) => refused(error),
                LegError::Raised(error) => raised(error),
            })
        })?;
        if let Some(raised) = PyErr::take(py) {
            return Err(raised);
        }
        if !matches!(found.stop, Stop::End) {
            let name = |j: usize| self.prepared.core().surface_name(j);
            let message = found.stop.message(t0, &mode, name);
            return Err(PyValueError::new_err(message));
        }
        let n = x.len();
        let (by_state, by_parameters) = found.derivative.split_at(n * n);
        let [at_start, at_end] = &found.velocities;
        // The motion that starts later starts farther back.
        let back = |r: usize| {
            (0..n)
                .map(|c| by_state[c * n + r] * at_start[c])
                .sum::<f64>()
        };
        let row = |r: usize| {
            let entries = |columns: &[f64]| columns.iter().skip(r).step_by(n).copied().collect();
            let (states, parameters): (Vec<f64>, Vec<f64>) =
                (entries(by_state), entries(by_parameters));
            [&states[..], &[at_end[r] - back(r), at_end[r]], &parameters].concat()
        };
        let mut derivative: Vec<Vec<f64>> = (0..n).map(row).collect();
        if let Some(guard) = &found.ending {
            derivative.push(along(&guard.gradient, &derivative));
        }
        let times: Vec<f64> = found.samples.iter().map(|sample| sample.0).collect();
        let width = found.samples.first().map_or(0, |sample| sample.1.len());
        let values: Vec<f64> = found
            .samples
            .into_iter()
            .flat_map(|sample| sample.1)
            .collect();
        Ok((
            PyArray1::from_slice(py, &found.x),
            PyArray2::from_vec2(py, &derivative)?,
            found.velocities.map(|v| PyArray1::from_slice(py, &v)),
            PyArray1::from_slice(py, &times),
            columns(py, &values, width),
            found.ending.map(|guard| {
                let row = by_time_and_state(&guard.gradient);
                (guard.value, PyArray1::from_vec(py, row))
            }),
        ))
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
            let rows = found.iter().map(|guard| by_time_and_state(&guard.gradient));
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

    /// What an action makes of a place: the state and the discrete states after it, the derivative of the state by states and
    /// parameters (or none), and by the time; and the value of the clock that it waits for, with its derivatives.
    #[allow(clippy::type_complexity)]
    fn act<'py>(
        &self,
        py: Python<'py>,
        index: usize,
        mode: Vec<i8>,
        q: Vec<f64>,
        t: f64,
        x: Given<'_>,
    ) -> PyResult<(
        Vector<'py>,
        Vec<f64>,
        Option<Rows<'py>>,
        Vector<'py>,
        Option<(f64, Vector<'py>)>,
    )> {
        let (mode, x) = (Mode::new(mode), x.as_slice()?.to_vec());
        self.with(&q, |_, extended, actions| {
            let found = extended.act((actions, index), &mode, (t, &x, &q));
            let found = found.map_err(raised)?;
            let rows = found.rows.map(|rows| PyArray2::from_vec2(py, &rows));
            let clock = found.clock.map(|(value, gradient)| {
                (value, PyArray1::from_vec(py, by_time_and_state(&gradient)))
            });
            Ok((
                PyArray1::from_slice(py, &found.x),
                found.q,
                rows.transpose()?,
                PyArray1::from_slice(py, &found.by_time),
                clock,
            ))
        })
    }
}

impl HeldMotions {
    fn with<R>(
        &self,
        q: &[f64],
        ask: impl FnOnce(&filippov::TracedSystem, &Extended, &filippov::action::Actions) -> PyResult<R>,
    ) -> PyResult<R> {
        let system = self.prepared.traced();
        let system = system.ok_or_else(|| PyValueError::new_err("system: it is not traced"))?;
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
