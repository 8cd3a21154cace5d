//! How a step is divided into parts. A step is as long as the state allows; its changes may bend much more along it.

/// A step has so many parts at first at most: what is stiff is damped.
const MOST_AT_FIRST: f64 = 16.0;

/// No part is shorter than this share of a step. What changes faster is a transient, which the method damps, or a singular point.
const LEAST: f64 = 1.0 / 1024.0;
/// The same where derivatives are differences: these are not known to all digits, and what is left of a value that is zero looks rough.
const LEAST_OF_DIFFERENCES: f64 = 1.0 / 16.0;

/// The share of the tolerance that a part may have as its error.
const ALLOWED: f64 = 0.3;

/// The error of a part goes with this power of its length.
const ORDER: f64 = 14.0;

/// How much shorter or longer than the last one a part may be, and by how much it is shorter than it could be.
const SHORTER: f64 = 0.25;
const LONGER: f64 = 2.0;
const SAFETY: f64 = 0.9;

/// The length of the next part of a step, and what is left of the step.
pub(super) struct Lengths {
    left: f64,
    dt: f64,
    least: f64,
    allowed: f64,
}

/// The error that a part may have in runs with this tolerance.
pub(super) fn allowed(rtol: f64) -> f64 {
    ALLOWED * rtol
}

impl Lengths {
    /// Of a step of this length, whose fastest changes have this rate.
    pub fn new(length: f64, fastest: f64, rtol: f64, by_differences: bool) -> Self {
        // NaN becomes one part, and stays NaN.
        let parts = (length * fastest / longest(rtol)).ceil();
        let least = match by_differences {
            true => LEAST_OF_DIFFERENCES,
            false => LEAST,
        };
        Lengths {
            left: length,
            dt: length / parts.clamp(1.0, MOST_AT_FIRST).max(1.0),
            least: least * length,
            allowed: allowed(rtol),
        }
    }

    /// The length of the next part, and how much of the step is left before it; `None` at the end.
    pub fn next(&mut self) -> Option<(f64, f64)> {
        if self.left == 0.0 {
            return None;
        }
        self.dt = self.left / (self.left / self.dt).ceil().max(1.0);
        Some((self.dt, self.left))
    }

    /// Is this error of the last part small enough for the part to be taken? The next one is as long as it tells.
    pub fn takes(&mut self, error: f64) -> bool {
        let is_taken = error <= self.allowed || self.dt <= self.least;
        if is_taken {
            self.left = match self.dt < self.left {
                true => self.left - self.dt,
                false => 0.0,
            };
        }
        let factor = SAFETY * (self.allowed / error).powf(1.0 / ORDER);
        // The next part is longer if there was no error at all, but not by more than after any other part.
        self.dt = (self.dt * factor.clamp(SHORTER, LONGER)).max(self.least);
        is_taken
    }
}

/// How long a part of a step may be, in units of 1 / |Df|: one of length z has the relative error 7e-15 z^14.
fn longest(rtol: f64) -> f64 {
    (rtol / 1e-12).powf(1.0 / ORDER).max(1.0)
}
