//! Motion in a region whose field is at rest.

use super::point::{Left, Lefts, Next, Point};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::switching::first_nonzero;

/// The motion in a region whose field is at rest where the surfaces of `meeting` vanish.
pub(super) fn rest_in(at: &Point, region: Mode, meeting: &[usize]) -> Result<Next, FieldError> {
    let (mut left, signs) = (Lefts::new(), region.signs());
    for &j in meeting {
        let side = region.entries()[j];
        let leading = first_nonzero(at.system, j, side, 0, at.t, at.x, &signs)?;
        left.push(Left::Surface(j, leading));
    }
    Ok(Next::new(region, left))
}
