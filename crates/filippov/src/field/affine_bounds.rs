//! Bounds of the multipliers of many surfaces along a piece of motion.

use std::cell::RefCell;

use filippov_expr::{Interval, Motion};

use crate::error::FieldError;
use crate::mode::Signs;
use crate::sparse::{SparseRows, SparseSolver};
use crate::switching::{IntervalVector, Vector};
use crate::system::{AffineParts, AffineSigns};

/// What bounds the multipliers of a mode where gradients and jumps, and so N = grad h B, are constant.
///
/// With g(lambda_0) the rates of the switching functions at fixed multipliers, lambda = lambda_0 - N^-1 g(lambda_0). For
/// all g within m +- r
///
///   |N^-1 g - N^-1 m| <= `<N>`^-1 r,
///
/// where `<N>` has |N_ii| on the diagonal and -|N_ij| beside it, if that is an M-matrix: a sparse system again. The rate
/// of lambda is bounded as lambda is, from that of g.
///
/// Reference: A. Ostrowski, Über die Determinanten mit überwiegender Hauptdiagonale, *Comment. Math. Helv.* 10
/// (1937); A. Neumaier, *Interval Methods for Systems of Equations* (1990), section 3.7.
pub struct AffineBounds {
    normal: RefCell<SparseSolver>,
    comparison: RefCell<SparseSolver>,
}

/// The multipliers along a piece of motion, and their rates.
pub struct EnclosedMultipliers {
    /// The multipliers.
    pub values: IntervalVector,
    /// Their derivatives in time; empty if they are not known to be finite.
    pub rates: IntervalVector,
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
        let Some(mut parts) = parts.filter(AffineParts::is_steady) else {
            return Ok((None, 0));
        };
        let evaluations = parts.evaluate(affine, t, x, signs)?;
        let (mut normal, mut comparison) = (SparseSolver::default(), SparseSolver::default());
        let is_factored = normal.factor(parts.normal()).is_ok()
            && comparison.factor(&comparison_of(parts.normal())).is_ok();
        let mut positive = vec![1.0; set.len()];
        if is_factored {
            comparison.solve(&mut positive);
        }
        // A matrix with this pattern of signs that maps a positive vector to a positive one is an M-matrix.
        let is_m_matrix = is_factored && positive.iter().all(|v| v.is_finite() && *v > 0.0);
        let bounds = AffineBounds {
            normal: RefCell::new(normal),
            comparison: RefCell::new(comparison),
        };
        Ok((is_m_matrix.then_some(bounds), evaluations))
    }

    /// The multipliers along a piece of motion, from their values `near` it; `None` if a rate of a switching function has
    /// no bounds.
    pub fn enclose(
        &self,
        affine: &dyn AffineSigns,
        set: &[usize],
        motion: &dyn Motion,
        signs: &[f64],
        near: &[f64],
    ) -> Option<EnclosedMultipliers> {
        let mut signs = Signs::from_slice(signs);
        for (&j, &lambda) in set.iter().zip(near) {
            signs[j] = lambda;
        }
        let (mut values, mut rates) = (IntervalVector::new(), IntervalVector::new());
        for &j in set {
            let enclosure = affine.enclose_rate(j, motion, &signs)?;
            values.push(enclosure.value);
            rates.push(enclosure.rate);
        }
        let mut values = self.changes(&values)?;
        for (value, &lambda) in values.iter_mut().zip(near) {
            *value = *value + Interval::point(lambda);
        }
        let rates = self.changes(&rates).unwrap_or_default();
        Some(EnclosedMultipliers { values, rates })
    }

    /// -N^-1 g for all g within these bounds; `None` if one of them is not finite.
    fn changes(&self, g: &[Interval]) -> Option<IntervalVector> {
        if !g.iter().all(|g| g.is_bounded()) {
            return None;
        }
        let mut middles: Vector = g.iter().map(|g| 0.5 * (g.lo + g.hi)).collect();
        let mut radii: Vector = g.iter().map(|g| 0.5 * (g.hi - g.lo)).collect();
        self.normal.borrow_mut().solve(&mut middles);
        self.comparison.borrow_mut().solve(&mut radii);
        let largest = middles.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        // A rounding error per unknown and operation, many times over.
        let rounding = 1e-12 + 1e-10 * largest;
        let pairs = middles.iter().zip(&radii);
        let around = |(m, r): (&f64, &f64)| Interval::around(-m, r.abs() * (1.0 + 1e-10) + rounding);
        Some(pairs.map(around).collect())
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
