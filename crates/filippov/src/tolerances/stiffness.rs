//! Thresholds of the method for stiff motions, and of the signs of stiffness.

/// How far behind an event a step of the method for stiff motions ends that is taken anew for it, as a share of the
/// step: first so far that the error of the continuous extension leaves the event inside, then so near that the
/// extension lies no farther from the manifold of the motion than rounding, also at a stiffness of 1e8.
pub const AIM_MARGINS: [f64; 2] = [1e-3, 1e-7];

/// The product of step and rate at which stability limits a Taylor step whose velocity hardly changes: without a fast rate the product would be as small as that change.
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

/// An unknown of a linear system is coupled with very many others if its row and column together have more entries than this
/// times the root of the number of unknowns: it alone makes the band about that wide.
pub const COUPLED_WITH_MANY: f64 = 4.0;

/// At most so many of them are kept apart: each costs one solution with the rest.
pub const MOST_BORDERED: usize = 64;

/// They are kept apart if the operations without that are this many times as many.
pub const BORDER_GAIN: f64 = 2.0;

/// A solution with a border is accurate if its residual is this part of the terms in each row: far below the tolerance of any
/// run, and above the rounding of long sums.
pub const BORDER_ACCURACY: f64 = 1e-11;
