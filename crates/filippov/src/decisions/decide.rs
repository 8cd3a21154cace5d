//! The one way from a point to the motion that follows: [`decide`].

use smallvec::SmallVec;

use super::contact::decide_in_contact;
use super::event::{arrival_at_surface, Reached};
use super::one_surface::one_surface;
use super::placement::place;
use super::point::{Cause, Notes, Point};
use super::rule::{Decision, How, Meeting, Rule};
use super::settle::settle;
use super::singular_points::doubt_at_singular_points;

use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::ModeField;

/// Decides which motion follows at a point. After an event, `reached` is what vanishes there.
pub(crate) fn decide(
    at: &Point,
    notes: &mut Notes,
    reached: &mut Reached,
) -> Result<Decision, FieldError> {
    let decision = match at.arrival.cause {
        Cause::Start => place(at, notes, None),
        Cause::Anew(memory) => place(at, notes, Some(memory)),
        Cause::Limit(meeting) => {
            let meeting = Meeting::new(at.arrival.mode, meeting, meeting, How::Limit);
            settle(at, notes, &meeting)
        }
        Cause::Event { .. } => {
            reached.find(at, notes)?;
            let surfaces = &reached.surfaces;
            let Decision { decided, rule } = after_event(at, notes, surfaces, &reached.before)?;
            doubt_at_singular_points(at, notes, surfaces, decided)
                .map(|decided| Decision { decided, rule })
        }
    };
    if let (Ok(decision), false) = (&decision, notes.warnings.is_empty()) {
        let warnings = notes.warnings.iter_mut();
        warnings.for_each(|warning| warning.rule = decision.rule.name());
    }
    decision
}

/// The motion after an event at which `surfaces` vanish beside those slid on.
fn after_event(
    at: &Point,
    notes: &mut Notes,
    fresh: &[usize],
    mode: &Mode,
) -> Result<Decision, FieldError> {
    let is_touch = matches!(at.arrival.cause, Cause::Event { touch: true, .. });
    let is_trigger = |j: &usize| at.triggers().is_only_trigger(*j);
    if !is_touch && matches!(&**at.arrival.field.borrow(), ModeField::Contact(_)) {
        return match fresh.iter().any(|&j| is_solid(at, j)) {
            true => cross_beside_triggers(at, notes, fresh),
            false => decide_in_contact(at, notes, fresh)
                .map(|decided| Decision::by(Rule::Contact, decided)),
        };
    }
    if !is_touch && fresh.len() > 1 && fresh.iter().any(is_trigger) {
        return cross_beside_triggers(at, notes, fresh);
    }
    if !is_touch && at.arrival.resting.iter().any(is_trigger) {
        // A body that touches another one was held by what ends now: they may push from here.
        return cross_beside_triggers(at, notes, &[]);
    }
    let mut both = SmallVec::<[usize; 4]>::new();
    let surfaces = match (fresh, at.arrival.sliding, at.arrival.resting) {
        (fresh, [], _) => fresh,
        ([], sliding, []) => sliding,
        // A surface on which a sliding motion rests lies in one place with a surface that it slides on.
        (fresh, sliding, resting) => {
            both.extend_from_slice(fresh);
            both.extend_from_slice(sliding);
            both.extend_from_slice(resting);
            both.sort_unstable();
            both.dedup();
            &both
        }
    };
    let how = How::Event(arrival_at_surface(at.arrival, fresh));
    let meeting = Meeting::new(mode, surfaces, fresh, how);
    let is_plain = !is_touch && at.system.reduced(surfaces).is_none();
    if is_plain && !at.system.has_nested_signs() {
        // No rule before that of one surface applies: the list need not be asked.
        if let Some(decided) = one_surface(at, notes, &meeting)? {
            return Ok(Decision::by(Rule::OneSurface, decided));
        }
    }
    settle(at, notes, &meeting)
}

/// Does an action act at surface j on the side that the motion is on? The motion does not pass it, but for a jump.
fn is_solid(at: &Point, j: usize) -> bool {
    let side = at.arrival.mode.entries()[j];
    let is_wall = at.triggers().is_only_trigger(j) && !at.triggers().is_internal(j);
    is_wall && at.actions.triggered_at(j, side).next().is_some()
}

/// A motion that passes surfaces of triggers in the direction in which they do nothing, while further surfaces vanish, or bodies
/// touch.
fn cross_beside_triggers(
    at: &Point,
    notes: &mut Notes,
    surfaces: &[usize],
) -> Result<Decision, FieldError> {
    let before = at.arrival.mode;
    let mut mode = before.clone();
    let is_passed = |j: &&usize| at.triggers().is_only_trigger(**j) && !is_solid(at, **j);
    for &j in surfaces.iter().filter(is_passed) {
        mode.set(j, -before.entries()[j]);
    }
    let decision = place(at, notes, Some(&mode))?;
    Ok(Decision::by(Rule::Triggers, decision.decided))
}
