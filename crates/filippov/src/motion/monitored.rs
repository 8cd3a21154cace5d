//! What is monitored along a motion: a guard with its state at the start of the step.

use super::Guard;
use crate::tolerances::TURNS_BACK;

/// A zero at the start of the motion that is divided out: near `t` the function is
/// `leading * (time - t)^order`.
///
/// Dividing by (time - t)^order, instead of looking away for a moment, keeps every other zero,
/// however close.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deflation {
    /// The time of the zero.
    pub t: f64,
    /// Its multiplicity.
    pub order: i32,
    /// The first coefficient that does not vanish, in the sense of the mode (positive).
    pub leading: f64,
    /// The value that the function has there all the same, by rounding or errors of the step before.
    pub residual: f64,
    /// The motion did not slide before: but for rounding, nothing moved it off the surface.
    pub is_clean: bool,
    /// Rounding that blurred it where it was found to be a multiple one: closer zeros belong to it.
    pub blur: f64,
}

/// A monitored function with its state at the start of the step.
#[derive(Clone, Copy, Debug)]
pub struct Monitored {
    /// The function.
    pub guard: Guard,
    /// Its place among the switching functions, or among the exit functions of the motion.
    pub place: usize,
    /// +1 or -1: the sign of the function inside of the mode. All values below are times this.
    pub orientation: f64,
    /// Value at the start of the step.
    pub value: f64,
    /// Rate at the start of the step (surfaces only).
    pub rate: f64,
    /// Rate of change of the rate over the last step (surfaces only).
    pub curvature: f64,
    /// Is the function affine in (t, x), so that the filter may exclude zeros?
    pub affine: bool,
    /// The zero divided out.
    pub deflation: Option<Deflation>,
    /// Rounding of the function, as far as it was needed.
    pub noise: f64,
}

impl Monitored {
    /// The switching function that it is, if it is one.
    pub fn surface(&self) -> Option<usize> {
        self.guard.is_surface().then_some(self.place)
    }

    /// The exit function that it is, if it is one.
    pub fn exit(&self) -> Option<usize> {
        (!self.guard.is_surface()).then_some(self.place)
    }

    /// Predicted time to the next zero, from value, rate and curvature; infinite if none is ahead.
    pub fn time_to_zero(&self) -> f64 {
        let (value, rate, curvature) = (self.value, self.rate, self.curvature);
        if !(rate < 0.0 && value > 0.0) {
            return f64::INFINITY;
        }
        let discriminant = rate * rate - 2.0 * curvature * value;
        // No zero of the parabola: its lowest point is the nearest approach. Where that is not much lower than here the
        // function turns back, and steps that aim at it would shrink to nothing.
        if discriminant < 0.0 {
            let lowest = value - rate * rate / (2.0 * curvature);
            if lowest > TURNS_BACK * value {
                f64::INFINITY
            } else {
                -rate / curvature
            }
        } else {
            let time = 2.0 * value / (-rate + discriminant.sqrt());
            // A root that begins here, or began at the start of the last step, has an infinite slope: no time follows from it.
            if time > 0.0 {
                time
            } else {
                f64::INFINITY
            }
        }
    }

    /// The value at `time` after division by the zero at the start, in units of the step `dt`.
    pub fn deflated(&self, value: f64, time: f64, dt: f64, noise: f64) -> f64 {
        let Some(Deflation {
            t,
            order,
            leading,
            residual,
            is_clean,
            ..
        }) = self.deflation
        else {
            return value;
        };
        let limit = leading * dt.powi(order);
        let elapsed = (time - t) / dt;
        let power = elapsed.powi(order);
        // Closer to the zero than rounding can resolve, the limit is the better value; but beside a multiple zero a value that
        // is clear of rounding says that there is more than the leading term.
        let says_more = is_clean && order > 1 && value.abs() > 4.0 * noise;
        if elapsed <= 0.0 || limit.abs() * power <= noise && !says_more {
            limit
        } else if residual < -noise {
            // What the function starts below zero fades out where it is far above that.
            let share = limit * power / (8.0 * residual);
            (value - residual / (1.0 + share * share)) / power
        } else {
            value / power
        }
    }
}
