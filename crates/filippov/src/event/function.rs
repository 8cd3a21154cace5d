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

/// A scalar function of a user, g(t, x), which may read the discrete states q.
pub trait UserFunction {
    /// The value of g.
    ///
    /// # Errors
    /// If the function raises.
    fn value(&self, t: f64, x: &[f64], q: &[f64]) -> Result<f64, FieldError>;

    /// Does [`enclose`](Self::enclose) give bounds? Then steps may be long: no zero in them is lost.
    fn has_bounds(&self) -> bool {
        false
    }

    /// Rigorous bounds of g and of its rate along a piece of motion; `None` if there are none, and zeros
    /// are then found by sampling.
    fn enclose(&self, motion: &dyn Motion, q: &[f64]) -> Option<Enclosure> {
        let _ = (motion, q);
        None
    }
}

impl<F: Fn(f64, &[f64]) -> f64> UserFunction for F {
    fn value(&self, t: f64, x: &[f64], _: &[f64]) -> Result<f64, FieldError> {
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
