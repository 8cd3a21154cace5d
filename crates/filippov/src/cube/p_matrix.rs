//! Is a matrix a P-matrix, one with positive principal minors?
//!
//! Decided for each connected component: minors up to 10 unknowns, else by conditions that suffice.
//!
//! Reference: Cottle, Pang, Stone, *The Linear Complementarity Problem* (1992), section 3.3.

use super::small_matrix::Matrix;
use crate::sparse::{coupled_blocks, is_positive_definite, SparseRows, SparseSolver};
use crate::tolerances::DEFINITE_PIVOT;

/// Largest component whose minors are computed; m unknowns take about 2^m eliminations.
const MOST_MINORS: usize = 10;

/// Are all principal minors positive? `None` if that is not known.
///
/// Beyond 10 coupled unknowns two classes are recognised: H-matrices with positive diagonal
/// (diagonally dominant after some scaling of the columns), and those that some positive diagonal D makes positive
/// definite, A D + D A^T > 0, with D tried so that A D is symmetric if it can be: friction with
/// different coefficients.
pub fn is_p_matrix(matrix: &SparseRows) -> Option<bool> {
    if matrix.is_diagonal() {
        return Some(!(0..matrix.n_rows()).any(|i| matrix.diagonal(i) <= 0.0));
    }
    let mut answer = Some(true);
    for (_, block) in coupled_blocks(matrix) {
        match decide_block(&block) {
            Some(true) => {}
            Some(false) => return Some(false),
            None => answer = None,
        }
    }
    answer
}

fn decide_block(block: &SparseRows) -> Option<bool> {
    let m = block.n_rows();
    if (0..m).any(|i| block.diagonal(i) <= 0.0) {
        return Some(false);
    }
    if m == 1 || is_h_matrix(block) || is_diagonally_stable(block) {
        return Some(true);
    }
    if m > MOST_MINORS {
        return None;
    }
    let mut dense = Matrix::zeros(m);
    for i in 0..m {
        for (j, value) in block.row(i) {
            dense[(i, j)] = value / (block.diagonal(i) * block.diagonal(j)).sqrt();
        }
    }
    Some(has_positive_minors(&dense))
}

/// Does the comparison matrix map some positive vector to a positive vector? Then it is an M-matrix.
fn is_h_matrix(block: &SparseRows) -> bool {
    let m = block.n_rows();
    let comparison = block.comparison();
    let mut solver = SparseSolver::default();
    if solver.factor(&comparison).is_err() {
        return false;
    }
    let mut weights: Vec<f64> = (0..m).map(|i| comparison.diagonal(i)).collect();
    solver.solve(&mut weights);
    // Rounding of a singular matrix makes them large.
    weights
        .iter()
        .all(|&weight| weight > 0.0 && weight < 1.0 / DEFINITE_PIVOT)
}

/// Is A D + D A^T positive definite for the D that makes A D symmetric, or for D = 1?
fn is_diagonally_stable(block: &SparseRows) -> bool {
    is_positive_definite(block)
        || symmetrising_scale(block)
            .is_some_and(|scale| is_positive_definite(&block.with_columns_scaled(&scale)))
}

/// Positive numbers with a_ij d_j = a_ji d_i along a walk through each component.
pub(crate) fn symmetrising_scale(block: &SparseRows) -> Option<Vec<f64>> {
    let transposed = block.transposed();
    let mut scale = vec![0.0; block.n_rows()];
    for start in 0..block.n_rows() {
        if scale[start] != 0.0 {
            continue;
        }
        scale[start] = 1.0;
        let mut order = vec![start];
        while let Some(i) = order.pop() {
            for (j, value) in block.row(i).filter(|entry| entry.1 != 0.0) {
                let mirrored = transposed.row(i).find(|entry| entry.0 == j)?.1;
                if scale[j] == 0.0 {
                    scale[j] = scale[i] * mirrored / value;
                    // Also refuses a NaN.
                    let is_positive = scale[j] > 0.0 && scale[j].is_finite();
                    if !is_positive {
                        return None;
                    }
                    order.push(j);
                }
            }
        }
    }
    Some(scale)
}

/// By the first pivot: A is a P-matrix if a_11 > 0, and A without the first unknown and the Schur complement of
/// a_11 both are (Tsatsomeros, Li 2000).
fn has_positive_minors(a: &Matrix) -> bool {
    if a.n() == 0 {
        return true;
    }
    let is_positive = a[(0, 0)] > DEFINITE_PIVOT;
    let rest = Matrix::of(a.n() - 1, |i, j| a[(i + 1, j + 1)]);
    let taken = |i: usize, j: usize| a[(i + 1, 0)] / a[(0, 0)] * a[(0, j + 1)];
    let complement = || Matrix::of(rest.n(), |i, j| rest[(i, j)] - taken(i, j));
    is_positive && has_positive_minors(&rest) && has_positive_minors(&complement())
}

#[cfg(test)]
pub(crate) mod tests;
