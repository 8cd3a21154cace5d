//! From a located event, a limit or a start to the next motion: the decision is asked for, recorded and carried out.

use crate::action::{identity, quiet_change, Instant};
use crate::decisions::limits::{
    limit_here, limit_of_impact_rounds, limit_of_switches, limit_of_unresolved_flights,
    limits_of_impacts, passed_beside, turn_of, Limit, Passed,
};
use crate::decisions::{
    add_vanishing_surfaces, cling, decide, differs_between_sides, end_of_sliding, goes_through,
    landing, located_surfaces, mean_of_rounds, refusal, rest_within_tolerance, side_of_rest, sides,
    triggers_reached, warn_against_direction, warn_oscillation, warn_unknown_side,
    warn_zero_surface, zero_surfaces, Cause, Clinging, Decision, EndOfSliding, Leap, Left, Lefts,
    Next, Notes, Point, Reached, RestingPlace, Rule, Scene, Sides, Values,
};
use crate::error::FieldError;
use crate::error_scale::Units;
use crate::event::{Found, Multiple};
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::motion::{
    Guard, Leading, ModeField, Projector, RootEnd, Run, Seen, SlidingSet, SmoothField,
};
use crate::page::IS_PAGE;
use crate::patience::Patience;
use crate::record::decide_and_record;
use crate::status::{is_named, Stop, Warning, WarningCode};
use crate::switch::{Kind, Switch};
use crate::system::{eval_on_side_in, ActionMap, Trigger};
use crate::tolerances::{DOUBTFUL, FEW_SWITCHES, MOST_SWITCHES_AT_ONE_TIME};
use smallvec::SmallVec;

