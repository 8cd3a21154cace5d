//! DOP853: one step, its error estimate and its continuous extension of order 7.

use super::coefficients_dop853::{A, D, E3, E5, NODES, STABILITY_END};
use super::dopri5::{jumps_between, stiffness_of};
use super::{Attempt, ErrorScale, Interpolant, Step, Stepper};
use crate::error::FieldError;
use crate::error_scale::root_mean_square;
use crate::motion::{observer, Run, SmoothField};
use crate::powers::power;

/// The stages at which an observer is called.
const OBSERVED: [usize; 5] = [3, 5, 8, 9, 10];

/// The stages in order of time, the end of the step last.
const IN_TIME: [usize; 12] = [0, 1, 2, 3, 6, 4, 7, 5, 9, 8, 10, 12];

/// The error e counts as e^(5/8) in the control of the step size, which is made for methods of order 5: 1 stays 1, and
/// steps change as e^(-1/8).
const AS_OF_ORDER_FIVE: f64 = 5.0 / 8.0;

/// The method of Dormand and Prince of order 8 with twelve stages and estimates of order 5 and 3. Three more evaluations
/// make the continuous extension, for every step that is accepted.
///
/// Reference: Hairer, Norsett, Wanner, Solving ODEs I (1993), sections II.5 and II.10.
#[repr(C)]
#[derive(Clone)]
pub struct Dop853 {
    step: Step,
    /// Derivatives at the stages, at the end of the step, and at the stages of the extension.
    k: [Vec<f64>; 16],
    stage: Vec<f64>,
    /// The state of the last stage, which is at the end of the step too.
    last_stage: Vec<f64>,
}

impl Dop853 {
    /// A stepper for n states.
    pub fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Dop853 {
            k: std::array::from_fn(|_| zeros()),
            stage: zeros(),
            last_stage: zeros(),
            step: Step::new(n, Interpolant::powers(n, 7)),
        }
    }

    /// Attempts a step of length `dt`; `observe` is called with the field after the evaluations at five stages, and last
    /// at the end.
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
        self.k[0].copy_from_slice(&self.step.start_derivative);
        for i in 1..=12 {
            let (before, rest) = self.k.split_at_mut(i);
            let stage = if i == 12 {
                &mut self.step.end
            } else {
                &mut self.stage
            };
            fill_stage(stage, y, dt, A[i - 1], before);
            field.eval(t + NODES[i] * dt, stage, &mut rest[0])?;
            if OBSERVED.contains(&i) {
                observe(field);
            }
            if i == 11 {
                self.last_stage.copy_from_slice(&self.stage);
            }
        }
        self.step.end_derivative.copy_from_slice(&self.k[12]);
        observe(field);
        let error = self.error(y, dt, scale);
        let is_finite =
            error.is_finite() && self.k.iter().take(13).flatten().all(|v| v.is_finite());
        if !is_finite {
            return Ok(Attempt::NotFinite);
        }
        if error <= 1.0 {
            for i in 13..16 {
                let (before, rest) = self.k.split_at_mut(i);
                fill_stage(&mut self.stage, y, dt, A[i - 1], before);
                field.eval(t + NODES[i] * dt, &mut self.stage, &mut rest[0])?;
            }
            self.extend(y, dt);
        }
        Ok(Attempt::Error(power(error, AS_OF_ORDER_FIVE)))
    }

    /// |e5|^2 / (|e5|^2 + |e3|^2/100)^(1/2), the norms in units of the tolerance: e5 where the two agree about the order.
    fn error(&self, y: &[f64], dt: f64, scale: &ErrorScale) -> f64 {
        let norm = |weights: &[f64; 12]| {
            root_mean_square(y.len(), |i| {
                let terms = weights.iter().zip(&self.k);
                let change = dt * terms.map(|(w, k)| w * k[i]).sum::<f64>();
                change / scale.of(i, y[i], self.step.end[i])
            })
        };
        let (fifth, third) = (norm(&E5), norm(&E3));
        if fifth == 0.0 {
            return if third.is_finite() { 0.0 } else { third };
        }
        fifth * (fifth / libm::hypot(fifth, 0.1 * third))
    }

    /// y0 + x (F0 + u (F1 + x (F2 + u (F3 + x (F4 + u (F5 + x F6)))))) with u = 1 - x, in powers of x = theta.
    fn extend(&mut self, y: &[f64], dt: f64) {
        let n = y.len();
        let rows = self.step.interpolant.coefficients_mut();
        for i in 0..n {
            let (moved, first, last) = (self.step.end[i] - y[i], self.k[0][i], self.k[12][i]);
            let [f3, f4, f5, f6] = D.map(|weights| -> f64 {
                let terms = weights.iter().zip(&self.k);
                dt * terms.map(|(w, k)| w * k[i]).sum::<f64>()
            });
            let inner = [
                f5,
                f4,
                f3,
                2.0 * moved - dt * (last + first),
                dt * first - moved,
                moved,
                y[i],
            ];
            let mut powers = [f6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            for (step, constant) in inner.into_iter().enumerate() {
                // Times x, and then times 1 - x, in turns.
                for k in (0..=step).rev() {
                    powers[k + 1] = if step % 2 == 0 {
                        powers[k]
                    } else {
                        powers[k + 1] - powers[k]
                    };
                }
                powers[0] = if step % 2 == 0 { 0.0 } else { powers[0] } + constant;
            }
            for (k, power) in powers.into_iter().enumerate() {
                rows[k * n + i] = power;
            }
        }
    }

    /// The product of the step and the fastest rate of the field, from the two evaluations at the end of the step.
    pub fn stiffness(&self) -> Option<f64> {
        let states = [&self.step.end[..], &self.last_stage];
        stiffness_of(self.step.interpolant.dt, states, [&self.k[12], &self.k[11]])
    }
}

impl Stepper for Dop853 {
    fn step(&self) -> &Step {
        &self.step
    }

    fn step_mut(&mut self) -> &mut Step {
        &mut self.step
    }

    fn attempt(&mut self, at: &mut Run, dt: f64) -> Result<Option<Attempt>, FieldError> {
        let (field, observe) = (&mut at.motion.field, observer(&mut at.seen));
        let attempt = self.attempt_along(field, observe, at.t, &at.x, dt, &at.scale)?;
        Ok(Some(attempt))
    }

    /// The error of the extension at theta > 1 in units of the tolerance, from above: what its last term does there.
    fn extrapolation_error(&self, theta: f64, scale: &ErrorScale) -> f64 {
        let weight = theta.powi(4) * (1.0 - theta).powi(3);
        // The highest power has the factor -1 of that term.
        let last = &self.step.interpolant.coefficients()[7 * self.step.end.len()..];
        let change: Vec<f64> = last.iter().map(|c| weight * c).collect();
        scale.norm(&change, &self.step.end)
    }

    /// Does the field jump within the attempted step?
    fn field_jumps(&self) -> bool {
        jumps_between(&IN_TIME.map(|stage| &self.k[stage][..]))
    }

    fn is_limited_by_stability(&mut self, _: &mut Run) -> Result<Option<bool>, FieldError> {
        let product = self.stiffness();
        Ok(Some(product.is_some_and(|product| product > STABILITY_END)))
    }
}

/// Writes y + dt sum a_ij k_j.
fn fill_stage(stage: &mut [f64], y: &[f64], dt: f64, row: &[(usize, f64)], k: &[Vec<f64>]) {
    for (i, (stage, y)) in stage.iter_mut().zip(y).enumerate() {
        let sum: f64 = row.iter().map(|&(j, weight)| weight * k[j][i]).sum();
        *stage = y + dt * sum;
    }
}
