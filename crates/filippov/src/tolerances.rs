//! Numerical thresholds, each with its reason. No other file holds a small number of this kind.

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

/// Highest order of Lie derivative looked at before a point counts as undecided.
pub const MAX_LIE_ORDER: usize = 6;

/// The remainder of the cubic through end values and end slopes is taken as at most this fraction
/// of the spread of its Bernstein coefficients. For a sinusoid stepped with two radians a step
/// it is 3 %, and error control keeps steps below that.
pub const CUBIC_REMAINDER: f64 = 0.25;

/// The remainder of the quartic through five samples is taken as at most this multiple of the
/// fourth difference; for a function whose fifth derivative is ten times its fourth, it is 0.08.
pub const QUARTIC_REMAINDER: f64 = 0.25;

/// The exit functions are searched only if their smallest stage value is below this multiple of
/// their spread over the stages.
pub const STAGE_SPREAD: f64 = 0.75;

/// A function within this multiple of its rounding all along a piece is judged by samples: bounds of
/// it are wider than itself.
pub const HUGGING: f64 = 1e4;

/// The motion on a curved surface lies beside the continuous extension by at most this multiple of the
/// distances at the probes of the step ...
pub const MARGIN: f64 = 2.0;

/// ... and that distance changes over the step by at most this multiple of itself: as theta^2 (1-theta)^2
/// it would be 5.
pub const MARGIN_SLOPE: f64 = 8.0;

/// Where no bounds exist after that many bisections (a root at the edge of its domain), samples decide.
pub const UNBOUNDED_DEPTH: u32 = 6;

/// The same for multipliers on intersections, whose bounds prove something only on short pieces where the fields
/// change fast.
pub const UNPROVED_DEPTH: u32 = 14;

/// After that many pieces of a step without a proof the samples decide in the rest of it: the reason is not a short
/// pulse, which lies in few pieces, but lasts, as near a fold of the multipliers.
pub const MOST_UNPROVED: u32 = 64;

/// Halvings of a step in the attempt to prove it free of zeros before it is searched with samples;
/// each costs two bounds, the search at least two evaluations of the field.
pub const PROOF_DEPTH: u32 = 3;

/// Bisections of a step in the search for zeros; 2^-48 of a step is below the rounding of time.
pub const MAX_DEPTH: u32 = 48;

/// Where a change of sign is narrowed down to rounding and the function is still larger than this
/// fraction of its values over the step, it has a pole or a jump there and no zero.
pub const POLE: f64 = 1e-3;

/// Samples that one search may take; bisecting to one zero takes about four per level of depth.
pub const MOST_SAMPLES: u32 = 1000;

/// Zeros of the user's functions in one step; with more the step is too long for them.
pub const MOST_ZEROS: usize = 64;

/// A search that needed more bisections than this met a function that the step does not resolve;
/// the step may not grow then.
pub const RESOLVED_DEPTH: u32 = 3;

/// Farthest extrapolation of the continuous extension, in steps (DISODE45, section 3).
pub const EXTRAPOLATION: f64 = 1.3;

/// A step towards the edge of a one-sided field aims to end at this fraction of the predicted
/// time to the surface, so that the surface lies at 1.15 steps, well inside the extrapolation.
pub const ONE_SIDED_AIM: f64 = 0.87;

/// A surface is not aimed at if its function, continued as a parabola, falls to no less than this share of its value: an
/// error of the curvature by a factor of two leaves it positive.
pub const TURNS_BACK: f64 = 0.5;

/// First offset into its own side for a field that is not finite on its surface, in units of
/// `EPS` times the size of the state; grown by 16 up to five times.
pub const SIDE_OFFSET: f64 = 8.0;

/// A point counts as on a surface up to rounding within this multiple of the offset.
pub const SIDE_REACH: f64 = 1.25;

/// Shortest step in units of the rounding of time.
pub const SHORTEST_STEP: f64 = 16.0 * EPS;