impl<'a> Integrator<'a> {
    /// Asks a question about the current place; counts what the answer cost, and keeps its warnings.
    #[inline]
    pub(super) fn ask<R>(
        &mut self,
        cause: Cause,
        question: impl FnOnce(&Point<'_, '_, 'a>, &mut Notes) -> Result<R, FieldError>,
    ) -> Result<R, FieldError> {
        let (watch, reached) = (&self.watch, self.progress.reached(self.run.t));
        let is_over = || watch.stop().is_some() || watch.is_over(watch.now(), reached);
        let scene = Scene {
            run: &mut self.run,
            velocity: self.stepper.start_derivative(),
            switches: self.recorder.switches(),
            patience: Patience::until(&is_over),
        };
        let mut notes = Notes {
            n_choices: self.n_choices,
            ..Notes::default()
        };
        let answer = scene.ask(cause, &mut notes, question);
        self.take_notes(&mut notes);
        answer
    }

    /// Counts what questions cost, and keeps their warnings.
    #[inline(always)]
    pub(super) fn take_notes(&mut self, notes: &mut Notes) {
        self.run.stats.n_field_evaluations += notes.n_field_evaluations;
        self.run.stats.n_surface_evaluations += notes.n_surface_evaluations;
        self.n_choices = notes.n_choices;
        // What an interrupted decision warns of need not hold.
        if !notes.warnings.is_empty() && !self.watch.has_ended() {
            self.keep_warnings(std::mem::take(&mut notes.warnings));
        }
    }

    #[cold]
    fn keep_warnings(&mut self, warnings: Vec<Warning>) {
        for warning in warnings {
            let is_known = warning.code == WarningCode::ZeroSurface
                && is_named(&self.warnings, warning.surfaces[0]);
            if !is_known {
                self.warnings.push(warning);
            }
        }
    }

    /// Decides which motion follows at the current place. After an event, `reached` becomes what vanishes there.
    #[inline]
    pub(super) fn decide(
        &mut self,
        cause: Cause,
        reached: &mut Reached,
    ) -> Result<Decision, FieldError> {
        let mut decision = if self.recorder.decisions.len() < self.run.options.keep_decisions {
            let kept = self.ask(cause, |at, notes| decide_and_record(at, notes, reached));
            let (decision, record) = kept?;
            // An interrupted decision depends on the computing time it was given: it is not recorded.
            if !self.watch.has_ended() {
                self.recorder.decisions.push(record);
            }
            Ok(decision)
        } else {
            self.ask(cause, |at, notes| decide(at, notes, reached))
        };
        if let (Ok(decision), Some(stop)) = (&mut decision, self.watch.stop()) {
            decision.decided = Err(stop);
        }
        decision
    }

    /// Decides what follows the event and starts it.
    pub(super) fn switch(&mut self, event: &Found) -> Result<Option<Stop>, FieldError> {
        self.run.stats.n_events += 1;
        if self.run.stats.n_events >= FEW_SWITCHES {
            let (run, before) = (&self.run, self.recorder.switches());
            self.progress.note_place(run.t, &run.x, before, &run.scale);
        }
        if self.recorder.observed.is_some() {
            self.recorder.leave(&mut self.run, &event.guards)?;
        }
        let n_switches = self.progress.n_switches_at(self.run.t);
        if n_switches > MOST_SWITCHES_AT_ONE_TIME {
            return self.leave_without_progress(event);
        }
        if n_switches > 1 && self.recorder.only_touches_at(self.run.t) {
            let touched = self.recorder.surfaces_switched_at(self.run.t);
            let is_of_higher_degree = |j| self.run.system.reduced(&[j]).is_some();
            if matches!(touched[..], [j] if is_of_higher_degree(j)) {
                if let Some(ended) = cling_to_surface(self, (true, false))? {
                    return Ok(ended);
                }
            }
        }
        if let Some(j) = self.recorder.surface_touched_in_a_row() {
            if let Some(ended) = rest_on_touched(self, j)? {
                return Ok(ended);
            }
        }
        if !self.run.actions.list.is_empty() {
            follow_laws(self)?;
            let h = self.ask(Cause::Start, |at, notes| {
                at.surface_values(notes, at.arrival.signs)
            })?;
            if let Some(done) = self.act_at_event(event, &h)? {
                return Ok(done);
            }
        }
        let mut at_two_fold = false;
        let is_end = |guard: &&Guard| matches!(guard, Guard::Multiplier { .. });
        let n_ends = event.guards.iter().filter(is_end).count();
        let cause = |at_two_fold| Cause::Event {
            functions: &event.guards,
            touch: event.touch,
            vanishing: event.multiple.vanishing,
            at_two_fold,
        };
        let is_first_order = matches!(self.run.motion.field, ModeField::Sliding(_));
        if let (&[j], true) = (self.run.motion.sliding(), n_ends > 0 && is_first_order) {
            let speed = self.stepper.end_derivative().iter();
            let speed = speed.fold(0.0_f64, |most, v| most.max(v.abs()));
            let may_lose = self.run.may_lose_multiplier(speed);
            let approaches = n_ends > 1 || self.run.approaches_two_fold();
            let horizon = self.horizon;
            let end = match may_lose || approaches {
                false => EndOfSliding::Exit,
                true => self.ask(cause(false), |at, notes| {
                    end_of_sliding(at, notes, j, (may_lose, approaches), horizon)
                })?,
            };
            match end {
                EndOfSliding::Exit => {}
                EndOfSliding::DoubleZero((t, x), mode) => {
                    self.move_straight(t, x)?;
                    self.record(mode.clone(), mode.clone(), &[], Rule::OneSurface.name())?;
                    return self.begin(Next::new(mode, Lefts::new()), &Multiple::default());
                }
                EndOfSliding::TwoFold((t, x)) => {
                    at_two_fold = true;
                    if t > self.run.t && t <= self.horizon {
                        self.move_straight(t, x)?;
                    }
                }
            }
        }
        let mut reached = Reached::default();
        let n_choices = self.n_choices;
        let Decision { decided, rule } = self.decide(cause(at_two_fold), &mut reached)?;
        if self.n_choices > n_choices {
            // A root that holds the motion leaves no choice: beside it the fields are as rounding has them.
            if let Some(clinging) = find_clinging(self, (true, true))? {
                forget_choices(self);
                self.n_choices = n_choices;
                return follow_clinging(self, clinging);
            }
        }
        let Reached { surfaces, before } = reached;
        self.run.residuals.clear();
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
                if !self.run.motion.sliding.is_empty() {
                    concerned.extend(self.run.motion.sliding.iter().copied());
                    concerned.sort_unstable();
                    concerned.dedup();
                }
                if concerned.len() > 1 && concerned.iter().any(is_changed) {
                    concerned.retain(|j| is_changed(j));
                }
                // Stability is lost, and the motion stays all the same: it oscillates around the root from now on.
                let sliding = self.run.motion.sliding().iter().copied();
                let slides_on = next.mode.sliding_set().eq(sliding);
                let is_unstable = event.guards.contains(&Guard::Root(RootEnd::Stability));
                if slides_on && is_unstable && next.mode.codimension() > 2 {
                    next.start_mut().oscillates = true;
                }
                let slides_on_several = next.mode.codimension() > 1;
                match before == next.mode && slides_on_several {
                    true => self.slacks.loosen(&event.guards),
                    false => self.slacks.clear(),
                }
            }
        }
        if self
            .recorder
            .repeats_touch(self.run.t, (&before, &next.mode), &concerned)
        {
            return self.begin(next, &event.multiple);
        }
        let due = triggered_by_a_sign(&self.run, &before, &next.mode, &concerned);
        self.record(before, next.mode.clone(), &concerned, rule.name())?;
        if !due.is_empty() {
            let (system, t) = (self.run.system, self.run.t);
            self.run.motion.restart(system, t, next.mode, &[]);
            return self.act(due);
        }
        if !matches!(rule, Rule::Touch | Rule::Contact | Rule::Triggers) {
            // One surface meets no other, but perhaps its rate.
            let is_of_higher_degree = |j: usize| self.run.system.reduced(&[j]).is_some();
            if self.run.system.n_surfaces() > 1 || is_of_higher_degree(0) {
                let turn = turn_of(self.recorder.switches());
                let limit = self.ask(Cause::Start, |at, _| limit_of_switches(at, turn))?;
                if let Some(limit) = limit.filter(|limit| limit.t <= self.horizon) {
                    return self.jump_to(limit, next.mode);
                }
                let (switches, scale) = (self.recorder.switches(), &self.run.scale);
                if self.progress.rounds.are_small(switches, turn, scale) {
                    if let Some(mean) = self.ask(Cause::Start, mean_of_rounds)? {
                        self.recorder.replace();
                        return self.jump_to(mean, next.mode);
                    }
                }
            }
        }
        self.begin(next, &event.multiple)
    }

    /// After too many switches without any progress of time: goes on from their limit, or ends the run.
    fn leave_without_progress(&mut self, event: &Found) -> Result<Option<Stop>, FieldError> {
        let mut surfaces = self.recorder.surfaces_switched_at(self.run.t);
        if let Some(limit) = self.ask(Cause::Start, |at, _| limit_here(at, &surfaces))? {
            forget_choices(self);
            let mode = self.run.motion.mode.clone();
            return self.jump_to(limit, mode);
        }
        if surfaces.is_empty() {
            surfaces.extend(event.surfaces());
        }
        Ok(Some(Stop::NoProgress { surfaces }))
    }

    /// Where the motion can be followed no further: goes on at rest, if it has come to one within the tolerance, or along a surface to
    /// which a root holds it. Else the run ends.
    #[cold]
    pub(super) fn rest_or_stop(&mut self, stop: Stop) -> Result<Option<Stop>, FieldError> {
        let is_first = self.progress.rested.replace(self.run.t) != Some(self.run.t);
        if !is_first || self.held.is_some() || self.watch.has_ended() {
            return Ok(Some(stop));
        }
        let only_roots = matches!(stop, Stop::Intersection { .. });
        let rest = match only_roots {
            // The decision has asked for it.
            true => None,
            false => self.ask(Cause::Start, rest_within_tolerance)?,
        };
        let Some(rest) = rest else {
            return Ok(cling_to_surface(self, (false, only_roots))?.unwrap_or(Some(stop)));
        };
        forget_choices(self);
        let RestingPlace { x, surfaces, next } = rest;
        let y_before = SmallVec::from_slice(&self.run.x);
        self.run.x = x;
        self.recorder.jump(self.run.t, &self.run.x);
        self.recorder.user_events.forget_sides();
        self.run.stats.n_events += 1;
        self.recorder.switch(Switch {
            t: self.run.t,
            y_before,
            y_after: SmallVec::from_slice(&self.run.x),
            kind: Kind::Accumulation,
            surfaces: SmallVec::from_slice(&surfaces),
            mode_before: self.run.motion.mode.clone(),
            mode_after: next.mode.clone(),
            note: String::new(),
            rule: Rule::Limit.name(),
        });
        self.begin(next, &Multiple::default())
    }

    /// Records a switch between two modes that leaves the state as it is.
    pub(super) fn record(
        &mut self,
        before: Mode,
        after: Mode,
        surfaces: &[usize],
        rule: &'static str,
    ) -> Result<(), FieldError> {
        let kind = Kind::between(&before, &after);
        if kind == Kind::Crossing && !self.run.actions.list.is_empty() {
            let crossed = |j: &usize| {
                let side = before.entries()[*j];
                side != 0 && after.entries()[*j] == -side
            };
            for j in surfaces.iter().copied().filter(crossed) {
                let is_known = self.run.motion.passed.contains(&j);
                if !is_known
                    && self.ask(Cause::Anew(&before), |at, notes| {
                        warn_against_direction(at, notes, j, &before)
                    })?
                {
                    self.run.motion.passed.push(j);
                }
            }
        }
        self.recorder.switch(Switch {
            t: self.run.t,
            y_before: SmallVec::from_slice(&self.run.x),
            y_after: SmallVec::from_slice(&self.run.x),
            kind,
            surfaces: SmallVec::from_slice(surfaces),
            mode_before: before,
            mode_after: after,
            note: String::new(),
            rule,
        });
        Ok(())
    }

    /// Starts a motion at the current point; what it leaves may have a multiple zero.
    pub(super) fn begin(
        &mut self,
        next: Next,
        multiple: &Multiple,
    ) -> Result<Option<Stop>, FieldError> {
        let Next {
            mode,
            mut left,
            mut start,
        } = next;
        self.run.stats.n_field_evaluations += self.run.motion.field.n_evaluations();
        self.control.remember(&self.run, &self.stepper);
        let slid = !self.run.motion.sliding().is_empty();
        let mut leaps = false;
        if let Some(start) = &mut start {
            if let Some(x) = start.moved.take() {
                self.run.x = x;
            }
            if let Some(leap) = &start.leap {
                leaps = true;
                left = self.make_leap(leap)?;
            }
        }
        self.run.motion.resting = match left.iter().all(|left| left.leading.order > 0) {
            true => SlidingSet::new(),
            false => self.ask(Cause::Start, |at, notes| {
                zero_surfaces(at, notes, &mode, &left)
            })?,
        };
        let t = self.run.t;
        let zeros = left.iter().filter_map(|left| left.deflation(t));
        let zeros: SmallVec<[_; 2]> = zeros.collect();
        let (system, x) = (self.run.system, &self.run.x);
        self.run.motion.look_around(system, t, x);
        self.run.motion.restart(system, t, mode, &zeros);
        if start.as_ref().is_some_and(|start| start.is_rest) {
            self.run.motion.rest(self.run.system);
        }
        let zeros = self.run.motion.monitored.iter_mut();
        for zero in zeros.filter_map(|m| m.deflation.as_mut()) {
            zero.is_clean = !slid;
        }
        let warning = self.stepper.begin(&mut self.run);
        self.warnings.extend(warning.map(|warning| *warning));
        let mut two_fold = None;
        match &mut self.run.motion.field {
            ModeField::Intersection(field) => {
                let start = start.as_deref();
                let multipliers = start.map_or(&[][..], |start| &start.multipliers);
                field.begin(multipliers, start.is_some_and(|start| start.oscillates));
                if let Some(start) = start.filter(|start| start.is_given) {
                    field.hold_at_start(self.run.t, start.is_located);
                }
                self.slacks.set(field);
            }
            ModeField::Sliding(field) => {
                if let Some(motion) = start.and_then(|start| start.two_fold) {
                    let reach = motion.reach(self.run.options.rtol);
                    two_fold = Some((motion, reach));
                    field.begin_at_two_fold(self.run.t, self.run.t, motion);
                }
            }
            _ => {}
        }
        self.evaluate_start()?;
        // Rounds whose mean is followed turn around it.
        let is_mean = |last: &Warning| last.code == WarningCode::Averaged && last.t == self.run.t;
        if self.run.motion.sliding.len() > 1 && !self.warnings.last().is_some_and(is_mean) {
            self.ask(Cause::Start, |at, notes| {
                warn_oscillation(at, notes);
                Ok(())
            })?;
        }
        if !leaps {
            let multipliers = self.run.motion.multipliers();
            self.recorder.begin_segment(
                self.run.t,
                &self.run.motion.mode,
                multipliers,
                &self.run.motion.discrete,
            );
        }
        if self.run.motion.sliding.len() > 1 {
            if let Some(stop) = refusal(&self.run.motion.field, &self.run.motion.sliding) {
                return Ok(Some(stop));
            }
        }
        if self.run.system.has_nested_signs() {
            if let Some(stop) =
                differs_between_sides(self.run.system, (self.run.t, &self.run.x), &self.run.motion)?
            {
                return Ok(Some(stop));
            }
        }
        let derivative = self.stepper.start_derivative();
        if derivative.iter().any(|v| !v.is_finite()) {
            return Ok(Some(Stop::NotFinite));
        }
        let start = (self.run.t, &self.run.x[..], derivative);
        self.detector.measure(&self.run, start)?;
        self.detector
            .accept_start(&mut self.run.motion.monitored, multiple);
        let run = &self.run;
        let q = &run.motion.discrete;
        self.recorder.user_events.restart(run.t, &run.x, q)?;
        let surfaces = left.iter().filter_map(|l| Some((l.surface()?, l.leading)));
        self.control
            .begin(&mut self.run, &self.stepper, self.t_end, surfaces)?;
        if let (Some((motion, reach)), ModeField::Sliding(field)) =
            (two_fold, &mut self.run.motion.field)
        {
            if reach > 0.0 {
                self.control.limit(reach);
                let until = match reach.is_finite() {
                    true => reach,
                    false => self.control.proposal(),
                };
                field.begin_at_two_fold(self.run.t, self.run.t + until, motion);
            }
        }
        if let Some(observed) = &mut self.recorder.observed {
            observed.arrive(&self.run, self.stepper.start_derivative());
        }
        Ok(None)
    }

    /// Begins the segment of a motion that starts with a leap, and makes that; what the motion leaves at its end.
    fn make_leap(&mut self, leap: &Leap) -> Result<Lefts, FieldError> {
        let room = self.horizon - self.run.t;
        let landing = self.ask(Cause::Start, |at, notes| landing(leap, at, notes, room))?;
        let region = leap.region.clone();
        self.run
            .motion
            .restart(self.run.system, self.run.t, region, &[]);
        let discrete = &self.run.motion.discrete;
        self.recorder
            .begin_segment(self.run.t, &leap.region, SmallVec::new(), discrete);
        self.move_straight(landing.t, landing.x)?;
        Ok(landing.left)
    }

    /// Records a straight line to a later point: the motion in between has more switches than can be listed.
    pub(super) fn move_straight(&mut self, t: f64, end: Vec<f64>) -> Result<(), FieldError> {
        self.stepper
            .set_straight(self.run.t, t - self.run.t, &self.run.x, &end);
        let (stepper, motion) = (&mut self.stepper, &mut self.run.motion);
        self.recorder.sample_step(t, &self.run.x, stepper, motion)?;
        self.recorder.step(self.stepper.interpolant(), t, &end);
        (self.run.t, self.run.x) = (t, end);
        Ok(())
    }

    /// The derivative at the start of the motion, and its exit functions there. The state moves onto the surfaces slid on.
    fn evaluate_start(&mut self) -> Result<(), FieldError> {
        let run = &mut self.run;
        if self.stepper.start(run)? {
            // Known.
        } else if let ModeField::Region(_) = &run.motion.field {
            let place = run.motion.setting().at(run.t, &run.x);
            let derivative = self.stepper.start_derivative_mut();
            let unit = Units::size_meant(run.options);
            run.stats.n_field_evaluations += eval_on_side_in(run.system, &place, unit, derivative)?;
        } else {
            let derivative = self.stepper.start_derivative_mut();
            run.motion.field.eval(run.t, &mut run.x, derivative)?;
            let warning = self.stepper.started(run);
            self.warnings.extend(warning.map(|warning| *warning));
        }
        let exits = run.motion.field.last_exits();
        run.seen.clear();
        let seen = exits.iter().map(|&exit| Seen::at_start(exit));
        run.seen.extend(seen);
        Ok(())
    }

    /// Decides the mode anew at the current point, records what changes, and goes on. The motion leaves the surfaces
    /// `departing` of laws at these rates.
    pub(super) fn go_on_from_here(
        &mut self,
        departing: &[(usize, f64)],
    ) -> Result<Option<Stop>, FieldError> {
        self.recorder.leave(&mut self.run, &[])?;
        if !self.run.actions.list.is_empty() {
            follow_laws(self)?;
        }
        let before = self.run.motion.mode.clone();
        let Decision { rule, decided } =
            self.decide(Cause::Anew(&before), &mut Reached::default())?;
        self.run.residuals.clear();
        let mut next = match decided {
            Ok(next) => next,
            Err(stop) => return Ok(Some(stop)),
        };
        let triggers = self.run.motion.triggers(self.run.system);
        let departing = departing.iter().filter(|(j, _)| triggers.is_internal(*j));
        let departing = departing.map(|&(j, value)| Left::beside(j, Leading { order: 1, value }));
        next.left.extend(departing);
        let entries = before.entries().iter().zip(next.mode.entries()).enumerate();
        let changed = entries.filter(|(_, (before, after))| before != after);
        let changed: Vec<usize> = changed.map(|(j, _)| j).collect();
        if !changed.is_empty() {
            self.record(before, next.mode.clone(), &changed, rule.name())?;
        }
        self.begin(next, &Multiple::default())
    }

    /// Finds the mode of the initial state and starts the motion.
    pub(super) fn start(&mut self) -> Result<Option<Stop>, FieldError> {
        self.recorder.start(self.run.t, &self.run.x);
        if let Some(mode) = self.held {
            self.run.motion.hold();
            return self.begin(Next::new(mode.clone(), Lefts::new()), &Multiple::default());
        }
        if !self.run.actions.list.is_empty() {
            return self.start_with_actions();
        }
        match self.decide(Cause::Start, &mut Reached::default())?.decided {
            Ok(next) => self.begin(next, &Multiple::default()),
            Err(stop @ Stop::Intersection { .. }) => self.rest_or_stop(stop),
            Err(stop) => Ok(Some(stop)),
        }
    }

    /// A start with actions: those of this time, and those whose surface the motion leads through from here.
    #[cold]
    pub(super) fn start_with_actions(&mut self) -> Result<Option<Stop>, FieldError> {
        let Some(Sides {
            mut mode,
            on_surface,
        }) = self.ask(Cause::Start, |at, notes| sides(at, notes, None))?
        else {
            return Ok(Some(Stop::NotFinite));
        };
        let mut due = self.timetable.take(self.run.actions, self.run.t);
        self.horizon = self
            .timetable
            .horizon(self.run.actions, self.run.t, self.t_end);
        for j in 0..on_surface.len() {
            if !on_surface[j] || !self.run.motion.triggers(self.run.system).is_only_trigger(j) {
                continue;
            }
            let side = self.run.motion.triggers(self.run.system).side(j, None);
            mode.set(j, side);
            self.ask(Cause::Start, |at, notes| {
                warn_unknown_side(at, notes, j, &mode)
            })?;
            let through = self.ask(Cause::Anew(&mode), |at, notes| {
                goes_through(at, notes, j, side, &mode, &on_surface)
            })?;
            if through {
                due.extend(self.run.actions.triggered_at(j, side));
            }
        }
        if due.is_empty() {
            return match self.decide(Cause::Start, &mut Reached::default())?.decided {
                Ok(next) => self.begin(next, &Multiple::default()),
                Err(stop) => Ok(Some(stop)),
            };
        }
        self.run
            .motion
            .restart(self.run.system, self.run.t, mode, &[]);
        due.sort_unstable();
        due.dedup();
        self.recorder.leave(&mut self.run, &[])?;
        self.act(due)
    }

    /// The end of the span, or a known time of actions.
    #[cold]
    pub(super) fn reach_horizon(&mut self) -> Result<Option<Stop>, FieldError> {
        if self.held.is_some() {
            return Ok(Some(Stop::End));
        }
        let mut due = self.timetable.take(self.run.actions, self.run.t);
        self.horizon = self
            .timetable
            .horizon(self.run.actions, self.run.t, self.t_end);
        let is_watched = self.recorder.observed.is_some() || self.run.options.keep_decisions > 0;
        if !due.is_empty() && !is_watched && self.run.t < self.t_end {
            if let Some(q) = quiet_change(&self.run, &due)? {
                self.run.stats.n_surface_evaluations += 2;
                self.control.forget_steps();
                self.run.motion.set_discrete(q);
                self.run.residuals.clear();
                self.run.passing.clear();
                let next = Next::new(self.run.motion.mode.clone(), Lefts::new());
                return self.begin(next, &Multiple::default());
            }
        }
        if !self.run.actions.list.is_empty() {
            let (h, reached) = self.ask(Cause::Start, |at, notes| {
                let h = at.surface_values(notes, at.arrival.signs)?;
                let reached = triggers_reached(at, &h)?;
                Ok((h, reached))
            })?;
            self.run.residuals = self.run.motion.residuals(&h, &reached);
            for j in reached {
                due.extend(
                    self.run
                        .actions
                        .triggered_at(j, self.run.motion.mode.entries()[j]),
                );
            }
            due.sort_unstable();
            due.dedup();
        }
        if !due.is_empty() {
            self.recorder.leave(&mut self.run, &[])?;
            self.control.forget_steps();
            return self.act(due);
        }
        Ok((self.run.t >= self.t_end).then_some(Stop::End))
    }

    /// Does what an event triggers; `None` if that is nothing and the decision is an ordinary one.
    pub(super) fn act_at_event(
        &mut self,
        event: &Found,
        h: &Values,
    ) -> Result<Option<Option<Stop>>, FieldError> {
        if event.touch {
            return Ok(None);
        }
        let mode = self.run.motion.mode.clone();
        let (surfaces, rates) = self.ask(Cause::Anew(&mode), |at, _| {
            let mut surfaces = located_surfaces(&event.guards);
            add_vanishing_surfaces(at, &mut surfaces, h)?;
            Ok((surfaces, at.rates_here()?))
        })?;
        let located = |j: usize| event.guards.contains(&Guard::Surface(j));
        let entries = self.run.motion.mode.entries();
        let reached = surfaces.iter().copied().filter(|&j| {
            let approaches = rates[j] * f64::from(entries[j]) < 0.0;
            // Rounding may show a zero where the motion leaves.
            let is_tangent = located(j) && rates[j] == 0.0;
            entries[j] != 0 && (approaches || is_tangent)
        });
        let mut due: Vec<usize> = Vec::new();
        for j in reached {
            due.extend(self.run.actions.triggered_at(j, entries[j]));
        }
        if !due.is_empty() {
            if self.run.t >= self.horizon {
                due.extend(self.timetable.take(self.run.actions, self.run.t));
                self.horizon = self
                    .timetable
                    .horizon(self.run.actions, self.run.t, self.t_end);
            }
            due.sort_unstable();
            due.dedup();
            self.run.residuals = self.run.motion.residuals(h, &surfaces);
            return self.act(due).map(Some);
        }
        let departs = |j: &&usize| {
            rates[**j] * f64::from(entries[**j]) > 0.0
                && self
                    .run
                    .motion
                    .triggers(self.run.system)
                    .is_only_trigger(**j)
        };
        let departing: Vec<(usize, f64)> = surfaces
            .iter()
            .filter(departs)
            .map(|&j| (j, rates[j]))
            .collect();
        if !departing.is_empty() {
            self.run.residuals = self.run.motion.residuals(h, &surfaces);
            return self.go_on_from_here(&departing).map(Some);
        }
        if !self.run.motion.is_in_contact() && surfaces.len() > 1 {
            self.run.residuals = self.run.motion.residuals(h, &surfaces);
        }
        Ok(None)
    }

    /// Does these actions and those that they trigger, and goes on with the motion that follows.
    pub(super) fn act(&mut self, due: Vec<usize>) -> Result<Option<Stop>, FieldError> {
        let moves_state = |index: &usize| self.run.actions.list[*index].map.moves_state();
        if due.iter().any(moves_state) {
            if let Some(stop) = self.recorder.zeros_before_jump(self.run.t, &self.run.x) {
                return Ok(Some(stop));
            }
        }
        let before = self.run.motion.mode.clone();
        let first = self.recorder.switches().len();
        let arrived = self.run.x.clone();
        let stopped = self.do_actions(due)?;
        self.recorder.set_jump(first, &arrived, &self.run.x);
        if stopped.is_some() {
            return Ok(stopped);
        }
        let Decision { rule, decided } =
            self.decide(Cause::Anew(&before), &mut Reached::default())?;
        let next = match decided {
            Ok(next) => next,
            Err(stop) => return Ok(Some(stop)),
        };
        if self.recorder.switches().len() == first && before != next.mode {
            // A law has changed unseen, in the instant in which surfaces vanish. The sign of one that does not vanish may
            // change with the state; that is no switch.
            let sides = self.ask(Cause::Anew(&before), |at, notes| {
                sides(at, notes, Some(&before))
            })?;
            let on_surface = sides.map_or_else(Default::default, |sides| sides.on_surface);
            let triggers = self.run.motion.triggers(self.run.system);
            let passed = (0..on_surface.len()).filter(|&j| {
                let changes = before.entries()[j] != next.mode.entries()[j];
                on_surface[j] && !triggers.is_internal(j) && changes
            });
            let passed: Vec<usize> = passed.collect();
            if !passed.is_empty() {
                self.record(before.clone(), next.mode.clone(), &passed, rule.name())?;
            }
        }
        self.run.residuals.clear();
        self.run.passing.clear();
        self.recorder.set_last_mode(first, &next.mode);
        let limits = self.ask(Cause::Start, |at, _| {
            limits_of_impacts(at, first, &next.mode)
        })?;
        let mut limits = limits.into_iter().flatten();
        if let Some(rest) = limits.find(|limit| limit.t <= self.horizon) {
            return self.jump_to(rest, next.mode);
        }
        let limit = self.ask(Cause::Start, |at, _| limit_of_unresolved_flights(at))?;
        if let Some(limit) = limit.filter(|limit| limit.t <= self.horizon) {
            return self.jump_to(limit, next.mode);
        }
        let rest = self.ask(Cause::Start, |at, _| limit_of_impact_rounds(at, &next.mode))?;
        if let Some(rest) = rest.filter(|limit| limit.t <= self.horizon) {
            return self.jump_to(rest, next.mode);
        }
        let t = self.run.t;
        let stop = self.begin(next, &Multiple::default())?;
        if self.run.t == t {
            // Contact that begins with a speed below the tolerance takes that away.
            self.recorder.jump(t, &self.run.x);
            self.recorder.set_jump(first, &arrived, &self.run.x);
        }
        Ok(stop)
    }

    /// Does these actions and those that they trigger; why the run ends with them, if it does.
    fn do_actions(&mut self, due: Vec<usize>) -> Result<Option<Stop>, FieldError> {
        let mut notes = Notes {
            n_choices: self.n_choices,
            ..Notes::default()
        };
        let (watch, t, n) = (&self.watch, self.run.t, self.run.x.len());
        let reached = self.progress.reached(t);
        let is_over = || watch.stop().is_some() || watch.is_over(watch.now(), reached);
        let mut instant = Instant {
            run: &mut self.run,
            velocity: self.stepper.start_derivative(),
            switches: self.recorder.switches(),
            patience: Patience::until(&is_over),
            notes: &mut notes,
            done: Vec::new(),
            derivative: self.recorder.observed.is_some().then(|| identity(n)),
            acts: Vec::new(),
        };
        let stopped = instant.act(due);
        let Instant {
            done,
            derivative,
            acts,
            ..
        } = instant;
        if let Some(observed) = &mut self.recorder.observed {
            observed.act(derivative, acts);
        }
        self.run.stats.n_events += done.len() as u64;
        // A law moves no state, though the instant may put it onto a surface, by a rounding.
        if !IS_PAGE && done.iter().any(|act| act.y_before != act.y_after) {
            self.recorder.user_events.forget_sides();
        }
        done.into_iter()
            .for_each(|switch| self.recorder.switch(switch));
        self.recorder.jump(t, &self.run.x);
        self.take_notes(&mut notes);
        stopped
    }

    /// Moves to the limit and goes on from there.
    pub(super) fn jump_to(
        &mut self,
        limit: Limit,
        before: Mode,
    ) -> Result<Option<Stop>, FieldError> {
        let Limit {
            t,
            x,
            surfaces,
            is_rest,
        } = limit;
        if x.iter().any(|v| !v.is_finite()) {
            return Ok(Some(Stop::NotFinite));
        }
        let discrete = &self.run.motion.discrete;
        self.recorder
            .begin_segment(self.run.t, &before, SmallVec::new(), discrete);
        self.run.motion.mode = before.clone();
        let y_before = x.clone().into();
        if t > self.run.t {
            self.move_straight(t, x)?;
        } else {
            self.run.x = x;
            self.recorder.jump(self.run.t, &self.run.x);
            self.recorder.user_events.forget_sides();
        }
        self.run.stats.n_events += 1;
        let passed = match surfaces[..] {
            [surface] if is_rest => self.ask(Cause::Start, |at, notes| {
                passed_beside(at, notes, &before, surface)
            })?,
            _ => None,
        };
        let switch = |after: &Mode, rule| Switch {
            t,
            y_before,
            y_after: SmallVec::new(),
            kind: Kind::Accumulation,
            surfaces: SmallVec::from_slice(&surfaces),
            mode_before: before.clone(),
            mode_after: after.clone(),
            note: String::new(),
            rule,
        };
        if let Some(Passed { triggers, x, h }) = passed {
            self.run.x = x;
            self.recorder.jump(self.run.t, &self.run.x);
            self.run
                .motion
                .restart(self.run.system, self.run.t, before.clone(), &[]);
            let met: Vec<usize> = triggers.iter().chain(&surfaces).copied().collect();
            self.run.residuals = self.run.motion.residuals(&h, &met);
            let due = triggers.iter().flat_map(|&k| {
                let side = before.entries()[k];
                self.run.actions.triggered_at(k, side)
            });
            let due = due.collect();
            let y_after = SmallVec::from_slice(&self.run.x);
            let switch = switch(&before, "");
            self.recorder.switch(Switch { y_after, ..switch });
            return self.act(due);
        }
        let cause = match is_rest {
            true => Cause::Anew(&before),
            false => Cause::Limit(&surfaces),
        };
        let Decision { rule, decided } = self.decide(cause, &mut Reached::default())?;
        // Where nothing is decided the run ends at the limit, having come there all the same.
        let after = decided.as_ref().map_or(&before, |next| &next.mode);
        let y_after = SmallVec::from_slice(&self.run.x);
        let switch = switch(after, rule.name());
        self.recorder.switch(Switch { y_after, ..switch });
        match decided {
            Ok(next) => self.begin(next, &Multiple::default()),
            Err(stop) => Ok(Some(stop)),
        }
    }

    /// A surface whose function was zero all along the step just made, up to rounding, and about which nothing was said: a
    /// function that becomes zero without a sign in it, as one that is called may do, or a rest that is reached.
    pub(super) fn zero_surface(&mut self, t1: f64) -> Result<Option<usize>, FieldError> {
        for index in 0..self.run.motion.monitored.len() {
            let m = self.run.motion.monitored[index];
            let (end, _) = self.detector.right[index];
            let Guard::Surface(j) = m.guard else {
                continue;
            };
            // Few functions come this far; the sizes in the noise are not computed for the others.
            if m.deflation.is_some() || m.value.abs().max(end.abs()) > DOUBTFUL {
                continue;
            }
            let noise = self.step_search().0.noise_of(&m)?;
            if m.value.abs().max(end.abs()) > noise {
                continue;
            }
            self.stepper.interpolant().at(0.5, &mut self.detector.x);
            let (middle, h) = (0.5 * (self.run.t + t1), &mut self.detector.h);
            let place = self.run.motion.setting().at(middle, &self.detector.x);
            self.run.system.surfaces(&place, h)?;
            if h[j].abs() <= noise
                && !is_named(&self.warnings, j)
                && !self.run.motion.settled.contains(&j)
            {
                return Ok(Some(j));
            }
        }
        Ok(None)
    }

    /// Goes on from a point at which h_j has become zero. If the fields hold the motion on the surface, it stays there: a field
    /// with a root of the distance brings it to rest so. Beside the surface the motion would follow the root of rounding.
    pub(super) fn settle_on(&mut self, j: usize) -> Result<Option<Stop>, FieldError> {
        let run = &mut self.run;
        let units = Units::from(run.options).parts(run.x.len());
        let mut projector = Projector::new(run.x.len(), run.motion.signs.len()).measured_in(units);
        let setting = run.motion.setting();
        // The flights beside a surface of higher degree are below its rounding.
        projector.project_onto_rates(run.system, &[j], run.t, &mut run.x, setting)?;
        let stop = self.go_on_from_here(&[])?;
        if !self.run.motion.sliding().contains(&j) {
            if !self.run.motion.resting.contains(&j) {
                self.run.motion.settled.push(j);
            }
            let mode = self.run.motion.mode.clone();
            self.ask(Cause::Start, |at, notes| {
                warn_zero_surface(at, notes, j, &mode);
                Ok(())
            })?;
        }
        Ok(stop)
    }
}

