//! Fields that are affine in the signs of the surfaces slid on: multipliers by one linear system.
//!
//! Around a point of the surfaces Z let f(s) = a + B s_Z, with the other signs fixed. Then
//!
//! ```text
//! dh_i/dt = d_t h_i + grad h_i . f = nu_i + (N s_Z)_i,    N = grad h_Z B,    i in Z,
//! ```
//!
//! so sliding on Z, dh_Z/dt = 0, determines the multipliers by N lambda = -nu, and at an event the mode follows
//! from the relay problem of [`crate::cube::solve_relay`]. Nothing is formed for 2^m sign patterns; in
//! a chain B, grad h and N are sparse, and everything costs O(n).
//!
//! References: Piiroinen, Kuznetsov (2008), (21)-(24), with s = 1 - 2 mu; Guglielmi, Hairer (2022), section 7.

use filippov_expr::{Enclosure, Motion};

use super::lie_derivatives::tolerance_of_differences;
use super::{PiecewiseSystem, Place, Setting};
use crate::error::FieldError;
use crate::sparse::{Pattern, SparseProduct, SparseRows, SparseSolver};
use crate::system::eval_on_side;

/// A system whose field is affine in the signs of some sets of surfaces.
///
/// Duties of an implementer:
///
/// 1. [`affine_parts`](Self::affine_parts) returns `None` unless f(t, x, s) is affine in the entries of s on these
///    surfaces for any values of the others, and the gradients of their switching functions do not depend
///    on these entries. It fixes the patterns of gradients and jumps.
/// 2. [`fill_affine_parts`](Self::fill_affine_parts) fills field, gradients, jumps and rates in time; entries of
///    `signs` on the surfaces may be any numbers, the others are -1.0 or +1.0.
///
/// [`refit_affine_parts`](Self::refit_affine_parts) does what the first does, in the space of other parts.
///
/// The provided methods suit a black box that is affine in all signs: m + 1 evaluations for m surfaces,
/// at signs -1 and +1 only, and dense matrices.
pub trait AffineSigns: PiecewiseSystem {
    /// Space for these surfaces (increasing), if the field is affine in their signs together.
    fn affine_parts(&self, surfaces: &[usize]) -> Option<AffineParts> {
        let n = self.n_states();
        let mut full = SparseRows::new(n);
        for _ in surfaces {
            full.push_row((0..n).map(|i| (i, 0.0)));
        }
        let mut parts = AffineParts::new(n, surfaces, full.clone(), full);
        parts.solver = SparseSolver::with_noise(self.noise_of_rates());
        Some(parts)
    }

    /// Makes parts those of other surfaces (increasing); `false`, and they are of no use, if the field is not affine in
    /// their signs together.
    fn refit_affine_parts(&self, surfaces: &[usize], parts: &mut AffineParts) -> bool {
        match self.affine_parts(surfaces) {
            Some(others) => *parts = others,
            None => return false,
        }
        true
    }

    /// Writes f(t, x, s), the gradients and time derivatives of the switching functions, and df/ds_j. Returns
    /// the number of evaluations of the right-hand side.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn fill_affine_parts(
        &self,
        place: &Place<'_>,
        parts: &mut AffineParts,
    ) -> Result<u64, FieldError> {
        let signs = place.signs;
        let n = self.n_states();
        let mut vertex = signs.to_vec();
        for &j in &parts.surfaces {
            vertex[j] = if signs[j] < 0.0 { -1.0 } else { 1.0 };
        }
        let mut evaluations = eval_on_side(self, &place.with_signs(&vertex), &mut parts.field)?;
        let base = parts.field.clone();
        let mut flipped = vec![0.0; n];
        for (row, &j) in parts.surfaces.iter().enumerate() {
            let range = row * n..(row + 1) * n;
            let gradient = &mut parts.gradients.values_mut()[range.clone()];
            parts.time_rates[row] = self.gradient(j, &place.with_signs(&vertex), gradient)?;
            vertex[j] = -vertex[j];
            evaluations += eval_on_side(self, &place.with_signs(&vertex), &mut flipped)?;
            vertex[j] = -vertex[j];
            let jump = &mut parts.jumps.values_mut()[range];
            for (i, jump) in jump.iter_mut().enumerate() {
                *jump = 0.5 * vertex[j] * (base[i] - flipped[i]);
                parts.field[i] += *jump * (signs[j] - vertex[j]);
            }
        }
        Ok(evaluations)
    }

    /// Below this fraction of its magnitude a rate of a switching function counts as zero.
    fn noise_of_rates(&self) -> f64 {
        let lie = self.lie_derivatives();
        lie.map_or(tolerance_of_differences(1), |lie| lie.lie_tolerance(1))
    }

    /// Are the gradient of h_j, and what s_j changes in the rates of switching functions, the same all along every motion?
    fn is_steady(&self, j: usize) -> bool {
        let _ = j;
        false
    }

    /// May dh_j/dt change along a piece of motion? `false` if it reads nothing that moves.
    fn rate_moves(&self, j: usize, motion: &dyn Motion) -> bool {
        let _ = (j, motion);
        true
    }

    /// Rigorous bounds of dh_j/dt, and of its derivative, along a piece of motion; entries of `signs` may be any numbers on surfaces that
    /// [`affine_parts`](Self::affine_parts) accepts together. `None` if there are none.
    fn enclose_rate(
        &self,
        j: usize,
        motion: &dyn Motion,
        setting: Setting<'_>,
    ) -> Option<Enclosure> {
        let _ = (j, motion, setting);
        None
    }
}

