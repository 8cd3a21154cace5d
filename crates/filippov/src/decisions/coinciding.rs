//! Coincident surfaces (same zero set): one of them decides, and the others follow it.
//!
//! A kink, as of `abs` or `maximum`, is a surface on whose sign the field does not depend while the point is on it. Where it is
//! in the place of another surface, as `x` beside `x + x*abs(x)` or both arguments of a maximum that vanish together, it has no
//! multiplier: the other one decides, and the kink goes with it.

use super::point::{Left, Lefts, Next, Notes, Point};
use crate::error::FieldError;
use crate::field::Projector;
use crate::mode::Mode;
use crate::switching::{first_nonzero, Leading};
use crate::system::{dot, PiecewiseSystem};
use crate::tolerances::{BESIDE, COINCIDE, MOST_MEETING, TANGENT};

/// A kink that coincides with another surface.
pub(super) struct Kink {
    pub surface: usize,
    /// The surface that decides.
    pub beside: usize,
}

/// The kinks of `meeting` that coincide with another surface of it.
pub(super) fn coinciding_kinks(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    meeting: &[usize],
) -> Result<Vec<Kink>, FieldError> {
    let mut kinks: Vec<Kink> = Vec::new();
    if !(2..=MOST_MEETING).contains(&meeting.len()) || !have_parallels(at, meeting, mode)? {
        return Ok(kinks);
    }
    let corners = at.corners(notes, meeting, mode)?;
    let free = (0..meeting.len()).filter(|&place| !corners.depends_on(place));
    let free: Vec<usize> = free.map(|place| meeting[place]).collect();
    for &j in meeting {
        let is_kink = |k: usize| kinks.iter().any(|kink| kink.surface == k);
        if is_kink(j) {
            continue;
        }
        let is_open = |k: usize| {
            let decides = kinks.iter().any(|kink| kink.beside == k);
            k != j && !is_kink(k) && !decides
        };
        let others: Vec<usize> = free.iter().copied().filter(|&k| is_open(k)).collect();
        let found = in_the_place_of(at.system, (at.t, at.x), j, &others, mode)?;
        kinks.extend(found.into_iter().map(|surface| Kink { surface, beside: j }));
    }
    notes.meets_kinks |= !kinks.is_empty();
    Ok(kinks)
}

/// Have two of the surfaces the same normal, or has one none?
pub(super) fn have_parallels(
    at: &Point,
    meeting: &[usize],
    mode: &Mode,
) -> Result<bool, FieldError> {
    let rows = meeting.iter().map(|&j| normal(at, j, mode));
    let rows: Vec<Vec<f64>> = rows.collect::<Result<_, _>>()?;
    let pairs = (0..rows.len()).flat_map(|j| (0..j).map(move |k| (j, k)));
    let mut pairs = pairs.map(|(j, k)| parallel(&rows[j], &rows[k]));
    Ok(pairs.any(|parallel| parallel))
}

/// Have two surfaces the same normal here, without being in one place?
pub(super) fn touch_one_another(
    at: &Point,
    j: usize,
    k: usize,
    mode: &Mode,
) -> Result<bool, FieldError> {
    let [one, other] = [normal(at, j, mode)?, normal(at, k, mode)?];
    let has_none = |normal: &[f64]| normal.iter().all(|v| *v == 0.0);
    let are_parallel = !has_none(&one) && !has_none(&other) && parallel(&one, &other);
    Ok(are_parallel && in_the_place_of(at.system, (at.t, at.x), j, &[k], mode)?.is_empty())
}

/// The active surfaces that coincide with those slid on in a mode: their functions vanish all along the motion.
pub(crate) fn surfaces_in_the_place_of_those_slid_on(
    system: &dyn PiecewiseSystem,
    place: (f64, &[f64]),
    mode: &Mode,
    active: &[bool],
) -> Result<Vec<usize>, FieldError> {
    let mut found = Vec::new();
    for j in mode.sliding_set() {
        let others = (0..active.len()).filter(|&k| active[k] && mode.entries()[k] != 0);
        for k in in_the_place_of(system, place, j, &others.collect::<Vec<_>>(), mode)? {
            if !found.contains(&k) {
                found.push(k);
            }
        }
    }
    Ok(found)
}

