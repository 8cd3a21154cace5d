//! Is a root of the sliding equations stable under the hidden dynamics?

use super::small_matrix::Matrix;

/// Is there a scaling of the surfaces for which the root with this matrix G is stable?
///
/// Looks for a chain of principal minors, each containing the one before, of orders 1 to m with signs
/// (-1)^order (Fisher, Fuller 1958). Sufficient; necessary for m <= 2, and nearly so for m = 3.
pub fn is_scaling_stable(jacobian: &Matrix) -> bool {
    let m = jacobian.n();
    // Bit set of the subsets that end a chain.
    let mut chained = vec![false; 1 << m];
    chained[0] = true;
    for subset in 1..1_usize << m {
        let members: Vec<usize> = (0..m).filter(|i| subset >> i & 1 == 1).collect();
        let follows = members.iter().any(|i| chained[subset & !(1 << i)]);
        let sign = (-1.0_f64).powi(members.len() as i32);
        chained[subset] = follows && sign * jacobian.principal(&members).determinant() > 0.0;
    }
    chained[(1 << m) - 1]
}

/// Is the root with this matrix G stable when the surfaces are scaled by kappa?
pub fn is_stable_for(jacobian: &Matrix, kappa: &[f64]) -> bool {
    let mut scaled = jacobian.clone();
    for (row, factor) in kappa.iter().enumerate() {
        for column in 0..scaled.n() {
            scaled[(row, column)] *= factor;
        }
    }
    scaled.is_hurwitz()
}

/// Are all principal minors of -G positive? If G is constant, as for fields that are affine in the
/// signs, then exactly one mode is consistent (Gale, Nikaido 1965).
pub fn is_negative_p_matrix(jacobian: &Matrix) -> bool {
    let m = jacobian.n();
    (1..1_usize << m).all(|subset| {
        let members: Vec<usize> = (0..m).filter(|i| subset >> i & 1 == 1).collect();
        let sign = (-1.0_f64).powi(members.len() as i32);
        sign * jacobian.principal(&members).determinant() > 0.0
    })
}
