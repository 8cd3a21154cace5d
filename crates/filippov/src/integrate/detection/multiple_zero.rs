//! Zeros that rounding or errors of the step blur: a touch, or a crossing with a multiple zero.
//!
//! Around a multiple zero a switching function is within its rounding for a while, and what is found there is some point of
//! that interval. The zero itself is one of a derivative, which has no such interval: that of the rate at a touch, of the
//! second derivative at a triple zero. Two crossings between which the function falls by less than errors of the step,
//! as it does at a touch, are a touch too.

use crate::error::FieldError;
use crate::event::{EventFunction, Monitored};
use crate::integrate::detection::detect::Found;
use crate::integrate::integrator::Integrator;
use crate::stepper::StepMethod;
use crate::system::LieValue;
use crate::tolerances::{AT_THE_END, BESIDE_A_POLE, EPS, FLAT, MOST_HALVINGS, TOUCH_DEPTH};

/// Which derivative of a switching function vanishes at its multiple zero.
#[derive(Clone, Copy)]
enum Derivative {
    /// The rate along the extension.
    First,
    /// The second along the field.
    Second,
}

impl Integrator<'_> {
    /// May the zero that was found be a multiple one? Rounding blurs it, or the function is back above zero at the end of
    /// the step.
    pub(in crate::integrate) fn may_be_multiple(&self, event: &Found) -> bool {
        let [EventFunction::Surface(_)] = event.functions[..] else {
            return false;
        };
        if event.theta > 1.0 {
            return false;
        }
        // Rounding of forces that balance blurs functions of a sliding motion for long: there is no zero to be moved to.
        if self.detector.blurred {
            return self.motion.sliding.is_empty();
        }
        if self.stepper.in_use() == StepMethod::Taylor {
            return false;
        }
        let mut values = self.motion.monitored.iter().zip(&self.detector.right);
        values.any(|(m, (value, _))| m.function == event.functions[0] && *value > 0.0)
    }

    /// Looks at what lies around a zero of one surface that may be a multiple one, and moves it there. Returns whether it is
    /// one: the next step tells where the function comes near to zero at the end of this one only.
    #[cold]
    #[inline(never)]
    pub(in crate::integrate) fn resolve_multiple_zero(
        &mut self,
        event: &mut Found,
        dt: f64,
    ) -> Result<bool, FieldError> {
        let &[function @ EventFunction::Surface(j)] = event.functions.as_slice() else {
            return Ok(true);
        };
        let monitored = &self.motion.monitored;
        let Some(m) = monitored.iter().find(|m| m.function == function) else {
            return Ok(true);
        };
        // Beside a zero that was just left and is divided out, the function is near zero anyway.
        if m.deflation.is_some() {
            return Ok(true);
        }
        let (m, theta) = (*m, event.theta);
        let noise = self.noise_of(function)?;
        if noise > BESIDE_A_POLE * self.along(&m, 0.0)?.0.abs() {
            return Ok(true);
        }
        let depth = noise.max(self.depth_of_touches(j, theta)?);
        // Up to where it is clear of zero on both sides.
        let least = 4.0 * EPS * (1.0 + self.t.abs() / dt);
        let (mut before, mut behind, mut width) = (theta, theta, least);
        let mut right = 0.0;
        while behind < 1.0 && right <= noise && right >= -depth {
            behind = (theta + width).min(1.0);
            right = self.along(&m, behind)?.0;
            width *= 4.0;
        }
        (width, before) = (least, before);
        while before > 0.0 && self.along(&m, before)?.0 <= noise {
            before = (theta - width).max(0.0);
            width *= 4.0;
        }
        if right > noise {
            let zero = self.zero_of(&m, Derivative::First, (before, behind), least)?;
            let Some(vertex) = zero else { return Ok(true) };
            if self.along(&m, vertex)?.0 >= -depth {
                (event.theta, event.touch) = (vertex, true);
                self.detector.depth = depth;
            }
        } else if right < -depth {
            event.touch = false;
            if let Some(zero) = self.triple_zero(&m, (before, behind), least)? {
                event.theta = zero;
            }
        } else {
            // Near to zero up to the end of the step.
            let is_last = self.t + dt >= self.horizon;
            if !is_last && 1.0 - before < AT_THE_END {
                return Ok(false);
            }
            event.touch |= self.turns_back(&m, (before, theta), depth)?;
        }
        Ok(true)
    }

    /// How far below zero a function may be at a touch: errors of the step make it so. A series has none where it matters.
    fn depth_of_touches(&mut self, j: usize, theta: f64) -> Result<f64, FieldError> {
        if self.stepper.in_use() == StepMethod::Taylor {
            return Ok(0.0);
        }
        let mut x = vec![0.0; self.x.len()];
        let mut gradient = x.clone();
        self.stepper.interpolant().at(theta, &mut x);
        let t = self.t + theta * self.stepper.interpolant().dt;
        self.system
            .gradient(j, t, &x, &self.motion.signs, &mut gradient)?;
        let tolerance = self.scale.along(&gradient, &x);
        Ok(TOUCH_DEPTH * tolerance)
    }

    /// Value and rate of a switching function along the extension, in the sense of the mode.
    fn along(&mut self, m: &Monitored, theta: f64) -> Result<(f64, f64), FieldError> {
        let EventFunction::Surface(j) = m.function else {
            return Ok((f64::NAN, f64::NAN));
        };
        let (mut x, mut velocity) = (vec![0.0; self.x.len()], vec![0.0; self.x.len()]);
        let extension = self.stepper.interpolant();
        extension.at(theta, &mut x);
        extension.derivative(theta, &mut velocity);
        let t = self.t + theta * extension.dt;
        if !self.motion.is_straight {
            self.motion.project(t, &mut x)?;
        }
        let n = self.system.n_surfaces();
        let (mut h, mut rates) = (vec![0.0; n], vec![0.0; n]);
        let signs = &self.motion.signs;
        self.system
            .surface_rates(t, &x, signs, &velocity, &mut h, &mut rates)?;
        self.stats.n_surface_evaluations += 1;
        Ok((m.orientation * h[j], m.orientation * rates[j]))
    }

    /// A Lie derivative of a switching function along the field of the region.
    fn lie_along(&self, m: &Monitored, order: usize, theta: f64) -> Result<LieValue, FieldError> {
        let EventFunction::Surface(j) = m.function else {
            return Ok(LieValue {
                value: f64::NAN,
                magnitude: f64::NAN,
            });
        };
        let mut x = vec![0.0; self.x.len()];
        let extension = self.stepper.interpolant();
        extension.at(theta, &mut x);
        let t = self.t + theta * extension.dt;
        let word = [self.motion.mode.entries()[j]; 2];
        self.system
            .lie_derivative(j, j, &word[..order], t, &x, &self.motion.signs)
    }

    /// Where the rate nearly vanishes between two points, without a change of sign: there the second derivative has one.
    fn triple_zero(
        &mut self,
        m: &Monitored,
        (lo, hi): (f64, f64),
        width: f64,
    ) -> Result<Option<f64>, FieldError> {
        if !self.motion.sliding.is_empty() {
            return Ok(None);
        }
        let Some(zero) = self.zero_of(m, Derivative::Second, (lo, hi), width)? else {
            return Ok(None);
        };
        let rate = self.along(m, zero)?.1;
        let is_flat = rate.abs() < FLAT * self.along(m, lo)?.1.abs()
            && rate.abs() < FLAT * self.along(m, hi)?.1.abs();
        Ok(is_flat.then_some(zero))
    }

    /// Does the function fall to no less than this depth from `theta` on, continued as the parabola through `before`?
    fn turns_back(
        &mut self,
        m: &Monitored,
        (before, theta): (f64, f64),
        depth: f64,
    ) -> Result<bool, FieldError> {
        let dt = self.stepper.interpolant().dt;
        let (first, last) = (self.along(m, before)?.1, self.along(m, theta)?.1);
        let curvature = (last - first) / ((theta - before) * dt);
        Ok(curvature > 0.0 && last * last <= 2.0 * curvature * depth)
    }

    /// Where a derivative changes its sign between two points; `None` if it does not.
    fn zero_of(
        &mut self,
        m: &Monitored,
        which: Derivative,
        (mut lo, mut hi): (f64, f64),
        width: f64,
    ) -> Result<Option<f64>, FieldError> {
        let mut at = |theta: f64| match which {
            Derivative::First => Ok(self.along(m, theta)?.1),
            Derivative::Second => Ok(self.lie_along(m, 2, theta)?.value),
        };
        let (mut left, mut right) = (at(lo)?, at(hi)?);
        let changes = left * right < 0.0;
        if !changes {
            return Ok(None);
        }
        // Regula falsi with the halved retained value, which ends with a step to rounding on either side.
        for _ in 0..MOST_HALVINGS {
            let theta = lo + (hi - lo) * left / (left - right);
            let value = at(theta)?;
            if value == 0.0 || hi - lo <= width {
                return Ok(Some(theta));
            }
            if value * left > 0.0 {
                (lo, left, right) = (theta, value, 0.5 * right);
            } else {
                (hi, right, left) = (theta, value, 0.5 * left);
            }
        }
        Ok(Some(0.5 * (lo + hi)))
    }
}
