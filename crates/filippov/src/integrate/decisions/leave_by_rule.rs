//! Where sliding on an intersection by another rule than the canopy begins and ends.

use crate::error::FieldError;
use crate::field::weights::RuleFailure;
use crate::integrate::decisions::transition::{Decided, Lefts};
use crate::integrate::integrator::Integrator;
use crate::integrate::motion::ModeField;
use crate::integrate::Stop;
use crate::mode::Mode;
use crate::options::SlidingRule;
use crate::tolerances::AT_SIDE;

impl Integrator<'_> {
    /// Does the motion slide on an intersection by another rule than the canopy?
    pub(in crate::integrate) fn slides_by_rule(&self) -> bool {
        matches!(&self.motion.field, ModeField::Intersection(field) if field.rule() != SlidingRule::Canopy)
    }

    /// Why the rule gives no field where the motion has just begun.
    pub(in crate::integrate) fn refusal(&self) -> Option<Stop> {
        match &self.motion.field {
            ModeField::Intersection(field) => {
                field.refusal(AT_SIDE).map(|reason| self.rule_stop(reason))
            }
            _ => None,
        }
    }

    /// What follows at an exit: the motion of lower codimension that begins to leave the intersection.
    pub(in crate::integrate) fn leave_by_rule(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
    ) -> Result<Decided, FieldError> {
        self.motion.field.exits(self.t, &mut self.x)?;
        let ModeField::Intersection(field) = &self.motion.field else {
            return Ok(Ok((mode.clone(), Lefts::new())));
        };
        let on_all = |k: &Mode| {
            let mut full = mode.clone();
            for (&j, &entry) in meeting.iter().zip(k.entries()) {
                full.set(j, entry);
            }
            full
        };
        let candidates: Vec<Mode> = field.leaving(AT_SIDE).iter().map(on_all).collect();
        let after = match candidates.as_slice() {
            [] => {
                // A premise has just reached zero: which one, a little beyond.
                let reason = field.refusal(-AT_SIDE);
                let reason = reason.unwrap_or(RuleFailure::NoTangentCombination);
                return Ok(Err(self.rule_stop(reason)));
            }
            [only] => only.clone(),
            [first, ..] => match self.choose(meeting, first.clone(), candidates.clone()) {
                Ok(after) => after,
                Err(stop) => return Ok(Err(stop)),
            },
        };
        let left = self.departures(&after, meeting, &[])?;
        Ok(Ok((after, left)))
    }

    fn rule_stop(&self, reason: RuleFailure) -> Stop {
        Stop::SlidingRule {
            surfaces: self.motion.sliding().to_vec(),
            rule: self.options.sliding,
            reason,
        }
    }
}
