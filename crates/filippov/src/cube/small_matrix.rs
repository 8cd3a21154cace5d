//! Square matrices of the size of an intersection: elimination, minors, stability.

use std::ops::{Index, IndexMut};

use smallvec::SmallVec;

use crate::tolerances::PROPORTIONAL;

/// A vector of the size of an intersection.
pub type Vector = SmallVec<[f64; 4]>;

/// A small square matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix {
    n: usize,
    entries: SmallVec<[f64; 16]>,
}

impl Matrix {
    /// The zero matrix.
    pub fn zeros(n: usize) -> Self {
        Matrix {
            n,
            entries: SmallVec::from_elem(0.0, n * n),
        }
    }

    /// The matrix with these entries by row and column.
    pub fn of(n: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let rows = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        let entries = rows.map(|(i, j)| entry(i, j)).collect();
        Matrix { n, entries }
    }

    /// Number of rows.
    pub fn n(&self) -> usize {
        self.n
    }

    /// The rows and columns with these indices.
    pub fn principal(&self, indices: &[usize]) -> Matrix {
        Matrix::of(indices.len(), |r, c| self[(indices[r], indices[c])])
    }

    /// The determinant; 1 for a matrix without rows.
    pub fn determinant(&self) -> f64 {
        Elimination::of(self.clone()).determinant()
    }

    /// Solves A x = b; `None` if a pivot vanishes.
    pub fn solve(&self, b: &[f64]) -> Option<Vector> {
        let x = Elimination::of(self.clone()).solve(b);
        x.iter().all(|v| v.is_finite()).then_some(x)
    }

    /// Solves A x = b for the matrix of inner products of some vectors. Those that depend on earlier ones, up to rounding,
    /// have no share in x.
    pub fn solve_gram(&self, b: &[f64]) -> Vector {
        let n = self.n;
        // A = L L^T, row by row; a dependent row stays zero.
        let mut factor = Matrix::zeros(n);
        for i in 0..n {
            for j in 0..i {
                let sum: f64 = (0..j).map(|k| factor[(i, k)] * factor[(j, k)]).sum();
                if factor[(j, j)] > 0.0 {
                    factor[(i, j)] = (self[(i, j)] - sum) / factor[(j, j)];
                }
            }
            let rest = self[(i, i)] - (0..i).map(|k| factor[(i, k)].powi(2)).sum::<f64>();
            if rest > PROPORTIONAL * self[(i, i)] {
                factor[(i, i)] = rest.sqrt();
            }
        }
        let mut x = Vector::from_slice(b);
        let over = |value: f64, pivot: f64| if pivot > 0.0 { value / pivot } else { 0.0 };
        for i in 0..n {
            let known: f64 = (0..i).map(|k| factor[(i, k)] * x[k]).sum();
            x[i] = over(x[i] - known, factor[(i, i)]);
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| factor[(k, i)] * x[k]).sum();
            x[i] = over(x[i] - known, factor[(i, i)]);
        }
        x
    }

    /// The inverse; `None` if a pivot vanishes.
    pub fn inverse(&self) -> Option<Matrix> {
        let mut inverse = self.clone();
        invert(&mut inverse.entries, self.n).then_some(inverse)
    }

    /// The product with another matrix of the same size.
    pub fn times(&self, other: &Matrix) -> Matrix {
        let entry = |i: usize, j: usize| (0..self.n).map(|k| self[(i, k)] * other[(k, j)]).sum();
        Matrix::of(self.n, entry)
    }

    /// The product with a vector.
    pub fn apply(&self, v: &[f64]) -> Vector {
        let row = |i: usize| (0..self.n).map(|j| self[(i, j)] * v[j]).sum();
        (0..self.n).map(row).collect()
    }

    /// The matrix with rows and columns exchanged.
    #[must_use]
    pub fn transposed(&self) -> Matrix {
        Matrix::of(self.n, |i, j| self[(j, i)])
    }

    /// The largest magnitude of its entries.
    pub fn size(&self) -> f64 {
        self.entries.iter().fold(0.0, |size, v| v.abs().max(size))
    }

    /// The matrix with each row multiplied by a factor.
    #[must_use]
    pub fn with_rows_scaled(&self, factors: &[f64]) -> Matrix {
        Matrix::of(self.n, |i, j| self[(i, j)] * factors[i])
    }

    /// The sets of indices each of which acts on all others of its set, directly or through others: by rows and
    /// columns sorted into these sets the matrix is block triangular. An entry that is rounding of its row does not act.
    pub fn strong_parts(&self) -> Vec<Vec<usize>> {
        let n = self.n;
        let mut acts = SmallVec::<[bool; 16]>::with_capacity(n * n);
        for row in self.entries.chunks_exact(n) {
            let size = row.iter().fold(0.0_f64, |size, v| size.max(v.abs()));
            acts.extend(row.iter().map(|v: &f64| v.abs() > PROPORTIONAL * size));
        }
        for k in 0..n {
            for i in (0..n).filter(|&i| i != k) {
                if acts[i * n + k] {
                    for j in 0..n {
                        acts[i * n + j] |= acts[k * n + j];
                    }
                }
            }
        }
        let together = |i: usize, j: usize| i == j || acts[i * n + j] && acts[j * n + i];
        let leads = |i: &usize| (0..*i).all(|j| !together(*i, j));
        let part = |i: usize| (0..n).filter(|&j| together(i, j)).collect();
        (0..n).filter(leads).map(part).collect()
    }

    /// Do all eigenvalues have negative real parts?
    ///
    /// The characteristic polynomial by Faddeev and LeVerrier, then the array of Routh: exact
    /// enough for the few surfaces that meet, and without eigenvalues.
    pub fn is_hurwitz(&self) -> bool {
        let mut upper: Vec<f64> = Vec::new();
        let mut lower: Vec<f64> = Vec::new();
        for (k, c) in self.characteristic_polynomial().into_iter().enumerate() {
            if k % 2 == 0 { &mut upper } else { &mut lower }.push(c);
        }
        // Each pass makes a row of the array from the two above it; the first column decides.
        for _ in 0..self.n {
            let Some(&lead) = lower.first().filter(|&&lead| lead > 0.0) else {
                return false;
            };
            let ratio = upper[0] / lead;
            let entry = |row: &[f64], i: usize| row.get(i).copied().unwrap_or(0.0);
            let next = (1..upper.len()).map(|i| upper[i] - ratio * entry(&lower, i));
            let next: Vec<f64> = next.collect();
            upper = std::mem::replace(&mut lower, next);
        }
        true
    }

    /// The last but one Hurwitz determinant of det(z - A): positive for stable matrices, and zero where a pair of
    /// eigenvalues reaches the imaginary axis; 1 for fewer than two rows.
    pub fn last_hurwitz_determinant(&self) -> f64 {
        let a = self.characteristic_polynomial();
        // Entry (i, j) is coefficient 2 (j + 1) - (i + 1).
        let entry = |i: usize, j: usize| {
            let index = (2 * j + 1).checked_sub(i);
            index.and_then(|k| a.get(k)).copied().unwrap_or(0.0)
        };
        Matrix::of(self.n.saturating_sub(1), entry).determinant()
    }

    /// Coefficients of det(z - A), highest power first.
    fn characteristic_polynomial(&self) -> Vec<f64> {
        let mut coefficients = vec![1.0];
        let mut power = Matrix::zeros(self.n);
        for k in 1..=self.n {
            for i in 0..self.n {
                power[(i, i)] += coefficients[k - 1];
            }
            power = self.times(&power);
            let trace: f64 = (0..self.n).map(|i| power[(i, i)]).sum();
            coefficients.push(-trace / k as f64);
        }
        coefficients
    }
}

