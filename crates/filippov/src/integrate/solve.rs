//! Runs from start to end.

use super::{Integrator, Stop};
use crate::error::Error;
use crate::event::UserEvent;
use crate::options::Options;
use crate::solution::Solution;
use crate::system::PiecewiseSystem;

/// Integrates a piecewise-smooth system over `t_span` from `y0`.
///
/// # Errors
/// If an argument is out of range. A failure during the run is no error: the solution up to there
/// comes back with its [`Stop`].
pub fn solve(
    system: &dyn PiecewiseSystem,
    t_span: (f64, f64),
    y0: &[f64],
    options: &Options,
    events: &[UserEvent],
) -> Result<Solution, Error> {
    solve_interruptible(system, t_span, y0, options, events, &mut |_| false)
}

/// As [`solve`]; `interrupt` is asked every few steps with the time reached, and the run stops
/// where it says `true`.
///
/// # Errors
/// As [`solve`].
pub fn solve_interruptible(
    system: &dyn PiecewiseSystem,
    t_span: (f64, f64),
    y0: &[f64],
    options: &Options,
    events: &[UserEvent],
    interrupt: &mut dyn FnMut(f64) -> bool,
) -> Result<Solution, Error> {
    let mut integrator = Integrator::new(system, t_span, y0, options, events)?;
    let stop = match integrator.run(interrupt) {
        Ok(stop) => stop,
        Err(raised) => Stop::FieldRaised(raised),
    };
    let mut solution = integrator.finish(stop);
    let resampled = options
        .t_eval
        .as_ref()
        .map(|times| solution.resample(system, times));
    if let Some(Err(raised)) = resampled {
        solution.stop = Stop::FieldRaised(raised);
    }
    if !options.dense_output {
        solution.forget_dense();
    }
    Ok(solution)
}