/// Makes values so many equal ones.
#[inline(never)]
fn fill(values: &mut Vec<f64>, length: usize, value: f64) {
    values.clear();
    values.resize(length, value);
}

/// Sliding is not determined: signs of these surfaces can change together without any effect on dh/dt.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the multipliers of the surfaces {surfaces:?} are not determined: their jumps are dependent there")]
pub struct SingularSliding {
    /// The surfaces concerned.
    pub surfaces: Vec<usize>,
}

/// The parts of an affine field at a point, and the sliding field that follows from them.
///
/// # Example
/// ```
/// use filippov::{AffineSigns, ClosureSystem, PiecewiseSystem, Place};
/// // Two masses on a belt each: v_i' = 0.2 - v_i - sign(v_i), sliding on both surfaces.
/// let system = ClosureSystem::new(
///     2,
///     2,
///     |_t, v, s, dv| (0..2).for_each(|i| dv[i] = 0.2 - v[i] - s[i]),
///     |_t, v, h| h.copy_from_slice(v),
/// )
/// .with_affine_signs();
/// let affine = system.affine_signs().expect("declared above");
/// let mut parts = affine.affine_parts(&[0, 1]).expect("affine in all signs");
/// parts.evaluate(affine, &Place::new(0.0, &[0.0, 0.0], &[1.0, 1.0]))?;
/// let mut rates = [f64::NAN; 2];
/// parts.slide(&mut rates).expect("both jumps are independent");
/// assert!(rates.iter().all(|v| v.abs() < 1e-15));
/// assert!(parts.multipliers().iter().all(|lambda| (lambda - 0.2).abs() < 1e-9));
/// # Ok::<(), filippov::FieldError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct AffineParts {
    surfaces: Vec<usize>,
    /// f(t, x, s) at the signs of the evaluation.
    pub field: Vec<f64>,
    /// d_t h_i, one entry per surface.
    pub time_rates: Vec<f64>,
    /// Row i is grad h_i.
    pub gradients: SparseRows,
    /// Row j is df/ds_j.
    pub jumps: SparseRows,
    /// Space for a system that computes all at once.
    pub(super) outputs: Vec<f64>,
    normal: SparseProduct,
    /// The signs of the evaluation on the surfaces.
    signs: Vec<f64>,
    rates: Vec<f64>,
    multipliers: Vec<f64>,
    solver: SparseSolver,
    /// Gradients and N are the same at every evaluation.
    is_steady: bool,
    /// N is known, and does not change any more.
    is_formed: bool,
    /// `solver` has factored it.
    is_factored: bool,
}

impl AffineParts {
    /// Space for surfaces with gradients and jumps of these patterns; their values do not matter.
    pub fn new(n: usize, surfaces: &[usize], gradients: SparseRows, jumps: SparseRows) -> Self {
        let mut parts = AffineParts {
            gradients,
            jumps,
            ..AffineParts::default()
        };
        parts.refit(n, surfaces);
        parts
    }

    /// Makes the rest fit surfaces whose gradients and jumps have been put in.
    pub(super) fn refit(&mut self, n: usize, surfaces: &[usize]) {
        let m = surfaces.len();
        self.surfaces.clear();
        self.surfaces.extend_from_slice(surfaces);
        self.normal.find_pattern(&self.gradients, &self.jumps);
        fill(&mut self.field, n, 0.0);
        fill(&mut self.time_rates, m, 0.0);
        fill(&mut self.signs, m, 0.0);
        fill(&mut self.rates, m, 0.0);
        fill(&mut self.multipliers, m, f64::NAN);
        self.is_steady = false;
        self.restart();
    }

    /// Says whether gradients and N are the same at every evaluation: N is formed and factored once then.
    pub fn set_steady(&mut self, is_steady: bool) {
        self.is_steady = is_steady;
    }

    /// Are gradients and N the same at every evaluation?
    pub fn is_steady(&self) -> bool {
        self.is_steady
    }

    /// Are they, and are they known by now?
    pub fn is_settled(&self) -> bool {
        self.is_steady && self.is_formed
    }

    /// Forgets N: the signs of other surfaces may have changed.
    pub(crate) fn restart(&mut self) {
        (self.is_formed, self.is_factored) = (false, false);
    }

    /// Moves the jumps from signs of size 1 to these sizes, one per surface.
    pub(super) fn stretch(&mut self, ratios: &[f64]) {
        self.jumps.scale_rows(ratios);
    }

