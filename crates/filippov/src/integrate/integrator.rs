//! The integrator.
//!
//! Specification, where several outcomes apply:
//!
//! 1. Time runs over half-open pieces: a switch at t belongs to the piece that starts there.
//! 2. Within a step the earliest zero wins; functions that vanish at the same time, within the
//!    rounding of the state, are one event with a set of surfaces.
//! 3. User events up to and including the time of a switch are recorded before it; one that ends
//!    the run does so before a switch at the same time.
//! 4. A switch at the end of the time span is recorded.
//! 5. A zero that the motion has just left is divided out until the next step end.
//! 6. Actions at one instant are done in their order, then those that they trigger; where the motion goes on is
//!    decided after the last one. A known time is the end of a step.
//!
//! `docs/theory/order_of_outcomes.md` has all of it, with the tests.

use crate::action::Timetable;
use crate::decisions::{differs_between_sides, has_left_resting, root_ends, Cause};
use crate::error::{Error, FieldError};
use crate::error_scale::ErrorScale;
use crate::event::search::Detector;
use crate::event::search::StepSearch;
use crate::event::UserEvents;
use crate::event::{Event, Found, Seen, UserEvent};
use crate::integrate::progress::Progress;
use crate::integrate::steps::chatter::ChatterWatch;
use crate::integrate::steps::pace::Paces;
use crate::integrate::steps::stiffness::Stiffness;
use crate::integrate::watch::Watch;
use crate::mode::Mode;
use crate::motion::CurrentMotion;
use crate::motion::{Guard, ModeField, SlidingField, SmoothField};
use crate::options::{Method, Options};
use crate::record::Recorder;
use crate::record::Solution;
use crate::stats::Stats;
use crate::status::{Stop, Warning};
use crate::stepper::Derivatives;
use crate::stepper::{Attempt, Controller, Dop853, Midpoint, Rodas5p, StepMethod, Stepper, Taylor};
use crate::system::Actions;
use crate::system::PiecewiseSystem;
use crate::tolerances::{EPS, SHORTEST_STEP, SHORTEST_STEP_AT_ZERO};

/// Most steps between two looks at the clock and at the caller's wish to stop.
const LONGEST_POLL: u64 = 64;
/// Seconds between two looks from which on they come at every step, for slow functions.
const SLOW_POLL: f64 = 0.002;

/// An integration in progress.
pub struct Integrator<'a> {
    pub(super) system: &'a dyn PiecewiseSystem,
    pub(super) options: &'a Options,
    pub(super) scale: ErrorScale,
    pub(super) t: f64,
    pub(super) t_end: f64,
    pub(super) actions: &'a Actions<'a>,
    pub(super) timetable: Timetable,
    /// The next known time of an action, or the end: no step goes beyond it.
    pub(super) horizon: f64,
    /// How far the point of an event lies off the surfaces that vanish there, by rounding; else empty.
    pub(super) residuals: Vec<f64>,
    /// Triggers whose action leaves the motion as it is: it goes through them.
    pub(super) passing: Vec<usize>,
    /// The step that was proposed where the horizon shortened it, else 0.
    wanted_dt: f64,
    pub(super) x: Vec<f64>,
    pub(super) motion: CurrentMotion<'a>,
    pub(super) stepper: Stepper,
    pub(super) controller: Controller,
    /// Proposed step.
    pub(super) dt: f64,
    /// How the last motion went, by mode.
    pub(super) paces: Paces,
    pub(super) detector: Detector,
    pub(super) recorder: Recorder<'a>,
    pub(super) stats: Stats,
    pub(super) warnings: Vec<Warning>,
    /// How many non-unique points were met.
    pub(super) n_choices: usize,
    /// The last attempt met a point where the field does not exist.
    pub(super) one_sided: bool,
    /// Some attempt of this run met such a point.
    pub(super) meets_edges: bool,
    pub(super) stiffness: Stiffness,
    /// How often the step was taken anew to end at an event.
    pub(super) n_aims: usize,
    /// Largest recent step of this motion.
    pub(super) recent_dt: f64,
    /// Since a jump of the field that no surface declares, if the steps have been short since then.
    pub(super) chatter: ChatterWatch,
    pub(super) progress: Progress,
    /// How long a step the series allows that was taken at the start of the motion, until the step.
    pub(super) series_reach: Option<f64>,
    /// Guards of this mode whose multipliers were held at their ends, with what they may go beyond.
    pub(super) slacks: Vec<(Guard, f64)>,
    pub(super) watch: Watch<'a>,
}

