//! Thresholds of steps and their lengths.

use super::EPS;

/// The first guess of a step is no shorter than this: it may still be shortened by many factors before the time ends it.
pub const SMALLEST_GUESS: f64 = f64::MIN_POSITIVE / EPS;

/// Nor is it shorter than so many roundings of the time.
pub const GUESS_ROUNDINGS: f64 = 1e3;

/// A motion of that many times the last step shows which step suits its mode.
pub const MANY: f64 = 8.0;

/// Share of the step last proposed in a mode with which the next motion there starts: its error is a
/// tenth, so that a point where the field is less smooth is rarely a rejection.
pub const FAMILIAR: f64 = 0.7;

/// The field does not limit a step of that many times the motion: within it the error is below a
/// hundredth of the tolerance.
pub const SEVERAL: f64 = 3.0;

/// How far ahead the first step looks then, as a multiple of the last motion in the mode.
pub const REACH: f64 = 1.25;

/// A moment moves each component of the state by this part of its size: short against the time in which anything changes,
/// and long enough for differences to be clear of rounding. To see whether an impulse depends on tangential velocities these are
/// changed by as much, and the approach is slower by the same factor again.
pub const MOMENT: f64 = 1e-5;

/// A moment in which the field changes by more than this part of its size is shortened, to a change of about [`MOMENT`]. A sliding
/// motion that its surfaces move by more than this part of a step is carried along with a jump of theirs.
pub const TOO_LARGE_A_CHANGE: f64 = 1e-2;

/// How often a moment is shortened: each time by up to the factor [`MOMENT`].
pub const MOST_SHORTENINGS: usize = 4;

/// Orders of Taylor steps per decimal digit of the relative tolerance, and beside that: where the coefficients are
/// cheap, and where they are dear. The least work on coefficients per unit of time takes 1.15 per digit (Jorba and
/// Zou); a step has costs of its own, and longer ones pay.
pub const TAYLOR_ORDER_CHEAP: (f64, f64) = (2.5, 3.0);
/// The same where the coefficients are dear.
pub const TAYLOR_ORDER_DEAR: (f64, f64) = (1.5, 2.0);

/// So many multipliers may depend on one another in series: the inverse of their equations is dense.
pub const LARGEST_SERIES_BLOCK: usize = 32;

/// Sliding on so many surfaces is integrated by series unless a method is named. All exit functions are searched
/// along the whole step: with more of them the short steps of a Runge-Kutta method are cheaper.
pub const MOST_AUTO_SERIES: usize = 10;

/// Coefficients are dear from so many operations on: then they take longer than the rest of a step.
pub const TAYLOR_DEAR: usize = 2000;

/// Pieces of a Taylor step in which a user's function without bounds is sampled: about as many steps would DOPRI5
/// have made.
pub const PIECES_OF_SERIES: u32 = 8;

/// Highest order of a Taylor step. On problems of the papers order 24 saves less than half a percent at any tolerance
/// down to 1e-13, and costs 2 % at 1e-9: most steps end at a switch.
pub const TAYLOR_LARGEST_ORDER: usize = 21;

/// A Taylor step that is shorter than this, in units of the rounding of the time, means that the motion comes to a
/// point where its field has no series.
pub const TAYLOR_SHORTEST: f64 = 1e4;

/// If the last Taylor coefficients are zero and one before them is below this, they may be those of a motion in huge units of
/// time, too small for a number: coefficient k falls like the k-th power of the unit. Another method integrates it then.
pub const TAYLOR_UNDERFLOW: f64 = 1e-100;

/// Where functions may change though no Taylor coefficient tells, steps grow by at most this factor ...
pub const WARY_GROWTH: f64 = 4.0;

/// ... from this part of the time span on, ...
pub const WARY_START: f64 = 1e-3;

/// ... and the field is compared with the series at these points of the step, too.
pub const WARY_POINTS: [f64; 4] = [0.2, 0.4, 0.6, 0.8];
