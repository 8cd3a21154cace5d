//! The derivatives of a field at a point, as a method for stiff motions needs them.

use crate::sparse::SparseRows;

/// The partial derivatives of a field f at a point, with multipliers as unknowns of their own.
///
/// While the motion slides, f(t, x) = F(t, x, lambda) with G(t, x, lambda) = 0, the rates of the surfaces slid on. Then
/// df/dx = F_x - F_l G_l^-1 G_x is full even where all these are sparse, and (c - df/dx) u = r is solved as
///
/// ```text
/// [ c - F_x   -F_l ] [ u  ]   [ r ]
/// [   G_x      G_l ] [ mu ] = [ 0 ],
/// ```
///
/// which stays sparse. In a region, or by differences, there are no multipliers, and it is (c - f_x) u = r.
#[derive(Clone, Debug)]
pub struct Linearisation {
    n: usize,
    /// The matrix, with the c that was asked for last.
    matrix: SparseRows,
    /// Where the diagonal of its first n rows is among the values.
    diagonal: Vec<usize>,
    /// -dF_i/dx_i.
    own: Vec<f64>,
    /// F_t, then -G_t: by their shares of the right-hand side the derivative in time enters.
    time: Vec<f64>,
    /// Are these the derivatives of the field beside the surfaces too, and not those of the field at the projection
    /// of a point?
    is_exact: bool,
    /// The values that a program computes, before they are in their places.
    pub(super) computed: Vec<f64>,
}

impl Linearisation {
    /// Space for the derivatives of n components: a square matrix that contains the diagonal of its first n rows.
    pub fn new(n: usize, matrix: SparseRows, is_exact: bool) -> Self {
        let mut start = 0;
        let mut diagonal = Vec::with_capacity(n);
        for i in 0..n {
            let columns = matrix.columns(i);
            let place = columns.binary_search(&i);
            diagonal.push(start + place.unwrap_or_else(|place| place));
            start += columns.len();
        }
        Linearisation {
            n,
            time: vec![0.0; matrix.n_rows()],
            own: vec![0.0; n],
            matrix,
            diagonal,
            is_exact,
            computed: Vec::new(),
        }
    }

    /// Space for derivatives by differences.
    pub fn dense(n: usize) -> Self {
        let mut matrix = SparseRows::new(n);
        for _ in 0..n {
            matrix.push_row((0..n).map(|i| (i, 0.0)));
        }
        Linearisation::new(n, matrix, false)
    }

    /// Number of components of the field.
    pub fn n_states(&self) -> usize {
        self.n
    }

    /// Number of unknowns: components and multipliers.
    pub fn n_unknowns(&self) -> usize {
        self.time.len()
    }

    /// Are these the derivatives of the field beside the surfaces too?
    pub fn is_exact(&self) -> bool {
        self.is_exact
    }

    /// Takes values: -F_x and -F_l, G_x and G_l row by row, and F_t and -G_t.
    pub fn fill(&mut self, values: impl FnOnce(&mut [f64], &mut [f64])) {
        values(self.matrix.values_mut(), &mut self.time);
        for (own, &place) in self.own.iter_mut().zip(&self.diagonal) {
            *own = self.matrix.values()[place];
        }
    }

    /// Are all derivatives finite?
    pub fn is_finite(&self) -> bool {
        self.matrix.is_finite() && self.time.iter().all(|v| v.is_finite())
    }

    /// The matrix with c on the diagonal.
    pub fn shifted(&mut self, c: f64) -> &SparseRows {
        for (own, &place) in self.own.iter().zip(&self.diagonal) {
            self.matrix.values_mut()[place] = c + own;
        }
        &self.matrix
    }

    /// The matrix as it was filled, or with what was put on its diagonal last.
    pub fn rows(&self) -> &SparseRows {
        &self.matrix
    }

    /// F_t, then -G_t.
    pub fn time(&self) -> &[f64] {
        &self.time
    }
}
