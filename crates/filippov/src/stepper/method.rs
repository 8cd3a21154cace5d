//! The stepper of a run: the methods that it may use, and which of them takes the current step.

use super::{Dop853, Dopri5, ErrorScale, Interpolant, Midpoint, Rodas5p, Step, Taylor};
use std::sync::Arc;

use crate::error::FieldError;
use crate::motion::SmoothField;
use crate::system::MotionJacobian;

/// How a motion is linearised.
#[derive(Clone, Default)]
pub(crate) enum Derivatives {
    /// It is not: an explicit method integrates it.
    #[default]
    None,
    /// By the derivatives of the expression graph.
    Exact(Arc<MotionJacobian>),
    /// By differences of its field.
    Differences,
}

/// The method that takes a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepMethod {
    /// The Runge-Kutta pair of Dormand and Prince, of order 5.
    Dopri5,
    /// That of order 8.
    Dop853,
    /// The explicit midpoint rule.
    Midpoint,
    /// Taylor series.
    Taylor,
    /// The Rosenbrock-Wanner method of Steinebach.
    Rodas5p,
}

/// The methods of a run; each keeps the last step that it took. DOPRI5 is always there: it takes over where another
/// method cannot go on.
pub struct Stepper {
    /// The Runge-Kutta method.
    pub dopri5: Dopri5,
    /// The Taylor method, where the run may use it.
    pub taylor: Option<Box<Taylor>>,
    /// The Runge-Kutta method of order 8, where the run uses it.
    pub dop853: Option<Box<Dop853>>,
    /// The midpoint rule, where the run uses it.
    pub midpoint: Option<Box<Midpoint>>,
    /// The method for stiff motions, where the run may use it.
    pub rodas5p: Option<Box<Rodas5p>>,
    /// How the motion is linearised, if the method for stiff motions integrates it.
    pub(crate) derivatives: Derivatives,
    in_use: StepMethod,
}

impl Stepper {
    /// A stepper for n states; with the Taylor method if it is given.
    pub fn new(n: usize, taylor: Option<Taylor>) -> Self {
        Stepper {
            dopri5: Dopri5::new(n),
            taylor: taylor.map(Box::new),
            dop853: None,
            midpoint: None,
            rodas5p: None,
            derivatives: Derivatives::None,
            in_use: StepMethod::Dopri5,
        }
    }

    /// The step of the method in use.
    #[inline(always)]
    fn step(&self) -> &Step {
        match self.in_use {
            StepMethod::Dopri5 => None,
            StepMethod::Taylor => self.taylor.as_ref().map(|m| m.step()),
            StepMethod::Rodas5p => self.rodas5p.as_ref().map(|m| m.step()),
            StepMethod::Dop853 => self.dop853.as_ref().map(|m| m.step()),
            StepMethod::Midpoint => self.midpoint.as_ref().map(|m| m.step()),
        }
        .unwrap_or_else(|| self.dopri5.step())
    }

    /// The method in use.
    pub fn in_use(&self) -> StepMethod {
        self.in_use
    }

    /// Does the Taylor method take the steps?
    pub fn is_taylor(&self) -> bool {
        self.in_use == StepMethod::Taylor
    }

    /// Is the continuous extension a polynomial in powers of theta that is there as soon as the step is?
    pub fn has_series(&self) -> bool {
        self.in_use != StepMethod::Dopri5
    }

    /// Lets a method take the steps of the motion that starts; DOPRI5 where it is not there.
    pub fn start_with(&mut self, method: StepMethod) {
        let is_there = match method {
            StepMethod::Dopri5 => true,
            StepMethod::Taylor => self.taylor.is_some(),
            StepMethod::Rodas5p => self.rodas5p.is_some(),
            StepMethod::Dop853 => self.dop853.is_some(),
            StepMethod::Midpoint => self.midpoint.is_some(),
        };
        self.in_use = if is_there { method } else { StepMethod::Dopri5 };
    }

    /// Leaves the rest of a motion to another method.
    pub fn go_on_with(&mut self, method: StepMethod) {
        if method == self.in_use {
            return;
        }
        let start = self.start_derivative().to_vec();
        self.start_with(method);
        self.start_derivative_mut().copy_from_slice(&start);
    }

    /// The derivative at the start of the step.
    #[inline(always)]
    pub fn start_derivative(&self) -> &[f64] {
        &self.step().start_derivative
    }

