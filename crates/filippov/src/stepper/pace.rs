//! The pace of a motion: its first step, from how the last motion in its mode went.

use rustc_hash::FxHashMap;

use super::tiny_step;
use crate::error::FieldError;
use crate::error_scale::ErrorScale;
use crate::mode::Mode;
use crate::motion::Leading;
use crate::system::{PiecewiseSystem, Place};
use crate::tolerances::{FAMILIAR, MANY, MAX_LIE_ORDER, REACH, SEVERAL};

/// How the last motion in a mode went.
#[derive(Clone, Copy, Debug)]
struct Pace {
    /// The step proposed at its end.
    dt: f64,
    /// How long it lasted.
    duration: f64,
}

impl Pace {
    /// The first step of another motion in the mode. After many steps the proposal has settled, and a
    /// little less will do. Where it was several times the motion, the field hardly limits it: look as
    /// far ahead as the last event was, though motions that become ever shorter are no reason to go
    /// below a tiny step. In between, nothing is known.
    fn first_step(self, x: &[f64], derivative: &[f64], scale: &ErrorScale) -> Option<f64> {
        if self.duration >= MANY * self.dt {
            Some(FAMILIAR * self.dt)
        } else if self.dt >= SEVERAL * self.duration {
            let reach = REACH * self.duration;
            Some(self.dt.min(reach.max(tiny_step(x, derivative, scale))))
        } else {
            None
        }
    }
}

/// How the last motions went, by mode.
#[derive(Clone, Default)]
pub(super) struct Paces(FxHashMap<Mode, Pace>);

impl Paces {
    /// Keeps the pace of a motion that ends: the step proposed at its end, and how long it lasted. A motion that ended where
    /// it began tells nothing.
    pub fn remember(&mut self, mode: &Mode, dt: f64, duration: f64) {
        if !dt.is_finite() || duration == 0.0 {
            return;
        }
        let pace = Pace { dt, duration };
        match self.0.get_mut(mode) {
            Some(last) => *last = pace,
            None => {
                self.0.insert(mode.clone(), pace);
            }
        }
    }

    /// The first step of a motion in the mode, as far as the last one suggests it.
    pub fn first_step(
        &self,
        mode: &Mode,
        x: &[f64],
        derivative: &[f64],
        scale: &ErrorScale,
    ) -> Option<f64> {
        self.0.get(mode)?.first_step(x, derivative, scale)
    }
}

/// Predicted time of return of a motion in a region to surface `j` that it leaves tangentially: the zero of
/// a τ^k/k! + b τ^(k+1)/(k+1)!, with a fifth to spare.
pub(super) fn excursion(
    system: &dyn PiecewiseSystem,
    place: &Place<'_>,
    mode: &Mode,
    j: usize,
    leading: Leading,
) -> Result<f64, FieldError> {
    let order = leading.order + 1;
    // While sliding h changes along another field than those of the derivatives.
    let is_known = leading.order >= 2 && mode.codimension() == 0;
    if !is_known || order > system.max_lie_order().min(MAX_LIE_ORDER) {
        return Ok(f64::INFINITY);
    }
    let word = [mode.entries()[j]; MAX_LIE_ORDER];
    let next = system.lie_derivative(j, j, &word[..order], place)?;
    let back = -(order as f64) * leading.value / next.value;
    Ok(if back > 0.0 {
        1.2 * back
    } else {
        f64::INFINITY
    })
}
