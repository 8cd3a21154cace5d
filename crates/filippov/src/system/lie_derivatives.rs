//! Lie derivatives of switching functions.

use super::Place;
use crate::error::FieldError;

/// The value of a Lie derivative and the sum of the magnitudes that make it up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LieValue {
    /// The derivative.
    pub value: f64,
    /// Sum of the absolute values of the terms; `value` counts as zero far below it.
    pub magnitude: f64,
}

/// The rate of a switching function along a field, with what it depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatePartials {
    /// L_f h.
    pub rate: f64,
    /// The size of its terms; `rate` counts as zero far below it.
    pub magnitude: f64,
    /// Its derivative in t.
    pub time: f64,
}

/// Which sides a step of differentiation takes: +1 for f+, -1 for f- of the surface concerned.
pub type Word<'a> = &'a [i8];

/// Highest order of Lie derivative that differences give.
pub(super) const HIGHEST_DIFFERENCE: usize = 3;

/// Below this fraction of its magnitude a Lie derivative of this order, found by differences, counts as zero.
pub(super) fn tolerance_of_differences(order: usize) -> f64 {
    match order {
        0 | 1 => 1e-8,
        2 => 1e-4,
        _ => 1e-2,
    }
}

/// A system that has its Lie derivatives exactly, but for rounding.
///
/// Duties of an implementer:
///
/// 1. Derivatives up to [`max_lie_order`](Self::max_lie_order) can be asked for, and that order is at least 1.
/// 2. A derivative that does not exist at a place is not finite.
/// 3. A derivative that is zero lies below [`lie_tolerance`](Self::lie_tolerance) times its magnitude.
pub trait LieDerivatives {
    /// The Lie derivative L_{f^w_k} ... L_{f^w_1} h_i, where f^w is the field with entry `j` of the
    /// signs replaced by w.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn lie_derivative(
        &self,
        i: usize,
        j: usize,
        word: Word,
        place: &Place<'_>,
    ) -> Result<LieValue, FieldError>;

    /// The first Lie derivatives of h_j along f- and f+, where one evaluation gives both; `signs[j]` is ignored.
    fn first_lie_derivatives(&self, j: usize, place: &Place<'_>) -> Option<[LieValue; 2]> {
        let _ = (j, place);
        None
    }

    /// Below this fraction of its magnitude a Lie derivative of this order counts as zero.
    fn lie_tolerance(&self, order: usize) -> f64;

    /// Highest order of Lie derivative worth asking for.
    fn max_lie_order(&self) -> usize;

    /// Writes the gradient in x of the rate L_f h_j along the field with these signs.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn rate_gradient(
        &self,
        j: usize,
        place: &Place<'_>,
        gradient: &mut [f64],
    ) -> Result<RatePartials, FieldError>;
}
