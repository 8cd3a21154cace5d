//! Sparse matrices by rows, and their product.

use std::borrow::Cow;

/// A sparse matrix by rows. The pattern is kept while values change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SparseRows {
    /// Where each row starts in `columns` and `values`; one entry more than rows.
    starts: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
    n_columns: usize,
}

impl SparseRows {
    /// An empty matrix to which rows are added.
    pub fn new(n_columns: usize) -> Self {
        SparseRows {
            starts: vec![0],
            columns: Vec::new(),
            values: Vec::new(),
            n_columns,
        }
    }

    /// The same with room for so many rows and entries.
    pub(crate) fn with_capacity(n_columns: usize, (rows, entries): (usize, usize)) -> Self {
        let mut starts = Vec::with_capacity(rows + 1);
        starts.push(0);
        SparseRows {
            starts,
            columns: Vec::with_capacity(entries),
            values: Vec::with_capacity(entries),
            n_columns,
        }
    }

    /// A matrix from its dense rows; entries that are 0 are left out.
    pub fn from_dense(rows: &[Vec<f64>]) -> Self {
        let mut matrix = SparseRows::new(rows.first().map_or(0, Vec::len));
        for row in rows {
            let entries = row.iter().copied().enumerate().filter(|&(_, v)| v != 0.0);
            matrix.push_row(entries);
        }
        matrix
    }

    /// Takes all rows out, and makes room for so many rows and entries.
    #[inline(never)]
    pub(crate) fn clear_for(&mut self, n_columns: usize, (rows, entries): (usize, usize)) {
        self.clear(n_columns);
        self.starts.reserve(rows);
        self.columns.reserve(entries);
        self.values.reserve(entries);
    }

    /// Takes all rows out, and keeps their space.
    pub fn clear(&mut self, n_columns: usize) {
        self.starts.clear();
        self.starts.push(0);
        self.columns.clear();
        self.values.clear();
        self.n_columns = n_columns;
    }

    /// Adds a row, its columns in increasing order.
    pub fn push_row(&mut self, entries: impl IntoIterator<Item = (usize, f64)>) {
        for (column, value) in entries {
            self.columns.push(column);
            self.values.push(value);
        }
        self.starts.push(self.columns.len());
    }

    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Number of columns.
    pub fn n_columns(&self) -> usize {
        self.n_columns
    }

    /// Number of stored entries.
    pub fn n_entries(&self) -> usize {
        self.columns.len()
    }

    /// Multiplies every row by its factor.
    pub fn scale_rows(&mut self, factors: &[f64]) {
        for (bounds, factor) in self.starts.windows(2).zip(factors) {
            let row = &mut self.values[bounds[0]..bounds[1]];
            row.iter_mut().for_each(|value| *value *= factor);
        }
    }

    /// Column and value of the entries of a row.
    #[inline]
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[i]..self.starts[i + 1];
        let values = &self.values[range.clone()];
        self.columns[range]
            .iter()
            .copied()
            .zip(values.iter().copied())
    }

    /// The columns of a row.
    #[inline]
    pub fn columns(&self, i: usize) -> &[usize] {
        &self.columns[self.starts[i]..self.starts[i + 1]]
    }

    /// All values, row by row.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All values, row by row, to be overwritten.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Entry (i, i).
    pub fn diagonal(&self, i: usize) -> f64 {
        self.entry(i, i)
    }

    /// Entry (i, j).
    pub fn entry(&self, i: usize, j: usize) -> f64 {
        let found = self.row(i).find(|&(column, _)| column == j);
        found.map_or(0.0, |(_, value)| value)
    }

    /// Row i times a vector.
    pub fn dot(&self, i: usize, x: &[f64]) -> f64 {
        self.row(i).map(|(column, value)| value * x[column]).sum()
    }

    /// The sum of |entry| |x| over row i: what rounding of the product is measured by.
    pub fn magnitude(&self, i: usize, x: &[f64]) -> f64 {
        let terms = self.row(i).map(|(column, value)| (value * x[column]).abs());
        terms.sum()
    }

    /// The transposed matrix.
    #[must_use]
    pub fn transposed(&self) -> SparseRows {
        let mut starts = vec![0; self.n_columns + 1];
        for &column in &self.columns {
            starts[column + 1] += 1;
        }
        for i in 0..self.n_columns {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut columns = vec![0; self.columns.len()];
        let mut values = vec![0.0; self.columns.len()];
        for i in 0..self.n_rows() {
            for (column, value) in self.row(i) {
                let slot = next[column];
                next[column] += 1;
                columns[slot] = i;
                values[slot] = value;
            }
        }
        SparseRows {
            starts,
            columns,
            values,
            n_columns: self.n_rows(),
        }
    }

    /// Rows and columns of a square matrix that `kept` lists in increasing order.
    #[must_use]
    pub fn principal(&self, kept: &[usize]) -> Cow<'_, SparseRows> {
        if kept.len() == self.n_rows() {
            return Cow::Borrowed(self);
        }
        let n_entries = kept.iter().map(|&i| self.columns(i).len()).sum();
        let mut block = SparseRows::with_capacity(kept.len(), (kept.len(), n_entries));
        if self.is_diagonal() {
            for (place, &i) in kept.iter().enumerate() {
                block.push_row(self.row(i).map(|(_, value)| (place, value)));
            }
            return Cow::Owned(block);
        }
        for &i in kept {
            let place = |(j, value)| kept.binary_search(&j).ok().map(|place| (place, value));
            block.push_row(self.row(i).filter_map(place));
        }
        Cow::Owned(block)
    }

    /// The matrix with each column multiplied by a factor.
    #[must_use]
    pub fn with_columns_scaled(&self, factors: &[f64]) -> SparseRows {
        let mut scaled = self.clone();
        let entries = scaled.values.iter_mut().zip(&self.columns);
        entries.for_each(|(value, &j)| *value *= factors[j]);
        scaled
    }

    /// The comparison matrix of a square one: |a_ii| on the diagonal, -|a_ij| beside it.
    #[must_use]
    pub fn comparison(&self) -> SparseRows {
        let mut comparison = self.clone();
        for i in 0..self.n_rows() {
            for k in self.starts[i]..self.starts[i + 1] {
                let size = self.values[k].abs();
                comparison.values[k] = if self.columns[k] == i { size } else { -size };
            }
        }
        comparison
    }

    /// Have no two rows a column in common?
    pub fn has_disjoint_rows(&self) -> bool {
        let is_disjoint = |columns: &[usize]| columns.windows(2).all(|pair| pair[0] < pair[1]);
        is_disjoint(&self.columns) || {
            let mut columns = self.columns.clone();
            columns.sort_unstable();
            is_disjoint(&columns)
        }
    }

    /// A square matrix less a diagonal.
    #[must_use]
    pub fn less_diagonal(&self, less: &[f64]) -> SparseRows {
        let mut result = SparseRows::new(self.n_columns);
        for (i, less) in less.iter().enumerate() {
            let before = self.row(i).filter(|&(j, _)| j < i);
            let own = [(i, self.diagonal(i) - less)];
            result.push_row(before.chain(own).chain(self.row(i).filter(|&(j, _)| j > i)));
        }
        result
    }

    /// Has a square matrix no entries beside the diagonal?
    pub fn is_diagonal(&self) -> bool {
        (0..self.n_rows()).all(|i| self.columns(i).iter().all(|&j| j == i))
    }

    /// Are all values finite?
    pub fn is_finite(&self) -> bool {
        self.values.iter().all(|value| value.is_finite())
    }
}

