//! The collocation of M' = Df M + D_p f on a part of a step, and its transpose.

use super::radau::{STAGES, WEIGHTS};
use crate::cube::{Elimination, Matrix};
use crate::sparse::{SparseRows, SparseSolver};
use crate::system::Linearisation;

/// Up to so many states the equations are solved as a full matrix, with the multipliers eliminated at each node.
const MOST_FULL: usize = 8;

/// The equations sum_j W_ij (Y_j - Y_0) = dt Df(t_i) Y_i for the change Y of the state, with multipliers as unknowns of their own.
pub(super) struct Collocation {
    n: usize,
    m: usize,
    /// Unknowns at each node.
    block: usize,
    /// The right-hand side, by the change at the start with the shares of the parameters behind it.
    right: SparseRows,
    full: Option<Elimination>,
    sparse: SparseSolver,
    /// Do the equations have a solution?
    is_regular: bool,
}

/// About how many operations a part takes with so many changes of n states.
pub(super) fn operations(n: usize, n_columns: usize) -> usize {
    let unknowns = STAGES * n;
    // Large systems are sparse.
    let width = unknowns.min(STAGES * MOST_FULL);
    unknowns * width * (width + 6 * n_columns) / 3 + STAGES * 200
}

impl Collocation {
    /// For n states and m parameters.
    pub fn new(n: usize, m: usize) -> Self {
        Collocation {
            n,
            m,
            block: n,
            right: SparseRows::new(n + m),
            full: None,
            sparse: SparseSolver::for_all_pivots(),
            is_regular: false,
        }
    }

    /// Takes the derivatives of the field at the nodes of a part of this length, for changes that are carried on, or for gradients
    /// that are pulled back.
    pub fn take(&mut self, nodes: &[Linearisation], dt: f64, is_pulled_back: bool) {
        self.right.clear(self.n + self.m);
        let n_multipliers = nodes[0].rows().n_rows().saturating_sub(self.n + self.m);
        let is_small = self.n <= MOST_FULL;
        let full = is_small.then(|| self.factor_full(nodes, dt, n_multipliers));
        self.full = full.flatten();
        self.is_regular =
            self.full.is_some() || self.factor_sparse(nodes, dt, n_multipliers, is_pulled_back);
    }

    /// Carries changes on, each of n states with the shares of the parameters behind them.
    pub fn carry(&mut self, columns: &mut [Vec<f64>]) {
        for column in columns {
            let stages = self.stages(column, &[]);
            column[..self.n].copy_from_slice(&stages[(STAGES - 1) * self.block..][..self.n]);
        }
    }

    /// The unknowns at all nodes, for a change at the start, and with what is added to the right-hand sides if anything is.
    fn stages(&mut self, column: &[f64], added: &[f64]) -> Vec<f64> {
        let rows = 0..STAGES * self.block;
        let mut right: Vec<f64> = rows.map(|k| self.right.dot(k, column)).collect();
        right.iter_mut().zip(added).for_each(|(r, a)| *r += a);
        match &self.full {
            Some(elimination) => right = elimination.solve(&right).into_vec(),
            None if self.is_regular => self.sparse.solve(&mut right),
            None => right.fill(f64::NAN),
        }
        right
    }

    /// Takes the gradient of a function by the state at the end back to the start, and adds to the shares of the parameters.
    pub fn pull_back(&mut self, gradient: &mut [f64]) {
        let mut weights = vec![0.0; STAGES * self.block];
        weights[(STAGES - 1) * self.block..][..self.n].copy_from_slice(&gradient[..self.n]);
        match &self.full {
            Some(elimination) => weights = elimination.solve_transposed(&weights).into_vec(),
            None if self.is_regular => self.sparse.solve(&mut weights),
            None => weights.fill(f64::NAN),
        }
        gradient[..self.n].fill(0.0);
        for (k, weight) in weights.iter().enumerate() {
            for (c, value) in self.right.row(k) {
                gradient[c] += weight * value;
            }
        }
    }

