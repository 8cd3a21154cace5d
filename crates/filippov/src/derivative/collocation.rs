//! The collocation of M' = Df M + D_p f on a part of a step, and its transpose.

use super::lengths::allowed;
use super::radau::{HIGHEST, HIGHEST_BACK, HIGHEST_RATES, INTEGRALS, STAGES, WEIGHTS};
use crate::cube::{Elimination, Matrix, Vector};
use crate::sparse::{SparseRows, SparseSolver};
use crate::system::Linearisation;
use crate::tolerances::EPS;

/// Up to so many states the equations are solved as a full matrix, with the multipliers eliminated at each node.
const MOST_FULL: usize = 8;

/// Up to so many changes are found by iteration, if it converges, before a sparse matrix is factored for them.
const MOST_ITERATED: usize = 16;

/// So many iterations at most, two of which are to make the rest smaller by the factor.
const MOST_ITERATIONS: usize = 40;
const CONTRACTION: f64 = 0.5;

/// A value below this share of the largest counts as one of this size: what rounding leaves of a zero looks rough, and so does all
/// that follows from it. Derivatives of the field by differences are known to fewer digits.
const LEAST: f64 = 1e-5;
const LEAST_BY_DIFFERENCES: f64 = 1e-4;

/// The fastest rate of a sliding motion is seen in so many applications of its derivative.
const FASTEST_POWER: u32 = 4;

/// The equations Y_i = Y_0 + dt sum_j C_ij Df(t_j) Y_j for the change Y of the state at the nodes.
///
/// For few states they are a full matrix. For many they are solved by iteration where the step is not stiff, and as a sparse matrix
/// with the multipliers as unknowns of their own otherwise.
pub(super) struct Collocation {
    n: usize,
    m: usize,
    /// Iteration ends at changes so small beside the result.
    rest: f64,
    /// The error that a part may have, and the share of the largest value below which none is looked at.
    allowed: f64,
    least: f64,
    dt: f64,
    way: Way,
    /// The right-hand side of the matrix, by the change at the start with the shares of the parameters behind it.
    right: SparseRows,
    sparse: SparseSolver,
    /// In what the changes of the states are measured in the full matrix.
    units: Vec<f64>,
    /// By what the rows of the full matrix are multiplied.
    scales: Vec<f64>,
    /// What iterations and terms need of each node.
    nodes: Vec<Node>,
    /// What was found for the end of a part, or for its start on the way back.
    ends: Vec<Vec<f64>>,
}

/// The derivatives at a node without those by the parameters, and what the multipliers follow from.
struct Node {
    rows: SparseRows,
    multipliers: Elimination,
}

enum Way {
    Full(Box<Elimination>),
    Iteration,
    /// The sparse matrix is factored, or its transpose, if it has an inverse.
    Sparse(bool),
}

/// The error of a part by the highest coefficient of the rates along it, both relative to the size of a value. It goes with the square:
/// the quadrature is exact for polynomials of about twice the degree. The coefficient before it tells about the highest one too,
/// which may be zero by chance.
fn error_by([before, last]: [f64; 2]) -> f64 {
    let highest = last.abs().max(0.7 * before.abs().powf(7.0 / 6.0));
    0.03 * highest * highest
}

/// About how many operations a part takes with so many changes of n states.
pub(super) fn operations(n: usize, n_columns: usize) -> usize {
    let unknowns = STAGES * n;
    // Large systems are sparse.
    let width = unknowns.min(STAGES * MOST_FULL);
    unknowns * width * (width + 6 * n_columns) / 3 + STAGES * 200
}

