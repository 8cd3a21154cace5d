//! Contact: which bodies stay, which leave, and what slides beside them.

use super::point::{Decided, Left, Lefts, Next, Notes, Point};
use crate::error::FieldError;
use crate::field::{ContactField, Guard, ModeField, SmoothField};
use crate::mode::Mode;
use crate::status::Stop;
use crate::switching::Leading;
use crate::system::dot;
use crate::tolerances::{MOST_IN_CONTACT, NO_GAP, VANISHING_MULTIPLIER};

/// An entry of the mode that is known before the decision: that of a multiplier that just vanished.
type Known = (usize, i8);

/// The field of a mode at the current point, if all of its multipliers are admissible.
struct Tried {
    velocity: Vec<f64>,
}

/// An event while bodies are in contact, that triggers no action: a body leaves, or a surface of another kind
/// is reached or left. `surfaces` vanish at the event.
pub(super) fn decide_in_contact(
    at: &Point,
    notes: &mut Notes,
    surfaces: &[usize],
) -> Result<Decided, FieldError> {
    let before = at.arrival.mode;
    let (contacts, mut meeting): (Vec<usize>, Vec<usize>) = before
        .sliding_set()
        .partition(|&j| at.triggers().is_only_trigger(j));
    let mut mode = before.clone();
    for &j in surfaces {
        if at.triggers().is_only_trigger(j) {
            mode.set(j, -before.entries()[j]);
        } else {
            meeting.push(j);
        }
    }
    meeting.sort_unstable();
    let known = vanished(at);
    place_in_contact(at, notes, mode, &contacts, &meeting, &known)
}

/// The entries that follow from the exit functions that vanish at an event.
fn vanished(at: &Point) -> Vec<Known> {
    if !matches!(&**at.arrival.field.borrow(), ModeField::Contact(_)) {
        return Vec::new();
    }
    let entry = |guard: &Guard| match *guard {
        Guard::Force(j) => Some((j, at.triggers().side(j, None))),
        Guard::Multiplier { surface, end } => Some((surface, end)),
        Guard::Surface(_) | Guard::Root(_) => None,
    };
    at.arrival.functions().iter().filter_map(entry).collect()
}

/// The mode where bodies touch without velocity (`contacts`) and other surfaces vanish (`meeting`): that with the
/// most bodies in contact and surfaces slid on, of which all forces push and all multipliers are admissible.
pub(super) fn place_in_contact(
    at: &Point,
    notes: &mut Notes,
    mode: Mode,
    contacts: &[usize],
    meeting: &[usize],
    known: &[Known],
) -> Result<Decided, FieldError> {
    let all: Vec<usize> = contacts.iter().chain(meeting).copied().collect();
    if all.len() > MOST_IN_CONTACT {
        return Ok(Err(Stop::Contact { surfaces: all }));
    }
    let mut modes = vec![mode.clone()];
    for &j in &all {
        let entries = match known.iter().find(|(surface, _)| *surface == j) {
            Some(&(_, entry)) => vec![entry],
            None if contacts.contains(&j) => vec![0, at.triggers().side(j, None)],
            None => vec![0, -1, 1],
        };
        let extended = |mode: &Mode| entries.iter().map(|&e| mode.with(j, e)).collect::<Vec<_>>();
        modes = modes.iter().flat_map(extended).collect();
    }
    modes.sort_by_key(|mode| usize::MAX - mode.codimension());
    for tried in modes {
        if at.patience.is_over() {
            return Ok(Err(Stop::Interrupted));
        }
        let Some(Tried { velocity }) = try_mode(at, notes, &tried)? else {
            continue;
        };
        if let Some(left) = leave(at, notes, &tried, contacts, meeting, known, &velocity)? {
            return Ok(Ok(Next::new(tried, left)));
        }
    }
    Ok(Err(Stop::Contact { surfaces: all }))
}

/// Evaluates the field of a mode at the current point.
fn try_mode(at: &Point, notes: &mut Notes, mode: &Mode) -> Result<Option<Tried>, FieldError> {
    let (mut x, mut velocity) = (at.x.to_vec(), vec![0.0; at.x.len()]);
    let mut field = field_of(at, mode);
    field.eval(at.t, &mut x, &mut velocity)?;
    notes.n_field_evaluations += field.n_evaluations();
    if matches!(&field, ModeField::Contact(field) if !field.presses()) {
        return Ok(None);
    }
    let exits = field.last_exits();
    let size = exits.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let is_admissible = exits.iter().all(|&v| v >= -VANISHING_MULTIPLIER * size)
        && velocity.iter().all(|v| v.is_finite());
    Ok(is_admissible.then_some(Tried { velocity }))
}

fn field_of<'a>(at: &Point<'_, '_, 'a>, mode: &Mode) -> ModeField<'a> {
    match ContactField::new(at.system, at.actions, mode, at.arrival.sides, at.q) {
        Some(field) => ModeField::Contact(Box::new(field)),
        None => ModeField::of(at.system, at.policy.law, mode),
    }
}

/// What vanishes at the start of a motion with this velocity; `None` if it does not lead to where the mode is.
fn leave(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    contacts: &[usize],
    meeting: &[usize],
    known: &[Known],
    velocity: &[f64],
) -> Result<Option<Lefts>, FieldError> {
    // Above the static limit the slipping motion has an acceleration at once.
    let is_known = |j: usize| {
        let ratio = at.system.stick_ratio(j, at.t, at.x, &mode.signs());
        ratio <= 1.0 + NO_GAP && known.iter().any(|(surface, _)| *surface == j)
    };
    let vanishes: Vec<bool> = contacts
        .iter()
        .chain(meeting)
        .map(|&j| is_known(j))
        .collect();
    let mut left = Lefts::new();
    for (&j, vanishes) in contacts.iter().chain(meeting).zip(vanishes) {
        let entry = mode.entries()[j];
        if entry == 0 {
            continue;
        }
        let order = 1 + usize::from(contacts.contains(&j));
        let mut leading = Leading {
            order,
            value: derivative_along(at, j, order, mode, velocity, 0.0)?,
        };
        if vanishes {
            // This derivative just vanished: the next one.
            let dt = at.moment(notes, &mode.signs(), velocity)?;
            let later = derivative_along(at, j, order, mode, velocity, dt)?;
            leading = Leading {
                order: order + 1,
                value: (later - leading.value) / dt,
            };
        }
        if leading.value * f64::from(entry) < 0.0 {
            return Ok(None);
        }
        if leading.value == 0.0 {
            // Nothing moves the bodies together or apart.
            leading.order = 0;
        }
        left.push(Left::Surface(j, leading));
    }
    Ok(Some(left))
}

/// The first or second derivative of h_j along the motion of a mode, a time `dt` later.
fn derivative_along(
    at: &Point,
    j: usize,
    order: usize,
    mode: &Mode,
    velocity: &[f64],
    dt: f64,
) -> Result<f64, FieldError> {
    let t = at.t + dt;
    let moved = at.x.iter().zip(velocity).map(|(x, v)| x + dt * v);
    let mut x: Vec<f64> = moved.collect();
    let mut later = velocity.to_vec();
    if dt > 0.0 {
        field_of(at, mode).eval(t, &mut x, &mut later)?;
    }
    let (mut row, signs) = (vec![0.0; x.len()], mode.signs());
    let time = if order == 1 {
        at.system.gradient(j, t, &x, &signs, &mut row)?
    } else {
        let rate = at.system.rate_gradient(j, t, &x, &signs, &mut row)?;
        rate.time
    };
    Ok(time + dot(&row, &later))
}