/// A step shorter than this fraction of its recent predecessors is looked at for a jump that no surface declares.
pub const JUMP_SHRINK: f64 = 0.05;

/// The field jumps in a step if its range over the stages exceeds this fraction of its size ...
pub const JUMP_SIZE: f64 = 0.02;

/// ... and this share of the range falls between two neighbouring stages, at most half a step apart.
pub const JUMP_SHARE: f64 = 0.9;

/// A motion that can go no further towards the edge of its field has arrived at a surface that is nearer
/// than this fraction of the tolerance.
pub const ARRIVED: f64 = 1e-3;

/// Less than this, relative to the time, is no progress: bodies with the speed of rounding hit one another that often.
pub const NO_PROGRESS: f64 = 32768.0 * EPS;

/// That many switches without any progress of time end a run.
pub const MOST_SWITCHES_AT_ONE_TIME: u32 = 64;

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

/// A multiplier counts as -1 or +1 at an exit within this distance; the event is located to better than that.
pub const AT_SIDE: f64 = 1e-6;

/// How far a multiplier may go beyond its end at first where forces balance to rounding: clear of the rounding of exit
/// functions. It grows up to `AT_SIDE`.
pub const FIRST_SLACK: f64 = 1e-12;

/// The diagonal entry that vanishes at an exit by loss of stability is below this fraction of the
/// other one. Only the kind of event is confirmed by it, so it may be coarse.
pub const VANISHING_DIAGONAL: f64 = 1e-2;

/// A sign that decided at an intersection is doubtful if its quantity is smaller than this fraction
/// of its size: about the error of the fields at a located event. The fields are perturbed by as much then.
pub const DOUBTFUL: f64 = 1e-8;

/// Where an exit leaves several ways open, the hidden dynamics starts beside the root by this much.
pub const BESIDE_THE_ROOT: f64 = 1e-6;

/// Distance from a root of three and more surfaces that loses stability at which the hidden dynamics starts: the pair
/// of eigenvalues that vanishes there says nothing, and what decides grows like the square of the distance.
pub const UNSTABLE_START: f64 = 0.1;

/// Drift of the normal components after an exit, as a fraction of their size: small enough to leave
/// all signs as they are, large enough to pass the fold in some thousands of units of time.
///
/// Also the allowance for the eigenvalue that vanishes there.
pub const AFTER_THE_EXIT: f64 = 1e-5;

/// Offsets along the border of a corner, in units of the transition, from which the hidden dynamics
/// is tried. They grow until the strips are crossed without a change; an outcome of a narrower band
/// of offsets may be missed.
pub const CORNER_OFFSETS: [f64; 9] = [0.05, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0, 30.0, 1000.0];

/// Share of the largest ellipse around a stable root in which a quadratic form surely decreases: so
/// that rounding does not matter.
pub const BASIN_SHARE: f64 = 0.9;

/// Successive ratios of accumulating returns agree within this fraction.
pub const ACCUMULATION_AGREEMENT: f64 = 0.1;

/// Returns that shrink by less than this do not accumulate soon enough to be extrapolated.
pub const SLOWEST_ACCUMULATION: f64 = 0.95;

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

/// Returns watched to tell a cycle from a slow approach to the root, once the motion is known to be bounded.
pub const RETURNS_TO_A_CYCLE: usize = 400;

/// Returns watched at most.
pub const MOST_RETURNS: usize = 20_000;

/// Beyond this distance, in units of the transition, the strips are negligible and each lap has the factor gamma.
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

/// Share of the last step over which rates at an event are taken by differences: short against the time in
/// which anything changes, long against rounding.
pub const DRIFT_SHARE: f64 = 1e-4;

/// A normal component below this fraction of its terms, where an intersection is left, is that of a multiplier
/// that just reached its end; the event is located to better than that.
pub const DEPARTS_TANGENTIALLY: f64 = 1e-6;

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

