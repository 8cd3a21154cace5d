//! Where actions are due: at a start, at a known time, at an event.

use crate::action::Instant;
use crate::decisions::{
    add_vanishing_surfaces, goes_through, limits::limits_of_impacts, located_surfaces, sides,
    triggers_reached, warn_unknown_side, Cause, Notes, Reached, Sides, Values,
};
use crate::error::FieldError;
use crate::event::{Found, Multiple};
use crate::integrate::integrator::Integrator;
use crate::motion::Guard;
use crate::patience::Patience;
use crate::status::Stop;

impl Integrator<'_> {
    /// A start with actions: those of this time, and those whose surface the motion leads through from here.
    #[cold]
    pub(in crate::integrate) fn start_with_actions(&mut self) -> Result<Option<Stop>, FieldError> {
        self.system.set_discrete(&self.motion.discrete);
        let Some(Sides {
            mut mode,
            on_surface,
        }) = self.ask(Cause::Start, |at, notes| sides(at, notes, None))?
        else {
            return Ok(Some(Stop::NotFinite));
        };
        let mut due = self.timetable.take(self.actions, self.t);
        self.horizon = self.timetable.horizon(self.actions, self.t, self.t_end);
        for j in 0..on_surface.len() {
            if !on_surface[j] || !self.motion.triggers(self.system).is_only_trigger(j) {
                continue;
            }
            let side = self.motion.triggers(self.system).side(j, None);
            mode.set(j, side);
            self.ask(Cause::Start, |at, notes| {
                warn_unknown_side(at, notes, j, &mode)
            })?;
            let through = self.ask(Cause::Anew(&mode), |at, notes| {
                goes_through(at, notes, j, side, &mode, &on_surface)
            })?;
            if through {
                due.extend(self.actions.triggered_at(j, side));
            }
        }
        if due.is_empty() {
            return match self.decide(Cause::Start, &mut Reached::default())?.decided {
                Ok(next) => self.begin(next, &Multiple::default()),
                Err(stop) => Ok(Some(stop)),
            };
        }
        self.motion.restart(self.system, self.t, mode, &[]);
        due.sort_unstable();
        due.dedup();
        self.act(due)
    }

    /// The end of the span, or a known time of actions.
    #[cold]
    pub(in crate::integrate) fn reach_horizon(&mut self) -> Result<Option<Stop>, FieldError> {
        let mut due = self.timetable.take(self.actions, self.t);
        self.horizon = self.timetable.horizon(self.actions, self.t, self.t_end);
        if !self.actions.list.is_empty() {
            let (h, reached) = self.ask(Cause::Start, |at, notes| {
                let h = at.surface_values(notes, at.arrival.signs)?;
                let reached = triggers_reached(at, &h)?;
                Ok((h, reached))
            })?;
            self.residuals = self.motion.residuals(&h, &reached);
            for j in reached {
                due.extend(self.actions.triggered_at(j, self.motion.mode.entries()[j]));
            }
            due.sort_unstable();
            due.dedup();
        }
        if !due.is_empty() {
            self.control.forget_steps();
            return self.act(due);
        }
        Ok((self.t >= self.t_end).then_some(Stop::End))
    }

    /// Does what an event triggers; `None` if that is nothing and the decision is an ordinary one.
    pub(in crate::integrate) fn act_at_event(
        &mut self,
        event: &Found,
        h: &Values,
    ) -> Result<Option<Option<Stop>>, FieldError> {
        if event.touch {
            return Ok(None);
        }
        let mode = self.motion.mode.clone();
        let (surfaces, rates) = self.ask(Cause::Anew(&mode), |at, _| {
            let mut surfaces = located_surfaces(&event.guards);
            add_vanishing_surfaces(at, &mut surfaces, h)?;
            Ok((surfaces, at.rates_here()?))
        })?;
        let located = |j: usize| event.guards.contains(&Guard::Surface(j));
        let entries = self.motion.mode.entries();
        let reached = surfaces.iter().copied().filter(|&j| {
            let approaches = rates[j] * f64::from(entries[j]) < 0.0;
            // Rounding may show a zero where the motion leaves.
            let is_tangent = located(j) && rates[j] == 0.0;
            entries[j] != 0 && (approaches || is_tangent)
        });
        let mut due: Vec<usize> = Vec::new();
        for j in reached {
            due.extend(self.actions.triggered_at(j, entries[j]));
        }
        if !due.is_empty() {
            if self.t >= self.horizon {
                due.extend(self.timetable.take(self.actions, self.t));
                self.horizon = self.timetable.horizon(self.actions, self.t, self.t_end);
            }
            due.sort_unstable();
            due.dedup();
            self.residuals = self.motion.residuals(h, &surfaces);
            return self.act(due).map(Some);
        }
        let departs = |j: &&usize| {
            rates[**j] * f64::from(entries[**j]) > 0.0
                && self.motion.triggers(self.system).is_only_trigger(**j)
        };
        let departing: Vec<(usize, f64)> = surfaces
            .iter()
            .filter(departs)
            .map(|&j| (j, rates[j]))
            .collect();
        if !departing.is_empty() {
            self.residuals = self.motion.residuals(h, &surfaces);
            return self.go_on_from_here(&departing).map(Some);
        }
        if !self.motion.is_in_contact() && surfaces.len() > 1 {
            self.residuals = self.motion.residuals(h, &surfaces);
        }
        Ok(None)
    }

    /// Does these actions and those that they trigger, and goes on with the motion that follows.
    pub(in crate::integrate) fn act(
        &mut self,
        due: Vec<usize>,
    ) -> Result<Option<Stop>, FieldError> {
        if let Some(stop) = self.recorder.zeros_before_jump(self.t, &self.x) {
            return Ok(Some(stop));
        }
        let before = self.motion.mode.clone();
        let first = self.recorder.switches().len();
        let arrived = self.x.clone();
        let stopped = self.do_actions(due)?;
        self.recorder.set_jump(first, &arrived, &self.x);
        if stopped.is_some() {
            return Ok(stopped);
        }
        let decided = self
            .decide(Cause::Anew(&before), &mut Reached::default())?
            .decided;
        let next = match decided {
            Ok(next) => next,
            Err(stop) => return Ok(Some(stop)),
        };
        self.residuals.clear();
        self.passing.clear();
        self.recorder.set_last_mode(first, &next.mode);
        let limits = self.ask(Cause::Start, |at, _| {
            limits_of_impacts(at, first, &next.mode)
        })?;
        let mut limits = limits.into_iter().flatten();
        if let Some(rest) = limits.find(|limit| limit.t <= self.horizon) {
            return self.jump_to(rest, next.mode);
        }
        let t = self.t;
        let stop = self.begin(next, &Multiple::default())?;
        if self.t == t {
            // Contact that begins with a speed below the tolerance takes that away.
            self.recorder.jump(t, &self.x);
            self.recorder.set_jump(first, &arrived, &self.x);
        }
        Ok(stop)
    }

    /// Does these actions and those that they trigger; why the run ends with them, if it does.
    fn do_actions(&mut self, due: Vec<usize>) -> Result<Option<Stop>, FieldError> {
        let mut notes = Notes {
            n_choices: self.n_choices,
            ..Notes::default()
        };
        let (watch, t) = (&self.watch, self.t);
        let is_over = || watch.stop().is_some() || watch.is_over(watch.now(), t);
        let mut instant = Instant {
            system: self.system,
            actions: self.actions,
            scale: &self.scale,
            policy: self.options.into(),
            t,
            x: &mut self.x,
            motion: &mut self.motion,
            residuals: &self.residuals,
            velocity: self.stepper.start_derivative(),
            switches: self.recorder.switches(),
            patience: Patience::until(&is_over),
            notes: &mut notes,
            done: Vec::new(),
            passing: Vec::new(),
        };
        let stopped = instant.act(due);
        let Instant { done, passing, .. } = instant;
        self.passing = passing;
        self.stats.n_switches += done.len() as u64;
        done.into_iter()
            .for_each(|switch| self.recorder.switch(switch));
        self.recorder.jump(t, &self.x);
        self.take_notes(notes);
        stopped
    }
}
