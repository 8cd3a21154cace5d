//! Equations of multipliers some of which follow from the others: bodies in contact that rub on one ground share what holds them.
//!
//! Two bodies that are pressed together rest on rough ground: of three equations, that neither moves and that they stay together, one
//! follows from the others, and the force between them is not determined. The motion is. All solutions z + sum over k of
//! a_k d_k give it, and it lasts as long as one of them is admissible: until the least of the reserves (a force, the distance of a sign
//! from its ends), which is taken of the solution for which it is largest, is zero.

use super::small_matrix::Matrix;
use crate::tolerances::{DEFINITE_PIVOT, MOST_MEETING, SAME_NUMBER};
use crate::vectors::dot;

/// All solutions of linear equations of which some follow from the others.
#[derive(Clone, Debug)]
pub struct Solutions {
    one: Vec<f64>,
    /// Each may be added with any factor.
    pub directions: Vec<Vec<f64>>,
}

/// That a multiplier is admissible: `factor` times it plus `constant` is not negative; a reserve, in units in which 1 is large.
#[derive(Clone, Copy, Debug)]
pub struct Limit {
    /// Its place.
    pub multiplier: usize,
    /// Of the multiplier.
    pub factor: f64,
    /// The reserve of a multiplier that is zero.
    pub constant: f64,
}

impl Solutions {
    /// Those of A z = b; `None` if there are none.
    pub fn of(matrix: &Matrix, b: &[f64]) -> Option<Self> {
        let n = matrix.n();
        let (mut left, mut right) = (matrix.clone(), b.to_vec());
        // The sizes of the rows, and of the columns beside them.
        let (mut rows, mut columns) = (vec![0.0_f64; n], vec![0.0_f64; n]);
        for i in 0..n {
            (0..n).for_each(|j| rows[i] = rows[i].max(left[(i, j)].abs()));
            (0..n).for_each(|j| columns[j] = columns[j].max(left[(i, j)].abs() / rows[i]));
        }
        // Gauss and Jordan: a pivot is the largest entry in the rows and columns without one.
        let (mut row_of, mut is_used) = (vec![None; n], vec![false; n]);
        loop {
            let (mut share, mut row, mut column) = (DEFINITE_PIVOT, 0, n);
            for i in (0..n).filter(|&i| !is_used[i]) {
                for j in (0..n).filter(|&j| row_of[j].is_none()) {
                    let own = left[(i, j)].abs() / (rows[i] * columns[j]);
                    if own > share {
                        (share, row, column) = (own, i, j);
                    }
                }
            }
            if column == n {
                break;
            }
            (row_of[column], is_used[row]) = (Some(row), true);
            let pivot = left[(row, column)];
            (0..n).for_each(|j| left[(row, j)] /= pivot);
            right[row] /= pivot;
            for i in (0..n).filter(|&i| i != row) {
                let factor = left[(i, column)];
                (0..n).for_each(|j| left[(i, j)] -= factor * left[(row, j)]);
                right[i] -= factor * right[row];
            }
        }
        let one: Vec<f64> = row_of
            .iter()
            .map(|row| row.map_or(0.0, |row| right[row]))
            .collect();
        let direction = |j: usize| {
            let mut direction = vec![0.0; n];
            direction[j] = 1.0;
            for (k, row) in row_of.iter().enumerate() {
                if let Some(row) = *row {
                    let share = left[(row, j)];
                    if share.abs() * columns[k] > DEFINITE_PIVOT * columns[j] {
                        direction[k] = -share;
                    }
                }
            }
            direction
        };
        let free = (0..n).filter(|&j| row_of[j].is_none());
        let directions = free.map(direction).collect();
        // What the terms of an equation may be, if they cancel.
        let sides = b.iter().zip(&rows).map(|(b, size)| b.abs() / size);
        let side = sides.filter(|v| v.is_finite()).fold(0.0, f64::max);
        for i in 0..n {
            let (mut sum, mut size) = (-b[i], b[i].abs() + side * rows[i]);
            for j in 0..n {
                let term = matrix[(i, j)] * one[j];
                (sum, size) = (sum + term, size + term.abs());
            }
            let is_solved = sum.abs() <= DEFINITE_PIVOT.sqrt() * size;
            if !is_solved {
                return None;
            }
        }
        Some(Solutions { one, directions })
    }

