//! The explicit midpoint rule, as Dieci and Lopez use it.

use super::{Attempt, ErrorScale, Interpolant, Step};
use crate::error::FieldError;
use crate::motion::SmoothField;

/// The error e counts as e^(5/2) in the control of the step size, which is made for methods of order 5: 1 stays 1, and
/// steps change as e^(-1/2).
const AS_OF_ORDER_FIVE: f64 = 5.0 / 2.0;

/// The explicit midpoint rule of order 2 with its continuous extension of the same order,
///
///   x02 = x0 + dt/2 f(x0),    x1(sigma) = x0 + sigma ((1 - sigma/dt) f(x0) + sigma/dt f(x02)),    sigma in [0, dt].
///
/// In a region the field is evaluated at x0 and x02 only, not at the end, which may lie beyond a surface. The error is
/// estimated by the distance to Euler's method.
///
/// Reference: Dieci, Lopez, *SIAM J. Numer. Anal.* 47 (2009), section 5.
pub struct Midpoint {
    /// The derivative at the start is that of the field there, and not that of the step before at its end.
    is_started: bool,
    stage: Vec<f64>,
    middle: Vec<f64>,
    step: Step,
    /// The derivative at the end is that of the field there.
    is_end_evaluated: bool,
}

impl Midpoint {
    /// A stepper for n states.
    pub fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Midpoint {
            is_started: false,
            stage: zeros(),
            middle: zeros(),
            step: Step::new(n, Interpolant::powers(n, 2)),
            is_end_evaluated: false,
        }
    }

    /// The step that was attempted last.
    #[inline]
    pub fn step(&self) -> &Step {
        &self.step
    }

    /// Is the derivative at the start that of the field there?
    pub fn is_started(&self) -> bool {
        self.is_started
    }

    /// The derivative at the start of the step, to be replaced.
    pub fn start_derivative_mut(&mut self) -> &mut [f64] {
        self.is_started = true;
        &mut self.step.start_derivative
    }

    /// Attempts a step of length `dt`; `observe` is called with the field after the evaluation in the middle, and where
    /// the end is evaluated, last there.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn attempt<F: SmoothField>(
        &mut self,
        (field, evaluates_end): (&mut F, bool),
        mut observe: impl FnMut(&F),
        t: f64,
        y: &[f64],
        dt: f64,
        scale: &ErrorScale,
    ) -> Result<Attempt, FieldError> {
        (self.step.interpolant.t0, self.step.interpolant.dt) = (t, dt);
        advance(&mut self.stage, y, 0.5 * dt, &self.step.start_derivative);
        field.eval(t + 0.5 * dt, &mut self.stage, &mut self.middle)?;
        observe(field);
        advance(&mut self.step.end, y, dt, &self.middle);
        self.is_end_evaluated = evaluates_end;
        if evaluates_end {
            field.eval(t + dt, &mut self.step.end, &mut self.step.end_derivative)?;
            observe(field);
        } else {
            let rates = self.step.start_derivative.iter().zip(&self.middle);
            for (end, (start, middle)) in self.step.end_derivative.iter_mut().zip(rates) {
                *end = 2.0 * middle - start;
            }
        }
        let n = y.len();
        let rows = self.step.interpolant.coefficients_mut();
        for i in 0..n {
            let slope = dt * self.step.start_derivative[i];
            // The end may have been projected.
            (rows[i], rows[n + i], rows[2 * n + i]) =
                (y[i], slope, self.step.end[i] - y[i] - slope);
        }
        let error = scale.norm(&rows[2 * n..], &self.step.end);
        let is_finite = error.is_finite() && self.step.end_derivative.iter().all(|v| v.is_finite());
        Ok(if is_finite {
            Attempt::Error(error.powf(AS_OF_ORDER_FIVE))
        } else {
            Attempt::NotFinite
        })
    }

    /// The error of the extension at theta > 1 in units of the tolerance.
    pub fn extrapolation_error(&self, theta: f64, scale: &ErrorScale) -> f64 {
        let bend = &self.step.interpolant.coefficients()[2 * self.step.end.len()..];
        let change: Vec<f64> = bend.iter().map(|c| theta * (theta - 1.0) * c).collect();
        scale.norm(&change, &self.step.end)
    }

    /// Makes the end of the attempted step the start of the next one.
    pub fn accept(&mut self, y: &mut [f64]) {
        self.step.accept(y);
        self.is_started = self.is_end_evaluated;
    }
}

/// Writes y + dt k.
fn advance(out: &mut [f64], y: &[f64], dt: f64, k: &[f64]) {
    for (out, (y, k)) in out.iter_mut().zip(y.iter().zip(k)) {
        *out = y + dt * k;
    }
}