    /// The full matrix, with the multipliers eliminated; `None` where they have no solution.
    fn factor_full(
        &mut self,
        nodes: &[Linearisation],
        dt: f64,
        n_multipliers: usize,
    ) -> Option<Elimination> {
        let (n, m) = (self.n, self.m);
        self.block = n;
        let mut matrix = Matrix::zeros(STAGES * n);
        let mut slopes = vec![0.0; n * (n + m)];
        for (i, node) in nodes.iter().enumerate() {
            eliminated(node.rows(), (n, m, n_multipliers), &mut slopes)?;
            let sum: f64 = WEIGHTS[i].iter().sum();
            for r in 0..n {
                let row = &slopes[r * (n + m)..][..n + m];
                for (j, weight) in WEIGHTS[i].iter().enumerate() {
                    matrix[(i * n + r, j * n + r)] = *weight;
                }
                for (c, slope) in row[..n].iter().enumerate() {
                    matrix[(i * n + r, i * n + c)] -= dt * slope;
                }
                let by_parameters = row[n..].iter().enumerate();
                let by_parameters = by_parameters.filter(|(_, slope)| **slope != 0.0);
                let by_parameters = by_parameters.map(|(p, slope)| (n + p, dt * slope));
                self.right
                    .push_row([(r, sum)].into_iter().chain(by_parameters));
            }
        }
        Some(Elimination::of(matrix))
    }

    /// The matrix with the multipliers as unknowns: is it regular?
    fn factor_sparse(
        &mut self,
        nodes: &[Linearisation],
        dt: f64,
        n_multipliers: usize,
        is_pulled_back: bool,
    ) -> bool {
        let (n, m, block) = (self.n, self.m, self.n + n_multipliers);
        self.block = block;
        self.right.clear(n + m);
        let mut matrix = SparseRows::new(STAGES * block);
        for (i, node) in nodes.iter().enumerate() {
            let sum: f64 = WEIGHTS[i].iter().sum();
            let (rows, start) = (node.rows(), i * block);
            let unknown = |(column, value): (usize, f64)| match column {
                column if column < n => Some((start + column, value)),
                column if column >= n + m => Some((start + column - m, value)),
                _ => None,
            };
            let is_parameter = |(column, _): &(usize, f64)| (n..n + m).contains(column);
            for r in 0..n {
                let mut own = vec![0.0; STAGES];
                own[i] = rows.diagonal(r) * dt;
                let mut row: Vec<(usize, f64)> = (0..STAGES)
                    .map(|j| (j * block + r, WEIGHTS[i][j] + own[j]))
                    .collect();
                let others = rows.row(r).filter(|(column, _)| *column != r);
                row.extend(others.filter_map(unknown).map(|(c, v)| (c, dt * v)));
                row.sort_unstable_by_key(|entry| entry.0);
                matrix.push_row(row);
                let shares = rows.row(r).filter(is_parameter);
                let shares = shares.map(|(c, value)| (c, -dt * value));
                self.right.push_row([(r, sum)].into_iter().chain(shares));
            }
            for c in 0..n_multipliers {
                matrix.push_row(rows.row(n + m + c).filter_map(unknown));
                let shares = rows.row(n + m + c).filter(is_parameter);
                self.right.push_row(shares.map(|(c, value)| (c, -value)));
            }
        }
        if is_pulled_back {
            matrix = matrix.transposed();
        }
        matrix.is_finite() && self.sparse.factor(&matrix).is_ok()
    }
}

/// The derivatives of the natural extension of a field by states and parameters, n rows of n + m entries: the multipliers follow
/// from G = 0. `None` if they do not.
fn eliminated(rows: &SparseRows, (n, m, l): (usize, usize, usize), out: &mut [f64]) -> Option<()> {
    let width = n + m;
    let mut by_multipliers = vec![0.0; n * l];
    out.fill(0.0);
    for r in 0..n {
        for (c, value) in rows.row(r) {
            match c.checked_sub(width) {
                None => out[r * width + c] = -value,
                Some(k) => by_multipliers[r * l + k] = -value,
            }
        }
    }
    if l == 0 {
        return Some(());
    }
    let mut own = Matrix::zeros(l);
    let mut by_states = vec![0.0; l * width];
    for k in 0..l {
        for (c, value) in rows.row(width + k) {
            match c.checked_sub(width) {
                None => by_states[k * width + c] = value,
                Some(j) => own[(k, j)] = value,
            }
        }
    }
    let factors = Elimination::of(own);
    for r in 0..n {
        // F_l G_l^-1, a row of the multiplier.
        let weights = factors.solve_transposed(&by_multipliers[r * l..][..l]);
        if weights.iter().any(|w| !w.is_finite()) {
            return None;
        }
        for (weight, row) in weights.iter().zip(by_states.chunks_exact(width)) {
            let entries = out[r * width..][..width].iter_mut().zip(row);
            entries.for_each(|(entry, value)| *entry -= weight * value);
        }
    }
    Some(())
}