/// The product A B^T of two matrices whose patterns stay: which entries meet is found once.
#[derive(Clone, Debug, Default)]
pub struct SparseProduct {
    /// (entry of the product, entry of A, entry of B), in the order of summation.
    terms: Vec<(u32, u32, u32)>,
    /// The product.
    pub matrix: SparseRows,
}

impl SparseProduct {
    /// Finds the pattern of A B^T. Its diagonal is always kept.
    pub fn new(a: &SparseRows, b: &SparseRows) -> Self {
        let mut product = SparseProduct::default();
        product.find_pattern(a, b);
        product
    }

    /// Becomes the product of two other matrices, in the same space.
    pub fn find_pattern(&mut self, a: &SparseRows, b: &SparseRows) {
        let SparseProduct { terms, matrix } = self;
        // Column, row and place of the entries of B, one column after the other.
        let mut users = Vec::with_capacity(b.n_entries());
        for j in 0..b.n_rows() {
            let entries = (b.starts[j] as u32..).zip(b.columns(j));
            users.extend(entries.map(|(entry, &column)| (column, j, entry)));
        }
        users.sort_unstable();
        let room = (a.n_rows(), a.n_entries().max(a.n_rows()));
        matrix.clear_for(b.n_rows(), room);
        terms.clear();
        terms.reserve(a.n_entries());
        let mut met = Vec::new();
        for i in 0..a.n_rows() {
            met.clear();
            for (entry, &column) in (a.starts[i] as u32..).zip(a.columns(i)) {
                let first = users.partition_point(|user| user.0 < column);
                let users = users[first..].iter().take_while(|user| user.0 == column);
                met.extend(users.map(|&(_, j, other)| (j, entry, other)));
            }
            met.sort_unstable();
            let start = matrix.n_entries();
            let mut diagonal = (i < b.n_rows()).then_some(i);
            for &(j, entry, other) in &met {
                if let Some(i) = diagonal.take_if(|i| *i <= j) {
                    matrix.columns.push(i);
                }
                if matrix.columns[start..].last() != Some(&j) {
                    matrix.columns.push(j);
                }
                terms.push((matrix.columns.len() as u32 - 1, entry, other));
            }
            matrix.columns.extend(diagonal);
            matrix.starts.push(matrix.columns.len());
        }
        matrix.values.resize(matrix.columns.len(), 0.0);
    }

    /// Computes the values; A and B have the patterns of [`SparseProduct::new`].
    pub fn update(&mut self, a: &SparseRows, b: &SparseRows) {
        self.matrix.values.fill(0.0);
        for &(slot, entry, other) in &self.terms {
            self.matrix.values[slot as usize] +=
                a.values[entry as usize] * b.values[other as usize];
        }
    }

    /// Number of multiplications of an update.
    pub fn n_operations(&self) -> usize {
        self.terms.len()
    }
}
