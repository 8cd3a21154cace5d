//! The continuous extension of a step.

use smallvec::SmallVec;

use crate::page::IS_PAGE;

/// How the rows of coefficients make a polynomial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// Six rows of the nested form
    ///
    ///   y0 + theta (r1 + (1-theta) (r2 + theta (r3 + (1-theta) (r4 + theta r5)))),
    ///
    /// with r5 = 0 for the free extension of order 4 of DOPRI5. The first three terms are the cubic Hermite
    /// polynomial of the step, so that the extension joins its neighbours with one derivative.
    Nested,
    /// Rows for the powers 1, theta, theta^2, .., theta^degree.
    Powers,
}

/// Coefficients of one component in powers of theta from some centre.
pub type Expansion = SmallVec<[f64; 32]>;

/// The continuous extension of a step: a polynomial in theta = (t - t0) / dt.
#[derive(Clone, Debug)]
pub struct Interpolant {
    /// Start of the step.
    pub t0: f64,
    /// Length of the step.
    pub dt: f64,
    n: usize,
    basis: Basis,
    /// Rows of n.
    coefficients: Vec<f64>,
}

impl Interpolant {
    pub(super) fn empty(n: usize) -> Self {
        Interpolant {
            t0: 0.0,
            dt: 0.0,
            n,
            basis: Basis::Nested,
            coefficients: vec![0.0; 6 * n],
        }
    }

    /// Zeros for powers up to `degree`.
    pub(super) fn powers(n: usize, degree: usize) -> Self {
        Interpolant {
            t0: 0.0,
            dt: 0.0,
            n,
            basis: Basis::Powers,
            coefficients: vec![0.0; (degree + 1) * n],
        }
    }

    #[inline]
    pub(super) fn rows(&mut self) -> [&mut [f64]; 6] {
        let n = self.n;
        let (y0, rest) = self.coefficients.split_at_mut(n);
        let (r1, rest) = rest.split_at_mut(n);
        let (r2, rest) = rest.split_at_mut(n);
        let (r3, rest) = rest.split_at_mut(n);
        let (r4, r5) = rest.split_at_mut(n);
        [y0, r1, r2, r3, r4, r5]
    }

    pub(super) fn coefficients_mut(&mut self) -> &mut [f64] {
        &mut self.coefficients
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.n
    }

    /// What the coefficients mean.
    pub fn basis(&self) -> Basis {
        self.basis
    }

    /// The coefficients, rows of n.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Writes the state at theta.
    pub fn at(&self, theta: f64, y: &mut [f64]) {
        evaluate(self.basis, &self.coefficients, self.n, theta, y);
    }

    /// Makes the state at theta > 0 this one by a motion that is even in time, so that the start stays.
    pub fn lead_to(&mut self, theta: f64, y: &[f64]) {
        let n = self.n;
        let mut here = vec![0.0; n];
        self.at(theta, &mut here);
        let linear = &mut self.coefficients[n..2 * n];
        for (c, (y, here)) in linear.iter_mut().zip(y.iter().zip(&here)) {
            *c += (y - here) / theta;
        }
    }

    /// The coefficients d0, d1, .. of component `i` in powers of theta - `centre`.
    pub fn expanded(&self, i: usize, centre: f64) -> Expansion {
        let r = |k: usize| self.coefficients[k * self.n + i];
        let mut d: Expansion = match self.basis {
            Basis::Nested => {
                let mut rows: Expansion = (0..6).map(r).collect();
                powers_of_nested(&mut rows);
                rows
            }
            Basis::Powers => {
                let n_rows = self.coefficients.len() / self.n;
                // What stands still, or moves evenly, has a short series.
                let used = (0..n_rows).rev().find(|&k| r(k) != 0.0).unwrap_or(0);
                let column = self.coefficients[i..].iter().step_by(self.n);
                column.take(used + 1).copied().collect()
            }
        };
        shift(&mut d, centre);
        d
    }

    /// The value of component `i` if it stands still.
    pub fn constant(&self, i: usize) -> Option<f64> {
        let moves = |row: &[f64]| row[i] != 0.0;
        let (first, rest) = self.coefficients.split_at(self.n);
        (!rest.chunks_exact(self.n).any(moves)).then_some(first[i])
    }

    /// Writes the derivative of the state in t at theta.
    pub fn derivative(&self, theta: f64, dy: &mut [f64]) {
        derivative(self.basis, &self.coefficients, (theta, self.dt), dy);
    }
}

/// Makes coefficients in powers of theta those in powers of theta - `centre`: Horner's scheme, once for every
/// derivative.
pub(crate) fn shift(d: &mut [f64], centre: f64) {
    if centre == 0.0 {
        return;
    }
    let Some((&mut highest, lower)) = d.split_last_mut() else {
        return;
    };
    for first in 0..lower.len() {
        let mut above = highest;
        for c in lower[first..].iter_mut().rev() {
            *c += centre * above;
            above = *c;
        }
    }
}

/// Makes the six coefficients of a nested form those in powers of theta.
pub(crate) fn powers_of_nested(rows: &mut [f64]) {
    if let &mut [_, r1, r2, r3, r4, r5] = rows {
        let powers = [r1 + r2, r3 + r4 - r2, r5 - r3 - 2.0 * r4, r4 - 2.0 * r5];
        rows[1..5].copy_from_slice(&powers);
    }
}