/// Goes on along a surface to which a root holds the motion; `None` if there is none, or none that the motion `leaves` if it is to.
#[cold]
fn cling_to_surface(
    integrator: &mut Integrator<'_>,
    (leaves, only_roots): (bool, bool),
) -> Result<Option<Option<Stop>>, FieldError> {
    let found = find_clinging(integrator, (leaves, only_roots))?;
    let followed = found.map(|clinging| follow_clinging(integrator, clinging));
    followed.transpose()
}

/// Continues on a surface that the motion has touched again and again, if it rests there.
#[cold]
fn rest_on_touched(
    integrator: &mut Integrator<'_>,
    j: usize,
) -> Result<Option<Option<Stop>>, FieldError> {
    let found = integrator.ask(Cause::Start, |at, notes| side_of_rest(at, notes, j))?;
    let Some((side, x)) = found else {
        return Ok(None);
    };
    let before = integrator.run.motion.mode.clone();
    let mut next = Next::new(before.with(j, side), Lefts::new());
    next.left.push(Left::stays(j));
    next.start_mut().moved = Some(x);
    integrator.record(before, next.mode.clone(), &[j], Rule::Limit.name())?;
    integrator.begin(next, &Multiple::default()).map(Some)
}

/// How a motion goes on that is held to surfaces: if it `leaves` one, and if they hold it like roots, where that is asked for.
fn find_clinging(
    integrator: &mut Integrator<'_>,
    (leaves, only_roots): (bool, bool),
) -> Result<Option<Clinging>, FieldError> {
    let horizon = integrator.horizon;
    let found = integrator.ask(Cause::Start, |at, notes| {
        cling(at, notes, only_roots, horizon)
    })?;
    Ok(found.filter(|found| found.leaves || !leaves))
}