/// How fast changes are at a node: at least the fastest rate in a region, about that while the motion slides, where the multipliers
/// change with the state.
pub(super) fn fastest(rows: &SparseRows, (n, m): (usize, usize)) -> f64 {
    if rows.n_rows() == n + m {
        return fastest_in_region(rows, n);
    }
    let (l, width) = (rows.n_rows() - n - m, n + m);
    let mut matrix = SparseRows::new(l);
    for k in 0..l {
        let own = rows.row(width + k).filter(|(c, _)| *c >= width);
        matrix.push_row(own.map(|(c, value)| (c - width, value)));
    }
    let mut solver = SparseSolver::for_all_pivots();
    if !matrix.is_finite() || solver.factor(&matrix).is_err() {
        return f64::NAN;
    }
    let size = |change: &[f64]| {
        change[..n]
            .iter()
            .fold(0.0_f64, |most, v| most.max(v.abs()))
    };
    // Any change has a part in all directions.
    let start = (0..n).map(|i| 1.0 + 0.3 * (1.0 + i as f64).sin());
    let mut change: Vec<f64> = start.chain(vec![0.0; m + l]).collect();
    let (at_start, mut most) = (size(&change), 0.0_f64);
    for power in 1..=FASTEST_POWER {
        change[width..].fill(0.0);
        let mut multipliers: Vec<f64> = (0..l).map(|k| -rows.dot(width + k, &change)).collect();
        solver.solve(&mut multipliers);
        change[width..].copy_from_slice(&multipliers);
        let rates: Vec<f64> = (0..n).map(|r| -rows.dot(r, &change)).collect();
        change[..n].copy_from_slice(&rates);
        if power > 1 {
            most = most.max((size(&change) / at_start).powf(1.0 / f64::from(power)));
        }
    }
    most
}

/// The root of the largest sum of the absolute values of a row of F_x^2.
fn fastest_in_region(rows: &SparseRows, n: usize) -> f64 {
    let (mut product, mut most) = (vec![0.0; n], 0.0_f64);
    for r in 0..n {
        product.fill(0.0);
        for (k, factor) in rows.row(r).filter(|(c, _)| *c < n) {
            let entries = rows.row(k).filter(|(c, _)| *c < n);
            entries.for_each(|(c, value)| product[c] += factor * value);
        }
        most = most.max(product.iter().map(|v| v.abs()).sum());
    }
    most.sqrt()
}

impl Collocation {
    /// For n states and m parameters, in runs with this tolerance.
    pub fn new((n, m): (usize, usize), rtol: f64, by_differences: bool) -> Self {
        Collocation {
            n,
            m,
            rest: (1e-3 * rtol).max(4.0 * EPS),
            allowed: allowed(rtol),
            least: match by_differences {
                true => LEAST_BY_DIFFERENCES,
                false => LEAST,
            },
            dt: f64::NAN,
            way: Way::Sparse(false),
            right: SparseRows::new(n + m),
            sparse: SparseSolver::for_all_pivots(),
            units: vec![1.0; n],
            scales: Vec::new(),
            nodes: Vec::new(),
            ends: Vec::new(),
        }
    }

    /// Carries changes on over a part of this length, each of n states with the shares of the parameters behind them. Returns an
    /// estimate of their error, relative to the size of each value; [`accept`](Self::accept) takes what was found.
    pub fn carry(&mut self, nodes: &[Linearisation], dt: f64, columns: &[Vec<f64>]) -> f64 {
        self.take(nodes, dt, Measured::Changes(columns), columns.len());
        let mut all = Vec::with_capacity(columns.len());
        if matches!(self.way, Way::Iteration) {
            let found = columns.iter().map(|c| self.iterate(nodes, c));
            match found.collect::<Option<Vec<_>>>() {
                Some(found) => all = found,
                None => self.way = Way::Sparse(self.factor_sparse(nodes, false)),
            }
        }
        if !matches!(self.way, Way::Iteration) {
            all.extend(columns.iter().map(|column| self.stages(column)));
        }
        let mut error = 0.0_f64;
        for (column, stages) in columns.iter().zip(&all) {
            error = error.max(self.error(nodes, column, stages));
        }
        let ends = all.into_iter().filter_map(|mut stages| stages.pop());
        self.ends = ends.collect();
        error
    }

