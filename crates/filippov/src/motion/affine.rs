//! The law of sliding on many surfaces where the field is affine in their signs.

use super::canopy::RootWatch;
use super::ties::are_parallel;
use crate::cube::{solve_relay, uncoupled_margins, Matrix, RelayProblem, SharedLoad, SharedLoads};
use crate::error::FieldError;
use crate::sparse::SparseRows;
use crate::system::{AffineParts, AffineSigns, OwnSetting, PiecewiseSystem, Setting};
use crate::tolerances::{MOST_MEETING, ROUNDING};

/// Sweeps over all surfaces of a projection; gradients that are orthogonal need one.
const MOST_SWEEPS: usize = 50;

/// Multipliers by one sparse linear system, however many surfaces there are.
#[derive(Clone)]
pub struct AffineLaw<'a> {
    system: &'a dyn AffineSigns,
    parts: AffineParts,
    /// The signs of the last evaluation: those of the mode, with the multipliers last found.
    setting: OwnSetting,
    h: Vec<f64>,
    /// The scaling of the surfaces, for the stability of the root of three and more.
    kappa: Vec<f64>,
    /// The sizes of the rows of N for two surfaces, when they were first looked at: in these units its determinant goes
    /// through zero where a row does.
    sizes: Option<[f64; 2]>,
    /// The exit functions of the root that were computed last, and the values of N that they belong to.
    known_ends: Option<(Vec<f64>, [f64; 2])>,
    /// The surfaces in small groups that do not act on one another. `ends` fills the list when it first needs it.
    in_small_groups: Option<Vec<usize>>,
    /// Were the multipliers the only ones at some evaluation since the motion began?
    was_regular: bool,
    /// No two gradients have a state in common.
    is_orthogonal: bool,
    /// The unit in which each state is moved; empty: one for all.
    units: Vec<f64>,
    multipliers: Vec<f64>,
    /// The multipliers last found are not the only ones: redundant contacts share their load.
    shared: Option<SharedLoad>,
    loads: Option<SharedLoads>,
}

impl<'a> AffineLaw<'a> {
    /// The law for these surfaces; `None` if the field is not affine in their signs.
    pub fn new(
        system: &'a dyn PiecewiseSystem,
        set: &[usize],
        setting: Setting<'_>,
    ) -> Option<Self> {
        let affine = system.affine_signs()?;
        let mut setting = OwnSetting::new(setting);
        set.iter().for_each(|&j| setting.signs[j] = 0.0);
        let parts = affine.affine_parts(set)?;
        Some(AffineLaw {
            system: affine,
            is_orthogonal: parts.gradients.has_disjoint_rows(),
            parts,
            known_ends: None,
            in_small_groups: None,
            was_regular: false,
            units: Vec::new(),
            setting,
            h: vec![0.0; system.n_surfaces()],
            kappa: vec![1.0; set.len()],
            sizes: None,
            multipliers: vec![f64::NAN; set.len()],
            shared: None,
            loads: None,
        })
    }

    /// Becomes the law for other surfaces; `false`, and it is of no use, if the field is not affine in their signs.
    pub fn refit(&mut self, set: &[usize], setting: Setting<'_>) -> bool {
        if !self.system.refit_affine_parts(set, &mut self.parts) {
            return false;
        }
        self.is_orthogonal = self.parts.gradients.has_disjoint_rows();
        self.kappa.resize(set.len(), 1.0);
        self.multipliers.resize(set.len(), f64::NAN);
        self.restart(setting);
        true
    }

    /// Sets the scaling of the surfaces.
    pub fn set_scaling(&mut self, kappa: &[f64]) {
        self.kappa.copy_from_slice(kappa);
        self.known_ends = None;
    }

    /// Starts anew on the same surfaces, with the signs of the others.
    pub fn restart(&mut self, setting: Setting<'_>) {
        self.setting.set(setting);
        let surfaces = self.parts.surfaces();
        surfaces.iter().for_each(|&j| self.setting.signs[j] = 0.0);
        self.parts.restart();
        self.sizes = None;
        self.in_small_groups = None;
        self.multipliers.fill(f64::NAN);
        self.shared = None;
        self.begin();
    }

    /// Sets the units in which states are moved; empty: one for all.
    pub(super) fn set_units(&mut self, units: &[f64]) {
        self.units = units.to_vec();
    }

    /// A motion begins.
    pub fn begin(&mut self) {
        self.known_ends = None;
        self.was_regular = false;
    }

