//! The field of a body in contact: h = 0 and h' = 0 at unilateral constraints, with sliding on other surfaces.

use filippov_expr::sort_few;
use smallvec::SmallVec;

use super::guard::Guards;
use super::{Guard, Motion, SmoothField};
use crate::cube::{is_scaling_stable, Limit, Matrix, Solutions};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::system::Actions;
use crate::system::{dot, eval_on_side, OwnSetting, PiecewiseSystem, Setting};
use crate::tolerances::{DEFINITE_PIVOT, DOUBTFUL, ROUNDING, VANISHING_GERM};

/// The field of contact,
///
///   f_s = f + sum_c nu_c W_c + sum_k mu_k B_k,
///
/// W_c the direction of the impulse of the impact at h_c = 0, in units of the acceleration h_c'' that it gives;
/// B_k the change of f from one side of h_k = 0 to the other. The multipliers make h_c'' and h_k' vanish: one
/// linear system. One contact alone gives f_s = f - (L_f^2 h / L_W L_f h) W.
///
/// Contact c lasts while nu_c > 0 (it pushes and does not pull), sliding while lambda_k = 2 mu_k - 1 lies in [-r, r],
/// r the ratio of static to kinetic friction, 1 for a Filippov system. Where some of the equations follow from others (bodies at rest that
/// are pressed together, each with friction) the multipliers that are not determined end together, when no choice of them is admissible.
#[derive(Clone)]
pub struct ContactField<'a> {
    system: &'a dyn PiecewiseSystem,
    actions: &'a Actions<'a>,
    /// The surfaces in contact, each with the side (+1 or -1) on which the body is free.
    contacts: Vec<(usize, f64)>,
    sliding: Vec<usize>,
    setting: OwnSetting,
    n_evaluations: u64,
    /// Did the equations of the last evaluation leave some of the multipliers open?
    shares_load: bool,
    /// nu, then mu, of the last evaluation.
    multipliers: Vec<f64>,
    /// The changes of the accelerations and rates by the multipliers, at the last evaluation.
    coupling: Matrix,
    /// The largest nu that would be rounding of the forces.
    noise: Vec<f64>,
    /// Ratio of static to kinetic friction at the surfaces slid on, at the last evaluation.
    ratios: Vec<f64>,
    /// nu of each contact, then r + lambda and r - lambda of each surface slid on, at the last evaluation.
    exits: Vec<f64>,
}

impl<'a> ContactField<'a> {
    /// Contact at those zero entries of the mode whose surface triggers an action and switches nothing, sliding
    /// on the others; `sides` are the sides on which the motion is, or was last; `discrete` are the discrete states.
    /// `None` without any contact.
    pub fn new(
        system: &'a dyn PiecewiseSystem,
        actions: &'a Actions<'a>,
        mode: &Mode,
        sides: &[i8],
        discrete: &[f64],
    ) -> Option<Self> {
        let (mut contacts, mut sliding) = (Vec::new(), Vec::new());
        for j in mode.sliding_set() {
            match actions.at_surface(j) {
                Some(_) if !system.switches_at(j) => {
                    contacts.push((j, f64::from(actions.trigger_side(j, sides[j]))));
                }
                _ => sliding.push(j),
            }
        }
        let mut signs = mode.signs();
        contacts.iter().for_each(|&(j, side)| signs[j] = side);
        (!contacts.is_empty()).then(|| ContactField {
            system,
            actions,
            contacts,
            sliding,
            setting: OwnSetting::new(Setting::new(&signs, discrete)),
            n_evaluations: 0,
            shares_load: false,
            multipliers: Vec::new(),
            coupling: Matrix::zeros(0),
            noise: Vec::new(),
            ratios: Vec::new(),
            exits: Vec::new(),
        })
    }

    /// Takes over the discrete states that an action left.
    pub(super) fn set_discrete(&mut self, q: &[f64]) {
        self.setting.set_discrete(q);
    }

