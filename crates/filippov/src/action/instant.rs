//! Actions in an instant: which are done, in which order, and what they trigger.
//!
//! Specification:
//!
//! 1. At one instant the actions whose time has come and those whose surface was reached in their direction are
//!    done in the order of the list, each on the state that the one before it left; then those that follow every jump.
//! 2. Then those are done that the jump triggered: it led across their surface in their direction, or onto it with
//!    a motion that approaches it; or onto it, where the function reads discrete states alone. This is repeated until there are none.
//! 3. An action whose state still moves through its surface is not done again in that instant: the motion
//!    crosses. (A count, or a phase that is set back, at a section.)
//! 4. The mode is decided for the last state ([`crate::decisions`]).

use smallvec::{smallvec, SmallVec};

use crate::decisions::{
    goes_through, pushed_back, sides, Cause, Notes, Point, Scene, Sides, Values,
};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::Run;
use crate::patience::Patience;
use crate::status::Stop;
use crate::switch::Switch;
use crate::system::{Act, ActionMap, Trigger};
use crate::tolerances::{AT_SIDE, MOST_ACTIONS_AT_ONE_TIME, ROUNDING};

/// An instant in which actions are done: the place and the motion that ends there.
pub(crate) struct Instant<'i, 'a> {
    /// The run. The actions change its state, and the discrete states of its motion.
    pub run: &'i mut Run<'a>,
    pub velocity: &'i [f64],
    pub switches: &'i [Switch],
    pub patience: Patience<'i>,
    pub notes: &'i mut Notes,
    /// What was done, also where the instant ends the run.
    pub done: Vec<Switch>,
    /// The derivative of all maps so far by the state before, in rows, if it is wanted.
    pub derivative: Option<Vec<f64>>,
    /// What was done on which state, if the derivative is wanted.
    pub acts: Vec<Act>,
}

/// The surfaces in one instant, as far as they trigger actions.
struct Approach {
    /// The side that the state is on, or comes from while it is on the surface.
    side: Vec<i8>,
    /// The motion goes on through the surface after its action.
    passes: Vec<bool>,
}

