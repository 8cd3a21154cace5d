//! Roots of the sliding equations g(lambda) = 0: all of them in the cube, one by Newton's method.

use super::codim2::Bilinear;
use super::normal_fields::NormalFields;
use super::small_matrix::Matrix;
use super::stability::is_scaling_stable;
use crate::tolerances::{
    FAR_FROM_THE_CUBE, INJECTIVE, MOST_BOXES, NARROWEST_BOX, NEWTON_DONE, NEWTON_STEPS, SAME_ROOT,
};

/// The roots found in the cube.
#[derive(Clone, Debug, PartialEq)]
pub struct Roots {
    /// The roots, each once.
    pub points: Vec<Vec<f64>>,
    /// Are these certainly all? Not if a multiple root, or one at the border of many boxes, used up
    /// the work.
    pub complete: bool,
}

/// All roots of g = 0 in (-1, 1)^m by branch and prune.
///
/// A function that is linear in each multiplier takes its extrema over a box at the vertices, and
/// so do the entries of G. So a box is discarded rigorously if some g_i has one sign at all of
/// them, and holds one root at most if |I - G(middle)^-1 G| < 1 there.
pub fn roots_in_cube(fields: &NormalFields) -> Roots {
    let m = fields.m();
    let mut roots = Roots {
        points: Vec::new(),
        complete: true,
    };
    let mut pending = vec![SearchBox {
        low: vec![-1.0; m],
        high: vec![1.0; m],
        fields: fields.clone(),
    }];
    for _ in 0..MOST_BOXES {
        let Some(region) = pending.pop() else {
            return roots;
        };
        match region.look(fields) {
            Look::Empty => {}
            Look::Root(root) => roots.add(root),
            Look::Unclear if region.width() < NARROWEST_BOX => roots.complete = false,
            Look::Unclear => pending.extend(region.halves()),
        }
    }
    roots.complete = false;
    roots
}

/// The roots at which a motion can slide: in the cube, with sign det G = (-1)^m, and stable for
/// some scaling. For one and two surfaces in closed form.
pub fn stable_roots(fields: &NormalFields) -> Vec<Vec<f64>> {
    match fields.m() {
        0 => vec![Vec::new()],
        1 => {
            let (minus, plus) = (fields.at(0)[0], fields.at(1)[0]);
            let slides = minus > 0.0 && plus < 0.0;
            let root = slides.then(|| vec![(minus + plus) / (minus - plus)]);
            root.into_iter().collect()
        }
        2 => {
            let root = Bilinear::of_fields(fields).sliding_root();
            root.map(|root| root.point.to_vec()).into_iter().collect()
        }
        _ => {
            let stable = |root: &Vec<f64>| is_scaling_stable(&fields.jacobian(root));
            roots_in_cube(fields)
                .points
                .into_iter()
                .filter(stable)
                .collect()
        }
    }
}

/// Newton's method from `start`, with full steps: for tracking a root from the last one.
/// `None` if it does not converge.
pub fn newton(fields: &NormalFields, start: &[f64]) -> Option<Vec<f64>> {
    let mut lambda = start.to_vec();
    for _ in 0..NEWTON_STEPS {
        let step = fields
            .jacobian(&lambda)
            .solve(&fields.interpolate(&lambda))?;
        let length = step.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        for (value, d) in lambda.iter_mut().zip(&step) {
            *value -= d;
        }
        if length <= NEWTON_DONE {
            return Some(lambda);
        }
        if lambda.iter().any(|v| v.abs() > FAR_FROM_THE_CUBE) {
            return None;
        }
    }
    None
}

/// The rate at which the root moves, lambda' = -G^-1 g', where `drift` is the rate g' at fixed
/// lambda: the predictor of a tracked root. `None` at a multiple root.
pub fn multiplier_rates(fields: &NormalFields, lambda: &[f64], drift: &[f64]) -> Option<Vec<f64>> {
    let rates = fields.jacobian(lambda).solve(drift)?;
    Some(rates.into_iter().map(|rate| -rate).collect())
}

impl Roots {
    fn add(&mut self, root: Vec<f64>) {
        let same = |other: &Vec<f64>| largest_distance(other, &root) <= SAME_ROOT;
        if root.iter().all(|v| v.abs() < 1.0) && !self.points.iter().any(same) {
            self.points.push(root);
        }
    }
}

