//! Thresholds of decisions: where surfaces meet, at tangencies and two-folds, at accumulations.

use super::EPS;

/// Largest number of surfaces that meet and whose signs multiply one another: their 2^m fields are all evaluated, and
/// all 3^m modes looked at.
pub const MOST_MEETING: usize = 6;

/// Largest matrix whose principal minors are all computed, and whose characteristic polynomial is trusted: 256
/// eliminations, and coefficients that lose a digit or two.
pub const LARGEST_BY_MINORS: usize = 8;

/// Squarings that take the norm of a power to the spectral radius: the 2^26-th root of the factor between them, up
/// to the order of the matrix, is 1 up to 1e-7.
pub const CAYLEY_SQUARINGS: u32 = 26;

/// Two normalised bilinear equations are the same if all coefficients of their eliminants, sums of
/// products of coefficients of size 1, are rounding errors below this; so is a component of a null vector.
pub const PROPORTIONAL: f64 = 64.0 * EPS;

/// A discriminant of normalised equations up to this is that of a double root: the multipliers,
/// known to its square root, are then no better after a Newton step.
pub const DOUBLE_ROOT: f64 = 1e-14;

/// A normal component below this fraction of that on the other side is looked at again on the surface itself: the point of a
/// located event is on it up to some roundings only.
pub const OF_ROUNDING: f64 = 1e-12;

/// Events are located to better than this: a multiplier counts as -1 or +1 at an exit within this distance, two multipliers as
/// one, and a normal component as zero below this fraction of its terms.
pub const AT_SIDE: f64 = 1e-6;

/// A sign that decided at an intersection is doubtful if its quantity is smaller than this fraction
/// of its size: about the error of the fields at a located event. The fields are perturbed by as
/// much then.
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

/// Share of the largest ellipse around a stable root in which a quadratic form surely decreases: so
/// that rounding does not matter.
pub const BASIN_SHARE: f64 = 0.9;

/// The ratios of accumulating switches and impacts agree within this part of themselves and of their distance to 1: the
/// limit is then known to that share of the time until then.
pub const ACCUMULATION_AGREEMENT: f64 = 0.1;

/// Pieces (corners, strips, steps of a series) that one run of the hidden dynamics may take: some
/// tenths of a second. Of 830 000 random runs one did not end within, a fold passed at a ratio of
/// scalings of 27. Of more than six surfaces as many fewer as a piece takes longer.
pub const MOST_PIECES: usize = 100_000;

/// Interval tests in the search for the end of one piece: a zero needs as many as halvings isolate it,
/// so that this leaves room for dozens of near misses.
pub const ZERO_SEARCHES: usize = 2000;

/// Interval tests of one run of the hidden dynamics, of which a piece takes a few: motions that stay within rounding of a
/// border, as where two surfaces are in the same place, need thousands for each.
pub const MOST_TESTS: usize = 20 * MOST_PIECES;

/// Two zeros nearer together than this fraction of a piece are one touch.
pub const SHORTEST_PIECE: f64 = 1e-12;

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

/// Returns watched at most.
pub const MOST_RETURNS: usize = 20_000;

/// Beyond this distance, in units of the transition, the strips are negligible and each lap has the
/// factor gamma.
pub const FAR_OUT: f64 = 1e5;

/// Components of the hidden dynamics of three and more surfaces rest if they are slower than this
/// fraction of the field: Newton's method then finds the rest point.
pub const HIDDEN_REST: f64 = 1e-8;

/// Distance within which it must lie. A rest point with an eigenvalue below `HIDDEN_REST` over this
/// is not told from its neighbours.
pub const HIDDEN_REST_REACH: f64 = 1e-4;

/// Slowest outward motion, as a fraction of the field, that counts as leaving for ever; above the
/// rounding of the field, below the drift after an exit.
pub const HIDDEN_OUTWARDS: f64 = 1e-10;

/// First and last window of time, in units of 1/(size of the field), over which the range of an
/// oscillation is compared: tens to thousands of oscillations.
pub const FIRST_WATCH: f64 = 100.0;
/// See [`FIRST_WATCH`].
pub const LAST_WATCH: f64 = 1e5;

/// The range of an oscillation, seen at the ends of steps, is the same within this fraction.
pub const STEADY_CYCLE: f64 = 0.02;

/// |I - G(middle)^-1 G| below this makes a box hold one root at most, and Newton's method converge in it.
pub const INJECTIVE: f64 = 0.5;

/// Boxes looked at in the search for all roots in a cube: for three surfaces it ends within a
/// millisecond, for six it can take seconds.
pub const MOST_BOXES: usize = 100_000;

/// Multiplications of m x m matrices in that search, m^3 for each: some seconds for many surfaces, where the number of
/// boxes alone is no bound. Up to six surfaces it is none.
pub const MOST_BOX_WORK: usize = MOST_BOXES * 6 * 6 * 6;

/// Boxes after which the search looks whether the caller still waits: each takes a microsecond for three surfaces and a
/// tenth of a millisecond for six.
pub const BOXES_PER_LOOK: usize = 64;

/// Boxes narrower than this hold a root that is multiple up to rounding.
pub const NARROWEST_BOX: f64 = 1e-6;

/// Roots nearer together than this are one.
pub const SAME_ROOT: f64 = 1e-9;

/// Newton's method has converged: the next step would be below rounding.
pub const NEWTON_DONE: f64 = 1e-12;

/// Full Newton steps that a converging iteration can need.
pub const NEWTON_STEPS: usize = 30;

/// An iterate beyond this does not come back to a root in the cube that is worth tracking.
pub const FAR_FROM_THE_CUBE: f64 = 10.0;

