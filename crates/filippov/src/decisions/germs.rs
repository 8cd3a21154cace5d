//! Decide by the germs of the guards if first-order data are doubtful.

use super::choice::choose;
use super::departures::velocity_in;
use super::leave_by_rule::slides_by_rule;
use super::meeting::hidden_limit;
use super::point::{Decided, Left, Next, Notes, Point};
use super::rule::{How, Meeting};
use super::viable::{noise_of, survey, Viable};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::status::Stop;
use crate::switching::{NormalFields, Resolution, Undecided};
use crate::tolerances::{MOST_MEETING, TANGENT};

/// Rule: first-order data are doubtful, and the viable modes are known.
pub(super) fn decide_if_doubtful(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    let is_few = (2..=MOST_MEETING).contains(&meeting.surfaces.len());
    let sticks = meeting.surfaces.iter().any(|&j| at.system.sticks_at(j));
    if !is_few || sticks || slides_by_rule(at.arrival) {
        return Ok(None);
    }
    let corners = at.corners(notes, meeting.surfaces, meeting.mode)?;
    match corners.normal_fields() {
        Ok(fields) if is_doubtful(at, &fields, meeting)? => decide_by_germs(at, notes, meeting),
        _ => Ok(None),
    }
}

/// What follows at an intersection of which first-order data do not decide, as `resolution` says.
pub(super) fn decide_undecided(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    resolution: Result<Resolution, Undecided>,
) -> Result<Decided, FieldError> {
    notes.leaf = "germs";
    Ok(match decide_by_germs(at, notes, meeting)? {
        Some(decided) => decided,
        None => Err(Stop::Intersection {
            surfaces: meeting.surfaces.to_vec(),
            candidates: Vec::new(),
            reason: resolution.err().unwrap_or(Undecided::NoOutcome),
        }),
    })
}

/// The viable mode that follows; `None` if there is none.
fn decide_by_germs(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    let Some(mut found) = survey(at, notes, meeting)? else {
        return Ok(None);
    };
    drop_other_names(at, notes, meeting, &mut found.viable)?;
    if found.viable.is_empty() {
        return Ok(None);
    }
    let mut chosen = preferred(at, notes, meeting, &found.viable)?;
    let viable = found.viable.iter().map(|viable| viable.mode.clone());
    let mut modes: Vec<Mode> = viable.chain(found.open).collect();
    modes.reverse();
    if modes.len() > 1 {
        chosen = match choose(at, notes, meeting.surfaces, chosen, modes) {
            Ok(chosen) => chosen,
            Err(stop) => return Ok(Some(Err(stop))),
        };
    }
    let viable = found
        .viable
        .into_iter()
        .find(|viable| viable.mode == chosen);
    Ok(viable.map(|viable| Ok(begin(viable))))
}

/// The mode that is taken among several, if none is asked for: the limit of the hidden dynamics; the mode before; a mode all
/// of whose guards grow before one with a guard that stays zero, and of several of those that with more signs +1.
fn preferred(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    viable: &[Viable],
) -> Result<Mode, FieldError> {
    let is_viable = |mode: &Mode| viable.iter().any(|viable| viable.mode == *mode);
    if let [only] = viable {
        return Ok(only.mode.clone());
    }
    let limit = hidden_limit(at, notes, meeting)?;
    if let Some(limit) = limit.filter(is_viable) {
        return Ok(limit);
    }
    if matches!(meeting.how, How::Event(_)) && is_viable(meeting.mode) {
        return Ok(meeting.mode.clone());
    }
    let strict = viable.iter().find(|viable| viable.is_strict);
    Ok(strict.unwrap_or(&viable[0]).mode.clone())
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
    viable.sort_by_key(|viable| (viable.is_pressed, viable.mode != *meeting.mode));
    let mut velocities: Vec<Vec<f64>> = Vec::with_capacity(viable.len());
    for one in viable.iter() {
        let mut velocity = vec![0.0; at.x.len()];
        velocity_in(
            at,
            notes,
            &one.mode,
            &one.multipliers,
            at.t,
            at.x,
            &mut velocity,
        )?;
        velocities.push(velocity);
    }
    let stays_on = |one: &Viable, j: usize| {
        let mut left = one.left.iter();
        one.mode.entries()[j] == 0
            || left.any(
                |left| matches!(left, Left::Surface(k, leading) if *k == j && leading.order == 0),
            )
    };
    let mut kept: Vec<usize> = Vec::new();
    for k in 0..viable.len() {
        let is_named = kept.iter().any(|&known| {
            let (one, other) = (&viable[k], &viable[known]);
            let differs = |j: &&usize| one.mode.entries()[**j] != other.mode.entries()[**j];
            let mut differing = meeting.surfaces.iter().filter(differs);
            let size = velocities[known]
                .iter()
                .fold(0.0_f64, |size, v| size.max(v.abs()));
            let mut pairs = velocities[k].iter().zip(&velocities[known]);
            differing.all(|&j| stays_on(one, j) && stays_on(other, j))
                && pairs.all(|(a, b)| (a - b).abs() <= TANGENT * size)
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

fn begin(viable: Viable) -> Next {
    let mut next = Next::new(viable.mode, viable.left);
    if viable.is_given || next.mode.codimension() > 1 && !viable.multipliers.is_empty() {
        let start = next.start_mut();
        (start.multipliers, start.is_given) = (viable.multipliers, viable.is_given);
    }
    next
}

/// Is a normal component at some surface not clear of zero?
fn is_doubtful(at: &Point, fields: &NormalFields, meeting: &Meeting) -> Result<bool, FieldError> {
    let noise = noise_of(at, meeting, fields)?;
    Ok(noise.iter().enumerate().any(|(i, noise)| {
        let [least, most] = fields.row_range(i);
        least.abs() <= *noise || most.abs() <= *noise
    }))
}
