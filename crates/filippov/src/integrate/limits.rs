//! Limits of switches and of impacts that come faster and faster: jumped to, with what follows there.

use smallvec::SmallVec;

use crate::decisions::limits::{limit_of_switches, limits_of_impacts, Limit};
use crate::decisions::{Cause, Decision};
use crate::error::FieldError;
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::motion::Projector;
use crate::status::Stop;
use crate::switch::Kind;
use crate::switch::Switch;

impl Integrator<'_> {
    /// The limit that the last switches tend to, if they do and it is within the known times.
    pub(in crate::integrate) fn accumulation(&mut self) -> Result<Option<Limit>, FieldError> {
        if self.system.n_surfaces() < 2 {
            // Nothing can meet.
            return Ok(None);
        }
        let limit = self.ask(Cause::Start, |at, _| limit_of_switches(at))?;
        Ok(limit.filter(|limit| limit.t <= self.horizon))
    }

    /// The limit of the last impacts, if they have one within the known times. `before` switches came before this instant.
    pub(in crate::integrate) fn impacts_end(
        &mut self,
        before: usize,
        after: &Mode,
    ) -> Result<Option<Limit>, FieldError> {
        let limits = self.ask(Cause::Start, |at, _| limits_of_impacts(at, before, after))?;
        let mut known = limits.into_iter().flatten();
        Ok(known.find(|limit| limit.t <= self.horizon))
    }

    /// Moves to the limit and goes on from there.
    pub(in crate::integrate) fn jump_to(
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
        let discrete = &self.motion.discrete;
        self.recorder
            .begin_segment(self.t, &before, SmallVec::new(), discrete);
        self.motion.mode = before.clone();
        let y_before = x.clone().into();
        if t > self.t || !is_rest {
            self.move_straight(t, x)?;
        } else {
            self.x = x;
            self.recorder.jump(self.t, &self.x);
        }
        self.stats.n_switches += 1;
        let due = match surfaces[..] {
            [surface] if is_rest => self.reached_beside(&before, surface)?,
            _ => Vec::new(),
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
        if !due.is_empty() {
            let y_after = SmallVec::from_slice(&self.x);
            let switch = switch(&before, "");
            self.recorder.switch(Switch { y_after, ..switch });
            return self.act(due);
        }
        let cause = match is_rest {
            true => Cause::Anew(&before),
            false => Cause::Limit(&surfaces),
        };
        let Decision { rule, decided } = self.decide(cause)?;
        // Where nothing is decided the run ends at the limit, having come there all the same.
        let after = decided.as_ref().map_or(&before, |next| &next.mode);
        let y_after = SmallVec::from_slice(&self.x);
        let switch = switch(after, rule.name());
        self.recorder.switch(Switch { y_after, ..switch });
        match decided {
            Ok(next) => self.begin(next),
            Err(stop) => Ok(Some(stop)),
        }
    }

    /// The actions at other surfaces that the jump to the limit passed: the point is moved back onto them.
    fn reached_beside(&mut self, before: &Mode, surface: usize) -> Result<Vec<usize>, FieldError> {
        let signs = before.signs();
        let h = self.surface_values(&signs)?;
        let passed = (0..h.len()).filter(|&k| {
            let side = before.entries()[k];
            k != surface
                && self.motion.triggers(self.system).is_only_trigger(k)
                && h[k] * f64::from(side) < 0.0
        });
        let passed: Vec<usize> = passed
            .filter(|&k| self.motion.triggers(self.system).side(k, None) == before.entries()[k])
            .collect();
        if passed.is_empty() {
            return Ok(Vec::new());
        }
        let set: Vec<usize> = passed.iter().copied().chain([surface]).collect();
        let mut projector = Projector::new(self.x.len(), self.system.n_surfaces());
        projector.project_onto(self.system, &set, self.t, &mut self.x, &signs)?;
        self.recorder.jump(self.t, &self.x);
        self.motion
            .restart(self.system, self.t, before.clone(), &[]);
        let h = self.surface_values(&signs)?;
        self.residuals = self.motion.residuals(&h, &set);
        let due = passed.iter().flat_map(|&k| {
            let side = before.entries()[k];
            self.actions.triggered_at(k, side).collect::<Vec<_>>()
        });
        Ok(due.collect())
    }
}
