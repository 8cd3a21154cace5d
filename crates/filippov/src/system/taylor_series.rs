//! Taylor series of motions.

use std::sync::Arc;

use super::{MotionJets, Place};

/// A system whose motions have Taylor series.
///
/// Duties of an implementer:
///
/// 1. [`is_analytic`](Self::is_analytic) may say `false` too often, [`hides_changes`](Self::hides_changes) `true`.
/// 2. [`eval_jets`](Self::eval_jets) is asked with what [`motion_jets`](Self::motion_jets) returned for the same system.
/// 3. A coefficient that does not exist at a place is not finite, nor are those of higher order.
pub trait TaylorSeries {
    /// Do all fields and switching functions have Taylor series wherever they are finite? Square roots and powers
    /// do not.
    fn is_analytic(&self) -> bool;

    /// Can fields or switching functions change although their Taylor coefficients show no change, as a late pulse does?
    fn hides_changes(&self) -> bool;

    /// Taylor coefficients up to `order` of the motions on these surfaces, in a region if there are none, with those of these
    /// curved switching functions (increasing), or of all; `None` if these motions have none.
    fn motion_jets(
        &self,
        sliding: &[usize],
        functions: Option<&[usize]>,
        order: usize,
    ) -> Option<Arc<MotionJets>>;

    /// Writes the coefficients at a place: (order + 1) rows.
    fn eval_jets(&self, jets: &MotionJets, place: &Place<'_>, out: &mut [f64]);
}
