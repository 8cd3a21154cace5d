//! Some surfaces have functions that are zero all along a motion: neither field leaves such a surface, or it lies in the place
//! of the one that the motion slides on. This file finds them and warns of them.

use super::point::{Left, Notes, Point};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{first_nonzero, SlidingSet};
use crate::status::{Warning, WarningCode};
use crate::tolerances::LEFT_RESTING;

/// The surfaces that a motion in `mode` does not leave. Warns of those that the field beyond would not leave either.
pub(crate) fn zero_surfaces(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    left: &[Left],
) -> Result<SlidingSet, FieldError> {
    let zero = left.iter().filter(|left| left.leading.order == 0);
    let zero: SlidingSet = zero.filter_map(Left::surface).collect();
    for &j in &zero {
        let beyond = -mode.entries()[j];
        let leading = first_nonzero(at.system, j, beyond, 0, &at.place(&mode.signs()))?;
        if leading.order == 0 {
            warn_zero_surface(at, notes, j, mode);
        }
    }
    Ok(zero)
}

/// Warns of a surface whose function is zero all along the motion in `mode`.
///
/// It is no mistake where nothing depends on the sign: where bodies touch without any force, and at a kink, where the
/// values of both signs agree, as those of `max(h, 0)` and `abs(h)` do where h = 0.
pub(crate) fn warn_zero_surface(at: &Point, notes: &mut Notes, j: usize, mode: &Mode) {
    let sliding: SlidingSet = mode.sliding_set().collect();
    if at.triggers().is_only_trigger(j) || !at.system.jumps_across(j, &mode.signs(), &sliding) {
        return;
    }
    let name = at.system.surface_name(j);
    notes.warnings.push(Warning {
        t: at.t,
        code: WarningCode::ZeroSurface,
        surfaces: vec![j],
        text: format!(
            "{name} is zero all along the motion from here: its sign means nothing, and that of the mode is taken"
        ),
        candidates: Vec::new(),
        rule: "",
    });
}

/// Has the motion left a surface that it was to stay on, by more than the tolerance?
pub(crate) fn has_left_zero_surface(at: &Point, notes: &mut Notes) -> Result<bool, FieldError> {
    let signs = at.arrival.signs;
    let h = at.surface_values(notes, signs)?;
    for &j in at.arrival.resting {
        let tolerance = at.system.tolerance(j, &at.place(signs), at.scale)?;
        // Bodies that touch have to be held apart at once.
        let factor = match at.triggers().is_only_trigger(j) {
            true => 1.0,
            false => LEFT_RESTING,
        };
        if h[j].abs() > factor * tolerance {
            return Ok(true);
        }
    }
    Ok(false)
}
