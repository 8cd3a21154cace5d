//! Sliding on several surfaces where the jump across one of them vanishes: nothing holds the motion there any more.
//!
//! Seen from the others, which are slid on, it is a two-fold of that surface: the normal components of both sides vanish
//! at once. First-order data say nothing there, and the multiplier is 0/0; both are taken a moment away.

use super::choice::choose;
use super::departures::{departures, velocity_in};
use super::point::{Decided, Left, Lefts, Next, Notes, Point};
use super::rule::Meeting;

use crate::error::FieldError;
use crate::field::{Guard, ModeField, SmoothField};
use crate::mode::Mode;
use crate::switching::{admissible_within, Leading};
use crate::system::dot;
use crate::tolerances::{EQUAL_SHARES, MOST_LISTED, VANISHED};

/// The sliding motion as it was a moment before the jump vanished.
struct Before {
    /// The surface.
    surface: usize,
    /// Its multiplier.
    multiplier: f64,
    velocity: Vec<f64>,
    /// How long a moment is.
    moment: f64,
}

/// A motion that goes on from there.
struct Way {
    mode: Mode,
    multipliers: Vec<f64>,
    /// The rate at which the normal component of the surface grows along it.
    rate: f64,
}

/// Has the jump across one of the surfaces slid on vanished here?
pub(super) fn has_lost_jump(at: &Point, notes: &mut Notes) -> Result<bool, FieldError> {
    Ok(at.arrival.slides_on_several() && before_jump_vanished(at, notes)?.is_some())
}

/// Rule: the root of sliding on all surfaces is lost because the jump across one of them vanishes.
pub(super) fn decide_where_jump_vanishes(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    let (is_exit, mode, meeting) = (meeting.is_exit(), meeting.mode, meeting.surfaces);
    let is_end_of_root = match &**at.arrival.field.borrow() {
        ModeField::Intersection(_) => {
            let mut guards = at.arrival.functions().iter();
            guards.any(|guard| matches!(guard, Guard::Root(_)))
        }
        _ => false,
    };
    if !is_exit || !is_end_of_root || meeting.len() > MOST_LISTED {
        return Ok(None);
    }
    let Some(before) = before_jump_vanished(at, notes)? else {
        return Ok(None);
    };
    let ways = ways_on(at, notes, mode, meeting, &before)?;
    // It stays on as many surfaces as it can; where it has to leave, to the side whose field had the larger share.
    let side = if before.multiplier < -EQUAL_SHARES {
        -1
    } else {
        1
    };
    let preferred = ways.iter().max_by_key(|way| {
        let is_that_side = way.mode.entries()[before.surface] == side;
        (
            way.mode.codimension() == meeting.len(),
            is_that_side,
            way.mode.codimension(),
        )
    });
    let Some(preferred) = preferred.map(|way| way.mode.clone()) else {
        return Ok(None);
    };
    let modes: Vec<Mode> = ways.iter().map(|way| way.mode.clone()).collect();
    let chosen = match modes.as_slice() {
        [only] => only.clone(),
        _ => match choose(at, notes, &[before.surface], preferred, modes) {
            Ok(chosen) => chosen,
            Err(stop) => return Ok(Some(Err(stop))),
        },
    };
    let Some(way) = ways.into_iter().find(|way| way.mode == chosen) else {
        return Ok(None);
    };
    let others: Vec<usize> = meeting
        .iter()
        .copied()
        .filter(|&j| j != before.surface)
        .collect();
    let mut left: Lefts = departures(at, notes, &way.mode, &others, &way.multipliers)?;
    if way.mode.entries()[before.surface] != 0 {
        let leading = Leading {
            order: 2,
            value: way.rate,
        };
        left.push(Left::Surface(before.surface, leading));
    }
    let mut next = Next::new(way.mode, left);
    next.start_mut().multipliers = way.multipliers;
    Ok(Some(Ok(next)))
}

