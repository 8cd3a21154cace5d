//! Contact: which bodies stay, which leave, and what slides beside them.

use super::choice::choose;
use super::point::{Decided, Left, Lefts, Next, Notes, Point, Values};
use super::trial::{largest_speed, try_mode, Trial};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{first_nonzero, Leading};
use crate::motion::{ModeField, SmoothField};
use crate::status::Stop;
use crate::system::{dot, surfaces_that_matter};
use crate::tolerances::{AT_SIDE, MOST_MEETING, ROUNDING, VANISHING_GERM};

/// An event while bodies are in contact, that triggers no action: a body leaves, or a surface of another kind
/// is reached or left. `surfaces` vanish at the event.
pub(super) fn decide_in_contact(
    at: &Point,
    notes: &mut Notes,
    surfaces: &[usize],
) -> Result<Decided, FieldError> {
    let before = at.arrival.mode;
    // What rested beside the motion takes part again: it was held by what ends.
    let held = before
        .sliding_set()
        .chain(at.arrival.resting.iter().copied());
    let (contacts, mut meeting): (Vec<usize>, Vec<usize>) =
        held.partition(|&j| at.triggers().is_only_trigger(j));
    let mut mode = before.clone();
    for &j in surfaces {
        if at.triggers().is_only_trigger(j) {
            mode.set(j, -before.entries()[j]);
        } else {
            meeting.push(j);
        }
    }
    meeting.sort_unstable();
    meeting.dedup();
    place_in_contact(at, notes, mode, &contacts, &meeting)
}

/// Adds the surfaces on which bodies are that come to rest at contacts: what is left of their speeds, below the tolerance, is taken
/// away there.
pub(super) fn add_reached_at_rest(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    contacts: &[usize],
    mut meeting: Vec<usize>,
) -> Result<Vec<usize>, FieldError> {
    let closed = contacts
        .iter()
        .fold(mode.clone(), |mode, &j| mode.with(j, 0));
    let mut field = at.field_of(&closed, None);
    let mut x = at.x.to_vec();
    field.project(at.t, &mut x)?;
    if x == at.x {
        return Ok(meeting);
    }
    let signs = mode.signs();
    let mut h = vec![0.0; signs.len()];
    at.system.surfaces(&at.place_at(at.t, &x, &signs), &mut h)?;
    notes.n_surface_evaluations += 1;
    for (j, h) in h.iter().enumerate() {
        let is_other = at.system.switches_at(j)
            && !at.triggers().is_only_trigger(j)
            && !at.triggers().is_internal(j)
            && !meeting.contains(&j);
        let size = at.system.surface_size(j, &at.place_at(at.t, &x, &signs))?;
        if is_other && h.abs() <= ROUNDING * size {
            meeting.push(j);
        }
    }
    meeting.sort_unstable();
    Ok(surfaces_that_matter(at.system, mode, meeting))
}

/// The mode where bodies touch without velocity (`contacts`) and other surfaces vanish (`meeting`): that with the
/// most bodies in contact and surfaces slid on, all of whose guards begin positive, if no other one is asked for. If there is
/// none, one in which a guard stays zero; bodies without a force between them are free, and what a contact holds on a surface
/// has the side to which it goes when that opens.
pub(super) fn place_in_contact(
    at: &Point,
    notes: &mut Notes,
    mode: Mode,
    contacts: &[usize],
    meeting: &[usize],
) -> Result<Decided, FieldError> {
    let all: Vec<usize> = contacts.iter().chain(meeting).copied().collect();
    if all.len() > MOST_MEETING {
        return Ok(Err(Stop::Contact { surfaces: all }));
    }
    let mut modes = vec![mode];
    for &j in &all {
        let entries = match contacts.contains(&j) {
            true => vec![0, at.triggers().side(j, None)],
            false => vec![0, 1, -1],
        };
        let extended = |mode: &Mode| entries.iter().map(|&e| mode.with(j, e)).collect::<Vec<_>>();
        modes = modes.iter().flat_map(extended).collect();
    }
    let most = modes.iter().map(Mode::codimension).max().unwrap_or(0);
    let of = |held: usize| modes.iter().filter(move |mode| mode.codimension() == held);
    let (mut viable, mut shared, mut neutral) = (Vec::<Next>::new(), None, Vec::new());
    for tried in (0..=most).rev().flat_map(of).cloned() {
        if at.patience.is_over() {
            return Ok(Err(Stop::Interrupted));
        }
        // What sticks slips beyond its static limit only.
        let slips = |next: &Next| {
            let mut held = next.mode.sliding_set();
            held.any(|j| tried.entries()[j] != 0 && at.system.sticks_at(j))
        };
        if viable.iter().any(slips) {
            continue;
        }
        let (trial, shares_load) = begin(at, notes, &tried, contacts, meeting)?;
        match trial {
            Trial::Leaves(left) if shares_load => {
                shared.get_or_insert(Next::new(tried, left));
            }
            Trial::Leaves(left) => viable.push(Next::new(tried, left)),
            Trial::WithinRounding => neutral.push(tried),
            Trial::Ends => {}
        }
    }
    if let [first, others @ ..] = &viable[..] {
        let mut chosen = first.mode.clone();
        if !others.is_empty() {
            let modes = viable.iter().map(|next| next.mode.clone()).collect();
            chosen = match choose(at, notes, &all, chosen, modes) {
                Ok(chosen) => chosen,
                Err(stop) => return Ok(Err(stop)),
            };
        }
        let found = viable.into_iter().find(|next| next.mode == chosen);
        return Ok(found.ok_or(Stop::Contact { surfaces: all }));
    }
    let n_closed = |mode: &Mode| contacts.iter().filter(|&&j| mode.entries()[j] == 0).count();
    if let Some(shared) = shared {
        // What is held by friction alone needs no contact, and what contacts hold alone no friction.
        let is_as = |mode: &Mode, j: &usize| mode.entries()[*j] == shared.mode.entries()[*j];
        let slides = |mode: &Mode| meeting.iter().any(|&j| mode.entries()[j] == 0);
        neutral.retain(|mode| {
            meeting.iter().all(|j| is_as(mode, j))
                || contacts.iter().all(|j| is_as(mode, j)) && !slides(mode)
        });
        if neutral.is_empty() {
            return Ok(Ok(shared));
        }
    }
    let mut best: Option<((usize, usize), Mode)> = None;
    for mode in neutral {
        let cost = (n_closed(&mode), n_led_back(at, &mode, meeting)?);
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, mode));
        }
    }
    let Some((_, mode)) = best else {
        return Ok(Err(Stop::Contact { surfaces: all }));
    };
    let left = all.into_iter().filter(|&j| mode.entries()[j] != 0);
    let left: Lefts = left.map(Left::stays).collect();
    Ok(Ok(Next::new(mode, left)))
}

