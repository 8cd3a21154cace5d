//! Warnings about the side from which an action is triggered.

use super::placement::{act_from_side, is_slow, leaves_point_alone};
use super::point::{Notes, Point};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::first_nonzero;
use crate::status::{Warning, WarningCode};

/// Warns of a trigger that the motion crosses from its side in `before` without an action, since its direction is the other
/// one, if the action would have kept the motion on its side: a wall that is passed from behind. A count, or a relay with
/// two thresholds, is crossed either way. Says whether there is such a trigger.
pub(crate) fn warn_against_direction(
    at: &Point,
    notes: &mut Notes,
    j: usize,
    before: &Mode,
) -> Result<bool, FieldError> {
    let is_trigger = at.triggers().is_only_trigger(j) && !at.triggers().follows_law(j);
    let mut fires = at.actions.triggered_at(j, before.entries()[j]);
    if !is_trigger || fires.next().is_some() {
        return Ok(false);
    }
    // A map that fails here was not asked for.
    if would_turn_back(at, j, before).unwrap_or(false) {
        let text = format!(
            "the motion crosses {} = 0 against the direction of the reset {}, which does not happen there; with \
             direction=\"both\" it does",
            at.system.surface_name(j),
            action_name(at, j)
        );
        warn(at, notes, WarningCode::AgainstDirection, j, text);
    }
    Ok(true)
}

/// Would the action at surface `j`, on which the point lies, leave the motion on the side of the mode?
fn would_turn_back(at: &Point, j: usize, mode: &Mode) -> Result<bool, FieldError> {
    let (side, signs) = (mode.entries()[j], mode.signs());
    let mut x = at.x.to_vec();
    act_from_side(at, j, &signs, &mut x)?;
    let mut h = vec![0.0; signs.len()];
    at.system.surfaces(&at.place_at(at.t, &x, &signs), &mut h)?;
    if !leaves_point_alone(at, j, &signs)? {
        return Ok(h[j] * f64::from(side) > 0.0);
    }
    let mut row = vec![0.0; x.len()];
    let rate = at
        .system
        .rate_gradient(j, &at.place_at(at.t, &x, &signs), &mut row)?;
    Ok(rate.rate * f64::from(side) > 0.0)
}

/// Warns of a start on a trigger without a direction, unless the velocity leads off to the side taken. `mode` has the side
/// that was taken.
pub(crate) fn warn_unknown_side(
    at: &Point,
    notes: &mut Notes,
    j: usize,
    mode: &Mode,
) -> Result<(), FieldError> {
    let has_direction = at.actions.at_surface(j).is_none_or(|(_, d)| d != 0);
    if has_direction || at.triggers().follows_law(j) {
        return Ok(());
    }
    let side = mode.entries()[j];
    let leading = first_nonzero(at.system, j, side, 0, &at.place(&mode.signs()))?;
    let leads_off =
        leading.order == 1 && leading.sign() == side && !is_slow(at, j, leading.value, mode)?;
    if !leads_off {
        let text = format!(
            "the run starts on {} = 0, and the reset {} has no direction: the start counts as on the side where the \
             function of the reset is positive, as with direction=\"down\"; direction=\"up\" is the other side",
            at.system.surface_name(j),
            action_name(at, j)
        );
        warn(at, notes, WarningCode::UnknownSide, j, text);
    }
    Ok(())
}

fn action_name<'p>(at: &'p Point, j: usize) -> &'p str {
    let found = at.actions.at_surface(j);
    found.map_or("", |(action, _)| &action.name)
}

fn warn(at: &Point, notes: &mut Notes, code: WarningCode, j: usize, text: String) {
    notes.warnings.push(Warning {
        t: at.t,
        code,
        text,
        candidates: Vec::new(),
        surfaces: vec![j],
        rule: "",
    });
}