/// The motion a moment before, if here all normal components of one surface vanish compared with it.
fn before_jump_vanished(at: &Point, notes: &mut Notes) -> Result<Option<Before>, FieldError> {
    let (mode, meeting) = (at.arrival.mode.clone(), at.arrival.sliding.to_vec());
    let here = at.corners(notes, &meeting, &mode)?;
    // Here the multipliers may be lost in rounding, and with them the velocity: a moment before they are not.
    let mut velocity = at.arrival.velocity.to_vec();
    let moment = at.moment(notes, &mode.signs(), &velocity)?;
    let mut past = at.x.to_vec();
    for _ in 0..2 {
        let pairs = past.iter_mut().zip(at.x.iter().zip(&velocity));
        pairs.for_each(|(past, (x, v))| *past = x - moment * v);
        let mut field = at.arrival.field.borrow_mut();
        field.eval(at.t - moment, &mut past, &mut velocity)?;
    }
    let multipliers = at.arrival.multipliers();
    if multipliers.len() != meeting.len() || velocity.iter().any(|v| !v.is_finite()) {
        return Ok(None);
    }
    let earlier = at.moved(at.t - moment, &past);
    let earlier = earlier.corners(notes, &meeting, &mode)?;
    let (Ok(here), Ok(earlier)) = (here.normal_fields(), earlier.normal_fields()) else {
        return Ok(None);
    };
    let vanishes = |row: usize| {
        let sticks = at.system.sticks_at(meeting[row]);
        !sticks && here.row_size(row) <= VANISHED * earlier.row_size(row)
    };
    let found = (0..meeting.len()).find(|&row| vanishes(row));
    Ok(found.map(|row| Before {
        surface: meeting[row],
        multiplier: multipliers[row],
        velocity,
        moment,
    }))
}

/// The motions that a moment later lead on, each along its own velocity.
fn ways_on(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    meeting: &[usize],
    before: &Before,
) -> Result<Vec<Way>, FieldError> {
    let pairs = at.x.iter().zip(&before.velocity);
    let ahead: Vec<f64> = pairs.map(|(x, v)| x + before.moment * v).collect();
    let later = at.moved(at.t + before.moment, &ahead);
    let later = later.corners(notes, meeting, mode)?;
    let Ok(fields) = later.normal_fields() else {
        return Ok(Vec::new());
    };
    let mut ways = Vec::new();
    for found in admissible_within(&fields, at.patience) {
        let Some(entries) = found.continuation.as_mode() else {
            continue;
        };
        let mut mode = mode.clone();
        for (&j, &entry) in meeting.iter().zip(entries.entries()) {
            mode.set(j, entry);
        }
        let rate = rate_along(at, notes, &mode, &found.multipliers, before)?;
        let side = f64::from(mode.entries()[before.surface]);
        if side == 0.0 || side * rate > 0.0 {
            ways.push(Way {
                mode,
                multipliers: found.multipliers,
                rate,
            });
        }
    }
    Ok(ways)
}

/// The rate at which the normal component of the surface grows along the motion in `mode`.
fn rate_along(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    multipliers: &[f64],
    before: &Before,
) -> Result<f64, FieldError> {
    let (x, signs, t) = (at.x.to_vec(), mode.signs(), at.t + before.moment);
    let mut velocity = vec![0.0; x.len()];
    velocity_in(at, notes, mode, multipliers, at.t, &x, &mut velocity)?;
    let pairs = x.iter().zip(&velocity);
    let ahead: Vec<f64> = pairs.map(|(x, v)| x + before.moment * v).collect();
    velocity_in(at, notes, mode, multipliers, t, &ahead, &mut velocity)?;
    let mut gradient = vec![0.0; x.len()];
    let time = at
        .system
        .gradient(before.surface, t, &ahead, &signs, &mut gradient)?;
    Ok((time + dot(&gradient, &velocity)) / before.moment)
}
