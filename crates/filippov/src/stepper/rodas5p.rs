//! Rodas5P: one step for stiff motions, its error estimate and its continuous extension.

use super::coefficients_rodas5p::{A, C, EXTENSION, GAMMA, NODES, TIME_SHARES};
use super::{Attempt, ErrorScale, Interpolant, Step};
use crate::error::FieldError;
use crate::motion::SmoothField;
use crate::sparse::SparseSolver;
use crate::system::Linearisation;

/// The Rosenbrock-Wanner method of order 5(4) with eight stages, L-stable and stiffly accurate,
///
///   (1/(gamma dt) - J) U_i = f(t + c_i dt, y + sum_j a_ij U_j) + sum_j (C_ij/dt) U_j + gamma_i dt df/dt,
///
/// with the exact Jacobian J at the start of the step. The last increment is the estimate of the error. The continuous
/// extension has order 4.
///
/// Reference: Steinebach, *BIT* 63:27 (2023); Hairer, Wanner, Solving ODEs II (1996), section IV.7.
pub struct Rodas5p {
    linearisation: Linearisation,
    /// The linearisation belongs to the current start.
    is_linearised: bool,
    solver: SparseSolver,
    /// U_i, and behind them the multipliers.
    increments: [Vec<f64>; 8],
    stage: Vec<f64>,
    step: Step,
    defect: Vec<f64>,
}

impl Rodas5p {
    /// A stepper for n states.
    pub fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Rodas5p {
            linearisation: Linearisation::dense(0),
            is_linearised: false,
            solver: SparseSolver::for_all_pivots(),
            increments: std::array::from_fn(|_| zeros()),
            stage: zeros(),
            step: Step::new(n, Interpolant::powers(n, 4)),
            defect: zeros(),
        }
    }

    /// The step that was attempted last.
    #[inline]
    pub fn step(&self) -> &Step {
        &self.step
    }

    /// Are the derivatives of the field at the start of the step known?
    pub fn is_linearised(&self) -> bool {
        self.is_linearised
    }

    /// Takes space for the derivatives of the field of a motion that starts.
    pub fn restart(&mut self, linearisation: Linearisation) {
        let size = linearisation.n_unknowns();
        self.increments.iter_mut().for_each(|u| u.resize(size, 0.0));
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

    /// The derivatives of the field at the start of the step.
    pub fn linearisation(&self) -> &Linearisation {
        &self.linearisation
    }

    /// The derivative at the start of the step, to be replaced.
    pub fn start_derivative_mut(&mut self) -> &mut [f64] {
        self.is_linearised = false;
        &mut self.step.start_derivative
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
    pub fn attempt<F: SmoothField>(
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

    /// The error of the extension at theta > 1 in units of the tolerance, from above: what its last term does there.
    pub fn extrapolation_error(&self, theta: f64, scale: &ErrorScale) -> f64 {
        let weight = (1.0 - theta) * theta.powi(3);
        let last = &self.step.interpolant.coefficients()[4 * self.step.end.len()..];
        let change: Vec<f64> = last.iter().map(|c| weight * c).collect();
        scale.norm(&change, &self.step.end)
    }

    /// Makes the end of the attempted step the start of the next one.
    pub fn accept(&mut self, y: &mut [f64]) {
        self.step.accept(y);
        self.is_linearised = false;
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
