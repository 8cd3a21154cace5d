//! The field beside surfaces: just inside of a region where it does not exist on their common points.

use smallvec::SmallVec;

use super::{PiecewiseSystem, Place};
use crate::error::FieldError;
use crate::tolerances::{EPS, OFFSET_ROUNDING, SIDE_OFFSET, SIDE_REACH, STEPS_INSIDE};

/// Moves a point that lies on surfaces up to rounding into the region of `signs`: off every surface
/// that is nearer than the distance `offset`, or up to `reach` on the wrong side.
///
/// # Errors
/// If a function of the user raises.
pub fn move_inside<S: PiecewiseSystem + ?Sized>(
    system: &S,
    place: &Place<'_>,
    offset: f64,
    reach: f64,
) -> Result<Vec<f64>, FieldError> {
    let &Place { t, x, signs, .. } = place;
    let mut moved = x.to_vec();
    let mut h = vec![0.0; system.n_surfaces()];
    let mut gradient = vec![0.0; x.len()];
    let mut is_moved: SmallVec<[bool; 8]> = SmallVec::from_elem(false, h.len());
    for _ in 0..STEPS_INSIDE {
        let mut is_there = true;
        system.surfaces(&place.moved(t, &moved), &mut h)?;
        for (j, h) in h.iter().enumerate() {
            system.gradient(j, &place.moved(t, &moved), &mut gradient)?;
            let norm2: f64 = gradient.iter().map(|g| g * g).sum();
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
                moved
                    .iter_mut()
                    .zip(&gradient)
                    .for_each(|(x, g)| *x += shift * g);
                is_moved[j] = true;
                is_there = false;
            }
        }
        if is_there {
            break;
        }
    }
    Ok(moved)
}

/// The offsets to try, from a few units of rounding of the state upwards.
pub fn side_offsets(x: &[f64]) -> impl Iterator<Item = f64> {
    let size = x.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
    (0..6).map(move |k| SIDE_OFFSET * EPS * size * 16_f64.powi(k))
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
    system.field(place, dx)?;
    if dx.iter().all(|v| v.is_finite()) {
        return Ok(1);
    }
    Ok(1 + eval_off_surface(system, place, dx)?)
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
    let mut evaluations = 0;
    for offset in side_offsets(place.x) {
        let inside = move_inside(system, place, offset, SIDE_REACH * offset)?;
        system.field(&place.moved(place.t, &inside), dx)?;
        evaluations += 1;
        if dx.iter().all(|v| v.is_finite()) {
            break;
        }
    }
    Ok(evaluations)
}
