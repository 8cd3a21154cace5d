//! Systems in which a few unknowns are coupled with very many others, as the multiplier of an actuator that acts everywhere.

use super::order::{components, Component};
use super::rows::SparseRows;
use super::solver::{Singular, SparseSolver};
use crate::page::IS_PAGE;
use crate::tolerances::{BORDER_ACCURACY, BORDER_GAIN, COUPLED_WITH_MANY, MOST_BORDERED};

/// How often the matrix of a step is used: what the border costs per solution counts that many times.
const SOLUTIONS: usize = 9;

/// Factors and solves square systems whose pattern is given before, as [`SparseSolver::for_all_pivots`] does.
///
/// Unknowns that are coupled with very many others fill every band. They are a border of the rest,
///
/// ```text
/// [ C  B ] [ u  ]   [ r ]        u = C^-1 (r - B mu),
/// [ D  E ] [ mu ] = [ q ],       (E - D C^-1 B) mu = q - D C^-1 r,
/// ```
///
/// so that one band serves C, and each of them costs one solution with it. Rows are not exchanged between the two parts. A system
/// whose solution is known shows what that costs: if its residual is more than rounding the matrix is factored as a whole.
///
/// Reference: Golub, Van Loan, *Matrix Computations*, section 3.2.11 (block elimination).
///
/// # Example
/// ```
/// use filippov::sparse::{BorderedSolver, SparseRows};
/// // An arrow: the last unknown is coupled with all others.
/// let n = 100;
/// let mut matrix = SparseRows::new(n + 1);
/// for i in 0..n {
///     matrix.push_row([(i, 2.0), (n, 1.0)]);
/// }
/// matrix.push_row((0..=n).map(|j| (j, 1.0)));
/// let mut solver = BorderedSolver::new(&matrix);
/// assert_eq!(solver.n_bordered(), 1);
/// solver.factor(&matrix)?;
/// let mut x: Vec<f64> = (0..=n).map(|i| if i < n { 3.0 } else { n as f64 + 1.0 }).collect();
/// solver.solve(&mut x);
/// assert!(x.iter().all(|x| (x - 1.0_f64).abs() < 1e-14));
/// # Ok::<(), filippov::sparse::Singular>(())
/// ```
#[derive(Clone, Debug)]
pub struct BorderedSolver {
    /// For matrices without a border, and those that need all pivots.
    whole: SparseSolver,
    border: Option<Border>,
    /// The matrix factored last has its border apart.
    is_bordered: bool,
}

impl BorderedSolver {
    /// A solver for matrices of this pattern.
    pub fn new(matrix: &SparseRows) -> Self {
        BorderedSolver {
            whole: SparseSolver::for_all_pivots(),
            border: Border::of(matrix),
            is_bordered: false,
        }
    }

    /// Takes another pattern.
    pub fn restart(&mut self, matrix: &SparseRows) {
        self.border = Border::of(matrix);
        self.is_bordered = false;
    }

    /// How many unknowns are kept apart.
    pub fn n_bordered(&self) -> usize {
        self.border.as_ref().map_or(0, |border| border.apart.len())
    }

    /// Factors a matrix of the pattern.
    ///
    /// # Errors
    /// [`Singular`] if a pivot is zero.
    pub fn factor(&mut self, matrix: &SparseRows) -> Result<(), Singular> {
        self.is_bordered = match &mut self.border {
            Some(border) if !IS_PAGE => border.factor(matrix),
            _ => false,
        };
        match self.is_bordered {
            true => Ok(()),
            false => self.whole.factor(matrix),
        }
    }

    /// Solves in place with the matrix factored last.
    pub fn solve(&mut self, x: &mut [f64]) {
        match &mut self.border {
            Some(border) if self.is_bordered && !IS_PAGE => border.solve(x),
            _ => self.whole.solve(x),
        }
    }
}

/// The parts of a matrix with a border. Entries are taken from it by their places among its values.
#[derive(Clone, Debug)]
struct Border {
    /// The unknowns of the border, and the others.
    apart: Vec<usize>,
    rest: Vec<usize>,
    core: SparseRows,
    core_places: Vec<usize>,
    /// (row of C, column of the border, place): B.
    right: Vec<(usize, usize, usize)>,
    /// (row of the border, column of C, place, value): D.
    below: Vec<(usize, usize, usize, f64)>,
    /// (row, column, place): E.
    corner: Vec<(usize, usize, usize)>,
    solver: SparseSolver,
    /// C^-1 B, column by column.
    across: Vec<Vec<f64>>,
    schur: SparseSolver,
    /// Both parts of a right-hand side.
    buffers: (Vec<f64>, Vec<f64>),
}