    /// The change at the nodes, by the matrix that was factored.
    fn stages(&mut self, column: &[f64]) -> Vec<Vec<f64>> {
        let rows = 0..self.right.n_rows();
        let mut right: Vec<f64> = rows.map(|k| self.right.dot(k, column)).collect();
        match &self.way {
            Way::Full(elimination) => {
                scale(&mut right, &self.scales);
                right = elimination.solve(&right).into_vec();
            }
            Way::Sparse(true) => self.sparse.solve(&mut right),
            _ => right.fill(f64::NAN),
        }
        let block = right.len() / STAGES;
        let stages = right.chunks_exact(block).map(|stage| {
            let mut stage = stage[..self.n].to_vec();
            scale(&mut stage, &self.units);
            stage
        });
        stages.collect()
    }

    /// The error of a change over a part, relative to its size.
    fn error(&mut self, nodes: &[Linearisation], column: &[f64], stages: &[Vec<f64>]) -> f64 {
        let n = self.n;
        let highest = |r: usize| {
            HIGHEST_RATES.map(|weights| {
                let pairs = weights.iter().zip(stages);
                pairs.map(|(w, stage)| w * (stage[r] - column[r])).sum()
            })
        };
        let highest: Vec<[f64; 2]> = (0..n).map(highest).collect();
        let mut sizes: Vec<f64> = column[..n].iter().map(|v| v.abs()).collect();
        for stage in stages {
            raise(&mut sizes, stage);
        }
        let terms = |own: &Self| {
            let mut terms: Vec<f64> = column[..n].iter().map(|v| v.abs()).collect();
            for (i, stage) in stages.iter().enumerate() {
                let by_parameters = own.by_parameters(nodes[i].rows(), column);
                let dt = own.dt * INTEGRALS[STAGES - 1][i];
                own.nodes[i].add_terms(stage, &by_parameters, dt, &mut terms);
            }
            terms
        };
        self.error_with_terms(nodes, &highest, (sizes, terms))
    }

    /// The largest error of values of these sizes. What rounding leaves of a value looks rough: it is small beside the terms that the
    /// value is made of, which are asked for if they are needed.
    fn error_with_terms(
        &mut self,
        nodes: &[Linearisation],
        highest: &[[f64; 2]],
        (mut sizes, terms): (Vec<f64>, impl FnOnce(&Self) -> Vec<f64>),
    ) -> f64 {
        let error = self.error_of(highest, &sizes);
        if error <= self.allowed {
            return error;
        }
        self.look_at(nodes);
        raise(&mut sizes, &terms(self));
        self.error_of(highest, &sizes)
    }

    fn error_of(&self, highest: &[[f64; 2]], sizes: &[f64]) -> f64 {
        let largest = sizes.iter().fold(0.0_f64, |most, size| size.max(most));
        let sizes = sizes.iter().map(|size| size.max(self.least * largest));
        // A change that has died out has lost its digits.
        let is_there = |size: f64| size > f64::MIN_POSITIVE / EPS;
        let pairs = highest
            .iter()
            .zip(sizes)
            .filter(|(_, size)| is_there(*size));
        let errors = pairs.map(|(highest, size)| error_by(highest.map(|c| c / size)));
        errors.fold(0.0, f64::max)
    }

    /// Takes the gradient of a function by the state at the end of a part back to the start, and adds to the shares of the
    /// parameters. Returns an estimate of its error, relative to the size of each entry; [`accept`](Self::accept) takes what was found.
    pub fn pull_back(&mut self, nodes: &[Linearisation], dt: f64, gradient: &[f64]) -> f64 {
        self.take(nodes, dt, Measured::Gradient(gradient), 1);
        let weights = self.weights(nodes, gradient);
        let (n, m, block) = (self.n, self.m, weights.len() / STAGES);
        let mut end = gradient.to_vec();
        end[..n].fill(0.0);
        let mut shares = vec![0.0; STAGES * m];
        for (k, weight) in weights.iter().enumerate() {
            for (c, value) in self.right.row(k) {
                end[c] += weight * value;
                if let Some(p) = c.checked_sub(n) {
                    shares[k / block * m + p] += weight * value;
                }
            }
        }
        let weights: Vec<&[f64]> = weights.chunks_exact(block).map(|w| &w[..n]).collect();
        let error = self.error_back(nodes, (gradient, &end), &weights, &shares);
        self.ends = vec![end];
        error
    }

