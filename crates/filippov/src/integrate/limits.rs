//! Accumulations: infinitely many switches in finite time, jumped to their limit.

use smallvec::SmallVec;

use crate::decisions::limits::{limit_of, Limit};
use crate::decisions::{Cause, Decision};
use crate::error::FieldError;
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::solution::Switch;
use crate::status::Stop;
use crate::switching::Kind;

impl Integrator<'_> {
    /// The limit that the last switches tend to, if they do and it is within the known times.
    pub(in crate::integrate) fn accumulation(&mut self) -> Result<Option<Limit>, FieldError> {
        if self.system.n_surfaces() < 2 {
            // Nothing can meet.
            return Ok(None);
        }
        let limit = self.ask(Cause::Start, |at, _| limit_of(at))?;
        Ok(limit.filter(|limit| limit.t <= self.horizon))
    }

    /// Moves to the limit and goes on from there.
    pub(in crate::integrate) fn jump_to(
        &mut self,
        limit: Limit,
        before: Mode,
    ) -> Result<Option<Stop>, FieldError> {
        self.recorder
            .begin_segment(self.t, &before, SmallVec::new(), &self.motion.discrete);
        self.motion.mode = before.clone();
        self.move_straight(limit.t, limit.x)?;
        self.stats.n_switches += 1;
        let Decision { rule, decided, .. } = self.decide(Cause::Limit(&limit.meeting))?;
        // Where nothing is decided the run ends at the limit, having come there all the same.
        let after = decided.as_ref().map_or(&before, |next| &next.mode).clone();
        self.recorder.switch(Switch {
            t: self.t,
            y_before: SmallVec::from_slice(&self.x),
            y_after: SmallVec::from_slice(&self.x),
            kind: Kind::Accumulation,
            surfaces: limit.meeting.into(),
            mode_before: before,
            mode_after: after,
            note: String::new(),
            rule: rule.name(),
        });
        match decided {
            Ok(next) => self.begin(next),
            Err(stop) => Ok(Some(stop)),
        }
    }
}