/// A box within the cube, with the values of g at its vertices in place of the fields.
struct SearchBox {
    low: Vec<f64>,
    high: Vec<f64>,
    fields: NormalFields,
}

enum Look {
    Empty,
    Root(Vec<f64>),
    Unclear,
}

impl SearchBox {
    fn width(&self) -> f64 {
        largest_distance(&self.low, &self.high)
    }

    fn look(&self, whole: &NormalFields) -> Look {
        if self.some_component_has_one_sign() {
            return Look::Empty;
        }
        let middle = vec![0.0; self.low.len()];
        // In the coordinates of the box, which runs from -1 to 1.
        let Some(inverse) = self.fields.jacobian(&middle).inverse() else {
            return Look::Unclear;
        };
        let spread = self.largest_row_deviation(&inverse);
        if spread >= INJECTIVE {
            return Look::Unclear;
        }
        // The only root of the box, if there is one, is within |step|/(1 - spread) of the middle.
        let step = newton_step(&inverse, &self.fields.interpolate(&middle));
        let reach = step.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        if reach * (1.0 - SAME_ROOT) > 1.0 + spread {
            return Look::Empty;
        }
        let guess: Vec<f64> = (0..step.len())
            .map(|i| {
                let (low, high) = (self.low[i], self.high[i]);
                0.5 * (low + high) - 0.5 * (high - low) * step[i]
            })
            .collect();
        match newton(whole, &guess) {
            Some(root) if self.contains(&root) => Look::Root(root),
            _ => Look::Unclear,
        }
    }

    fn contains(&self, point: &[f64]) -> bool {
        let borders = self.low.iter().zip(&self.high);
        point
            .iter()
            .zip(borders)
            .all(|(v, (low, high))| *v >= low - SAME_ROOT && *v <= high + SAME_ROOT)
    }

    fn some_component_has_one_sign(&self) -> bool {
        (0..self.fields.m()).any(|j| {
            let values = || (0..self.fields.n_patterns()).map(|p| self.fields.at(p)[j]);
            values().all(|v| v > 0.0) || values().all(|v| v < 0.0)
        })
    }

    /// The largest row sum of |I - inverse G| over the box, entry by entry at the vertices.
    fn largest_row_deviation(&self, inverse: &Matrix) -> f64 {
        let m = self.fields.m();
        let mut deviation = Matrix::zeros(m);
        for pattern in 0..self.fields.n_patterns() {
            let sign = |i: usize| if pattern >> i & 1 == 1 { 1.0 } else { -1.0 };
            let vertex: Vec<f64> = (0..m).map(sign).collect();
            let product = inverse.times(&self.fields.jacobian(&vertex));
            for i in 0..m {
                for j in 0..m {
                    let unit = if i == j { 1.0 } else { 0.0 };
                    let here = (unit - product[(i, j)]).abs();
                    deviation[(i, j)] = deviation[(i, j)].max(here);
                }
            }
        }
        let row_sum = |i: usize| (0..m).map(|j| deviation[(i, j)]).sum();
        (0..m).map(row_sum).fold(0.0, f64::max)
    }

    /// Both halves across the longest edge.
    fn halves(self) -> [SearchBox; 2] {
        let lengths = || (0..self.low.len()).map(|i| self.high[i] - self.low[i]);
        let longest = lengths().fold(0.0, f64::max);
        let axis = lengths().position(|l| l == longest).unwrap_or(0);
        let middle = 0.5 * (self.low[axis] + self.high[axis]);
        let mut lower_end = self.high.clone();
        lower_end[axis] = middle;
        let mut upper_start = self.low.clone();
        upper_start[axis] = middle;
        [
            SearchBox {
                fields: self.fields.half(axis, -1),
                low: self.low,
                high: lower_end,
            },
            SearchBox {
                fields: self.fields.half(axis, 1),
                low: upper_start,
                high: self.high,
            },
        ]
    }
}

fn newton_step(inverse: &Matrix, g: &[f64]) -> Vec<f64> {
    let row = |i: usize| (0..g.len()).map(|j| inverse[(i, j)] * g[j]).sum();
    (0..g.len()).map(row).collect()
}

fn largest_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |m, (x, y)| m.max((x - y).abs()))
}
