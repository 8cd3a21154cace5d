//! Where a run starts: arguments checked.

use crate::error::Error;
use crate::integrate::problem::Problem;
use crate::system::Trigger;

/// Checks the arguments of a run.
pub(super) fn check(problem: &Problem) -> Result<(), Error> {
    let Problem {
        system,
        t_span: (t0, t1),
        y0,
        options,
        actions,
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
