//! The methods of a run, and which of them takes the current step.

use super::chosen::Chosen;
use super::duties::{Attempt, ExitSeries, Ready, Stepper};
use super::{Controller, Dopri5, ErrorScale, Interpolant, Rodas5p, Step};
use crate::error::FieldError;
use crate::motion::{Run, Seen, SmoothField};
use crate::options::Method;
use crate::stats::Stats;
use crate::status::Warning;

/// Calls a method of the stepper in use; that of DOPRI5 is known to the compiler.
macro_rules! of_method_in_use {
    (mut $self:ident.$name:ident($($argument:expr),*)) => {
        match &mut $self.chosen {
            Some(method) if $self.takes_step => method.$name($($argument),*),
            _ => $self.dopri5.$name($($argument),*),
        }
    };
    ($self:ident.$name:ident($($argument:expr),*)) => {
        match &$self.chosen {
            Some(method) if $self.takes_step => method.$name($($argument),*),
            _ => $self.dopri5.$name($($argument),*),
        }
    };
}

/// The methods of a run. DOPRI5 is always there: it takes over if another method cannot go on.
#[derive(Clone)]
pub(crate) struct Steppers {
    dopri5: Dopri5,
    /// The other one, if the run has one.
    chosen: Option<Chosen>,
    /// That one integrates the present motion.
    takes_motion: bool,
    /// It takes the step.
    takes_step: bool,
}

impl Steppers {
    /// The methods of a run over an interval of length `span`.
    pub fn new(start: &Run, span: f64) -> Self {
        Steppers {
            dopri5: Dopri5::new(start.system.n_states()),
            chosen: Chosen::of_run(start, span),
            takes_motion: false,
            takes_step: false,
        }
    }

    /// About how many bytes the coefficients and matrices of the methods take.
    pub fn n_bytes(&self) -> usize {
        let own = self.dopri5.step().interpolant.coefficients().len();
        let numbers = own + self.chosen.as_ref().map_or(0, Chosen::n_numbers);
        numbers * size_of::<f64>()
    }

    /// The step of the method in use.
    #[inline(always)]
    fn step(&self) -> &Step {
        of_method_in_use!(self.step())
    }

    /// Hands the next step to the chosen method or to DOPRI5.
    #[cold]
    fn hand_over(&mut self, to_chosen: bool) {
        if to_chosen == self.takes_step {
            return;
        }
        let start = self.start_derivative().to_vec();
        self.takes_step = to_chosen;
        self.start_derivative_mut().copy_from_slice(&start);
    }

    /// A motion starts: the chosen method takes it if it can; with a warning if the user asked for it and it cannot.
    #[inline]
    pub fn begin(&mut self, at: &mut Run) -> Option<Box<Warning>> {
        (self.takes_motion, self.takes_step) = (false, false);
        let method = self.chosen.as_mut()?;
        if method.begin(at) == Ready::NotThisMotion {
            return method.refusal(at);
        }
        (self.takes_motion, self.takes_step) = (true, true);
        None
    }

