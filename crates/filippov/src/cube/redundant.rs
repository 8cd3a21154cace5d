//! Intersections where some equations say nothing: sliding of higher order.

use super::normal_fields::NormalFields;
use super::small_matrix::Matrix;
use crate::tolerances::{NEWTON_DONE, NEWTON_STEPS};

/// The multipliers of least norm that make the fields tangent to the surfaces `rows`; `None` if there are none
/// in the cube.
///
/// On an intersection like x = x' = 0 of x'' = -a sign(x) - b sign(x') all fields are tangent to the surface x = 0,
/// whatever the multipliers; the other equation determines a line of them, and the motion does not depend on
/// which is taken. Gauss-Newton steps from 0, lambda <- lambda - G^T (G G^T)^-1 g.
///
/// Reference: A. Levant, Sliding order and sliding accuracy in sliding mode control, *Int. J. Control* 58 (1993).
pub fn least_multipliers(fields: &NormalFields, rows: &[usize]) -> Option<Vec<f64>> {
    let m = fields.m();
    let mut lambda = vec![0.0; m];
    for _ in 0..NEWTON_STEPS {
        let (g, jacobian) = (fields.interpolate(&lambda), fields.jacobian(&lambda));
        let mut gram = Matrix::zeros(rows.len());
        for (a, &i) in rows.iter().enumerate() {
            for (b, &j) in rows.iter().enumerate() {
                gram[(a, b)] = (0..m).map(|k| jacobian[(i, k)] * jacobian[(j, k)]).sum();
            }
        }
        let residual: Vec<f64> = rows.iter().map(|&i| g[i]).collect();
        let shifts = gram.solve(&residual)?;
        let mut largest = 0.0_f64;
        for (k, lambda) in lambda.iter_mut().enumerate() {
            let step: f64 = rows
                .iter()
                .zip(&shifts)
                .map(|(&i, s)| jacobian[(i, k)] * s)
                .sum();
            *lambda -= step;
            largest = largest.max(step.abs());
        }
        if !largest.is_finite() {
            return None;
        }
        if largest <= NEWTON_DONE {
            return lambda.iter().all(|l| l.abs() < 1.0).then_some(lambda);
        }
    }
    None
}