    /// Takes over the discrete states that an action left.
    pub(super) fn set_discrete(&mut self, q: &[f64]) {
        self.setting.set_discrete(q);
    }

    /// Writes the sliding field at (t, x); NaN, also in the multipliers, where it is not determined. Returns the
    /// number of evaluations of the right-hand side.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn eval(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<u64, FieldError> {
        let evaluations = self.parts.evaluate(self.system, &self.setting.at(t, x))?;
        self.shared = None;
        if self.parts.slide(dx).is_ok() {
            self.multipliers.copy_from_slice(self.parts.multipliers());
            self.was_regular = true;
        } else {
            self.share(dx);
        }
        for (&j, &lambda) in self.parts.surfaces().iter().zip(&self.multipliers) {
            // The nearer the evaluation is to the multipliers, the less cancels.
            self.setting.signs[j] = if lambda.is_finite() { lambda } else { 0.0 };
        }
        Ok(evaluations)
    }

    /// The field and multipliers where those are not the only ones. All that make the motion slide give the same
    /// field; those of least norm may be outside of [-1, 1] while others are inside.
    fn share(&mut self, dx: &mut [f64]) {
        let surfaces = self.parts.surfaces();
        let here: Vec<f64> = surfaces.iter().map(|&j| self.setting.signs[j]).collect();
        let normal = self.parts.normal();
        if self
            .loads
            .as_ref()
            .is_none_or(|loads| loads.normal() != normal)
        {
            self.loads = SharedLoads::new(normal);
        }
        let loads = self.loads.as_mut();
        self.shared = loads.and_then(|loads| loads.at(self.parts.rates(), &here));
        if let (Some(shared), Some(loads)) = (&mut self.shared, &self.loads) {
            follow_leaders(&self.parts.gradients, loads.idle(), &mut shared.signs);
        }
        let Some(shared) = &self.shared else {
            dx.fill(f64::NAN);
            self.multipliers.fill(f64::NAN);
            return;
        };
        self.parts.combine(&shared.signs, dx);
        self.multipliers.copy_from_slice(&shared.signs);
        let entries = || shared.reserves.iter().zip(&shared.signs);
        if entries().any(|(reserve, sign)| reserve.is_some() && sign.abs() > 1.0) {
            let problem = RelayProblem {
                nu: &self.parts.nu(),
                n: self.parts.normal(),
                noise: self.system.noise_of_rates(),
            };
            if let Ok(inside) = solve_relay(&problem, &vec![0; here.len()]) {
                for (place, reserve) in shared.reserves.iter().enumerate() {
                    if reserve.is_some() {
                        self.multipliers[place] = inside.signs[place];
                    }
                }
            }
        }
    }

    /// The multipliers last found.
    pub fn multipliers(&self) -> &[f64] {
        &self.multipliers
    }

    /// For the multiplier of a contact that shares its load with others, what is left of their strength
    /// ([`SharedLoad`]); `None` if it is the only one.
    pub fn reserve(&self, place: usize) -> Option<f64> {
        self.shared.as_ref()?.reserves[place]
    }

    /// Do redundant contacts share their load?
    pub fn is_shared(&self) -> bool {
        self.shared.is_some()
    }

    /// The exit functions of the root, as those of the canopy: the determinant of N with the sign of a stable one,
    /// and the stability ([`RootWatch`]). Of many surfaces that act on one another they are not asked for: the friction of many
    /// bodies is stable for good. Contacts that share their load from the start of the motion have no determinant; where the
    /// multipliers were the only ones before, it vanishes.
    pub(super) fn ends(&mut self, watch: &mut RootWatch) -> [f64; 2] {
        if self.is_shared() && !self.was_regular {
            return [1.0, 1.0];
        }
        let values = self.parts.normal().values();
        let known = self.known_ends.as_ref().filter(|known| known.0 == values);
        if let Some((_, ends)) = known {
            return *ends;
        }
        let mut of = self.known_ends.take().unwrap_or_default().0;
        of.clear();
        of.extend_from_slice(values);
        let ends = self.present_ends(watch);
        self.known_ends = Some((of, ends));
        ends
    }

    /// Those of the last evaluation.
    fn present_ends(&mut self, watch: &mut RootWatch) -> [f64; 2] {
        let (normal, m) = (self.parts.normal(), self.parts.surfaces().len());
        if m > 2 && normal.is_diagonal() {
            let entries = || (0..m).map(|i| self.kappa[i] * normal.diagonal(i));
            let unit = watch.unit(entries().fold(0.0, |size, v| v.abs().max(size)));
            return uncoupled_margins(entries().map(|v| v * unit));
        }
        if m > MOST_MEETING {
            let chosen = self
                .in_small_groups
                .get_or_insert_with(|| normal.in_small_blocks(MOST_MEETING));
            if chosen.is_empty() {
                return [1.0, 1.0];
            }
            let kappa: Vec<f64> = chosen.iter().map(|&i| self.kappa[i]).collect();
            return watch.ends((&dense(&normal.principal(chosen)), true), &kappa);
        }
        let jacobian = dense(normal);
        if m > 2 {
            return watch.ends((&jacobian, false), &self.kappa);
        }
        let size = |i: usize| {
            let entries = normal.row(i).map(|(_, v)| v.abs());
            entries.fold(f64::MIN_POSITIVE, f64::max)
        };
        let sizes = *self.sizes.get_or_insert_with(|| [size(0), size(1)]);
        let unit = jacobian.with_rows_scaled(&sizes.map(|size| 1.0 / size));
        [unit.determinant(), -unit[(0, 0)].min(unit[(1, 1)])]
    }

    /// N = grad h B, where it is known and the same all along the motion.
    pub fn steady_normal(&self) -> Option<&SparseRows> {
        self.parts.is_settled().then(|| self.parts.normal())
    }

    /// Does one sweep of [`project`](Self::project) do, with gradients that are known for good?
    pub fn projects_at_once(&self) -> bool {
        self.is_orthogonal && self.parts.is_settled()
    }

    /// Moves `x` onto all surfaces, one after the other along their gradients, until all |h| are at the level of
    /// rounding (Kaczmarz's method). The gradients are those of the last evaluation.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn project(
        &mut self,
        t: f64,
        x: &mut [f64],
        setting: Setting<'_>,
    ) -> Result<(), FieldError> {
        // The second sweep takes away what rounding left.
        let most = if self.projects_at_once() {
            2
        } else {
            MOST_SWEEPS
        };
        for _ in 0..most {
            self.system.surfaces(&setting.at(t, x), &mut self.h)?;
            let mut is_near = true;
            let gradients = &self.parts.gradients;
            // Moves of earlier rows change h of later ones: to first order by their common states.
            let start = (!self.is_orthogonal).then(|| x.to_vec());
            for (row, &j) in self.parts.surfaces().iter().enumerate() {
                let moved = start.as_ref().map_or(0.0, |start| {
                    let entries = gradients.row(row);
                    entries.map(|(i, g)| g * (x[i] - start[i])).sum::<f64>()
                });
                let h = self.h[j] + moved;
                if h == 0.0 || h.abs() <= 0.25 * ROUNDING * gradients.magnitude(row, x) {
                    continue;
                }
                let unit = |i: usize| self.units.get(i).copied().unwrap_or(1.0);
                let entries = || gradients.row(row).map(|(i, g)| (i, g * unit(i)));
                let square: f64 = entries().map(|(_, g)| g * g).sum();
                if square == 0.0 {
                    continue;
                }
                is_near = false;
                entries().for_each(|(i, g)| x[i] -= g * unit(i) * h / square);
            }
            if is_near {
                break;
            }
        }
        Ok(())
    }
}

fn dense(normal: &SparseRows) -> Matrix {
    let mut matrix = Matrix::zeros(normal.n_rows());
    for i in 0..normal.n_rows() {
        normal.row(i).for_each(|(j, v)| matrix[(i, j)] = v);
    }
    matrix
}

/// Gives surfaces whose signs act on no rate the multipliers of those in whose place they are, one surface being there as Filippov has
/// it: tangential components may jump with either sign.
fn follow_leaders(gradients: &SparseRows, idle: &[usize], signs: &mut [f64]) {
    let product = |i: usize, k: usize| -> f64 {
        let other = |column: usize| gradients.row(k).find(|entry| entry.0 == column);
        let pairs = gradients
            .row(i)
            .filter_map(|(column, v)| Some(v * other(column)?.1));
        pairs.sum()
    };
    for &i in idle {
        let leads = |k: &usize| {
            let squares = product(i, i) * product(*k, *k);
            squares > 0.0 && are_parallel(product(i, *k), squares)
        };
        let mut others = (0..signs.len()).filter(|k| !idle.contains(k));
        if let Some(leader) = others.find(leads) {
            signs[i] = product(i, leader).signum() * signs[leader];
        }
    }
}
