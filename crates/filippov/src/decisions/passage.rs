//! Does the motion go through a surface that triggers actions?

use super::placement::{can_stay, is_slow, leading_along};
use super::point::{Notes, Point, Values};
use smallvec::smallvec;

use crate::error::FieldError;
use crate::field::SmoothField;
use crate::mode::Mode;
use crate::system::surfaces_that_matter;

/// Does the motion lead from this side through a surface that the point lies on? A body that is pressed on
/// without velocity does not: it stays.
pub(crate) fn goes_through(
    at: &Point,
    notes: &mut Notes,
    j: usize,
    side: i8,
    mode: &Mode,
    on_surface: &[bool],
) -> Result<bool, FieldError> {
    let mode = mode.with(j, side);
    let others = (0..on_surface.len()).filter(|&k| {
        k != j
            && on_surface[k]
            && !at.triggers().is_internal(k)
            && !at.triggers().is_only_trigger(k)
    });
    let meeting = surfaces_that_matter(at.system, &mode, others.collect());
    let leading = leading_along(at, notes, j, &mode, &meeting, None)?;
    if leading.sign() != -side {
        return Ok(false);
    }
    let is_still = leading.order != 1 || is_slow(at, j, leading.value, &mode)?;
    Ok(!is_still || !can_stay(at, j, &mode)?)
}

/// The rates of all switching functions along the motion that arrives here.
pub(crate) fn rates_here(at: &Point) -> Result<Values, FieldError> {
    let d = at.system.n_surfaces();
    let (mut h, mut rates): (Values, Values) = (smallvec![0.0; d], smallvec![0.0; d]);
    let mut velocity = vec![0.0; at.x.len()];
    let mut x = at.x.to_vec();
    at.arrival
        .field
        .borrow_mut()
        .eval(at.t, &mut x, &mut velocity)?;
    let signs = &at.arrival.signs;
    at.system
        .surface_rates(at.t, at.x, signs, &velocity, &mut h, &mut rates)?;
    Ok(rates)
}
