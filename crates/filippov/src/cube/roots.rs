//! Roots of the sliding equations g(lambda) = 0: all of them in the cube, one by Newton's method.

use super::bilinear::Bilinear;
use super::normal_fields::{NormalFields, SignGroup};
use super::small_matrix::{Matrix, Vector};
use super::stability::is_scaling_stable;
use crate::patience::Patience;
use crate::tolerances::{
    AT_SIDE, DOUBTFUL, FAR_FROM_THE_CUBE, INJECTIVE, MOST_MEETING, MOST_WORK, NEWTON_STEPS,
    SAME_NUMBER, SAME_ROOT,
};

/// The roots found in the cube.
#[derive(Clone, Debug, PartialEq)]
pub struct Roots {
    /// The roots, each once.
    pub points: Vec<Vec<f64>>,
    /// Are these certainly all? Not if a multiple root, or one at the border of many boxes, used up
    /// the work, or if the caller did not wait.
    pub complete: bool,
}

/// All roots of g = 0 in (-1, 1)^m by branch and prune.
///
/// A function that is linear in each multiplier takes its extrema over a box at the vertices, and
/// so do the entries of G. So a box is discarded rigorously if some g_i has one sign at all of
/// them, and holds one root at most if |I - G(middle)^-1 G| < 1 there.
///
/// Multipliers on which g depends linearly, free of all others, are eliminated first: the search is
/// exponential in the number of surfaces whose signs multiply, and in no others.
pub fn roots_in_cube(fields: &NormalFields) -> Roots {
    roots_within(fields, Patience::endless())
}

/// As [`roots_in_cube`]; those found until then when the caller has waited long enough.
fn roots_within(fields: &NormalFields, patience: Patience) -> Roots {
    let Some(eliminated) = Eliminated::of(fields) else {
        return search(fields, patience);
    };
    let inner = search(&eliminated.rest, patience);
    let mut roots = Roots {
        points: Vec::new(),
        complete: inner.complete,
    };
    for point in inner.points {
        // One step is exact for the multipliers that were eliminated.
        let mut start = vec![0.0; fields.m()];
        let kept = eliminated.left.iter().zip(point);
        kept.for_each(|(&i, value)| start[i] = value);
        newton(fields, &start)
            .into_iter()
            .for_each(|root| roots.add(root));
    }
    roots
}

fn search(fields: &NormalFields, patience: Patience) -> Roots {
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
    let few = MOST_MEETING.pow(3);
    for _ in 0..MOST_WORK * few / m.pow(3).max(few) {
        if patience.is_over() {
            break;
        }
        let Some(region) = pending.pop() else {
            return roots;
        };
        match region.look(fields) {
            Look::Empty => {}
            Look::Root(root) => roots.add(root),
            Look::Unclear if region.width() < AT_SIDE => roots.complete = false,
            Look::Unclear => pending.extend(region.halves()),
        }
    }
    roots.complete &= pending.is_empty();
    roots
}

/// The roots at which a motion can slide: in the cube, with sign det G = (-1)^m, and stable for
/// some scaling. For one and two surfaces in closed form.
pub fn stable_roots(fields: &NormalFields) -> Vec<Vec<f64>> {
    stable_roots_within(fields, Patience::endless())
}

/// As [`stable_roots`]; those found until then when the caller has waited long enough.
pub fn stable_roots_within(fields: &NormalFields, patience: Patience) -> Vec<Vec<f64>> {
    match fields.m() {
        0 => vec![Vec::new()],
        1 => {
            let (minus, plus) = (fields.at(0)[0], fields.at(1)[0]);
            let slides = minus > 0.0 && plus < 0.0;
            let root = slides.then(|| vec![zero_between(minus, plus)]);
            root.into_iter().collect()
        }
        2 => {
            let root = Bilinear::of_fields(fields).sliding_root();
            root.map(|root| root.point.to_vec()).into_iter().collect()
        }
        _ => {
            let stable = |root: &Vec<f64>| is_scaling_stable(&fields.jacobian(root));
            roots_within(fields, patience)
                .points
                .into_iter()
                .filter(stable)
                .collect()
        }
    }
}