    /// The surfaces in contact.
    pub fn contacts(&self) -> impl Iterator<Item = usize> + '_ {
        self.contacts.iter().map(|(j, _)| *j)
    }

    /// The surfaces in contact with the accelerations nu that hold the bodies, at the last evaluation.
    pub fn accelerations(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let held = self.contacts().zip(&self.multipliers);
        held.map(|(j, nu)| (j, *nu))
    }

    /// How far from zero a guard with this index may be by rounding, at the last evaluation.
    pub fn noise_of_exit(&self, index: usize) -> f64 {
        match index.checked_sub(self.contacts.len()) {
            None => self.noise[index],
            Some(end) => DOUBTFUL * self.ratios[end / 2],
        }
    }

    /// Do contacts and what is slid on share their load at the last evaluation, in parts that are not determined?
    pub fn shares_load(&self) -> bool {
        self.shares_load
    }

    /// Do the fields around the surfaces slid on lead to them, with the forces of the contacts?
    pub fn attracts(&self) -> bool {
        // What follows from others is held with them.
        let mut telling = Vec::new();
        for i in 0..self.coupling.n() {
            telling.push(i);
            if !is_regular(&self.coupling.principal(&telling)) {
                telling.pop();
            }
        }
        let (contacts, sliding): (Vec<usize>, Vec<usize>) =
            telling.iter().partition(|&&i| i < self.contacts.len());
        let closed = self.coupling.principal(&contacts);
        let mut rates = Matrix::zeros(sliding.len());
        for (k, &column) in sliding.iter().enumerate() {
            let by_sign: Vec<f64> = contacts
                .iter()
                .map(|&c| self.coupling[(c, column)])
                .collect();
            let Some(forces) = closed.solve(&by_sign) else {
                return false;
            };
            for (i, &row) in sliding.iter().enumerate() {
                let of_forces = contacts.iter().zip(&forces);
                let of_forces = of_forces.map(|(&c, force)| self.coupling[(row, c)] * force);
                rates[(i, k)] = self.coupling[(row, column)] - of_forces.sum::<f64>();
            }
        }
        sliding.is_empty() || is_scaling_stable(&rates)
    }

    /// The multipliers, from their equations; where these do not determine them, those with the largest reserves. None where there are
    /// no solutions, or where they give several motions.
    fn solve(&mut self, rates: &[f64], directions: &[Vec<f64>]) -> Option<Vec<f64>> {
        let solutions = Solutions::of(&self.coupling, rates);
        let shared = solutions.filter(|solutions| !solutions.directions.is_empty());
        self.shares_load = shared.is_some();
        match shared {
            Some(solutions) => {
                let is_one = moves_nothing(&solutions, directions);
                is_one.then(|| solutions.most_reserved(&self.limits()))?
            }
            None => self.coupling.solve(rates).map(SmallVec::into_vec),
        }
    }

    /// The limits of the multipliers: a force is measured by the accelerations around.
    fn limits(&self) -> Vec<Limit> {
        let n = self.contacts.len();
        let force = |(multiplier, noise): (usize, &f64)| Limit {
            multiplier,
            factor: VANISHING_GERM / noise.max(f64::MIN_POSITIVE),
            constant: 0.0,
        };
        let forces = self.noise.iter().enumerate().map(force);
        // r + lambda and r - lambda, lambda = 2 mu - 1.
        let signs = self.ratios.iter().enumerate().flat_map(|(k, r)| {
            [(2.0, r - 1.0), (-2.0, r + 1.0)].map(|(factor, constant)| Limit {
                multiplier: n + k,
                factor,
                constant,
            })
        });
        forces.chain(signs).collect()
    }

    /// The directions W, in units of the acceleration that they give on the free side; NaN where the map has no
    /// effect on the velocity.
    fn impulses(&self, t: f64, x: &[f64], rows: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, FieldError> {
        let mut impulses = Vec::with_capacity(rows.len());
        for (&(j, side), row) in self.contacts.iter().zip(rows) {
            // A body approaches: the map may have a kink at zero speed.
            let approach: Vec<f64> = row.iter().map(|r| -side * r).collect();
            let (mut moved, mut change) = (approach.clone(), vec![0.0; x.len()]);
            for action in self.actions.from_side(j, if side < 0.0 { -1 } else { 1 }) {
                let Setting { signs, q } = self.setting.get();
                action.map.impulse(t, x, &moved, signs, q, &mut change)?;
                moved.iter_mut().zip(&change).for_each(|(m, c)| *m += c);
            }
            let mut w: Vec<f64> = moved.iter().zip(&approach).map(|(m, a)| m - a).collect();
            let strength = dot(row, &w);
            let size = (dot(row, row) * dot(&w, &w)).sqrt();
            let scale = if strength.abs() > DOUBTFUL * size {
                side / strength
            } else {
                f64::NAN
            };
            w.iter_mut().for_each(|w| *w *= scale);
            impulses.push(w);
        }
        Ok(impulses)
    }

    /// How a function with this gradient changes when one of the contacts opens, for each of them.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn rates_when_opened(
        &self,
        t: f64,
        x: &[f64],
        row: &[f64],
    ) -> Result<Vec<f64>, FieldError> {
        let mut rows = Vec::with_capacity(self.contacts.len());
        for &(j, _) in &self.contacts {
            let mut own = vec![0.0; x.len()];
            self.system
                .rate_gradient(j, &self.setting.at(t, x), &mut own)?;
            rows.push(own);
        }
        let impulses = self.impulses(t, x, &rows)?;
        Ok(impulses.iter().map(|w| dot(row, w)).collect())
    }

    /// The field where every surface slid on has the sign -1, and its changes to the other side of each.
    fn sides(&mut self, t: f64, x: &[f64]) -> Result<(Vec<f64>, Vec<Vec<f64>>), FieldError> {
        let n = x.len();
        let mut signs = self.setting.signs.clone();
        let place = self.setting.at(t, x);
        self.sliding.iter().for_each(|&j| signs[j] = -1.0);
        let mut base = vec![0.0; n];
        self.n_evaluations += eval_on_side(self.system, &place.with_signs(&signs), &mut base)?;
        let mut changes = Vec::with_capacity(self.sliding.len());
        for &j in &self.sliding {
            signs[j] = 1.0;
            let mut change = vec![0.0; n];
            self.n_evaluations +=
                eval_on_side(self.system, &place.with_signs(&signs), &mut change)?;
            signs[j] = -1.0;
            change.iter_mut().zip(&base).for_each(|(c, b)| *c -= b);
            changes.push(change);
        }
        Ok((base, changes))
    }
}

