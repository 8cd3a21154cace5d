//! Projection onto a surface, or onto an intersection of surfaces.

use smallvec::{smallvec, SmallVec};

use crate::cube::{Matrix, Vector};
use crate::error::FieldError;
use crate::system::{dot, dot_magnitude, PiecewiseSystem, Place, Setting};
use crate::tolerances::ROUNDING;

/// A system, or one reduced from it, with surfaces to move onto.
pub(crate) type Level<'s> = (&'s dyn PiecewiseSystem, &'s [usize]);

/// Scratch space of the projection.
#[derive(Clone, Debug)]
pub struct Projector {
    h: Vec<f64>,
    gradient: Vec<f64>,
    /// The gradients of several surfaces.
    rows: Vec<f64>,
    /// The unit in which each state is moved; empty: one for all.
    units: Vec<f64>,
}

impl Projector {
    /// Space for a system with n states and d surfaces.
    pub fn new(n: usize, d: usize) -> Self {
        Projector {
            h: vec![0.0; d],
            gradient: vec![0.0; n],
            rows: Vec::new(),
            units: Vec::new(),
        }
    }

    /// The same in these units of the states, which may be left out if all have one: what is near does not depend on those of
    /// the user.
    #[must_use]
    pub fn measured_in(mut self, units: Vec<f64>) -> Self {
        self.units = units;
        self
    }

    /// Moves `x` onto h_j(t, x) = 0 along the gradient: x <- x - h U^2 grad h / |U grad h|^2 with the units U, repeated
    /// until |h| is at the level of rounding, at most four times; once if h is affine.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn project(
        &mut self,
        system: &dyn PiecewiseSystem,
        j: usize,
        t: f64,
        x: &mut [f64],
        setting: Setting<'_>,
    ) -> Result<(), FieldError> {
        let most = if system.is_affine(j) { 1 } else { 4 };
        for _ in 0..most {
            let place = setting.at(t, x);
            system.surfaces(&place, &mut self.h)?;
            let h = self.h[j];
            if h == 0.0 || !h.is_finite() {
                break;
            }
            system.gradient(j, &place, &mut self.gradient)?;
            let size: f64 = self
                .gradient
                .iter()
                .zip(&*x)
                .map(|(g, x)| (g * x).abs())
                .sum();
            scale(&mut self.gradient, &self.units);
            let norm2: f64 = self.gradient.iter().map(|g| g * g).sum();
            // A root may have no slope on its surface.
            if norm2 == 0.0 || !norm2.is_finite() || h.abs() <= 0.25 * ROUNDING * size {
                break;
            }
            let shift = h / norm2;
            scale(&mut self.gradient, &self.units);
            x.iter_mut()
                .zip(&self.gradient)
                .for_each(|(x, g)| *x -= shift * g);
        }
        Ok(())
    }

    /// Moves `x` onto all surfaces of `set` at once, x <- x - U N^T (N N^T)^-1 h with U times the gradients as the rows of N,
    /// repeated until every |h| is at the level of rounding, at most eight times. A surface whose gradient depends on those
    /// of others is in the place of them, and goes with them.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn project_onto(
        &mut self,
        system: &dyn PiecewiseSystem,
        set: &[usize],
        t: f64,
        x: &mut [f64],
        setting: Setting<'_>,
    ) -> Result<(), FieldError> {
        if let &[j] = set {
            return self.project(system, j, t, x, setting);
        }
        let n = x.len();
        self.rows.resize(n * set.len(), 0.0);
        for _ in 0..8 {
            let place = setting.at(t, x);
            system.surfaces(&place, &mut self.h)?;
            let mut is_near = true;
            for (row, &j) in self.rows.chunks_exact_mut(n).zip(set) {
                system.gradient(j, &place, row)?;
                is_near &= self.h[j].abs() <= 0.25 * ROUNDING * dot_magnitude(row, x);
            }
            if is_near {
                break;
            }
            let h: Vector = set.iter().map(|&j| self.h[j]).collect();
            if !self.shift(&h, x) {
                break;
            }
        }
        Ok(())
    }

    /// Moves `x` onto all surfaces of `set` and onto their rates, for those of higher relative degree, all at once: one after the other
    /// each would disturb the others.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn project_onto_rates(
        &mut self,
        system: &dyn PiecewiseSystem,
        set: &[usize],
        t: f64,
        x: &mut [f64],
        setting: Setting<'_>,
    ) -> Result<(), FieldError> {
        let mut levels: SmallVec<[Level<'_>; 3]> = smallvec![(system, set)];
        let mut last = system;
        while let Some(next) = last.reduced(set) {
            levels.push((next, set));
            last = next;
        }
        self.project_onto_levels(&levels, t, x, setting)
    }

    /// Moves `x` onto these surfaces of several systems at once, as [`project_onto`](Self::project_onto) does for one.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn project_onto_levels(
        &mut self,
        levels: &[Level<'_>],
        t: f64,
        x: &mut [f64],
        setting: Setting<'_>,
    ) -> Result<(), FieldError> {
        if let &[(system, set)] = levels {
            return self.project_onto(system, set, t, x, setting);
        }
        let n = x.len();
        let n_rows: usize = levels.iter().map(|(_, set)| set.len()).sum();
        self.rows.resize(n * n_rows, 0.0);
        for _ in 0..8 {
            let place = setting.at(t, x);
            let (mut is_near, mut values) = (true, Vector::new());
            let mut rows = self.rows.chunks_exact_mut(n);
            for &(system, set) in levels {
                system.surfaces(&place, &mut self.h)?;
                for (&j, row) in set.iter().zip(&mut rows) {
                    system.gradient(j, &place, row)?;
                    is_near &= self.h[j].abs() <= 0.25 * ROUNDING * dot_magnitude(row, x);
                    values.push(self.h[j]);
                }
            }
            if is_near {
                break;
            }
            if !self.shift(&values, x) {
                break;
            }
        }
        Ok(())
    }

    /// Takes away from `x` the shortest move that changes the functions by these values; `false` if none is known.
    #[inline(never)]
    fn shift(&mut self, values: &Vector, x: &mut [f64]) -> bool {
        let rows = self.rows.chunks_exact_mut(x.len());
        rows.for_each(|row| scale(row, &self.units));
        let Some(shares) = shares_of_rows(&self.rows, values) else {
            return false;
        };
        for (row, share) in self.rows.chunks_exact_mut(x.len()).zip(shares) {
            scale(row, &self.units);
            x.iter_mut().zip(row).for_each(|(x, g)| *x -= share * *g);
        }
        true
    }

    /// Adds the term that draws a point beside the surfaces back to them, -C sum h_j grad h_j.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn pull_back(
        &mut self,
        system: &dyn PiecewiseSystem,
        (set, factor): (&[usize], f64),
        place: &Place<'_>,
        dx: &mut [f64],
    ) -> Result<(), FieldError> {
        system.surfaces(place, &mut self.h)?;
        for &j in set {
            system.gradient(j, place, &mut self.gradient)?;
            let pull = factor * self.h[j];
            let components = dx.iter_mut().zip(&self.gradient);
            components.for_each(|(dx, g)| *dx -= pull * g);
        }
        Ok(())
    }
}

