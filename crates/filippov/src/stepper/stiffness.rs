//! What was seen of the stiffness of a run.

use crate::status::Warning;
use crate::tolerances::{NOT_STIFF_SIGNS, STIFF_SIGNS};

/// Accepted steps between two looks, a power of two.
const LOOK_EVERY: u64 = 128;

/// What follows from the stiffness of a run.
pub(crate) enum Stiff {
    /// Nothing: it is not known to be stiff, or has been for long.
    Nothing,
    /// It is stiff from now on, and the method goes on.
    Warning(Box<Warning>),
    /// It is stiff from now on: the rest is left to the method for stiff motions.
    GoOnImplicitly,
}

/// What was seen of the steps so far: Hairer's count.
///
/// Every [`LOOK_EVERY`] steps, and at every step once there is a sign, the product of the step and the fastest rate of the
/// field is estimated. Where it lies at the end of the region of stability in 15 steps, not six in a row between them
/// without, stability and not accuracy limits the steps.
///
/// Reference: Hairer, Wanner (1996), section IV.2, "stiffness detection".
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stiffness {
    signs: u32,
    signs_against: u32,
    /// The time from which on the run counts as stiff.
    pub since: Option<f64>,
}

impl Stiffness {
    /// Is the step after that many accepted ones to be looked at?
    #[inline(always)]
    pub fn is_due(&self, n_steps: u64) -> bool {
        (n_steps & (LOOK_EVERY - 1) == 0 || self.signs > 0) && self.since.is_none()
    }

    /// Counts a step; returns whether the run counts as stiff now.
    pub fn count(&mut self, is_limited: bool) -> bool {
        if is_limited {
            self.signs_against = 0;
            self.signs += 1;
        } else if self.signs > 0 {
            self.signs_against += 1;
            if self.signs_against == NOT_STIFF_SIGNS {
                (self.signs, self.signs_against) = (0, 0);
            }
        }
        self.signs == STIFF_SIGNS
    }
}