    /// The solution whose least reserve is largest, or 1; `None` if there are too many limits to tell.
    pub fn most_reserved(&self, limits: &[Limit]) -> Option<Vec<f64>> {
        // The reserve at coefficients a, each with its changes by them.
        let reserve = |limit: &Limit| {
            let changes = self.directions.iter();
            let changes: Vec<f64> = changes
                .map(|d| limit.factor * d[limit.multiplier])
                .collect();
            (
                limit.constant + limit.factor * self.one[limit.multiplier],
                changes,
            )
        };
        let unlimited = (1.0, vec![0.0; self.directions.len()]);
        let reserves: Vec<(f64, Vec<f64>)> =
            limits.iter().map(reserve).chain([unlimited]).collect();
        if reserves.len() > 2 * MOST_MEETING + 1 {
            return None;
        }
        // It is largest where as many reserves are equal as there are unknowns.
        let n = self.directions.len() + 1;
        let mut best: Option<(Vec<f64>, f64)> = None;
        for chosen in
            (0_u32..1 << reserves.len()).filter(|chosen| chosen.count_ones() as usize == n)
        {
            let equal: Vec<&(f64, Vec<f64>)> = (0..reserves.len())
                .filter(|i| chosen >> i & 1 == 1)
                .map(|i| &reserves[i])
                .collect();
            let entry = |i: usize, j: usize| equal[i].1.get(j).copied().unwrap_or(-1.0);
            let values: Vec<f64> = equal.iter().map(|reserve| -reserve.0).collect();
            let Some(mut found) = Matrix::of(n, entry).solve(&values) else {
                continue;
            };
            let Some(least) = found.pop() else {
                continue;
            };
            let noise = SAME_NUMBER * (1.0 + least.abs());
            let is_least = reserves
                .iter()
                .all(|(value, changes)| value + dot(changes, &found) >= least - noise);
            if is_least && best.as_ref().is_none_or(|(_, most)| least > *most) {
                best = Some((found.into_vec(), least));
            }
        }
        let (coefficients, _) = best?;
        let mut multipliers = self.one.clone();
        for (direction, a) in self.directions.iter().zip(&coefficients) {
            multipliers
                .iter_mut()
                .zip(direction)
                .for_each(|(z, d)| *z += a * d);
        }
        Some(multipliers)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::{Limit, Solutions};
    use crate::cube::Matrix;

    /// Two bodies of masses 1 and 2 with friction 0.5 and 0.8, pressed together: the acceleration between them, and theirs.
    fn pressed(common: f64, press: f64) -> (Matrix, [f64; 3]) {
        let (mass, friction) = ([1.0, 2.0], [0.5, 0.8]);
        // The force between them pushes the first back, and the other one forth.
        let push = [-1.0 / mass[0], 1.0 / mass[1]];
        let strength = push[1] - push[0];
        let by_sign = [-friction[0] / mass[0], -friction[1] / mass[1]];
        let rows = [
            [1.0, -by_sign[0], by_sign[1]],
            [push[0] / strength, by_sign[0], 0.0],
            [push[1] / strength, 0.0, by_sign[1]],
        ];
        let free = [
            (common / 3.0 + press) / mass[0],
            (2.0 * common / 3.0 - press) / mass[1],
        ];
        (
            Matrix::of(3, |i, j| rows[i][j]),
            [free[0] - free[1], -free[0], -free[1]],
        )
    }

    fn limits() -> Vec<Limit> {
        let ends = (1..3).flat_map(|multiplier| {
            [1.0, -1.0].map(|factor| Limit {
                multiplier,
                factor,
                constant: 1.0,
            })
        });
        ends.chain([Limit {
            multiplier: 0,
            factor: 1.0,
            constant: 0.0,
        }])
        .collect()
    }

    fn least_reserve(multipliers: &[f64]) -> f64 {
        let limits = limits().into_iter();
        let reserves =
            limits.map(|limit| limit.constant + limit.factor * multipliers[limit.multiplier]);
        reserves.fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn bodies_give_way_where_all_friction_is_used() {
        for (common, is_held) in [(1.29, true), (1.31, false), (-1.29, true), (-1.31, false)] {
            let (matrix, b) = pressed(common, 3.0);
            let solutions = Solutions::of(&matrix, &b).unwrap();
            assert_eq!(solutions.directions.len(), 1);
            let multipliers = solutions.most_reserved(&limits()).unwrap();
            assert_eq!(least_reserve(&multipliers) > 0.0, is_held, "{common}");
            // Both use the same share of their friction where the force between them does not limit it.
            assert!((multipliers[1] - multipliers[2]).abs() < 1e-12);
            assert!((1.3 * multipliers[1] - common).abs() < 1e-12);
        }
    }

    #[test]
    fn bodies_that_are_pulled_apart_give_way_where_one_does() {
        // Without any force between them each is held by its own friction.
        for (pull, is_held) in [(-0.49, true), (-0.51, false)] {
            let (matrix, b) = pressed(0.0, pull);
            let solutions = Solutions::of(&matrix, &b).unwrap();
            let multipliers = solutions.most_reserved(&limits()).unwrap();
            assert_eq!(least_reserve(&multipliers) > 0.0, is_held, "{pull}");
        }
    }

    #[test]
    fn equations_that_contradict_one_another_have_no_solution() {
        let (matrix, mut b) = pressed(0.3, 3.0);
        b[1] += 0.1;
        assert!(Solutions::of(&matrix, &b).is_none());
        let regular = Matrix::of(2, |i, j| if i == j { 2.0 } else { 1.0 });
        assert!(Solutions::of(&regular, &[3.0, 3.0])
            .unwrap()
            .directions
            .is_empty());
    }
}
