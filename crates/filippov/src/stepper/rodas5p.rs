//! Rodas5P: one step for stiff motions, its error estimate and its continuous extension.

use std::sync::Arc;

use super::coefficients_rodas5p::{A, C, EXTENSION, GAMMA, NODES, TIME_SHARES};
use super::duties::Ready;
use super::{Attempt, ErrorScale, Interpolant, Step, Stepper};
use crate::error::FieldError;
use crate::motion::{observer, ModeField, Run, SmoothField};
use crate::sparse::{BorderedSolver, SparseRows};
use crate::system::{Linearisation, MotionJacobian};
use crate::tolerances::EPS;

/// The Rosenbrock-Wanner method of order 5(4) with eight stages, L-stable and stiffly accurate,
///
///   (1/(gamma dt) - J) U_i = f(t + c_i dt, y + sum_j a_ij U_j) + sum_j (C_ij/dt) U_j + gamma_i dt df/dt,
///
/// with the exact Jacobian J at the start of the step. The last increment is the estimate of the error. The continuous
/// extension has order 4.
///
/// Reference: Steinebach, *BIT* 63:27 (2023); Hairer, Wanner, Solving ODEs II (1996), section IV.7.
#[repr(C)]
#[derive(Clone)]
pub struct Rodas5p {
    step: Step,
    /// The derivatives of the motion by its expression graph; differences of its field if there are none.
    jacobian: Option<Arc<MotionJacobian>>,
    linearisation: Linearisation,
    /// The linearisation belongs to the current start.
    is_linearised: bool,
    solver: BorderedSolver,
    /// U_i, and behind them the multipliers.
    increments: [Vec<f64>; 8],
    stage: Vec<f64>,
    defect: Vec<f64>,
}

