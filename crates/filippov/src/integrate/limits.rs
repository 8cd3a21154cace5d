//! Limits of switches and of impacts that come faster and faster: jumped to, with what follows there.

use smallvec::SmallVec;

use crate::decisions::limits::{passed_beside, Limit, Passed};
use crate::decisions::{Cause, Decision, Reached};
use crate::error::FieldError;
use crate::event::Multiple;
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::status::Stop;
use crate::switch::Kind;
use crate::switch::Switch;

impl Integrator<'_> {
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
            self.x = x;
            self.recorder.jump(self.t, &self.x);
            self.motion
                .restart(self.system, self.t, before.clone(), &[]);
            let met: Vec<usize> = triggers.iter().chain(&surfaces).copied().collect();
            self.residuals = self.motion.residuals(&h, &met);
            let due = triggers.iter().flat_map(|&k| {
                let side = before.entries()[k];
                self.actions.triggered_at(k, side)
            });
            let due = due.collect();
            let y_after = SmallVec::from_slice(&self.x);
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
        let y_after = SmallVec::from_slice(&self.x);
        let switch = switch(after, rule.name());
        self.recorder.switch(Switch { y_after, ..switch });
        match decided {
            Ok(next) => self.begin(next, &Multiple::default()),
            Err(stop) => Ok(Some(stop)),
        }
    }
}
