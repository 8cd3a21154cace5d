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

/// A value counts as zero below this multiple of `EPS` times the sum of the magnitudes it is made of: the rounding of the
/// state plus that of a few operations. Also the shortest step in units of the time: its ends are told apart.
pub const ROUNDING: f64 = 16.0 * EPS;

/// A point lies on a surface, and has no side, if the switching function is below this, relative to 1 plus the largest state: the
/// rounding of a switching function of some hundred terms.
pub const ON_SURFACE: f64 = 1e-13;

/// Where sliding, a contact or a map takes directions from a basis, one is gone if its length is below this fraction of that of the
/// longest: what is left of it is the rounding of products with matrices whose entries are up to some thousands.
pub const GONE: f64 = 1e-12;

/// A Lie derivative counts as zero below this fraction of the sum of the magnitudes it is made of.
/// Points handed in by a user or found as a root carry a few rounding errors, amplified by at most
/// some thousands through the derivatives; a genuine value this small would be
/// indistinguishable from a tangency in the sense of every later comparison.
pub const TANGENT: f64 = 1e-11;

/// A Taylor coefficient of a guard counts as zero below this fraction of what the sizes and rates of its terms allow; of the
/// force of a contact, which is a second derivative, of the accelerations around.
pub const VANISHING_GERM: f64 = 1e-10;

/// Newton's method for the multipliers of divided equations starts at all points of this grid.
pub const BLOW_UP_STARTS: [f64; 4] = [-0.9, -0.3, 0.3, 0.9];

/// Highest derivative of a guard that is looked at, as a Lie derivative or as a Taylor coefficient, before the guard counts
/// as zero along the motion and the point as undecided.
pub const MAX_LIE_ORDER: usize = 6;

/// A point nearer than this fraction of the tolerance counts as reached: the limit of Newton's method.
pub const ARRIVED: f64 = 1e-3;

/// The errors of some steps together are at most this multiple of the tolerance: a body beyond a wall by less is on it, a sliding
/// motion whose normal components differ by less may have reached a two-fold or a double zero (the multiplier, a quotient with
/// this denominator, then consists mostly of errors), and the last terms of a Taylor step stay below the tolerance by this factor.
pub const ERRORS_OF_STEPS: f64 = 10.0;

/// Less than this, relative to the time, is no progress: bodies with the speed of rounding hit one another that often.
pub const NO_PROGRESS: f64 = 32768.0 * EPS;

/// That many switches without any progress of time end a run.
pub const MOST_SWITCHES_AT_ONE_TIME: u32 = 64;

/// After so many touches without any progress of time a root that holds the motion to its surface is looked for.
pub const MOST_TOUCHES_AT_ONE_TIME: usize = 3;

/// After so many touches of one surface, one after the other, it is asked whether the motion rests there.
pub const MOST_TOUCHES_IN_A_ROW: usize = 8;

/// So many switches in one place are worth a word: a run that goes on in time makes as many in many places.
pub const MANY_SWITCHES: u64 = 100_000;

/// A run of fewer switches does not ask in which place they are.
pub const FEW_SWITCHES: u64 = MANY_SWITCHES / 100;

/// Two states are in one place if no component differs by more than this part of its size.
pub const SAME_PLACE: f64 = 0.1;

/// Switches that are kept where only the last state is wanted: several turns of the longest accumulation.
pub const LATEST_SWITCHES: usize = 8 * LONGEST_TURN;

/// Returns to a section have to agree with those one period before so many times in a row, and at least one period
/// long: a single agreement may be a turning point.
pub const LEAST_AGREEMENTS: usize = 2;

/// Returns whose distance shrinks faster and faster still come together if it shrinks by this part of itself. Less is
/// what the errors of the steps make of a distance that stays, which are ten times smaller than what counts as agreement.
pub const COMING_TOGETHER: f64 = 0.01;
