//! Matrices of known class, and random ones against all their minors.

use super::is_p_matrix;
use crate::sparse::SparseRows;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn determinant(a: &[Vec<f64>]) -> f64 {
    match a.split_first() {
        None => 1.0,
        Some((first, rest)) => (0..first.len())
            .map(|j| {
                let without = |row: &Vec<f64>| [&row[..j], &row[j + 1..]].concat();
                let minor: Vec<Vec<f64>> = rest.iter().map(without).collect();
                let sign = if j % 2 == 0 { 1.0 } else { -1.0 };
                sign * first[j] * determinant(&minor)
            })
            .sum(),
    }
}

/// The smallest principal minor.
pub fn smallest_minor(a: &[Vec<f64>]) -> f64 {
    let subsets = 1..1_usize << a.len();
    subsets.fold(f64::INFINITY, |smallest, subset| {
        let kept: Vec<usize> = (0..a.len()).filter(|i| subset >> i & 1 == 1).collect();
        let block: Vec<Vec<f64>> = kept
            .iter()
            .map(|&i| kept.iter().map(|&j| a[i][j]).collect())
            .collect();
        smallest.min(determinant(&block))
    })
}

#[test]
fn known_classes_are_recognised_at_any_size() {
    let chain = |d: usize, own: f64| {
        let mut matrix = SparseRows::new(d);
        for i in 0..d {
            // Coefficients of friction differ by column.
            let mu = |j: usize| 1.0 + (j % 7) as f64;
            let columns = i.saturating_sub(1)..(i + 2).min(d);
            matrix.push_row(columns.map(|j| (j, mu(j) * if i == j { own } else { -1.0 })));
        }
        matrix
    };
    assert_eq!(is_p_matrix(&chain(500, 2.0)), Some(true));
    assert_eq!(is_p_matrix(&chain(500, 1.5)), None);
    assert_eq!(is_p_matrix(&chain(9, 1.5)), Some(false));
    assert_eq!(is_p_matrix(&chain(500, -1.0)), Some(false));
    // Not symmetric, not dominant, but a block each.
    let rotation = SparseRows::from_dense(&[vec![1.0, 5.0], vec![-5.0, 1.0]]);
    assert_eq!(is_p_matrix(&rotation), Some(true));
    let redundant = SparseRows::from_dense(&[vec![1.0, 1.0], vec![1.0, 1.0]]);
    assert_eq!(is_p_matrix(&redundant), Some(false));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn minors_decide(entries in prop::collection::vec(-1.0..1.0, 16), own in 0.0..1.5) {
        let mut rows: Vec<Vec<f64>> = entries.chunks(4).map(<[f64]>::to_vec).collect();
        for (i, row) in rows.iter_mut().enumerate() {
            row[i] = row[i].abs() + own;
        }
        let smallest = smallest_minor(&rows);
        prop_assume!(smallest.abs() > 1e-6);
        prop_assert_eq!(is_p_matrix(&SparseRows::from_dense(&rows)), Some(smallest > 0.0));
    }
}