    /// Finds the derivative at the start of the motion without its field; `false` if the method does not.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn start(&mut self, at: &mut Run) -> Result<bool, FieldError> {
        of_method_in_use!(mut self.start(at))
    }

    /// The field was evaluated at the start of the motion; with a warning if the method that the user asked for does not
    /// integrate it.
    pub fn started(&mut self, at: &mut Run) -> Option<Box<Warning>> {
        match of_method_in_use!(mut self.started(at)) {
            Ready::NotThisMotion => self.leave_motion(at),
            Ready::UpTo(_) | Ready::NotThisStep => None,
        }
    }

    /// Leaves the rest of the motion to DOPRI5; with a warning if the user asked for the other method.
    #[cold]
    #[inline(never)]
    pub fn leave_motion(&mut self, at: &Run) -> Option<Box<Warning>> {
        self.takes_motion = false;
        self.hand_over(false);
        self.chosen.as_mut()?.refusal(at)
    }

    /// Does the method of the motion prepare its steps? DOPRI5 has nothing to prepare.
    #[inline(always)]
    pub fn is_to_prepare(&self) -> bool {
        self.takes_motion
    }

    /// Prepares the next step: by the method of the motion if it takes this step, else by DOPRI5. If the method takes no more
    /// steps of the motion, `leave_motion` has to follow.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline(always)]
    pub fn prepare(&mut self, at: &mut Run) -> Result<Ready, FieldError> {
        if self.takes_motion && !self.takes_step {
            self.hand_over(true);
        }
        let Some(method) = self.chosen.as_mut().filter(|_| self.takes_motion) else {
            return Ok(Ready::ANY);
        };
        let ready = method.prepare(at)?;
        if ready == Ready::NotThisStep {
            self.hand_over(false);
        }
        Ok(ready)
    }

    /// Attempts a step of length `dt`, or of less if the method may not make it that long.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline(always)]
    pub fn attempt(&mut self, at: &mut Run, dt: f64) -> Result<Attempt, FieldError> {
        at.seen.iter_mut().for_each(Seen::begin);
        if let Some(method) = self.chosen.as_mut().filter(|_| self.takes_step) {
            if let Some(attempt) = method.attempt(at, dt)? {
                return Ok(attempt);
            }
            self.hand_over(false);
        }
        self.dopri5.attempt_by_kind(at, dt)
    }

    /// Makes the end of the attempted step the start of the next one.
    #[inline(always)]
    pub fn accept(&mut self, y: &mut [f64]) {
        of_method_in_use!(mut self.accept(y))
    }

    /// Counts a step that is accepted.
    #[inline]
    pub fn count(&self, stats: &mut Stats) {
        let chosen = self.chosen.as_ref().filter(|_| self.takes_step);
        let method = chosen.map_or(Method::Dopri5, Chosen::method);
        stats.n_steps_by[method as usize] += 1;
    }

    /// The next step after one of length `dt` with this error was accepted.
    #[inline]
    pub fn after_acceptance(&self, controller: &mut Controller, dt: f64, error: f64) -> f64 {
        of_method_in_use!(self.after_acceptance(controller, dt, error))
    }

    /// The factor for another attempt after one with this error was rejected.
    #[inline]
    pub fn after_rejection(&self, controller: &mut Controller, error: f64) -> f64 {
        of_method_in_use!(self.after_rejection(controller, error))
    }

    /// Does stability and not accuracy limit the attempted step, which is accepted? `None` if that is not known, as for a
    /// step that DOPRI5 takes for another method.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn is_limited_by_stability(&mut self, at: &mut Run) -> Result<Option<bool>, FieldError> {
        if self.takes_step != self.takes_motion {
            return Ok(None);
        }
        of_method_in_use!(mut self.is_limited_by_stability(at))
    }

    /// Leaves the rest of the motion, and the motions after it, to the method for stiff motions.
    #[cold]
    pub fn go_on_implicitly(&mut self, at: &mut Run) {
        let mut rodas5p = Rodas5p::new(at.x.len());
        rodas5p.take(at);
        rodas5p
            .start_derivative_mut()
            .copy_from_slice(self.start_derivative());
        self.chosen = Some(Chosen::Rodas5p(Box::new(rodas5p)));
        (self.takes_motion, self.takes_step) = (true, true);
    }

    /// The derivative at the start of the step.
    #[inline(always)]
    pub fn start_derivative(&self) -> &[f64] {
        &self.step().start_derivative
    }

    /// The derivative at the start of the step, to be replaced.
    pub fn start_derivative_mut(&mut self) -> &mut [f64] {
        of_method_in_use!(mut self.start_derivative_mut())
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

    /// Is the accurate extension there as soon as the step is, as a polynomial in powers of theta?
    #[inline]
    pub fn extends_freely(&self) -> bool {
        of_method_in_use!(self.extends_freely())
    }

    /// Is the extension the Taylor series of the motion?
    #[inline]
    pub fn is_series(&self) -> bool {
        of_method_in_use!(self.is_series())
    }

    /// Writes the series of an exit function in powers of theta into `rows`, if the method has one.
    pub fn exit_series(&self, index: usize, rows: &mut [f64]) -> Option<ExitSeries> {
        of_method_in_use!(self.exit_series(index, rows))
    }

    /// Has a step to end at an event?
    #[inline]
    pub fn ends_at_events(&self) -> bool {
        of_method_in_use!(self.ends_at_events())
    }

    /// Makes an extension available that costs no evaluation.
    #[inline]
    pub fn extend_cheaply(&mut self, y: &[f64]) {
        of_method_in_use!(mut self.extend_cheaply(y))
    }

    /// Is the extension as accurate as the step?
    #[inline]
    pub fn is_extended(&self) -> bool {
        of_method_in_use!(self.is_extended())
    }

    /// Makes the extension as accurate as the step.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline]
    pub fn extend(&mut self, field: &mut dyn SmoothField, y: &[f64]) -> Result<(), FieldError> {
        of_method_in_use!(mut self.extend(field, y))
    }

    /// Estimated error of the extension beyond the end of the step, in units of the tolerance.
    pub fn extrapolation_error(&self, theta: f64, scale: &ErrorScale) -> f64 {
        of_method_in_use!(self.extrapolation_error(theta, scale))
    }

    /// Does the field jump within the attempted step?
    #[inline]
    pub fn field_jumps(&self) -> bool {
        of_method_in_use!(self.field_jumps())
    }

    /// Makes the continuous extension a straight line: the record of a motion that was not stepped.
    pub fn set_straight(&mut self, t: f64, dt: f64, from: &[f64], to: &[f64]) {
        self.takes_step = false;
        self.dopri5.set_straight(t, dt, from, to);
    }
}
