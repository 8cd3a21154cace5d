//! Where surfaces meet: what follows at an intersection, from the switching stage.

use super::choice::{asked, choose};
use super::consistency::agreeing_with_own_signs;
use super::first_order::resolution;
use super::germ::{surfaces_left, Found};
use super::germs::{decide_by_germs, decide_undecided};
use super::point::{Decided, Lefts, Next, Notes, Point};
use super::rule::{How, Meeting};
use super::spiral::outward_leap;
use super::surroundings::Surroundings;
use crate::cube::{stable_roots_with_border, NormalFields};
use crate::error::{FieldError, Undecided};
use crate::mode::Mode;
use crate::motion::ModeField;
use crate::status::{Stop, Warning, WarningCode};
use crate::switching::{Continuation, Resolution};
use crate::tolerances::AT_SIDE;

/// Rule: the first-order data of the fields around the point, for the way in which the motion arrives.
pub(super) fn resolve_first_order(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Decided, FieldError> {
    let around = match meeting.surroundings(at, notes)? {
        Ok(around) => around,
        Err(undecided) => return decide_undecided(at, notes, meeting, Some(undecided)),
    };
    let resolution = resolution(at, notes, meeting, around)?;
    follow(at, notes, meeting, around, resolution)
}

/// Turns a resolution into the motion that follows. Where first-order data do not decide, the first
/// derivatives that do not vanish may still leave only one way.
fn follow(
    at: &Point,
    notes: &mut Notes,
    place: &Meeting,
    around: &Surroundings,
    resolution: Result<Resolution, Undecided>,
) -> Result<Decided, FieldError> {
    let (mode, meeting) = (place.mode, place.surfaces);
    if resolution == Err(Undecided::Interrupted) {
        return Ok(Err(Stop::Interrupted));
    }
    let resolution = match resolution {
        Ok(resolution) if !resolution.degenerate => resolution,
        other => return decide_undecided(at, notes, place, other.err()),
    };
    // A multiplier that starts at its end may go beyond it.
    let mut multipliers = resolution.multipliers.iter();
    let starts_at_end = !matches!(place.how, How::Event(_))
        && multipliers.any(|lambda| 1.0 - lambda.abs() <= AT_SIDE);
    if starts_at_end || !has_root(&around.fields, &resolution, at) {
        if let Ok(decided) = decide_by_germs(at, notes, place)? {
            return Ok(decided);
        }
    }
    notes.leaf = resolution.leaf;
    notes.spirals = resolution.candidates.contains(&Continuation::OutwardSpiral);
    let on_all = |k: &Mode| place.on_all(k);
    let mut candidates: Vec<Mode> = Vec::new();
    for mode in &resolution.candidates {
        let mode = mode.as_mode().map(on_all);
        candidates.extend(mode.filter(|mode| !candidates.contains(mode)));
    }
    let is_spiral = resolution.chosen == Continuation::OutwardSpiral;
    let asked = asked(at, notes, &candidates).flatten();
    let (mut after, leap) = match &resolution.chosen {
        Continuation::Mode(chosen) => (on_all(chosen), None),
        Continuation::OutwardSpiral => match asked {
            Some(asked) => (asked.clone(), None),
            None => match outward_leap(at, meeting, mode, around) {
                Some(leap) => (leap.region.clone(), Some(leap)),
                None => return decide_undecided(at, notes, place, None),
            },
        },
    };
    let preferred = after.clone();
    if !resolution.unique || is_spiral || candidates.len() > 1 {
        let modes = candidates.clone();
        if !candidates.contains(&after) {
            candidates.push(after.clone());
        }
        after = match choose(at, notes, meeting, after, candidates) {
            Ok(after) => after,
            Err(stop) => return Ok(Err(stop)),
        };
        if is_spiral {
            // The region that the spiral enters first is no mode in which a motion starts.
            notes.candidates = modes;
        }
    }
    let after = match agreeing_with_own_signs(at, notes, place, after)? {
        Ok(mode) => mode,
        Err(stop) => return Ok(Err(stop)),
    };
    let multipliers: &[f64] = if after == preferred && !is_spiral {
        &resolution.multipliers
    } else {
        &[]
    };
    let left = match &leap {
        // What it leaves is known at the end of the leap.
        Some(_) => Lefts::new(),
        None => surfaces_left(
            at,
            notes,
            &after,
            meeting,
            Found {
                multipliers,
                ..Found::default()
            },
        )?,
    };
    let mut next = Next::new(after, left);
    let oscillates = next.mode == preferred && resolution.oscillates;
    if leap.is_some() || oscillates || !multipliers.is_empty() {
        let start = next.start_mut();
        (start.oscillates, start.leap) = (oscillates, leap);
        start.multipliers = multipliers.to_vec();
    }
    Ok(Ok(next))
}

/// Is there a root of its own with which the motion slides on two surfaces? The hidden dynamics may end on a line of them.
fn has_root(fields: &NormalFields, resolution: &Resolution, at: &Point) -> bool {
    let slides_on_two = resolution.mode().filter(|mode| mode.codimension() == 2);
    slides_on_two.is_none_or(|mode| {
        !stable_roots_with_border(&fields.restrict(mode.entries()), at.patience).is_empty()
    })
}

/// Warns where the motion goes on at a root around which the regularised motion oscillates.
pub(crate) fn warn_oscillation(at: &Point, notes: &mut Notes) {
    let field = at.arrival.field.borrow();
    let ModeField::Intersection(field) = &**field else {
        return;
    };
    if !field.oscillates() {
        return;
    }
    let names = field
        .set()
        .iter()
        .map(|&j| at.system.surface_name(j) + " = 0");
    let names: Vec<String> = names.collect();
    notes.warnings.push(Warning {
        t: at.t,
        code: WarningCode::Oscillation,
        surfaces: field.set().to_vec(),
        text: format!(
            "sliding at the intersection of {} is not stable for this scaling of the surfaces: the regularised \
             motion goes around it, with another mean, or away from it; another kappa= may be stable",
            names.join(", ")
        ),
        candidates: Vec::new(),
        rule: "",
    });
}
