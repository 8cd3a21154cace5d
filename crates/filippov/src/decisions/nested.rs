//! Switching functions that contain signs of others: they may jump where those change.
//!
//! On the far side of a surface h_j = 0 the signs of such functions are others than on the near side, and with them the
//! field. If that field leads away from the surface, it is crossed. If it leads back, the motion would slide between two
//! fields that differ in several signs at once; the run ends there, and names the surfaces. A surface that only bends there,
//! as that of abs or maximum does, is slid on beyond if its field and its normal there allow it.

use super::choice::choose;
use super::departures::departures;
use super::point::{Decided, Left, Lefts, Next, Notes, Point};
use super::rule::{How, Meeting, Rule};
use super::settle::place_on;
use crate::error::FieldError;
use crate::field::eval_on_side;
use crate::mode::Mode;
use crate::status::Stop;
use crate::switching::{decide_intersection, first_nonzero, normal_component, Undecided};
use crate::system::{dot, dot_magnitude};
use crate::tolerances::{AT_SIDE, EPS, MOST_MEETING, SURFACE_NOISE, TANGENT};

/// Rule: surfaces are reached where others jump, or bend.
pub(super) fn decide_where_others_jump(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    if matches!(meeting.how, How::Start(_)) || !at.system.has_nested_signs() {
        return Ok(None);
    }
    let mode = meeting.mode;
    let (fresh, jumping) = split_those_that_jump(at, notes, mode, meeting.fresh)?;
    let fresh = &fresh[..];
    let mut beyond = mode.clone();
    fresh
        .iter()
        .for_each(|&j| beyond.set(j, -mode.entries()[j]));
    let (mut jumped, landed) = let_others_jump(at, notes, mode, &mut beyond, (fresh, fresh))?;
    jumped.extend(jumping);
    if jumped.is_empty() {
        if let Some(next) = leaves_at_bends(at, notes, mode, fresh)? {
            return Ok(Some(Ok(next)));
        }
        if bends_what_is_slid_on(at, mode, &beyond)? {
            return Ok(leave_to(at, notes, &beyond, fresh, &landed)?.map(Ok));
        }
        let mut surfaces = [fresh, at.arrival.sliding].concat();
        surfaces.sort_unstable();
        return Ok(leaves_along_bends(at, notes, mode, &surfaces)?.map(Ok));
    }
    if fresh.len() == 1 {
        if let Some(next) = leave_to(at, notes, &beyond, fresh, &landed)? {
            return Ok(Some(Ok(next)));
        }
    }
    Ok(Some(Err(between(fresh, &jumped))))
}

/// Splits off those of the surfaces reached at once that are not zero beyond another of them: as `x - c*sign(x - c)` at
/// x = c, they jump before they can be crossed.
fn split_those_that_jump(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    fresh: &[usize],
) -> Result<(Vec<usize>, Vec<usize>), FieldError> {
    let (mut kept, mut jumping) = (fresh.to_vec(), Vec::new());
    if fresh.len() < 2 {
        return Ok((kept, jumping));
    }
    let old = at.surface_values(notes, &mode.signs())?;
    let residual = residual(&old, fresh);
    for &j in fresh {
        let signs = mode.with(j, -mode.entries()[j]).signs();
        let h = at.surface_values(notes, &signs)?;
        for &k in fresh.iter().filter(|&&k| k != j) {
            let size = at.system.surface_size(k, at.t, at.x, &signs)?;
            let is_zero = h[k].abs() <= SURFACE_NOISE * (size + h[k].abs()) + residual;
            if !is_zero && kept.contains(&j) && !jumping.contains(&k) {
                jumping.push(k);
                kept.retain(|kept| *kept != k);
            }
        }
    }
    Ok((kept, jumping))
}