/// Records how surfaces came to hold the motion, and decides the mode in which it goes on.
fn follow_clinging(
    integrator: &mut Integrator<'_>,
    clinging: Clinging,
) -> Result<Option<Stop>, FieldError> {
    integrator.recorder.leave(&mut integrator.run, &[])?;
    integrator.recorder.replace();
    let before = integrator.run.motion.mode.clone();
    let is_start = integrator.recorder.has_no_segment();
    if let Some(mode) = clinging.mode.filter(|mode| is_start || *mode != before) {
        let entries = mode.entries().iter().zip(before.entries()).enumerate();
        let changed = entries.filter(|(_, (after, before))| after != before);
        let changed: Vec<usize> = changed.map(|(j, _)| j).collect();
        let (system, t) = (integrator.run.system, integrator.run.t);
        integrator.run.motion.restart(system, t, mode.clone(), &[]);
        if !is_start {
            integrator.record(before, mode.clone(), &changed, Rule::Limit.name())?;
        }
        let discrete = &integrator.run.motion.discrete;
        integrator
            .recorder
            .begin_segment(t, &mode, SmallVec::new(), discrete);
    }
    for (t, x) in clinging.pieces {
        let (t0, x0) = (integrator.run.t, &integrator.run.x);
        integrator.stepper.set_straight(t0, t - t0, x0, &x);
        let (mut search, recorder) = integrator.step_search();
        let Some(zeros) = recorder.find_user_zeros(&mut search, 1.0, t)? else {
            let surfaces = clinging.surfaces;
            return Ok(Some(Stop::NoProgress { surfaces }));
        };
        if let Some(stop) = recorder.record_user_zeros(&mut search, zeros, (1.0, t))? {
            return Ok(Some(stop));
        }
        integrator.move_straight(t, x)?;
    }
    integrator.control.forget_proposal();
    integrator.go_on_from_here(&[])
}

