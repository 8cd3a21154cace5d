//! Actions in an instant: which are done, in which order, and what they trigger.
//!
//! Specification:
//!
//! 1. At one instant the actions whose time has come and those whose surface was reached in their direction are
//!    done in the order of the list, each on the state that the one before it left.
//! 2. Then those are done that the jump triggered: it led across their surface in their direction, or onto it with
//!    a motion that approaches it. This is repeated until there are none.
//! 3. An action whose state still moves through its surface is not done again in that instant: the motion
//!    crosses. (A count, or a phase that is set back, at a section.)
//! 4. The mode is decided for the last state ([`crate::decisions`]).

use smallvec::SmallVec;

use crate::decisions::{
    add_vanishing_surfaces, goes_through, located_surfaces, pushed_back, sides, warn_unknown_side,
    Cause, Decision, Left, Sides, Triggers, Values,
};
use crate::error::FieldError;
use crate::event::Found;
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::motion::Guard;
use crate::motion::Leading;
use crate::status::Stop;
use crate::switch::Switch;
use crate::system::Trigger;
use crate::tolerances::{MOST_ACTIONS_AT_ONE_TIME, PENETRATION, SURFACE_NOISE};

/// The surfaces in one instant, as far as they trigger actions.
struct Approach {
    /// The side that the state is on, or comes from while it is on the surface.
    side: Vec<i8>,
    /// The motion goes on through the surface after its action.
    passes: Vec<bool>,
}

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
        self.update_horizon();
        for j in 0..on_surface.len() {
            if !on_surface[j] || !self.triggers().is_only_trigger(j) {
                continue;
            }
            let side = self.triggers().side(j, None);
            mode.set(j, side);
            self.ask(Cause::Start, |at, notes| {
                warn_unknown_side(at, notes, j, &mode)
            })?;
            if self.goes_through(j, side, &mode, &on_surface)? {
                due.extend(self.triggered_at(j, side));
            }
        }
        if due.is_empty() {
            return match self.decide(Cause::Start)?.decided {
                Ok(next) => self.begin(next),
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
        self.update_horizon();
        if !self.actions.list.is_empty() {
            let signs = self.motion.signs.clone();
            let h = self.surface_values(&signs)?;
            let reached = self.triggers_reached(&h)?;
            self.note_residuals(&h, &reached);
            for j in reached {
                due.extend(self.triggered_at(j, self.motion.mode.entries()[j]));
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

    /// The next known time up to the end.
    pub(in crate::integrate) fn update_horizon(&mut self) {
        let next = self.timetable.next(self.actions);
        self.horizon = next.map_or(self.t_end, |next| next.max(self.t).min(self.t_end));
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
            due.extend(self.triggered_at(j, entries[j]));
        }
        if !due.is_empty() {
            if self.t >= self.horizon {
                due.extend(self.timetable.take(self.actions, self.t));
                self.update_horizon();
            }
            due.sort_unstable();
            due.dedup();
            self.note_residuals(h, &surfaces);
            return self.act(due).map(Some);
        }
        let departs = |j: &&usize| {
            rates[**j] * f64::from(entries[**j]) > 0.0 && self.triggers().is_only_trigger(**j)
        };
        let departing: Vec<(usize, f64)> = surfaces
            .iter()
            .filter(departs)
            .map(|&j| (j, rates[j]))
            .collect();
        if !departing.is_empty() {
            self.note_residuals(h, &surfaces);
            return self.go_on_unless_stuck(&departing).map(Some);
        }
        if !self.motion.is_in_contact() && surfaces.len() > 1 {
            self.note_residuals(h, &surfaces);
        }
        Ok(None)
    }

    /// The triggers that the motion reaches here up to rounding.
    fn triggers_reached(&mut self, h: &Values) -> Result<Vec<usize>, FieldError> {
        let rates = self.ask(Cause::Start, |at, _| at.rates_here())?;
        let mut reached = Vec::new();
        for j in (0..h.len()).filter(|&j| self.actions.at_surface(j).is_some()) {
            let signs = &self.motion.signs;
            let size = self.system.surface_size(j, self.t, &self.x, signs)?;
            let approaches = rates[j] * f64::from(self.motion.mode.entries()[j]) < 0.0;
            if approaches && h[j].abs() <= SURFACE_NOISE * size {
                reached.push(j);
            }
        }
        Ok(reached)
    }

    /// Notes how far the point lies off the surfaces that vanish there, and those that the motion stays on.
    pub(in crate::integrate) fn note_residuals(&mut self, h: &Values, surfaces: &[usize]) {
        self.residuals.clear();
        self.residuals.resize(h.len(), 0.0);
        for &j in surfaces.iter().chain(self.motion.sliding()) {
            self.residuals[j] = h[j].abs();
        }
    }

    /// The actions at surface `j` for a motion that comes from `side`.
    pub(in crate::integrate) fn triggered_at(
        &self,
        j: usize,
        side: i8,
    ) -> impl Iterator<Item = usize> + '_ {
        let fires = move |trigger: &Trigger| match trigger {
            Trigger::Surface {
                index, direction, ..
            } => *index == j && (*direction == 0 || *direction == -side),
            _ => false,
        };
        let list = self.actions.list.iter().enumerate();
        list.filter(move |(_, action)| fires(&action.trigger))
            .map(|(index, _)| index)
    }

    /// Does these actions and those that they trigger, and goes on with the motion that follows.
    pub(in crate::integrate) fn act(
        &mut self,
        mut due: Vec<usize>,
    ) -> Result<Option<Stop>, FieldError> {
        if let Some(stop) = self.record_zeros_here() {
            return Ok(Some(stop));
        }
        let before = self.motion.mode.clone();
        let first = self.recorder.switches().len();
        let mut approach = Approach {
            side: self.free_sides(&before),
            passes: vec![false; before.entries().len()],
        };
        let mut count = 0;
        let arrived = self.x.clone();
        self.push_back(&before)?;
        let start = self.surface_values(&before.signs())?;
        while !due.is_empty() {
            for &index in &due {
                count += 1;
                if count > MOST_ACTIONS_AT_ONE_TIME {
                    let names = due.iter().map(|&k| self.actions.list[k].name.clone());
                    return Ok(Some(Stop::ActionsDoNotEnd {
                        actions: names.collect(),
                    }));
                }
                let arrives = self.passage(index, &before, &approach)?;
                if let Some(stop) = self.do_action(index, &before)? {
                    return Ok(Some(stop));
                }
                if let (Some((j, true)), Some((_, true))) =
                    (arrives, self.passage(index, &before, &approach)?)
                {
                    approach.passes[j] = true;
                }
            }
            self.push_back(&before)?;
            due = self.triggered_by_jump(&due, &mut approach)?;
        }
        if let Some(j) = self.penetrates(&before, &start, &approach)? {
            return Ok(Some(Stop::Contact { surfaces: vec![j] }));
        }
        let passing = approach.passes.iter().enumerate();
        self.passing = passing.filter(|(_, p)| **p).map(|(j, _)| j).collect();
        self.recorder.jump(self.t, &self.x);
        self.recorder.set_jump(first, &arrived, &self.x);
        let decided = self.decide(Cause::Anew(&before))?.decided;
        let next = match decided {
            Ok(next) => next,
            Err(stop) => return Ok(Some(stop)),
        };
        self.residuals.clear();
        self.passing.clear();
        self.recorder.set_last_mode(first, &next.mode);
        if let Some(rest) = self.impacts_end(first, &next.mode)? {
            return self.jump_to(rest, next.mode);
        }
        let t = self.t;
        let stop = self.begin(next)?;
        if self.t == t {
            // Contact that begins with a speed below the tolerance takes that away.
            self.recorder.jump(t, &self.x);
            self.recorder.set_jump(first, &arrived, &self.x);
        }
        Ok(stop)
    }

    /// The surface of an action, and whether the motion goes through it from here.
    fn passage(
        &mut self,
        index: usize,
        before: &Mode,
        approach: &Approach,
    ) -> Result<Option<(usize, bool)>, FieldError> {
        let Trigger::Surface { index: j, .. } = self.actions.list[index].trigger else {
            return Ok(None);
        };
        let side = approach.side[j];
        if side == 0 {
            return Ok(None);
        }
        let Some(Sides { mode, on_surface }) = self.ask(Cause::Anew(before), |at, notes| {
            sides(at, notes, Some(before))
        })?
        else {
            return Ok(None);
        };
        let goes_on = on_surface[j] && self.goes_through(j, side, &mode, &on_surface)?;
        Ok(Some((j, goes_on)))
    }

    /// A trigger that the motion has passed by more than the tolerance without an action that carried it across: bodies
    /// that could not be kept apart.
    fn penetrates(
        &mut self,
        before: &Mode,
        start: &Values,
        approach: &Approach,
    ) -> Result<Option<usize>, FieldError> {
        let signs = before.signs();
        let h = self.surface_values(&signs)?;
        let is_solid =
            |j: &usize| self.triggers().is_only_trigger(*j) && !self.triggers().is_internal(*j);
        for j in (0..h.len()).filter(|j| is_solid(j) && !approach.passes[*j]) {
            let side = self.triggers().side(j, Some(before));
            let came_from = before.entries()[j] == side || before.entries()[j] == 0;
            let is_beyond = h[j] * f64::from(side) < 0.0 && came_from;
            let has_jumped = (h[j] - start[j]).abs() > PENETRATION * h[j].abs();
            if !is_beyond || has_jumped {
                continue;
            }
            let known = self.residuals.get(j).copied().unwrap_or(0.0);
            let size = self.system.surface_size(j, self.t, &self.x, &signs)?;
            if h[j].abs() > (SURFACE_NOISE * size).max(known.min(PENETRATION * size)) {
                return Ok(Some(j));
            }
        }
        Ok(None)
    }

    /// Decides the mode anew where an event turned out to be none: the motion leaves the surfaces `departing` at these
    /// rates.
    fn go_on_unless_stuck(
        &mut self,
        departing: &[(usize, f64)],
    ) -> Result<Option<Stop>, FieldError> {
        let before = self.motion.mode.clone();
        let Decision { rule, decided } = self.decide(Cause::Anew(&before))?;
        self.residuals.clear();
        let mut next = match decided {
            Ok(next) => next,
            Err(stop) => return Ok(Some(stop)),
        };
        for &(j, value) in departing
            .iter()
            .filter(|(j, _)| self.triggers().is_internal(*j))
        {
            next.left.push(Left::beside(j, Leading { order: 1, value }));
        }
        self.go_on_in(before, next, rule)
    }

    /// Moves the state back onto the triggers that it slipped through.
    fn push_back(&mut self, memory: &Mode) -> Result<(), FieldError> {
        let moved = self.ask(Cause::Anew(memory), |at, notes| {
            pushed_back(at, notes, memory)
        })?;
        if let Some(x) = moved {
            self.x = x;
        }
        Ok(())
    }

    /// Does the motion lead from this side through a surface that the point lies on?
    fn goes_through(
        &mut self,
        j: usize,
        side: i8,
        mode: &Mode,
        on_surface: &[bool],
    ) -> Result<bool, FieldError> {
        self.ask(Cause::Anew(mode), |at, notes| {
            goes_through(at, notes, j, side, mode, on_surface)
        })
    }

    /// What the surfaces do that trigger actions.
    pub(in crate::integrate) fn triggers(&self) -> Triggers<'_> {
        Triggers {
            system: self.system,
            actions: self.actions,
            sides: &self.motion.sides,
        }
    }

    /// Does one action and records it.
    fn do_action(&mut self, index: usize, before: &Mode) -> Result<Option<Stop>, FieldError> {
        let action = &self.actions.list[index];
        let y_before = SmallVec::from_slice(&self.x);
        let mut q = std::mem::take(&mut self.motion.discrete);
        let signs = self.motion.signs.clone();
        let done = action.map.apply(self.t, &mut self.x, &signs, &mut q);
        self.motion.discrete = q;
        done?;
        self.system.set_discrete(&self.motion.discrete);
        if let Some(kind) = action.kind {
            self.stats.n_switches += 1;
            let surfaces = match action.trigger {
                Trigger::Surface { index, .. } => vec![index],
                _ => Vec::new(),
            };
            self.recorder.switch(Switch {
                t: self.t,
                y_before,
                y_after: SmallVec::from_slice(&self.x),
                kind,
                surfaces: surfaces.into(),
                mode_before: before.clone(),
                mode_after: before.clone(),
                note: action.name.clone(),
                rule: "",
            });
        }
        // The run may end in the middle of an instant.
        self.recorder.jump(self.t, &self.x);
        let is_finite = self.x.iter().all(|v| v.is_finite());
        Ok((!is_finite).then(|| Stop::ActionNotFinite {
            action: action.name.clone(),
        }))
    }

    /// The actions that the jump of the state triggered, after `done`.
    fn triggered_by_jump(
        &mut self,
        done: &[usize],
        approach: &mut Approach,
    ) -> Result<Vec<usize>, FieldError> {
        let before = self.motion.mode.clone();
        let cause = Cause::Anew(&before);
        let Some(Sides { mode, on_surface }) =
            self.ask(cause, |at, notes| sides(at, notes, Some(&before)))?
        else {
            return Ok(Vec::new());
        };
        let mut due = Vec::new();
        for j in 0..on_surface.len() {
            let side = approach.side[j];
            if side == 0 || self.actions.at_surface(j).is_none() {
                continue;
            }
            let was_done = self
                .triggered_at(j, side)
                .any(|index| done.contains(&index));
            if self.triggers().follows_law(j) && !on_surface[j] {
                // Whatever led there in this instant, also after its own change: in the end the law holds.
                if mode.entries()[j] < 0 {
                    due.extend(self.triggered_at(j, 1));
                }
                continue;
            }
            if was_done && self.triggers().is_internal(j) {
                continue;
            }
            if !on_surface[j] {
                let now = mode.entries()[j];
                // The jump of its own action may complete the passage that triggered it.
                if now != side && !was_done {
                    due.extend(self.triggered_at(j, side));
                }
                (approach.side[j], approach.passes[j]) = (now, false);
                continue;
            }
            if !self.goes_through(j, side, &mode, &on_surface)? {
                approach.passes[j] = false;
            } else if !approach.passes[j] {
                due.extend(self.triggered_at(j, side));
            }
        }
        due.sort_unstable();
        due.dedup();
        Ok(due)
    }

    /// The sides of a mode; where it is in contact, the free side.
    fn free_sides(&self, mode: &Mode) -> Vec<i8> {
        let mut sides = mode.entries().to_vec();
        for (j, side) in sides.iter_mut().enumerate() {
            if *side == 0 && self.triggers().is_only_trigger(j) {
                *side = self.triggers().side(j, None);
            }
        }
        sides
    }
}
