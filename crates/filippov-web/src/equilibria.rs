//! Equilibria and pseudo-equilibria in a window, by Newton's method from many starts.
//!
//! In a region f(x) = 0. On surfaces h_j = 0 the field is the mean of those around, with the weights (1 - l_j) / 2 and
//! (1 + l_j) / 2 of the two sides of each, and the multipliers l_j are further unknowns.
//! Derivatives are central differences: they decide how fast the iteration converges, not what it converges to.

use filippov::cube::{is_stable, Matrix};
use filippov::{FieldError, Setting};

use crate::sheet::{Plane, SheetKind, SheetPart};

/// An equilibrium.
pub struct Equilibrium {
    pub y: Vec<f64>,
    /// The surfaces that it is on, if it is a pseudo-equilibrium.
    pub surfaces: Vec<usize>,
    /// Is it stable? `None` if linear terms do not decide.
    pub is_stable: Option<bool>,
    /// Does the system have it: is it in its own region, or its multiplier from -1 to 1?
    pub is_admissible: bool,
}

/// Starts along each side of the window in each region, and along each sliding part.
const STARTS: usize = 7;
const STARTS_ALONG: usize = 9;
const MOST_ITERATIONS: usize = 40;
/// Ends of parts of two surfaces that are nearer than this share of the window show where these meet.
const NEAR_ENDS: f64 = 0.05;
/// So many states are kept near which the same surfaces meet, and so many for each number of surfaces.
const MOST_OF_A_SET: usize = STARTS_ALONG;
const MOST_MEETINGS: usize = 100;
/// Beside m surfaces there are 2^m fields.
const MOST_SURFACES: usize = 6;
/// Equilibria nearer than this share of the window are one.
const SAME: f64 = 1e-6;
/// The last correction, relative to the size of the unknowns.
const CONVERGED: f64 = 1e-11;
/// The share of the size of a matrix within which its eigenvalues decide nothing.
const UNDECIDED: f64 = 1e-6;
/// Differences of the cube root of the rounding unit: the best for central ones.
const STEP: f64 = 6e-6;

/// The equilibria in the window: those of the regions seen there, those on one surface each, and those where surfaces meet.
/// A point on the border of its region is not among them if the field jumps there: it is the end of sliding, or of sticking.
pub fn equilibria(
    plane: &Plane,
    parts: &[SheetPart],
    n_visible: usize,
) -> Result<Vec<Equilibrium>, FieldError> {
    let mut found: Vec<Equilibrium> = Vec::new();
    let mut add = |new: Equilibrium| {
        let window = plane.window;
        let is_same = |known: &Equilibrium| {
            let is_near = window.distance(window.point(&known.y), window.point(&new.y)) <= SAME;
            known.surfaces == new.surfaces && is_near && known.is_admissible == new.is_admissible
        };
        if !window.contains(window.point(&new.y)) {
            return;
        }
        match found.iter().position(is_same) {
            // On a kink the linear terms of all regions count.
            Some(known) if found[known].is_stable != new.is_stable => found[known].is_stable = None,
            Some(_) => {}
            None => found.push(new),
        }
    };
    let mut regions: Vec<Vec<f64>> = Vec::new();
    let mut starts: Vec<Vec<f64>> = Vec::new();
    for row in 0..STARTS {
        for column in 0..STARTS {
            let x = plane.window.state(plane.window.centre(column, row, STARTS));
            let signs = plane.signs(&x)?;
            if !regions.contains(&signs) {
                regions.push(signs);
            }
            starts.push(x);
        }
    }
    for signs in &regions {
        let balance = Balance {
            plane,
            signs,
            surfaces: &[],
        };
        for x in &starts {
            let Some((x, jacobian)) = balance.solve(x.clone())? else {
                continue;
            };
            let at = plane.surfaces_at(&x, signs, n_visible)?;
            if at.iter().any(|&j| plane.system.jumps_across(j, signs, &[])) {
                continue;
            }
            let own = plane.signs(&x)?;
            let is_admissible = (0..n_visible).all(|j| own[j] == signs[j] || at.contains(&j));
            add(Equilibrium {
                is_stable: stability(&jacobian),
                is_admissible,
                surfaces: Vec::new(),
                y: x,
            });
        }
    }
    for part in parts {
        let slides = matches!(part.kind, SheetKind::Attracting | SheetKind::Repelling);
        let stride = part.points.len().div_ceil(STARTS_ALONG);
        for start in part.points.iter().step_by(stride).filter(|_| slides) {
            let x = plane.window.state(start.point);
            // The multiplier at which the motion slides.
            let multiplier = (start.minus + start.plus) / (start.minus - start.plus);
            let found = pseudo_equilibrium(plane, &[part.surface], x, &[multiplier], n_visible)?;
            found.into_iter().for_each(&mut add);
        }
    }
    let mut met = pairs(plane, parts, n_visible)?;
    for _ in 2..=plane.system.n_states().min(n_visible).min(MOST_SURFACES) {
        let more = with_one_more(plane, &met, n_visible)?;
        for (surfaces, x) in met {
            let multipliers = vec![0.0; surfaces.len()];
            let found = pseudo_equilibrium(plane, &surfaces, x, &multipliers, n_visible)?;
            found.into_iter().for_each(&mut add);
        }
        met = more;
    }
    Ok(found)
}