/// How many surfaces beside which a mode moves would be crossed at once if one of its contacts opened.
fn n_led_back(at: &Point, mode: &Mode, meeting: &[usize]) -> Result<usize, FieldError> {
    let ModeField::Contact(field) = at.field_of(mode, None) else {
        return Ok(0);
    };
    let (mut row, signs, mut count) = (vec![0.0; at.x.len()], mode.signs(), 0);
    for &k in meeting.iter().filter(|&&k| mode.entries()[k] != 0) {
        at.system
            .gradient(k, &at.place_at(at.t, at.x, &signs), &mut row)?;
        let rates = field.rates_when_opened(at.t, at.x, &row)?;
        let side = f64::from(mode.entries()[k]);
        count += rates.iter().filter(|rate| *rate * side < 0.0).count();
    }
    Ok(count)
}

/// Do all guards of a mode begin positive? Forces, multipliers and the first derivatives of the functions that leave zero
/// tell where they are clear of rounding, else a trial. And do its contacts share their load?
fn begin(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    contacts: &[usize],
    meeting: &[usize],
) -> Result<(Trial, bool), FieldError> {
    let (mut x, mut velocity) = (at.x.to_vec(), vec![0.0; at.x.len()]);
    let mut field = at.field_of(mode, None);
    field.eval(at.t, &mut x, &mut velocity)?;
    notes.n_field_evaluations += field.n_evaluations();
    // What has just been located as zero is not known better than that, unless other surfaces have another side now.
    let located = at.arrival.functions();
    let (before, after) = (at.arrival.mode.entries(), mode.entries());
    let is_located = |j| {
        located.iter().any(|guard| guard.surface_held() == Some(j))
            && meeting.iter().all(|&k| k == j || before[k] == after[k])
    };
    // A surface that is reached tangentially is located to the square root of rounding.
    let rounding = match located {
        [] => VANISHING_GERM,
        _ => AT_SIDE,
    };
    // The values at both ends of a multiplier add up to the size that they are measured by.
    let pairs = field.last_exits().chunks(2);
    let sizes: Values = pairs
        .map(|pair| pair.iter().map(|v| v.abs()).sum())
        .collect();
    let mut is_clear = true;
    for (i, (guard, exit)) in field.guards().iter().zip(field.last_exits()).enumerate() {
        if guard.surface_held().is_some_and(is_located) {
            is_clear = false;
            continue;
        }
        let noise = match field {
            ModeField::Contact(_) => field.noise_of_exit(i) * rounding / VANISHING_GERM,
            _ => rounding * sizes[i / 2],
        };
        if exit.is_nan() || *exit < -noise {
            return Ok((Trial::Ends, false));
        }
        is_clear &= *exit > noise;
    }
    let repels = matches!(&field, ModeField::Contact(field) if !field.attracts());
    if repels || velocity.iter().any(|v| !v.is_finite()) {
        return Ok((Trial::Ends, false));
    }
    let shares_load = matches!(&field, ModeField::Contact(field) if field.shares_load());
    let (mut left, mut row, signs) = (Lefts::new(), vec![0.0; x.len()], mode.signs());
    let speed = largest_speed(at, notes, mode, meeting, &velocity)?;
    for &j in contacts.iter().chain(meeting) {
        let entry = mode.entries()[j];
        if entry == 0 {
            continue;
        }
        let (order, of_time) = match contacts.contains(&j) {
            true => (
                2,
                at.system
                    .rate_gradient(j, &at.place_at(at.t, &x, &signs), &mut row)?
                    .time,
            ),
            false => (
                1,
                at.system
                    .gradient(j, &at.place_at(at.t, &x, &signs), &mut row)?,
            ),
        };
        let value = of_time + dot(&row, &velocity);
        let size = of_time.abs() + dot(&row, &row).sqrt() * speed;
        let mut leading = Leading { order, value };
        let is_tangent = value.abs() <= rounding * size;
        let has_series = is_tangent && mode.codimension() == 0;
        if has_series {
            leading = first_nonzero(at.system, j, entry, order, &at.place_at(at.t, &x, &signs))?;
        }
        if leading.order == 0 || (is_tangent || is_located(j)) && !has_series {
            is_clear = false;
        } else if leading.sign() != entry {
            return Ok((Trial::Ends, false));
        }
        left.push(Left::beside(j, leading));
    }
    if is_clear {
        return Ok((Trial::Leaves(left), shares_load));
    }
    let all: Vec<usize> = contacts.iter().chain(meeting).copied().collect();
    let next = Next::new(mode.clone(), Lefts::new());
    let trial = try_mode(at, notes, &next, &all, rounding)?;
    Ok((trial, shares_load))
}
