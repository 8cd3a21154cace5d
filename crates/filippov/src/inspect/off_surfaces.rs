//! The field at a point that lies on no surface.

use crate::error::FieldError;
use crate::system::{PiecewiseSystem, Setting};
use crate::tolerances::ON_SURFACE;
use crate::vectors::largest;

/// A point that lies on no surface.
#[derive(Clone, Debug, PartialEq)]
pub struct OffSurfaces {
    /// The signs of the surfaces that a user sees.
    pub signs: Vec<f64>,
    /// The field there.
    pub field: Vec<f64>,
}

/// The signs of the first `n_seen` surfaces at (t, x), and the field there; `None` on a surface, and where the field depends
/// on the sign of a function that is not a number.
///
/// Surfaces may contain the signs of others, so that the signs are found by iteration. `complete` adds the signs of the
/// surfaces behind the first `n_seen`.
///
/// # Errors
/// That of a function of the user.
pub fn field_off_surfaces(
    system: &dyn PiecewiseSystem,
    n_seen: usize,
    complete: impl Fn(&[f64]) -> Result<Vec<f64>, FieldError>,
    q: &[f64],
    (t, x): (f64, &[f64]),
) -> Result<Option<OffSurfaces>, FieldError> {
    let field_with = |signs: &[f64]| -> Result<Vec<f64>, FieldError> {
        let mut dx = vec![0.0; system.n_states()];
        system.field(&Setting::new(&complete(signs)?, q).at(t, x), &mut dx)?;
        Ok(dx)
    };
    let largest = largest(x);
    let tiny = ON_SURFACE * (1.0 + largest);
    let mut signs = vec![1.0; n_seen];
    let mut h = vec![0.0; system.n_surfaces()];
    for _ in 0..=n_seen {
        system.surfaces(&Setting::new(&complete(&signs)?, q).at(t, x), &mut h)?;
        let seen = &h[..n_seen];
        // NaN beyond the domain of an inactive surface: either sign will do.
        if seen.iter().zip(&signs).any(|(h, sign)| h * sign < 0.0) {
            signs = seen
                .iter()
                .map(|&h| if h < 0.0 { -1.0 } else { 1.0 })
                .collect();
            continue;
        }
        if seen.iter().any(|h| h.abs() <= tiny) {
            return Ok(None);
        }
        let here = field_with(&signs)?;
        for j in (0..n_seen).filter(|&j| seen[j].is_nan()) {
            let mut other = signs.clone();
            other[j] = -other[j];
            let beyond = field_with(&other)?;
            let agree = |(a, b): (&f64, &f64)| a == b || (a.is_nan() && b.is_nan());
            if !here.iter().zip(&beyond).all(agree) {
                return Ok(None);
            }
        }
        return Ok(Some(OffSurfaces { signs, field: here }));
    }
    Ok(None)
}