/// Those of `others` whose functions vanish where that of surface j does, around the place.
fn in_the_place_of(
    system: &dyn PiecewiseSystem,
    (t, x): (f64, &[f64]),
    j: usize,
    others: &[usize],
    mode: &Mode,
) -> Result<Vec<usize>, FieldError> {
    // Beside the place, so that surfaces that only touch are told apart.
    let later = t + BESIDE * (1.0 + t.abs());
    let shifts = (0..x.len()).map(|i| BESIDE * (1.0 + 1.0 / (2.0 + i as f64)));
    let pairs = x.iter().zip(shifts);
    let mut beside: Vec<f64> = pairs.map(|(x, d)| x + d * (1.0 + x.abs())).collect();
    let signs = mode.signs();
    let mut h = [(); 2].map(|()| vec![0.0; signs.len()]);
    let mut projector = Projector::new(beside.len(), signs.len());
    projector.project(system, j, later, &mut beside, &signs)?;
    system.surfaces(later, &beside, &signs, &mut h[0])?;
    system.surfaces(t, x, &signs, &mut h[1])?;
    let (mut found, mut gradient) = (Vec::new(), vec![0.0; beside.len()]);
    for &k in others {
        let rate = system.gradient(k, later, &beside, &signs, &mut gradient)?;
        let size = rate.abs() + gradient.iter().fold(0.0_f64, |sum, g| sum + g.abs());
        // One with a multiple zero has no gradient there.
        if h[0][k].abs().max(h[1][k].abs()) <= COINCIDE * size {
            found.push(k);
        }
    }
    Ok(found)
}

/// Gives the surfaces that the motion rested on the sides that those in their places have after an event.
pub(super) fn leave_coinciding(
    at: &Point,
    notes: &Notes,
    mut next: Next,
) -> Result<Next, FieldError> {
    if !(at.system.has_nested_signs() || at.arrival.meets_kinks || notes.meets_kinks) {
        return Ok(next);
    }
    let sliding = at.arrival.sliding.iter().copied();
    let leaving: Vec<usize> = sliding.filter(|&j| next.mode.entries()[j] != 0).collect();
    for &k in at.arrival.resting {
        for &j in &leaving {
            let is_known = next.left.iter().any(|left| left.surface() == Some(k));
            if !is_known && parallel(&normal(at, j, &next.mode)?, &normal(at, k, &next.mode)?) {
                leave_together(at, j, k, &mut next.mode, &mut next.left)?;
            }
        }
    }
    Ok(next)
}

/// Surface k is left as surface j is, which is in the same place.
fn leave_together(
    at: &Point,
    j: usize,
    k: usize,
    after: &mut Mode,
    left: &mut Lefts,
) -> Result<(), FieldError> {
    let leading = left.iter().find_map(|left| match left {
        Left::Surface(of, leading) if *of == j => Some(*leading),
        _ => None,
    });
    let Some(Leading { order, value }) = leading else {
        return Ok(());
    };
    let (known, other) = (normal(at, j, after)?, normal(at, k, after)?);
    let ratio = dot(&known, &other) / dot(&known, &known);
    let mut leading = Leading {
        order,
        value: ratio * value,
    };
    if leading.value == 0.0 && after.codimension() == 0 {
        // A multiple zero.
        let (side, signs) = (after.entries()[k], after.signs());
        leading = first_nonzero(at.system, k, side, 1, at.t, at.x, &signs)?;
    }
    if leading.value.is_finite() && leading.value != 0.0 {
        after.set(k, leading.sign());
        left.push(Left::Surface(k, leading));
    }
    Ok(())
}

/// The normal of a surface in time and space: the gradient, then the derivative in time.
pub(super) fn normal(at: &Point, j: usize, mode: &Mode) -> Result<Vec<f64>, FieldError> {
    let (signs, n) = (mode.signs(), at.x.len());
    let mut row = vec![0.0; n + 1];
    row[n] = at.system.gradient(j, at.t, at.x, &signs, &mut row[..n])?;
    Ok(row)
}

/// Are two normals the same, up to their lengths, or is one zero?
fn parallel(one: &[f64], other: &[f64]) -> bool {
    let (product, squares) = (dot(one, other), dot(one, one) * dot(other, other));
    squares - product * product <= TANGENT * squares
}