/// The same in the cube with its border, and a little beyond it by rounding: multipliers at their ends are -1 or +1.
pub fn stable_roots_with_border(fields: &NormalFields, patience: Patience) -> Vec<Vec<f64>> {
    let factor = 1.0 + AT_SIDE;
    let mut enlarged = fields.clone();
    for axis in 0..fields.m() {
        enlarged = enlarged.on_range(axis, [-factor, factor]);
    }
    let mut roots = stable_roots_within(&enlarged, patience);
    for value in roots.iter_mut().flatten() {
        *value = (factor * *value).clamp(-1.0, 1.0);
    }
    roots
}

/// Do the equations leave a line of multipliers within the cube, and not single roots? Looked at for two surfaces.
pub fn is_undetermined(fields: &NormalFields) -> bool {
    let crosses_zero = |j: usize| {
        let ([low, high], noise) = (fields.row_range(j), DOUBTFUL * fields.row_size(j));
        low < -noise && high > noise
    };
    fields.m() == 2 && Bilinear::of_fields(fields).is_undetermined() && (0..2).all(crosses_zero)
}

/// The multiplier at which the component between these ends vanishes.
pub fn zero_between(minus: f64, plus: f64) -> f64 {
    (minus + plus) / (minus - plus)
}

/// Newton's method from `start`, with full steps: for tracking a root from the last one.
/// `None` if it does not converge. Of one surface the first step is exact.
pub fn newton(fields: &NormalFields, start: &[f64]) -> Option<Vec<f64>> {
    if fields.m() == 1 {
        let root = zero_between(fields.at(0)[0], fields.at(1)[0]);
        return (root.abs() <= FAR_FROM_THE_CUBE).then(|| vec![root]);
    }
    iterate(start, |lambda| {
        fields.jacobian(lambda).solve(&fields.interpolate(lambda))
    })
}

/// The multipliers of least norm that make the fields tangent to the surfaces `rows`; `None` if there are none
/// in the cube.
///
/// On an intersection like x = x' = 0 of x'' = -a sign(x) - b sign(x') all fields are tangent to the surface x = 0,
/// whatever the multipliers; the other equation determines a line of them, and the motion does not depend on
/// which is taken. Gauss-Newton steps from 0, lambda <- lambda - G^T (G G^T)^-1 g.
///
/// Reference: A. Levant, Sliding order and sliding accuracy in sliding mode control, *Int. J. Control* 58 (1993).
pub fn least_multipliers(fields: &NormalFields, rows: &[usize]) -> Option<Vec<f64>> {
    let m = fields.m();
    let root = iterate(&vec![0.0; m], |lambda| {
        let (g, jacobian) = (fields.interpolate(lambda), fields.jacobian(lambda));
        let product =
            |i: usize, j: usize| (0..m).map(|k| jacobian[(i, k)] * jacobian[(j, k)]).sum();
        let gram = Matrix::of(rows.len(), |a, b| product(rows[a], rows[b]));
        let residual: Vector = rows.iter().map(|&i| g[i]).collect();
        let shares = gram.solve(&residual)?;
        let terms = |k: usize| rows.iter().zip(&shares).map(move |(&i, s)| (i, k, s));
        let step = |k: usize| terms(k).map(|(i, k, s)| jacobian[(i, k)] * s).sum();
        Some((0..m).map(step).collect())
    })?;
    root.iter().all(|l| l.abs() < 1.0).then_some(root)
}