    /// The weights of the rows of the equations in a gradient: of those of the states U, for which W^T U = b + dt Df^T U, where b is
    /// the gradient at the last node.
    fn weights(&mut self, nodes: &[Linearisation], gradient: &[f64]) -> Vec<f64> {
        if matches!(self.way, Way::Iteration) {
            if let Some(weights) = self.iterate_back(nodes, gradient) {
                self.take_right(nodes);
                return weights;
            }
            self.way = Way::Sparse(self.factor_sparse(nodes, true));
        }
        let block = self.right.n_rows() / STAGES;
        let mut weights = vec![0.0; STAGES * block];
        weights[(STAGES - 1) * block..][..self.n].copy_from_slice(&gradient[..self.n]);
        match &self.way {
            Way::Full(elimination) => {
                scale(&mut weights[(STAGES - 1) * block..], &self.units);
                weights = elimination.solve_transposed(&weights).into_vec();
                scale(&mut weights, &self.scales);
            }
            Way::Sparse(true) => self.sparse.solve(&mut weights),
            _ => weights.fill(f64::NAN),
        }
        weights
    }

    /// The error of a gradient over a part, relative to the sizes of its entries, by its weights and shares at the nodes.
    fn error_back(
        &mut self,
        nodes: &[Linearisation],
        (gradient, end): (&[f64], &[f64]),
        weights: &[&[f64]],
        shares: &[f64],
    ) -> f64 {
        let (n, m) = (self.n, self.m);
        let of_state = |c: usize| {
            [0, 1].map(|k| {
                let pairs = HIGHEST_BACK[k].iter().zip(weights);
                let all: f64 = pairs.map(|(h, weights)| h * weights[c]).sum();
                all - HIGHEST[k][STAGES - 1] * gradient[c]
            })
        };
        let of_share = |p: usize| {
            HIGHEST.map(|highest| {
                let nodes = highest.iter().enumerate();
                nodes.map(|(i, h)| h * shares[i * m + p]).sum()
            })
        };
        let highest = (0..n).map(of_state).chain((0..m).map(of_share));
        let highest: Vec<[f64; 2]> = highest.collect();
        let mut sizes: Vec<f64> = gradient.iter().map(|v| v.abs()).collect();
        raise(&mut sizes, end);
        let terms = |own: &Self| own.terms_back(nodes, gradient, weights);
        self.error_with_terms(nodes, &highest, (sizes, terms))
    }

