//! Bounds of the multipliers of many surfaces along a piece of motion.

use std::cell::RefCell;

use filippov_expr::{Interval, Motion};

use crate::error::FieldError;
use crate::mode::Signs;
use crate::sparse::{SparseRows, SparseSolver};
use crate::switching::{IntervalVector, Vector};
use crate::system::AffineSigns;

/// What bounds the multipliers of a mode where gradients and jumps, and so N = grad h B, are constant.
///
/// With g(lambda_0) the rates of the switching functions at fixed multipliers, lambda = lambda_0 - N^-1 g(lambda_0), and
///
///   |lambda - lambda_0| <= `<N>`^-1 |g(lambda_0)|,
///
/// where `<N>` has |N_ii| on the diagonal and -|N_ij| beside it, if that is an M-matrix: a sparse system again.
///
/// Reference: A. Ostrowski, Über die Determinanten mit überwiegender Hauptdiagonale, *Comment. Math. Helv.* 10
/// (1937); A. Neumaier, *Interval Methods for Systems of Equations* (1990), section 3.7.
pub struct AffineBounds {
    comparison: RefCell<SparseSolver>,
}

impl AffineBounds {
    /// The bounds for these surfaces; `None` if N varies, or its comparison matrix is no M-matrix. The point and
    /// the signs do not matter where N is constant. Returns also the number of evaluations.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn new(
        affine: &dyn AffineSigns,
        set: &[usize],
        (t, x): (f64, &[f64]),
        signs: &[f64],
    ) -> Result<(Option<Self>, u64), FieldError> {
        let parts = affine.affine_parts(set);
        let Some(mut parts) = parts.filter(|_| set.iter().all(|&j| affine.is_steady(j))) else {
            return Ok((None, 0));
        };
        let evaluations = parts.evaluate(affine, t, x, signs)?;
        let mut comparison = SparseSolver::default();
        let factored = comparison.factor(&comparison_of(parts.normal()));
        let mut positive = vec![1.0; set.len()];
        if factored.is_ok() {
            comparison.solve(&mut positive);
        }
        // A matrix with this pattern of signs that maps a positive vector to a positive one is an M-matrix.
        let is_m_matrix = factored.is_ok() && positive.iter().all(|v| v.is_finite() && *v > 0.0);
        let comparison = RefCell::new(comparison);
        Ok((
            is_m_matrix.then_some(AffineBounds { comparison }),
            evaluations,
        ))
    }

    /// The multipliers along a piece of motion, from their values `near` it; `None` if a rate has no bounds.
    pub fn enclose(
        &self,
        affine: &dyn AffineSigns,
        set: &[usize],
        motion: &dyn Motion,
        signs: &[f64],
        near: &[f64],
    ) -> Option<IntervalVector> {
        let mut signs = Signs::from_slice(signs);
        for (&j, &lambda) in set.iter().zip(near) {
            signs[j] = lambda;
        }
        let mut spread = Vector::with_capacity(set.len());
        for &j in set {
            let rate = affine.enclose_rate(j, motion, &signs)?;
            spread.push(rate.hi.max(-rate.lo));
        }
        if !spread.iter().all(|v| v.is_finite()) {
            return None;
        }
        self.comparison.borrow_mut().solve(&mut spread);
        // A rounding error per unknown and operation, many times over.
        let wider = |e: f64| 1.0e-12 + e.abs() * (1.0 + 1e-10);
        let pairs = near.iter().zip(spread);
        Some(pairs.map(|(&l, e)| Interval::around(l, wider(e))).collect())
    }
}

fn comparison_of(matrix: &SparseRows) -> SparseRows {
    let mut comparison = SparseRows::new(matrix.n_columns());
    for i in 0..matrix.n_rows() {
        let entries = matrix.row(i);
        comparison.push_row(entries.map(|(j, v)| (j, if i == j { v.abs() } else { -v.abs() })));
    }
    comparison
}
