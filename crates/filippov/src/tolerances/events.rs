//! Thresholds of the event stage.

/// The remainder of the cubic through end values and end slopes is taken as at most this fraction
/// of the spread of its Bernstein coefficients, that of the quartic through five samples as at most this multiple of the
/// fourth difference. For a sinusoid stepped with two radians a step it is 3 %, and error control keeps steps below that; for a
/// function whose fifth derivative is ten times its fourth, it is 0.08.
pub const REMAINDER: f64 = 0.25;

/// The exit functions are searched only if their smallest stage value is below this multiple of
/// their spread over the stages.
pub const STAGE_SPREAD: f64 = 0.75;

/// A function within this multiple of its rounding all along a piece is judged by samples: bounds of
/// it are wider than itself.
pub const HUGGING: f64 = 1e4;

/// A piece on which a function stays below this share of its values over the step may lie beside a multiple zero, where bounds
/// of it are wider than itself on all but the shortest pieces: beside a zero of order five u^5 has a slope whose terms are
/// of the size of u or u^2.
pub const FLAT_PIECE: f64 = 1e-2;

/// The same for a piece on which it stays below this multiple of its rounding: its terms cancel to seven digits.
pub const CANCELLED: f64 = 1e8;

/// After that many flat pieces of a step that bounds leave open, or pieces behind a multiple zero at its start, samples
/// decide: beside a simple zero there are a few.
pub const MOST_OPEN: u32 = 16;

/// The motion on a curved surface lies beside the continuous extension by at most this multiple of the
/// distances at the probes of the step ...
pub const MARGIN: f64 = 2.0;

/// What is measured at a few probes of a step is at most this multiple of it elsewhere. So is the change over the step of the
/// distance of the motion on a curved surface from the continuous extension: as theta^2 (1-theta)^2 it would be 5. And so is the
/// distance of a function from its series: the terms left out grow towards the end, and those next to the last that is kept may
/// cancel at the probes.
pub const PROBED: f64 = 8.0;

/// Bisections of a piece in which bounds have to decide everything, and after which samples decide where there are no bounds (a
/// root at the edge of its domain).
pub const BOUNDS_DEPTH: u32 = 6;

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

/// Samples that one search may take, and pieces that are cut in two because one of the user's functions is not finite in a part
/// of them. Bisecting to one zero, or to one end of where a function is finite, takes about four per level of depth; with more
/// the step is too long.
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

/// Most steps of Newton's method by which a point is moved into a region, or beside an intersection: from a distance like that of a
/// stage behind a curved surface, each squares what is missing.
pub const STEPS_INSIDE: usize = 5;

/// A point that was moved is where it was to go up to this share of the offset, which is near to rounding.
pub const OFFSET_ROUNDING: f64 = 0.75;

/// A point counts as on a surface up to rounding within this multiple of the offset.
pub const SIDE_REACH: f64 = 1.25;

/// A step shorter than this fraction of its recent predecessors is looked at for a jump that no surface
/// declares.
pub const JUMP_SHRINK: f64 = 0.05;

/// After so many short steps in a row since a jump that no surface declares, a tenth of them across jumps, the motion
/// chatters along it: a passage makes a few dozen, and this many take a tenth of a second.
pub const CHATTER_STEPS: u32 = 100_000;

/// The field jumps in a step if its range over the stages exceeds this fraction of its size ...
pub const JUMP_SIZE: f64 = 0.02;

/// ... and this share of the range falls between two neighbouring stages, at most half a step apart.
pub const JUMP_SHARE: f64 = 0.9;

/// Between two crossings with a method other than a series a function that falls to no less than this share of the tolerance
/// below zero touches it: accumulated rounding alone is up to a hundredth of the tightest tolerances.
pub const TOUCH_DEPTH: f64 = 1e-2;

/// One term of the expansion around a zero explains the value where the function is clear of rounding if it differs from it by
/// no more than this share: two terms may matter, and the zero is known to rounding only.
pub const EXPLAINED: f64 = 0.5;

/// After a touch of an exit function the search goes on from this share of the step behind it.
pub const BEYOND_TOUCH: f64 = 0.02;

