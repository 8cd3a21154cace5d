//! Where two roots of the sliding equations meet, and how far the equations are from it.

use super::normal_fields::NormalFields;
use super::small_matrix::{Matrix, Vector};
use crate::tolerances::{NEWTON_STEPS, ROOT_BOXES, SAME_NUMBER};

/// Two roots as one, in equations that have been moved so that they meet.
#[derive(Clone, Debug, PartialEq)]
pub struct MergedRoot {
    /// The multipliers, with det G = 0.
    pub lambda: Vec<f64>,
    /// g there. The two roots meet where it is taken off all fields.
    pub residual: Vec<f64>,
}

/// The point near `near` where two roots meet, when g is moved as little as needed along the left null vector of G.
///
/// Newton's method for the multipliers, the null vector v and the distance mu in
///
/// ```text
/// g(lambda) = mu e,      G(lambda) v = 0,      c . v = 1,
/// ```
///
/// with e and c near the left and the right null vector of G. Derivatives of G are exact: it is linear in each
/// multiplier. `None` if there is no such point nearer than the first of [`ROOT_BOXES`].
///
/// Reference: A. Griewank, G. W. Reddien, Characterization and computation of generalized turning points,
/// *SIAM J. Numer. Anal.* 21 (1984).
pub fn merged_root(fields: &NormalFields, near: &[f64]) -> Option<MergedRoot> {
    let m = fields.m();
    let sizes: Vec<f64> = (0..m).map(|j| fields.row_size(j)).collect();
    let unit = fields.scaled(&sizes.iter().map(|size| 1.0 / size).collect::<Vec<_>>());
    let jacobian = unit.jacobian(near);
    let c = near_null_vector(&jacobian)?;
    let e = near_null_vector(&jacobian.transposed())?;
    let (mut lambda, mut v, mut mu) = (near.to_vec(), c.clone(), 0.0);
    for _ in 0..NEWTON_STEPS {
        let (system, values) = equations(&unit, &lambda, &v, mu, (&c, &e));
        let step = system.solve(&values)?;
        for i in 0..m {
            lambda[i] -= step[i];
            v[i] -= step[m + i];
        }
        mu -= step[2 * m];
        if !lambda
            .iter()
            .zip(near)
            .all(|(a, b)| (a - b).abs() <= ROOT_BOXES[0])
        {
            return None;
        }
        if step.iter().all(|d| d.abs() <= SAME_NUMBER) {
            let residual = fields.interpolate(&lambda).into_vec();
            return Some(MergedRoot { lambda, residual });
        }
    }
    None
}

/// The linear equations of one step, and the residuals.
fn equations(
    fields: &NormalFields,
    lambda: &[f64],
    v: &[f64],
    mu: f64,
    (c, e): (&[f64], &[f64]),
) -> (Matrix, Vec<f64>) {
    let m = lambda.len();
    let (g, jacobian) = (fields.interpolate(lambda), fields.jacobian(lambda));
    let mut system = Matrix::zeros(2 * m + 1);
    let mut values = vec![0.0; 2 * m + 1];
    for p in 0..m {
        let mut moved = lambda.to_vec();
        moved[p] += 1.0;
        let beside = fields.jacobian(&moved);
        for j in 0..m {
            let bend: f64 = (0..m)
                .map(|q| (beside[(j, q)] - jacobian[(j, q)]) * v[q])
                .sum();
            system[(j, p)] = jacobian[(j, p)];
            system[(m + j, p)] = bend;
            system[(m + j, m + p)] = jacobian[(j, p)];
            values[m + j] += jacobian[(j, p)] * v[p];
        }
        system[(p, 2 * m)] = -e[p];
        system[(2 * m, m + p)] = c[p];
        values[p] = g[p] - mu * e[p];
        values[2 * m] += c[p] * v[p];
    }
    values[2 * m] -= 1.0;
    (system, values)
}

/// The unit vector that a nearly singular matrix shrinks most, by inverse iteration.
fn near_null_vector(matrix: &Matrix) -> Option<Vector> {
    let n = matrix.n();
    let mut regular = matrix.clone();
    for i in 0..n {
        // An exactly singular matrix has no inverse.
        regular[(i, i)] += 1e-13 * matrix.size();
    }
    // No null vector of a matrix with small integers is orthogonal to this one.
    let mut v: Vector = (0..n).map(|i| 1.0 + (1.0 + i as f64).sqrt()).collect();
    for _ in 0..4 {
        v = regular.transposed().solve(&v)?;
        v = regular.solve(&v)?;
        let length = v.iter().map(|v| v * v).sum::<f64>().sqrt();
        v.iter_mut().for_each(|v| *v /= length);
    }
    v.iter().all(|v| v.is_finite()).then_some(v)
}
