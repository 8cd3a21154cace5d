//! Band matrices: LU factorisation with row exchanges, and the test for positive definiteness.

/// An LU factorisation of a matrix with `b` diagonals below and above the main one.
///
/// Gaussian elimination with partial pivoting inside of the band; U grows to at most 2 b diagonals above. Costs
/// about 2 n b (2 b + 1) operations, a solution 2 n (3 b + 1), and where no rows are exchanged half and two thirds of that.
///
/// Reference: Golub, Van Loan, *Matrix Computations*, section 4.3.
#[derive(Clone, Debug, Default)]
pub(super) struct BandLu {
    n: usize,
    b: usize,
    /// Entry (i, j) at i (3 b + 1) + j - i + b, for j - i from -b to 2 b.
    entries: Vec<f64>,
    /// The last column of each row that may not be zero: without exchanges U has no more diagonals than A.
    ends: Vec<usize>,
    /// The factors by which row k was taken from the b rows behind it, at k b.
    factors: Vec<f64>,
    exchanges: Vec<usize>,
    /// Multiplications and divisions so far.
    pub n_operations: usize,
}

impl BandLu {
    /// Forgets everything: a matrix of zeros, to be filled by [`BandLu::add`].
    pub fn reset(&mut self, n: usize, b: usize) {
        (self.n, self.b) = (n, b);
        self.entries.clear();
        self.entries.resize(n * (3 * b + 1), 0.0);
        self.factors.clear();
        self.factors.resize(n * b, 0.0);
        self.exchanges.clear();
        self.ends.clear();
        self.ends.extend(0..n);
    }

    fn at(&self, i: usize, j: usize) -> usize {
        i * (3 * self.b + 1) + j + self.b - i
    }

    /// Adds to entry (i, j).
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        let at = self.at(i, j);
        self.entries[at] += value;
        self.ends[i] = self.ends[i].max(j);
    }

    /// Factors the matrix. If no pivot of a column is larger than `threshold` the matrix is singular to
    /// rounding: returns a vector that it maps to (nearly) 0.
    pub fn factor(&mut self, threshold: f64) -> Result<(), Vec<f64>> {
        for k in 0..self.n {
            let last = (k + self.b).min(self.n - 1);
            let mut pivot = k;
            for i in k + 1..=last {
                if self.entries[self.at(i, k)].abs() > self.entries[self.at(pivot, k)].abs() {
                    pivot = i;
                }
            }
            if self.entries[self.at(pivot, k)].abs() <= threshold {
                return Err(self.null_vector(k));
            }
            self.exchanges.push(pivot);
            if pivot != k {
                for j in k..=self.ends[k].max(self.ends[pivot]) {
                    let (upper, lower) = (self.at(k, j), self.at(pivot, j));
                    self.entries.swap(upper, lower);
                }
                self.ends.swap(k, pivot);
            }
            self.eliminate(k, last);
        }
        Ok(())
    }

    /// Takes row k from those behind it up to `last`.
    fn eliminate(&mut self, k: usize, last: usize) {
        let (diagonal, end) = (self.entries[self.at(k, k)], self.ends[k]);
        for i in k + 1..=last {
            let below = self.at(i, k);
            if self.entries[below] == 0.0 {
                continue;
            }
            let factor = self.entries[below] / diagonal;
            self.factors[k * self.b + i - k - 1] = factor;
            let (pivot, n) = (self.at(k, k) + 1, end - k);
            // Row i begins behind the end of row k.
            let (upper, lower) = self.entries.split_at_mut(below + 1);
            let pairs = lower[..n].iter_mut().zip(&upper[pivot..pivot + n]);
            pairs.for_each(|(entry, above)| *entry -= factor * above);
            self.ends[i] = self.ends[i].max(end);
            self.n_operations += n + 1;
        }
    }

    /// Solves in place.
    pub fn solve(&mut self, x: &mut [f64]) {
        for k in 0..self.n {
            x.swap(k, self.exchanges[k]);
            let n = self.b.min(self.n - 1 - k);
            let (known, behind) = x.split_at_mut(k + 1);
            let factors = &self.factors[k * self.b..k * self.b + n];
            let pairs = behind.iter_mut().zip(factors);
            pairs.for_each(|(x, factor)| *x -= factor * known[k]);
            self.n_operations += n;
        }
        self.back_substitute(x, self.n);
        self.n_operations += self.n * (2 * self.b + 1);
    }

    /// Solves with the first n rows and columns of U.
    fn back_substitute(&self, x: &mut [f64], n: usize) {
        for k in (0..n).rev() {
            let end = self.ends[k].min(n - 1);
            let row = self.at(k, k);
            let known: f64 = (1..=end - k)
                .map(|offset| self.entries[row + offset] * x[k + offset])
                .sum();
            x[k] = (x[k] - known) / self.entries[row];
        }
    }

    /// With the first k columns eliminated and no pivot in column k: z with U z = 0, z_k = 1.
    fn null_vector(&self, k: usize) -> Vec<f64> {
        let mut z = vec![0.0; self.n];
        for (i, z) in z.iter_mut().enumerate().take(k) {
            if k - i <= 2 * self.b {
                *z = -self.entries[self.at(i, k)];
            }
        }
        self.back_substitute(&mut z, k);
        z[k] = 1.0;
        z
    }

    /// Is the symmetric matrix that was filled in positive definite? Elimination without exchanges; all pivots
    /// have to be larger than `threshold`. Destroys the matrix.
    pub fn is_positive_definite(&mut self, threshold: f64) -> bool {
        for k in 0..self.n {
            // A NaN is not larger either.
            let is_large = self.entries[self.at(k, k)] > threshold;
            if !is_large {
                return false;
            }
            let last = (k + self.b).min(self.n - 1);
            self.eliminate(k, last);
        }
        true
    }
}