    /// Takes what was found by [`carry`](Self::carry) or [`pull_back`](Self::pull_back).
    pub fn accept<'c>(&self, columns: impl IntoIterator<Item = &'c mut Vec<f64>>) {
        for (column, end) in columns.into_iter().zip(&self.ends) {
            column[..end.len()].copy_from_slice(end);
        }
    }

    /// Chooses the way for these changes, or for one on the way back.
    fn take(&mut self, nodes: &[Linearisation], dt: f64, measured: Measured, n_columns: usize) {
        self.dt = dt;
        self.nodes.clear();
        self.way = Way::Sparse(false);
        self.units.fill(1.0);
        if self.n <= MOST_FULL {
            if let Some(elimination) = self.factor_full(nodes, measured) {
                self.way = Way::Full(Box::new(elimination));
                return;
            }
            self.units.fill(1.0);
        }
        if n_columns > MOST_ITERATED {
            self.way = Way::Sparse(self.factor_sparse(nodes, false));
            return;
        }
        self.look_at(nodes);
        self.way = Way::Iteration;
    }

    /// Takes what iterations and terms need of the nodes.
    fn look_at(&mut self, nodes: &[Linearisation]) {
        if self.nodes.is_empty() {
            let sizes = (self.n, self.m);
            let own = nodes.iter().map(|node| Node::of(node.rows(), sizes));
            self.nodes.extend(own);
        }
    }

    /// The change at the nodes, by iteration; `None` if it does not converge.
    fn iterate(&self, nodes: &[Linearisation], column: &[f64]) -> Option<Vec<Vec<f64>>> {
        let n = self.n;
        let by_parameters: Vec<Vec<f64>> = nodes
            .iter()
            .map(|node| self.by_parameters(node.rows(), column))
            .collect();
        let mut stages: Vec<Vec<f64>> = vec![column[..n].to_vec(); STAGES];
        let mut rates = vec![vec![0.0; n]; STAGES];
        let (mut changes, mut before) = (vec![0.0_f64; n], [f64::INFINITY; 2]);
        for _ in 0..MOST_ITERATIONS {
            for (i, rates) in rates.iter_mut().enumerate() {
                self.nodes[i].rates(&stages[i], &by_parameters[i], rates);
            }
            let (mut change, mut size) = (0.0_f64, 0.0_f64);
            changes.fill(0.0);
            for (stage, weights) in stages.iter_mut().zip(&INTEGRALS) {
                for r in 0..n {
                    let terms = weights.iter().zip(&rates).map(|(w, rates)| w * rates[r]);
                    let value = column[r] + self.dt * terms.sum::<f64>();
                    changes[r] = changes[r].max((value - stage[r]).abs());
                    size = size.max(value.abs());
                    stage[r] = value;
                }
                change = changes.iter().fold(change, |most, own| own.max(most));
            }
            if change <= self.rest * size {
                let mut terms: Vec<f64> = column[..n].iter().map(|v| v.abs()).collect();
                for ((node, stage), by_parameters) in
                    self.nodes.iter().zip(&stages).zip(&by_parameters)
                {
                    node.add_terms(stage, by_parameters, self.dt, &mut terms);
                }
                if self.are_small(&changes, &terms) {
                    return Some(stages);
                }
            }
            if change.is_nan() || change > CONTRACTION * before[0] {
                return None;
            }
            before = [before[1], change];
        }
        None
    }

    /// Are the changes of an iteration small beside the terms that each value is made of? States differ in size.
    fn are_small(&self, changes: &[f64], terms: &[f64]) -> bool {
        let mut pairs = changes.iter().zip(terms);
        pairs.all(|(change, terms)| *change <= self.rest * terms)
    }

    /// What the shares of the parameters add to each row.
    fn by_parameters(&self, rows: &SparseRows, column: &[f64]) -> Vec<f64> {
        let parameters = self.n..self.n + self.m;
        let row = |r: usize| {
            let entries = rows.row(r).filter(|(c, _)| parameters.contains(c));
            entries.map(|(c, value)| value * column[c]).sum()
        };
        let own = (0..self.n).chain(self.n + self.m..rows.n_rows());
        own.map(row).collect()
    }

    /// The same for the transposed equations: V_i = b_i + dt Df_i^T U_i with U_i = sum_j C_ji V_j, where b is the gradient at the last
    /// node.
    fn iterate_back(&self, nodes: &[Linearisation], gradient: &[f64]) -> Option<Vec<f64>> {
        let n = self.n;
        let mut v = vec![vec![0.0; n]; STAGES];
        v[STAGES - 1].copy_from_slice(&gradient[..n]);
        let mut u = v.clone();
        let (mut back, mut multipliers) = (vec![0.0; n], Vector::new());
        let (mut changes, mut before) = (vec![0.0_f64; n], [f64::INFINITY; 2]);
        for _ in 0..MOST_ITERATIONS {
            let (mut change, mut size) = (0.0_f64, 0.0_f64);
            changes.fill(0.0);
            integrate_back(&v, &mut u);
            for i in 0..STAGES {
                self.nodes[i].rates_back(&u[i], &mut back, &mut multipliers);
                for r in 0..n {
                    let end = if i == STAGES - 1 { gradient[r] } else { 0.0 };
                    let value = end + self.dt * back[r];
                    changes[r] = changes[r].max((value - v[i][r]).abs());
                    size = size.max(value.abs());
                    v[i][r] = value;
                }
                change = changes.iter().fold(change, |most, own| own.max(most));
            }
            let is_small = change <= self.rest * size;
            if is_small && self.are_small(&changes, &self.terms_back(nodes, gradient, &u)) {
                integrate_back(&v, &mut u);
                let mut weights = Vec::new();
                for (node, u) in self.nodes.iter().zip(&u) {
                    node.rates_back(u, &mut back, &mut multipliers);
                    weights.extend_from_slice(u);
                    weights.extend(multipliers.iter().map(|weight| self.dt * weight));
                }
                return Some(weights);
            }
            if change.is_nan() || change > CONTRACTION * before[0] {
                return None;
            }
            before = [before[1], change];
        }
        None
    }

    /// The sizes of the terms that a gradient at the start, and the shares of the parameters, are made of.
    fn terms_back(
        &self,
        nodes: &[Linearisation],
        gradient: &[f64],
        weights: &[impl AsRef<[f64]>],
    ) -> Vec<f64> {
        let (n, width) = (self.n, self.n + self.m);
        let mut terms: Vec<f64> = gradient.iter().map(|v| v.abs()).collect();
        let (mut back, mut multipliers) = (vec![0.0; n], Vector::new());
        for ((node, own), weights) in nodes.iter().zip(&self.nodes).zip(weights) {
            own.rates_back(weights.as_ref(), &mut back, &mut multipliers);
            let rows = (0..n).zip(weights.as_ref());
            for (r, weight) in rows.chain((width..).zip(&multipliers)) {
                let entries = node.rows().row(r).filter(|(c, _)| *c < width);
                entries.for_each(|(c, value)| terms[c] += (self.dt * weight * value).abs());
            }
        }
        terms
    }

    /// The full matrix, with the multipliers eliminated; `None` where they have no solution. Its rows, and its unknowns, are divided by
    /// powers of two: no digit is lost, and pivots are chosen well where states are of very different size.
    fn factor_full(&mut self, nodes: &[Linearisation], measured: Measured) -> Option<Elimination> {
        let (n, m, dt) = (self.n, self.m, self.dt);
        let n_multipliers = nodes[0].rows().n_rows() - n - m;
        self.right.clear(n + m);
        let mut matrix = Matrix::zeros(STAGES * n);
        let size = n * (n + m);
        let mut all = vec![0.0; STAGES * size];
        for (node, slopes) in nodes.iter().zip(all.chunks_exact_mut(size)) {
            eliminated(node.rows(), (n, m, n_multipliers), slopes)?;
        }
        self.units = units(&all, (n, m, dt), measured);
        self.scales.clear();
        for (i, slopes) in all.chunks_exact(size).enumerate() {
            let sum: f64 = WEIGHTS[i].iter().sum();
            for r in 0..n {
                let row = &slopes[r * (n + m)..][..n + m];
                for (j, weight) in WEIGHTS[i].iter().enumerate() {
                    matrix[(i * n + r, j * n + r)] = self.units[r] * weight;
                }
                for (c, slope) in row[..n].iter().enumerate() {
                    matrix[(i * n + r, i * n + c)] -= self.units[c] * dt * slope;
                }
                let entries = (0..STAGES * n).map(|k| matrix[(i * n + r, k)].abs());
                let scale = 1.0 / power_of_two_below(entries.fold(0.0, f64::max));
                (0..STAGES * n).for_each(|k| matrix[(i * n + r, k)] *= scale);
                let by_parameters = row[n..].iter().enumerate();
                let by_parameters = by_parameters.filter(|(_, slope)| **slope != 0.0);
                let by_parameters = by_parameters.map(|(p, slope)| (n + p, dt * slope));
                self.right
                    .push_row([(r, sum)].into_iter().chain(by_parameters));
                self.scales.push(scale);
            }
        }
        Some(Elimination::of(matrix))
    }

    /// The right-hand side of the equations with the multipliers as unknowns.
    fn take_right(&mut self, nodes: &[Linearisation]) {
        let (n, m, dt) = (self.n, self.m, self.dt);
        let is_parameter = |(column, _): &(usize, f64)| (n..n + m).contains(column);
        self.right.clear(n + m);
        for (node, weights) in nodes.iter().zip(&WEIGHTS) {
            let (rows, sum) = (node.rows(), weights.iter().sum());
            for r in 0..n {
                let shares = rows.row(r).filter(is_parameter);
                let shares = shares.map(|(c, value)| (c, -dt * value));
                self.right.push_row([(r, sum)].into_iter().chain(shares));
            }
            for r in n + m..rows.n_rows() {
                let shares = rows.row(r).filter(is_parameter);
                self.right.push_row(shares.map(|(c, value)| (c, -value)));
            }
        }
    }

    /// The matrix with the multipliers as unknowns: is it regular?
    fn factor_sparse(&mut self, nodes: &[Linearisation], is_pulled_back: bool) -> bool {
        let (n, m, dt) = (self.n, self.m, self.dt);
        let n_multipliers = nodes[0].rows().n_rows() - n - m;
        let block = n + n_multipliers;
        self.take_right(nodes);
        let mut matrix = SparseRows::new(STAGES * block);
        for (i, node) in nodes.iter().enumerate() {
            let (rows, start) = (node.rows(), i * block);
            let unknown = |(column, value): (usize, f64)| match column {
                column if column < n => Some((start + column, value)),
                column if column >= n + m => Some((start + column - m, value)),
                _ => None,
            };
            for r in 0..n {
                let mut own = [0.0; STAGES];
                own[i] = rows.diagonal(r) * dt;
                let mut row: Vec<(usize, f64)> = (0..STAGES)
                    .map(|j| (j * block + r, WEIGHTS[i][j] + own[j]))
                    .collect();
                let others = rows.row(r).filter(|(column, _)| *column != r);
                row.extend(others.filter_map(unknown).map(|(c, v)| (c, dt * v)));
                row.sort_unstable_by_key(|entry| entry.0);
                matrix.push_row(row);
            }
            for c in 0..n_multipliers {
                matrix.push_row(rows.row(n + m + c).filter_map(unknown));
            }
        }
        if is_pulled_back {
            matrix = matrix.transposed();
        }
        matrix.is_finite() && self.sparse.factor(&matrix).is_ok()
    }
}