/// Products of the rows with the directions.
fn gram(rows: &[Vec<f64>], directions: &[Vec<f64>]) -> Matrix {
    let mut matrix = Matrix::zeros(rows.len());
    for (i, row) in rows.iter().enumerate() {
        for (k, direction) in directions.iter().enumerate() {
            matrix[(i, k)] = dot(row, direction);
        }
    }
    matrix
}

/// Have the equations of this matrix one solution each?
fn is_regular(matrix: &Matrix) -> bool {
    let solutions = Solutions::of(matrix, &vec![0.0; matrix.n()]);
    solutions.is_some_and(|solutions| solutions.directions.is_empty())
}

/// Do all solutions give the same motion?
fn moves_nothing(solutions: &Solutions, of_multipliers: &[Vec<f64>]) -> bool {
    let n_states = of_multipliers.first().map_or(0, Vec::len);
    solutions.directions.iter().all(|direction| {
        (0..n_states).all(|i| {
            let terms = direction
                .iter()
                .zip(of_multipliers)
                .map(|(d, of)| d * of[i]);
            let (sum, size) = terms.fold((0.0, 0.0), |(sum, size), term| {
                (sum + term, size + term.abs())
            });
            sum.abs() <= DEFINITE_PIVOT.sqrt() * size
        })
    })
}

