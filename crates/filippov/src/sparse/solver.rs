//! Solution of sparse systems by components, with singular ones named.

use super::band::BandLu;
use super::order::{components, Component};
use super::rows::SparseRows;
use crate::tolerances::{AT_SIDE, DEFINITE_PIVOT, PROPORTIONAL};

/// What couples the unknowns of a system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Nothing.
    Diagonal,
    /// Neighbours in some order: entries up to that distance from the diagonal in the largest component.
    Banded {
        /// The distance.
        bandwidth: usize,
    },
    /// Everything with everything.
    Dense,
}

/// A matrix that has no inverse to rounding.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the matrix is singular: the columns {unknowns:?} depend on one another")]
pub struct Singular {
    /// Unknowns that a solution does not determine, in increasing order.
    pub unknowns: Vec<usize>,
}

/// Components that are factored together.
#[derive(Clone, Debug)]
struct Block {
    joined: Component,
    /// Unknowns of the largest of them.
    largest: usize,
}

/// Factors and solves square systems. The ordering is kept while the pattern stays the same.
///
/// # Example
/// ```
/// use filippov::sparse::{Pattern, SparseRows, SparseSolver};
/// let matrix = SparseRows::from_dense(&[vec![-2.0, 1.0, 0.0], vec![1.0, -2.0, 1.0], vec![0.0, 1.0, -2.0]]);
/// let mut solver = SparseSolver::default();
/// solver.factor(&matrix)?;
/// let mut x = [-1.0, 0.0, -1.0];
/// solver.solve(&mut x);
/// assert!(x.iter().all(|x| (x - 1.0_f64).abs() < 1e-15));
/// assert_eq!(solver.pattern(), Pattern::Banded { bandwidth: 1 });
/// # Ok::<(), filippov::sparse::Singular>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct SparseSolver {
    /// The entries of a diagonal matrix, which needs nothing else.
    diagonal: Option<Vec<f64>>,
    /// The pattern that the blocks belong to: columns of each row, row lengths in front.
    ordered: Vec<usize>,
    blocks: Vec<Block>,
    factors: Vec<BandLu>,
    /// Rows and columns are divided by these before elimination.
    row_scale: Vec<f64>,
    column_scale: Vec<f64>,
    /// For each unknown its place in its block.
    place: Vec<usize>,
    buffer: Vec<f64>,
    n_orderings: usize,
    /// Relative errors of the entries, beside rounding.
    noise: f64,
    /// Only a pivot that is zero is singular.
    takes_all_pivots: bool,
    /// Of factors that other orderings replaced.
    n_operations_before: usize,
}

impl SparseSolver {
    /// A solver for matrices whose entries are known up to this fraction of the largest ones in row and column,
    /// as from differences: what is singular within it counts as singular.
    pub fn with_noise(noise: f64) -> Self {
        SparseSolver {
            noise,
            ..SparseSolver::default()
        }
    }

    /// A new solver for matrices with entries of the same errors.
    pub fn of_this_noise(&self) -> Self {
        SparseSolver::with_noise(self.noise)
    }

    /// A solver that goes on at every pivot but zero: for matrices that have an inverse, however far apart the sizes
    /// are that they are made of, as 1/dt and the fastest rate of a stiff field.
    pub fn for_all_pivots() -> Self {
        SparseSolver {
            takes_all_pivots: true,
            ..SparseSolver::default()
        }
    }

    /// Factors a matrix.
    ///
    /// Rows and columns are scaled to the size 1 first, so that units do not matter. A matrix with entries
    /// that are not finite is factored all the same, and the solution is then not finite.
    ///
    /// # Errors
    /// [`Singular`] if a pivot is at the level of rounding.
    pub fn factor(&mut self, matrix: &SparseRows) -> Result<(), Singular> {
        if matrix.is_diagonal() {
            return self.factor_diagonal(matrix);
        }
        self.diagonal = None;
        self.order(matrix);
        self.scale(matrix);
        for (block, factor) in self.blocks.iter().zip(&mut self.factors) {
            let component = &block.joined;
            factor.reset(component.unknowns.len(), component.bandwidth);
            for (i, &row) in component.unknowns.iter().enumerate() {
                for (column, value) in matrix.row(row) {
                    let scaled = value / self.row_scale[row] / self.column_scale[column];
                    factor.add(i, self.place[column], scaled);
                }
            }
            let threshold = if self.takes_all_pivots {
                0.0
            } else {
                self.noise.max(PROPORTIONAL * block.largest as f64)
            };
            if let Err(null) = factor.factor(threshold) {
                let scaled = component.unknowns.iter().zip(null);
                return Err(Singular {
                    unknowns: determined_by(scaled),
                });
            }
        }
        Ok(())
    }

    /// A diagonal matrix is singular where an entry is 0.
    fn factor_diagonal(&mut self, matrix: &SparseRows) -> Result<(), Singular> {
        let mut diagonal = self.diagonal.take().unwrap_or_default();
        diagonal.clear();
        diagonal.extend((0..matrix.n_rows()).map(|i| matrix.diagonal(i)));
        let zero = diagonal.iter().position(|&entry| entry == 0.0);
        self.diagonal = Some(diagonal);
        zero.map_or(Ok(()), |i| Err(Singular { unknowns: vec![i] }))
    }

