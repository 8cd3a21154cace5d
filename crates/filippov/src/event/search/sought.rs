//! What the search of a step comes to.

use smallvec::smallvec;

use crate::event::{Found, Multiple};
use crate::motion::Guard;

/// What the search of a step has come to.
pub(crate) struct Sought {
    /// The length of the step.
    pub dt: f64,
    /// The first zero so far.
    pub found: Option<Found>,
    /// Up to here the other guards are searched.
    pub reach: f64,
    /// A guard was not searched though nothing was proved about it.
    pub dismissed: bool,
    /// How long the next step may be.
    pub longest: f64,
}

/// What came of the search for a zero of one guard.
#[derive(Clone, Copy)]
pub(crate) enum Search {
    /// There is none.
    Nothing,
    /// The first is here.
    At(f64, AtZero),
    /// A shorter step is needed to tell.
    Unsure,
}

/// How a guard vanishes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AtZero {
    /// It changes its sign, and is steep enough for rounding not to blur that.
    Steep,
    /// It changes its sign where rounding blurs it.
    Blurred,
    /// It only touches zero.
    Touch,
}

impl AtZero {
    /// A crossing by its slope: beside a multiple zero it is flat, however steep the guard is on the way there.
    pub fn crossing(is_steep: bool) -> Self {
        match is_steep {
            true => AtZero::Steep,
            false => AtZero::Blurred,
        }
    }
}

impl Sought {
    /// The search of a step of length `dt`.
    pub fn new(dt: f64) -> Self {
        Sought {
            dt,
            found: None,
            reach: 1.0,
            dismissed: false,
            longest: f64::INFINITY,
        }
    }

    /// Keeps a zero if it is the first, or one with the first: closer than `together`.
    pub fn keep(&mut self, guard: Guard, (theta, kind): (f64, AtZero), together: f64) {
        let (touch, is_blurred) = (kind == AtZero::Touch, kind != AtZero::Steep);
        match &mut self.found {
            Some(first) if theta > first.theta + together => {}
            Some(first) if theta >= first.theta - together => {
                first.guards.push(guard);
                first.touch &= touch;
                first.is_blurred |= is_blurred;
            }
            _ => {
                self.found = Some(Found {
                    theta,
                    guards: smallvec![guard],
                    touch,
                    is_blurred,
                    multiple: Multiple::default(),
                })
            }
        }
    }
}