/// Takes the steps off `start` until they are below rounding; `None` if they do not become so.
fn iterate(start: &[f64], step: impl Fn(&[f64]) -> Option<Vector>) -> Option<Vec<f64>> {
    let mut lambda = start.to_vec();
    for _ in 0..NEWTON_STEPS {
        let step = step(&lambda)?;
        lambda
            .iter_mut()
            .zip(&step)
            .for_each(|(value, d)| *value -= d);
        if step.iter().all(|d| d.abs() <= SAME_NUMBER) {
            return Some(lambda);
        }
        if !lambda.iter().all(|v| v.abs() <= FAR_FROM_THE_CUBE) {
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
        let step = inverse.apply(&self.fields.interpolate(&middle));
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
            let [low, high] = self.fields.row_range(j);
            low > 0.0 || high < 0.0
        })
    }

    /// The largest row sum of |I - inverse G| over the box, entry by entry at the vertices.
    fn largest_row_deviation(&self, inverse: &Matrix) -> f64 {
        let m = self.fields.m();
        let mut deviation = Matrix::zeros(m);
        for p in 0..m {
            for column in self.fields.columns(p) {
                for (i, product) in inverse.apply(&column).into_iter().enumerate() {
                    let unit = if i == p { 1.0 } else { 0.0 };
                    deviation[(i, p)] = deviation[(i, p)].max((unit - product).abs());
                }
            }
        }
        let row_sum = |i: usize| (0..m).map(|j| deviation[(i, j)]).sum();
        (0..m).map(row_sum).fold(0.0, f64::max)
    }

    /// Both halves across the longest edge.
    fn halves(&self) -> [SearchBox; 2] {
        let lengths = || (0..self.low.len()).map(|i| self.high[i] - self.low[i]);
        let longest = lengths().fold(0.0, f64::max);
        let axis = lengths().position(|l| l == longest).unwrap_or(0);
        let middle = 0.5 * (self.low[axis] + self.high[axis]);
        let part = |half: [f64; 2], low: f64, high: f64| {
            let mut part = SearchBox {
                low: self.low.clone(),
                high: self.high.clone(),
                fields: self.fields.on_range(axis, half),
            };
            (part.low[axis], part.high[axis]) = (low, high);
            part
        };
        [
            part([-1.0, 0.0], self.low[axis], middle),
            part([0.0, 1.0], middle, self.high[axis]),
        ]
    }
}

/// The equations without the multipliers a of groups of one: with g = c + N lambda_a + phi(the others) and rows a and
/// r, lambda_a = -N_aa^-1 (c + phi)_a leaves (c + phi)_r - N_ra N_aa^-1 (c + phi)_a = 0.
struct Eliminated {
    /// The surfaces of the multipliers that are left.
    left: Vec<usize>,
    rest: NormalFields,
}

impl Eliminated {
    /// `None` if there are no such groups, or nothing else, or N_aa is singular.
    fn of(whole: &NormalFields) -> Option<Self> {
        let m = whole.m();
        let is_alone = |i: usize| {
            let mut groups = whole.groups().iter();
            groups.any(|group| group.members[..] == [i])
        };
        let (alone, left): (Vec<usize>, Vec<usize>) = (0..m).partition(|&i| is_alone(i));
        if alone.is_empty() || left.is_empty() {
            return None;
        }
        let jacobian = whole.jacobian(&vec![0.0; m]);
        let inverse = jacobian.principal(&alone).inverse()?;
        let reduce = |values: &[f64]| -> Vec<f64> {
            let shares = inverse.apply(&alone.iter().map(|&a| values[a]).collect::<Vector>());
            let taken = |r: usize| -> f64 {
                let terms = alone.iter().zip(&shares);
                terms.map(|(&a, share)| jacobian[(r, a)] * share).sum()
            };
            left.iter().map(|&r| values[r] - taken(r)).collect()
        };
        // What the groups of one contribute at their multipliers 0.
        let mut constant = vec![0.0; left.len()];
        let mut groups = Vec::new();
        for group in whole.groups() {
            if let [_] = group.members[..] {
                let pairs = group.at(0, m).iter().zip(group.at(1, m));
                let middle: Vec<f64> = pairs.map(|(a, b)| 0.5 * (a + b)).collect();
                let shares = constant.iter_mut().zip(reduce(&middle));
                shares.for_each(|(c, v)| *c += v);
                continue;
            }
            let place = |i: &usize| left.binary_search(i).ok();
            groups.push(SignGroup {
                members: group.members.iter().filter_map(place).collect(),
                values: group.values.chunks_exact(m).flat_map(reduce).collect(),
            });
        }
        let rest = NormalFields::of_groups(left.len(), groups).ok()?;
        let rest = rest.shifted(&constant);
        Some(Eliminated { left, rest })
    }
}

fn largest_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |m, (x, y)| m.max((x - y).abs()))
}