impl<'a> Integrator<'a> {
    /// Checks the arguments and places the start in its mode on the first call of [`step`](Self::step).
    ///
    /// # Errors
    /// If an argument is out of range.
    pub fn new(
        system: &'a dyn PiecewiseSystem,
        t_span: (f64, f64),
        y0: &[f64],
        options: &'a Options,
        events: &'a [UserEvent<'a>],
        actions: &'a Actions<'a>,
    ) -> Result<Self, Error> {
        crate::integrate::start::check(system, t_span, y0, options, actions)?;
        let n = system.n_states();
        let uses_series = match options.method {
            Method::Dopri5 | Method::Dop853 | Method::Midpoint | Method::Rodas5p => false,
            Method::Taylor => true,
            Method::Auto => system.is_analytic(),
        };
        let operations = |order| Some(system.motion_jets(&[], order)?.operations());
        let taylor = uses_series.then(|| {
            let order = Taylor::order_for(options.rtol, operations);
            let taylor = Taylor::new(n, order);
            match system.hides_changes() {
                true => taylor.wary_over(t_span.1 - t_span.0),
                false => taylor,
            }
        });
        let mut stepper = Stepper::new(n, taylor);
        match options.method {
            Method::Rodas5p => stepper.rodas5p = Some(Box::new(Rodas5p::new(n))),
            Method::Dop853 => stepper.dop853 = Some(Box::new(Dop853::new(n))),
            Method::Midpoint => stepper.midpoint = Some(Box::new(Midpoint::new(n))),
            Method::Auto | Method::Dopri5 | Method::Taylor => {}
        }
        let undecided = Mode::new(vec![1; system.n_surfaces()]);
        Ok(Integrator {
            system,
            options,
            scale: ErrorScale::new(options.rtol, &options.atol, n),
            t: t_span.0,
            t_end: t_span.1,
            actions,
            timetable: Timetable::new(actions, t_span.0),
            horizon: t_span.1,
            residuals: Vec::new(),
            passing: Vec::new(),
            wanted_dt: 0.0,
            x: y0.to_vec(),
            motion: CurrentMotion::new(system, t_span.0, undecided, options.into(), actions),
            stepper,
            controller: Controller::default(),
            dt: f64::NAN,
            paces: Paces::default(),
            detector: Detector::new(n, system.n_surfaces()),
            recorder: Recorder::new(n, options, events),
            stats: Stats::default(),
            warnings: Vec::new(),
            n_choices: 0,
            one_sided: false,
            meets_edges: false,
            stiffness: Stiffness::default(),
            n_aims: 0,
            recent_dt: 0.0,
            chatter: ChatterWatch::default(),
            progress: Progress::default(),
            series_reach: None,
            slacks: Vec::new(),
            watch: Watch::new(options),
        })
    }

    /// Asks `interrupt` every few steps, and during long decisions, with the time reached; the run stops where it returns
    /// `true`.
    #[must_use]
    pub fn interruptible(mut self, interrupt: &'a mut (dyn FnMut(f64) -> bool + 'a)) -> Self {
        self.watch.ask(interrupt);
        self
    }

    /// Runs to the end.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn run(&mut self) -> Result<Stop, FieldError> {
        let (mut polled, mut interval, mut next_poll) = (self.watch.start(), 1, 0);
        if let Some(stop) = self.start()? {
            return Ok(stop);
        }
        loop {
            let attempts = self.stats.n_steps + self.stats.n_rejected;
            if attempts >= self.options.max_steps {
                return Ok(Stop::MaxSteps);
            }
            if self.stats.n_switches >= self.options.max_events {
                return Ok(Stop::MaxEvents);
            }
            if attempts >= next_poll {
                let now = self.watch.now();
                let is_slow = (now - polled).as_secs_f64() > SLOW_POLL;
                interval = if is_slow {
                    1
                } else {
                    (2 * interval).min(LONGEST_POLL)
                };
                (polled, next_poll) = (now, attempts + interval);
                self.watch.is_over(now, self.t);
            }
            if let Some(stop) = self.watch.stop() {
                return Ok(stop);
            }
            if let Some(stop) = self.step()?.or_else(|| self.recorder.stop_at_section()) {
                return Ok(stop);
            }
        }
    }

    /// Attempts one step: accepts it up to its end or to the first event, or shortens the next.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn step(&mut self) -> Result<Option<Stop>, FieldError> {
        let remaining = self.horizon - self.t;
        if remaining <= 0.0 {
            return self.reach_horizon();
        }
        self.expand()?;
        if !matches!(self.stepper.derivatives, Derivatives::None) {
            self.linearise()?;
        }
        let mut dt = self.dt.min(self.options.max_step);
        dt = self.aim_at_surface(dt);
        self.wanted_dt = 0.0;
        if dt >= remaining * 0.99 {
            if self.horizon < self.t_end {
                self.wanted_dt = dt;
            }
            dt = remaining;
        }
        let shortest = (SHORTEST_STEP * self.t.abs()).max(SHORTEST_STEP_AT_ZERO);
        if dt < shortest && dt < remaining {
            let lost = self.ask(Cause::Start, root_ends::lost_functions)?;
            if let Some(lost) = lost {
                self.dt = f64::NAN;
                self.one_sided = false;
                return self.switch(&Found::here(lost));
            }
            if !self.one_sided {
                return Ok(Some(Stop::StepTooSmall));
            }
            return match self.arrival_at_edge()? {
                Some(event) => {
                    // The steps shrank towards the edge: the next motion takes a guess of its own.
                    self.dt = f64::NAN;
                    self.one_sided = false;
                    self.switch(&event)
                }
                None => Ok(Some(Stop::NotFinite)),
            };
        }
        if self.stepper.in_use() == StepMethod::Midpoint {
            dt = self.keep_to_side(dt)?;
        }
        let sliding = !self.motion.sliding().is_empty();
        match self.attempt(dt)? {
            Attempt::NotFinite => {
                self.count_rejection(sliding);
                self.shorten_to_surface(dt);
                Ok(None)
            }
            Attempt::Error(error) if error > 1.0 => {
                self.count_rejection(sliding);
                self.dt = dt
                    * match &self.stepper.taylor {
                        Some(taylor) if self.stepper.is_taylor() => taylor.reject(error),
                        _ => self.controller.reject(error),
                    };
                Ok(None)
            }
            Attempt::Error(error) => self.advance(dt, error),
        }
    }

    fn attempt(&mut self, dt: f64) -> Result<Attempt, FieldError> {
        self.detector.seen.iter_mut().for_each(Seen::begin);
        match self.stepper.in_use() {
            StepMethod::Taylor => self.attempt_series(dt),
            StepMethod::Rodas5p => self.attempt_implicit(dt),
            StepMethod::Dopri5 => self.attempt_explicit(dt),
            StepMethod::Dop853 => self.attempt_dop853(dt),
            StepMethod::Midpoint => self.attempt_midpoint(dt),
        }
    }

    pub(super) fn attempt_explicit(&mut self, dt: f64) -> Result<Attempt, FieldError> {
        let (t, x, scale) = (self.t, &self.x, &self.scale);
        let (stepper, seen) = (&mut self.stepper.dopri5, &mut self.detector.seen);
        match &mut self.motion.field {
            ModeField::Region(field) => stepper.attempt(field, |_| {}, t, x, dt, scale),
            ModeField::Sliding(field) => {
                let observe = |field: &SlidingField| {
                    let a = field.last();
                    seen[0].see(a.minus);
                    seen[1].see(-a.plus);
                };
                stepper.attempt(&mut **field, observe, t, x, dt, scale)
            }
            field => stepper.attempt(field, self.detector.observer(), t, x, dt, scale),
        }
    }

    fn attempt_dop853(&mut self, dt: f64) -> Result<Attempt, FieldError> {
        let Some(dop853) = &mut self.stepper.dop853 else {
            return Ok(Attempt::NotFinite);
        };
        let (field, observe) = (&mut self.motion.field, self.detector.observer());
        dop853.attempt(field, observe, self.t, &self.x, dt, &self.scale)
    }

    /// Accepts the step, or its part up to the first event.
    fn advance(&mut self, dt: f64, error: f64) -> Result<Option<Stop>, FieldError> {
        let sliding = !self.motion.sliding().is_empty();
        let t1 = if dt == self.horizon - self.t {
            self.horizon
        } else {
            self.t + dt
        };
        let (event, longest) = self.step_search().0.first_event(t1, dt)?;
        let found = match event {
            Event::None => None,
            Event::At(found) => Some(found),
            Event::Shorten(dt) => {
                self.count_rejection(sliding);
                self.shorten_step(dt);
                return Ok(None);
            }
        };
        if sliding && self.system.has_nested_signs() {
            let (mut end, mut t) = (self.stepper.end().to_vec(), t1);
            if let Some(event) = &found {
                self.stepper.interpolant().at(event.theta, &mut end);
                t = self.t + event.theta * dt;
            }
            if let Some(stop) = differs_between_sides(self.system, (t, &end), &self.motion)? {
                if dt < SHORTEST_STEP * self.t.abs().max(1.0) / EPS.sqrt() {
                    return Ok(Some(stop));
                }
                self.count_rejection(sliding);
                self.shorten_step(0.5 * dt);
                return Ok(None);
            }
        }
        let theta = found.as_ref().map_or(1.0, |event| event.theta);
        let is_implicit = self.stepper.in_use() == StepMethod::Rodas5p;
        let crosses = found
            .as_ref()
            .is_some_and(|event| !event.touch && !event.is_blurred);
        if is_implicit && crosses && self.aims_again(theta, dt) {
            return Ok(None);
        }
        let t_stop = if theta == 1.0 {
            t1
        } else {
            self.t + theta * dt
        };
        // A switch at the end of the span, or at a known time, is there, and not a rounding before.
        let last = self.horizon;
        let is_last = t_stop < last && last - t_stop < SHORTEST_STEP * last.abs();
        let t_stop = if is_last { last } else { t_stop };
        let Some(zeros) = self.find_user_zeros(theta, t_stop)? else {
            self.count_rejection(sliding);
            self.shorten_step(0.5 * dt);
            return Ok(None);
        };
        self.n_aims = 0;
        self.stats.n_steps += 1;
        self.stats.n_steps_sliding += u64::from(sliding);
        match self.stepper.in_use() {
            StepMethod::Dopri5 => {}
            StepMethod::Taylor => self.stats.n_steps_taylor += 1,
            StepMethod::Rodas5p => self.stats.n_steps_rodas5p += 1,
            StepMethod::Dop853 => self.stats.n_steps_dop853 += 1,
            StepMethod::Midpoint => self.stats.n_steps_midpoint += 1,
        }
        self.dt = if self.stepper.is_taylor() {
            f64::INFINITY
        } else {
            (dt * self.controller.accept(error)).max(self.wanted_dt)
        };
        self.note_jump(dt);
        let stepper = &self.stepper;
        let chatter = self.chatter.note_step(dt, || stepper.field_jumps());
        if let Some(stop) = self.record_user_zeros(zeros, theta, t_stop)? {
            return Ok(Some(stop));
        }
        self.one_sided = longest < dt;
        self.dt = self.dt.min(longest);
        if self.recorder.keeps_dense() {
            self.stepper.extend_order4(&self.x);
        }
        self.sample(t_stop)?;
        let Some(event) = found else {
            self.recorder
                .step(self.stepper.interpolant(), t1, self.stepper.end());
            let zero = self.zero_surface(t1)?;
            let turns_stiff =
                self.stiffness.is_due(self.stats.n_steps) && self.look_at_stiffness(dt)?;
            self.stepper.accept(&mut self.x);
            self.t = t1;
            if turns_stiff {
                self.go_on_implicitly();
            }
            if self.detector.accept(&mut self.motion.monitored, dt) {
                self.motion.note_departure();
            }
            if !self.motion.resting.is_empty() && self.ask(Cause::Start, has_left_resting)? {
                return self.go_on_from_here(&[]);
            }
            if let Some(j) = zero {
                return self.settle_on(j);
            }
            return Ok(chatter);
        };
        self.stepper.interpolant().at(theta, &mut self.x);
        self.motion.project(t_stop, &mut self.x)?;
        let extension = self.stepper.interpolant();
        if self.motion.is_in_contact() && theta > 0.0 {
            // Contact has taken velocities from the state, which no surface tells of later.
            let mut extension = extension.clone();
            extension.lead_to(theta, &self.x);
            self.recorder.step(&extension, t_stop, &self.x);
        } else {
            self.recorder.step(extension, t_stop, &self.x);
        }
        self.t = t_stop;
        self.recent_dt = 0.0;
        self.chatter.forget();
        self.switch(&event)
    }

    /// The search of the step that was computed; and the user's functions.
    pub(super) fn step_search(&mut self) -> (StepSearch<'_, 'a>, &UserEvents<'a>) {
        let search = StepSearch {
            system: self.system,
            scale: &self.scale,
            t: self.t,
            x: &self.x,
            motion: &mut self.motion,
            stepper: &mut self.stepper,
            detector: &mut self.detector,
            stats: &mut self.stats,
            slacks: &self.slacks,
            rule: self.options.sliding,
            horizon: self.horizon,
            one_sided: self.one_sided,
        };
        (search, &self.recorder.user_events)
    }

    fn count_rejection(&mut self, sliding: bool) {
        self.stats.n_rejected += 1;
        self.stats.n_rejected_sliding += u64::from(sliding);
    }

    /// Closes the books.
    pub fn finish(mut self, stop: Stop) -> Solution {
        self.stats.n_field_evaluations += self.motion.field.n_evaluations();
        self.stats.stiff_since = self.stiffness.since;
        self.recorder.finish(
            (self.t, &self.x, self.options),
            self.motion.mode,
            stop,
            self.stats,
            self.warnings,
        )
    }
}
