//! Sliding on an intersection by another rule than the canopy: where it begins and ends.

use super::choice::choose;
use super::germ::{surfaces_left, Found};
use super::point::{Arrival, Decided, Next, Notes, Point};
use super::rule::Meeting;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::weights::RuleFailure;
use crate::motion::ModeField;
use crate::options::SlidingRule;
use crate::status::Stop;
use crate::tolerances::AT_SIDE;

/// Does the motion slide on an intersection by another rule than the canopy?
pub(super) fn slides_by_rule(arrival: &Arrival) -> bool {
    matches!(&**arrival.field.borrow(), ModeField::Intersection(field) if field.rule() != SlidingRule::Canopy)
}

/// Why the rule gives no field where the motion has just begun.
#[inline]
pub(crate) fn refusal(field: &ModeField, sliding: &[usize]) -> Option<Stop> {
    match field {
        ModeField::Intersection(field) => field
            .refusal(AT_SIDE)
            .map(|reason| rule_stop(sliding, field.rule(), reason)),
        _ => None,
    }
}

/// Rule: the end of sliding on an intersection by another rule than the canopy. The motion of lower codimension that begins
/// to leave the intersection follows.
pub(crate) fn leave_by_rule(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    if !meeting.is_exit() || !slides_by_rule(at.arrival) {
        return Ok(None);
    }
    let mut x = at.x.to_vec();
    let (candidates, refusal) = {
        let mut field = at.arrival.field.borrow_mut();
        field.exits(at.t, &mut x)?;
        let ModeField::Intersection(field) = &**field else {
            return Ok(None);
        };
        let candidates = field.leaving(AT_SIDE);
        let candidates: Vec<Mode> = candidates.iter().map(|k| meeting.on_all(k)).collect();
        // A premise has just reached zero: which one, a little beyond.
        (candidates, field.refusal(-AT_SIDE))
    };
    let after = match candidates.as_slice() {
        [] => {
            let reason = refusal.unwrap_or(RuleFailure::NoTangentCombination);
            let rule = at.policy.law.rule;
            return Ok(Some(Err(rule_stop(at.arrival.sliding, rule, reason))));
        }
        [only] => only.clone(),
        [first, ..] => {
            match choose(
                at,
                notes,
                meeting.surfaces,
                first.clone(),
                candidates.clone(),
            ) {
                Ok(after) => after,
                Err(stop) => return Ok(Some(Err(stop))),
            }
        }
    };
    let left = surfaces_left(at, notes, &after, meeting.surfaces, Found::default())?;
    Ok(Some(Ok(Next::new(after, left))))
}

fn rule_stop(sliding: &[usize], rule: SlidingRule, reason: RuleFailure) -> Stop {
    Stop::SlidingRule {
        surfaces: sliding.to_vec(),
        rule,
        reason,
    }
}