impl<'a> Instant<'_, 'a> {
    /// Does these actions and those that they trigger; why the run ends with them, if it does.
    pub fn act(&mut self, mut due: Vec<usize>) -> Result<Option<Stop>, FieldError> {
        let before = self.run.motion.mode.clone();
        let mut approach = Approach {
            side: self.free_sides(&before),
            passes: vec![false; before.entries().len()],
        };
        let mut count = 0;
        self.run.passing.clear();
        self.push_back(&before)?;
        let start = self.surface_values(&before)?;
        while !due.is_empty() {
            for &index in &due {
                count += 1;
                if count > MOST_ACTIONS_AT_ONE_TIME {
                    let names = due.iter().map(|&k| self.run.actions.list[k].name.clone());
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
            for index in self.run.actions.after_jumps() {
                if let Some(stop) = self.do_action(index, &before)? {
                    return Ok(Some(stop));
                }
            }
            self.push_back(&before)?;
            due = self.triggered_by_jump(&due, &start, &mut approach)?;
        }
        if let Some(j) = self.penetrates(&before, &start, &approach)? {
            return Ok(Some(Stop::Contact { surfaces: vec![j] }));
        }
        let passing = approach.passes.iter().enumerate();
        self.run.passing = passing.filter(|(_, p)| **p).map(|(j, _)| j).collect();
        Ok(None)
    }

    fn ask<R>(
        &mut self,
        memory: &Mode,
        question: impl FnOnce(&Point<'_, '_, 'a>, &mut Notes) -> R,
    ) -> R {
        let scene = Scene {
            run: self.run,
            velocity: self.velocity,
            switches: self.switches,
            patience: self.patience,
        };
        scene.ask(Cause::Anew(memory), self.notes, question)
    }

    fn surface_values(&mut self, mode: &Mode) -> Result<Values, FieldError> {
        let mut h: Values = smallvec![0.0; self.run.system.n_surfaces()];
        let (run, signs) = (&self.run, mode.signs());
        let place = run.motion.setting().with_signs(&signs).at(run.t, &run.x);
        run.system.surfaces(&place, &mut h)?;
        self.notes.n_surface_evaluations += 1;
        Ok(h)
    }

    /// The surface of an action, and whether the motion goes through it from here.
    fn passage(
        &mut self,
        index: usize,
        before: &Mode,
        approach: &Approach,
    ) -> Result<Option<(usize, bool)>, FieldError> {
        let Trigger::Surface { index: j, .. } = self.run.actions.list[index].trigger else {
            return Ok(None);
        };
        let side = approach.side[j];
        if side == 0 {
            return Ok(None);
        }
        let sides = self.ask(before, |at, notes| sides(at, notes, Some(before)))?;
        let Some(Sides { mode, on_surface }) = sides else {
            return Ok(None);
        };
        let passes = on_surface[j] && self.goes_through(j, side, &mode, &on_surface)?;
        Ok(Some((j, passes)))
    }

    /// Does the motion lead from this side through a surface that the point lies on?
    fn goes_through(
        &mut self,
        j: usize,
        side: i8,
        mode: &Mode,
        on_surface: &[bool],
    ) -> Result<bool, FieldError> {
        self.ask(mode, |at, notes| {
            goes_through(at, notes, j, side, mode, on_surface)
        })
    }

    /// Moves the state back onto the triggers that it slipped through.
    fn push_back(&mut self, memory: &Mode) -> Result<(), FieldError> {
        if let Some(x) = self.ask(memory, |at, notes| pushed_back(at, notes, memory))? {
            self.run.x = x;
        }
        Ok(())
    }

    /// A trigger that the motion has passed by more than the tolerance without an action that carried it across: bodies
    /// that could not be kept apart.
    fn penetrates(
        &mut self,
        before: &Mode,
        start: &Values,
        approach: &Approach,
    ) -> Result<Option<usize>, FieldError> {
        let h = self.surface_values(before)?;
        let is_solid = |j: &usize| {
            self.run
                .motion
                .triggers(self.run.system)
                .is_only_trigger(*j)
                && !self.run.motion.triggers(self.run.system).is_internal(*j)
        };
        for j in (0..h.len()).filter(|j| is_solid(j) && !approach.passes[*j]) {
            let side = self
                .run
                .motion
                .triggers(self.run.system)
                .side(j, Some(before));
            let came_from = before.entries()[j] == side || before.entries()[j] == 0;
            let is_beyond = h[j] * f64::from(side) < 0.0 && came_from;
            let has_jumped = (h[j] - start[j]).abs() > AT_SIDE * h[j].abs();
            if !is_beyond || has_jumped {
                continue;
            }
            let known = self.run.residuals.get(j).copied().unwrap_or(0.0);
            let signs = before.signs();
            let setting = self.run.motion.setting().with_signs(&signs);
            let place = setting.at(self.run.t, &self.run.x);
            let size = self.run.system.surface_size(j, &place)?;
            if h[j].abs() > (ROUNDING * size).max(known.min(AT_SIDE * size)) {
                return Ok(Some(j));
            }
        }
        Ok(None)
    }

    /// Does one action and takes it down.
    fn do_action(&mut self, index: usize, before: &Mode) -> Result<Option<Stop>, FieldError> {
        let action = &self.run.actions.list[index];
        let y_before = SmallVec::from_slice(&self.run.x);
        let (mut x, mut q) = (self.run.x.clone(), self.run.motion.discrete.clone());
        let signs = &self.run.motion.signs;
        if let Some(derivative) = &mut self.derivative {
            let place = (self.run.t, &self.run.x[..]);
            apply_derivative(action.map, place, signs, &q, derivative)?;
            self.acts.push(Act {
                index,
                x: x.clone(),
                discrete: q.clone(),
            });
        }
        action.map.apply(self.run.t, &mut x, signs, &mut q)?;
        self.run.x = x;
        self.run.motion.set_discrete(q);
        if let Some(kind) = action.kind {
            let surfaces = match action.trigger {
                Trigger::Surface { index, .. } => vec![index],
                _ => Vec::new(),
            };
            self.done.push(Switch {
                t: self.run.t,
                y_before,
                y_after: SmallVec::from_slice(&self.run.x),
                kind,
                surfaces: surfaces.into(),
                mode_before: before.clone(),
                mode_after: before.clone(),
                note: action.name.clone(),
                rule: "",
            });
        }
        let is_finite = self.run.x.iter().all(|v| v.is_finite());
        Ok((!is_finite).then(|| Stop::ActionNotFinite {
            action: action.name.clone(),
        }))
    }

    /// The actions that the jump of the state triggered, after `done`.
    fn triggered_by_jump(
        &mut self,
        done: &[usize],
        start: &Values,
        approach: &mut Approach,
    ) -> Result<Vec<usize>, FieldError> {
        let before = self.run.motion.mode.clone();
        let sides = self.ask(&before, |at, notes| sides(at, notes, Some(&before)))?;
        let Some(Sides { mode, on_surface }) = sides else {
            return Ok(Vec::new());
        };
        let actions = self.run.actions;
        let mut due = Vec::new();
        for j in 0..on_surface.len() {
            let side = approach.side[j];
            if side == 0 || actions.at_surface(j).is_none() {
                continue;
            }
            let was_done = actions
                .triggered_at(j, side)
                .any(|index| done.contains(&index));
            if self.run.motion.triggers(self.run.system).follows_law(j) && !on_surface[j] {
                // Whatever led there in this instant, also after its own change: in the end the law holds.
                if mode.entries()[j] < 0 {
                    due.extend(actions.triggered_at(j, 1));
                }
                continue;
            }
            if was_done && self.run.motion.triggers(self.run.system).is_internal(j) {
                continue;
            }
            if !on_surface[j] {
                let now = mode.entries()[j];
                // The jump of its own action may complete the passage that triggered it.
                let is_new = start[j] != 0.0 || !self.is_steady(j, &mode)?;
                if now != side && !was_done && is_new {
                    due.extend(actions.triggered_at(j, side));
                }
                (approach.side[j], approach.passes[j]) = (now, false);
                continue;
            }
            if self.is_steady(j, &mode)? {
                // No motion leads on from there: the jump has reached the surface, once.
                if start[j] != 0.0 && !was_done && !approach.passes[j] {
                    due.extend(actions.triggered_at(j, side));
                    approach.passes[j] = true;
                }
            } else if !self.goes_through(j, side, &mode, &on_surface)? {
                approach.passes[j] = false;
            } else if !approach.passes[j] {
                due.extend(actions.triggered_at(j, side));
            }
        }
        due.sort_unstable();
        due.dedup();
        Ok(due)
    }

    /// Does a switching function read discrete states alone, so that no motion changes it?
    fn is_steady(&self, j: usize, mode: &Mode) -> Result<bool, FieldError> {
        let (run, signs) = (&self.run, mode.signs());
        let place = run.motion.setting().with_signs(&signs).at(run.t, &run.x);
        let mut gradient = vec![0.0; run.x.len()];
        let rate = run.system.gradient(j, &place, &mut gradient)?;
        Ok(rate == 0.0 && gradient.iter().all(|g| *g == 0.0))
    }

    /// The sides of a mode; where it is in contact, the free side.
    fn free_sides(&self, mode: &Mode) -> Vec<i8> {
        let mut sides = mode.entries().to_vec();
        for (j, side) in sides.iter_mut().enumerate() {
            if *side == 0 && self.run.motion.triggers(self.run.system).is_only_trigger(j) {
                *side = self.run.motion.triggers(self.run.system).side(j, None);
            }
        }
        sides
    }
}

/// The derivative of a map that leaves all states as they are, in rows.
pub(crate) fn identity(n: usize) -> Vec<f64> {
    let mut rows = vec![0.0; n * n];
    rows.iter_mut().step_by(n + 1).for_each(|one| *one = 1.0);
    rows
}

/// Multiplies the rows by the derivative of a map by the state.
fn apply_derivative(
    map: &dyn ActionMap,
    (t, x): (f64, &[f64]),
    signs: &[f64],
    q: &[f64],
    rows: &mut [f64],
) -> Result<(), FieldError> {
    let n = x.len();
    let mut change = vec![0.0; n];
    for k in 0..n {
        let column: Vec<f64> = rows[k..].iter().step_by(n).copied().collect();
        map.impulse(t, x, &column, signs, q, &mut change)?;
        let entries = rows[k..].iter_mut().step_by(n);
        entries.zip(&change).for_each(|(entry, c)| *entry += c);
    }
    Ok(())
}
