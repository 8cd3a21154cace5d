//! How a motion leaves the surfaces that meet at its start.

use super::point::{Left, Lefts, Notes, Point, Values};
use smallvec::smallvec;

use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{first_nonzero, Leading};
use crate::tolerances::{AT_SIDE, MOST_MEETING};

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
    let signs = after.signs();
    let velocity = at.velocity(notes, after, multipliers)?;
    // At the exit of a multiplier all forces may balance, and nothing of the motion itself tells how large they are.
    let mut around: Vec<usize> = leaving.iter().copied().chain(after.sliding_set()).collect();
    around.sort_unstable();
    let sizes = component_sizes(at, notes, after, &around)?;
    for j in leaving {
        let (value, size) = at.rate_of(j, &signs, &velocity)?;
        let place = around.binary_search(&j).unwrap_or(0);
        let leading = if value.abs() > AT_SIDE * size.max(sizes[place]) {
            Leading { order: 1, value }
        } else if after.codimension() == 0 {
            let side = after.entries()[j];
            first_nonzero(at.system, j, side, 1, &at.place(&signs))?
        } else {
            // The normal component vanishes at the exit of a multiplier: its rate along the new motion.
            let dt = at.moment(notes, &signs, &velocity)?;
            let x = at.along(&velocity, dt);
            let later = at.moved(at.t + dt, &x);
            let velocity = later.velocity(notes, after, multipliers)?;
            let (then, _) = later.rate_of(j, &signs, &velocity)?;
            let (order, value) = (2, (then - value) / dt);
            Leading { order, value }
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
        notes.n_field_evaluations += parts.evaluate(affine, &at.place(&mode.signs()))?;
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
