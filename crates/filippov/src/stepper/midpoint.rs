//! The explicit midpoint rule, as Dieci and Lopez use it.

use super::{Attempt, ErrorScale, Interpolant, Step, Stepper};
use crate::error::FieldError;
use crate::locate::{refine, Bracket};
use crate::motion::{observer, Guard, ModeField, Run, SmoothField};
use crate::powers::power;
use crate::tolerances::EPS;

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
#[repr(C)]
#[derive(Clone)]
pub struct Midpoint {
    step: Step,
    /// The derivative at the start is that of the field there, and not that of the step before at its end.
    is_started: bool,
    stage: Vec<f64>,
    middle: Vec<f64>,
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

    /// Attempts a step of length `dt`; `observe` is called with the field after the evaluation in the middle, and where
    /// the end is evaluated, last there.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn attempt_along<F: SmoothField>(
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
            Attempt::Error(power(error, AS_OF_ORDER_FIVE))
        } else {
            Attempt::NotFinite
        })
    }

    /// The step `dt`, or the longest one whose stage in the middle is not beyond a surface that the motion in a region comes to:
    /// then it lies on the surface, and the end behind it (Dieci, Lopez 2009, theorem 5.2).
    ///
    /// # Errors
    /// If a function of the user raises.
    fn keep_to_side(&mut self, at: &mut Run, dt: f64) -> Result<f64, FieldError> {
        if !self.is_started {
            let mut x = at.x.to_vec();
            let derivative = self.start_derivative_mut();
            at.motion.field.eval(at.t, &mut x, derivative)?;
        }
        if !matches!(at.motion.field, ModeField::Region(_)) {
            return Ok(dt);
        }
        let (system, t, x, setting) = (at.system, at.t, &at.x, at.motion.setting());
        let derivative = &self.step.start_derivative;
        let mut h = vec![0.0; system.n_surfaces()];
        let mut stage = x.to_vec();
        let mut value = |index: usize, dt: f64| -> Result<f64, FieldError> {
            let points = stage.iter_mut().zip(x.iter().zip(derivative));
            points.for_each(|(stage, (x, k))| *stage = x + 0.5 * dt * k);
            system.surfaces(&setting.at(t + 0.5 * dt, &stage), &mut h)?;
            Ok(h[index])
        };
        let mut longest = dt;
        for m in &at.motion.monitored {
            let Guard::Surface(j) = m.guard else {
                continue;
            };
            if m.deflation.is_some() || m.value <= 0.0 {
                continue;
            }
            let mut side = |theta: f64| Ok(m.orientation * value(j, theta * longest)?);
            let end = side(1.0)?;
            // A function that is not finite there has its surface before.
            if end >= 0.0 || end.is_nan() {
                continue;
            }
            let bracket = Bracket {
                lo: 0.0,
                hi: 1.0,
                g_lo: m.value,
                g_hi: end,
                guess: m.value / (m.value - end),
                slope: end - m.value,
            };
            let mut theta = refine(&mut side, bracket, EPS)?.theta;
            // Rounding may blur the zero far beyond the rounding of the step: growing strides get out of that.
            let mut stride = 4.0 * EPS;
            while side(theta)? < 0.0 && theta > 0.0 {
                theta *= 1.0 - stride;
                stride = (2.0 * stride).min(0.5);
            }
            longest *= theta;
        }
        Ok(longest)
    }
}

impl Stepper for Midpoint {
    fn step(&self) -> &Step {
        &self.step
    }

    fn step_mut(&mut self) -> &mut Step {
        &mut self.step
    }

    fn attempt(&mut self, at: &mut Run, dt: f64) -> Result<Option<Attempt>, FieldError> {
        let dt = self.keep_to_side(at, dt)?;
        // On a surface the field is there at the end too, which is projected onto it.
        let evaluates_end = !matches!(at.motion.field, ModeField::Region(_));
        let (field, observe) = (
            (&mut at.motion.field, evaluates_end),
            observer(&mut at.seen),
        );
        let attempt = self.attempt_along(field, observe, at.t, &at.x, dt, &at.scale)?;
        Ok(Some(attempt))
    }

    /// The error of the extension at theta > 1 in units of the tolerance.
    fn extrapolation_error(&self, theta: f64, scale: &ErrorScale) -> f64 {
        let bend = &self.step.interpolant.coefficients()[2 * self.step.end.len()..];
        let change: Vec<f64> = bend.iter().map(|c| theta * (theta - 1.0) * c).collect();
        scale.norm(&change, &self.step.end)
    }

    fn start_derivative_mut(&mut self) -> &mut [f64] {
        self.is_started = true;
        &mut self.step.start_derivative
    }

    fn accept(&mut self, y: &mut [f64]) {
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