/// A zero that is expected somewhere is searched for up to this many times the way there: behind it, so that it is
/// found, and not far, so that bounds are narrow.
pub const BEYOND_GUESS: f64 = 1.1;

/// A series and a function agree at the ends of a step up to this share of the terms of the series: above what rounding
/// does to sums of large terms, far below what another function would give.
pub const SAME_VALUE: f64 = 1e-10;

/// Terms of a series that together are below this share of the first one are left out where its zeros are told apart: the
/// work grows with the square of their number. The larger the share, the more zeros are too close to others to be told apart
/// by the terms that are kept, and are looked for again with all of them.
pub const SMALL_REST: f64 = 1e-3;

/// The same where it is only asked whether there is a zero at all: terms that others may outweigh.
pub const REST_BESIDE: f64 = 0.125;

/// The fields of both sides of a switch are compared at its point, and what each changes by over this share of the size of the
/// state into its own side tells how much of the difference is the rounding of the point.
pub const KINK_OFFSET: f64 = 1e-6;

/// A difference up to this share of that change is none. The point lies on the surface up to some units of rounding, 1e-9 of the
/// offset; over them a square root changes by 3e-5 of what it changes by over the offset. A jump that is mistaken for a kink is
/// below 1e-10 of what the field changes by over the size of the state.
pub const JUMP_AT_KINK: f64 = 1e-4;

/// While sliding on more surfaces than this the fields of all regions around them are not compared, and a switch counts as a jump unless
/// the structure of the signs excludes one.
pub const MOST_SLID_ON_AT_KINK: usize = 8;

/// Where the sign of a user's function behind a zero is looked at, in shares of the piece that is searched: near, and farther
/// from a double zero, where its values are within rounding for the square root of that.
pub const SHARES_BEHIND_ZERO: [f64; 5] = [1e-7, 1e-5, 1e-3, 1e-2, 1e-1];

/// As [`BOUNDS_DEPTH`], for a user's function: beside a root inside of it two of its zeros may be this near to the root.
pub const BOUNDS_DEPTH_BESIDE_ROOT: u32 = 32;

/// A zero of a user's function this near to a kink or a jump, in shares of the piece before it, counts only if the sign changes
/// clear of rounding on the way there: a root such as sqrt(|u|) is zero where u is within rounding of zero.
pub const NEAR_KINK: f64 = 1e-6;

/// Where that is looked at, in shares of the way from the zero to the kink.
pub const SHARES_BEFORE_KINK: [f64; 3] = [0.25, 0.5, 0.75];

/// Behind a touch the search goes on where a user's function is larger than its rounding by this factor: the touch is not
/// found again.
pub const BEHIND_TOUCH: f64 = 8.0;

/// Runs of systems with fewer surfaces monitor all of them: there is little to gain.
pub const FEWEST_ASLEEP: usize = 8;

/// The box in which functions are proved to keep their signs goes beyond where the motion has been by this share of the width of
/// that, and of the size of the state: it is left a few times in a run.
pub const BOX_GROWTH: f64 = 2.0;

/// Steps of a motion on several surfaces before its multipliers are bounded over a box, and how many steps such a box reaches ahead at
/// first: more than most motions between two switches of many contacts take.
pub const STEPS_BEFORE_BOX: u32 = 4;

/// A box reaches no more steps ahead: bounds become wide with it.
pub const MOST_BOX_STEPS: f64 = 64.0;

/// A function keeps its sign in the box if its least value there is this share of its largest: values within rounding count as zeros.
pub const CLEAR_IN_BOX: f64 = 1e-6;

/// What a step spreads over counts this much wider: its extension is raised to a higher order by a search, and differs by the error of
/// the step then.
pub const SPARE_SPREAD: f64 = 1.25;

/// Where a long step leads is bounded in so many pieces, if the sums of its coefficients do not tell.
pub const PIECES_OF_RANGES: u32 = 4;

/// Series of the motion contain the curved switching functions that are not asleep, if they are no more than this; else all: each
/// set of them has a program of its own.
pub const MOST_CHOSEN_SERIES: usize = 4;