/// What tells how large changes of the states are: some of them, or the gradient by them of a function at the end.
#[derive(Clone, Copy)]
enum Measured<'c> {
    Changes(&'c [Vec<f64>]),
    Gradient(&'c [f64]),
}

/// In what changes of n states are measured over a part of this length, by their derivatives at the nodes: the size that each state has
/// at the start, or comes to on the way. A state that is zero but for rounding is not measured by that where others act on it.
/// Of a gradient the sizes are those of its entries, which act the other way round, and changes are measured by what they amount to.
fn units(slopes: &[f64], (n, m, dt): (usize, usize, f64), measured: Measured) -> Vec<f64> {
    let width = n + m;
    let mut largest = vec![0.0_f64; n * width];
    for node in slopes.chunks_exact(n * width) {
        let entries = largest.iter_mut().zip(node);
        entries.for_each(|(most, slope)| *most = most.max((dt * slope).abs()));
    }
    let size = |r: usize| match measured {
        Measured::Changes(columns) => columns.iter().fold(0.0_f64, |most, c| most.max(c[r].abs())),
        Measured::Gradient(gradient) => gradient[r].abs(),
    };
    let (action, n_acting): (&dyn Fn(usize, usize) -> f64, _) = match measured {
        Measured::Changes(_) => (&|r, c| largest[r * width + c], width),
        Measured::Gradient(_) => (&|r, c| largest[c * width + r], n),
    };
    let mut sizes: Vec<f64> = (0..n_acting).map(size).collect();
    for _ in 0..n {
        for r in 0..n {
            let others = (0..n_acting).filter(|c| *c != r);
            let share = others.fold(0.0_f64, |most, c| most.max(action(r, c) * sizes[c]));
            sizes[r] = sizes[r].max(share / (1.0 + action(r, r)));
        }
    }
    let states = sizes[..n].iter().map(|size| match measured {
        Measured::Changes(_) => *size,
        Measured::Gradient(_) => 1.0 / size,
    });
    states.map(power_of_two_below).collect()
}

/// The largest power of two that is not above a positive normal number; 1 for others.
fn power_of_two_below(size: f64) -> f64 {
    let digits = (1_u64 << (f64::MANTISSA_DIGITS - 1)) - 1;
    match size.is_normal() {
        true => f64::from_bits(size.to_bits() & !digits),
        false => 1.0,
    }
}

impl Node {
    fn of(rows: &SparseRows, (n, m): (usize, usize)) -> Self {
        let l = rows.n_rows() - n - m;
        let mut own = SparseRows::new(n + l);
        for r in (0..n).chain(n + m..n + m + l) {
            own.push_row(rows.row(r).filter_map(|(c, value)| match c {
                c if c < n => Some((c, value)),
                c if c >= n + m => Some((c - m, value)),
                _ => None,
            }));
        }
        let mut matrix = Matrix::zeros(l);
        for k in 0..l {
            let entries = own.row(n + k).filter(|(c, _)| *c >= n);
            entries.for_each(|(c, value)| matrix[(k, c - n)] = value);
        }
        Node {
            rows: own,
            multipliers: Elimination::of(matrix),
        }
    }

    /// The rates of a change, with what the parameters add to each row.
    fn rates(&self, change: &[f64], by_parameters: &[f64], out: &mut [f64]) {
        let all = self.with_multipliers(change, by_parameters);
        for (r, out) in out.iter_mut().enumerate() {
            *out = -self.rows.dot(r, &all) - by_parameters[r];
        }
    }

    /// Adds the sizes of what the states, the parameters, and the multipliers that follow from them, have in the rates over a length of
    /// time.
    fn add_terms(&self, change: &[f64], by_parameters: &[f64], dt: f64, terms: &mut [f64]) {
        let all = self.with_multipliers(change, by_parameters);
        for (r, terms) in terms.iter_mut().enumerate() {
            *terms += dt.abs() * (self.rows.magnitude(r, &all) + by_parameters[r].abs());
        }
    }

    /// A change with those of the multipliers behind it.
    fn with_multipliers(&self, change: &[f64], by_parameters: &[f64]) -> Vec<f64> {
        let (n, n_rows) = (change.len(), self.rows.n_rows());
        let mut all = change.to_vec();
        all.resize(n_rows, 0.0);
        if n_rows > n {
            let known = (n..n_rows).map(|k| -self.rows.dot(k, &all) - by_parameters[k]);
            let known: Vector = known.collect();
            all[n..].copy_from_slice(&self.multipliers.solve(&known));
        }
        all
    }

    /// The transpose of [`rates`](Self::rates), and the weights of the equations of the multipliers.
    fn rates_back(&self, weights: &[f64], out: &mut [f64], multipliers: &mut Vector) {
        let n = weights.len();
        let l = self.rows.n_rows() - n;
        let mut rest = Vector::from_elem(0.0, l);
        out.fill(0.0);
        for (r, weight) in weights.iter().enumerate() {
            for (c, value) in self.rows.row(r) {
                match c.checked_sub(n) {
                    None => out[c] -= weight * value,
                    Some(k) => rest[k] -= weight * value,
                }
            }
        }
        if l > 0 {
            *multipliers = self.multipliers.solve_transposed(&rest);
            for (k, share) in multipliers.iter().enumerate() {
                let entries = self.rows.row(n + k).filter(|(c, _)| *c < n);
                entries.for_each(|(c, value)| out[c] -= share * value);
            }
        }
    }
}

/// Multiplies values by factors.
fn scale(values: &mut [f64], factors: &[f64]) {
    let pairs = values.iter_mut().zip(factors);
    pairs.for_each(|(value, factor)| *value *= factor);
}

/// Raises sizes to those of these values.
fn raise(sizes: &mut [f64], values: &[f64]) {
    let pairs = sizes.iter_mut().zip(values);
    pairs.for_each(|(size, value)| *size = size.max(value.abs()));
}

/// U_i = sum_j C_ji V_j.
fn integrate_back(v: &[Vec<f64>], u: &mut [Vec<f64>]) {
    for (i, u) in u.iter_mut().enumerate() {
        u.fill(0.0);
        for (v, weights) in v.iter().zip(&INTEGRALS) {
            let entries = u.iter_mut().zip(v);
            entries.for_each(|(u, v)| *u += weights[i] * v);
        }
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
