//! The field beside surfaces: just inside of a region where it does not exist on their common points.

use smallvec::SmallVec;

use super::{PiecewiseSystem, Place};
use crate::error::FieldError;
use crate::error_scale::ErrorScale;
use crate::tolerances::{EPS, OFFSET_ROUNDING, SIDE_OFFSET, SIDE_REACH, STEPS_INSIDE};

/// Moves a point that lies on surfaces up to rounding into the region of `signs`: off every surface
/// that is nearer than the distance `offset`, or up to `reach` on the wrong side. In time, too, where no state leads
/// there: off a surface of time alone, or between surfaces with the same gradient.
///
/// # Errors
/// If a function of the user raises.
pub fn move_inside<S: PiecewiseSystem + ?Sized>(
    system: &S,
    place: &Place<'_>,
    offset: f64,
    reach: f64,
) -> Result<(f64, Vec<f64>), FieldError> {
    let (is_inside, moved) = moved_off(system, place, [offset, reach], 0.0)?;
    if is_inside {
        return Ok((place.t, moved));
    }
    // Time in units in which its rounding is that of the state.
    let unit = place.t.abs().max(1.0) / size_of(place.x);
    let (is_inside, mut in_time) = moved_off(system, place, [offset, reach], unit)?;
    let t = in_time.pop().unwrap_or(place.t);
    Ok(match is_inside {
        true => (t, in_time),
        false => (place.t, moved),
    })
}

/// The state moved off its surfaces, with the time behind it if that moves, in this `unit`; and whether it is in its region.
fn moved_off<S: PiecewiseSystem + ?Sized>(
    system: &S,
    place: &Place<'_>,
    [offset, reach]: [f64; 2],
    unit: f64,
) -> Result<(bool, Vec<f64>), FieldError> {
    let &Place { t, x, signs, .. } = place;
    let n = x.len();
    let mut moved = x.to_vec();
    let mut gradient = vec![0.0; n];
    if unit > 0.0 {
        moved.push(t);
        gradient.push(0.0);
    }
    let mut h = vec![0.0; system.n_surfaces()];
    let mut is_moved: SmallVec<[bool; 8]> = SmallVec::from_elem(false, h.len());
    for _ in 0..STEPS_INSIDE {
        let mut is_there = true;
        let mut can_move = true;
        let at = |moved: &[f64]| moved.get(n).copied().unwrap_or(t);
        system.surfaces(&place.moved(at(&moved), &moved[..n]), &mut h)?;
        for (j, h) in h.iter().enumerate() {
            let here = place.moved(at(&moved), &moved[..n]);
            let rate = unit * system.gradient(j, &here, &mut gradient[..n])?;
            if let Some(entry) = gradient.get_mut(n) {
                *entry = rate;
            }
            let norm2: f64 = gradient.iter().map(|g| g * g).sum();
            // Where a root begins at another surface it has no slope: that one is moved off.
            if !(norm2 + h).is_finite() {
                continue;
            }
            let wanted = offset * norm2.sqrt();
            let missing = wanted - signs[j] * h;
            // A curved surface makes the first step too long or too short; what is left is rounding.
            let is_off = if is_moved[j] {
                missing.abs() > OFFSET_ROUNDING * wanted
            } else {
                missing > 0.0 && h.abs() <= reach * norm2.sqrt()
            };
            if norm2 > 0.0 && is_off {
                let shift = signs[j] * missing / norm2;
                for (i, (x, g)) in moved.iter_mut().zip(&gradient).enumerate() {
                    *x += shift * g * if i == n { unit } else { 1.0 };
                }
                is_moved[j] = true;
                is_there = false;
            }
            can_move &= norm2 > 0.0 || signs[j] * h > 0.0;
        }
        if is_there {
            return Ok((can_move, moved));
        }
    }
    Ok((false, moved))
}

/// The offsets to try, from a few units of rounding of the state upwards.
pub fn side_offsets(x: &[f64]) -> impl Iterator<Item = f64> {
    offsets_from(x, 1.0)
}

