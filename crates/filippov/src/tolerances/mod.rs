//! Numerical thresholds, each with its reason. No other file holds a small number of this kind.

mod actions;
mod events;
mod stepping;
mod stiffness;
mod switching;

pub use actions::*;
pub use events::*;
pub use stepping::*;
pub use stiffness::*;
pub use switching::*;

/// Unit roundoff times two.
pub const EPS: f64 = f64::EPSILON;

/// A switching function counts as zero below this multiple of `EPS` times the sum of the
/// magnitudes it is made of: the rounding of the state plus that of a few operations.
pub const SURFACE_NOISE: f64 = 16.0 * EPS;

/// A Lie derivative counts as zero below this fraction of the sum of the magnitudes it is made of.
/// Points handed in by a user or found as a root carry a few rounding errors, amplified by at most
/// some thousands through the derivatives; a genuine value this small would be
/// indistinguishable from a tangency in the sense of every later comparison.
pub const TANGENT: f64 = 1e-11;

/// Highest order of the Taylor coefficients of a guard that are looked at before it counts as zero.
pub const GERM_ORDER: usize = 6;

/// A Taylor coefficient of a guard counts as zero below this fraction of what the sizes and rates of its terms allow.
pub const VANISHING_GERM: f64 = 1e-10;

/// Newton's method for the multipliers of divided equations starts at all points of this grid.
pub const BLOW_UP_STARTS: [f64; 4] = [-0.9, -0.3, 0.3, 0.9];

/// Highest order of Lie derivative looked at before a point counts as undecided.
pub const MAX_LIE_ORDER: usize = 6;

/// Shortest step in units of the rounding of time.
pub const SHORTEST_STEP: f64 = 16.0 * EPS;

/// Shortest step where the time is zero: below it numbers lose digits, and a step that is rounded to zero is no step.
pub const SHORTEST_STEP_AT_ZERO: f64 = f64::MIN_POSITIVE;

/// A point nearer than this fraction of the tolerance counts as reached: the limit of Newton's method.
pub const ARRIVED: f64 = 1e-3;

/// Less than this, relative to the time, is no progress: bodies with the speed of rounding hit one another that often.
pub const NO_PROGRESS: f64 = 32768.0 * EPS;

/// That many switches without any progress of time end a run.
pub const MOST_SWITCHES_AT_ONE_TIME: u32 = 64;

/// Switches that are kept where only the last state is wanted: several turns of the longest accumulation.
pub const LATEST_SWITCHES: usize = 8 * LONGEST_TURN;

/// Returns to a section have to agree with those one period before so many times in a row, and at least one period
/// long: a single agreement may be a turning point.
pub const LEAST_AGREEMENTS: usize = 2;

/// Returns whose distance shrinks faster and faster still come together if it shrinks by this part of itself. Less is
/// what the errors of the steps make of a distance that stays, which are ten times smaller than what counts as agreement.
pub const COMING_TOGETHER: f64 = 0.01;
