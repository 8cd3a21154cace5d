//! Meetings of surfaces where the field is affine in their signs: one relay problem, whatever their number.

use super::choice::choose;
use super::coinciding::have_parallels;
use super::departures::departures;
use super::germs::decide_undecided;
use super::point::{Decided, Left, Lefts, Next, Notes, Point};
use super::rule::{How, Meeting};
use super::surroundings::Surroundings;
use crate::cube::{RelaySolution, Uniqueness};
use crate::error::FieldError;
use crate::error::Undecided;
use crate::mode::Mode;
use crate::motion::{Guard, SmoothField};
use crate::status::Stop;
use crate::switching::relay_at;
use crate::tolerances::{AT_SIDE, MOST_IN_LOOP, MOST_MEETING};

/// What follows where the surfaces of `meeting` vanish, if the field is affine in their signs and the relay
/// problem has certainly one solution; for many surfaces also if that is not known, with a warning. `None`
/// otherwise.
///
/// Several surfaces may be reached and left at one instant. Where first-order data leave both open, as they do at the
/// exit of a multiplier, they are taken a moment later along the motion that ends.
pub(super) fn decide_by_relay(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    let (question, is_event, mode, meeting) = (
        meeting,
        matches!(meeting.how, How::Event(_)),
        meeting.mode,
        meeting.surfaces,
    );
    // From a start on two surfaces the motion may also spiral outwards: their trees know. Between parallel ones it cannot.
    if !is_event && meeting.len() == 2 && !have_parallels(at, meeting, mode)? {
        return Ok(None);
    }
    let is_exit = |guard: &Guard| !guard.is_surface();
    let exits = is_event && at.arrival.functions().iter().any(is_exit);
    let mut found = solve_relay_at(at, notes, mode, meeting, exits)?;
    let is_degenerate = |found: &Option<RelaySolution>| {
        found
            .as_ref()
            .is_some_and(|found| !found.degenerate.is_empty())
    };
    if is_degenerate(&found) && is_event && !exits {
        found = solve_relay_at(at, notes, mode, meeting, true)?;
    }
    let Some(mut found) = found else {
        return Ok(None);
    };
    let is_silent = |around: &Surroundings| around.has_silent(at);
    if found.may_be_tangent && question.surroundings(at, notes)?.is_ok_and(is_silent) {
        return decide_undecided(at, notes, question, None).map(Some);
    }
    if found.n_sharing > MOST_IN_LOOP {
        return Ok(Some(Err(Stop::Intersection {
            surfaces: meeting.to_vec(),
            failing: Vec::new(),
            reason: Undecided::TooRedundant { n: found.n_sharing },
        })));
    }
    if !found.degenerate.is_empty() {
        if !is_event {
            return Ok(None);
        }
        let_go(at, mode, meeting, &mut found);
    }
    let is_certain = match found.uniqueness {
        Uniqueness::Certain => true,
        // Surfaces may be parallel at a point only: those that stay together are so along the motion.
        Uniqueness::OfMotion if found.n_sharing > 0 && is_event => {
            let later = solve_relay_at(at, notes, mode, meeting, true)?;
            later.is_some_and(|later| {
                (later.uniqueness, &later.modes) == (found.uniqueness, &found.modes)
            })
        }
        other => other == Uniqueness::OfMotion,
    };
    if !is_certain && meeting.len() <= MOST_MEETING {
        return Ok(None);
    }
    let mut after = mode.clone();
    let (mut multipliers, entries) = (Vec::new(), found.modes.iter().zip(&found.signs));
    for (&j, (&entry, &sign)) in meeting.iter().zip(entries) {
        after.set(j, entry);
        if entry == 0 {
            multipliers.push(sign);
        }
    }
    if !is_certain {
        match choose(at, notes, meeting, after.clone(), vec![after.clone()]) {
            Ok(chosen) => after = chosen,
            Err(stop) => return Ok(Some(Err(stop))),
        }
    }
    let left = departures_caught(at, notes, &mut after, meeting, &multipliers)?;
    Ok(Some(Ok(Next::new(after, left))))
}

/// What the motion in `after` leaves; surfaces that it would pass to the wrong side are slid on instead.
fn departures_caught(
    at: &Point,
    notes: &mut Notes,
    after: &mut Mode,
    meeting: &[usize],
    multipliers: &[f64],
) -> Result<Lefts, FieldError> {
    let mut left = departures(at, notes, after, meeting, multipliers)?;
    for _ in meeting {
        let is_wrong = |left: &&Left| {
            let entry = left.surface().map_or(0, |j| after.entries()[j]);
            left.leading.value * f64::from(entry) <= 0.0
        };
        let wrong = left.iter().filter(is_wrong);
        let wrong: Vec<usize> = wrong.filter_map(Left::surface).collect();
        if wrong.is_empty() {
            break;
        }
        wrong.iter().for_each(|&j| after.set(j, 0));
        left = departures(at, notes, after, meeting, &[])?;
    }
    Ok(left)
}

/// Multipliers at their ends with rates that vanish: loads passed on from a contact that begins to slip. Those
/// that slid until now and are at the same end let go too; if the load does not grow they are caught at
/// once. All others stay as they are.
fn let_go(at: &Point, mode: &Mode, meeting: &[usize], found: &mut RelaySolution) {
    let multipliers = at.arrival.multipliers();
    for &k in &found.degenerate {
        let j = meeting[k];
        let before = mode.entries()[j];
        let position = at.arrival.sliding.binary_search(&j);
        let lambda = position.ok().and_then(|at| multipliers.get(at));
        let is_at_end = lambda.is_some_and(|l| (l - found.signs[k]).abs() <= AT_SIDE);
        found.modes[k] = match before {
            0 if is_at_end => {
                if found.signs[k] < 0.0 {
                    -1
                } else {
                    1
                }
            }
            other => other,
        };
    }
}

/// The relay problem at the current point, or a moment later.
fn solve_relay_at(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    meeting: &[usize],
    later: bool,
) -> Result<Option<RelaySolution>, FieldError> {
    let (mut t, mut x) = (at.t, at.x.to_vec());
    if later {
        let mut velocity = vec![0.0; x.len()];
        let mut field = at.arrival.field.borrow_mut();
        field.eval(t, &mut x, &mut velocity)?;
        let dt = at.moment(notes, &mode.signs(), &velocity)?;
        (t, x) = (t + dt, at.moved(t, &x).along(&velocity, dt));
    }
    let (found, evaluations) = relay_at(at.system, (t, &x), mode, meeting, at.patience)?;
    notes.n_field_evaluations += evaluations;
    Ok(found)
}