/// The start on the surfaces `meeting` that was decided with the signs of `mode`; others may jump with it.
pub(super) fn follow_jumps(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    meeting: &[usize],
    (rule, decided): (Rule, Decided),
) -> Result<(Rule, Decided), FieldError> {
    let Ok(next) = &decided else {
        return Ok((rule, decided));
    };
    if meeting.is_empty() || !at.system.has_nested_signs() {
        return Ok((rule, decided));
    }
    let mut beyond = next.mode.clone();
    let (jumped, landed) = let_others_jump(at, notes, mode, &mut beyond, (meeting, meeting))?;
    if jumped.is_empty() {
        return compare_with_opposite(at, notes, mode, meeting, (rule, decided));
    }
    if let [j] = meeting {
        let mut opposite = mode.with(*j, -next.mode.entries()[*j]);
        let (_, on_opposite) = let_others_jump(at, notes, mode, &mut opposite, (meeting, meeting))?;
        let mut found = Vec::new();
        for (mode, landed) in [(beyond, landed), (opposite, on_opposite)] {
            if mode.entries()[*j] != 0 {
                found.extend(leave_to(at, notes, &mode, meeting, &landed)?);
            }
        }
        let modes: Vec<Mode> = found.iter().map(|next| next.mode.clone()).collect();
        let chosen = match modes.as_slice() {
            [] => None,
            [only] => Some(only.clone()),
            [preferred, ..] => match choose(at, notes, meeting, preferred.clone(), modes.clone()) {
                Ok(chosen) => Some(chosen),
                Err(stop) => return Ok((Rule::OthersJump, Err(stop))),
            },
        };
        let mut found = found.into_iter();
        if let Some(next) = found.find(|next| Some(&next.mode) == chosen.as_ref()) {
            return Ok((Rule::OthersJump, Ok(next)));
        }
    }
    Ok((Rule::OthersJump, Err(between(meeting, &jumped))))
}

/// A start on one surface that the motion leaves: if others jump on its other side, it may lead away there too.
fn compare_with_opposite(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    meeting: &[usize],
    (rule, decided): (Rule, Decided),
) -> Result<(Rule, Decided), FieldError> {
    let (Ok(next), &[j]) = (&decided, meeting) else {
        return Ok((rule, decided));
    };
    let side = next.mode.entries()[j];
    let mut opposite = mode.with(j, -side);
    let (jumped, landed) = let_others_jump(at, notes, mode, &mut opposite, (meeting, meeting))?;
    if side == 0 || jumped.is_empty() {
        return Ok((rule, decided));
    }
    let Some(other) = leave_to(at, notes, &opposite, meeting, &landed)? else {
        return Ok((rule, decided));
    };
    let modes = vec![next.mode.clone(), other.mode.clone()];
    Ok(match choose(at, notes, meeting, next.mode.clone(), modes) {
        Ok(chosen) if chosen == other.mode => (Rule::OthersJump, Ok(other)),
        Ok(_) => (rule, decided),
        Err(stop) => (Rule::OthersJump, Err(stop)),
    })
}

/// The motion that leaves the surfaces `reached` to their sides in `mode`, if its field leads there. What it slides on
/// besides, and what jumped to zero, is decided anew.
fn leave_to(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    reached: &[usize],
    landed: &[usize],
) -> Result<Option<Next>, FieldError> {
    let mut sliding: Vec<usize> = mode.sliding_set().chain(landed.iter().copied()).collect();
    sliding.sort_unstable();
    sliding.dedup();
    let mut after = mode.clone();
    if !sliding.is_empty() {
        match place_on(at, notes, mode, &sliding, Some(mode))? {
            (_, Ok(placed)) => after = placed.mode,
            (_, Err(_)) => return Ok(None),
        }
    }
    let leaving: Vec<usize> = sliding.iter().chain(reached).copied().collect();
    let left = departures(at, notes, &after, &leaving, &[])?;
    let leads_away = |l: &Left| match l {
        // A surface that jumped to zero, and along which the motion goes.
        Left::Surface(k, leading) if leading.order == 0 => !reached.contains(k),
        Left::Surface(k, leading) => leading.sign() == after.entries()[*k],
        Left::Exit(..) => true,
    };
    Ok(left.iter().all(leads_away).then(|| Next::new(after, left)))
}