impl Rodas5p {
    /// A stepper for n states.
    pub fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Rodas5p {
            jacobian: None,
            linearisation: Linearisation::dense(0),
            is_linearised: false,
            solver: BorderedSolver::new(&SparseRows::new(0)),
            increments: std::array::from_fn(|_| zeros()),
            stage: zeros(),
            step: Step::new(n, Interpolant::powers(n, 4)),
            defect: zeros(),
        }
    }

    /// About how many numbers its matrices are: the Jacobian, and the factors with their pattern.
    pub fn n_in_matrices(&self) -> usize {
        6 * self.linearisation.rows().n_entries()
    }

    /// Takes space for the derivatives of the field of a motion that starts.
    pub fn restart(&mut self, linearisation: Linearisation) {
        let size = linearisation.n_unknowns();
        self.increments.iter_mut().for_each(|u| u.resize(size, 0.0));
        self.solver.restart(linearisation.rows());
        self.linearisation = linearisation;
        self.is_linearised = false;
    }

    /// Takes the derivatives of the field at the start of the step, which `fill` writes; returns whether they are
    /// finite.
    pub fn linearise(&mut self, fill: impl FnOnce(&mut Linearisation)) -> bool {
        fill(&mut self.linearisation);
        self.is_linearised = self.linearisation.is_finite();
        self.is_linearised
    }

    /// Factors the matrix of a step of length `dt`; returns whether it has an inverse.
    pub fn factor(&mut self, dt: f64) -> bool {
        let matrix = self.linearisation.shifted(1.0 / (GAMMA * dt));
        self.solver.factor(matrix).is_ok()
    }

    /// Attempts a step of length `dt`, for which the matrix was factored; `observe` is called with the field
    /// after the evaluations at the stages 2 to 6, counted from 1, and last at the end.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn attempt_along<F: SmoothField>(
        &mut self,
        field: &mut F,
        mut observe: impl FnMut(&F),
        t: f64,
        y: &[f64],
        dt: f64,
        scale: &ErrorScale,
    ) -> Result<Attempt, FieldError> {
        (self.step.interpolant.t0, self.step.interpolant.dt) = (t, dt);
        for i in 0..8 {
            let (before, rest) = self.increments.split_at_mut(i);
            let right = &mut rest[0];
            if i == 0 {
                right[..y.len()].copy_from_slice(&self.step.start_derivative);
            } else {
                fill_stage(&mut self.stage, y, before);
                let (time, rate) = (t + NODES[i] * dt, &mut right[..y.len()]);
                // The field beside the surfaces is the one whose derivatives are known, or that at the projection.
                if self.linearisation.is_exact() {
                    field.eval_unprojected(time, &mut self.stage, rate)?;
                } else {
                    field.eval(time, &mut self.stage, rate)?;
                }
                if i < 6 {
                    observe(field);
                }
            }
            right[y.len()..].fill(0.0);
            add_known(right, y.len(), before, i, dt);
            let share = TIME_SHARES[i] * dt;
            if share != 0.0 {
                let time = self.linearisation.time();
                right
                    .iter_mut()
                    .zip(time)
                    .for_each(|(right, time)| *right += share * time);
            }
            self.solver.solve(right);
        }
        fill_stage(&mut self.step.end, y, &self.increments);
        let error = scale.norm(&self.increments[7][..y.len()], &self.step.end);
        if !error.is_finite() {
            return Ok(Attempt::NotFinite);
        }
        field.eval(t + dt, &mut self.step.end, &mut self.step.end_derivative)?;
        observe(field);
        self.extend(y);
        let between = self.error_between(field, t, dt, scale)?;
        let error = error.max(between);
        Ok(if error.is_finite() {
            Attempt::Error(error)
        } else {
            Attempt::NotFinite
        })
    }

    /// The error of the extension at the middle of the step in units of the tolerance, (1/(gamma dt) - J)^-1 (f - p').
    ///
    /// In components that are fast compared with the step this is the distance from the manifold that they keep to,
    /// in the others about dt times the defect of the derivative. The estimate at the end of the step knows nothing of
    /// the former.
    fn error_between<F: SmoothField>(
        &mut self,
        field: &mut F,
        t: f64,
        dt: f64,
        scale: &ErrorScale,
    ) -> Result<f64, FieldError> {
        let n = self.step.end.len();
        self.step.interpolant.at(0.5, &mut self.stage);
        self.defect.resize(self.linearisation.n_unknowns(), 0.0);
        let rate = &mut self.defect[..n];
        if self.linearisation.is_exact() {
            field.eval_unprojected(t + 0.5 * dt, &mut self.stage, rate)?;
        } else {
            field.eval(t + 0.5 * dt, &mut self.stage, rate)?;
        }
        self.step.interpolant.derivative(0.5, &mut self.stage);
        rate.iter_mut().zip(&self.stage).for_each(|(f, p)| *f -= p);
        self.defect[n..].fill(0.0);
        self.solver.solve(&mut self.defect);
        Ok(scale.norm(&self.defect[..n], &self.step.end))
    }

    fn extend(&mut self, y: &[f64]) {
        let n = y.len();
        let rows = self.step.interpolant.coefficients_mut();
        for i in 0..n {
            let k = EXTENSION.map(|weights| -> f64 {
                let terms = weights.iter().zip(&self.increments);
                terms.map(|(w, u)| w * u[i]).sum()
            });
            rows[i] = y[i];
            rows[n + i] = self.step.end[i] - y[i] + k[0];
            rows[2 * n + i] = k[1] - k[0];
            rows[3 * n + i] = k[2] - k[1];
            rows[4 * n + i] = -k[2];
        }
    }

    /// Takes the motion that starts.
    pub(super) fn take(&mut self, at: &Run) {
        let by_graph = at.motion.has_canopy_field() && !at.motion.is_drawn_back();
        let jacobian = by_graph
            .then(|| at.system.motion_jacobian(at.motion.sliding()))
            .flatten();
        self.take_derivatives(jacobian, at.x.len());
    }

    fn take_derivatives(&mut self, jacobian: Option<Arc<MotionJacobian>>, n: usize) {
        self.restart(match &jacobian {
            Some(jacobian) => jacobian.linearisation(),
            None => Linearisation::dense(n),
        });
        self.jacobian = jacobian;
    }

    /// The signs of the mode, with the signs that stand for the multipliers at the start of the step.
    fn signs_and_multipliers(at: &mut Run) -> Result<Vec<f64>, FieldError> {
        let mut signs = at.motion.signs.to_vec();
        if at.motion.sliding.is_empty() {
            return Ok(signs);
        }
        let (mut x, mut rates) = (at.x.to_vec(), vec![0.0; at.x.len()]);
        at.motion.field.eval(at.t, &mut x, &mut rates)?;
        let multipliers = at.motion.multipliers();
        for (k, &j) in at.motion.sliding.iter().enumerate() {
            let place = at.motion.setting().at(at.t, &at.x);
            let ratio = at.system.stick_ratio(j, &place);
            signs[j] = ratio * multipliers.get(k).copied().unwrap_or(f64::NAN);
        }
        Ok(signs)
    }

    /// Derivatives by one difference per state and one in time. Where the field is not there on one side of the
    /// start the other is taken.
    fn linearise_by_differences(&mut self, at: &mut Run) -> Result<bool, FieldError> {
        let (t, n) = (at.t, at.x.len());
        let start = self.step.start_derivative.clone();
        let mut columns = vec![0.0; n * n];
        let mut at_rates = vec![0.0; n];
        let field = &mut at.motion.field;
        let mut difference = |i: Option<usize>, out: &mut [f64]| -> Result<(), FieldError> {
            let value = i.map_or(t, |i| at.x[i]);
            for side in [1.0, -1.0] {
                // Radau5's choice (Hairer, Wanner 1996, section IV.8).
                let moved = value + side * (EPS * value.abs().max(1e-5)).sqrt();
                let mut x = at.x.to_vec();
                let time = match i {
                    Some(i) => {
                        x[i] = moved;
                        t
                    }
                    None => moved,
                };
                field.eval(time, &mut x, &mut at_rates)?;
                for ((out, there), here) in out.iter_mut().zip(&at_rates).zip(&start) {
                    *out = (there - here) / (moved - value);
                }
                if out.iter().all(|v| v.is_finite()) {
                    break;
                }
            }
            Ok(())
        };
        for (i, column) in columns.chunks_exact_mut(n).enumerate() {
            difference(Some(i), column)?;
        }
        let mut in_time = vec![0.0; n];
        difference(None, &mut in_time)?;
        Ok(self.linearise(|out| {
            out.fill(|values, time| {
                for (place, value) in values.iter_mut().enumerate() {
                    *value = -columns[place % n * n + place / n];
                }
                time.copy_from_slice(&in_time);
            });
        }))
    }
}