    /// The derivative at the start of the step, to be replaced.
    pub fn start_derivative_mut(&mut self) -> &mut [f64] {
        match self.in_use {
            StepMethod::Dopri5 => None,
            StepMethod::Taylor => self.taylor.as_mut().map(|m| m.start_derivative_mut()),
            StepMethod::Rodas5p => self.rodas5p.as_mut().map(|m| m.start_derivative_mut()),
            StepMethod::Dop853 => self.dop853.as_mut().map(|m| m.start_derivative_mut()),
            StepMethod::Midpoint => self.midpoint.as_mut().map(|m| m.start_derivative_mut()),
        }
        .unwrap_or_else(|| self.dopri5.start_derivative_mut())
    }

    /// The end of the attempted step.
    #[inline(always)]
    pub fn end(&self) -> &[f64] {
        &self.step().end
    }

    /// The derivative at the end of the attempted step.
    #[inline(always)]
    pub fn end_derivative(&self) -> &[f64] {
        &self.step().end_derivative
    }

    /// The continuous extension of the attempted step.
    #[inline(always)]
    pub fn interpolant(&self) -> &Interpolant {
        &self.step().interpolant
    }

    /// Makes the end of the attempted step the start of the next one.
    #[inline(always)]
    pub fn accept(&mut self, y: &mut [f64]) {
        match (self.in_use, &mut self.taylor) {
            (StepMethod::Taylor, Some(taylor)) => return taylor.accept(y),
            (StepMethod::Dopri5, _) => return self.dopri5.accept(y),
            _ => {}
        }
        match (&mut self.rodas5p, &mut self.dop853, &mut self.midpoint) {
            (Some(method), ..) if self.in_use == StepMethod::Rodas5p => method.accept(y),
            (_, Some(method), _) if self.in_use == StepMethod::Dop853 => method.accept(y),
            (.., Some(method)) if self.in_use == StepMethod::Midpoint => method.accept(y),
            _ => self.dopri5.accept(y),
        }
    }

    /// Makes the extension that costs nothing available.
    pub fn extend_order4(&mut self, y: &[f64]) {
        if !self.has_series() {
            self.dopri5.extend_order4(y);
        }
    }

    /// Is the extension as accurate as the step?
    pub fn is_extended(&self) -> bool {
        self.has_series() || self.dopri5.has_order5()
    }

    /// Makes the extension as accurate as the step.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn extend(&mut self, field: &mut dyn SmoothField, y: &[f64]) -> Result<(), FieldError> {
        if !self.is_extended() {
            self.dopri5.extend_order5(field, y)?;
        }
        Ok(())
    }

    /// Estimated error of the extension beyond the end of the step, in units of the tolerance.
    pub fn extension_defect(&self, theta: f64, scale: &ErrorScale) -> f64 {
        let extrapolated = match self.in_use {
            StepMethod::Dopri5 => None,
            StepMethod::Taylor => self.taylor.as_ref().map(|m| m.extrapolation_error(theta)),
            StepMethod::Rodas5p => {
                let method = self.rodas5p.as_ref();
                method.map(|m| m.extrapolation_error(theta, scale))
            }
            StepMethod::Dop853 => {
                let method = self.dop853.as_ref();
                method.map(|m| m.extrapolation_error(theta, scale))
            }
            StepMethod::Midpoint => {
                let method = self.midpoint.as_ref();
                method.map(|m| m.extrapolation_error(theta, scale))
            }
        };
        extrapolated.unwrap_or_else(|| self.dopri5.extension_defect(theta, scale))
    }

    /// Does the field jump within the attempted step? A series has no jumps, and over the stages of a stiff step the
    /// field changes as fast without any.
    pub fn field_jumps(&self) -> bool {
        match (self.in_use, &self.dop853) {
            (StepMethod::Dopri5, _) => self.dopri5.field_jumps(),
            (StepMethod::Dop853, Some(dop853)) => dop853.field_jumps(),
            _ => false,
        }
    }

    /// Makes the continuous extension a straight line: the record of a motion that was not stepped.
    pub fn set_straight(&mut self, t: f64, dt: f64, from: &[f64], to: &[f64]) {
        self.in_use = StepMethod::Dopri5;
        self.dopri5.set_straight(t, dt, from, to);
    }
}