/// The pseudo-equilibrium on these surfaces that Newton's method reaches from a state and multipliers.
fn pseudo_equilibrium(
    plane: &Plane,
    surfaces: &[usize],
    mut unknowns: Vec<f64>,
    multipliers: &[f64],
    n_visible: usize,
) -> Result<Option<Equilibrium>, FieldError> {
    let n = unknowns.len();
    let signs = plane.signs(&unknowns)?;
    let balance = Balance {
        plane,
        signs: &signs,
        surfaces,
    };
    unknowns.extend(multipliers);
    let Some((mut x, jacobian)) = balance.solve(unknowns)? else {
        return Ok(None);
    };
    let multipliers = x.split_off(n);
    let own = plane.signs(&x)?;
    let others = (0..n_visible).filter(|j| !surfaces.contains(j));
    let is_inside = multipliers.iter().all(|multiplier| multiplier.abs() <= 1.0);
    Ok(Some(Equilibrium {
        is_stable: sliding_stability(n, &jacobian),
        is_admissible: is_inside && others.into_iter().all(|j| own[j] == signs[j]),
        surfaces: surfaces.to_vec(),
        y: x,
    }))
}

/// Surfaces, and a state near which they meet.
type Meeting = (Vec<usize>, Vec<f64>);

/// Where two surfaces meet in the window, as far as the ends of their pieces show it; in more than two states also starts along
/// each surface, for the other states are not those of the window there.
fn pairs(plane: &Plane, parts: &[SheetPart], n_visible: usize) -> Result<Vec<Meeting>, FieldError> {
    let mut found = Vec::new();
    for part in parts {
        let stride = part.points.len().div_ceil(STARTS_ALONG);
        let mut before: Option<Vec<f64>> = None;
        for (index, point) in part.points.iter().enumerate() {
            let x = plane.window.state(point.point);
            let signs = plane.signs(&x)?;
            let is_start = x.len() > 2 && index % stride == 0;
            let is_unseen = |j: usize| parts.iter().all(|part| part.surface != j);
            let others =
                (0..n_visible).filter(|&j| j > part.surface || j < part.surface && is_unseen(j));
            for other in others {
                let crosses = before
                    .as_ref()
                    .is_some_and(|before| before[other] != signs[other]);
                if crosses || is_start {
                    let pair = vec![part.surface.min(other), part.surface.max(other)];
                    found.push((pair, x.clone()));
                }
            }
            before = Some(signs);
        }
    }
    // Parts of one surface end where the fields beside it change, as they do at another surface.
    for (k, part) in parts.iter().enumerate() {
        for other in parts[k + 1..]
            .iter()
            .filter(|other| other.surface != part.surface)
        {
            let pair = vec![
                part.surface.min(other.surface),
                part.surface.max(other.surface),
            ];
            let ends =
                |part: &SheetPart| [part.points.first().copied(), part.points.last().copied()];
            for a in ends(part).into_iter().flatten() {
                for b in ends(other).into_iter().flatten() {
                    if plane.window.distance(a.point, b.point) <= NEAR_ENDS {
                        found.push((pair.clone(), plane.window.state(a.point)));
                    }
                }
            }
        }
    }
    Ok(found)
}

/// Where one surface more passes than those that are known to meet, seen through the window.
fn with_one_more(
    plane: &Plane,
    known: &[Meeting],
    n_visible: usize,
) -> Result<Vec<Meeting>, FieldError> {
    let mut found: Vec<Meeting> = Vec::new();
    let is_near = |a: &[f64], b: &[f64]| {
        let mut pairs = a.iter().zip(b);
        pairs.all(|(a, b)| (a - b).abs() <= SAME * (1.0 + a.abs()))
    };
    for (surfaces, x) in known {
        if surfaces.len() == plane.system.n_states() {
            continue;
        }
        for other in (0..n_visible).filter(|j| !surfaces.contains(j)) {
            let mut set = surfaces.clone();
            set.push(other);
            set.sort_unstable();
            let of_set = found.iter().filter(|(known, _)| *known == set);
            if found.len() == MOST_MEETINGS || of_set.count() == MOST_OF_A_SET {
                continue;
            }
            let Some(x) = onto(plane, &set, x.clone())? else {
                continue;
            };
            let is_known = |(known, at): &Meeting| *known == set && is_near(at, &x);
            if plane.window.contains(plane.window.point(&x)) && !found.iter().any(is_known) {
                found.push((set, x));
            }
        }
    }
    Ok(found)
}

