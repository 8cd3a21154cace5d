//! Where a run starts: arguments checked, the mode of the initial state found.

use crate::action::{Actions, Trigger};
use crate::decisions::{Cause, Decision, Next, Rule};
use crate::error::{Error, FieldError};
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::options::Options;
use crate::status::Stop;
use crate::system::PiecewiseSystem;

/// Checks the arguments of a run.
pub(super) fn check(
    system: &dyn PiecewiseSystem,
    (t0, t1): (f64, f64),
    y0: &[f64],
    options: &Options,
    actions: &Actions,
) -> Result<(), Error> {
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

impl Integrator<'_> {
    /// Decides the mode anew at the current point and goes on.
    pub(super) fn go_on_from_here(&mut self) -> Result<Option<Stop>, FieldError> {
        let before = self.motion.mode.clone();
        let Decision { rule, decided, .. } = self.decide(Cause::Anew(&before))?;
        match decided {
            Ok(next) => self.go_on_in(before, next, rule),
            Err(stop) => Ok(Some(stop)),
        }
    }

    /// Records what changes between two modes, if anything does, and starts the motion in the second.
    pub(super) fn go_on_in(
        &mut self,
        before: Mode,
        next: Next,
        rule: Rule,
    ) -> Result<Option<Stop>, FieldError> {
        let entries = before.entries().iter().zip(next.mode.entries()).enumerate();
        let changed = entries.filter(|(_, (before, after))| before != after);
        let changed: Vec<usize> = changed.map(|(j, _)| j).collect();
        if !changed.is_empty() {
            self.record(before, next.mode.clone(), &changed, rule.name());
        }
        self.begin(next)
    }

    /// Finds the mode of the initial state and starts the motion.
    pub(super) fn start(&mut self) -> Result<Option<Stop>, FieldError> {
        self.recorder.start(self.t, &self.x);
        if !self.actions.list.is_empty() {
            return self.start_with_actions();
        }
        match self.decide(Cause::Start)?.decided {
            Ok(next) => self.begin(next),
            Err(stop) => Ok(Some(stop)),
        }
    }
}
