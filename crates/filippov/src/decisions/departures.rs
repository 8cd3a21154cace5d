//! How a motion leaves the surfaces that meet at its start.

use super::point::{Left, Lefts, Notes, Point, Values};
use smallvec::smallvec;

use crate::error::FieldError;
use crate::field::{IntersectionField, SlidingField, SmoothField};
use crate::mode::Mode;
use crate::switching::{first_nonzero, Leading};
use crate::system::{dot, dot_magnitude};
use crate::tolerances::{DEPARTS_TANGENTIALLY, MOST_MEETING};

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
    // At the exit of a multiplier all forces may balance, and nothing of the motion itself tells how large they are.
    let mut around: Vec<usize> = leaving.iter().copied().chain(after.sliding_set()).collect();
    around.sort_unstable();
    let sizes = component_sizes(at, notes, after, &around)?;
    for j in leaving {
        let ht = at.system.gradient(j, at.t, at.x, &signs, &mut gradient)?;
        let value = ht + dot(&gradient, &velocity);
        let size = ht.abs() + dot_magnitude(&gradient, &velocity);
        let place = around.binary_search(&j).unwrap_or(0);
        let leading = if value.abs() > DEPARTS_TANGENTIALLY * size.max(sizes[place]) {
            Leading { order: 1, value }
        } else if after.codimension() == 0 {
            let side = after.entries()[j];
            first_nonzero(at.system, j, side, 1, at.t, at.x, &signs)?
        } else {
            // The normal component vanishes at the exit of a multiplier: its rate along the new motion.
            let value = acceleration_of(at, notes, after, multipliers, j, &velocity)?;
            Leading { order: 2, value }
        };
        left.push(Left::beside(j, leading));
    }
    Ok(left)
}

/// The largest component normal to each of these surfaces among the fields around them, or a bound of it where the field is
/// affine in their signs; 0 where the fields are too many to be looked at, or not finite.
fn component_sizes(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    surfaces: &[usize],
) -> Result<Values, FieldError> {
    let affine = at.system.affine_signs();
    let parts = affine.and_then(|affine| Some((affine, affine.affine_parts(surfaces)?)));
    if let Some((affine, mut parts)) = parts {
        notes.n_field_evaluations += parts.evaluate(affine, at.t, at.x, &mode.signs())?;
        let spread = |row| parts.normal().row(row).map(|(_, n)| n.abs()).sum::<f64>();
        let rows = parts.nu().into_iter().enumerate();
        return Ok(rows.map(|(row, nu)| nu.abs() + spread(row)).collect());
    }
    let groups = at.system.sign_groups(surfaces);
    if groups.iter().any(|group| group.len() > MOST_MEETING) {
        return Ok(smallvec![0.0; surfaces.len()]);
    }
    let fields = at.corners(notes, surfaces, mode)?.normal_fields();
    let size = |i| fields.as_ref().map_or(0.0, |fields| fields.row_size(i));
    Ok((0..surfaces.len()).map(size).collect())
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