/// The state on all of these surfaces that is reached from here along their gradients; none if they do not meet.
fn onto(
    plane: &Plane,
    surfaces: &[usize],
    mut x: Vec<f64>,
) -> Result<Option<Vec<f64>>, FieldError> {
    let signs = plane.signs(&x)?;
    let values = |x: &[f64]| -> Result<Vec<f64>, FieldError> {
        let mut h = vec![0.0; signs.len()];
        let setting = Setting::new(&signs, plane.q);
        plane.system.surfaces(&setting.at(plane.t, x), &mut h)?;
        Ok(surfaces.iter().map(|&j| h[j]).collect())
    };
    for _ in 0..MOST_ITERATIONS {
        let h = values(&x)?;
        let gradients = differences(&x, values)?;
        let gram = Matrix::of(surfaces.len(), |i, j| {
            gradients.iter().map(|along| along[i] * along[j]).sum()
        });
        let Some(shares) = gram.solve(&h) else {
            return Ok(None);
        };
        let mut is_there = true;
        for (value, along) in x.iter_mut().zip(&gradients) {
            let change: f64 = along.iter().zip(&shares[..]).map(|(a, b)| a * b).sum();
            *value -= change;
            is_there &= change.abs() <= CONVERGED * (1.0 + value.abs());
        }
        if is_there || !x.iter().all(|value| value.is_finite()) {
            return Ok(is_there.then_some(x));
        }
    }
    Ok(None)
}

/// The derivatives of a function by each variable, as central differences.
fn differences(
    at: &[f64],
    function: impl Fn(&[f64]) -> Result<Vec<f64>, FieldError>,
) -> Result<Vec<Vec<f64>>, FieldError> {
    let mut moved = at.to_vec();
    let mut columns = Vec::with_capacity(at.len());
    for (k, &value) in at.iter().enumerate() {
        let step = STEP * (1.0 + value.abs());
        let (up, down) = (value + step, value - step);
        moved[k] = up;
        let above = function(&moved)?;
        moved[k] = down;
        let below = function(&moved)?;
        moved[k] = value;
        let both = above.iter().zip(&below);
        let column = both.map(|(above, below)| (above - below) / (up - down));
        columns.push(column.collect());
    }
    Ok(columns)
}

/// The equations of an equilibrium in a region, or on surfaces with their multipliers as the last unknowns.
struct Balance<'a> {
    plane: &'a Plane<'a>,
    signs: &'a [f64],
    surfaces: &'a [usize],
}

impl Balance<'_> {
    /// The field, and on surfaces their functions behind it.
    fn residual(&self, unknowns: &[f64]) -> Result<Vec<f64>, FieldError> {
        let Plane { system, t, q, .. } = *self.plane;
        let n = system.n_states();
        let (x, multipliers) = unknowns.split_at(n);
        let mut signs = self.signs.to_vec();
        let mut residual = vec![0.0; n];
        let mut dx = vec![0.0; n];
        for corner in 0..1_usize << self.surfaces.len() {
            let mut weight = 1.0;
            for (bit, (&j, l)) in self.surfaces.iter().zip(multipliers).enumerate() {
                signs[j] = if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
                weight *= 0.5 * (1.0 + signs[j] * l);
            }
            let setting = Setting::new(&signs, q);
            system.field(&setting.at(t, x), &mut dx)?;
            for (sum, part) in residual.iter_mut().zip(&dx) {
                *sum += weight * part;
            }
        }
        if !self.surfaces.is_empty() {
            let mut h = vec![0.0; signs.len()];
            let setting = Setting::new(&signs, q);
            system.surfaces(&setting.at(t, x), &mut h)?;
            residual.extend(self.surfaces.iter().map(|&j| h[j]));
        }
        Ok(residual)
    }

    fn jacobian(&self, unknowns: &[f64]) -> Result<Matrix, FieldError> {
        let columns = differences(unknowns, |moved| self.residual(moved))?;
        Ok(Matrix::of(unknowns.len(), |i, k| columns[k][i]))
    }

    /// The solution that Newton's method reaches from here, and the derivative there; none if it reaches none, or one that is
    /// not isolated.
    fn solve(&self, mut unknowns: Vec<f64>) -> Result<Option<(Vec<f64>, Matrix)>, FieldError> {
        for _ in 0..MOST_ITERATIONS {
            let residual = self.residual(&unknowns)?;
            let jacobian = self.jacobian(&unknowns)?;
            let Some(step) = jacobian.solve(&residual) else {
                return Ok(None);
            };
            let mut is_there = true;
            for (value, change) in unknowns.iter_mut().zip(&step) {
                *value -= change;
                is_there &= change.abs() <= CONVERGED * (1.0 + value.abs());
            }
            if !unknowns.iter().all(|value| value.is_finite()) {
                return Ok(None);
            }
            if is_there {
                let jacobian = self.jacobian(&unknowns)?;
                let is_isolated = jacobian
                    .inverse()
                    .is_some_and(|inverse| inverse.size() * jacobian.size() < 1.0 / UNDECIDED);
                return Ok(is_isolated.then_some((unknowns, jacobian)));
            }
        }
        Ok(None)
    }
}

