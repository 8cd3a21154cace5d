//! Derivatives along a motion: M' = Df M + D_p f on an accepted step, by collocation. The method damps what is stiff, and is of higher
//! order than the continuous extension of any step but that of Taylor series.

use std::sync::Arc;

use super::extended::Extended;
use super::radau::{NODES, STAGES, WEIGHTS};
use crate::cube::Matrix;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{ContactField, Law, ModeField, SmoothField};
use crate::options::SlidingRule;
use crate::sparse::{SparseRows, SparseSolver};
use crate::system::{
    Actions, LieDerivatives, Linearisation, Linearisations, MotionJacobian, PiecewiseSystem, Place,
    Setting, SignStructure,
};
use crate::tolerances::{EPS, ROUNDING};

/// Largest part of a step, in units of 1 / |Df|; stiff steps are not divided into more than so many parts.
const LONGEST_PART: f64 = 1.0;
const MOST_PARTS: f64 = 16.0;

/// What a motion follows from, beside its mode and discrete states.
#[derive(Clone)]
pub(super) struct Surroundings<'a> {
    pub extended: &'a Extended<'a>,
    /// The impacts of its contacts.
    pub impacts: &'a Actions<'a>,
    pub law: Law<'a>,
    /// The side of each surface on which the motion is, or was last.
    pub sides: Vec<i8>,
}

impl Surroundings<'_> {
    /// Takes the sides of a mode.
    pub fn take_sides(&mut self, mode: &Mode) {
        let known = self.sides.iter_mut().zip(mode.entries());
        known
            .filter(|(_, entry)| **entry != 0)
            .for_each(|(side, entry)| *side = *entry);
    }
}

/// A motion of the extended system in one mode.
pub(super) struct Piece<'a> {
    extended: &'a Extended<'a>,
    pub mode: Mode,
    pub q: Vec<f64>,
    /// The surfaces slid on.
    pub sliding: Vec<usize>,
    /// The surfaces in contact.
    contacts: Vec<usize>,
    signs: Vec<f64>,
    pub field: ModeField<'a>,
    /// The derivatives of its field, if the graph has them.
    jacobian: Option<Arc<MotionJacobian>>,
    solver: SparseSolver,
}

/// The derivatives of the field at a point, without the rows of the parameters.
struct Slopes {
    /// -F_x, -F_p and -F_l, then G_x, G_p and G_l, in rows.
    rows: SparseRows,
    /// F_t, then -G_t.
    time: Vec<f64>,
}

impl<'a> Piece<'a> {
    pub fn new(around: &Surroundings<'a>, mode: &Mode, q: &[f64]) -> Self {
        let Surroundings {
            extended,
            impacts,
            law,
            ref sides,
        } = *around;
        let system: &dyn PiecewiseSystem = &extended.system;
        let contact = match impacts.list.is_empty() {
            true => None,
            false => ContactField::new(&extended.system, impacts, mode, sides, q),
        };
        let contacts: Vec<usize> = contact.iter().flat_map(ContactField::contacts).collect();
        let zeros = mode.sliding_set();
        let sliding: Vec<usize> = zeros.filter(|j| !contacts.contains(j)).collect();
        let field = match contact {
            Some(contact) => ModeField::Contact(Box::new(contact)),
            None => ModeField::of(&extended.system, law, mode, q),
        };
        let mut signs = mode.signs();
        for &j in &contacts {
            signs[j] = f64::from(impacts.trigger_side(j, sides[j]));
        }
        let by_graph = match &field {
            ModeField::Region(_) | ModeField::Sliding(_) => true,
            ModeField::Intersection(field) => field.rule() == SlidingRule::Canopy,
            _ => false,
        };
        let linearisations = system.linearisations().filter(|_| by_graph);
        Piece {
            extended,
            mode: mode.clone(),
            q: q.to_vec(),
            signs: signs.to_vec(),
            contacts,
            field,
            jacobian: linearisations.and_then(|l| l.motion_jacobian(&sliding)),
            sliding,
            solver: SparseSolver::for_all_pivots(),
        }
    }

    /// Does this motion have these mode and discrete states?
    pub fn is_of(&self, mode: &Mode, q: &[f64]) -> bool {
        self.mode == *mode && self.q == q
    }

    /// A point of the extended system in this motion.
    pub fn at<'p>(&'p self, t: f64, z: &'p [f64]) -> Place<'p> {
        Setting::new(&self.signs, &self.q).at(t, z)
    }

