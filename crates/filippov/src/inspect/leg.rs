//! A motion that is held in one mode over a given time, whatever its guards are: a leg of an itinerary.

use crate::derivative::{Column, Extended, GuardAt, HeldMotion, Tangents};
use crate::error::{Error, FieldError};
use crate::integrate::{Problem, Reached};
use crate::mode::Mode;
use crate::options::{Keep, Options};
use crate::record::{Side, Solution};
use crate::status::Stop;
use crate::system::{Actions, TracedSystem};
use crate::vectors::dot;

/// Over what time a leg goes, from where, and what of its guards is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Over<'s> {
    /// Its first and last time.
    pub span: (f64, f64),
    /// The state at its start.
    pub start: &'s [f64],
    /// At how many places in each step all guards are evaluated.
    pub places: usize,
    /// The number of the guard that the leg ends at.
    pub ending: Option<usize>,
}

/// A leg.
#[derive(Debug)]
pub struct Leg {
    /// The state at its end.
    pub x: Vec<f64>,
    /// The velocity at its start and its end.
    pub velocities: [Vec<f64>; 2],
    /// The derivative of the state at the end, n entries by each of the states at the start, then by each parameter.
    pub derivative: Vec<f64>,
    /// Times, and the values of the guards there.
    pub samples: Vec<(f64, Vec<f64>)>,
    /// The guard that the leg ends at, there.
    pub ending: Option<GuardAt>,
}

impl Leg {
    /// The derivative of the state at the end by that at the start, a column after the other.
    pub fn by_state(&self) -> &[f64] {
        let n = self.x.len();
        &self.derivative[..n * n]
    }

    /// The derivatives of the state at the end, a row for each component: by the states and the time at the start, the duration and
    /// the parameters.
    pub fn rows(&self) -> Vec<Vec<f64>> {
        let n = self.x.len();
        let [at_start, at_end] = &self.velocities;
        let (by_state, by_parameters) = self.derivative.split_at(n * n);
        let row = |r: usize| {
            let entries = |columns: &[f64]| -> Vec<f64> {
                columns.iter().skip(r).step_by(n).copied().collect()
            };
            let states = entries(by_state);
            // The motion that starts later starts farther back.
            let back = dot(&states, at_start);
            [
                &states[..],
                &[at_end[r] - back, at_end[r]],
                &entries(by_parameters),
            ]
            .concat()
        };
        (0..n).map(row).collect()
    }
}

/// Follows the motion in a mode over a given time; `interrupt` is asked every few steps, and the leg ends where it returns `true`.
/// The actions have the discrete states of the motion.
///
/// # Errors
/// If an argument is out of range, or a function of the user raises.
pub fn leg(
    (system, extended, actions): (&TracedSystem, &Extended, &Actions),
    options: &Options,
    motion: &mut HeldMotion,
    Over {
        span,
        start,
        places,
        ending,
    }: Over,
    interrupt: &mut dyn FnMut(Reached) -> bool,
) -> Result<Leg, LegError> {
    let n = start.len();
    let impacts = extended.impacts();
    let parameters = 0..extended.n_parameters();
    let kinds: Vec<Column> = (0..n)
        .map(Column::State)
        .chain(parameters.map(Column::Parameter))
        .collect();
    let options = Options {
        keep: if places > 0 { Keep::Steps } else { Keep::Last },
        dense_output: places > 0,
        ..options.clone()
    };
    let mut tangents = Tangents::new(extended, &impacts, kinds, &options, span.1 - span.0);
    let solution = Problem::new(system, span, start)
        .options(&options)
        .actions(actions)
        .held_in(motion.mode())
        .solve_observed(&mut tangents, interrupt)?;
    let solution = complete(solution, motion.mode())?;
    let values = tangents.finish()?.values;
    // Behind the states are the named discrete states, which rest.
    let rows = extended.n_rows();
    let last = values.len() - rows * (n + extended.n_parameters());
    let columns = values[last..].chunks_exact(rows);
    let derivative: Vec<f64> = columns.flat_map(|column| &column[..n]).copied().collect();
    let x = solution.last_state().to_vec();
    let velocities = [
        motion.velocity(span.0, start)?,
        motion.velocity(solution.t_last, &x)?,
    ];
    let mut samples = Vec::new();
    let mut point = vec![0.0; n];
    for pair in solution.t.windows(2).filter(|_| places > 0) {
        for place in 0..places {
            let t = pair[0] + (pair[1] - pair[0]) * place as f64 / places as f64;
            solution.evaluate(system, t, Side::Right, &mut point)?;
            samples.push((t, motion.values(t, &point)?));
        }
    }
    if places > 0 {
        samples.push((solution.t_last, motion.values(solution.t_last, &x)?));
    }
    let ending = match ending {
        Some(place) => motion.guard_at(place, solution.t_last, &x)?,
        None => None,
    };
    Ok(Leg {
        x,
        velocities,
        derivative,
        samples,
        ending,
    })
}

/// The state to which the motion in a mode leads from a place in a given time. The actions have its discrete states.
///
/// # Errors
/// If it cannot be followed so far, an argument is out of range, or a function of the user raises.
pub fn state_after(
    (system, actions): (&TracedSystem, &Actions),
    options: &Options,
    mode: &Mode,
    (span, start): ((f64, f64), &[f64]),
    interrupt: &mut dyn FnMut(Reached) -> bool,
) -> Result<Vec<f64>, LegError> {
    let options = Options {
        keep: Keep::Last,
        dense_output: false,
        ..options.clone()
    };
    let problem = Problem::new(system, span, start)
        .options(&options)
        .actions(actions);
    let solution = problem.held_in(mode).solve_interruptible(interrupt)?;
    Ok(complete(solution, mode)?.last_state().to_vec())
}

/// A solution that comes to its end.
fn complete(solution: Solution, mode: &Mode) -> Result<Solution, LegError> {
    match solution.stop {
        Stop::End => Ok(solution),
        stop => Err(LegError::Stopped {
            mode: mode.clone(),
            t: solution.t_last,
            stop,
        }),
    }
}

/// Why there is no leg.
#[derive(Debug)]
pub enum LegError {
    /// A motion cannot be followed for so long.
    Stopped {
        /// Its mode.
        mode: Mode,
        /// The last time.
        t: f64,
        /// Why.
        stop: Stop,
    },
    /// The motion has no such guard.
    NoGuard,
    /// An argument is out of range.
    Argument(Error),
    /// A function of the user raised.
    Raised(FieldError),
}

impl From<Error> for LegError {
    fn from(error: Error) -> Self {
        LegError::Argument(error)
    }
}

impl From<FieldError> for LegError {
    fn from(error: FieldError) -> Self {
        LegError::Raised(error)
    }
}
