//! Events: of the run, and of a user.

use filippov_expr::{Enclosure, Motion};

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::motion::{Guard, Held, Piece};
use crate::system::{Place, Setting};

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
    /// The surfaces whose switching functions vanish.
    pub fn surfaces(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        self.guards.iter().filter_map(|guard| match guard {
            Guard::Surface(j) => Some(*j),
            _ => None,
        })
    }

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

    /// The smooth parts of g, with bounds: no zero is lost then. `None` if they are not known: zeros are found by sampling.
    fn parts(&self) -> Option<&dyn SmoothParts> {
        None
    }

    /// The surface whose switching function g is a multiple of, and the sign of the factor. Then g is zero where the motion arrives
    /// at that surface, and nowhere else.
    fn surface(&self) -> Option<(usize, f64)> {
        None
    }

    /// Does g contain the sign of this surface? Where the motion slides on it, [`value_held`](Self::value_held) is asked.
    fn reads(&self, surface: usize) -> bool {
        let _ = surface;
        false
    }

    /// The value of g at a place of a motion that slides on surfaces whose signs it contains: these are what holds the motion there.
    ///
    /// # Errors
    /// If the function raises.
    fn value_held(
        &self,
        (t, x): (f64, &[f64]),
        piece: &Piece,
        held: &Held,
    ) -> Result<f64, FieldError> {
        let _ = held;
        self.value(t, x, &piece.discrete)
    }
}

/// A function whose kinks and jumps are known: it is smooth between the zeros of switching functions inside of it.
///
/// Duties of an implementer:
///
/// 1. The parts are numbered from 0: first the switching functions, at last the function itself.
/// 2. A part reads the signs of parts before it alone, and is smooth while they stay as they are, also a little beyond the
///    zeros of these parts.
/// 3. [`enclose`](Self::enclose) gives rigorous bounds.
pub trait SmoothParts {
    /// How many switching functions there are: 0 for a smooth function.
    fn n_inner(&self) -> usize;

    /// The value of a part where the parts before it have these signs.
    fn value(&self, part: usize, place: &Place<'_>) -> f64;

    /// Bounds of a part and of its rate along a piece of motion.
    fn enclose(&self, part: usize, motion: &dyn Motion, setting: Setting<'_>) -> Enclosure;

    /// The part as an affine function, if it is one and reads no signs.
    fn affine(&self, part: usize) -> Option<&AffinePart> {
        let _ = part;
        None
    }
}

/// What an affine function is made of beside a constant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AffinePart {
    /// Its rate in time.
    pub of_time: f64,
    /// Its slopes in the states that it contains.
    pub slopes: Vec<(u32, f64)>,
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