    /// The field of the extended system with the signs of the mode, and those given on the surfaces slid on.
    pub fn corner(
        &self,
        t: f64,
        z: &[f64],
        signs: &[(usize, f64)],
    ) -> Result<Vec<f64>, FieldError> {
        let mut all = self.signs.clone();
        signs.iter().for_each(|&(j, sign)| all[j] = sign);
        let mut out = vec![0.0; z.len()];
        let place = Setting::new(&all, &self.q).at(t, z);
        self.extended.system.field(&place, &mut out)?;
        Ok(out)
    }

    /// Carries the derivative of the state, columns of n states with the shares of the parameters behind them, over a step along
    /// which the state is `path`.
    pub fn advance(
        &mut self,
        mut path: impl FnMut(f64, &mut [f64]) -> Result<(), FieldError>,
        (t0, t1): (f64, f64),
        columns: &mut [Vec<f64>],
    ) -> Result<(), FieldError> {
        let middle = 0.5 * (t0 + t1);
        let mut z = self.extended.state(&vec![0.0; self.extended.n]);
        path(middle, &mut z[..self.extended.n])?;
        let steepest = self.slopes(middle, &z)?.norm(self.extended.n);
        let parts = ((t1 - t0) * steepest / LONGEST_PART).ceil();
        // NaN becomes one part, and stays NaN.
        let parts = parts.clamp(1.0, MOST_PARTS).max(1.0);
        let dt = (t1 - t0) / parts;
        for part in 0..parts as usize {
            let start = t0 + part as f64 * dt;
            let slopes = self.slopes_at_nodes(&mut path, start, start + dt)?;
            self.step(&slopes, dt, columns)?;
        }
        Ok(())
    }

    /// One step of the collocation method.
    fn step(
        &mut self,
        slopes: &[Slopes],
        dt: f64,
        columns: &mut [Vec<f64>],
    ) -> Result<(), FieldError> {
        let (n, m, l) = (
            self.extended.n,
            self.extended.n_parameters(),
            self.n_multipliers(),
        );
        let block = n + l;
        let mut matrix = SparseRows::new(STAGES * block);
        for (i, slopes) in slopes.iter().enumerate() {
            for (r, weights) in (0..n).map(|r| (r, &WEIGHTS[i])) {
                let mut row = Vec::with_capacity(STAGES + block);
                for (j, weight) in weights.iter().enumerate() {
                    if i != j {
                        row.push((j * block + r, *weight));
                        continue;
                    }
                    let mut has_own = false;
                    for (column, value) in slopes.rows.row(r) {
                        let own = if column == r { *weight } else { 0.0 };
                        has_own |= column == r;
                        if column < n {
                            row.push((i * block + column, own + dt * value));
                        } else if column >= n + m {
                            row.push((i * block + column - m, dt * value));
                        }
                    }
                    debug_assert!(has_own, "the pattern has the diagonal");
                }
                matrix.push_row(row);
            }
            for c in 0..l {
                let of_states = |(column, value)| match column {
                    column if column < n => Some((i * block + column, value)),
                    column if column >= n + m => Some((i * block + column - m, value)),
                    _ => None,
                };
                matrix.push_row(slopes.rows.row(n + m + c).filter_map(of_states));
            }
        }
        let is_regular = matrix.is_finite() && self.solver.factor(&matrix).is_ok();
        for column in columns {
            if !is_regular {
                column[..n].fill(f64::NAN);
                continue;
            }
            let mut right = vec![0.0; STAGES * block];
            for (i, slopes) in slopes.iter().enumerate() {
                let sum: f64 = WEIGHTS[i].iter().sum();
                let by_parameters = |r: usize| -> f64 {
                    let entries = slopes.rows.row(r).filter(|(c, _)| (n..n + m).contains(c));
                    entries.map(|(c, value)| value * column[c]).sum()
                };
                for r in 0..n {
                    right[i * block + r] = sum * column[r] - dt * by_parameters(r);
                }
                for c in 0..l {
                    right[i * block + n + c] = -by_parameters(n + m + c);
                }
            }
            self.solver.solve(&mut right);
            column[..n].copy_from_slice(&right[(STAGES - 1) * block..][..n]);
        }
        Ok(())
    }

