//! Events: of the run, and of a user.

use filippov_expr::{Enclosure, Motion};

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::motion::Guard;

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
