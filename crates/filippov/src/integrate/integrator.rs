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
use crate::decisions::{differs_between_sides, has_left_zero_surface, lost_guards, Cause};
use crate::error::{Error, FieldError};
use crate::event::search::{Detector, StepSearch};
use crate::event::{Event, Found, StepEnd};
use crate::integrate::problem::{check, Problem};
use crate::integrate::progress::{Progress, Reached};
use crate::integrate::watch::Watch;
use crate::mode::Mode;
use crate::motion::{Run, Slacks, SmoothField};
use crate::record::{Observed, Observer, Recorder, Solution};
use crate::status::{Stop, Warning};
use crate::stepper::{shortest_step, Attempt, StepControl, Steppers, Stiff};
use crate::system::Trigger;
use crate::tolerances::{EPS, ROUNDING};

/// An integration in progress.
pub struct Integrator<'a> {
    pub(super) run: Run<'a>,
    pub(super) t_end: f64,
    pub(super) timetable: Timetable,
    /// The next known time of an action, or the end: no step goes beyond it.
    pub(super) horizon: f64,
    pub(super) stepper: Steppers,
    pub(super) control: StepControl,
    pub(super) detector: Detector,
    pub(super) recorder: Recorder<'a>,
    pub(super) warnings: Vec<Warning>,
    /// How many non-unique points were met.
    pub(super) n_choices: usize,
    pub(super) progress: Progress,
    /// Guards of this mode whose multipliers were held at their ends, with what they may go beyond.
    pub(super) slacks: Slacks,
    pub(super) watch: Watch<'a>,
    /// The mode in which the motion stays whatever its guards are, if it is such a run.
    pub(super) held: Option<&'a Mode>,
}

impl<'a> Integrator<'a> {
    /// Checks the arguments.
    ///
    /// # Errors
    /// If one is out of range.
    pub fn new(problem: Problem<'a>) -> Result<Self, Error> {
        let Problem {
            system,
            t_span,
            y0,
            options,
            events,
            actions,
            held,
        } = problem;
        check(&problem)?;
        let n = system.n_states();
        let mut run = Run::new(system, options, actions, (t_span.0, y0));
        run.motion.look_around(system, t_span.0, y0);
        Ok(Integrator {
            t_end: t_span.1,
            held,
            timetable: Timetable::new(actions, t_span.0),
            horizon: t_span.1,
            stepper: Steppers::new(&run, t_span.1 - t_span.0),
            run,
            control: StepControl::new(),
            detector: Detector::new(n, system.n_surfaces()),
            recorder: Recorder::new(n, options, events),
            warnings: Vec::new(),
            n_choices: 0,
            progress: Progress::default(),
            slacks: Slacks::default(),
            watch: Watch::new(options),
        })
    }

