//! Derivatives of motions by states and multipliers, for methods of stiff systems.

use std::sync::Arc;

use super::{Linearisation, MotionJacobian, Place};

/// A system that has the derivatives of its motions exactly, but for rounding.
///
/// Duties of an implementer:
///
/// 1. [`eval_jacobian`](Self::eval_jacobian) is asked with what [`motion_jacobian`](Self::motion_jacobian) returned for the same
///    system.
/// 2. A derivative that does not exist at a place is not finite.
pub trait Linearisations {
    /// The derivatives of the field of the motions on these surfaces, in a region if there are none; `None` if
    /// these motions have them by differences only.
    fn motion_jacobian(&self, sliding: &[usize]) -> Option<Arc<MotionJacobian>>;

    /// Writes these derivatives at a place; entries of its signs on the surfaces slid on are their multipliers.
    fn eval_jacobian(&self, jacobian: &MotionJacobian, place: &Place<'_>, out: &mut Linearisation);
}
