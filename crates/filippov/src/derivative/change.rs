//! What an instant makes of a change of the extended state.

use super::piece::dot;
use crate::cube::{Elimination, Matrix, Vector};

/// A linear map of changes (x, p) of the extended state, which leaves p as it is: x goes to R (x, p) + sum_i d_i (g_i . (x, p)).
#[derive(Clone, Debug, Default)]
pub(super) struct Change {
    /// The rows of R, one for each state; x itself where there are none.
    pub map: Option<Vec<Vec<f64>>>,
    /// The directions d_i, of the states.
    pub directions: Vec<Vec<f64>>,
    /// The rows g_i.
    pub rows: Vec<Vec<f64>>,
    /// Is it a projection, to be done twice? What is left after the first time is rounding.
    pub is_projection: bool,
}

impl Change {
    /// Takes from a change its part along some directions of the states, so that it is normal to these gradients.
    pub fn normal_to(normals: &[Vec<f64>], directions: &[&[f64]]) -> Change {
        let products = Matrix::of(normals.len(), |i, k| dot(&normals[i], directions[k]));
        let factors = Elimination::of(products);
        let width = normals.first().map_or(0, Vec::len);
        let mut rows = vec![vec![0.0; width]; normals.len()];
        for c in 0..width {
            let column: Vector = normals.iter().map(|normal| normal[c]).collect();
            let shares = factors.solve(&column);
            rows.iter_mut().zip(shares).for_each(|(row, v)| row[c] = -v);
        }
        Change {
            map: None,
            directions: directions.iter().map(|d| d.to_vec()).collect(),
            rows,
            is_projection: true,
        }
    }

    /// What becomes of a change of n states with the shares of the parameters behind them.
    pub fn apply(&self, n: usize, column: &mut [f64]) {
        for _ in 0..self.times() {
            self.apply_once(n, column);
        }
    }

    fn times(&self) -> usize {
        if self.is_projection {
            2
        } else {
            1
        }
    }

    fn apply_once(&self, n: usize, column: &mut [f64]) {
        let shares: Vector = self.rows.iter().map(|row| dot(row, column)).collect();
        if let Some(map) = &self.map {
            let image: Vec<f64> = map.iter().map(|row| dot(row, column)).collect();
            column[..n].copy_from_slice(&image);
        }
        for (share, direction) in shares.iter().zip(&self.directions) {
            let entries = column.iter_mut().zip(direction);
            entries.for_each(|(entry, d)| *entry += share * d);
        }
    }

    /// The transposed map, of the gradient of a function of the state behind the instant.
    pub fn pull_back(&self, n: usize, gradient: &mut [f64]) {
        for _ in 0..self.times() {
            self.pull_back_once(n, gradient);
        }
    }

    fn pull_back_once(&self, n: usize, gradient: &mut [f64]) {
        let products = |d: &Vec<f64>| dot(d, &gradient[..n]);
        let shares: Vector = self.directions.iter().map(products).collect();
        if let Some(map) = &self.map {
            let behind = gradient[..n].to_vec();
            gradient[..n].fill(0.0);
            for (row, share) in map.iter().zip(&behind) {
                let entries = gradient.iter_mut().zip(row);
                entries.for_each(|(entry, value)| *entry += share * value);
            }
        }
        for (row, share) in self.rows.iter().zip(&shares) {
            let entries = gradient.iter_mut().zip(row);
            entries.for_each(|(entry, value)| *entry += share * value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_pulled_back_has_the_same_product_with_every_change() {
        let change = Change {
            map: Some(vec![vec![1.0, 2.0, 0.5], vec![-1.0, 3.0, 0.0]]),
            directions: vec![vec![0.3, -0.7]],
            rows: vec![vec![2.0, 0.1, -0.4]],
            is_projection: false,
        };
        let (mut column, mut gradient) = (vec![0.2, -1.1, 0.6], vec![1.5, 0.4, 0.9]);
        let (before, behind) = (column.clone(), gradient.clone());
        change.apply(2, &mut column);
        change.pull_back(2, &mut gradient);
        assert!((dot(&behind, &column) - dot(&gradient, &before)).abs() < 1e-15);
    }
}
