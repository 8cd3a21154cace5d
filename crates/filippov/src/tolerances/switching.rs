//! Thresholds of decisions: where surfaces meet, at tangencies and two-folds, at accumulations.

use super::EPS;

/// Largest number of surfaces that meet and whose signs multiply one another: their 2^m fields are all evaluated, and
/// all 3^m modes looked at. Of surfaces in contact and slid on, all combinations are.
pub const MOST_MEETING: usize = 6;

/// Largest matrix whose principal minors are all computed, and whose characteristic polynomial is trusted: 256
/// eliminations, and coefficients that lose a digit or two.
pub const LARGEST_BY_MINORS: usize = 8;

/// Squarings that take the norm of a power to the spectral radius: the 2^26-th root of the factor between them, up
/// to the order of the matrix, is 1 up to 1e-7.
pub const CAYLEY_SQUARINGS: u32 = 26;

/// A sum of products of numbers of size 1 is rounding below this, and what is made of them alike: then two normalised
/// bilinear equations are the same, their two roots are one, a component of a null vector is none, and, times the number of
/// unknowns, a pivot of a linear system is that of a singular one.
pub const PROPORTIONAL: f64 = 64.0 * EPS;

/// Events are located to better than this, in time, state and multipliers. So a multiplier counts as -1 or +1 at an exit within
/// this distance, two multipliers as one, and a root in a box of this width as multiple; a normal component, an entry of a null
/// vector, and a gap of static friction above the kinetic one as none below this fraction of their terms; bodies that overlap by
/// less than this fraction of their positions touch; and a motion is looked at this long after its start, where the equations of
/// its multipliers vanish.
pub const AT_SIDE: f64 = 1e-6;

/// A sign that decided at an intersection is doubtful if its quantity is smaller than this fraction
/// of its size: about the error of the fields at a located event, or at a limit of switches, and above that of differences of
/// functions that are called (1e-10). The fields are perturbed by as much then. Components of the hidden dynamics that are
/// slower rest: this is above the rounding of the field, and below the drift after an exit. A rest point lies within the root of
/// it, or an eigenvalue is too small to tell it from its neighbours.
pub const DOUBTFUL: f64 = 1e-8;

/// Largest distance from a root that loses stability or meets another one at which the hidden
/// dynamics starts: an eigenvalue vanishes there, and the motion off the root grows like the square of the distance. Also
/// the distance from u = 0 of a second start, if the hidden dynamics from there rests in a repelling mode.
pub const UNSTABLE_START: f64 = 0.1;

/// Drift of the normal components after an exit, as a fraction of their size: small enough to leave
/// all signs as they are, large enough to pass the fold in some thousands of units of time.
///
/// Also the allowance for the eigenvalue that vanishes there.
pub const AFTER_THE_EXIT: f64 = 1e-5;

/// The ratios of accumulating switches and impacts agree within this part of themselves and of their distance to 1: the
/// limit is then known to that share of the time until then.
pub const ACCUMULATION_AGREEMENT: f64 = 0.1;

/// Work that one decision may take, some tenths of a second: pieces of a run of the hidden dynamics, with the interval tests in
/// the search for their ends, or boxes looked at for all roots in a cube. Of 830 000 random runs one did not end within, a fold
/// passed at a ratio of scalings of 27; motions that stay within rounding of a border, as where two surfaces are in the same
/// place, need thousands of tests for each piece. For three surfaces the search for roots ends within a millisecond, for six it
/// can take seconds. Of more surfaces as many fewer as a piece, or a box, takes longer.
pub const MOST_WORK: usize = 100_000;

/// Interval tests in the search for the end of one piece: a zero needs as many as halvings isolate it,
/// so that this leaves room for dozens of near misses.
pub const ZERO_SEARCHES: usize = 2000;

/// Halvings and Newton steps for an event time; Newton's method ends them after a few, halvings alone
/// after 53 in a bracket of one size.
pub const MOST_HALVINGS: usize = 200;

/// Returns this near to the root, and oscillations this small, are at the root.
pub const AT_THE_ROOT: f64 = 1e-7;

/// Returns that differ by less than this fraction lie on a cycle.
pub const CYCLE: f64 = 1e-10;

/// Returns watched to tell a cycle from a slow approach to the root, once the motion is known to be
/// bounded.
pub const RETURNS_TO_A_CYCLE: usize = 400;

/// Beyond this distance, in units of the transition, the strips are negligible and each lap has the
/// factor gamma.
pub const FAR_OUT: f64 = 1e5;

/// First and last window of time, in units of 1/(size of the field), over which the range of an
/// oscillation is compared: tens to thousands of oscillations.
pub const FIRST_WATCH: f64 = 100.0;
/// See [`FIRST_WATCH`].
pub const LAST_WATCH: f64 = 1e5;

/// The range of an oscillation, seen at the ends of steps, is the same within this fraction.
pub const STEADY_CYCLE: f64 = 0.02;

/// |I - G(middle)^-1 G| below this makes a box hold one root at most, and Newton's method converge in it.
pub const INJECTIVE: f64 = 0.5;

/// Roots nearer together than this are one.
pub const SAME_ROOT: f64 = 1e-9;

/// Numbers of size 1 nearer together than this are the same, up to the rounding of what they were computed from: Newton's
/// method has converged, zeros of a polynomial on an interval of size 1 are one touch, terms of the hidden dynamics are left
/// out (far below what is doubtful, and below the difference of returns to a cycle), a value is a whole number.
pub const SAME_NUMBER: f64 = 1e-12;

