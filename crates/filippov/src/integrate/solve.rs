//! Runs from start to end.

use super::Integrator;
use crate::error::Error;
use crate::event::UserEvent;
use crate::options::Options;
use crate::record::section::{Place, Section};
use crate::record::Solution;
use crate::status::Stop;
use crate::system::Actions;
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
    solve_with_actions(
        system,
        t_span,
        y0,
        options,
        events,
        &Actions::none(),
        interrupt,
    )
}

/// As [`solve_interruptible`], with actions that change the state in instants.
///
/// # Example
///
/// A ball that falls on a table, and loses half of its speed at each impact, comes to rest.
///
/// ```
/// use filippov::action::{Action, Actions, Trigger};
/// use filippov::{solve_with_actions, ClosureSystem, Kind, Options};
///
/// let ball = ClosureSystem::new(
///     2,
///     1,
///     |_, x, _, dx| (dx[0], dx[1]) = (x[1], -9.81),
///     |_, x, h| h[0] = x[0],
/// );
/// let ball = ball.with_smooth_surfaces(&[0]);
/// let bounce = |_t: f64, x: &mut [f64], _q: &mut [f64]| x[1] *= -0.5;
/// let impact = Action {
///     trigger: Trigger::Surface { index: 0, direction: -1, side: 1 },
///     map: &bounce,
///     name: "impact".into(),
///     kind: Some(Kind::Reset),
/// };
/// let actions = Actions { list: vec![impact], discrete: Vec::new() };
/// let options = Options::default();
/// let solution =
///     solve_with_actions(&ball, (0.0, 5.0), &[1.0, 0.0], &options, &[], &actions, &mut |_| false)?;
/// let rest = solution.switches.last().expect("the impacts accumulate");
/// assert_eq!(rest.kind, Kind::Accumulation);
/// assert!((rest.t - 3.0 * (2.0_f64 / 9.81).sqrt()).abs() < 1e-9);
/// assert_eq!(solution.mode.entries(), [0]);
/// # Ok::<(), filippov::Error>(())
/// ```
///
/// # Errors
/// As [`solve`].
pub fn solve_with_actions(
    system: &dyn PiecewiseSystem,
    t_span: (f64, f64),
    y0: &[f64],
    options: &Options,
    events: &[UserEvent],
    actions: &Actions,
    interrupt: &mut dyn FnMut(f64) -> bool,
) -> Result<Solution, Error> {
    let integrator = Integrator::new(system, t_span, y0, options, events, actions)?;
    let mut solution = run_to_end(integrator.interruptible(interrupt));
    let resampled = options
        .t_eval
        .as_ref()
        .filter(|_| solution.is_dense())
        .map(|times| solution.resample(system, times));
    if let Some(Err(raised)) = resampled {
        solution.stop = Stop::FieldRaised(raised);
    }
    Ok(solution)
}

/// Integrates until a section was met as often as it asks for, its returns are periodic, or the end of `t_span`;
/// [`Solution::returns`](crate::Solution::returns) are the returns.
///
/// # Example
///
/// The forced oscillator with dry friction, once per period of the forcing (Piiroinen and Kuznetsov 2008, Fig. 4).
///
/// ```
/// use filippov::action::{Actions, Clock};
/// use filippov::section::{Place, Section};
/// use filippov::{solve_to_section, ClosureSystem, Options};
///
/// let oscillator = ClosureSystem::new(
///     2,
///     1,
///     |t, x, s, dx| (dx[0], dx[1]) = (x[1], -x[0] + (t / 3.0).sin() - 0.4 * s[0]),
///     |_t, x, h| h[0] = x[1],
/// );
/// let clock = Clock { period: 6.0 * std::f64::consts::PI, phase: 0.0 };
/// let section = Section { place: Place::Ticks(clock), transient: 20, most: 2, cycle: None };
/// let (options, none) = (Options::default(), Actions::none());
/// let solution =
///     solve_to_section(&oscillator, (0.0, 1e3), &[1.0, 2.0], &options, &section, &none, &mut |_| false)?;
/// let returns = solution.returns.expect("there is a section");
/// assert_eq!((returns.count, returns.kept.len()), (22, 2));
/// assert!((returns.kept[1].y[1] - 0.3570302433858536).abs() < 1e-5);
/// # Ok::<(), filippov::Error>(())
/// ```
///
/// # Errors
/// As [`solve`].
pub fn solve_to_section(
    system: &dyn PiecewiseSystem,
    t_span: (f64, f64),
    y0: &[f64],
    options: &Options,
    section: &Section,
    actions: &Actions,
    interrupt: &mut dyn FnMut(f64) -> bool,
) -> Result<Solution, Error> {
    let function = match section.place {
        Place::Function {
            function,
            direction,
        } => Some(UserEvent {
            function,
            direction,
            terminal: 0,
        }),
        _ => None,
    };
    if let Place::Ticks(clock) = section.place {
        clock.check("period of the section", "offset of the section")?;
    }
    let events = function.as_slice();
    let mut integrator = Integrator::new(system, t_span, y0, options, events, actions)?;
    integrator.user_events.is_section = matches!(section.place, Place::Function { .. });
    integrator.recorder.observe(section, integrator.t);
    Ok(run_to_end(integrator.interruptible(interrupt)))
}

fn run_to_end(mut integrator: Integrator) -> Solution {
    let stop = match integrator.run() {
        Ok(stop) => stop,
        Err(raised) => Stop::FieldRaised(raised),
    };
    integrator.finish(stop)
}