/// The same for states in this unit; those of states of size 1 are tried last.
fn offsets_from(x: &[f64], unit: f64) -> impl Iterator<Item = f64> {
    let size = size_of(x);
    let least = x.iter().fold(unit.min(1.0), |m, v| m.max(v.abs()));
    let finer = ((size / least).log2() / 4.0).ceil() as i32;
    (-finer..6).map(move |k| SIDE_OFFSET * EPS * size * 16_f64.powi(k))
}

fn size_of(x: &[f64]) -> f64 {
    x.iter().fold(1.0_f64, |m, v| m.max(v.abs()))
}

/// Evaluates the field of one side at a point that lies on a surface up to rounding.
///
/// If the field is not finite there (a power 3/2 of the distance, a black box that looks at the
/// sign of h itself), the point is moved into the region of `signs`, just far enough. Returns the
/// number of evaluations.
///
/// # Errors
/// If a function of the user raises.
pub fn eval_on_side<S: PiecewiseSystem + ?Sized>(
    system: &S,
    place: &Place<'_>,
    dx: &mut [f64],
) -> Result<u64, FieldError> {
    eval_on_side_in(system, place, 1.0, dx)
}

/// The same for states in this unit: a small state may be so in the units of the user only.
///
/// # Errors
/// If a function of the user raises.
pub fn eval_on_side_in<S: PiecewiseSystem + ?Sized>(
    system: &S,
    place: &Place<'_>,
    unit: f64,
    dx: &mut [f64],
) -> Result<u64, FieldError> {
    system.field(place, dx)?;
    if dx.iter().all(|v| v.is_finite()) {
        return Ok(1);
    }
    Ok(1 + eval_at_offsets(system, place, offsets_from(place.x, unit), dx)?)
}

/// As [`eval_on_side`], for a field known not to exist on its surface: moves the point first.
///
/// # Errors
/// If a function of the user raises.
pub fn eval_off_surface<S: PiecewiseSystem + ?Sized>(
    system: &S,
    place: &Place<'_>,
    dx: &mut [f64],
) -> Result<u64, FieldError> {
    eval_at_offsets(system, place, side_offsets(place.x), dx)
}

fn eval_at_offsets<S: PiecewiseSystem + ?Sized>(
    system: &S,
    place: &Place<'_>,
    offsets: impl Iterator<Item = f64>,
    dx: &mut [f64],
) -> Result<u64, FieldError> {
    let mut evaluations = 0;
    for offset in offsets {
        let (t, inside) = move_inside(system, place, offset, SIDE_REACH * offset)?;
        system.field(&place.moved(t, &inside), dx)?;
        evaluations += 1;
        if dx.iter().all(|v| v.is_finite()) {
            break;
        }
    }
    Ok(evaluations)
}

/// Is the function of surface `j`, with this `value` here, zero up to the tolerance of the state? By its slope, and then by its
/// value at the distance of the tolerance: beside a root the slope of a function far from zero is huge, and where the root
/// begins it is infinite.
///
/// # Errors
/// If a function of the user raises.
pub fn is_zero_within<S: PiecewiseSystem + ?Sized>(
    system: &S,
    place: &Place<'_>,
    (j, value): (usize, f64),
    scale: &ErrorScale,
) -> Result<bool, FieldError> {
    let mut gradient = vec![0.0; place.x.len()];
    system.gradient(j, place, &mut gradient)?;
    let tolerance = scale.along(&gradient, place.x);
    if !tolerance.is_finite() || value.abs() > tolerance {
        return Ok(false);
    }
    let mut x = place.x.to_vec();
    for (i, (x, slope)) in x.iter_mut().zip(&gradient).enumerate() {
        let towards = -value * slope;
        if towards != 0.0 {
            *x += towards.signum() * scale.tolerance(i, *x, *x);
        }
    }
    let mut h = vec![0.0; system.n_surfaces()];
    system.surfaces(&place.moved(place.t, &x), &mut h)?;
    let keeps_sign = value * h[j] > 0.0;
    Ok(!keeps_sign)
}