/// Multiplies a row by the units, if states have different ones.
#[inline(never)]
fn scale(row: &mut [f64], units: &[f64]) {
    row.iter_mut()
        .zip(units)
        .for_each(|(entry, unit)| *entry *= unit);
}

/// The combination of some rows, one after the other, that is the shortest vector with these inner products with them:
/// (N N^T)^-1 h. A row that depends on earlier ones has no share in it. `None` if a number is not finite.
pub fn shares_of_rows(rows: &[f64], values: &[f64]) -> Option<Vector> {
    let m = values.len();
    let n = rows.len() / m;
    let row = |i: usize| &rows[i * n..(i + 1) * n];
    let mut gram = Matrix::zeros(m);
    for i in 0..m {
        for j in 0..m {
            gram[(i, j)] = dot(row(i), row(j));
        }
    }
    let shares = gram.solve_gram(values);
    // A root may have no slope on its surface, and nothing moves along that.
    let is_finite = shares.iter().chain(rows).all(|v| v.is_finite());
    is_finite.then_some(shares)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::TracedSystem;
    use filippov_expr::{Backend, BinaryOp, Graph, Names};

    /// Beside the surface x^2 + y^2 = 0.64 the products of its gradient and that of hypot(x, y) - 0.8 are those of dependent
    /// vectors up to rounding, which must not decide how far a point is moved.
    #[test]
    fn surfaces_in_one_place_are_projected_onto_as_one() {
        let mut g = Graph::new();
        let (x, y) = (g.state(0), g.state(1));
        let (xx, yy) = (g.mul(x, x), g.mul(y, y));
        let square = g.add(xx, yy);
        let (limit, radius) = (g.constant(0.64), g.constant(0.8));
        let length = g.binary(BinaryOp::Hypot, x, y);
        let (h0, h1) = (g.sub(square, limit), g.sub(length, radius));
        let field = vec![g.sign(h0), g.sign(h1)];
        let names = Names::default();
        let system = TracedSystem::new(g, field, Vec::new(), names, Backend::Auto).unwrap();
        assert_eq!(system.n_surfaces(), 2);
        let mut projector = Projector::new(2, 2);
        let setting = Setting::of_signs(&[1.0, 1.0]);
        let mut h = [0.0; 2];
        for k in 0..50_000 {
            let angle = 1e-4 * f64::from(k);
            let r = 0.8 + 1e-8 * (1e-3 * f64::from(k)).sin();
            let mut x = [r * angle.cos(), r * angle.sin()];
            projector
                .project_onto(&system, &[0, 1], 0.0, &mut x, setting)
                .unwrap();
            system.surfaces(&setting.at(0.0, &x), &mut h).unwrap();
            assert!(h[0].abs().max(h[1].abs()) < 4e-15, "{h:?} at {angle}");
            assert!((x[1].atan2(x[0]) - angle).sin().abs() < 1e-15);
        }
    }
}
