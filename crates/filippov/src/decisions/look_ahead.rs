//! Try the modes for a moment if derivatives at the point do not decide.
//!
//! So it is where two surfaces touch one another: seen from the point they are one, and a moment later they are two, in an
//! order that decides.

use super::departures::velocity_in;
use super::point::{Left, Lefts, Notes, Point};
use crate::error::FieldError;
use crate::field::ModeField;
use crate::field::SmoothField;
use crate::mode::Mode;
use crate::switching::Leading;
use crate::tolerances::{LONGER_TRIAL, MAX_LIE_ORDER, MOST_LENGTHENINGS, SURFACE_NOISE};

/// Follows a motion in this mode for a moment, and longer until it is clear of rounding.
pub(super) fn try_mode(
    at: &Point,
    notes: &mut Notes,
    candidate: &Mode,
    meeting: &[usize],
) -> Result<Trial, FieldError> {
    let entries = candidate.entries();
    let leaving: Vec<usize> = meeting
        .iter()
        .copied()
        .filter(|&j| entries[j] != 0)
        .collect();
    let mut velocity = vec![0.0; at.x.len()];
    velocity_in(at, notes, candidate, &[], at.t, at.x, &mut velocity)?;
    if velocity.iter().any(|v| !v.is_finite()) {
        return Ok(Trial::WithinRounding);
    }
    let mut moment = at.moment(notes, &candidate.signs(), &velocity)?;
    for _ in 0..=MOST_LENGTHENINGS {
        match leaves_within(at, notes, candidate, &leaving, moment)? {
            Trial::WithinRounding => moment *= LONGER_TRIAL,
            trial => return Ok(trial),
        }
    }
    Ok(Trial::WithinRounding)
}

/// What becomes of a motion within a short time.
pub(super) enum Trial {
    /// It leaves surfaces to the sides of its mode.
    Leaves(Lefts),
    /// It leaves one to the other side, or its multipliers go beyond their ends.
    Ends,
    /// Some function is not clear of rounding, or the mode has no field.
    WithinRounding,
}

fn leaves_within(
    at: &Point,
    notes: &mut Notes,
    candidate: &Mode,
    leaving: &[usize],
    moment: f64,
) -> Result<Trial, FieldError> {
    let mut values = [1.0, 0.5].map(|_| vec![0.0; leaving.len()]);
    for (share, values) in [1.0, 0.5].into_iter().zip(&mut values) {
        let Some(h) = surfaces_after(at, notes, candidate, share * moment)? else {
            return Ok(Trial::Ends);
        };
        for (&j, value) in leaving.iter().zip(values) {
            let (h, size) = h[j];
            if h.abs() <= SURFACE_NOISE * size {
                return Ok(Trial::WithinRounding);
            }
            if h * f64::from(candidate.entries()[j]) < 0.0 {
                return Ok(Trial::Ends);
            }
            *value = h;
        }
    }
    let [full, half] = values;
    let pairs = leaving.iter().zip(full.iter().zip(half));
    let left = pairs.map(|(&j, (full, half))| {
        let order = (full / half).log2().round();
        let order = order.clamp(1.0, MAX_LIE_ORDER as f64) as usize;
        let factorial: f64 = (1..=order).map(|k| k as f64).product();
        let value = factorial * full / moment.powi(order as i32);
        Left::Surface(j, Leading { order, value })
    });
    Ok(Trial::Leaves(left.collect()))
}

/// The switching functions, and their sizes, after some time of motion in a mode; `None` if its multipliers are beyond
/// their ends.
fn surfaces_after(
    at: &Point,
    notes: &mut Notes,
    candidate: &Mode,
    time: f64,
) -> Result<Option<Vec<(f64, f64)>>, FieldError> {
    let (signs, law) = (candidate.signs(), at.policy.law);
    let mut field = ModeField::of(at.system, law, candidate);
    let mut x = at.x.to_vec();
    let mut velocity = vec![0.0; x.len()];
    // The midpoint rule.
    for share in [0.5, 1.0] {
        let mut from = x.clone();
        let t = at.t + (share - 0.5) * time;
        field.eval(t, &mut from, &mut velocity)?;
        let pairs = x.iter_mut().zip(at.x.iter().zip(&velocity));
        pairs.for_each(|(x, (start, v))| *x = start + share * time * v);
        field.project(at.t + share * time, &mut x)?;
    }
    let exits = field.exits(at.t + time, &mut x)?;
    notes.n_field_evaluations += field.n_evaluations();
    if exits.iter().any(|exit| exit.is_nan() || *exit <= 0.0) {
        return Ok(None);
    }
    let mut h = vec![0.0; signs.len()];
    let t = at.t + time;
    at.system.surfaces(t, &x, &signs, &mut h)?;
    let sized = h.into_iter().enumerate().map(|(j, h)| {
        let size = at.system.surface_size(j, t, &x, &signs)?;
        Ok((h, size))
    });
    sized.collect::<Result<Vec<_>, FieldError>>().map(Some)
}
