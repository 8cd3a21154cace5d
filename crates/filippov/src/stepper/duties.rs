//! What is asked of every method that takes steps.

use super::{Controller, ErrorScale, Step};
use crate::error::FieldError;
use crate::motion::{Run, SmoothField};
use crate::status::Warning;

/// What came of an attempted step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Attempt {
    /// The error in units of the tolerance; the step is acceptable up to 1.
    Error(f64),
    /// A stage or the end of the step was not finite.
    NotFinite,
}

/// Whether a method takes the next steps. If it does not, DOPRI5 takes over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Ready {
    /// It takes the next step, which may be this long.
    UpTo(f64),
    /// It takes the step after the next one.
    NotThisStep,
    /// It takes no step of this motion.
    NotThisMotion,
}

impl Ready {
    /// It takes a step of any length.
    pub const ANY: Ready = Ready::UpTo(f64::INFINITY);
}

/// How the series of an exit function stands for the function.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExitSeries {
    /// The exit functions are affine in (t, x): along the step they are polynomials, as the states are.
    pub is_affine: bool,
    /// The coefficients show all that the exit functions do in a step.
    pub is_complete: bool,
}

/// A method that advances one smooth field.
///
/// Duties of every implementer:
///
/// 1. `step` is the step that was attempted last, or is about to be; `step_mut` is the same one. It is the first field of
///    the type, in the order of C: then no branch leads to the steps of different methods. Its `start_derivative` is
///    kept through rejected attempts. Its `interpolant` has the time and the length of the attempt, also of a failed one.
/// 2. `attempt` changes only the step, the memory of the method, the counters, and through the observer
///    ([`crate::motion::observer`]) what was seen of the exit functions. The observer is called after evaluations within
///    the step, and last after that at its end. The attempt may be shorter than `dt`.
/// 3. The error acts as that of a method of order 5: 1 stays 1, and the step changes as error^(-1/5).
/// 4. `extrapolation_error` is for the accurate extension, which is there when it is called.
///
/// Duties with a default, which suits an explicit Runge-Kutta method whose extension is a polynomial in powers of theta
/// and is computed by `attempt`:
///
/// 5. `begin` is called for every motion, before its first derivative is known: the method forgets the motion before.
///    `start` follows, then, if that returns `false`, `started` after the field was evaluated at the start. `refusal` is
///    asked wherever the method does not take the motion.
/// 6. `prepare` is called before every attempt, and evaluates what it needs once per start.
/// 7. `start_derivative_mut` is called if the start has changed: the method forgets what it prepared there.
/// 8. `accept` makes the end of the step the start of the next one. `after_acceptance` and `after_rejection` use the
///    controller unless the method has means of its own.
/// 9. `extend_cheaply` evaluates nothing. It and `extend` may be called several times for one step.
/// 10. `field_jumps` and `is_limited_by_stability` are asked of accepted steps only, before `accept`.
pub(crate) trait Stepper {
    /// The step that was attempted last, or is about to be.
    fn step(&self) -> &Step;

    /// The same, to be changed.
    fn step_mut(&mut self) -> &mut Step;

    /// Attempts a step of length `dt`, or of less if it may not be that long; `None` if the method cannot take this step.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn attempt(&mut self, at: &mut Run, dt: f64) -> Result<Option<Attempt>, FieldError>;

    /// The error of the accurate extension at theta > 1, in units of the tolerance.
    fn extrapolation_error(&self, theta: f64, scale: &ErrorScale) -> f64;

    /// A motion starts: does the method integrate it?
    fn begin(&mut self, _: &mut Run) -> Ready {
        Ready::ANY
    }

    /// Finds the derivative at the start of the motion without its field; `false` if it does not.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn start(&mut self, _: &mut Run) -> Result<bool, FieldError> {
        Ok(false)
    }

    /// The field was evaluated at the start of the motion: does the method integrate it?
    fn started(&mut self, _: &mut Run) -> Ready {
        Ready::ANY
    }

    /// The warning that the method does not take this motion, if it is worth one.
    fn refusal(&mut self, _: &Run) -> Option<Box<Warning>> {
        None
    }

    /// The derivative at the start of the step, to be replaced.
    fn start_derivative_mut(&mut self) -> &mut [f64] {
        &mut self.step_mut().start_derivative
    }

    /// Does what has to be done at the start of a step, and says how long the step may be.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn prepare(&mut self, _: &mut Run) -> Result<Ready, FieldError> {
        Ok(Ready::ANY)
    }

    /// Makes the end of the attempted step the start of the next one.
    #[inline]
    fn accept(&mut self, y: &mut [f64]) {
        self.step_mut().accept(y);
    }

    /// The next step after one of length `dt` with this error was accepted.
    #[inline]
    fn after_acceptance(&self, controller: &mut Controller, dt: f64, error: f64) -> f64 {
        dt * controller.accept(error)
    }

    /// The factor for another attempt after one with this error was rejected.
    #[inline]
    fn after_rejection(&self, controller: &mut Controller, error: f64) -> f64 {
        controller.reject(error)
    }

    /// Is the accurate extension there as soon as the step is, as a polynomial in powers of theta?
    #[inline]
    fn extends_freely(&self) -> bool {
        true
    }

    /// Is the accurate extension there?
    #[inline]
    fn is_extended(&self) -> bool {
        true
    }

    /// Makes an extension available that costs no evaluation.
    #[inline]
    fn extend_cheaply(&mut self, _: &[f64]) {}

    /// Makes the extension as accurate as the step.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn extend(&mut self, _: &mut dyn SmoothField, _: &[f64]) -> Result<(), FieldError> {
        Ok(())
    }

    /// Is the extension the Taylor series of the motion, exact but for rounding near the start of the step? The series
    /// limits the length of the step before it is attempted.
    #[inline]
    fn is_series(&self) -> bool {
        false
    }

    /// Writes the series of an exit function in powers of theta into `rows`, if the method has one.
    fn exit_series(&self, _: usize, _: &mut [f64]) -> Option<ExitSeries> {
        None
    }

    /// Has a step to end at an event? So it is if the extension is less accurate than the end of the step in fast
    /// components.
    #[inline]
    fn ends_at_events(&self) -> bool {
        false
    }

    /// Does the field jump within the attempted step?
    fn field_jumps(&self) -> bool {
        false
    }

    /// Does stability and not accuracy limit the attempted step, which is accepted? `None` if the method does not notice.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn is_limited_by_stability(&mut self, _: &mut Run) -> Result<Option<bool>, FieldError> {
        Ok(None)
    }
}