/// Full Newton steps that a converging iteration can need.
pub const NEWTON_STEPS: usize = 30;

/// An iterate beyond this does not come back to a root in the cube that is worth tracking.
pub const FAR_FROM_THE_CUBE: f64 = 10.0;

/// The matrix of the sliding equations changes by less than this fraction of itself from the last multipliers to the root
/// that continues them; below 1 there is one root only, and steps are shortened until it is so. Towards a
/// fold the distance to it shrinks by a factor of four at most from one evaluation to the next.
pub const TRACKED_CHANGE: f64 = 0.75;

/// Evaluations of which the multipliers are kept to track from: those of a step and its rejected attempts.
pub const MOST_TRACKED: usize = 16;

/// An outward spiral starts at this multiple of the tolerance from the intersection: a free parameter of a family
/// of solutions, small, and well above the error of the event.
pub const SPIRAL_START: f64 = 100.0;

/// Switches in one turn of an accumulation at most: a turn around two surfaces has four.
pub const LONGEST_TURN: usize = 32;

/// Surfaces of which all 3^m modes are tried where a motion may rest, as all lead back, and whose multipliers are bounded over a step by
/// m 2^m bounds: for more, samples cost less. Where so many meet, the errors of the place are looked at in all regions around it.
pub const FEW_SURFACES: usize = 3;

/// How far beside such an intersection the modes are tried, in units of the tolerance: at its edge, and well inside.
pub const PLACES_BESIDE_REST: [f64; 2] = [1.0, 1e-3];

/// A motion that a root holds to a surface is followed there up to so many tolerances at most: it leaves beyond the first.
pub const MOST_CLINGING: f64 = 4.0;

/// So near to its surface, in tolerances, a function that holds a motion like a root falls by more than twice this part of its fall over
/// one tolerance.
pub const CLOSE_TO_ROOT: f64 = 1.0 / 16.0;

/// How far such a motion may bend away from the straight lines that are recorded, in tolerances.
pub const BEND_OF_CLINGING: f64 = 0.25;

/// Straight lines of one such motion at most.
pub const PIECES_OF_CLINGING: usize = 10_000;

/// Flights that shrink by this factor or more at a time end soon, whether the factors agree or not.
pub const FAST_SHRINKING: f64 = 0.5;

/// The limit of impacts is known to third order up to this ratio. Beyond it the difference of two limits of second order, times
/// r^2 / (1 - r^2), is the rounding of the times between its members.
pub const SLOW_SHRINKING: f64 = 0.95;

/// Rounds whose ratio lies above this count as such that do not end; a geometric series of a smaller ratio is a limit before its rounds
/// are below the tolerance.
pub const STEADY_ROUNDS: f64 = 0.99;

/// Where ever smaller rounds are left to their mean, the velocity of the last round is that of the motion that follows up to this
/// part of its speed: the mean of a round differs by a multiple of its size, and another mean by a multiple of the speed.
pub const SAME_MEAN: f64 = 1e-3;

/// The square of the distance from which accumulating switches are extrapolated is at least this part of that of the size of the
/// states, also for a tolerance of zero.
pub const NEAREST_ACCUMULATION: f64 = 1e-20;

/// The multipliers are sought within these distances of their values at the ends of the step: the larger, the more
/// they may move; the smaller, the nearer another root may be.
pub const ROOT_BOXES: [f64; 3] = [0.2, 0.02, 0.002];

/// Most contacts that close loops with one another, as those of seven bodies in a row: up to 1716 facets are looked at in
/// each evaluation.
pub const MOST_IN_LOOP: usize = 13;

/// A matrix with diagonal 1 counts as definite, or as one with positive minors, if all pivots exceed this: what is
/// claimed of it (that a mode is the only one) has to be clear of rounding. A contact is redundant if this share of its row
/// or less is left beside the others.
///
/// The root of it, where as many digits are kept as are lost, is the share of a row that is taken off the diagonal of a
/// relay problem that is not definite, and how well the multipliers of redundant contacts have to satisfy their equations.
pub const DEFINITE_PIVOT: f64 = 1e-10;

/// Where steps shrink to nothing because multipliers end, their determinant is below this: it falls like the
/// square root of the time that is left.
pub const AT_FOLD: f64 = 1e-2;

/// Time, in units of 1 plus its size, for which multipliers are held after a located start at which their equations vanish: then
/// they have changed by as much as rounding of the state changes the quotients, by about the root of rounding.
pub const HELD_AFTER: f64 = 1e-8;

/// Distances, in units of 1 plus the size of a component, at which two surfaces are compared: the square of the first is far above
/// rounding, and the ninth power of the second.
pub const BESIDE: [f64; 2] = [1e-3, 3e-2];

/// Surfaces that touch part in one direction if two places beside the point show the same to this, far above [`BESIDE`].
pub const ONE_DIRECTION: f64 = 1e-2;

/// A multiplier is not lost where the difference is above this multiple of the tolerance, relative to the speed: gradients of
/// normal components a hundred times larger than what they are made of are not expected.
pub const SMALL_JUMP: f64 = 1e4;

/// A multiplier was lost, and not at its end, where the shares of both fields beyond are above this.
pub const INSIDE_SHARES: f64 = 0.05;

/// A motion that was to stay on a surface has left it where h is above this multiple of the tolerance: errors of many
/// steps add up.
pub const LEFT_RESTING: f64 = 1e3;

/// Lengths of the trials of a mode, in moments, until every function is clear of rounding: the last is about the time in which the state
/// changes by its own size.
pub const TRIALS: [f64; 4] = [1.0, 1e1, 1e2, 1e3];
