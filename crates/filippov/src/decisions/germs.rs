//! Decide by the germs of the guards if first-order data are doubtful.

use filippov_expr::sort_few;

use super::candidate::Viable;
use super::choice::choose;
use super::consistency::{bends, with_those_that_jump};
use super::first_order::hidden_limit;
use super::leave_by_rule::slides_by_rule;
use super::limits::stay_on_all;
use super::point::{Decided, Notes, Point};
use super::rest::stay_if_nothing_leaves;
use super::rule::{How, Meeting};
use super::touching::Parallels;
use super::viable::{survey, Survey};
use crate::error::FieldError;
use crate::error::Undecided;
use crate::mode::Mode;
use crate::motion::SmoothField;
use crate::status::Stop;
use crate::tolerances::{AT_SIDE, MOST_MEETING, TANGENT};

/// Rule: switching functions jump between the regions around the point, surfaces are in one place or touch one another.
pub(super) fn decide_if_entangled(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    if !(1..=MOST_MEETING).contains(&meeting.surfaces.len()) || slides_by_rule(at.arrival) {
        return Ok(None);
    }
    let wider = with_those_that_jump(at, notes, meeting)?;
    if wider.is_none() && !bends(at, meeting)? {
        // To rounding, surfaces that touch are one, and the rules for surfaces that cross may still apply.
        if Parallels::of(at, meeting.surfaces, meeting.mode)?.are_any() {
            return Ok(decide_by_germs(at, notes, meeting)?.ok());
        }
        return Ok(None);
    }
    let is_steep = wider.is_some() && !at.system.is_analytic();
    let surfaces = wider.unwrap_or_else(|| meeting.surfaces.to_vec());
    if is_steep {
        // A function that jumps here, or a root that is too steep to tell.
        if let Some(stays) = stay_if_nothing_leaves(at, notes, &meeting.with_surfaces(&surfaces))? {
            notes.leaf = "rest";
            return Ok(Some(Ok(stays)));
        }
    }
    decide_undecided(at, notes, &meeting.with_surfaces(&surfaces), None).map(Some)
}

/// Rule: first-order data are doubtful, and the viable modes are known.
pub(super) fn decide_if_doubtful(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    let is_few = (2..=MOST_MEETING).contains(&meeting.surfaces.len());
    if !is_few || slides_by_rule(at.arrival) {
        return Ok(None);
    }
    let Ok(around) = meeting.surroundings(at, notes)? else {
        return Ok(None);
    };
    if !around.is_doubtful() {
        return Ok(None);
    }
    if around.has_silent(at) {
        return decide_undecided(at, notes, meeting, None).map(Some);
    }
    Ok(decide_by_germs(at, notes, meeting)?.ok())
}

/// Rule: a limit of infinitely many switches, where the motion slides on all surfaces if that is possible. Where all fields are
/// tangent to one of them, it goes on in a viable mode.
pub(super) fn stay_at_limit(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    if meeting.how != How::Limit || meeting.surfaces.len() == 1 {
        return Ok(None);
    }
    match stay_on_all(at, notes, meeting)? {
        Some(Err(Stop::Intersection { reason, .. })) => {
            decide_undecided(at, notes, meeting, Some(reason)).map(Some)
        }
        decided => Ok(decided),
    }
}

/// What follows at an intersection of which first-order data do not decide; why, if that is known. Rest comes first where a
/// field or a slope is not finite: it has no germ there.
pub(super) fn decide_undecided(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    reason: Option<Undecided>,
) -> Result<Decided, FieldError> {
    if !is_finite(at, notes, meeting)? {
        if let Some(stays) = stay_if_nothing_leaves(at, notes, meeting)? {
            notes.leaf = "rest";
            return Ok(Ok(stays));
        }
    }
    let decided = by_viable_modes(at, notes, meeting, reason)?;
    if matches!(decided, Err(Stop::Intersection { .. })) && !at.patience.is_over() {
        if let Some(stays) = stay_if_nothing_leaves(at, notes, meeting)? {
            notes.leaf = "rest";
            return Ok(Ok(stays));
        }
    }
    Ok(decided)
}

