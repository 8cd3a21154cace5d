//! Is a root of the sliding equations stable under the hidden dynamics?
//!
//! All questions are asked of the strongly coupled parts of G: it is block triangular in them, and its eigenvalues
//! are theirs. With groups of surfaces that do not know of each other the parts are small.

use super::normal_fields::NormalFields;
use super::p_matrix::is_p_matrix;
use super::small_matrix::Matrix;
use crate::sparse::SparseRows;
use crate::tolerances::{CAYLEY_SQUARINGS, LARGEST_BY_MINORS};

/// Is there a scaling of the surfaces for which the root with this matrix G is stable?
///
/// Looks for a chain of principal minors, each containing the one before, of orders 1 to m with signs
/// (-1)^order (Fisher, Fuller 1958). Sufficient; necessary for m <= 2, and nearly so for m = 3. A part of more
/// than [`LARGEST_BY_MINORS`] surfaces counts as stable if it is for equal scalings.
pub fn is_scaling_stable(jacobian: &Matrix) -> bool {
    blocks(jacobian).all(|block| match block.n() > LARGEST_BY_MINORS {
        true => decay(&block) > 0.0,
        false => chain_margin(&block) > 0.0,
    })
}

/// A continuous function that is positive where [`is_scaling_stable`] finds a chain: the smallest minor of the best
/// chain, with its sign changed for odd orders; 1 for more than [`LARGEST_BY_MINORS`] surfaces.
pub fn scaling_margin(jacobian: &Matrix) -> f64 {
    let margins = blocks(jacobian).map(|block| match block.n() > LARGEST_BY_MINORS {
        true => 1.0,
        false => chain_margin(&block),
    });
    margins.fold(1.0, f64::min)
}

/// The strongly coupled parts of a matrix.
fn blocks(matrix: &Matrix) -> impl Iterator<Item = Matrix> + '_ {
    let parts = matrix.strong_parts().into_iter();
    parts.map(|part| matrix.principal(&part))
}

fn chain_margin(jacobian: &Matrix) -> f64 {
    let m = jacobian.n();
    // By the subset that ends a chain.
    let mut margins = vec![1.0; 1 << m];
    for subset in 1..1_usize << m {
        let members: Vec<usize> = (0..m).filter(|i| subset >> i & 1 == 1).collect();
        let before = members.iter().map(|i| margins[subset & !(1 << i)]);
        let sign = (-1.0_f64).powi(members.len() as i32);
        let minor = sign * jacobian.principal(&members).determinant();
        margins[subset] = before.fold(f64::NEG_INFINITY, f64::max).min(minor);
    }
    margins[(1 << m) - 1]
}

/// Is the root with this matrix G stable when the surfaces are scaled by kappa?
pub fn is_stable_for(jacobian: &Matrix, kappa: &[f64]) -> bool {
    is_stable(&jacobian.with_rows_scaled(kappa))
}

/// Do all eigenvalues have negative real parts?
pub fn is_stable(matrix: &Matrix) -> bool {
    blocks(matrix).all(|block| match block.n() > LARGEST_BY_MINORS {
        true => decay(&block) > 0.0,
        false => block.is_hurwitz(),
    })
}

/// Two functions of G, with its rows scaled, that are positive as long as the root is stable: the first vanishes
/// where a real eigenvalue does (two roots meet), the second where a pair of them reaches the imaginary axis.
///
/// They are (-1)^m det, and the last but one Hurwitz determinant (for more than [`LARGEST_BY_MINORS`] surfaces the decay
/// rate of the Cayley transform). `in_parts` says that the zeros of G are those of the structure, and not of rounding:
/// then each is the smallest among the strongly coupled parts, and for a part of two surfaces the second is
/// -min(G11, G22), so that it is stable for some scaling.
pub fn stability_margins(scaled: &Matrix, in_parts: bool) -> [f64; 2] {
    let parts = match in_parts {
        true => blocks(scaled).collect(),
        false => vec![scaled.clone()],
    };
    let mut margins = [f64::INFINITY; 2];
    for block in parts {
        let sign = (-1.0_f64).powi(block.n() as i32);
        let fold = sign * block.determinant();
        let stability = match block.n() {
            // Of two surfaces no scaling is preferred, as where they meet alone.
            2 => -block[(0, 0)].min(block[(1, 1)]),
            n if n > LARGEST_BY_MINORS => decay(&block),
            _ => block.last_hurwitz_determinant(),
        };
        // Not `min`, which forgets NaN.
        for (least, value) in margins.iter_mut().zip([fold, stability]) {
            if value.is_nan() || value < *least {
                *least = value;
            }
        }
    }
    margins
}

/// The [`stability_margins`] of a diagonal matrix, with its rows scaled and its zeros those of the structure.
pub fn uncoupled_margins(scaled: impl Iterator<Item = f64>) -> [f64; 2] {
    let least = |least: f64, entry: f64| match -entry {
        fold if fold.is_nan() || fold < least => fold,
        _ => least,
    };
    [scaled.fold(f64::INFINITY, least), 1.0]
}

/// -ln of the spectral radius of (c + A)(c - A)^-1, c the size of A: positive if and only if all eigenvalues have
/// negative real parts. By repeated squaring; NaN if A has the eigenvalue c.
fn decay(matrix: &Matrix) -> f64 {
    let n = matrix.n();
    let size = matrix.size();
    let (mut sum, mut difference) = (matrix.clone(), matrix.with_rows_scaled(&vec![-1.0; n]));
    for i in 0..n {
        sum[(i, i)] += size;
        difference[(i, i)] += size;
    }
    let Some(inverse) = difference.inverse() else {
        return f64::NAN;
    };
    let mut power = inverse.times(&sum);
    let mut logarithm = 0.0;
    for k in 0..CAYLEY_SQUARINGS {
        let size = power.size();
        if size == 0.0 {
            return f64::INFINITY;
        }
        logarithm += size.ln() / f64::from(1_u32 << k);
        let unit = power.with_rows_scaled(&vec![1.0 / size; n]);
        power = unit.times(&unit);
    }
    -logarithm
}

/// Is exactly one mode consistent, as -G is a P-matrix all over the cube (Gale, Nikaido 1965)?
///
/// For affine fields by their constant G; else if the comparison matrix of all -G in the cube, with the least entries on the
/// diagonal and the largest magnitudes beside it, is an M-matrix.
pub fn has_one_mode_only(fields: &NormalFields) -> bool {
    let (m, is_affine) = (fields.m(), fields.is_affine());
    let mut bound = vec![vec![0.0; m]; m];
    for (j, row) in bound.iter_mut().enumerate() {
        for (p, entry) in row.iter_mut().enumerate() {
            let values = fields.columns(p).map(|column| match is_affine || j == p {
                true => -column[j],
                false => -column[j].abs(),
            });
            *entry = values.fold(f64::INFINITY, f64::min);
        }
    }
    is_p_matrix(&SparseRows::from_dense(&bound)) == Some(true)
}