impl Stepper for Rodas5p {
    fn step(&self) -> &Step {
        &self.step
    }

    fn step_mut(&mut self) -> &mut Step {
        &mut self.step
    }

    /// `None` if the matrix of the step has no inverse.
    #[cold]
    #[inline(never)]
    fn attempt(&mut self, at: &mut Run, dt: f64) -> Result<Option<Attempt>, FieldError> {
        at.stats.n_factorisations += 1;
        if !self.factor(dt) {
            return Ok(None);
        }
        let (field, observe) = (&mut at.motion.field, observer(&mut at.seen));
        let attempt = self.attempt_along(field, observe, at.t, &at.x, dt, &at.scale)?;
        let is_beside = self.linearisation.is_exact() && !at.motion.is_straight;
        if attempt == Attempt::NotFinite && is_beside {
            // The field may not be there beside a curved surface: at its projection it is.
            self.take_derivatives(None, at.x.len());
        }
        Ok(Some(attempt))
    }

    /// The error of the extension at theta > 1 in units of the tolerance, from above: what its last term does there.
    fn extrapolation_error(&self, theta: f64, scale: &ErrorScale) -> f64 {
        let weight = (1.0 - theta) * theta.powi(3);
        let last = &self.step.interpolant.coefficients()[4 * self.step.end.len()..];
        let change: Vec<f64> = last.iter().map(|c| weight * c).collect();
        scale.norm(&change, &self.step.end)
    }

    fn begin(&mut self, at: &mut Run) -> Ready {
        if !at.motion.resting.is_empty() {
            return Ready::NotThisMotion;
        }
        self.take(at);
        Ready::ANY
    }

    /// If redundant contacts share a load their equations do not determine the multipliers: there are no exact derivatives.
    fn started(&mut self, at: &mut Run) -> Ready {
        if self.jacobian.is_some() && at.motion.shares_load() {
            self.take_derivatives(None, at.x.len());
        }
        Ready::ANY
    }

    fn start_derivative_mut(&mut self) -> &mut [f64] {
        self.is_linearised = false;
        &mut self.step.start_derivative
    }

    /// Finds the derivatives at the start of the step. If they are not finite DOPRI5 takes the step.
    #[cold]
    #[inline(never)]
    fn prepare(&mut self, at: &mut Run) -> Result<Ready, FieldError> {
        if self.is_linearised {
            return Ok(Ready::ANY);
        }
        let begins_at_two_fold = match &at.motion.field {
            ModeField::Sliding(field) => field.is_at_two_fold(at.t),
            _ => false,
        };
        if begins_at_two_fold {
            // The equation of the multiplier is 0 = 0.
            return Ok(Ready::NotThisStep);
        }
        at.stats.n_jacobians += 1;
        let is_finite = match self.jacobian.clone() {
            Some(jacobian) => {
                let signs = Self::signs_and_multipliers(at)?;
                let (system, setting) = (at.system, at.motion.setting());
                let place = setting.with_signs(&signs).at(at.t, &at.x);
                self.linearise(|out| system.eval_jacobian(&jacobian, &place, out))
            }
            None => self.linearise_by_differences(at)?,
        };
        Ok(if is_finite {
            Ready::ANY
        } else {
            Ready::NotThisStep
        })
    }

    fn accept(&mut self, y: &mut [f64]) {
        self.step.accept(y);
        self.is_linearised = false;
    }

    /// The fast components of a stiff motion keep to a manifold. The extension lies beside it, within the tolerance, and there the
    /// field points in a direction that the motion does not have. The end of a step lies on the manifold.
    fn ends_at_events(&self) -> bool {
        true
    }
}

/// Writes y + sum a_ij U_j for the stage after these increments; after all of them it is the end of the step.
fn fill_stage(stage: &mut [f64], y: &[f64], increments: &[Vec<f64>]) {
    stage.copy_from_slice(y);
    let weights = A[increments.len().clamp(1, 5) - 1].iter().copied();
    for (weight, u) in weights.chain([1.0; 3]).zip(increments) {
        stage.iter_mut().zip(u).for_each(|(s, u)| *s += weight * u);
    }
}

/// Adds (C_ij/dt) U_j to the right-hand side of stage i.
fn add_known(right: &mut [f64], n: usize, before: &[Vec<f64>], i: usize, dt: f64) {
    if i == 0 {
        return;
    }
    for (weight, u) in C[i - 1].iter().zip(before) {
        let weight = weight / dt;
        let sums = right[..n].iter_mut().zip(u);
        sums.for_each(|(right, u)| *right += weight * u);
    }
}
