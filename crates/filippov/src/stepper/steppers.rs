//! The methods of a run, and which of them takes the current step.

use super::stepper::{Attempt, ExitSeries, Ready, StepStart, Stepper};
use super::{Controller, Dop853, Dopri5, ErrorScale, Interpolant, Midpoint, Rodas5p, Step, Taylor};
use crate::error::FieldError;
use crate::motion::{Seen, SmoothField};
use crate::options::{Method, Options};
use crate::stats::Stats;
use crate::status::Warning;
use crate::system::PiecewiseSystem;

/// What `options.method` stands for: the methods beside DOPRI5, the first one to be asked first. `span` is the length of
/// the interval of integration.
fn methods(options: &Options, system: &dyn PiecewiseSystem, span: f64) -> Vec<Box<dyn Stepper>> {
    let n = system.n_states();
    match options.method {
        Method::Dopri5 => vec![],
        Method::Dop853 => vec![Box::new(Dop853::new(n))],
        Method::Midpoint => vec![Box::new(Midpoint::new(n))],
        Method::Rodas5p => vec![Box::new(Rodas5p::new(n))],
        Method::Taylor => vec![Box::new(Taylor::of_run(options, system, span))],
        Method::Auto if system.is_analytic() => {
            vec![Box::new(Taylor::of_run(options, system, span))]
        }
        Method::Auto => vec![],
    }
}

/// The methods of a run. DOPRI5 is always there: it takes over if another method cannot go on.
pub(crate) struct Steppers {
    dopri5: Dopri5,
    /// The others, the first one to be asked first.
    methods: Vec<Box<dyn Stepper>>,
    /// The one of them that integrates the present motion.
    of_motion: Option<usize>,
    /// The one of them that takes the step.
    in_use: Option<usize>,
}

impl Steppers {
    /// The methods of a run over an interval of length `span`.
    pub fn new(options: &Options, system: &dyn PiecewiseSystem, span: f64) -> Self {
        Steppers {
            dopri5: Dopri5::new(system.n_states()),
            methods: methods(options, system, span),
            of_motion: None,
            in_use: None,
        }
    }

    #[inline(always)]
    fn current(&self) -> &dyn Stepper {
        match self.in_use {
            None => &self.dopri5,
            Some(k) => &*self.methods[k],
        }
    }

    #[inline(always)]
    fn current_mut(&mut self) -> &mut dyn Stepper {
        match self.in_use {
            None => &mut self.dopri5,
            Some(k) => &mut *self.methods[k],
        }
    }

    /// The step of the method in use.
    #[inline(always)]
    fn step(&self) -> &Step {
        match self.in_use {
            None => self.dopri5.step(),
            Some(k) => self.methods[k].step(),
        }
    }

    /// Lets a method take the next step.
    fn go_on_with(&mut self, method: Option<usize>) {
        if method == self.in_use {
            return;
        }
        let start = self.start_derivative().to_vec();
        self.in_use = method;
        self.start_derivative_mut().copy_from_slice(&start);
    }

    /// Asks the methods in their order for one that integrates the motion that starts; with a warning if the one that the
    /// user asked for does not.
    pub fn begin(&mut self, at: &mut StepStart) -> Option<Box<Warning>> {
        let mut why = None;
        self.of_motion = None;
        for (k, method) in self.methods.iter_mut().enumerate() {
            match method.begin(at) {
                Ready::NotThisMotion(warning) => why = warning,
                Ready::UpTo(_) | Ready::NotThisStep => {
                    self.of_motion = Some(k);
                    break;
                }
            }
        }
        self.in_use = self.of_motion;
        why
    }

    /// Finds the derivative at the start of the motion without its field; `false` if the method does not.
    pub fn start(&mut self, at: &mut StepStart) -> bool {
        self.current_mut().start(at)
    }

    /// The field was evaluated at the start of the motion; with a warning if the method that the user asked for does not
    /// integrate it.
    pub fn started(&mut self, at: &mut StepStart) -> Option<Box<Warning>> {
        match self.current_mut().started(at) {
            Ready::NotThisMotion(warning) => {
                self.leave_motion();
                warning
            }
            Ready::UpTo(_) | Ready::NotThisStep => None,
        }
    }

    /// Leaves the rest of the motion to DOPRI5.
    fn leave_motion(&mut self) {
        self.of_motion = None;
        self.go_on_with(None);
    }

