//! The stepper of a run: the methods that it may use, and which of them takes the current step.

use super::{Dopri5, ErrorScale, Interpolant, Taylor};
use crate::error::FieldError;
use crate::field::SmoothField;

/// One method per motion; each keeps the last step that it took.
pub struct Stepper {
    /// The Runge-Kutta method.
    pub dopri5: Dopri5,
    /// The Taylor method, where the run may use it.
    pub taylor: Option<Box<Taylor>>,
    is_taylor: bool,
}

/// Calls the method in use.
macro_rules! in_use {
    ($self:ident, $method:ident => $call:expr) => {
        match &$self.taylor {
            Some($method) if $self.is_taylor => $call,
            _ => {
                let $method = &$self.dopri5;
                $call
            }
        }
    };
}

impl Stepper {
    /// A stepper for n states; with the Taylor method if it is given.
    pub fn new(n: usize, taylor: Option<Taylor>) -> Self {
        Stepper {
            dopri5: Dopri5::new(n),
            taylor: taylor.map(Box::new),
            is_taylor: false,
        }
    }

    /// Does the Taylor method take the steps?
    pub fn is_taylor(&self) -> bool {
        self.is_taylor
    }

    /// Lets the Taylor method take the steps of the motion that starts, or not.
    pub fn use_taylor(&mut self, is_taylor: bool) {
        self.is_taylor = is_taylor && self.taylor.is_some();
    }

    /// Leaves the rest of a motion to the Runge-Kutta method.
    pub fn leave_taylor(&mut self) {
        if let (true, Some(taylor)) = (self.is_taylor, &self.taylor) {
            let start = taylor.start_derivative();
            self.dopri5.start_derivative_mut().copy_from_slice(start);
        }
        self.is_taylor = false;
    }

    /// The derivative at the start of the step.
    pub fn start_derivative(&self) -> &[f64] {
        in_use!(self, method => method.start_derivative())
    }

    /// The derivative at the start of the step, to be replaced.
    pub fn start_derivative_mut(&mut self) -> &mut [f64] {
        match &mut self.taylor {
            Some(taylor) if self.is_taylor => taylor.start_derivative_mut(),
            _ => self.dopri5.start_derivative_mut(),
        }
    }

    /// The end of the attempted step.
    pub fn end(&self) -> &[f64] {
        in_use!(self, method => method.end())
    }

    /// The derivative at the end of the attempted step.
    pub fn end_derivative(&self) -> &[f64] {
        in_use!(self, method => method.end_derivative())
    }

    /// The continuous extension of the attempted step.
    pub fn interpolant(&self) -> &Interpolant {
        in_use!(self, method => method.interpolant())
    }

    /// Makes the end of the attempted step the start of the next one.
    pub fn accept(&mut self, y: &mut [f64]) {
        match &mut self.taylor {
            Some(taylor) if self.is_taylor => taylor.accept(y),
            _ => self.dopri5.accept(y),
        }
    }

    /// Makes the extension that costs nothing available.
    pub fn extend_order4(&mut self, y: &[f64]) {
        if !self.is_taylor {
            self.dopri5.extend_order4(y);
        }
    }

    /// Is the extension as accurate as the step?
    pub fn is_extended(&self) -> bool {
        self.is_taylor || self.dopri5.has_order5()
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
        match &self.taylor {
            Some(taylor) if self.is_taylor => taylor.extrapolation_error(theta),
            _ => self.dopri5.extension_defect(theta, scale),
        }
    }

    /// Does the field jump within the attempted step? A series has no jumps.
    pub fn field_jumps(&self) -> bool {
        !self.is_taylor && self.dopri5.field_jumps()
    }

    /// Makes the continuous extension a straight line: the record of a motion that was not stepped.
    pub fn set_straight(&mut self, t: f64, dt: f64, from: &[f64], to: &[f64]) {
        self.is_taylor = false;
        self.dopri5.set_straight(t, dt, from, to);
    }
}