impl Motion for ContactField<'_> {
    /// The forces of the contacts, then the ends of the multipliers.
    fn guards(&self) -> Guards {
        let ends = self.sliding.iter().flat_map(|&j| Guard::ends(j));
        self.contacts().map(Guard::Force).chain(ends).collect()
    }

    fn last_exits(&self) -> &[f64] {
        &self.exits
    }

    /// lambda / r of each surface slid on, NaN for those in contact, in the order of the surfaces.
    fn multipliers(&self) -> SmallVec<[f64; 2]> {
        let mut all: Vec<(usize, f64)> = self.contacts().map(|j| (j, f64::NAN)).collect();
        let mu = self.multipliers[self.contacts.len()..].iter();
        let lambdas = mu.zip(&self.ratios).map(|(mu, r)| (2.0 * mu - 1.0) / r);
        all.extend(self.sliding.iter().copied().zip(lambdas));
        sort_few(&mut all, |a, b| a.0 < b.0);
        all.into_iter().map(|(_, lambda)| lambda).collect()
    }

    /// Moves `x` onto all surfaces, by their gradients, and the velocities of the contacts to zero, along their
    /// impulses.
    fn project(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        let set: Vec<usize> = self
            .contacts()
            .chain(self.sliding.iter().copied())
            .collect();
        let mut projector = super::Projector::new(x.len(), self.system.n_surfaces());
        projector.project_onto(self.system, &set, t, x, self.setting.get())?;
        let n = x.len();
        for _ in 0..2 {
            let (mut rows, mut rates) = (Vec::new(), Vec::new());
            let mut is_still = true;
            for &(j, _) in &self.contacts {
                let mut row = vec![0.0; n];
                let rate = self
                    .system
                    .rate_gradient(j, &self.setting.at(t, x), &mut row)?;
                is_still &= rate.rate.abs() <= ROUNDING * rate.magnitude;
                rates.push(rate.rate);
                rows.push(row);
            }
            if is_still {
                break;
            }
            let impulses = self.impulses(t, x, &rows)?;
            let Some(shifts) = gram(&rows, &impulses).solve(&rates) else {
                break;
            };
            for (impulse, shift) in impulses.iter().zip(shifts) {
                x.iter_mut().zip(impulse).for_each(|(x, w)| *x -= shift * w);
            }
        }
        Ok(())
    }
}

impl SmoothField for ContactField<'_> {
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        self.project(t, x)?;
        let (base, changes) = self.sides(t, x)?;
        let n = x.len();
        let (mut rows, mut rates) = (Vec::new(), Vec::new());
        self.noise.clear();
        for &(j, _) in &self.contacts {
            let mut row = vec![0.0; n];
            let rate = self
                .system
                .rate_gradient(j, &self.setting.at(t, x), &mut row)?;
            rates.push(-(rate.time + dot(&row, &base)));
            let size = rate.time.abs() + (dot(&row, &row) * dot(&base, &base)).sqrt();
            self.noise.push(VANISHING_GERM * size);
            rows.push(row);
        }
        let mut directions = self.impulses(t, x, &rows)?;
        for &j in &self.sliding {
            let mut row = vec![0.0; n];
            let time = self.system.gradient(j, &self.setting.at(t, x), &mut row)?;
            rates.push(-(time + dot(&row, &base)));
            rows.push(row);
        }
        directions.extend(changes);
        let ratios = self.sliding.iter();
        self.ratios = ratios
            .map(|&j| self.system.stick_ratio(j, &self.setting.at(t, x)))
            .collect();
        self.coupling = gram(&rows, &directions);
        self.multipliers = match self.solve(&rates, &directions) {
            Some(found) => found,
            None => vec![f64::NAN; rows.len()],
        };
        let (nu, mu) = self.multipliers.split_at(self.contacts.len());
        let lambdas = mu.iter().map(|mu| 2.0 * mu - 1.0);
        let sides = lambdas.zip(&self.ratios).flat_map(|(l, r)| [r + l, r - l]);
        self.exits.clear();
        self.exits.extend(nu.iter().copied().chain(sides));
        dx.copy_from_slice(&base);
        for (multiplier, direction) in self.multipliers.iter().zip(&directions) {
            dx.iter_mut()
                .zip(direction)
                .for_each(|(dx, d)| *dx += multiplier * d);
        }
        Ok(())
    }

    fn n_evaluations(&self) -> u64 {
        self.n_evaluations
    }
}