impl Border {
    /// The border of a pattern, if it has one that saves much.
    fn of(matrix: &SparseRows) -> Option<Border> {
        if IS_PAGE {
            return None;
        }
        let n = matrix.n_rows();
        let mut degrees = vec![0_usize; n];
        for i in 0..n {
            for &j in matrix.columns(i) {
                degrees[i] += 1;
                degrees[j] += 1;
            }
        }
        let many = (COUPLED_WITH_MANY * (n as f64).sqrt()) as usize;
        let (apart, rest): (Vec<usize>, Vec<usize>) = (0..n).partition(|&k| degrees[k] > many);
        if apart.is_empty() || apart.len() > MOST_BORDERED.min(n / 8) {
            return None;
        }
        let core = matrix.principal(&rest).into_owned();
        let bordered = work(&components(&core)) + 2 * SOLUTIONS * n * apart.len();
        if BORDER_GAIN * bordered as f64 > work(&components(matrix)) as f64 {
            return None;
        }
        let mut parts = Border {
            core_places: Vec::with_capacity(core.n_entries()),
            core,
            right: Vec::new(),
            below: Vec::new(),
            corner: Vec::new(),
            solver: SparseSolver::for_all_pivots(),
            across: vec![vec![0.0; rest.len()]; apart.len()],
            schur: SparseSolver::for_all_pivots(),
            buffers: (vec![0.0; rest.len()], vec![0.0; apart.len()]),
            apart,
            rest,
        };
        parts.find_places(matrix);
        Some(parts)
    }

    fn find_places(&mut self, matrix: &SparseRows) {
        let (apart, rest) = (&self.apart, &self.rest);
        let is_apart = |k: usize| apart.binary_search(&k);
        let in_rest = |k: usize| rest.partition_point(|&other| other < k);
        let mut place = 0;
        for i in 0..matrix.n_rows() {
            for &j in matrix.columns(i) {
                match (is_apart(i), is_apart(j)) {
                    (Ok(row), Ok(column)) => self.corner.push((row, column, place)),
                    (Ok(row), Err(_)) => self.below.push((row, in_rest(j), place, 0.0)),
                    (Err(_), Ok(column)) => self.right.push((in_rest(i), column, place)),
                    (Err(_), Err(_)) => self.core_places.push(place),
                }
                place += 1;
            }
        }
    }

    /// Factors a matrix; `false` if the border loses digits.
    fn factor(&mut self, matrix: &SparseRows) -> bool {
        let values = matrix.values();
        let core = self.core.values_mut().iter_mut().zip(&self.core_places);
        core.for_each(|(value, &place)| *value = values[place]);
        if self.solver.factor(&self.core).is_err() {
            return false;
        }
        self.across.iter_mut().for_each(|column| column.fill(0.0));
        for &(row, column, place) in &self.right {
            self.across[column][row] = values[place];
        }
        for column in &mut self.across {
            self.solver.solve(column);
        }
        let m = self.apart.len();
        let mut schur = vec![vec![0.0; m]; m];
        for &(row, column, place) in &self.corner {
            schur[row][column] += values[place];
        }
        for (row, column, place, value) in &mut self.below {
            *value = values[*place];
            for (entry, across) in schur[*row].iter_mut().zip(&self.across) {
                *entry -= *value * across[*column];
            }
        }
        let mut rows = SparseRows::new(m);
        for row in &schur {
            rows.push_row(row.iter().copied().enumerate());
        }
        self.schur.factor(&rows).is_ok() && self.is_accurate(matrix)
    }

    /// Is the residual of the system whose solution is all ones no more than rounding?
    fn is_accurate(&mut self, matrix: &SparseRows) -> bool {
        let n = matrix.n_rows();
        let ones = vec![1.0; n];
        let right: Vec<f64> = (0..n).map(|i| matrix.dot(i, &ones)).collect();
        let mut x = right.clone();
        self.solve(&mut x);
        // A NaN is not small either.
        (0..n).all(|i| {
            let residual = (right[i] - matrix.dot(i, &x)).abs();
            residual <= BORDER_ACCURACY * matrix.magnitude(i, &x).max(matrix.magnitude(i, &ones))
        })
    }

    fn solve(&mut self, x: &mut [f64]) {
        let (inner, outer) = (&mut self.buffers.0, &mut self.buffers.1);
        let known = inner.iter_mut().zip(&self.rest);
        known.for_each(|(value, &k)| *value = x[k]);
        self.solver.solve(inner);
        let known = outer.iter_mut().zip(&self.apart);
        known.for_each(|(value, &k)| *value = x[k]);
        for &(row, column, _, value) in &self.below {
            outer[row] -= value * inner[column];
        }
        self.schur.solve(outer);
        for (across, &multiplier) in self.across.iter().zip(&*outer) {
            let pairs = inner.iter_mut().zip(across);
            pairs.for_each(|(value, share)| *value -= multiplier * share);
        }
        self.rest
            .iter()
            .zip(&*inner)
            .chain(self.apart.iter().zip(&*outer))
            .for_each(|(&k, &value)| x[k] = value);
    }
}

/// Operations of a factorisation with its solutions, by bands.
fn work(components: &[Component]) -> usize {
    let of = |component: &Component| {
        let (n, b) = (component.unknowns.len(), component.bandwidth);
        2 * n * b * (2 * b + 1) + 2 * SOLUTIONS * n * (3 * b + 1)
    };
    components.iter().map(of).sum()
}