/// The matrix of the sliding equations changes by less than this fraction of itself from the last multipliers to the root
/// that continues them; below 1 there is one root only, and steps are shortened until it is so. Towards a
/// fold the distance to it shrinks by a factor of four at most from one evaluation to the next.
pub const TRACKED_CHANGE: f64 = 0.75;

/// Two roots that meet farther than this from the multipliers tracked last are others: these are known up to the square
/// root of the last step.
pub const FOLD_REACH: f64 = 0.2;

/// Evaluations of which the multipliers are kept to track from: those of a step and its rejected attempts.
pub const MOST_TRACKED: usize = 16;

/// An outward spiral starts at this multiple of the tolerance from the intersection: a free parameter of a family
/// of solutions, small, and well above the error of the event.
pub const SPIRAL_START: f64 = 100.0;

/// Switches in one turn of an accumulation at most: a turn around two surfaces has four.
pub const LONGEST_TURN: usize = 32;

/// The square of the distance from which accumulating switches are extrapolated is at least this, also for a tolerance
/// of zero.
pub const NEAREST_ACCUMULATION: f64 = 1e-20;

/// All fields count as tangent to a surface if their normal components are below this fraction of their size: the
/// error of a point that accumulating switches lead to, or that was projected.
pub const TANGENT_TO_ALL: f64 = 1e-7;

/// Surfaces slid on whose multipliers are bounded over a step: for more, m 2^m bounds cost more than samples.
pub const MOST_ENCLOSED: usize = 3;

/// The multipliers are sought within these distances of their values at the ends of the step: the larger, the more
/// they may move; the smaller, the nearer another root may be.
pub const ROOT_BOXES: [f64; 3] = [0.2, 0.02, 0.002];

/// A linear system whose rows and columns have size 1 is singular if a pivot is below this number times the
/// number of unknowns: elimination leaves about one rounding error per unknown, amplified by the few
/// decades that physical coefficients spread over.
pub const SINGULAR_PIVOT: f64 = 64.0 * EPS;

/// Unknowns with entries below this fraction of the largest have no part in a vector of the null space:
/// rounding errors of elimination are far below it, genuine shares far above.
pub const NULL_VECTOR_ENTRY: f64 = 1e-6;

/// Share of a row that is taken off the diagonal of a singular relay problem. Proximal steps then converge by
/// about this factor each; the damped matrix has half of the digits left.
pub const RELAY_DAMPING: f64 = 1e-6;

/// Linear systems of a relay problem after which its solution looks whether the caller still waits: more than a decision
/// from the mode before usually needs. Each takes a millisecond for some thousand surfaces.
pub const PIVOTS_PER_LOOK: usize = 8;

/// Most contacts that close loops with one another, as those of seven bodies in a row: up to 1716 facets are looked at in
/// each evaluation.
pub const MOST_IN_LOOP: usize = 13;

/// A contact is redundant if this share of its strength or less is left where the others are taken out: rounding of
/// the elimination is far below it, and multipliers found from less than this would have lost most of their digits.
pub const REDUNDANT_PIVOT: f64 = 1e-11;

/// A matrix with diagonal 1 counts as definite, or as one with positive minors, if all pivots exceed this: what is
/// claimed of it (that a mode is the only one) has to be clear of rounding.
pub const DEFINITE_PIVOT: f64 = 1e-10;

/// Where steps shrink to nothing because multipliers end, their determinant is below this: it falls like the
/// square root of the time that is left.
pub const AT_FOLD: f64 = 1e-2;

/// At an exit a multiplier vanishes to this fraction of the largest one: the event is located to better than that.
pub const VANISHING_MULTIPLIER: f64 = 1e-9;

/// Functions above this are not looked at for being zero all along a step: rounding of states up to thousands is below.
pub const NEARLY_ZERO: f64 = 1e-10;

/// Time, in units of 1 plus its size, for which multipliers are held after a located start at which their equations vanish: then
/// they have changed by as much as rounding of the state changes the quotients, by about the root of rounding.
pub const HELD_AFTER: f64 = 1e-8;

/// Time, in units of 1 plus its size, after a start at which the equations of the multipliers vanish: how clear their root is
/// there stands for the start. Components are clear of [`TANGENT_TO_ALL`], and little else has changed.
pub const JUST_AFTER: f64 = 1e-6;

/// Distance, in units of 1 plus the size of a component, at which two surfaces are compared ...
pub const BESIDE: f64 = 1e-3;

/// ... and how far apart they may be there, in units of the gradient: far below the square of that distance.
pub const COINCIDE: f64 = 1e-11;

/// Surfaces that touch part in one direction if two places beside the point show the same to this, far above [`BESIDE`].
pub const ONE_DIRECTION: f64 = 1e-2;

/// Sliding has come to a two-fold where both normal components vanish within this multiple of the tolerance: then errors
/// of some steps make up the multiplier.
pub const AT_TWO_FOLD: f64 = 10.0;

/// A multiplier is not lost where the difference is above this multiple of the tolerance, relative to the speed: gradients of
/// normal components a hundred times larger than what they are made of are not expected.
pub const SMALL_JUMP: f64 = 1e4;

/// A multiplier was lost, and not at its end, where the shares of both fields beyond are above this.
pub const INSIDE_SHARES: f64 = 0.05;

/// A motion that was to stay on a surface has left it where h is above this multiple of the tolerance: errors of many
/// steps add up.
pub const LEFT_RESTING: f64 = 1e3;

/// A trial of the modes is lengthened by this factor, up to so many times, until every function is clear of rounding.
pub const LONGER_TRIAL: f64 = 10.0;
/// See [`LONGER_TRIAL`]: from a moment to about the time in which the state changes by its own size.
pub const MOST_LENGTHENINGS: i32 = 3;
