//! Sliding whose multipliers are lost, or go on beyond their ends by rounding.

use super::end_of_sliding::{beyond_double_zero, two_fold_here};
use super::point::{Notes, Point};
use super::surroundings::Surroundings;
use smallvec::{smallvec, SmallVec};

use crate::error::FieldError;
use crate::motion::{Guard, ModeField, RootEnd};
use crate::tolerances::{AT_FOLD, AT_SIDE, TANGENT};

/// The functions that count as vanishing where steps of sliding shrink to nothing: the jump of the field across a surface has
/// vanished, the multipliers have met a fold beyond which there are none, or both fields are tangent to the surface.
pub(crate) fn lost_functions(
    at: &Point,
    notes: &mut Notes,
) -> Result<Option<SmallVec<[Guard; 2]>>, FieldError> {
    if at.arrival.slides_on_several() {
        let around = Surroundings::of(at, notes, at.arrival.sliding, at.arrival.mode)?;
        if around.is_ok_and(|around| around.has_silent(at)) {
            return Ok(Some(smallvec![Guard::Root(RootEnd::Stability)]));
        }
        return Ok(has_lost_root(at)?.then(|| smallvec![Guard::Root(RootEnd::Fold)]));
    }
    let &[j] = at.arrival.sliding else {
        return Ok(None);
    };
    let arrived = beyond_double_zero(at, notes, j)?.is_some() || two_fold_here(at)?.is_some();
    Ok(arrived.then(|| Guard::ends(j).as_slice().into()))
}

/// Has sliding on several surfaces come to a fold of its multipliers?
fn has_lost_root(at: &Point) -> Result<bool, FieldError> {
    let mut field = at.arrival.field.borrow_mut();
    let is_rootless = |field: &ModeField| matches!(field, ModeField::Intersection(f) if f.set().len() > 2 && f.is_rootless());
    if !matches!(&**field, ModeField::Intersection(_)) {
        return Ok(false);
    }
    let was_rootless = is_rootless(&field);
    let exits = field.exits(at.t, &mut at.x.to_vec())?;
    // The evaluation here may be the first one without a root.
    if was_rootless || is_rootless(&field) {
        return Ok(true);
    }
    let mut ends = field.guards().into_iter().zip(exits);
    Ok(ends.any(|(guard, exit)| guard == Guard::Root(RootEnd::Fold) && exit.abs() < AT_FOLD))
}

/// Is it the root of three and more surfaces that is no longer stable?
pub(crate) fn loses_stability(field: &ModeField, functions: &[Guard]) -> bool {
    let ModeField::Intersection(field) = field else {
        return false;
    };
    field.set().len() > 2 && functions.contains(&Guard::Root(RootEnd::Stability))
}

/// How far multipliers may go beyond their ends, by guard, after an event whose decision is that the motion slides on:
/// there forces balance to rounding. Ten times as far each time, so that the motion gets on.
pub(crate) fn loosen(field: &ModeField, functions: &[Guard], slacks: &mut Vec<(Guard, f64)>) {
    if !matches!(field, ModeField::Intersection(_)) {
        slacks.clear();
        return;
    }
    let is_end = |guard: &&Guard| matches!(guard, Guard::Multiplier { .. });
    for &guard in functions.iter().filter(is_end) {
        match slacks.iter_mut().find(|held| held.0 == guard) {
            Some(held) => held.1 = (10.0 * held.1).min(AT_SIDE),
            None => slacks.push((guard, TANGENT)),
        }
    }
}
