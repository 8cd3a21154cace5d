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

/// First offset into its own side for a field that is not finite on its surface, in units of
/// `EPS` times the size of the state; grown by 16 up to five times.
pub const SIDE_OFFSET: f64 = 8.0;

/// A point counts as on a surface up to rounding within this multiple of the offset.
pub const SIDE_REACH: f64 = 1e3;

/// Shortest step in units of the rounding of time.
pub const SHORTEST_STEP: f64 = 16.0 * EPS;

/// A step shorter than this fraction of its recent predecessors is looked at for a jump that no surface
/// declares.
pub const JUMP_SHRINK: f64 = 0.05;

/// The field jumps in a step if its range over the stages exceeds this fraction of its size ...
pub const JUMP_SIZE: f64 = 0.02;

/// ... and this share of the range falls between two neighbouring stages, at most half a step apart.
pub const JUMP_SHARE: f64 = 0.9;

/// A motion that can go no further towards the edge of its field has arrived at a surface that is nearer
/// than this fraction of the tolerance.
pub const ARRIVED: f64 = 1e-3;

/// That many switches without any progress of time end a run.
pub const MOST_SWITCHES_AT_ONE_TIME: u32 = 64;

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
