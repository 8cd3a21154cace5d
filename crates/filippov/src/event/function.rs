//! What is monitored.

use filippov_expr::{Enclosure, Motion};

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::field::Guard;
use crate::tolerances::TURNS_BACK;

/// What the event stage says of a step.
#[derive(Clone, Debug)]
pub enum Event {
    /// No guard vanishes in it.
    None,
    /// Here the first ones vanish.
    At(Found),
    /// A step as short as this is needed to tell.
    Shorten(f64),
}

/// The earliest zero of a step.
#[derive(Clone, Debug)]
pub struct Found {
    /// Where, in steps.
    pub theta: f64,
    /// What vanishes there.
    pub guards: SmallVec<[Guard; 2]>,
    /// They come within rounding of zero without a change of sign.
    pub touch: bool,
    /// Rounding blurs it: it may be a multiple one.
    pub is_blurred: bool,
    /// What is known of it if it is a multiple one.
    pub multiple: Multiple,
}

/// A multiple zero.
#[derive(Clone, Copy, Debug, Default)]
pub struct Multiple {
    /// How far below zero a function that touches may be there.
    pub depth: f64,
    /// Rounding of the function over the step.
    pub blur: f64,
    /// How many derivatives along f- and f+ vanish.
    pub vanishing: [usize; 2],
}

impl Found {
    /// Guards that vanish at the start of the step.
    pub fn here(guards: SmallVec<[Guard; 2]>) -> Self {
        Found {
            theta: 0.0,
            guards,
            touch: false,
            is_blurred: false,
            multiple: Multiple::default(),
        }
    }
}

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
            2.0 * value / (-rate + discriminant.sqrt())
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

/// What a step shows of an exit function: its values at both ends, and the range of those at the ends and the stages.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// At the start of the step.
    pub start: f64,
    /// At its end, once the step was attempted.
    pub end: f64,
    /// The least and the largest value; NaN if one of them is.
    pub range: [f64; 2],
}

impl Seen {
    /// This value at the start of a motion.
    pub fn at_start(value: f64) -> Self {
        Seen {
            start: value,
            end: value,
            range: [value; 2],
        }
    }

    /// A step is attempted.
    pub fn begin(&mut self) {
        self.range = [self.start; 2];
    }

    /// The value at a stage, last that at the end.
    #[inline(always)]
    pub fn see(&mut self, value: f64) {
        let [least, most] = &mut self.range;
        if value < *least || value.is_nan() {
            *least = value;
        }
        if value > *most || value.is_nan() {
            *most = value;
        }
        self.end = value;
    }

    /// The largest magnitude.
    pub fn size(&self) -> f64 {
        self.range[0].abs().max(self.range[1].abs())
    }
}

/// A scalar function of a user, g(t, x).
pub trait UserFunction {
    /// The value of g.
    ///
    /// # Errors
    /// If the function raises.
    fn value(&self, t: f64, x: &[f64]) -> Result<f64, FieldError>;

    /// Does [`enclose`](Self::enclose) give bounds? Then steps may be long: no zero in them is lost.
    fn has_bounds(&self) -> bool {
        false
    }

    /// Rigorous bounds of g and of its rate along a piece of motion; `None` if there are none, and zeros
    /// are then found by sampling.
    fn enclose(&self, motion: &dyn Motion) -> Option<Enclosure> {
        let _ = motion;
        None
    }
}

impl<F: Fn(f64, &[f64]) -> f64> UserFunction for F {
    fn value(&self, t: f64, x: &[f64]) -> Result<f64, FieldError> {
        Ok(self(t, x))
    }
}

/// A user's event: zeros of g are recorded, and may end the run.
pub struct UserEvent<'a> {
    /// The function.
    pub function: &'a dyn UserFunction,
    /// Only zeros where g rises (+1) or falls (-1); both if 0.
    pub direction: f64,
    /// End the run at that many zeros; never if 0.
    pub terminal: u64,
}