/// Inverts n rows of n entries where they are; `false`, with entries lost, if a pivot vanishes or is not finite.
pub(crate) fn invert(rows: &mut [f64], n: usize) -> bool {
    if let ([entry], 1) = (&mut *rows, n) {
        *entry = 1.0 / *entry;
        return entry.is_finite() && *entry != 0.0;
    }
    let mut swaps = SmallVec::<[usize; 8]>::new();
    for column in 0..n {
        let size = |row: &usize| rows[row * n + column].abs();
        let pivot = (column..n).max_by(|a, b| size(a).total_cmp(&size(b)));
        let pivot = pivot.unwrap_or(column);
        swaps.push(pivot);
        for k in 0..n {
            rows.swap(column * n + k, pivot * n + k);
        }
        let inverse = 1.0 / rows[column * n + column];
        if !inverse.is_finite() || inverse == 0.0 {
            return false;
        }
        rows[column * n + column] = 1.0;
        rows[column * n..(column + 1) * n]
            .iter_mut()
            .for_each(|v| *v *= inverse);
        for row in (0..n).filter(|&row| row != column) {
            let factor = std::mem::replace(&mut rows[row * n + column], 0.0);
            if factor != 0.0 {
                for k in 0..n {
                    rows[row * n + k] -= factor * rows[column * n + k];
                }
            }
        }
    }
    for (column, pivot) in swaps.into_iter().enumerate().rev() {
        for row in 0..n {
            rows.swap(row * n + column, row * n + pivot);
        }
    }
    true
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;

    fn index(&self, (row, column): (usize, usize)) -> &f64 {
        &self.entries[row * self.n + column]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    fn index_mut(&mut self, (row, column): (usize, usize)) -> &mut f64 {
        &mut self.entries[row * self.n + column]
    }
}

/// Gaussian elimination with row pivoting: factors below and above the diagonal, row order, sign.
#[derive(Clone)]
pub(crate) struct Elimination {
    factors: Matrix,
    order: SmallVec<[usize; 4]>,
    sign: f64,
}

impl Elimination {
    /// Of a square matrix, with the largest pivot of each column.
    pub fn of(mut a: Matrix) -> Self {
        let n = a.n;
        let mut order: SmallVec<[usize; 4]> = (0..n).collect();
        let mut sign = 1.0;
        for k in 0..n {
            let larger = |p: usize, i: usize| {
                if a[(i, k)].abs() > a[(p, k)].abs() {
                    i
                } else {
                    p
                }
            };
            let pivot = (k..n).fold(k, larger);
            if pivot != k {
                for j in 0..n {
                    a.entries.swap(k * n + j, pivot * n + j);
                }
                order.swap(k, pivot);
                sign = -sign;
            }
            if a[(k, k)] == 0.0 {
                continue;
            }
            let (above, below) = a.entries.split_at_mut((k + 1) * n);
            let row = &above[k * n + k..];
            for other in below.chunks_exact_mut(n) {
                let factor = other[k] / row[0];
                other[k] = factor;
                let entries = other[k + 1..].iter_mut().zip(&row[1..]);
                entries.for_each(|(entry, value)| *entry -= factor * value);
            }
        }
        Elimination {
            factors: a,
            order,
            sign,
        }
    }

    fn determinant(&self) -> f64 {
        let diagonal = (0..self.factors.n).map(|i| self.factors[(i, i)]);
        self.sign * diagonal.product::<f64>()
    }

    /// Solves A x = b; the solution is not finite if a pivot vanishes.
    pub fn solve(&self, b: &[f64]) -> Vector {
        let (a, n) = (&self.factors, self.factors.n);
        let mut x: Vector = self.order.iter().map(|&row| b[row]).collect();
        for i in 0..n {
            let row = &a.entries[i * n..][..i];
            x[i] -= row.iter().zip(&x).map(|(a, x)| a * x).sum::<f64>();
        }
        for i in (0..n).rev() {
            let row = &a.entries[i * n + i..][..n - i];
            let rest: f64 = row[1..].iter().zip(&x[i + 1..]).map(|(a, x)| a * x).sum();
            x[i] = (x[i] - rest) / row[0];
        }
        x
    }

    /// Solves A^T x = b.
    pub fn solve_transposed(&self, b: &[f64]) -> Vector {
        let (a, n) = (&self.factors, self.factors.n);
        let mut y = Vector::from_slice(b);
        for i in 0..n {
            let row = &a.entries[i * n + i..][..n - i];
            let value = y[i] / row[0];
            y[i] = value;
            let later = y[i + 1..].iter_mut().zip(&row[1..]);
            later.for_each(|(y, a)| *y -= a * value);
        }
        for i in (0..n).rev() {
            let (earlier, value) = y.split_at_mut(i);
            let row = &a.entries[i * n..][..i];
            let entries = earlier.iter_mut().zip(row);
            entries.for_each(|(y, a)| *y -= a * value[0]);
        }
        let mut x = Vector::from_elem(0.0, n);
        self.order.iter().zip(&y).for_each(|(&row, &y)| x[row] = y);
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transposed_equations_are_solved_with_the_same_factors() {
        let a = Matrix::of(3, |i, j| {
            [[0.0, 2.0, 1.0], [3.0, -1.0, 4.0], [1.0, 5.0, -2.0]][i][j]
        });
        let found = Elimination::of(a.clone()).solve_transposed(&[1.0, -2.0, 3.0]);
        for (entry, exact) in a.transposed().apply(&found).iter().zip([1.0, -2.0, 3.0]) {
            assert!((entry - exact).abs() < 1e-14);
        }
    }

    #[test]
    fn a_vector_that_depends_on_others_has_no_share() {
        // Rows (1, 0), (3, 0), (0, 2) and h = (1, 3, 4): the second one says the same as the first.
        let rows = [[1.0, 0.0], [3.0, 0.0], [0.0, 2.0]];
        let mut gram = Matrix::zeros(3);
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            gram[(i, j)] = rows[i][0] * rows[j][0] + rows[i][1] * rows[j][1];
        }
        let shifts = gram.solve_gram(&[1.0, 3.0, 4.0]);
        assert_eq!(shifts.as_slice(), [1.0, 0.0, 1.0]);
    }

    #[test]
    fn rounding_couples_nothing() {
        let mut matrix = Matrix::zeros(2);
        (matrix[(0, 0)], matrix[(1, 1)]) = (-1.0, -2.0);
        (matrix[(0, 1)], matrix[(1, 0)]) = (1e-17, -3e-16);
        assert_eq!(matrix.strong_parts(), [vec![0], vec![1]]);
        matrix[(1, 0)] = -3e-3;
        assert_eq!(matrix.strong_parts().len(), 2);
        matrix[(0, 1)] = 1e-3;
        assert_eq!(matrix.strong_parts(), [vec![0, 1]]);
    }
}
