//! A piece of constant mode.

use smallvec::SmallVec;

use crate::mode::Mode;

/// A piece of constant mode.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Segment {
    /// Start.
    pub t_start: f64,
    /// End.
    pub t_end: f64,
    /// The mode.
    pub mode: Mode,
    /// Index of the first step, and one past the last.
    pub steps: (usize, usize),
    /// lambda of the surfaces slid on, in their order, at the start; NaN for those in contact.
    pub multipliers: SmallVec<[f64; 2]>,
    /// The discrete states.
    pub discrete: Vec<f64>,
}
