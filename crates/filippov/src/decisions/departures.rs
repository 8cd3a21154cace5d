//! How a motion leaves the surfaces that meet at its start.

use super::point::{Left, Lefts, Notes, Point};
use smallvec::smallvec;

use crate::error::FieldError;
use crate::field::{IntersectionField, SlidingField, SmoothField};
use crate::mode::Mode;
use crate::switching::{first_nonzero, Leading};
use crate::system::{dot, dot_magnitude};
use crate::tolerances::DEPARTS_TANGENTIALLY;

/// The surfaces of `meeting` that the motion in `after` leaves, with the leading derivatives of h.
pub(crate) fn departures(
    at: &Point,
    notes: &mut Notes,
    after: &Mode,
    meeting: &[usize],
    multipliers: &[f64],
) -> Result<Lefts, FieldError> {
    let mut left: Lefts = smallvec![];
    let leaving: Vec<usize> = meeting
        .iter()
        .copied()
        .filter(|&j| after.entries()[j] != 0)
        .collect();
    if leaving.is_empty() {
        return Ok(left);
    }
    let (n, signs) = (at.x.len(), after.signs());
    let mut velocity = vec![0.0; n];
    velocity_in(at, notes, after, multipliers, at.t, at.x, &mut velocity)?;
    let mut gradient = vec![0.0; n];
    for j in leaving {
        let ht = at.system.gradient(j, at.t, at.x, &signs, &mut gradient)?;
        let value = ht + dot(&gradient, &velocity);
        let size = ht.abs() + dot_magnitude(&gradient, &velocity);
        let leading = if value.abs() > DEPARTS_TANGENTIALLY * size
            && departs_clearly(at, notes, after, multipliers, j, value)?
        {
            Leading { order: 1, value }
        } else if after.codimension() == 0 {
            let side = after.entries()[j];
            first_nonzero(at.system, j, side, 1, at.t, at.x, &signs)?
        } else {
            // The normal component vanishes at the exit of a multiplier: its rate along the new motion.
            let value = acceleration_of(at, notes, after, multipliers, j, &velocity)?;
            Leading { order: 2, value }
        };
        left.push(Left::Surface(j, leading));
    }
    Ok(left)
}

/// Is a normal component clear of rounding, compared with that beyond the surface? At the exit of a multiplier
/// all forces may balance, and nothing of the motion itself tells how large they are.
fn departs_clearly(
    at: &Point,
    notes: &mut Notes,
    after: &Mode,
    multipliers: &[f64],
    j: usize,
    value: f64,
) -> Result<bool, FieldError> {
    let beyond = after.with(j, -after.entries()[j]);
    let (x, mut velocity) = (at.x.to_vec(), vec![0.0; at.x.len()]);
    velocity_in(at, notes, &beyond, multipliers, at.t, &x, &mut velocity)?;
    let mut gradient = vec![0.0; x.len()];
    let signs = beyond.signs();
    let ht = at.system.gradient(j, at.t, &x, &signs, &mut gradient)?;
    let other = ht + dot(&gradient, &velocity);
    let is_rounding = value.abs() <= DEPARTS_TANGENTIALLY * other.abs();
    Ok(!is_rounding)
}

/// The rate of dh_j/dt along the motion in `after`, which has this velocity.
fn acceleration_of(
    at: &Point,
    notes: &mut Notes,
    after: &Mode,
    multipliers: &[f64],
    j: usize,
    velocity: &[f64],
) -> Result<f64, FieldError> {
    let (n, signs) = (at.x.len(), after.signs());
    let mut gradient = vec![0.0; n];
    let ht = at.system.gradient(j, at.t, at.x, &signs, &mut gradient)?;
    let now = ht + dot(&gradient, velocity);
    let dt = at.moment(notes, &signs, velocity)?;
    let pairs = at.x.iter().zip(velocity);
    let ahead: Vec<f64> = pairs.map(|(x, v)| x + dt * v).collect();
    let mut next = vec![0.0; n];
    velocity_in(at, notes, after, multipliers, at.t + dt, &ahead, &mut next)?;
    let ht = at
        .system
        .gradient(j, at.t + dt, &ahead, &signs, &mut gradient)?;
    Ok((ht + dot(&gradient, &next) - now) / dt)
}

/// The field of a mode at a point near the current one.
pub(super) fn velocity_in(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    multipliers: &[f64],
    t: f64,
    x: &[f64],
    velocity: &mut [f64],
) -> Result<(), FieldError> {
    let (signs, mut x) = (mode.signs(), x.to_vec());
    let set: Vec<usize> = mode.sliding_set().collect();
    notes.n_field_evaluations += match set.as_slice() {
        [] => crate::field::eval_on_side(at.system, t, &x, &signs, velocity)?,
        &[j] => {
            let mut field = SlidingField::new(at.system, j, &signs);
            field.eval(t, &mut x, velocity)?;
            field.n_evaluations()
        }
        _ => {
            let field = IntersectionField::new(at.system, &set, &signs, multipliers);
            let field = field
                .with_rule(at.policy.law.rule)
                .with_patience(at.patience);
            let mut field = field.with_scaling(&at.policy.law.scaling(&set));
            field.eval(t, &mut x, velocity)?;
            field.n_evaluations()
        }
    };
    Ok(())
}