    /// Solves in place with the matrix factored last.
    pub fn solve(&mut self, x: &mut [f64]) {
        if let Some(diagonal) = &self.diagonal {
            let pairs = x.iter_mut().zip(diagonal);
            pairs.for_each(|(x, entry)| *x /= entry);
            self.n_operations_before += x.len();
            return;
        }
        for (block, factor) in self.blocks.iter().zip(&mut self.factors) {
            let component = &block.joined;
            self.buffer.clear();
            let scaled = component.unknowns.iter().map(|&i| x[i] / self.row_scale[i]);
            self.buffer.extend(scaled);
            factor.solve(&mut self.buffer);
            for (&i, &value) in component.unknowns.iter().zip(&self.buffer) {
                x[i] = value / self.column_scale[i];
            }
        }
    }

    /// What couples the unknowns of the matrix factored last.
    pub fn pattern(&self) -> Pattern {
        if self.diagonal.is_some() {
            return Pattern::Diagonal;
        }
        let n: usize = self.place.len();
        let bandwidth = self.blocks.iter().map(|block| block.joined.bandwidth).max();
        match bandwidth {
            None | Some(0) => Pattern::Diagonal,
            Some(b) if b + 1 == n => Pattern::Dense,
            Some(bandwidth) => Pattern::Banded { bandwidth },
        }
    }

    /// Multiplications and divisions of all factorisations and solutions.
    pub fn n_operations(&self) -> usize {
        let now: usize = self.factors.iter().map(|factor| factor.n_operations).sum();
        self.n_operations_before + now
    }

    /// How often an ordering was looked for.
    pub fn n_orderings(&self) -> usize {
        self.n_orderings
    }

    fn order(&mut self, matrix: &SparseRows) {
        let n = matrix.n_rows();
        let lengths = (0..n).map(|i| matrix.columns(i).len());
        let key = lengths.chain((0..n).flat_map(|i| matrix.columns(i).iter().copied()));
        if self.n_orderings > 0 && key.clone().eq(self.ordered.iter().copied()) {
            return;
        }
        self.ordered = key.collect();
        self.blocks = blocks(components(matrix));
        self.n_operations_before = self.n_operations();
        self.factors = vec![BandLu::default(); self.blocks.len()];
        self.place = vec![0; n];
        for block in &self.blocks {
            for (place, &i) in block.joined.unknowns.iter().enumerate() {
                self.place[i] = place;
            }
        }
        self.n_orderings += 1;
    }

    fn scale(&mut self, matrix: &SparseRows) {
        let n = matrix.n_rows();
        let or_one = |size: f64| if size > 0.0 { size } else { 1.0 };
        self.row_scale.clear();
        self.row_scale.extend((0..n).map(|i| {
            let size = matrix.row(i).fold(0.0_f64, |m, (_, v)| m.max(v.abs()));
            or_one(size)
        }));
        self.column_scale.clear();
        self.column_scale.resize(n, 0.0);
        for i in 0..n {
            for (column, value) in matrix.row(i) {
                let size = &mut self.column_scale[column];
                *size = size.max((value / self.row_scale[i]).abs());
            }
        }
        for size in &mut self.column_scale {
            *size = or_one(*size);
        }
    }
}

/// Components of the same bandwidth joined: nothing couples them, and one band serves them all.
fn blocks(mut components: Vec<Component>) -> Vec<Block> {
    components.sort_by_key(|component| component.bandwidth);
    let mut blocks: Vec<Block> = Vec::new();
    for component in components {
        let size = component.unknowns.len();
        match blocks.last_mut() {
            Some(last) if last.joined.bandwidth == component.bandwidth => {
                last.joined.unknowns.extend(component.unknowns);
                last.largest = last.largest.max(size);
            }
            _ => blocks.push(Block {
                joined: component,
                largest: size,
            }),
        }
    }
    blocks
}

/// The unknowns that take part in a vector of the null space.
fn determined_by<'a>(entries: impl Iterator<Item = (&'a usize, f64)> + Clone) -> Vec<usize> {
    let largest = entries.clone().fold(0.0_f64, |m, (_, v)| m.max(v.abs()));
    let mut unknowns: Vec<usize> = entries
        .filter(|(_, v)| v.abs() >= AT_SIDE * largest)
        .map(|(&i, _)| i)
        .collect();
    unknowns.sort_unstable();
    unknowns
}

/// Is A + A^T positive definite? Decided after scaling the diagonal to 1, so that units do not matter.
pub fn is_positive_definite(matrix: &SparseRows) -> bool {
    let n = matrix.n_rows();
    let roots: Vec<f64> = (0..n).map(|i| (2.0 * matrix.diagonal(i)).sqrt()).collect();
    if !roots.iter().all(|&root| root > 0.0) {
        return false;
    }
    let mut place = vec![0; n];
    components(matrix).iter().all(|component| {
        for (at, &i) in component.unknowns.iter().enumerate() {
            place[i] = at;
        }
        let mut band = BandLu::default();
        band.reset(component.unknowns.len(), component.bandwidth);
        for &i in &component.unknowns {
            for (j, value) in matrix.row(i) {
                let scaled = value / roots[i] / roots[j];
                band.add(place[i], place[j], scaled);
                band.add(place[j], place[i], scaled);
            }
        }
        band.is_positive_definite(DEFINITE_PIVOT)
    })
}
