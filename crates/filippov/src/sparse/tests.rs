//! Solutions against the matrix, singular ones named, costs counted.

use super::{
    components, is_positive_definite, BorderedSolver, Pattern, Singular, SparseProduct, SparseRows,
    SparseSolver,
};

/// Numbers in [-1, 1), the same in every run.
fn pseudo_random(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

fn residual(matrix: &SparseRows, b: &[f64]) -> f64 {
    let mut x = b.to_vec();
    let mut solver = SparseSolver::default();
    solver.factor(matrix).expect("not singular");
    solver.solve(&mut x);
    (0..b.len()).fold(0.0, |worst, i| {
        f64::max(worst, (matrix.dot(i, &x) - b[i]).abs())
    })
}

#[test]
fn random_matrices_of_all_bandwidths_are_solved() {
    let mut state = 1;
    for n in [1, 2, 5, 20] {
        for b in [0, 1, 3, n] {
            let rows: Vec<Vec<f64>> = (0..n)
                .map(|i: usize| {
                    let entry = |j: usize| {
                        if i.abs_diff(j) <= b {
                            pseudo_random(&mut state)
                        } else {
                            0.0
                        }
                    };
                    (0..n).map(entry).collect()
                })
                .collect();
            let b: Vec<f64> = (0..n).map(|_| pseudo_random(&mut state)).collect();
            assert!(residual(&SparseRows::from_dense(&rows), &b) < 1e-10);
        }
    }
}

#[test]
fn a_shuffled_chain_is_found_to_be_tridiagonal() {
    let place = |i: usize| i * 37 % 100;
    let mut rows = vec![vec![0.0; 100]; 100];
    for i in 0..100 {
        rows[place(i)][place(i)] = 2.5;
        if i > 0 {
            rows[place(i)][place(i - 1)] = -1.0;
            rows[place(i - 1)][place(i)] = -1.0;
        }
    }
    let matrix = SparseRows::from_dense(&rows);
    let found = components(&matrix);
    assert_eq!((found.len(), found[0].bandwidth), (1, 1));
    assert!(is_positive_definite(&matrix));
}

#[test]
fn singular_matrices_name_the_columns_that_depend_on_one_another() {
    let matrix = SparseRows::from_dense(&[
        vec![1.0, 0.0, 2.0, 0.0],
        vec![0.0, 3.0, 0.0, 1.0],
        vec![2.0, 0.0, 4.0, 0.0],
        vec![0.0, 1.0, 0.0, 1e-3],
    ]);
    let found = SparseSolver::default().factor(&matrix);
    assert_eq!(
        found,
        Err(Singular {
            unknowns: vec![0, 2]
        })
    );
    // Units do not matter.
    let tiny = SparseRows::from_dense(&[vec![1e-200, 0.0], vec![0.0, 1e150]]);
    assert_eq!(SparseSolver::default().factor(&tiny), Ok(()));
    let third = 1.0 / 3.0;
    let nearly = SparseRows::from_dense(&[vec![0.1, third], vec![0.3, 1.0]]);
    assert_eq!(
        SparseSolver::default().factor(&nearly),
        Err(Singular {
            unknowns: vec![0, 1]
        })
    );
}

#[test]
fn the_ordering_is_kept_with_the_pattern_and_the_cost_is_linear() {
    let cost = |n: usize| {
        let mut matrix = SparseRows::new(n);
        for i in 0..n {
            let columns = i.saturating_sub(1)..(i + 2).min(n);
            matrix.push_row(columns.map(|j| (j, if i == j { -3.0 } else { 1.0 })));
        }
        let mut solver = SparseSolver::default();
        for round in 0..3 {
            matrix.values_mut()[0] = -3.0 - f64::from(round);
            solver.factor(&matrix).expect("diagonally dominant");
            solver.solve(&mut vec![1.0; n]);
        }
        assert_eq!(
            (solver.n_orderings(), solver.pattern()),
            (1, Pattern::Banded { bandwidth: 1 })
        );
        solver.n_operations() as f64 / n as f64
    };
    assert!(cost(1000) < 1.1 * cost(100));
}

#[test]
fn without_exchanges_a_band_is_eliminated_over_its_own_width() {
    let (n, b) = (60, 7);
    let operations = |diagonal: f64| {
        let mut state = 3;
        let mut matrix = SparseRows::new(n);
        for i in 0..n {
            let columns = i.saturating_sub(b)..(i + b + 1).min(n);
            let mut entry = |j| {
                if i == j {
                    diagonal
                } else {
                    pseudo_random(&mut state)
                }
            };
            matrix.push_row(columns.map(|j| (j, entry(j))).collect::<Vec<_>>());
        }
        assert!(residual(&matrix, &vec![1.0; n]) < 1e-10);
        let mut solver = SparseSolver::default();
        solver.factor(&matrix).expect("not singular");
        solver.n_operations()
    };
    let (dominant, exchanged) = (operations(100.0), operations(0.01));
    assert!(dominant <= n * b * (b + 1) && exchanged > n * b * (b + 1));
}

#[test]
fn products_are_those_of_the_dense_rows() {
    let a = SparseRows::from_dense(&[vec![1.0, 0.0, 2.0], vec![0.0, 3.0, 0.0]]);
    let b = SparseRows::from_dense(&[vec![0.0, 0.0, 5.0], vec![7.0, 0.0, 1.0]]);
    let mut product = SparseProduct::new(&a, &b);
    product.update(&a, &b);
    let entries: Vec<Vec<(usize, f64)>> = (0..2).map(|i| product.matrix.row(i).collect()).collect();
    assert_eq!(entries, [vec![(0, 10.0), (1, 9.0)], vec![(1, 0.0)]]);
    assert_eq!(a.transposed().transposed(), a);
}

/// A tridiagonal matrix of n unknowns with full rows and columns of m others among them, those of the corner `corner`.
fn bordered(n: usize, m: usize, diagonal: f64, corner: f64) -> SparseRows {
    let mut state = 7;
    let is_apart = |k: usize| k % (n / m) == n / m / 2;
    let mut matrix = SparseRows::new(n);
    for i in 0..n {
        let mut row = Vec::new();
        for j in 0..n {
            let value = match (is_apart(i), is_apart(j)) {
                (true, true) if i == j => corner,
                (true, true) => 0.1 * pseudo_random(&mut state),
                (true, false) | (false, true) => pseudo_random(&mut state),
                _ if i == j => diagonal,
                _ if i.abs_diff(j) == 1 => -1.0,
                _ => continue,
            };
            row.push((j, value));
        }
        matrix.push_row(row);
    }
    matrix
}

fn solved_with_border(matrix: &SparseRows) -> (BorderedSolver, Vec<f64>) {
    let mut solver = BorderedSolver::new(matrix);
    solver.factor(matrix).expect("not singular");
    let mut x: Vec<f64> = (0..matrix.n_rows()).map(|i| (i as f64).sin()).collect();
    solver.solve(&mut x);
    (solver, x)
}

#[test]
fn unknowns_coupled_with_all_are_a_border() {
    for m in [1, 3] {
        let matrix = bordered(400, m, 4.0, 0.0);
        let (solver, x) = solved_with_border(&matrix);
        assert_eq!(solver.n_bordered(), m);
        let mut whole = SparseSolver::for_all_pivots();
        whole.factor(&matrix).expect("not singular");
        let mut expected: Vec<f64> = (0..400).map(|i| f64::from(i).sin()).collect();
        whole.solve(&mut expected);
        for (x, expected) in x.iter().zip(&expected) {
            assert!((x - expected).abs() < 1e-12 * expected.abs().max(1.0));
        }
    }
}

#[test]
fn a_border_of_a_singular_rest_is_given_up() {
    // Without its border the chain has a row of zeros but for one entry of rounding, which only the border determines.
    let mut matrix = bordered(400, 1, 4.0, 1.0);
    let start: usize = (0..10).map(|i| matrix.columns(i).len()).sum();
    let last = start + matrix.columns(10).len();
    let border = matrix.columns(10).iter().position(|&j| j == 200);
    for place in start..last {
        if Some(place - start) != border {
            matrix.values_mut()[place] = 1e-18;
        }
    }
    let (solver, x) = solved_with_border(&matrix);
    assert_eq!(solver.n_bordered(), 1);
    for i in 0..400 {
        let residual = (matrix.dot(i, &x) - (i as f64).sin()).abs();
        assert!(residual < 1e-12 * matrix.magnitude(i, &x).max(1.0));
    }
}

#[test]
fn meshes_and_small_systems_have_no_border() {
    assert_eq!(
        BorderedSolver::new(&bordered(7, 1, 4.0, 0.0)).n_bordered(),
        0
    );
    let side = 20;
    let mut mesh = SparseRows::new(side * side);
    for i in 0..side * side {
        let others = [i.wrapping_sub(side), i.wrapping_sub(1), i, i + 1, i + side];
        mesh.push_row(
            others
                .into_iter()
                .filter(|&j| j < side * side)
                .map(|j| (j, 1.0)),
        );
    }
    assert_eq!(BorderedSolver::new(&mesh).n_bordered(), 0);
}