    /// Evaluates everything at a point. Entries of `signs` on the surfaces are any numbers: the nearer to the
    /// multipliers, the less cancels. Returns the number of evaluations of the right-hand side.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn evaluate(
        &mut self,
        system: &dyn AffineSigns,
        place: &Place<'_>,
    ) -> Result<u64, FieldError> {
        let signs = place.signs;
        let evaluations = system.fill_affine_parts(place, self)?;
        if !self.is_formed {
            self.normal.update(&self.gradients, &self.jumps);
            (self.is_formed, self.is_factored) = (self.is_steady, false);
        }
        for (row, &j) in self.surfaces.iter().enumerate() {
            self.signs[row] = signs[j];
            self.rates[row] = self.time_rates[row] + self.gradients.dot(row, &self.field);
        }
        Ok(evaluations)
    }

    /// The surfaces.
    pub fn surfaces(&self) -> &[usize] {
        &self.surfaces
    }

    /// N: how dh_i/dt depends on s_j.
    pub fn normal(&self) -> &SparseRows {
        &self.normal.matrix
    }

    /// dh_i/dt at the signs of the evaluation.
    pub fn rates(&self) -> &[f64] {
        &self.rates
    }

    /// nu: dh_i/dt at s_Z = 0, the other signs as in the evaluation.
    pub fn nu(&self) -> Vec<f64> {
        let rows = self.rates.iter().enumerate();
        rows.map(|(i, rate)| rate - self.normal.matrix.dot(i, &self.signs))
            .collect()
    }

    /// Writes the field at these signs of the surfaces, f + B (s - s of the evaluation).
    pub fn combine(&self, signs: &[f64], dx: &mut [f64]) {
        dx.copy_from_slice(&self.field);
        for (row, (sign, here)) in signs.iter().zip(&self.signs).enumerate() {
            let change = sign - here;
            for (i, jump) in self.jumps.row(row) {
                dx[i] += change * jump;
            }
        }
    }

    /// Solves for the multipliers and writes the sliding field; [`AffineParts::evaluate`] comes first. Where
    /// the field is not finite neither are they.
    ///
    /// # Errors
    /// [`SingularSliding`] with the surfaces whose multipliers are not determined.
    pub fn slide(&mut self, dx: &mut [f64]) -> Result<(), SingularSliding> {
        self.multipliers.clear();
        self.multipliers.extend(self.rates.iter().map(|rate| -rate));
        if !self.is_factored {
            if !self.normal.matrix.is_finite() {
                self.multipliers.fill(f64::NAN);
                dx.fill(f64::NAN);
                return Ok(());
            }
            if let Err(singular) = self.solver.factor(&self.normal.matrix) {
                self.multipliers.fill(f64::NAN);
                let surfaces = singular.unknowns.iter().map(|&row| self.surfaces[row]);
                return Err(SingularSliding {
                    surfaces: surfaces.collect(),
                });
            }
            self.is_factored = self.is_formed;
        }
        self.solver.solve(&mut self.multipliers);
        for (lambda, here) in self.multipliers.iter_mut().zip(&self.signs) {
            *lambda += here;
        }
        self.combine(&self.multipliers, dx);
        // A state that is held by its surface alone does not move by the rounding of these sums.
        for (row, rate) in self.time_rates.iter().enumerate() {
            let mut entries = self.gradients.row(row);
            if let (Some((i, slope)), None) = (entries.next(), entries.next()) {
                if slope != 0.0 && dx[i].is_finite() {
                    dx[i] = 0.0 - rate / slope;
                }
            }
        }
        Ok(())
    }

    /// The velocity of a motion that slides on those of the surfaces whose entry is 0, and has left the others to these
    /// sides, at the point of the evaluation; there is an entry for every surface of the system. `None` where its multipliers
    /// are not determined.
    pub fn velocity_in(&self, entries: &[i8]) -> Option<Vec<f64>> {
        let mut signs: Vec<f64> = self.surfaces.iter().map(|&j| entries[j].into()).collect();
        let rows = 0..signs.len();
        let slid: Vec<usize> = rows.filter(|&row| signs[row] == 0.0).collect();
        let normal = &self.normal.matrix;
        let rate = |row: usize| {
            let changes = normal.row(row).map(|(k, n)| n * (signs[k] - self.signs[k]));
            self.rates[row] + changes.sum::<f64>()
        };
        let mut multipliers: Vec<f64> = slid.iter().map(|&row| -rate(row)).collect();
        let mut solver = self.solver.of_this_noise();
        solver.factor(&normal.principal(&slid)).ok()?;
        solver.solve(&mut multipliers);
        for (&row, multiplier) in slid.iter().zip(multipliers) {
            signs[row] = multiplier;
        }
        let mut velocity = vec![0.0; self.field.len()];
        self.combine(&signs, &mut velocity);
        Some(velocity)
    }

    /// The multipliers that [`AffineParts::slide`] found, one per surface.
    pub fn multipliers(&self) -> &[f64] {
        &self.multipliers
    }

    /// What couples the surfaces.
    pub fn pattern(&self) -> Pattern {
        self.solver.pattern()
    }

    /// Multiplications and divisions of the solutions so far, and of one product N = grad h B.
    pub fn n_operations(&self) -> usize {
        self.solver.n_operations() + self.normal.n_operations()
    }
}

#[cfg(test)]
mod tests;
