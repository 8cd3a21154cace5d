//! Does the motion go through a surface that triggers actions?

use super::placement::{can_stay, is_slow, leading_along};
use super::point::{Notes, Point, Values};
use smallvec::smallvec;

use crate::error::FieldError;
use crate::field::{ModeField, SmoothField};
use crate::mode::Mode;
use crate::switching::Leading;
use crate::system::{dot, surfaces_that_matter};
use crate::tolerances::DEPARTS_TANGENTIALLY;

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
    let leading = match rate_of_sliding(at, j, on_surface)? {
        Some(value) => Leading { order: 1, value },
        None => {
            let others = (0..on_surface.len()).filter(|&k| {
                k != j
                    && on_surface[k]
                    && !at.triggers().is_internal(k)
                    && !at.triggers().is_only_trigger(k)
            });
            let others: Vec<usize> = others.collect();
            let meeting = surfaces_that_matter(at.system, &mode, others);
            leading_along(at, notes, j, &mode, &meeting, None)?
        }
    };
    if leading.sign() != -side {
        return Ok(false);
    }
    let is_still = leading.order != 1 || is_slow(at, j, leading.value, &mode)?;
    Ok(!is_still || !can_stay(at, j, &mode)?)
}

/// The rate of h_j where the motion slides on, at a point on its surfaces; `None` if it does not, or h_j is tangent.
fn rate_of_sliding(at: &Point, j: usize, on_surface: &[bool]) -> Result<Option<f64>, FieldError> {
    let sliding = at.arrival.sliding;
    let may_slide = sliding.iter().all(|&k| k != j && on_surface[k]);
    if sliding.is_empty()
        || !may_slide
        || matches!(&**at.arrival.field.borrow(), ModeField::Contact(_))
    {
        return Ok(None);
    }
    let rate = rates_here(at)?[j];
    let field = at.arrival.field.borrow();
    let is_admissible = field.last_exits().iter().all(|&exit| exit > 0.0);
    let mut gradient = vec![0.0; at.x.len()];
    let signs = &at.arrival.signs;
    let ht = at.system.gradient(j, at.t, at.x, signs, &mut gradient)?;
    let size = ht.abs() + dot(&gradient, &gradient).sqrt();
    let is_clear = rate.abs() > DEPARTS_TANGENTIALLY * size;
    Ok((is_admissible && is_clear).then_some(rate))
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
