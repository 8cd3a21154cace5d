//! The explicit midpoint rule, as Dieci and Lopez use it.

use super::{Attempt, ErrorScale, Interpolant};
use crate::error::FieldError;
use crate::field::SmoothField;

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
    start_derivative: Vec<f64>,
    /// The derivative at the start is that of the field there, and not that of the step before at its end.
    is_started: bool,
    stage: Vec<f64>,
    middle: Vec<f64>,
    y1: Vec<f64>,
    end_derivative: Vec<f64>,
    /// The derivative at the end is that of the field there.
    is_end_evaluated: bool,
    interpolant: Interpolant,
}

impl Midpoint {
    /// A stepper for n states.
    pub fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Midpoint {
            start_derivative: zeros(),
            is_started: false,
            stage: zeros(),
            middle: zeros(),
            y1: zeros(),
            end_derivative: zeros(),
            is_end_evaluated: false,
            interpolant: Interpolant::powers(n, 2),
        }
    }

    /// Is the derivative at the start that of the field there?
    pub fn is_started(&self) -> bool {
        self.is_started
    }

    /// The derivative at the start of the step.
    pub fn start_derivative(&self) -> &[f64] {
        &self.start_derivative
    }

    /// The derivative at the start of the step, to be replaced.
    pub fn start_derivative_mut(&mut self) -> &mut [f64] {
        self.is_started = true;
        &mut self.start_derivative
    }

    /// The end of the attempted step.
    pub fn end(&self) -> &[f64] {
        &self.y1
    }

    /// The derivative at the end of the attempted step; in a region that of the extension.
    pub fn end_derivative(&self) -> &[f64] {
        &self.end_derivative
    }

    /// The continuous extension of the attempted step.
    pub fn interpolant(&self) -> &Interpolant {
        &self.interpolant
    }

    /// Attempts a step of length `dt`; `observe(number)` is called with the field after the evaluation in the middle, as
    /// 1, and where the end is evaluated there, as 6.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn attempt<F: SmoothField>(
        &mut self,
        (field, evaluates_end): (&mut F, bool),
        mut observe: impl FnMut(usize, &F),
        t: f64,
        y: &[f64],
        dt: f64,
        scale: &ErrorScale,
    ) -> Result<Attempt, FieldError> {
        (self.interpolant.t0, self.interpolant.dt) = (t, dt);
        advance(&mut self.stage, y, 0.5 * dt, &self.start_derivative);
        field.eval(t + 0.5 * dt, &mut self.stage, &mut self.middle)?;
        observe(1, field);
        advance(&mut self.y1, y, dt, &self.middle);
        self.is_end_evaluated = evaluates_end;
        if evaluates_end {
            field.eval(t + dt, &mut self.y1, &mut self.end_derivative)?;
            observe(6, field);
        } else {
            let rates = self.start_derivative.iter().zip(&self.middle);
            for (end, (start, middle)) in self.end_derivative.iter_mut().zip(rates) {
                *end = 2.0 * middle - start;
            }
        }
        let n = y.len();
        let rows = self.interpolant.coefficients_mut();
        for i in 0..n {
            let slope = dt * self.start_derivative[i];
            // The end may have been projected.
            (rows[i], rows[n + i], rows[2 * n + i]) = (y[i], slope, self.y1[i] - y[i] - slope);
        }
        let error = scale.norm(&rows[2 * n..], &self.y1);
        let is_finite = error.is_finite() && self.end_derivative.iter().all(|v| v.is_finite());
        Ok(if is_finite {
            Attempt::Error(error.powf(AS_OF_ORDER_FIVE))
        } else {
            Attempt::NotFinite
        })
    }

    /// The error of the extension at theta > 1 in units of the tolerance.
    pub fn extrapolation_error(&self, theta: f64, scale: &ErrorScale) -> f64 {
        let bend = &self.interpolant.coefficients()[2 * self.y1.len()..];
        let change: Vec<f64> = bend.iter().map(|c| theta * (theta - 1.0) * c).collect();
        scale.norm(&change, &self.y1)
    }

    /// Makes the end of the attempted step the start of the next one.
    pub fn accept(&mut self, y: &mut [f64]) {
        y.copy_from_slice(&self.y1);
        self.start_derivative.copy_from_slice(&self.end_derivative);
        self.is_started = self.is_end_evaluated;
    }
}

/// Writes y + dt k.
fn advance(out: &mut [f64], y: &[f64], dt: f64, k: &[f64]) {
    for (out, (y, k)) in out.iter_mut().zip(y.iter().zip(k)) {
        *out = y + dt * k;
    }
}