/// Has a surface that is slid on another normal in the second mode?
fn bends_what_is_slid_on(at: &Point, mode: &Mode, beyond: &Mode) -> Result<bool, FieldError> {
    let (mut near, mut far) = (vec![0.0; at.x.len()], vec![0.0; at.x.len()]);
    for &j in at.arrival.sliding {
        let (t, x) = (at.t, at.x);
        at.system.gradient(j, t, x, &mode.signs(), &mut near)?;
        at.system.gradient(j, t, x, &beyond.signs(), &mut far)?;
        if near != far {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Rule: a start where surfaces bend at one another, and one motion leads away from all of them into a region.
pub(super) fn leave_at_bends(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    if !matches!(meeting.how, How::Start(_)) {
        return Ok(None);
    }
    Ok(leaves_at_bends(at, notes, meeting.mode, meeting.surfaces)?.map(Ok))
}

/// Rule: such a start from which one motion leads away into a region or along one surface.
pub(super) fn leave_along_bends(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    if !matches!(meeting.how, How::Start(_)) {
        return Ok(None);
    }
    Ok(leaves_along_bends(at, notes, meeting.mode, meeting.surfaces)?.map(Ok))
}

/// Where several surfaces are reached and one of them bends at another: the motion in a region that leads away from all
/// of them, if it is the only one. A surface along which the motion goes keeps its side.
fn leaves_at_bends(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    meeting: &[usize],
) -> Result<Option<Next>, FieldError> {
    let m = meeting.len();
    let is_small = (2..=MOST_MEETING).contains(&m) && at.arrival.sliding.is_empty();
    if !is_small || !at.system.has_nested_signs() || !bends(at, mode, meeting)? {
        return Ok(None);
    }
    let mut found = None;
    for pattern in 0..1_usize << m {
        if at.patience.is_over() {
            return Ok(None);
        }
        let region = mode.on_sides(meeting, pattern);
        let mut settled = region.clone();
        let (jumped, _) = let_others_jump(at, notes, mode, &mut settled, (&[], meeting))?;
        if !jumped.is_empty() {
            continue;
        }
        let Some(left) = leaves_into(at, mode, &region, meeting)? else {
            continue;
        };
        if found.replace(Next::new(region, left)).is_some() {
            return Ok(None);
        }
    }
    Ok(found)
}

/// Where three and more surfaces whose normals lie in one plane meet, some of which bend at others: the motion in a region or
/// along one surface that leads away, if it is the only one and nothing stays, as one of the functions rises along all
/// fields, or falls. Multipliers of several surfaces are not looked for: normals and regions are others on every side.
fn leaves_along_bends(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    meeting: &[usize],
) -> Result<Option<Next>, FieldError> {
    let m = meeting.len();
    let is_small = (3..=MOST_MEETING).contains(&m);
    if !is_small || !at.system.has_nested_signs() || !bends(at, mode, meeting)? {
        return Ok(None);
    }
    let n = at.x.len();
    let (mut field, mut normals) = (vec![0.0; n], Vec::with_capacity(m << m));
    let (mut rises, mut falls) = (vec![true; m], vec![true; m]);
    for pattern in 0..1_usize << m {
        if at.patience.is_over() {
            return Ok(None);
        }
        let region = mode.on_sides(meeting, pattern);
        let (signs, t, x) = (region.signs(), at.t, at.x);
        notes.n_field_evaluations += eval_on_side(at.system, t, x, &signs, &mut field)?;
        for (bit, &j) in meeting.iter().enumerate() {
            let mut normal = vec![0.0; n + 1];
            normal[n] = at.system.gradient(j, t, x, &signs, &mut normal[..n])?;
            let rate = normal[n] + dot(&normal[..n], &field);
            let size = normal[n].abs() + dot_magnitude(&normal[..n], &field);
            rises[bit] &= rate > TANGENT * size;
            falls[bit] &= rate < -TANGENT * size;
            normals.push(normal);
        }
    }
    let stays = !rises.iter().chain(&falls).any(|&one_way| one_way);
    if stays || !are_in_one_plane(normals) {
        return Ok(None);
    }
    let decision = decide_intersection(at.system, meeting, mode, false, (at.t, at.x), at.patience)?;
    let ([only], [left]) = (&decision.candidates[..], &decision.left[..]) else {
        return Ok(None);
    };
    let left = left.iter().map(|&(j, l)| Left::Surface(j, l)).collect();
    Ok(Some(Next::new(only.clone(), left)))
}

/// The decision where surfaces meet, unless it is to slide on one of them where the fields do not hold the motion: at a
/// bend normals are others on every side, which its equations know nothing of.
pub(super) fn reject_if_not_attracting(
    at: &Point,
    decided: Decided,
    meeting: &[usize],
) -> Result<Decided, FieldError> {
    let known = decided.as_ref().ok();
    let slides = known.filter(|next| next.mode.codimension() == 1);
    let Some(Next { mode: after, .. }) = slides.filter(|_| at.system.has_nested_signs()) else {
        return Ok(decided);
    };
    let signs = after.signs();
    let Some(j) = after.sliding_set().find(|&j| !at.system.sticks_at(j)) else {
        return Ok(decided);
    };
    let along = |side| normal_component(at.system, j, j, side, at.t, at.x, &signs);
    let (minus, plus) = (along(-1)?, along(1)?);
    let error = AT_SIDE * (minus.magnitude + plus.magnitude);
    if minus.value >= -error && plus.value <= error {
        return Ok(decided);
    }
    Ok(Err(Stop::Intersection {
        surfaces: meeting.to_vec(),
        candidates: Vec::new(),
        reason: Undecided::NoOutcome,
    }))
}

/// What vanishes at the start of a motion in `region` that leads away from all surfaces of `meeting`, if it does.
fn leaves_into(
    at: &Point,
    mode: &Mode,
    region: &Mode,
    meeting: &[usize],
) -> Result<Option<Lefts>, FieldError> {
    let (mut left, signs) = (Lefts::new(), region.signs());
    for &j in meeting {
        let side = region.entries()[j];
        let leading = first_nonzero(at.system, j, side, 0, at.t, at.x, &signs)?;
        let stays = leading.order == 0 && side == mode.entries()[j];
        if leading.sign() != side && !stays {
            return Ok(None);
        }
        left.push(Left::Surface(j, leading));
    }
    let is_left = |left: &Left| matches!(left, Left::Surface(_, leading) if leading.order > 0);
    Ok(left.iter().any(is_left).then_some(left))
}

/// Has one of the surfaces another normal on the other side of one of them, or none at all?
pub(super) fn bends(at: &Point, mode: &Mode, meeting: &[usize]) -> Result<bool, FieldError> {
    let n = at.x.len();
    let (mut near, mut far) = (vec![0.0; n], vec![0.0; n]);
    for &k in meeting {
        let beyond = mode.with(k, -mode.entries()[k]).signs();
        for &j in meeting.iter().filter(|&&j| j != k) {
            let (t, x) = (at.t, at.x);
            let rate = at.system.gradient(j, t, x, &mode.signs(), &mut near)?;
            let other = at.system.gradient(j, t, x, &beyond, &mut far)?;
            let is_flat = rate == 0.0 && near.iter().all(|&g| g == 0.0);
            if is_flat || near != far || rate != other {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// Gives all surfaces that jump between two modes the side that they are on afterwards; returns which, and those
/// of them that jump to zero, which keep their side. Those of `fixed` are not looked at; the point lies on those
/// of `reached`, up to what their values are.
fn let_others_jump(
    at: &Point,
    notes: &mut Notes,
    before: &Mode,
    after: &mut Mode,
    (fixed, reached): (&[usize], &[usize]),
) -> Result<(Vec<usize>, Vec<usize>), FieldError> {
    let old = at.surface_values(notes, &before.signs())?;
    let residual = residual(&old, reached);
    let (mut jumped, mut landed) = (Vec::new(), Vec::new());
    // A jump may make others jump.
    for _ in 0..old.len() {
        let signs = after.signs();
        let new = at.surface_values(notes, &signs)?;
        let mut is_final = true;
        landed.clear();
        for j in (0..new.len()).filter(|j| !fixed.contains(j)) {
            let size = at.system.surface_size(j, at.t, at.x, &signs)?;
            let noise = SURFACE_NOISE * (size + old[j].abs() + new[j].abs()) + residual;
            if (new[j] - old[j]).abs() <= noise {
                continue;
            }
            let side = if new[j] < 0.0 { -1 } else { 1 };
            if new[j].abs() <= noise {
                landed.push(j);
            } else if after.entries()[j] != side {
                after.set(j, side);
                jumped.push(j);
                is_final = false;
            }
        }
        if is_final {
            break;
        }
    }
    jumped.extend(&landed);
    Ok((jumped, landed))
}

/// Do vectors lie in one plane, up to rounding?
fn are_in_one_plane(mut vectors: Vec<Vec<f64>>) -> bool {
    let sizes: Vec<f64> = vectors.iter().map(|v| dot(v, v)).collect();
    for _ in 0..2 {
        // The longest one spans, and goes out of all.
        let longest = vectors
            .iter()
            .max_by(|a, b| dot(a, a).total_cmp(&dot(b, b)));
        let Some(axis) = longest.cloned() else {
            return true;
        };
        let square = dot(&axis, &axis);
        if square == 0.0 {
            return true;
        }
        for vector in &mut vectors {
            let share = dot(vector, &axis) / square;
            vector
                .iter_mut()
                .zip(&axis)
                .for_each(|(v, a)| *v -= share * a);
        }
    }
    let rests = vectors.iter().map(|v| dot(v, v)).zip(sizes);
    rests.into_iter().all(|(rest, size)| rest <= TANGENT * size)
}

/// How far functions may be from zero at a point that lies on the surfaces `reached` to this: their values, and some
/// times as much for other slopes.
fn residual(h: &[f64], reached: &[usize]) -> f64 {
    SURFACE_NOISE / EPS * reached.iter().fold(0.0, |most, &j| h[j].abs().max(most))
}

/// The motion would slide between the sides of these surfaces while others jump.
pub(super) fn between(meeting: &[usize], jumped: &[usize]) -> Stop {
    let mut jumping: Vec<usize> = jumped.to_vec();
    jumping.sort_unstable();
    jumping.dedup();
    Stop::SlidesAcrossJump {
        surfaces: meeting.to_vec(),
        jumping,
    }
}
