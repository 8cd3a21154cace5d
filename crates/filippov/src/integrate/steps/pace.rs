//! The pace of a motion: its first step, from how the last motion in its mode went.

use crate::decisions::Left;
use crate::error::FieldError;
use crate::integrate::integrator::Integrator;
use crate::stepper::{initial_step, restart_step, tiny_step, ErrorScale};
use crate::switching::Leading;
use crate::tolerances::{FAMILIAR, MANY, MAX_LIE_ORDER, REACH, SEVERAL, SMALLEST_GUESS};

/// How the last motion in a mode went.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrate) struct Pace {
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

impl Integrator<'_> {
    /// Keeps the pace of the motion that ends, for the next one in its mode.
    pub(in crate::integrate) fn remember_pace(&mut self) {
        // A motion that ended where it began tells nothing.
        if !self.dt.is_finite() || self.t == self.motion.t_start {
            return;
        }
        let pace = Pace {
            dt: self.dt,
            duration: self.t - self.motion.t_start,
        };
        match self.paces.get_mut(&self.motion.mode) {
            Some(last) => *last = pace,
            None => {
                self.paces.insert(self.motion.mode.clone(), pace);
            }
        }
    }

    /// The first step of a motion: what the last motion in its mode suggests; else the proposal of the
    /// motion before, as far as Hairer's guess for this one supports it. No longer than a short
    /// excursion from the surface.
    pub(in crate::integrate) fn first_step(&mut self, left: &[Left]) -> Result<f64, FieldError> {
        let remaining = (self.t_end - self.t).max(f64::MIN_POSITIVE);
        if let (Some(first), true) = (self.options.first_step, self.dt.is_nan()) {
            return Ok(first.max(SMALLEST_GUESS).min(remaining));
        }
        let longest = remaining.min(self.options.max_step);
        if self.motion.jets.is_some() {
            // The series tells.
            return Ok(longest);
        }
        let (t, x, scale, field) = (self.t, &self.x, &self.scale, &mut self.motion.field);
        let derivative = self.stepper.start_derivative();
        let pace = self.paces.get(&self.motion.mode);
        let mut dt = match pace.and_then(|pace| pace.first_step(x, derivative, scale)) {
            Some(dt) => dt.min(longest),
            None if self.dt.is_nan() => initial_step(field, t, x, derivative, scale, longest)?,
            None => restart_step(field, t, x, derivative, scale, self.dt.min(longest))?,
        };
        for l in left {
            if let Left::Surface(j, leading) = l {
                dt = dt.min(self.excursion(*j, *leading)?);
            }
        }
        Ok(dt)
    }

    /// Predicted time of return to a surface that is left tangentially: the zero of
    /// a τ^k/k! + b τ^(k+1)/(k+1)!, with a fifth to spare.
    fn excursion(&self, j: usize, leading: Leading) -> Result<f64, FieldError> {
        let order = leading.order + 1;
        // While sliding h changes along another field than those of the derivatives.
        let is_known = leading.order >= 2 && self.motion.sliding.is_empty();
        if !is_known || order > self.system.max_lie_order().min(MAX_LIE_ORDER) {
            return Ok(f64::INFINITY);
        }
        let side = self.motion.mode.entries()[j];
        let signs = &self.motion.signs;
        let next = self.system.lie_derivative(
            j,
            j,
            &[side; MAX_LIE_ORDER][..order],
            self.t,
            &self.x,
            signs,
        )?;
        let back = -(order as f64) * leading.value / next.value;
        Ok(if back > 0.0 {
            1.2 * back
        } else {
            f64::INFINITY
        })
    }
}