    /// Asks `interrupt` every few steps, and during long decisions, with the place reached; the run stops where it returns
    /// `true`.
    #[must_use]
    pub fn interruptible(mut self, interrupt: &'a mut (dyn FnMut(Reached) -> bool + 'a)) -> Self {
        self.watch.ask(interrupt);
        self
    }

    /// Hands every accepted step and every instant to an observer.
    ///
    /// # Example
    ///
    /// The saltation matrix of an instant without a jump of the state is I + (F+ - F-) dg / (dg . F-): here that of a
    /// sign that is crossed at speed 1, across which the other component changes its velocity from -1 to 1.
    ///
    /// ```
    /// use filippov::{ClosureSystem, InstantRecord, Integrator, Observer, Problem};
    ///
    /// struct Saltation(Vec<f64>);
    ///
    /// impl Observer for Saltation {
    ///     fn instant(&mut self, instant: &InstantRecord) {
    ///         let ([before, after], g) = (instant.field, instant.gradient);
    ///         let pairs = g.state.iter().zip(before);
    ///         let rate = g.time + pairs.map(|(g, f)| g * f).sum::<f64>();
    ///         for (i, (after, before)) in after.iter().zip(before).enumerate() {
    ///             for (j, g) in g.state.iter().enumerate() {
    ///                 let unit = if i == j { 1.0 } else { 0.0 };
    ///                 self.0.push(unit + (after - before) * g / rate);
    ///             }
    ///         }
    ///     }
    /// }
    ///
    /// let system = ClosureSystem::new(
    ///     2,
    ///     1,
    ///     |_, _, s, dx| (dx[0], dx[1]) = (1.0, s[0]),
    ///     |_, x, h| h[0] = x[0] - 0.5,
    /// );
    /// let problem = Problem::new(&system, (0.0, 1.0), &[0.0, 0.0]);
    /// let mut saltation = Saltation(Vec::new());
    /// Integrator::new(problem)?.observed_by(&mut saltation).solve();
    /// for (entry, exact) in saltation.0.iter().zip([1.0, 0.0, 2.0, 1.0]) {
    ///     assert!((entry - exact).abs() < 1e-9);
    /// }
    /// # Ok::<(), filippov::Error>(())
    /// ```
    #[must_use]
    pub fn observed_by(mut self, observer: &'a mut dyn Observer) -> Self {
        self.recorder.observed = Some(Observed::by(observer));
        self
    }

    /// The time reached.
    pub fn t(&self) -> f64 {
        self.run.t
    }

    /// The state there.
    pub fn x(&self) -> &[f64] {
        &self.run.x
    }

    /// The mode of the motion from there.
    pub fn mode(&self) -> &Mode {
        &self.run.motion.mode
    }

    /// Runs to the end.
    pub fn solve(mut self) -> Solution {
        let stop = loop {
            match self.step() {
                Ok(None) => {}
                Ok(Some(stop)) => break stop,
                Err(raised) => break Stop::FieldRaised(raised),
            }
        };
        self.finish(stop)
    }

    /// Goes on: at first the mode of the start is found; then it is one step, accepted up to its end or to the first event, or
    /// rejected. Why the run ends, if it does.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn step(&mut self) -> Result<Option<Stop>, FieldError> {
        if !self.watch.is_started() {
            self.watch.start();
            return self.start();
        }
        let attempts = self.run.stats.n_steps + self.run.stats.n_rejected;
        if attempts >= self.run.options.max_steps {
            return Ok(Some(Stop::MaxSteps));
        }
        if self.run.stats.n_events >= self.run.options.max_events {
            return Ok(Some(Stop::MaxEvents));
        }
        self.watch.look(attempts, self.progress.reached(self.run.t));
        if self.watch.has_ended() {
            return Ok(self.watch.stop());
        }
        match self.attempt_step() {
            Ok(None) => Ok(self.recorder.stop_at_section()),
            Ok(Some(
                stop @ (Stop::NotFinite
                | Stop::StepTooSmall
                | Stop::NoProgress { .. }
                | Stop::Intersection { .. }),
            )) => self.rest_or_stop(stop),
            ended => ended,
        }
    }

    #[inline(always)]
    fn attempt_step(&mut self) -> Result<Option<Stop>, FieldError> {
        let remaining = self.horizon - self.run.t;
        if remaining <= 0.0 {
            return self.reach_horizon();
        }
        if self.stepper.is_to_prepare() {
            let (run, stepper) = (&mut self.run, &mut self.stepper);
            if let Some(warning) = self.control.prepare(run, stepper, self.t_end)? {
                self.warnings.push(*warning);
            }
        }
        let room = (remaining, self.horizon >= self.t_end);
        let dt = self.control.next(&self.run, room)?;
        let shortest = shortest_step(self.run.t);
        if dt < shortest && dt < remaining {
            let lost = self.ask(Cause::Start, lost_guards)?;
            if let Some(lost) = lost {
                self.control.forget_proposal();
                return self.switch(&Found::here(lost));
            }
            if !self.control.is_one_sided() {
                return Ok(Some(Stop::StepTooSmall));
            }
            let arrival = self.step_search().0.arrival_at_edge()?;
            return match arrival {
                Some(event) => {
                    self.control.forget_proposal();
                    self.switch(&event)
                }
                None => Ok(Some(Stop::NotFinite)),
            };
        }
        let sliding = !self.run.motion.sliding().is_empty();
        let attempt = self.stepper.attempt(&mut self.run, dt)?;
        // The method may have made it shorter.
        let dt = self.stepper.interpolant().dt;
        match attempt {
            Attempt::NotFinite => {
                self.run.stats.reject(sliding);
                self.control.shorten_to_surface(dt, &self.run)?;
                Ok(None)
            }
            Attempt::Error(error) if error > 1.0 => {
                self.run.stats.reject(sliding);
                self.control.reject(&self.stepper, dt, error);
                Ok(None)
            }
            Attempt::Error(error) => self.advance(dt, error),
        }
    }

    /// Accepts the step, or its part up to the first event.
    fn advance(&mut self, dt: f64, error: f64) -> Result<Option<Stop>, FieldError> {
        let sliding = !self.run.motion.sliding().is_empty();
        let t1 = if dt == self.horizon - self.run.t {
            self.horizon
        } else {
            self.run.t + dt
        };
        let (event, longest) = self.step_search().0.first_event(t1, dt)?;
        let found = match event {
            Event::None => None,
            Event::At(found) => Some(found),
            Event::Shorten(dt) => {
                self.run.stats.reject(sliding);
                self.control.shorten(dt);
                return Ok(None);
            }
        };
        if sliding && self.run.system.has_nested_signs() {
            let (mut end, mut t) = (self.stepper.end().to_vec(), t1);
            if let Some(event) = &found {
                self.stepper.interpolant().at(event.theta, &mut end);
                t = self.run.t + event.theta * dt;
            }
            if let Some(stop) = differs_between_sides(self.run.system, (t, &end), &self.run.motion)?
            {
                if dt < ROUNDING * self.run.t.abs().max(1.0) / EPS.sqrt() {
                    return Ok(Some(stop));
                }
                self.run.stats.reject(sliding);
                self.control.shorten(0.5 * dt);
                return Ok(None);
            }
        }
        let theta = found.as_ref().map_or(1.0, |event| event.theta);
        let crosses = found
            .as_ref()
            .is_some_and(|event| !event.touch && !event.is_blurred);
        let aims = crosses && self.stepper.ends_at_events();
        if aims && self.control.aims_again(self.run.t, theta, dt) {
            return Ok(None);
        }
        let t_stop = if theta == 1.0 {
            t1
        } else {
            self.run.t + theta * dt
        };
        // A switch at the end of the span, or at a known time, is there, and not a rounding before.
        let last = self.horizon;
        let is_last = t_stop < last && last - t_stop < ROUNDING * last.abs();
        let t_stop = if is_last { last } else { t_stop };
        if !self.recorder.user_events.events.is_empty() {
            let end = self.end_of_step(found.as_ref(), t_stop);
            self.recorder.user_events.expect(end, found.as_ref());
        }
        let (mut search, recorder) = self.step_search();
        let Some(zeros) = recorder.find_user_zeros(&mut search, theta, t_stop)? else {
            self.run.stats.reject(sliding);
            self.control.shorten(0.5 * dt);
            return Ok(None);
        };
        self.run.stats.n_steps += 1;
        self.run.stats.n_steps_sliding += u64::from(sliding);
        self.stepper.count(&mut self.run.stats);
        self.control.accept(&self.stepper, dt, error);
        self.control.limit(self.run.longest_by_exits(dt));
        if self.control.is_short(dt, self.horizon - self.run.t) {
            // Towards a fold of the multipliers the field of an intersection bends like a square root, and towards a
            // two-fold the multiplier is a quotient of small numbers.
            let may_bend = match self.run.motion.sliding.len() {
                0 => false,
                1 => self.run.approaches_two_fold(),
                _ => true,
            };
            if !may_bend {
                let warning = self.control.look_for_jump(&self.stepper, (self.run.t, dt));
                self.warnings.extend(warning);
            }
        }
        self.control.note_length(dt);
        let chatter = self.control.look_for_chatter(&self.stepper, dt);
        let (mut search, recorder) = self.step_search();
        if let Some(stop) = recorder.record_user_zeros(&mut search, zeros, (theta, t_stop))? {
            return Ok(Some(stop));
        }
        self.control.note_edge(longest, dt);
        if self.recorder.needs_extensions() {
            self.stepper.extend_cheaply(&self.run.x);
        }
        let (stepper, motion) = (&mut self.stepper, &mut self.run.motion);
        self.recorder
            .sample_step(t_stop, &self.run.x, stepper, motion)?;
        let Some(event) = found else {
            self.recorder
                .step(self.stepper.interpolant(), t1, self.stepper.end());
            let zero = self.zero_surface(t1)?;
            let mut stiffness = Stiff::Nothing;
            if self.control.stiffness_is_due(self.run.stats.n_steps) {
                let (run, stepper) = (&mut self.run, &mut self.stepper);
                stiffness = self.control.look_for_stiffness(run, stepper)?;
            }
            self.stepper.accept(&mut self.run.x);
            self.run.t = t1;
            self.run.motion.field.come_to(t1);
            if let Stiff::Warning(warning) = stiffness {
                self.warnings.push(*warning);
            } else if let Stiff::GoOnImplicitly = stiffness {
                let (run, stepper) = (&mut self.run, &mut self.stepper);
                self.control.go_on_implicitly(run, stepper);
            }
            if self.detector.accept(&mut self.run, dt) {
                self.run.motion.note_departure();
            }
            if !self.run.motion.resting.is_empty()
                && self.ask(Cause::Start, has_left_zero_surface)?
            {
                return self.go_on_from_here(&[]);
            }
            if let Some(j) = zero {
                return self.settle_on(j);
            }
            return Ok(chatter);
        };
        self.stepper.interpolant().at(theta, &mut self.run.x);
        self.run.motion.project(t_stop, &mut self.run.x)?;
        let extension = self.stepper.interpolant();
        if self.run.motion.is_in_contact() && theta > 0.0 {
            // Contact has taken velocities from the state, which no surface tells of later.
            let mut extension = extension.clone();
            extension.lead_to(theta, &self.run.x);
            self.recorder.step(&extension, t_stop, &self.run.x);
        } else {
            self.recorder.step(extension, t_stop, &self.run.x);
        }
        self.run.t = t_stop;
        self.control.switched();
        self.switch(&event)
    }

    /// What happens at the end of the step, at `t_stop`, where these guards vanish.
    #[cold]
    fn end_of_step(&self, found: Option<&Found>, t_stop: f64) -> StepEnd {
        if found.is_none() && t_stop < self.horizon {
            return StepEnd::GoesOn;
        }
        let triggers = self.run.motion.triggers(self.run.system);
        let is_tick = t_stop >= self.horizon && self.horizon < self.t_end;
        let mut timed = self.run.actions.list.iter().filter(|action| {
            is_tick && !matches!(action.trigger, Trigger::Surface { .. } | Trigger::Jump)
        });
        let mut surfaces = found.iter().flat_map(|event| event.surfaces());
        let jumps = |j| triggers.at(j).any(|action| action.map.moves_state());
        let moves_state =
            surfaces.clone().any(jumps) || timed.any(|action| action.map.moves_state());
        match () {
            () if surfaces.any(|j| triggers.follows_law(j)) => StepEnd::Law,
            () if moves_state || t_stop >= self.t_end => StepEnd::Stops,
            () if is_tick => StepEnd::Law,
            () => StepEnd::GoesOn,
        }
    }

    /// The search of the step that was computed; and the record of what it finds.
    #[inline(always)]
    pub(super) fn step_search(&mut self) -> (StepSearch<'_, 'a>, &mut Recorder<'a>) {
        let search = StepSearch {
            run: &mut self.run,
            stepper: &mut self.stepper,
            detector: &mut self.detector,
            slacks: &self.slacks,
            horizon: self.horizon,
            one_sided: self.control.is_one_sided(),
        };
        (search, &mut self.recorder)
    }

    /// Closes the books.
    pub fn finish(mut self, stop: Stop) -> Solution {
        if let Some(observed) = &mut self.recorder.observed {
            observed.end(&mut self.run);
        }
        self.run.stats.n_field_evaluations += self.run.motion.field.n_evaluations();
        self.run.stats.stiff_since = self.control.stiff_since();
        self.progress.note_end(&mut self.run.stats);
        let sides = match self.run.actions.list.is_empty() {
            true => Vec::new(),
            false => self.run.motion.sides.to_vec(),
        };
        self.recorder.finish(
            (self.run.t, &self.run.x, self.run.options),
            (self.run.motion.mode, self.run.motion.discrete, sides),
            stop,
            self.run.stats,
            self.warnings,
        )
    }
}
