//! Sliding between fields in which other functions have different signs.

use crate::error::FieldError;
use crate::mode::Mode;
use crate::status::Stop;
use crate::system::PiecewiseSystem;
use crate::tolerances::{BETWEEN_SIDES, MOST_MEETING};

/// Surfaces that have another sign on some side of what is slid on than in the mode: the motion would slide between fields
/// that differ in several signs at once. Those for which `is_checked` is false are not looked at.
pub(crate) fn differs_between_sides(
    system: &dyn PiecewiseSystem,
    (t, x): (f64, &[f64]),
    mode: &Mode,
    sliding: &[usize],
    is_checked: impl Fn(usize) -> bool,
) -> Result<Option<Stop>, FieldError> {
    if !(1..=MOST_MEETING).contains(&sliding.len()) {
        return Ok(None);
    }
    let mut h = vec![0.0; mode.entries().len()];
    for pattern in 0..1_usize << sliding.len() {
        let side = mode.on_sides(sliding, pattern);
        let signs = side.signs();
        system.surfaces(t, x, &signs, &mut h)?;
        for k in (0..h.len()).filter(|k| !sliding.contains(k) && is_checked(*k)) {
            let beyond = -h[k] * f64::from(side.entries()[k]);
            let size = system.surface_size(k, t, x, &signs)?;
            if beyond > BETWEEN_SIDES * (1.0 + size) {
                return Ok(Some(Stop::SlidesAcrossJump {
                    surfaces: sliding.to_vec(),
                    jumping: vec![k],
                }));
            }
        }
    }
    Ok(None)
}