    fn n_multipliers(&self) -> usize {
        match &self.jacobian {
            Some(_) => self.sliding.len(),
            None => 0,
        }
    }

    fn slopes_at_nodes(
        &mut self,
        path: &mut impl FnMut(f64, &mut [f64]) -> Result<(), FieldError>,
        t0: f64,
        t1: f64,
    ) -> Result<Vec<Slopes>, FieldError> {
        let mut z = self.extended.state(&vec![0.0; self.extended.n]);
        let mut all = Vec::with_capacity(STAGES);
        for node in NODES {
            let t = t0 + node * (t1 - t0);
            path(t, &mut z[..self.extended.n])?;
            all.push(self.slopes(t, &z)?);
        }
        Ok(all)
    }

    fn slopes(&mut self, t: f64, z: &[f64]) -> Result<Slopes, FieldError> {
        let Some(jacobian) = self.jacobian.clone() else {
            return self.slopes_by_differences(t, z);
        };
        let mut signs = self.signs.clone();
        if !self.sliding.is_empty() {
            let (mut point, mut rates) = (z.to_vec(), vec![0.0; z.len()]);
            self.field.eval_unprojected(t, &mut point, &mut rates)?;
            let multipliers = self.field.multipliers();
            let place = Setting::new(&self.signs, &self.q).at(t, z);
            for (k, &j) in self.sliding.iter().enumerate() {
                let ratio = self.extended.system.stick_ratio(j, &place);
                signs[j] = ratio * multipliers.get(k).copied().unwrap_or(f64::NAN);
            }
        }
        let mut linearisation: Linearisation = jacobian.linearisation();
        let place = Setting::new(&signs, &self.q).at(t, z);
        self.extended
            .system
            .eval_jacobian(&jacobian, &place, &mut linearisation);
        Ok(Slopes {
            time: linearisation.time().to_vec(),
            rows: linearisation.shifted(0.0).clone(),
        })
    }

    /// The same by central differences of the natural extension of the field.
    fn slopes_by_differences(&mut self, t: f64, z: &[f64]) -> Result<Slopes, FieldError> {
        let size = z.len();
        let mut dense = vec![vec![0.0; size]; size];
        let mut value = |z: &[f64]| -> Result<Vec<f64>, FieldError> {
            let (mut point, mut rates) = (z.to_vec(), vec![0.0; size]);
            self.field.eval_unprojected(t, &mut point, &mut rates)?;
            Ok(rates)
        };
        for c in 0..size {
            let d = EPS.cbrt() * (1.0 + z[c].abs());
            let mut moved = z.to_vec();
            moved[c] = z[c] + d;
            let above = value(&moved)?;
            moved[c] = z[c] - d;
            let below = value(&moved)?;
            for (row, (above, below)) in dense.iter_mut().zip(above.iter().zip(&below)) {
                row[c] = -(above - below) / (2.0 * d);
            }
        }
        let mut rows = SparseRows::new(size);
        for row in dense {
            rows.push_row(row.into_iter().enumerate());
        }
        Ok(Slopes {
            rows,
            time: vec![f64::NAN; size],
        })
    }

    /// The derivatives of the multiplier of a surface slid on, by the time and by the extended state; `None` where the graph has
    /// none.
    pub fn multiplier_slopes(
        &mut self,
        j: usize,
        t: f64,
        z: &[f64],
    ) -> Result<Option<(f64, Vec<f64>)>, FieldError> {
        let place = self.sliding.iter().position(|&k| k == j);
        let (Some(place), Some(_)) = (place, &self.jacobian) else {
            return Ok(None);
        };
        let slopes = self.slopes(t, z)?;
        let (size, l) = (z.len(), self.sliding.len());
        // dlambda_j = -w . dG with G_l^T w = e_j.
        let mut transposed = Matrix::zeros(l);
        for c in 0..l {
            for (column, value) in slopes.rows.row(size + c).filter(|(k, _)| *k >= size) {
                transposed[(column - size, c)] = value;
            }
        }
        let mut unit = vec![0.0; l];
        unit[place] = 1.0;
        let Some(weights) = transposed.solve(&unit) else {
            return Ok(Some((f64::NAN, vec![f64::NAN; size])));
        };
        let (mut time, mut state) = (0.0, vec![0.0; size]);
        for (c, weight) in weights.iter().enumerate() {
            time += weight * slopes.time[size + c];
            for (column, value) in slopes.rows.row(size + c).filter(|(k, _)| *k < size) {
                state[column] -= weight * value;
            }
        }
        Ok(Some((time, state)))
    }