/// Are the fields of all regions and the slopes of the surfaces finite at the point?
fn is_finite(at: &Point, notes: &mut Notes, meeting: &Meeting) -> Result<bool, FieldError> {
    if matches!(meeting.surroundings(at, notes)?, Err(Undecided::NotFinite)) {
        return Ok(false);
    }
    let (signs, mut row) = (meeting.mode.signs(), vec![0.0; at.x.len()]);
    for &j in meeting.surfaces {
        at.system.gradient(j, &at.place(&signs), &mut row)?;
        if row.iter().any(|slope| !slope.is_finite()) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The viable mode that follows.
fn by_viable_modes(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    reason: Option<Undecided>,
) -> Result<Decided, FieldError> {
    notes.leaf = "germs";
    let found = decide_by_germs(at, notes, meeting)?;
    Ok(match found {
        Ok(decided) => decided,
        Err(found) if !found.between.is_empty() => Err(Stop::SlidesAcrossJump {
            surfaces: meeting.surfaces.to_vec(),
            jumping: found.jumping(),
        }),
        Err(found) => Err(Stop::Intersection {
            surfaces: meeting.surfaces.to_vec(),
            // Where no mode could be looked at, nothing is known to fail.
            reason: reason.unwrap_or(match found.open.is_empty() && !found.failing.is_empty() {
                true => Undecided::NoneViable,
                false => Undecided::NoOutcome,
            }),
            failing: found.failing,
        }),
    })
}

/// The viable mode that follows. If there is none, what is known of all modes.
pub(super) fn decide_by_germs(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Result<Decided, Survey>, FieldError> {
    let Some(mut found) = survey(at, notes, meeting)? else {
        return Ok(Err(Survey::default()));
    };
    drop_other_names(at, notes, meeting, &mut found.viable)?;
    if found.viable.is_empty() {
        return Ok(Err(found));
    }
    let mut chosen = preferred(at, notes, meeting, &found.viable)?;
    let viable = found.viable.iter().map(|viable| viable.next.mode.clone());
    let mut modes: Vec<Mode> = viable.chain(found.open).collect();
    modes.reverse();
    if modes.len() > 1 {
        chosen = match choose(at, notes, meeting.surfaces, chosen, modes) {
            Ok(chosen) => chosen,
            Err(stop) => return Ok(Ok(Err(stop))),
        };
    }
    let viable = found
        .viable
        .into_iter()
        .find(|viable| viable.next.mode == chosen);
    Ok(viable
        .map(|viable| Ok(viable.next))
        .ok_or_else(Survey::default))
}

/// The mode that is taken among several, if none is asked for: the limit of the hidden dynamics; the mode before; a mode all
/// of whose guards grow before one with a guard that stays zero, and of several of those that with more signs +1.
fn preferred(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    viable: &[Viable],
) -> Result<Mode, FieldError> {
    let is_viable = |mode: &Mode| viable.iter().any(|viable| viable.next.mode == *mode);
    if let [only] = viable {
        return Ok(only.next.mode.clone());
    }
    let around = meeting.surroundings(at, notes)?;
    if around.is_ok_and(|around| !around.has_silent(at)) {
        let limit = hidden_limit(at, notes, meeting)?;
        if let Some(limit) = limit.filter(is_viable) {
            return Ok(limit);
        }
    }
    if matches!(meeting.how, How::Event(_)) && is_viable(meeting.mode) {
        return Ok(meeting.mode.clone());
    }
    let is_any_strict = viable.iter().any(|viable| viable.is_strict);
    let strict = viable
        .iter()
        .filter(|viable| viable.is_strict == is_any_strict);
    let before = multipliers_before(at, notes, meeting)?;
    let far = |viable: &&Viable| {
        let mut own = viable.next.multipliers().iter();
        let entries = meeting
            .surfaces
            .iter()
            .map(|&j| viable.next.mode.entries()[j]);
        let place = entries.map(|entry| match entry {
            0 => own.next().copied().unwrap_or(0.0),
            side => f64::from(side),
        });
        let parts = place.zip(&before).map(|(own, before)| (own - before).abs());
        (parts.sum::<f64>() / AT_SIDE).round() as u64
    };
    Ok(strict
        .min_by_key(far)
        .unwrap_or(&viable[0])
        .next
        .mode
        .clone())
}

/// The signs of the motion that arrives, with the multipliers of what it slides on a moment before: at the point itself they
/// may be lost in rounding. Empty at a start.
fn multipliers_before(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Vec<f64>, FieldError> {
    if !matches!(meeting.how, How::Event(_)) {
        return Ok(Vec::new());
    }
    let mut velocity = at.arrival.velocity.to_vec();
    let moment = at.moment(notes, at.arrival.signs, &velocity)?;
    let mut past = at.along(&velocity, -moment);
    let mut field = at.arrival.field.borrow_mut();
    field.eval(at.t - moment, &mut past, &mut velocity)?;
    let known = field.multipliers();
    let mut signs = at.arrival.mode.signs();
    for (&j, &multiplier) in at.arrival.sliding.iter().zip(&known) {
        signs[j] = if multiplier.is_finite() {
            multiplier
        } else {
            0.0
        };
    }
    Ok(meeting.surfaces.iter().map(|&j| signs[j]).collect())
}

/// Keeps one of several modes that have the same motion, and differ in the entries of surfaces on which that stays: the one
/// that slides where a field presses, the mode before, or the first.
fn drop_other_names(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    viable: &mut Vec<Viable>,
) -> Result<(), FieldError> {
    if viable.len() < 2 || viable.iter().all(|viable| viable.is_strict) {
        return Ok(());
    }
    let rank = |viable: &Viable| (viable.is_pressed, viable.next.mode != *meeting.mode);
    sort_few(viable, |a, b| rank(a) < rank(b));
    let mut velocities: Vec<Vec<f64>> = Vec::with_capacity(viable.len());
    for Viable { next, .. } in viable.iter() {
        velocities.push(at.velocity_from(notes, &next.mode, next.start.as_deref())?);
    }
    let around = meeting.surroundings(at, notes)?;
    let units = at.units();
    let pace = around.map_or(0.0, |around| around.corners.pace(&|i| units.of_state(i)));
    let stays_on = |one: &Viable, j: usize| {
        let mut left = one.next.left.iter();
        one.next.mode.entries()[j] == 0
            || left.any(|left| left.surface() == Some(j) && left.leading.order == 0)
    };
    let mut kept: Vec<usize> = Vec::new();
    for k in 0..viable.len() {
        let is_named = kept.iter().any(|&known| {
            let (one, other) = (&viable[k], &viable[known]);
            let differs =
                |j: &&usize| one.next.mode.entries()[**j] != other.next.mode.entries()[**j];
            let mut differing = meeting.surfaces.iter().filter(differs);
            let mut pairs = velocities[k].iter().zip(&velocities[known]).enumerate();
            differing.all(|&j| stays_on(one, j) && stays_on(other, j))
                && pairs.all(|(i, (a, b))| (a - b).abs() <= TANGENT * pace * units.of_state(i))
        });
        if !is_named {
            kept.push(k);
        }
    }
    let mut index = 0;
    viable.retain(|_| {
        index += 1;
        kept.contains(&(index - 1))
    });
    Ok(())
}
