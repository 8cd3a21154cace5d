//! What an instant makes of a change of the extended state.

use smallvec::{smallvec, SmallVec};

use crate::cube::{Elimination, Matrix, Vector};
use crate::vectors::dot;

/// A gradient, or a change of the extended state.
pub(super) type Row = SmallVec<[f64; 8]>;

/// Some of them, mostly one.
pub(super) type Rows = SmallVec<[Row; 1]>;

/// A linear map of changes c = (x, p) of the extended state, which leaves p as it is: x goes to R c + sum_i d_i s_i, where the shares s
/// are the products g_i . c, or what solves equations with them on the right.
#[derive(Clone, Default)]
pub(super) struct Change {
    /// The rows of R, one for each state; x itself where there are none.
    map: Option<Vec<Vec<f64>>>,
    /// The directions d_i, of the states.
    directions: Rows,
    /// The rows g_i.
    rows: Rows,
    equations: Equations,
}

/// The equations of a projection, which is done twice: what is left after the first time is rounding.
#[derive(Clone, Default)]
enum Equations {
    #[default]
    None,
    One(f64),
    Several(Elimination),
}

impl Change {
    /// Of an instant that moves in time by `row` . c: each unit of time changes the state by `direction` behind the map.
    pub fn at_moving_time(map: Option<Vec<Vec<f64>>>, direction: Row, row: Row) -> Change {
        Change {
            map,
            directions: smallvec![direction],
            rows: smallvec![row],
            equations: Equations::None,
        }
    }

    /// Takes from a change its part along some directions of the states, so that it is normal to these gradients.
    pub fn normal_to(normals: Rows, directions: Rows) -> Change {
        let product = |i: usize, k: usize| -dot(&normals[i], &directions[k]);
        let equations = match normals.len() {
            1 => Equations::One(product(0, 0)),
            count => Equations::Several(Elimination::of(Matrix::of(count, product))),
        };
        Change {
            map: None,
            directions,
            rows: normals,
            equations,
        }
    }

    /// What becomes of a change of n states with the shares of the parameters behind them.
    pub fn apply(&self, n: usize, column: &mut [f64]) {
        for _ in 0..self.times() {
            self.apply_once(n, column);
        }
    }

    fn times(&self) -> usize {
        match self.equations {
            Equations::None => 1,
            Equations::One(_) | Equations::Several(_) => 2,
        }
    }

    fn apply_once(&self, n: usize, column: &mut [f64]) {
        // Mostly there is one direction, and no map.
        if let (None, [row], [direction]) = (&self.map, &self.rows[..], &self.directions[..]) {
            let share = match self.equations {
                Equations::One(product) => dot(row, column) / product,
                _ => dot(row, column),
            };
            let entries = column.iter_mut().zip(direction);
            entries.for_each(|(entry, d)| *entry += share * d);
            return;
        }
        let mut shares: Vector = self.rows.iter().map(|row| dot(row, column)).collect();
        match &self.equations {
            Equations::None => {}
            Equations::One(product) => shares[0] /= product,
            Equations::Several(equations) => shares = equations.solve(&shares),
        }
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
        let products = |d: &Row| dot(d, &gradient[..n]);
        let mut shares: Vector = self.directions.iter().map(products).collect();
        match &self.equations {
            Equations::None => {}
            Equations::One(product) => shares[0] /= product,
            Equations::Several(equations) => shares = equations.solve_transposed(&shares),
        }
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

/// What changes, one after the other, make of a change of n states and m parameters: n rows of the shares of the states, and n of those
/// of the parameters.
pub(super) fn matrices(changes: &[Change], (n, m): (usize, usize)) -> (Vec<f64>, Vec<f64>) {
    let (mut by_states, mut by_parameters) = (vec![0.0; n * n], vec![0.0; n * m]);
    let mut unit = Row::from_elem(0.0, n + m);
    for i in 0..n + m {
        unit.fill(0.0);
        unit[i] = 1.0;
        changes.iter().for_each(|one| one.apply(n, &mut unit));
        for (r, entry) in unit.iter().enumerate().take(n) {
            match i.checked_sub(n) {
                None => by_states[r * n + i] = *entry,
                Some(p) => by_parameters[r * m + p] = *entry,
            }
        }
    }
    (by_states, by_parameters)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn same_products(change: &Change) {
        let (mut column, mut gradient) = (vec![0.2, -1.1, 0.6], vec![1.5, 0.4, 0.9]);
        let (before, behind) = (column.clone(), gradient.clone());
        change.apply(2, &mut column);
        change.pull_back(2, &mut gradient);
        assert!((dot(&behind, &column) - dot(&gradient, &before)).abs() < 1e-15);
    }

    #[test]
    fn what_is_pulled_back_has_the_same_product_with_every_change() {
        let map = vec![vec![1.0, 2.0, 0.5], vec![-1.0, 3.0, 0.0]];
        same_products(&Change::at_moving_time(
            Some(map),
            smallvec![0.3, -0.7],
            smallvec![2.0, 0.1, -0.4],
        ));
        same_products(&Change::normal_to(
            smallvec![smallvec![1.0, 2.0, 0.3]],
            smallvec![smallvec![0.5, -0.1]],
        ));
    }
}
