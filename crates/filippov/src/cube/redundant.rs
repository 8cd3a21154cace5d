//! Equations of multipliers some of which follow from the others: bodies in contact that rub on one ground share what holds them.
//!
//! Two bodies that are pressed together rest on rough ground: of three equations, that neither moves and that they stay together, one
//! follows from the others, and the force between them is not determined. The motion is. All solutions z + sum over k of
//! a_k d_k give it, and it lasts as long as one of them is admissible: until the least of the reserves (a force, the distance of a sign
//! from its ends), which is taken of the solution for which it is largest, is zero.

use super::small_matrix::{Matrix, Vector};
use crate::tolerances::{DEFINITE_PIVOT, MOST_MEETING, SAME_NUMBER};
use crate::vectors::dot;

/// All solutions of linear equations of which some follow from the others.
#[derive(Clone, Debug)]
pub struct Solutions {
    one: Vector,
    /// Each may be added with any factor.
    pub directions: Vec<Vector>,
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
        let largest = |values: &mut dyn Iterator<Item = f64>| {
            let size = values.fold(0.0_f64, |size, v| size.max(v.abs()));
            if size > 0.0 {
                size
            } else {
                1.0
            }
        };
        let rows: Vector = (0..n)
            .map(|i| largest(&mut (0..n).map(|j| matrix[(i, j)])))
            .collect();
        let columns: Vector = (0..n)
            .map(|j| largest(&mut (0..n).map(|i| matrix[(i, j)] / rows[i])))
            .collect();
        let mut left = Matrix::of(n, |i, j| matrix[(i, j)] / (rows[i] * columns[j]));
        let mut right: Vector = b.iter().zip(&rows).map(|(b, size)| b / size).collect();
        // Gauss and Jordan: a pivot is the largest entry in the rows and columns without one.
        let mut pivots = Vec::<(usize, usize)>::new();
        loop {
            let is_free =
                |i: usize, j: usize| pivots.iter().all(|pivot| pivot.0 != i && pivot.1 != j);
            let entries = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
            let entries = entries.filter(|&(i, j)| is_free(i, j));
            let size = |at: &(usize, usize)| left[*at].abs();
            let Some((row, column)) = entries.max_by(|a, b| size(a).total_cmp(&size(b))) else {
                break;
            };
            let pivot = left[(row, column)];
            if pivot.abs() <= DEFINITE_PIVOT {
                break;
            }
            (0..n).for_each(|j| left[(row, j)] /= pivot);
            right[row] /= pivot;
            for i in (0..n).filter(|&i| i != row) {
                let factor = left[(i, column)];
                (0..n).for_each(|j| left[(i, j)] -= factor * left[(row, j)]);
                right[i] -= factor * right[row];
            }
            pivots.push((row, column));
        }
        let mut one = Vector::from_elem(0.0, n);
        for &(row, column) in &pivots {
            one[column] = right[row] / columns[column];
        }
        let free = (0..n).filter(|&j| pivots.iter().all(|pivot| pivot.1 != j));
        let direction = |j: usize| {
            let mut direction = Vector::from_elem(0.0, n);
            direction[j] = 1.0 / columns[j];
            for &(row, column) in &pivots {
                let share = left[(row, j)];
                if share.abs() > DEFINITE_PIVOT {
                    direction[column] = -share / columns[column];
                }
            }
            direction
        };
        let directions = free.map(direction).collect();
        let is_solved = |i: usize| {
            let terms = (0..n).map(|j| matrix[(i, j)] * one[j]);
            let (sum, size) = terms.fold((-b[i], b[i].abs()), |(sum, size), term| {
                (sum + term, size + term.abs())
            });
            sum.abs() <= DEFINITE_PIVOT.sqrt() * size
        };
        (0..n)
            .all(is_solved)
            .then_some(Solutions { one, directions })
    }

    /// The solution whose least reserve is largest, or 1; `None` if there are too many limits to tell.
    pub fn most_reserved(&self, limits: &[Limit]) -> Option<Vector> {
        // The reserve at coefficients a, each with its changes by them.
        let reserve = |limit: &Limit| {
            let changes = self.directions.iter();
            let changes: Vector = changes
                .map(|d| limit.factor * d[limit.multiplier])
                .collect();
            (
                limit.constant + limit.factor * self.one[limit.multiplier],
                changes,
            )
        };
        let unlimited = (1.0, Vector::from_elem(0.0, self.directions.len()));
        let reserves: Vec<(f64, Vector)> = limits.iter().map(reserve).chain([unlimited]).collect();
        if reserves.len() > 2 * MOST_MEETING + 1 {
            return None;
        }
        // It is largest where as many reserves are equal as there are unknowns.
        let n = self.directions.len() + 1;
        let mut best: Option<(Vector, f64)> = None;
        for chosen in
            (0_u32..1 << reserves.len()).filter(|chosen| chosen.count_ones() as usize == n)
        {
            let equal: Vec<&(f64, Vector)> = (0..reserves.len())
                .filter(|i| chosen >> i & 1 == 1)
                .map(|i| &reserves[i])
                .collect();
            let entry = |i: usize, j: usize| equal[i].1.get(j).copied().unwrap_or(-1.0);
            let values: Vector = equal.iter().map(|reserve| -reserve.0).collect();
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
                best = Some((found, least));
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
