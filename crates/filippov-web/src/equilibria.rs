//! Equilibria and pseudo-equilibria in a window, by Newton's method from many starts.
//!
//! In a region f(x) = 0. On one surface ((1 - l) f- + (1 + l) f+) / 2 = 0 and h = 0, with the multiplier l as a further unknown.
//! Derivatives are central differences: they decide how fast the iteration converges, not what it converges to.

use filippov::cube::{is_stable, Matrix};
use filippov::{FieldError, Setting};

use crate::sheet::{Plane, SheetKind, SheetPart};

/// An equilibrium.
pub struct Equilibrium {
    pub y: Vec<f64>,
    /// The surface that it is on, if it is a pseudo-equilibrium.
    pub surface: Option<usize>,
    /// Is it stable? `None` if linear terms do not decide.
    pub is_stable: Option<bool>,
    /// Does the system have it: is it in its own region, or its multiplier from -1 to 1?
    pub is_admissible: bool,
}

/// Starts along each side of the window in each region, and along each sliding part.
const STARTS: usize = 7;
const STARTS_ALONG: usize = 9;
const MOST_ITERATIONS: usize = 40;
/// Equilibria nearer than this share of the window are one.
const SAME: f64 = 1e-6;
/// The last correction, relative to the size of the unknowns.
const CONVERGED: f64 = 1e-11;
/// The share of the size of a matrix within which its eigenvalues decide nothing.
const UNDECIDED: f64 = 1e-6;
/// Differences of the cube root of the rounding unit: the best for central ones.
const STEP: f64 = 6e-6;

/// The equilibria in the window: those of the regions seen there, and those on one surface each. A point on the border of its
/// region is not among them: it is the end of sliding, or of sticking.
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
            known.surface == new.surface && is_near && known.is_admissible == new.is_admissible
        };
        if window.contains(window.point(&new.y)) && !found.iter().any(is_same) {
            found.push(new);
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
            surface: None,
        };
        for x in &starts {
            let Some((x, jacobian)) = balance.solve(x.clone())? else {
                continue;
            };
            if plane.is_on_surface(&x, signs, n_visible)? {
                continue;
            }
            let own = plane.signs(&x)?;
            let is_admissible = own[..n_visible] == signs[..n_visible];
            add(Equilibrium {
                is_stable: stability(&jacobian),
                is_admissible,
                surface: None,
                y: x,
            });
        }
    }
    for part in parts {
        let slides = matches!(part.kind, SheetKind::Attracting | SheetKind::Repelling);
        let stride = part.points.len().div_ceil(STARTS_ALONG);
        for start in part.points.iter().step_by(stride).filter(|_| slides) {
            let mut x = plane.window.state(start.point);
            let signs = plane.signs(&x)?;
            let balance = Balance {
                plane,
                signs: &signs,
                surface: Some(part.surface),
            };
            // The multiplier at which the motion slides.
            x.push((start.minus + start.plus) / (start.minus - start.plus));
            let Some((mut x, jacobian)) = balance.solve(x)? else {
                continue;
            };
            let multiplier = x.pop().unwrap_or(f64::NAN);
            let own = plane.signs(&x)?;
            let others = (0..n_visible).filter(|&j| j != part.surface);
            let is_admissible =
                multiplier.abs() <= 1.0 && others.into_iter().all(|j| own[j] == signs[j]);
            let is_stable = balance.sliding_stability(&x, multiplier, &jacobian)?;
            add(Equilibrium {
                is_stable,
                is_admissible,
                surface: Some(part.surface),
                y: x,
            });
        }
    }
    Ok(found)
}

/// The equations of an equilibrium in a region, or on a surface with its multiplier as the last unknown.
struct Balance<'a> {
    plane: &'a Plane<'a>,
    signs: &'a [f64],
    surface: Option<usize>,
}

impl Balance<'_> {
    /// The field, and on a surface its function behind it.
    fn residual(&self, unknowns: &[f64]) -> Result<Vec<f64>, FieldError> {
        let Plane { system, t, q, .. } = *self.plane;
        let n = system.n_states();
        let (x, multiplier) = unknowns.split_at(n);
        let field_at = |signs: &[f64]| {
            let mut dx = vec![0.0; n];
            let setting = Setting::new(signs, q);
            system.field(&setting.at(t, x), &mut dx).map(|()| dx)
        };
        let (Some(j), &[l]) = (self.surface, multiplier) else {
            return field_at(self.signs);
        };
        let mut signs = self.signs.to_vec();
        signs[j] = -1.0;
        let minus = field_at(&signs)?;
        signs[j] = 1.0;
        let plus = field_at(&signs)?;
        let both = minus.iter().zip(&plus);
        let mut residual: Vec<f64> = both
            .map(|(minus, plus)| 0.5 * ((1.0 - l) * minus + (1.0 + l) * plus))
            .collect();
        let mut h = vec![0.0; signs.len()];
        let setting = Setting::new(&signs, q);
        system.surfaces(&setting.at(t, x), &mut h)?;
        residual.push(h[j]);
        Ok(residual)
    }

    fn jacobian(&self, unknowns: &[f64]) -> Result<Matrix, FieldError> {
        let n = unknowns.len();
        let mut columns = Vec::with_capacity(n);
        let mut moved = unknowns.to_vec();
        for (k, &value) in unknowns.iter().enumerate() {
            let step = STEP * (1.0 + value.abs());
            let (up, down) = (value + step, value - step);
            moved[k] = up;
            let above = self.residual(&moved)?;
            moved[k] = down;
            let below = self.residual(&moved)?;
            moved[k] = value;
            let both = above.iter().zip(&below);
            let column = both.map(|(above, below)| (above - below) / (up - down));
            columns.push(column.collect::<Vec<f64>>());
        }
        Ok(Matrix::of(n, |i, k| columns[k][i]))
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

    /// Is the equilibrium of the sliding field stable? The surface must attract, and the field on it too.
    fn sliding_stability(
        &self,
        x: &[f64],
        multiplier: f64,
        jacobian: &Matrix,
    ) -> Result<Option<bool>, FieldError> {
        let n = x.len();
        // Rows: the field by states and multiplier, then the gradient of h.
        let entry = |i: usize, k: usize| jacobian[(i, k)];
        let normal: f64 = (0..n).map(|i| entry(n, i) * entry(i, n)).sum();
        if normal == 0.0 || !multiplier.is_finite() {
            return Ok(None);
        }
        // dh/dt = normal * (l - l0): the surface attracts if it falls with the multiplier.
        if normal > 0.0 {
            return Ok(Some(false));
        }
        if n == 1 {
            return Ok(Some(true));
        }
        // The multiplier keeps the rate of h at zero: l_x = -(h_x F_x) / (h_x F_l).
        let response = |k: usize| {
            let rate: f64 = (0..n).map(|i| entry(n, i) * entry(i, k)).sum();
            -rate / normal
        };
        let responses: Vec<f64> = (0..n).map(response).collect();
        let along = |i: usize, k: usize| entry(i, k) + entry(i, n) * responses[k];
        // On the surface the state with the steepest slope follows from the others.
        let steepest = (0..n).fold(0, |best, i| {
            if entry(n, i).abs() > entry(n, best).abs() {
                i
            } else {
                best
            }
        });
        let others: Vec<usize> = (0..n).filter(|&i| i != steepest).collect();
        let reduced = Matrix::of(n - 1, |i, k| {
            let (i, k) = (others[i], others[k]);
            along(i, k) - along(i, steepest) * entry(n, k) / entry(n, steepest)
        });
        Ok(stability(&reduced))
    }
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
