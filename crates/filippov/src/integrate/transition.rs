//! From a located event, a limit or a start to the next motion: the decision is asked for, recorded and carried out.

use std::cell::RefCell;

use smallvec::{smallvec, SmallVec};

use crate::decision_record::decide_and_record;
use crate::decisions::{
    beyond_double_zero, decide, differs_between_sides, landing, limits::limit_here, refusal,
    root_ends, two_fold_here, vanishing_surfaces, warn_against_direction, Arrival, Cause, Decision,
    Leap, Left, Lefts, Next, Notes, Point, Reached, Rule, Values,
};
use crate::error::FieldError;
use crate::event::{Deflation, Found, Multiple, Seen};
use crate::field::{eval_on_side, Guard, ModeField, SmoothField};
use crate::integrate::integrator::Integrator;
use crate::integrate::steps::pace::excursion;
use crate::mode::Mode;
use crate::solution::Switch;
use crate::status::Stop;
use crate::stepper::{initial_step, restart_step};
use crate::switching::{Kind, Patience};
use crate::tolerances::{MOST_SWITCHES_AT_ONE_TIME, NO_PROGRESS, SMALLEST_GUESS, SMALL_JUMP};

impl<'a> Integrator<'a> {
    /// Asks a question about the current place; counts what the answer cost, and keeps its warnings.
    #[inline]
    pub(in crate::integrate) fn ask<R>(
        &mut self,
        cause: Cause,
        question: impl FnOnce(&Point<'_, '_, 'a>, &mut Notes) -> Result<R, FieldError>,
    ) -> Result<R, FieldError> {
        let mut departing = SmallVec::new();
        for monitored in &self.motion.monitored {
            if let (Guard::Surface(j), Some(Deflation { order: 2.., .. })) =
                (monitored.guard, monitored.deflation)
            {
                departing.push(j);
            }
        }
        let arrival = Arrival {
            cause,
            mode: &self.motion.mode,
            signs: &self.motion.signs,
            sliding: &self.motion.sliding,
            sides: &self.motion.sides,
            active: &self.motion.active,
            resting: &self.motion.resting,
            departing,
            switches: self.recorder.switches(),
            residuals: &self.residuals,
            passing: &self.passing,
            velocity: self.stepper.start_derivative(),
            field: RefCell::new(&mut self.motion.field),
        };
        let (watch, t) = (&self.watch, self.t);
        let is_over = || watch.stop().is_some() || watch.is_over(watch.now(), t);
        let at = Point {
            system: self.system,
            actions: self.actions,
            scale: &self.scale,
            t: self.t,
            x: &self.x,
            q: &self.motion.discrete,
            arrival: &arrival,
            policy: self.options.into(),
            patience: Patience::until(&is_over),
        };
        let mut notes = Notes {
            n_choices: self.n_choices,
            ..Notes::default()
        };
        let answer = question(&at, &mut notes);
        self.stats.n_field_evaluations += notes.n_field_evaluations;
        self.stats.n_surface_evaluations += notes.n_surface_evaluations;
        self.n_choices = notes.n_choices;
        // What an interrupted decision warns of need not hold.
        if !notes.warnings.is_empty() && self.watch.stop().is_none() {
            self.warnings.append(&mut notes.warnings);
        }
        answer
    }

    /// Decides which motion follows at the current place.
    pub(in crate::integrate) fn decide(&mut self, cause: Cause) -> Result<Decision, FieldError> {
        self.decide_where_reached(cause, &mut Reached::default())
    }

    /// The same after an event; `reached` becomes what vanishes there.
    #[inline]
    fn decide_where_reached(
        &mut self,
        cause: Cause,
        reached: &mut Reached,
    ) -> Result<Decision, FieldError> {
        let mut decision = if self.recorder.decisions.len() < self.options.keep_decisions {
            let kept = self.ask(cause, |at, notes| decide_and_record(at, notes, reached));
            let (decision, record) = kept?;
            // One that was interrupted depends on the time it had.
            if self.watch.stop().is_none() {
                self.recorder.decisions.push(record);
            }
            decision
        } else {
            self.ask(cause, |at, notes| decide(at, notes, reached))?
        };
        if let Some(stop) = self.watch.stop() {
            decision.decided = Err(stop);
        }
        Ok(decision)
    }

    /// Values of all switching functions at the current place.
    pub(in crate::integrate) fn surface_values(
        &mut self,
        signs: &[f64],
    ) -> Result<Values, FieldError> {
        let mut h: Values = smallvec![0.0; self.system.n_surfaces()];
        self.system.surfaces(self.t, &self.x, signs, &mut h)?;
        self.stats.n_surface_evaluations += 1;
        Ok(h)
    }

    /// Decides what follows the event and starts it.
    pub(in crate::integrate) fn switch(
        &mut self,
        event: &Found,
    ) -> Result<Option<Stop>, FieldError> {
        self.stats.n_switches += 1;
        if self.count_switches_here() > MOST_SWITCHES_AT_ONE_TIME {
            return self.leave_without_progress(event);
        }
        if !self.actions.list.is_empty() {
            let signs = self.motion.signs.clone();
            let h = self.surface_values(&signs)?;
            if let Some(done) = self.act_at_event(event, &h)? {
                return Ok(done);
            }
        }
        let mut at_two_fold = false;
        let is_end = |guard: &&Guard| matches!(guard, Guard::Multiplier { .. });
        let n_ends = event.guards.iter().filter(is_end).count();
        if n_ends > 0 && self.motion.sliding.len() == 1 {
            if let Some(done) = self.pass_double_zero(event)? {
                return Ok(done);
            }
            at_two_fold = self.arrives_at_two_fold(event, n_ends)?;
        }
        let mut reached = Reached::default();
        let cause = Cause::Event {
            functions: &event.guards,
            touch: event.touch,
            vanishing: event.multiple.vanishing,
            at_two_fold,
        };
        let Decision { decided, rule } = self.decide_where_reached(cause, &mut reached)?;
        let Reached { surfaces, before } = reached;
        self.residuals.clear();
        let mut next = match decided {
            Ok(next) => next,
            Err(stop) => return Ok(Some(stop)),
        };
        let is_changed = |j: &usize| before.entries()[*j] != next.mode.entries()[*j];
        let mut concerned = surfaces;
        match rule {
            Rule::Touch => {}
            Rule::Contact | Rule::Triggers => {
                let all = 0..before.entries().len();
                let changed: SmallVec<[usize; 4]> = all.filter(is_changed).collect();
                if !changed.is_empty() || rule == Rule::Triggers {
                    concerned = changed;
                }
            }
            _ => {
                if !self.motion.sliding.is_empty() {
                    concerned.extend(self.motion.sliding.iter().copied());
                    concerned.sort_unstable();
                    concerned.dedup();
                }
                if concerned.len() > 1 && concerned.iter().any(is_changed) {
                    concerned.retain(|j| is_changed(j));
                }
                // Stability is lost, and the motion stays all the same: it oscillates around the root from now on.
                let sliding = self.motion.sliding().iter().copied();
                let slides_on = next.mode.sliding_set().eq(sliding);
                let field = &self.motion.field;
                if slides_on && root_ends::loses_stability(field, &event.guards) {
                    next.start_mut().oscillates = true;
                }
                if before == next.mode {
                    root_ends::loosen(field, &event.guards, &mut self.slacks);
                } else {
                    self.slacks.clear();
                }
            }
        }
        self.record(before, next.mode.clone(), &concerned, rule.name())?;
        if !matches!(rule, Rule::Touch | Rule::Contact | Rule::Triggers) {
            if let Some(limit) = self.accumulation()? {
                return self.jump_to(limit, next.mode);
            }
        }
        self.begin_behind(next, &event.multiple)
    }

    /// How many switches came before this one without any progress of time.
    fn count_switches_here(&mut self) -> u32 {
        let (since, before) = self.last_switch;
        let is_progress = self.t != since && self.t - since > NO_PROGRESS * self.t.abs();
        self.last_switch = if is_progress || since.is_nan() {
            (self.t, 0)
        } else {
            (since, before + 1)
        };
        self.last_switch.1
    }

    /// After too many switches without any progress of time: goes on from their limit, or ends the run.
    fn leave_without_progress(&mut self, event: &Found) -> Result<Option<Stop>, FieldError> {
        let mut surfaces = self.recorder.surfaces_switched_at(self.t);
        if let Some(limit) = self.ask(Cause::Start, |at, _| limit_here(at, &surfaces))? {
            let mode = self.motion.mode.clone();
            return self.jump_to(limit, mode);
        }
        if surfaces.is_empty() {
            let named = event.guards.iter().filter_map(|f| match f {
                Guard::Surface(j) => Some(*j),
                _ => None,
            });
            surfaces.extend(named);
        }
        Ok(Some(Stop::NoProgress { surfaces }))
    }

    /// Goes on beyond a double zero of the difference of the normal components, if sliding has come to one: what came of
    /// that.
    fn pass_double_zero(&mut self, event: &Found) -> Result<Option<Option<Stop>>, FieldError> {
        let &[j] = self.motion.sliding() else {
            return Ok(None);
        };
        if !self.may_lose_multiplier() {
            return Ok(None);
        }
        let Reached {
            surfaces,
            before: mode,
        } = self.vanishing_surfaces(event)?;
        if !surfaces.is_empty() {
            return Ok(None);
        }
        let beyond = self.ask(Cause::Anew(&mode), |at, notes| {
            beyond_double_zero(at, notes, j)
        })?;
        let Some((t, end)) = beyond.filter(|(t, _)| *t <= self.horizon) else {
            return Ok(None);
        };
        self.move_straight(t, end)?;
        self.record(mode.clone(), mode.clone(), &[], Rule::OneSurface.name())?;
        let next = Next::new(mode, Lefts::new());
        Ok(Some(self.begin(next)?))
    }

    /// Has sliding on one surface come to a two-fold? Then the point is moved there.
    fn arrives_at_two_fold(&mut self, event: &Found, n_ends: usize) -> Result<bool, FieldError> {
        if n_ends == 1 && !self.approaches_two_fold() {
            return Ok(false);
        }
        let Reached {
            surfaces,
            before: mode,
        } = self.vanishing_surfaces(event)?;
        if !surfaces.is_empty() {
            return Ok(false);
        }
        let Some((t, x)) = self.ask(Cause::Anew(&mode), |at, _| two_fold_here(at))? else {
            return Ok(false);
        };
        if t > self.t && t <= self.horizon {
            self.move_straight(t, x)?;
        }
        Ok(true)
    }

    /// The surfaces that vanish at an event, those slid on left out, and the mode before.
    fn vanishing_surfaces(&mut self, event: &Found) -> Result<Reached, FieldError> {
        let cause = Cause::Event {
            functions: &event.guards,
            touch: event.touch,
            vanishing: [0; 2],
            at_two_fold: false,
        };
        self.ask(cause, vanishing_surfaces)
    }

    /// Is the difference of the normal components at the end of the step so small, compared with the speed, that the
    /// multiplier may be lost? Far from it nothing else has to be looked at.
    fn may_lose_multiplier(&self) -> bool {
        let [minus, plus, ..] = self.detector.seen.as_slice() else {
            return false;
        };
        let speed = self.stepper.end_derivative().iter();
        let speed = speed.fold(0.0_f64, |most, v| most.max(v.abs()));
        let least = (minus.start + plus.start).min(minus.end + plus.end);
        least <= (SMALL_JUMP * self.options.rtol).min(1.0) * speed
    }

    /// Does the share of f+ change fast in the step just made, towards a two-fold?
    pub(in crate::integrate) fn approaches_two_fold(&self) -> bool {
        let [minus, plus, ..] = self.detector.seen.as_slice() else {
            return false;
        };
        let (before, after) = (minus.start + plus.start, minus.end + plus.end);
        self.motion.sliding.len() == 1 && after < 0.99 * before
    }

    /// Records a switch between two modes that leaves the state as it is.
    pub(in crate::integrate) fn record(
        &mut self,
        before: Mode,
        after: Mode,
        surfaces: &[usize],
        rule: &'static str,
    ) -> Result<(), FieldError> {
        let kind = Kind::between(&before, &after);
        if kind == Kind::Crossing && !self.actions.list.is_empty() {
            self.look_at_directions(&before, &after, surfaces)?;
        }
        self.recorder.switch(Switch {
            t: self.t,
            y_before: SmallVec::from_slice(&self.x),
            y_after: SmallVec::from_slice(&self.x),
            kind,
            surfaces: SmallVec::from_slice(surfaces),
            mode_before: before,
            mode_after: after,
            note: String::new(),
            rule,
        });
        Ok(())
    }

    /// Warns of triggers that the motion crosses against their direction. Each is looked at once.
    #[cold]
    fn look_at_directions(
        &mut self,
        before: &Mode,
        after: &Mode,
        surfaces: &[usize],
    ) -> Result<(), FieldError> {
        for &j in surfaces {
            let side = before.entries()[j];
            let is_crossed = side != 0 && after.entries()[j] == -side;
            let triggers = self.triggers();
            if !is_crossed || !triggers.is_only_trigger(j) || triggers.follows_law(j) {
                continue;
            }
            let is_triggered = self.triggered_at(j, side).next().is_some();
            if is_triggered || self.motion.passed.contains(&j) {
                continue;
            }
            self.motion.passed.push(j);
            self.ask(Cause::Anew(before), |at, notes| {
                warn_against_direction(at, notes, j, before)
            })?;
        }
        Ok(())
    }

    /// Starts a motion at the current point.
    pub(in crate::integrate) fn begin(&mut self, next: Next) -> Result<Option<Stop>, FieldError> {
        self.begin_behind(next, &Multiple::default())
    }

    /// The same where what the motion leaves has a multiple zero.
    fn begin_behind(
        &mut self,
        next: Next,
        multiple: &Multiple,
    ) -> Result<Option<Stop>, FieldError> {
        let Next {
            mode,
            mut left,
            mut start,
        } = next;
        self.stats.n_field_evaluations += self.motion.field.n_evaluations();
        let duration = self.t - self.motion.t_start;
        self.paces.remember(&self.motion.mode, self.dt, duration);
        let slid = !self.motion.sliding().is_empty();
        let mut leaps = false;
        if let Some(start) = &mut start {
            if let Some(x) = start.moved.take() {
                self.x = x;
            }
            if let Some(leap) = &start.leap {
                leaps = true;
                left = self.make_leap(leap)?;
            }
        }
        self.note_resting(&mode, &left)?;
        self.motion.restart(self.system, self.t, mode, &left);
        let zeros = self.motion.monitored.iter_mut();
        for zero in zeros.filter_map(|m| m.deflation.as_mut()) {
            zero.is_clean = !slid;
        }
        self.choose_stepper();
        let mut two_fold = None;
        match &mut self.motion.field {
            ModeField::Intersection(field) => {
                let start = start.as_deref();
                let multipliers = start.map_or(&[][..], |start| &start.multipliers);
                field.begin(multipliers, start.is_some_and(|start| start.oscillates));
                if let Some(start) = start.filter(|start| start.is_given) {
                    field.hold_at_start(self.t, start.is_located);
                }
                for &(guard, slack) in &self.slacks {
                    field.set_slack(guard, slack);
                }
            }
            ModeField::Sliding(field) => {
                if let Some(motion) = start.and_then(|start| start.two_fold) {
                    let reach = motion.reach(self.options.rtol);
                    two_fold = Some((motion, reach));
                    field.begin_at_two_fold(self.t, self.t, motion);
                }
            }
            _ => {}
        }
        self.motion.project(self.t, &mut self.x)?;
        self.evaluate_start()?;
        if self.motion.sliding.len() > 1 {
            self.note_oscillation();
        }
        if !leaps {
            let multipliers = self.motion.multipliers();
            self.recorder.begin_segment(
                self.t,
                &self.motion.mode,
                multipliers,
                &self.motion.discrete,
            );
        }
        if self.motion.sliding.len() > 1 {
            if let Some(stop) = refusal(&self.motion.field, &self.motion.sliding) {
                return Ok(Some(stop));
            }
        }
        if self.system.has_nested_signs() {
            if let Some(stop) = self.differs_between_sides(self.t, &self.x)? {
                return Ok(Some(stop));
            }
        }
        let derivative = self.stepper.start_derivative();
        if derivative.iter().any(|v| !v.is_finite()) {
            return Ok(Some(Stop::NotFinite));
        }
        let start = (self.t, &self.x[..], derivative);
        self.detector.measure(self.system, &self.motion, start)?;
        self.detector
            .accept_start(&mut self.motion.monitored, multiple);
        self.user_events.restart(self.t, &self.x)?;
        self.controller.restart();
        self.dt = self.first_step(&left)?;
        if let (Some((motion, reach)), ModeField::Sliding(field)) =
            (two_fold, &mut self.motion.field)
        {
            if reach > 0.0 {
                self.dt = self.dt.min(reach);
                let until = if reach.is_finite() { reach } else { self.dt };
                field.begin_at_two_fold(self.t, self.t + until, motion);
            }
        }
        Ok(None)
    }

    /// Does the motion slide between fields that differ in more signs than those of the surfaces slid on?
    pub(in crate::integrate) fn differs_between_sides(
        &self,
        t: f64,
        x: &[f64],
    ) -> Result<Option<Stop>, FieldError> {
        let motion = &self.motion;
        let is_checked = |k: usize| motion.active[k] && !motion.resting.contains(&k);
        differs_between_sides(
            self.system,
            (t, x),
            &motion.mode,
            &motion.sliding,
            is_checked,
        )
    }

    /// Begins the segment of a motion that starts with a leap, and makes that; what the motion leaves at its end.
    fn make_leap(&mut self, leap: &Leap) -> Result<Lefts, FieldError> {
        let room = self.horizon - self.t;
        let landing = self.ask(Cause::Start, |at, notes| landing(leap, at, notes, room))?;
        let region = leap.region.clone();
        self.motion.restart(self.system, self.t, region, &[]);
        let discrete = &self.motion.discrete;
        self.recorder
            .begin_segment(self.t, &leap.region, SmallVec::new(), discrete);
        self.move_straight(landing.t, landing.x)?;
        Ok(landing.left)
    }

    /// Records a straight line to a later point: the motion in between has more switches than can be listed.
    pub(in crate::integrate) fn move_straight(
        &mut self,
        t: f64,
        end: Vec<f64>,
    ) -> Result<(), FieldError> {
        self.stepper.set_straight(self.t, t - self.t, &self.x, &end);
        self.sample(t)?;
        self.recorder.step(self.stepper.interpolant(), t, &end);
        (self.t, self.x) = (t, end);
        Ok(())
    }

    /// The derivative at the start of the motion, and its exit functions there.
    fn evaluate_start(&mut self) -> Result<(), FieldError> {
        self.series_reach = None;
        if self.start_with_series() {
            // Known.
        } else if let ModeField::Region(_) = &self.motion.field {
            let (signs, derivative) = (&self.motion.signs, self.stepper.start_derivative_mut());
            self.stats.n_field_evaluations +=
                eval_on_side(self.system, self.t, &self.x, signs, derivative)?;
        } else {
            let derivative = self.stepper.start_derivative_mut();
            self.motion.field.eval(self.t, &mut self.x, derivative)?;
            self.go_without_equations();
        }
        let exits = self.motion.field.last_exits();
        self.detector.seen.clear();
        let seen = exits.iter().map(|&exit| Seen::at_start(exit));
        self.detector.seen.extend(seen);
        Ok(())
    }

    /// Decides the mode anew at the current point and goes on.
    pub(in crate::integrate) fn go_on_from_here(&mut self) -> Result<Option<Stop>, FieldError> {
        let before = self.motion.mode.clone();
        let Decision { rule, decided } = self.decide(Cause::Anew(&before))?;
        match decided {
            Ok(next) => self.go_on_in(before, next, rule),
            Err(stop) => Ok(Some(stop)),
        }
    }

    /// Records what changes between two modes, if anything does, and starts the motion in the second.
    pub(in crate::integrate) fn go_on_in(
        &mut self,
        before: Mode,
        next: Next,
        rule: Rule,
    ) -> Result<Option<Stop>, FieldError> {
        let entries = before.entries().iter().zip(next.mode.entries()).enumerate();
        let changed = entries.filter(|(_, (before, after))| before != after);
        let changed: Vec<usize> = changed.map(|(j, _)| j).collect();
        if !changed.is_empty() {
            self.record(before, next.mode.clone(), &changed, rule.name())?;
        }
        self.begin(next)
    }

    /// Finds the mode of the initial state and starts the motion.
    pub(in crate::integrate) fn start(&mut self) -> Result<Option<Stop>, FieldError> {
        self.recorder.start(self.t, &self.x);
        if !self.actions.list.is_empty() {
            return self.start_with_actions();
        }
        match self.decide(Cause::Start)?.decided {
            Ok(next) => self.begin(next),
            Err(stop) => Ok(Some(stop)),
        }
    }

    /// The first step of a motion: what the last motion in its mode suggests; else the proposal of the
    /// motion before, as far as Hairer's guess for this one supports it. No longer than a short
    /// excursion from the surface.
    pub(in crate::integrate) fn first_step(&mut self, left: &[Left]) -> Result<f64, FieldError> {
        let remaining = (self.t_end - self.t).max(f64::MIN_POSITIVE);
        if let (Some(first), true) = (self.options.first_step, self.dt.is_nan()) {
            return Ok(first.max(SMALLEST_GUESS).min(remaining));
        }
        let longest = remaining.min(self.options.max_step);
        if self.motion.jets.is_some() {
            // The series tells.
            return Ok(longest);
        }
        let (t, x, scale, field) = (self.t, &self.x, &self.scale, &mut self.motion.field);
        let derivative = self.stepper.start_derivative();
        let mode = &self.motion.mode;
        let mut dt = match self.paces.first_step(mode, x, derivative, scale) {
            Some(dt) => dt.min(longest),
            None if self.dt.is_nan() => initial_step(field, t, x, derivative, scale, longest)?,
            None => restart_step(field, t, x, derivative, scale, self.dt.min(longest))?,
        };
        let place = (self.t, &self.x[..]);
        for left in left {
            if let Some(j) = left.surface() {
                let room = excursion(self.system, place, &self.motion.mode, j, left.leading)?;
                dt = dt.min(room);
            }
        }
        Ok(dt)
    }
}