/// A matrix with diagonal 1 counts as definite, or as one with positive minors, if all pivots exceed this: what is
/// claimed of it (that a mode is the only one) has to be clear of rounding.
pub const DEFINITE_PIVOT: f64 = 1e-10;

/// The equations of the weights of least norm, normalised, hold up to this: some roundings.
pub const LEAST_NORM_DONE: f64 = 1e-14;

/// Keeps a Hessian regular where fewer weights are positive than there are equations; so small that Newton's method
/// is not slowed down.
pub const LEAST_NORM_RIDGE: f64 = 1e-15;

/// Newton steps for the weights of least norm: one per set of positive weights, of which there are a few.
pub const LEAST_NORM_STEPS: usize = 100;

/// Largest number of surfaces at whose intersection all Filippov solutions are listed: there are 3^m modes to look
/// at, and those of three and more surfaces take a search for all roots.
pub const MOST_LISTED: usize = 3;

/// Surfaces that know of one another of which each is scaled on its own in the trial for uniqueness; beyond, only all
/// together are, in two orders.
pub const MOST_SCALED_SINGLY: usize = 12;

/// Combinations of candidates of the parts of an intersection that are listed.
pub const MOST_COMBINED: usize = 81;

/// After a touch of an exit function the search goes on from this share of the step behind it.
pub const BEYOND_TOUCH: f64 = 0.02;

/// Where steps shrink to nothing because multipliers end, their determinant is below this: it falls like the
/// square root of the time that is left.
pub const AT_FOLD: f64 = 1e-2;

/// A zero that is expected somewhere is searched for up to this many times the way there: behind it, so that it is
/// found, and not far, so that bounds are narrow.
pub const BEYOND_GUESS: f64 = 1.1;

/// Halvings of a step whose bounds have to decide everything; beyond that samples help.
pub const PROVED_DEPTH: u32 = 6;

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
pub const MOST_AUTO_SERIES: usize = 5;

/// Coefficients are dear from so many operations on: then they take longer than the rest of a step.
pub const TAYLOR_DEAR: usize = 2000;

/// The last terms of a Taylor step, times this, may be as large as the tolerance: errors of many steps add up.
pub const TAYLOR_SHARE: f64 = 10.0;

/// Pieces of a Taylor step in which a user's function without bounds is sampled: about as many steps would DOPRI5
/// have made.
pub const PIECES_OF_SERIES: u32 = 8;

/// Highest order of a Taylor step: beyond it rounding limits the error, and not the step.
pub const TAYLOR_LARGEST_ORDER: usize = 24;

/// A Taylor step that is shorter than this, in units of the rounding of the time, means that the motion comes to a
/// point where its field has no series.
pub const TAYLOR_SHORTEST: f64 = 1e4;

/// A tick of a clock counts as at a time within this multiple of the size of both in periods: a few roundings.
pub const SAME_TICK: f64 = 8.0 * EPS;

/// A map changes a velocity if the derivative is above this fraction of the sizes that make it up: differences
/// of black boxes have an error of 1e-10.
pub const NO_IMPULSE: f64 = 1e-8;

/// Switches that are kept where only the last state is wanted: several turns of the longest accumulation.
pub const LATEST_SWITCHES: usize = 8 * LONGEST_TURN;

/// Actions in one instant at most. A chain of bodies that pass an impulse on needs about the square of their number.
pub const MOST_ACTIONS_AT_ONE_TIME: usize = 1000;

/// The ratios of the last intervals between impacts agree within this share of their distance to 1: the time of rest
/// is then known to that share of the time until then.
pub const IMPACTS_AGREE: f64 = 0.1;

/// Impacts whose flights rise less than this multiple of the rounding of the surface are not resolved.
pub const UNRESOLVED_FLIGHT: f64 = 64.0;

/// Largest number of surfaces in contact and slid on at once, whose combinations are all looked at.
pub const MOST_IN_CONTACT: usize = 6;

