//! A run to be made: what it needs, and what it may have.

use std::sync::LazyLock;

use crate::error::Error;
use crate::event::UserEvent;
use crate::mode::Mode;
use crate::options::Options;
use crate::system::{Actions, PiecewiseSystem, Trigger};

static DEFAULTS: LazyLock<Options> = LazyLock::new(Options::default);
static NO_ACTIONS: Actions = Actions::none();

/// An initial value problem: a system, a span of time and a start; with options, events, actions and a section, if it has any.
///
/// # Example
///
/// A ball that falls on a table, and loses half of its speed at each impact, comes to rest.
///
/// ```
/// use filippov::action::{Action, Actions, Trigger};
/// use filippov::{ClosureSystem, Kind, Problem};
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
/// let solution = Problem::new(&ball, (0.0, 5.0), &[1.0, 0.0]).actions(&actions).solve()?;
/// let rest = solution.switches.last().expect("the impacts accumulate");
/// assert_eq!(rest.kind, Kind::Accumulation);
/// assert!((rest.t - 3.0 * (2.0_f64 / 9.81).sqrt()).abs() < 1e-5);
/// assert_eq!(solution.mode.entries(), [0]);
/// # Ok::<(), filippov::Error>(())
/// ```
#[derive(Clone, Copy)]
#[must_use]
pub struct Problem<'a> {
    pub(super) system: &'a dyn PiecewiseSystem,
    pub(super) t_span: (f64, f64),
    pub(super) y0: &'a [f64],
    pub(super) options: &'a Options,
    pub(super) events: &'a [UserEvent<'a>],
    pub(super) actions: &'a Actions<'a>,
    pub(super) held: Option<&'a Mode>,
}

impl<'a> Problem<'a> {
    /// The motion of a system over `t_span` from `y0`, with default options.
    pub fn new(system: &'a dyn PiecewiseSystem, t_span: (f64, f64), y0: &'a [f64]) -> Self {
        Problem {
            system,
            t_span,
            y0,
            options: &DEFAULTS,
            events: &[],
            actions: &NO_ACTIONS,
            held: None,
        }
    }

    /// With these options.
    pub fn options(self, options: &'a Options) -> Self {
        Problem { options, ..self }
    }

    /// With functions whose zeros are recorded, and may end the run.
    pub fn events(self, events: &'a [UserEvent<'a>]) -> Self {
        Problem { events, ..self }
    }

    /// With actions that change the state in instants, and with discrete states.
    pub fn actions(self, actions: &'a Actions<'a>) -> Self {
        Problem { actions, ..self }
    }

    /// In this mode to the end, whatever its guards are: nothing is looked for, and no action is done. The discrete states are those of
    /// the actions.
    pub fn held_in(self, mode: &'a Mode) -> Self {
        let held = Some(mode);
        Problem { held, ..self }
    }
}

/// Checks the arguments of a run.
pub(super) fn check(problem: &Problem) -> Result<(), Error> {
    let Problem {
        system,
        t_span: (t0, t1),
        y0,
        options,
        actions,
        held,
        ..
    } = *problem;
    let n = system.n_states();
    if y0.len() != n {
        return Err(Error::WrongLength {
            name: "y0",
            found: y0.len(),
            expected: n,
        });
    }
    if options.atol.len() != 1 && options.atol.len() != n {
        return Err(Error::WrongLength {
            name: "atol",
            found: options.atol.len(),
            expected: n,
        });
    }
    if let Some(mode) = held.filter(|mode| mode.entries().len() != system.n_surfaces()) {
        return Err(Error::WrongLength {
            name: "mode",
            found: mode.entries().len(),
            expected: system.n_surfaces(),
        });
    }
    let require = |name, value: f64, holds: bool, requirement| {
        if holds {
            Ok(())
        } else {
            Err(Error::OutOfRange {
                name,
                value,
                requirement,
            })
        }
    };
    require("t_span[0]", t0, t0.is_finite(), "must be finite")?;
    require(
        "t_span[1]",
        t1,
        t1.is_finite() && t1 >= t0,
        "must be finite and not before t_span[0]",
    )?;
    for &y in y0 {
        require("y0", y, y.is_finite(), "must be finite")?;
    }
    for &a in &options.atol {
        require("atol", a, a >= 0.0 && a.is_finite(), "must not be negative")?;
    }
    require(
        "rtol",
        options.rtol,
        options.rtol > 0.0 && options.rtol.is_finite(),
        "must be positive",
    )?;
    require(
        "max_step",
        options.max_step,
        options.max_step > 0.0,
        "must be positive",
    )?;
    if let Some(limit) = options.max_wall_time {
        let runs = options.clock.runs();
        require(
            "max_wall_time",
            limit,
            runs,
            "needs a clock, which this platform does not have; use max_steps",
        )?;
    }
    if let Some(factor) = options.stabilization.restoring() {
        require(
            "stabilization",
            factor,
            factor > 0.0 && factor.is_finite(),
            "must be positive",
        )?;
    }
    for action in &actions.list {
        if let Trigger::Clock { clock, .. } = action.trigger {
            clock.check("period", "phase")?;
        }
        if let Trigger::Surface { index, .. } = action.trigger {
            if index >= system.n_surfaces() {
                return Err(Error::OutOfRange {
                    name: "actions",
                    value: index as f64,
                    requirement: "must be the index of a surface",
                });
            }
        }
    }
    if let Some(first) = options.first_step {
        require(
            "first_step",
            first,
            first > 0.0 && first.is_finite(),
            "must be positive",
        )?;
    }
    Ok(())
}