/// Evaluates the derivative of rows of coefficients at theta, of a step of this length, in time.
pub(crate) fn derivative(
    basis: Basis,
    coefficients: &[f64],
    (theta, dt): (f64, f64),
    dy: &mut [f64],
) {
    let n = dy.len();
    let r = |i: usize| &coefficients[i * n..(i + 1) * n];
    if basis == Basis::Powers {
        for (i, dy) in dy.iter_mut().enumerate() {
            let (mut slope, mut k) = (0.0, (coefficients.len() / n) as f64);
            for c in coefficients[n + i..].iter().step_by(n).rev() {
                k -= 1.0;
                slope = slope * theta + k * c;
            }
            *dy = slope / dt;
        }
        return;
    }
    let u = 1.0 - theta;
    let (w, dw) = ((theta * u).powi(2), 2.0 * theta * u * (u - theta));
    for (i, dy) in dy.iter_mut().enumerate() {
        let cubic = r(1)[i] + (u - theta) * r(2)[i] + theta * (2.0 - 3.0 * theta) * r(3)[i];
        *dy = (cubic + dw * (r(4)[i] + theta * r(5)[i]) + w * r(5)[i]) / dt;
    }
}

/// Evaluates rows of coefficients.
#[inline]
pub(crate) fn evaluate(basis: Basis, coefficients: &[f64], n: usize, theta: f64, y: &mut [f64]) {
    match basis {
        Basis::Nested => evaluate_nested(coefficients, n, theta, y),
        Basis::Powers if IS_PAGE => evaluate_in_blocks(coefficients, theta, y),
        Basis::Powers => match n {
            1 => evaluate_powers::<1>(coefficients, theta, y),
            2 => evaluate_powers::<2>(coefficients, theta, y),
            3 => evaluate_powers::<3>(coefficients, theta, y),
            4 => evaluate_powers::<4>(coefficients, theta, y),
            _ => evaluate_in_blocks(coefficients, theta, y),
        },
    }
}

/// Horner's scheme for many states, some at a time.
fn evaluate_in_blocks(coefficients: &[f64], theta: f64, y: &mut [f64]) {
    let mut first = 0;
    while first < y.len() {
        first += match y.len() - first {
            8.. if !IS_PAGE => evaluate_block::<8>(coefficients, theta, y, first),
            4.. if !IS_PAGE => evaluate_block::<4>(coefficients, theta, y, first),
            _ => evaluate_block::<1>(coefficients, theta, y, first),
        };
    }
}

/// The same for `N` states from this one on; returns their number.
fn evaluate_block<const N: usize>(
    coefficients: &[f64],
    theta: f64,
    y: &mut [f64],
    first: usize,
) -> usize {
    let mut value = [0.0; N];
    for row in coefficients.chunks_exact(y.len()).rev() {
        if let Some(row) = row[first..].first_chunk::<N>() {
            for i in 0..N {
                value[i] = value[i] * theta + row[i];
            }
        }
    }
    y[first..first + N].copy_from_slice(&value);
    N
}

/// Horner's scheme for few states: the values stay in registers.
fn evaluate_powers<const N: usize>(coefficients: &[f64], theta: f64, y: &mut [f64]) {
    let mut value = [0.0; N];
    for row in coefficients.chunks_exact(N).rev() {
        for i in 0..N {
            value[i] = value[i] * theta + row[i];
        }
    }
    y[..N].copy_from_slice(&value);
}

/// Evaluates the nested form from its six rows.
#[inline]
fn evaluate_nested(coefficients: &[f64], n: usize, theta: f64, y: &mut [f64]) {
    let (y0, rest) = coefficients.split_at(n);
    let (r1, rest) = rest.split_at(n);
    let (r2, rest) = rest.split_at(n);
    let (r3, rest) = rest.split_at(n);
    let (r4, r5) = rest.split_at(n);
    let (r5, y) = (&r5[..n], &mut y[..n]);
    for i in 0..n {
        y[i] = nested(&[y0[i], r1[i], r2[i], r3[i], r4[i], r5[i]], theta);
    }
}

/// The nested form of one component.
#[inline]
fn nested(r: &[f64; 6], theta: f64) -> f64 {
    let u = 1.0 - theta;
    r[0] + theta * (r[1] + u * (r[2] + theta * (r[3] + u * (r[4] + theta * r[5]))))
}

#[cfg(test)]
mod tests {
    use super::{evaluate, Basis};

    #[test]
    fn columns_are_evaluated_one_like_another() {
        for n in 1..=27 {
            let coefficients: Vec<f64> = (0..6 * n)
                .map(|k| f64::from(k as u32 * 37 % 11) - 5.0)
                .collect();
            let (mut all, mut one) = (vec![f64::NAN; n], [f64::NAN]);
            evaluate(Basis::Powers, &coefficients, n, 0.7, &mut all);
            for (i, value) in all.iter().enumerate() {
                let column: Vec<f64> = coefficients[i..].iter().step_by(n).copied().collect();
                evaluate(Basis::Powers, &column, 1, 0.7, &mut one);
                assert_eq!(*value, one[0]);
            }
        }
    }
}
