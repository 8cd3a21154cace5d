//! The moments sliding vector field on the intersection of two surfaces.

use super::{sign_of, RuleFailure};
use crate::cube::{Matrix, NormalFields, Vector};

/// The weights w that solve
///
/// ```text
/// sum_k w_k f_j^k = 0 (j = 1, 2),   sum_k w_k = 1,   sum_k k_1 k_2 w_k |f^k|_2 = 0
/// ```
///
/// with the components normal to the surfaces in units of their gradients. They are positive where the
/// intersection attracts, and exactly those of sliding on one surface where this begins to leave it.
///
/// # Errors
/// If there are not two surfaces, or the system is singular.
///
/// Reference: L. Dieci, F. Difonzo, The moments sliding vector field on the intersection of two manifolds,
/// *J. Dyn. Diff. Equ.* 29 (2017).
pub fn moments(fields: &NormalFields) -> Result<Vec<f64>, RuleFailure> {
    if fields.m() != 2 {
        return Err(RuleFailure::NotTwoSurfaces { m: fields.m() });
    }
    let size = fields.size();
    let mut system = Matrix::zeros(4);
    for pattern in 0..4 {
        let f = fields.at(pattern);
        let alternating = sign_of(pattern, 0) * sign_of(pattern, 1);
        system[(0, pattern)] = f[0] / size;
        system[(1, pattern)] = f[1] / size;
        system[(2, pattern)] = 1.0;
        system[(3, pattern)] = alternating * f[0].hypot(f[1]) / size;
    }
    system
        .solve(&[0.0, 0.0, 1.0, 0.0])
        .map(Vector::into_vec)
        .ok_or(RuleFailure::Undetermined)
}