    /// The gradients of the surfaces slid on and of those in contact by the extended state.
    pub fn normals(&self, t: f64, z: &[f64]) -> Result<Vec<Vec<f64>>, FieldError> {
        let gradient = |&j: &usize| {
            let mut row = vec![0.0; z.len()];
            let place = self.at(t, z);
            self.extended.system.gradient(j, &place, &mut row)?;
            Ok(row)
        };
        self.sliding
            .iter()
            .chain(&self.contacts)
            .map(gradient)
            .collect()
    }

    /// The surfaces through a point that the motion leaves, where the field jumps.
    pub fn left_at_once(&self, t: f64, z: &[f64]) -> Result<Vec<usize>, FieldError> {
        let (system, place) = (&self.extended.system, self.at(t, z));
        let mut h = vec![0.0; system.n_surfaces()];
        system.surfaces(&place, &mut h)?;
        let mut found = Vec::new();
        for (j, h) in h
            .iter()
            .enumerate()
            .filter(|(j, _)| self.mode.entries()[*j] != 0)
        {
            let is_there = h.abs() <= ROUNDING * system.surface_size(j, &place)?;
            if is_there && system.jumps_across(j, &self.signs, &self.sliding) {
                found.push(j);
            }
        }
        Ok(found)
    }

    /// The gradients of the rates of the surfaces in contact.
    fn rate_normals(&self, t: f64, z: &[f64]) -> Result<Vec<Vec<f64>>, FieldError> {
        let gradient = |&j: &usize| {
            let mut row = vec![0.0; z.len()];
            self.extended
                .system
                .rate_gradient(j, &self.at(t, z), &mut row)?;
            Ok(row)
        };
        self.contacts.iter().map(gradient).collect()
    }

    /// Takes from the columns what leads off the surfaces slid on, and off those in contact and their rates.
    pub fn project(&self, t: f64, z: &[f64], columns: &mut [Vec<f64>]) -> Result<(), FieldError> {
        self.project_beside(&[], t, z, columns)
    }

    /// The same, but for some surfaces.
    pub fn project_beside(
        &self,
        kept: &[usize],
        t: f64,
        z: &[f64],
        columns: &mut [Vec<f64>],
    ) -> Result<(), FieldError> {
        let surfaces = self.sliding.iter().chain(&self.contacts);
        let normals = surfaces.zip(self.normals(t, z)?);
        let mut normals: Vec<Vec<f64>> = normals
            .filter(|(j, _)| !kept.contains(j))
            .map(|(_, normal)| normal)
            .collect();
        normals.extend(self.rate_normals(t, z)?);
        let n = self.extended.n;
        let of_states: Vec<&[f64]> = normals.iter().map(|row| &row[..n]).collect();
        remove_along(&of_states, &normals, columns);
        Ok(())
    }
}

impl Slopes {
    /// The largest sum of the absolute values of a row of F_x.
    fn norm(&self, n: usize) -> f64 {
        let row = |r: usize| {
            let entries = self.rows.row(r).filter(|(c, _)| *c < n);
            entries.map(|(_, value)| value.abs()).sum::<f64>()
        };
        (0..n).map(row).fold(0.0, f64::max)
    }
}

/// Takes from every column its part along some directions of the states, so that it is normal to these gradients.
pub(super) fn remove_along(directions: &[&[f64]], normals: &[Vec<f64>], columns: &mut [Vec<f64>]) {
    let count = normals.len();
    if count == 0 {
        return;
    }
    let mut products = Matrix::zeros(count);
    for (i, normal) in normals.iter().enumerate() {
        for (k, direction) in directions.iter().enumerate() {
            products[(i, k)] = dot(normal, direction);
        }
    }
    for column in columns {
        // Twice: what is left after the first time is rounding.
        for _ in 0..2 {
            let rates: Vec<f64> = normals.iter().map(|normal| dot(normal, column)).collect();
            let Some(shares) = products.solve(&rates) else {
                column.fill(f64::NAN);
                break;
            };
            for (share, direction) in shares.iter().zip(directions) {
                let entries = column.iter_mut().zip(*direction);
                entries.for_each(|(entry, d)| *entry -= share * d);
            }
        }
    }
}

/// The product of as many entries as both have.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