/// Is the equilibrium of a sliding field stable? The surfaces must attract, and the field on them too.
///
/// The rows of the derivative are the field by states and multipliers, then the gradients of the surfaces.
fn sliding_stability(n: usize, jacobian: &Matrix) -> Option<bool> {
    let m = jacobian.n() - n;
    let entry = |i: usize, k: usize| jacobian[(i, k)];
    let rate = |j: usize, k: usize| -> f64 { (0..n).map(|i| entry(n + j, i) * entry(i, k)).sum() };
    // dh/dt = normal * (l - l0): the surfaces attract if it falls with the multipliers.
    let normal = Matrix::of(m, |j, k| rate(j, n + k));
    match stability(&normal) {
        Some(true) if n > m => {}
        decided => return decided,
    }
    // The multipliers keep the rates of h at zero: their derivative by the states, one column for each.
    let columns: Option<Vec<Vec<f64>>> = (0..n)
        .map(|k| {
            let rates: Vec<f64> = (0..m).map(|j| -rate(j, k)).collect();
            normal.solve(&rates).map(|column| column.to_vec())
        })
        .collect();
    let responses = columns?;
    let along = |i: usize, k: usize| {
        entry(i, k)
            + (0..m)
                .map(|j| entry(i, n + j) * responses[k][j])
                .sum::<f64>()
    };
    // On the surfaces m of the states follow from the others: those in which the surfaces are steepest.
    let dependent = steepest(n, m, &entry);
    let others: Vec<usize> = (0..n).filter(|i| !dependent.contains(i)).collect();
    let gradient = Matrix::of(m, |j, p| entry(n + j, dependent[p]));
    let follow: Option<Vec<Vec<f64>>> = others
        .iter()
        .map(|&k| {
            let slopes: Vec<f64> = (0..m).map(|j| -entry(n + j, k)).collect();
            gradient.solve(&slopes).map(|column| column.to_vec())
        })
        .collect();
    let follow = follow?;
    let reduced = Matrix::of(n - m, |i, k| {
        let through = (0..m).map(|p| along(others[i], dependent[p]) * follow[k][p]);
        along(others[i], others[k]) + through.sum::<f64>()
    });
    stability(&reduced)
}

/// As many states as there are surfaces, in which their gradients are independent: the pivots of an elimination.
fn steepest(n: usize, m: usize, entry: &dyn Fn(usize, usize) -> f64) -> Vec<usize> {
    let gradient = |j: usize| (0..n).map(|i| entry(n + j, i)).collect();
    let mut rows: Vec<Vec<f64>> = (0..m).map(gradient).collect();
    let mut columns = Vec::with_capacity(m);
    while let Some(row) = rows.pop() {
        let larger = |best: usize, i: usize| match row[i].abs() > row[best].abs() {
            true => i,
            false => best,
        };
        let pivot = (0..n).reduce(larger).unwrap_or(0);
        columns.push(pivot);
        for other in &mut rows {
            let factor = other[pivot] / row[pivot];
            for (value, own) in other.iter_mut().zip(&row) {
                *value -= factor * own;
            }
            other[pivot] = 0.0;
        }
    }
    columns
}

/// Do all eigenvalues have negative real parts? `None` if one is too near to the imaginary axis.
fn stability(matrix: &Matrix) -> Option<bool> {
    let shift = UNDECIDED * matrix.size();
    let shifted = |by: f64| {
        Matrix::of(matrix.n(), |i, k| {
            matrix[(i, k)] + if i == k { by } else { 0.0 }
        })
    };
    let (to_the_right, to_the_left) = (is_stable(&shifted(shift)), is_stable(&shifted(-shift)));
    (to_the_right == to_the_left).then_some(to_the_right)
}
