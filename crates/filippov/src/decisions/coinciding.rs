//! Coincident surfaces (same zero set): one of them decides, and the others follow it.
//!
//! A kink, as of `abs` or `maximum`, is a surface on whose sign the field does not depend while the point is on it. Where it is
//! in the place of another surface, as `x` beside `x + x*abs(x)` or both arguments of a maximum that vanish together, it has no
//! multiplier: the other one decides, and the kink goes with it.

use super::point::{Left, Lefts, Next, Notes, Point};
use crate::error::FieldError;
use crate::field::{beside_on, in_the_place_of, normal, parallel};
use crate::mode::Mode;
use crate::switching::{first_nonzero, Leading};
use crate::system::{dot, PiecewiseSystem};
use crate::tolerances::{MOST_MEETING, ONE_DIRECTION, SURFACE_NOISE};

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
        let found = in_the_place_of(at.system, (at.t, at.x), j, &others, &mode.signs())?;
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
    let signs = mode.signs();
    let rows = meeting
        .iter()
        .map(|&j| normal(at.system, (at.t, at.x), j, &signs));
    let rows: Vec<Vec<f64>> = rows.collect::<Result<_, _>>()?;
    let pairs = (0..rows.len()).flat_map(|j| (0..j).map(move |k| (j, k)));
    let mut pairs = pairs.map(|(j, k)| parallel(&rows[j], &rows[k]));
    Ok(pairs.any(|parallel| parallel))
}

/// Two surfaces, counted within a meeting, that touch one another: they have the same normal here, and are not in one place.
pub(super) struct Touch {
    pub pair: [usize; 2],
    /// Have they the same normal to rounding? If not, the point is beside the one where they touch.
    pub is_exact: bool,
}

/// The surfaces of a meeting that touch one another.
pub(super) fn touching(
    at: &Point,
    meeting: &[usize],
    mode: &Mode,
) -> Result<Vec<Touch>, FieldError> {
    let (place, signs, mut found) = ((at.t, at.x), mode.signs(), Vec::new());
    let rows = meeting.iter().map(|&j| normal(at.system, place, j, &signs));
    let rows: Vec<Vec<f64>> = rows.collect::<Result<_, _>>()?;
    for (i, k) in (0..rows.len()).flat_map(|k| (0..k).map(move |i| (i, k))) {
        let (one, other) = (&rows[i], &rows[k]);
        // One that is zero has no direction.
        let product = dot(one, other);
        let (j, others) = (meeting[i], [meeting[k]]);
        if product != 0.0
            && parallel(one, other)
            && in_the_place_of(at.system, place, j, &others, &signs)?.is_empty()
        {
            let ratio = product / dot(one, one);
            let mut pairs = other.iter().zip(one);
            let noise = SURFACE_NOISE * dot(other, other).sqrt();
            let is_exact = pairs.all(|(b, a)| (b - ratio * a).abs() <= noise);
            found.push(Touch {
                pair: [i, k],
                is_exact,
            });
        }
    }
    Ok(found)
}

/// The normal of what two surfaces that touch have in common beside the first of them: if their functions differ by a power
/// of another one, its normal. `None` if that depends on where one looks.
pub(super) fn parting(
    at: &Point,
    [j, k]: [usize; 2],
    mode: &Mode,
) -> Result<Option<Vec<f64>>, FieldError> {
    let signs = mode.signs();
    let [one, other] = [j, k].map(|j| normal(at.system, (at.t, at.x), j, &signs));
    let (one, other) = (one?, other?);
    let square = dot(&one, &one);
    let ratio = dot(&one, &other) / square;
    let mut found: Vec<Vec<f64>> = Vec::new();
    for side in [-1.0, 1.0] {
        let (t, x) = beside_on(at.system, (at.t, at.x), j, &signs, side)?;
        let (near, far) = (
            normal(at.system, (t, &x), j, &signs)?,
            normal(at.system, (t, &x), k, &signs)?,
        );
        let pairs = far.iter().zip(&near);
        let mut row: Vec<f64> = pairs.map(|(far, near)| far - ratio * near).collect();
        // Along the surfaces.
        let along = dot(&row, &one) / square;
        row.iter_mut()
            .zip(&one)
            .for_each(|(row, one)| *row -= along * one);
        let size = dot(&row, &row).sqrt();
        row.iter_mut().for_each(|v| *v /= size);
        found.push(row);
    }
    let product = dot(&found[0], &found[1]);
    Ok((product.abs() >= 1.0 - ONE_DIRECTION).then(|| found.swap_remove(1)))
}

/// The active surfaces that coincide with those slid on in a mode: their functions vanish all along the motion.
pub(crate) fn surfaces_in_the_place_of_those_slid_on(
    system: &dyn PiecewiseSystem,
    place: (f64, &[f64]),
    mode: &Mode,
    active: &[bool],
) -> Result<Vec<usize>, FieldError> {
    let (mut found, signs) = (Vec::new(), mode.signs());
    for j in mode.sliding_set() {
        let others = (0..active.len()).filter(|&k| active[k] && mode.entries()[k] != 0);
        for k in in_the_place_of(system, place, j, &others.collect::<Vec<_>>(), &signs)? {
            if !found.contains(&k) {
                found.push(k);
            }
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
            if !is_known
                && parallel(
                    &normal_at(at, j, &next.mode)?,
                    &normal_at(at, k, &next.mode)?,
                )
            {
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
    let (known, other) = (normal_at(at, j, after)?, normal_at(at, k, after)?);
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

fn normal_at(at: &Point, j: usize, mode: &Mode) -> Result<Vec<f64>, FieldError> {
    normal(at.system, (at.t, at.x), j, &mode.signs())
}