/// The actions at surfaces whose functions jump through zero with the sign of another one: that of a floor, or of a branch.
fn triggered_by_a_sign(run: &Run, before: &Mode, after: &Mode, reached: &[usize]) -> Vec<usize> {
    if run.actions.list.is_empty() || !run.system.has_nested_signs() {
        return Vec::new();
    }
    let triggers = run.motion.triggers(run.system);
    let sides = before.entries().iter().zip(after.entries()).enumerate();
    let jumps = sides.filter(|(j, (side, now))| {
        **side * **now == -1 && !reached.contains(j) && !triggers.is_internal(*j)
    });
    let due = jumps.flat_map(|(j, (side, _))| run.actions.triggered_at(j, *side));
    let mut due: Vec<usize> = due.collect();
    due.sort_unstable();
    due.dedup();
    due
}

/// Forgets the choices since time last went on: the motion has come back at once, whatever was chosen.
fn forget_choices(integrator: &mut Integrator<'_>) {
    let since = integrator.progress.stands_since(integrator.run.t);
    let n_before = integrator.warnings.len();
    integrator
        .warnings
        .retain(|warning| warning.code != WarningCode::NonUnique || warning.t < since);
    let n_forgotten = n_before - integrator.warnings.len();
    integrator.n_choices = integrator.n_choices.saturating_sub(n_forgotten);
}

/// Updates the discrete states that the mode did not read. A decision may read them.
fn follow_laws(integrator: &mut Integrator<'_>) -> Result<(), FieldError> {
    let (actions, active) = (integrator.run.actions, integrator.run.motion.known.active());
    let is_idle = |trigger: &Trigger| matches!(*trigger, Trigger::Surface { index, .. } if !active.has(index));
    let idle = actions
        .list
        .iter()
        .filter(|action| is_idle(&action.trigger));
    let idle: SmallVec<[&dyn ActionMap; 4]> = idle.map(|action| action.map).collect();
    if idle.is_empty() {
        return Ok(());
    }
    let mode = integrator.run.motion.mode.clone();
    // They may read one another, also by signs.
    for _ in 0..=idle.len() {
        let sides = integrator.ask(Cause::Start, |at, notes| sides(at, notes, Some(&mode)))?;
        let signs = sides.map_or_else(|| mode.signs(), |sides| sides.mode.signs());
        let before = integrator.run.motion.discrete.clone();
        let mut q = before.clone();
        for map in &idle {
            map.follow(integrator.run.t, &integrator.run.x, &signs, &mut q);
        }
        if q == before {
            break;
        }
        integrator.run.motion.set_discrete(q);
    }
    Ok(())
}