/// At an exit a multiplier vanishes to this fraction of the largest one: the event is located to better than that.
pub const VANISHING_MULTIPLIER: f64 = 1e-9;

/// An expression of whole numbers is one itself within this: a few roundings.
pub const WHOLE_NUMBER: f64 = 1e-12;

/// Functions above this are not looked at for being zero all along a step: rounding of states up to thousands is below.
pub const NEARLY_ZERO: f64 = 1e-10;

/// Distance, in units of 1 plus the size of a component, at which two surfaces are compared ...
pub const BESIDE: f64 = 1e-3;

/// ... and how far apart they may be there, in units of the gradient: far below the square of that distance.
pub const COINCIDE: f64 = 1e-11;

/// Sliding has come to a two-fold where both normal components vanish within this multiple of the tolerance: then errors
/// of some steps make up the multiplier.
pub const AT_TWO_FOLD: f64 = 10.0;

/// Newton's method has come to a two-fold, in tolerances of the state: far below what matters, above rounding.
pub const SETTLED: f64 = 1e-6;

/// A function beyond zero by more than this on one side of what is slid on has another sign there: steps end before.
pub const BETWEEN_SIDES: f64 = 1e-8;

/// A motion that was to stay on a surface has left it where h is above this multiple of the tolerance: errors of many
/// steps add up.
pub const LEFT_RESTING: f64 = 1e3;

/// Static friction above the kinetic one by less than this fraction makes no jump of the acceleration that could be told
/// from the error of the time at which the motion breaks away.
pub const NO_GAP: f64 = 1e-6;

/// A body that touches another is in contact if the force exceeds this fraction of the accelerations around.
pub const NO_FORCE: f64 = 1e-10;

/// A body touches without speed if that is below this fraction of the tolerance.
pub const SLOW: f64 = 0.1;

/// A point beyond a surface at which bodies touch by less than this multiple of the tolerance is on it.
pub const SLIPPED: f64 = 10.0;

/// Bodies that overlap by less than this fraction of their positions touch; an action that moves them changes h by more
/// than this fraction.
pub const PENETRATION: f64 = 1e-6;

/// Returns to a section have to agree with those one period before so many times in a row, and at least one period
/// long: a single agreement may be a turning point.
pub const LEAST_AGREEMENTS: u64 = 2;

/// How far behind an event a step of the method for stiff motions ends that is taken anew for it, as a share of the
/// step: first so far that the error of the continuous extension leaves the event inside, then so near that the
/// extension lies no farther from the manifold of the motion than rounding, also at a stiffness of 1e8.
pub const AIM_MARGINS: [f64; 2] = [1e-3, 1e-7];

/// The end of the region of stability of DOPRI5 on the negative axis: the product of step and rate at which stability
/// limits the step (Hairer, Wanner 1996, section IV.2).
pub const STIFF_DOPRI5: f64 = 3.25;

/// That of DOP853 (Hairer's choice).
pub const STIFF_DOP853: f64 = 6.1;

/// That of a Taylor step whose velocity hardly changes: without a fast rate the product would be as small as that change.
pub const STIFF_SERIES: f64 = 2.0;

/// The velocity of a Taylor step hardly changes: its terms of higher order together are less than this share of it, ...
pub const TAYLOR_SLOW: f64 = 0.2;

/// ... or that many tolerances. At the limit of stability, where the last of 18 terms is a tenth of the tolerance, the
/// largest ones of a fast component are some hundreds; those of an oscillation as large as its state are 1e5 and more.
pub const TAYLOR_NOISE: f64 = 1e3;

/// Steps at the limit of stability that make a run stiff, and steps in a row away from it that make it begin to count
/// anew (Hairer's choice).
pub const STIFF_SIGNS: u32 = 15;
/// See [`STIFF_SIGNS`].
pub const NOT_STIFF_SIGNS: u32 = 6;