    /// Prepares the next step: by the method of the motion if it takes this step, else by DOPRI5.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline]
    pub fn prepare(&mut self, at: &mut StepStart) -> Result<Ready, FieldError> {
        let Some(k) = self.of_motion else {
            return Ok(Ready::ANY);
        };
        self.go_on_with(self.of_motion);
        let ready = self.methods[k].prepare(at)?;
        match ready {
            Ready::UpTo(_) => {}
            Ready::NotThisStep => self.go_on_with(None),
            Ready::NotThisMotion(_) => self.leave_motion(),
        }
        Ok(ready)
    }

    /// Attempts a step of length `dt`, or of less if the method may not make it that long.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline]
    pub fn attempt(&mut self, at: &mut StepStart, dt: f64) -> Result<Attempt, FieldError> {
        at.seen.iter_mut().for_each(Seen::begin);
        if let Some(k) = self.in_use {
            if let Some(attempt) = self.methods[k].attempt(at, dt)? {
                return Ok(attempt);
            }
            self.go_on_with(None);
        }
        self.dopri5.attempt_by_kind(at, dt)
    }

    /// Makes the end of the attempted step the start of the next one.
    #[inline(always)]
    pub fn accept(&mut self, y: &mut [f64]) {
        self.current_mut().accept(y);
    }

    /// Counts a step that is accepted.
    pub fn count(&self, stats: &mut Stats) {
        self.current().count(stats);
    }

    /// The next step after one of length `dt` with this error was accepted.
    pub fn after_acceptance(&self, controller: &mut Controller, dt: f64, error: f64) -> f64 {
        self.current().after_acceptance(controller, dt, error)
    }

    /// The factor for another attempt after one with this error was rejected.
    pub fn after_rejection(&self, controller: &mut Controller, error: f64) -> f64 {
        self.current().after_rejection(controller, error)
    }

    /// Does stability and not accuracy limit the attempted step, which is accepted? `None` if that is not known, as for a
    /// step that DOPRI5 takes for another method.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn is_limited_by_stability(
        &mut self,
        at: &mut StepStart,
    ) -> Result<Option<bool>, FieldError> {
        if self.in_use != self.of_motion {
            return Ok(None);
        }
        self.current_mut().is_limited_by_stability(at)
    }

    /// Leaves the rest of the motion to the method for stiff motions, and asks it first from now on.
    #[cold]
    pub fn go_on_implicitly(&mut self, at: &mut StepStart) {
        let start = self.start_derivative().to_vec();
        let mut rodas5p = Rodas5p::new(at.x.len());
        rodas5p.take(at);
        rodas5p.start_derivative_mut().copy_from_slice(&start);
        self.methods.insert(0, Box::new(rodas5p));
        self.of_motion = Some(0);
        self.in_use = Some(0);
    }

    /// The derivative at the start of the step.
    #[inline(always)]
    pub fn start_derivative(&self) -> &[f64] {
        &self.step().start_derivative
    }

    /// The derivative at the start of the step, to be replaced.
    pub fn start_derivative_mut(&mut self) -> &mut [f64] {
        self.current_mut().start_derivative_mut()
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
    pub fn extends_freely(&self) -> bool {
        self.current().extends_freely()
    }

    /// Is the extension the Taylor series of the motion?
    pub fn is_series(&self) -> bool {
        self.current().is_series()
    }

    /// Writes the series of an exit function in powers of theta into `rows`, if the method has one.
    pub fn exit_series(&self, index: usize, rows: &mut [f64]) -> Option<ExitSeries> {
        self.current().exit_series(index, rows)
    }

    /// Has a step to end at an event?
    pub fn ends_at_events(&self) -> bool {
        self.current().ends_at_events()
    }

    /// Makes an extension available that costs no evaluation.
    pub fn extend_cheaply(&mut self, y: &[f64]) {
        self.current_mut().extend_cheaply(y);
    }

    /// Is the extension as accurate as the step?
    pub fn is_extended(&self) -> bool {
        self.current().is_extended()
    }

    /// Makes the extension as accurate as the step.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn extend(&mut self, field: &mut dyn SmoothField, y: &[f64]) -> Result<(), FieldError> {
        self.current_mut().extend(field, y)
    }

    /// Estimated error of the extension beyond the end of the step, in units of the tolerance.
    pub fn extrapolation_error(&self, theta: f64, scale: &ErrorScale) -> f64 {
        self.current().extrapolation_error(theta, scale)
    }

    /// Does the field jump within the attempted step?
    pub fn field_jumps(&self) -> bool {
        self.current().field_jumps()
    }

    /// Makes the continuous extension a straight line: the record of a motion that was not stepped.
    pub fn set_straight(&mut self, t: f64, dt: f64, from: &[f64], to: &[f64]) {
        self.in_use = None;
        self.dopri5.set_straight(t, dt, from, to);
    }
}
