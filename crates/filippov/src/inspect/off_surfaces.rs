//! The field at a point that lies on no surface, and switching functions that are rounding at a point.

use crate::error::FieldError;
use crate::system::{PiecewiseSystem, Setting};
use crate::tolerances::{DOUBTFUL, ON_SURFACE, ROUNDING};
use crate::vectors::largest;

/// A point that lies on no surface.
#[derive(Clone, Debug, PartialEq)]
pub struct OffSurfaces {
    /// The signs of the surfaces that a user sees.
    pub signs: Vec<f64>,
    /// The field there.
    pub field: Vec<f64>,
}

/// The signs of surfaces at a point, and their functions with these signs.
struct Sides {
    signs: Vec<f64>,
    values: Vec<f64>,
}

/// The signs of the first `n_seen` surfaces at (t, x), and the field there; `None` on a surface, and where the field depends
/// on the sign of a function that is not a number.
///
/// `complete` adds the signs of the surfaces behind the first `n_seen`.
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
    let Some(Sides { signs, values: h }) = signs_at(system, n_seen, &complete, q, (t, x))? else {
        return Ok(None);
    };
    let tiny = ON_SURFACE * (1.0 + largest(x));
    if h.iter().any(|h| h.abs() <= tiny) {
        return Ok(None);
    }
    let here = field_with(&signs)?;
    for j in (0..n_seen).filter(|&j| h[j].is_nan()) {
        let mut other = signs.clone();
        other[j] = -other[j];
        let beyond = field_with(&other)?;
        let agree = |(a, b): (&f64, &f64)| a == b || (a.is_nan() && b.is_nan());
        if !here.iter().zip(&beyond).all(agree) {
            return Ok(None);
        }
    }
    Ok(Some(OffSurfaces { signs, field: here }))
}

/// The first `n_seen` switching functions that are nothing but rounding at (t, x). Affine ones are not looked at. `complete` is
/// as in [`field_off_surfaces`].
///
/// # Errors
/// That of a function of the user.
pub fn surfaces_of_rounding(
    system: &dyn PiecewiseSystem,
    n_seen: usize,
    complete: impl Fn(&[f64]) -> Result<Vec<f64>, FieldError>,
    q: &[f64],
    (t, x): (f64, &[f64]),
) -> Result<Vec<usize>, FieldError> {
    let mut found = Vec::new();
    if (0..n_seen).all(|j| system.is_affine(j)) {
        return Ok(found);
    }
    let Some(Sides { signs, values: h }) = signs_at(system, n_seen, &complete, q, (t, x))? else {
        return Ok(found);
    };
    let all = complete(&signs)?;
    let place = Setting::new(&all, q).at(t, x);
    for (j, &value) in h.iter().enumerate() {
        // To bound the rounding takes longer than to see that most values are far from it.
        if !system.is_affine(j) && value.abs() <= DOUBTFUL * (1.0 + largest(x)) {
            let noise = ROUNDING * system.surface_size(j, &place)?;
            found.extend((value.abs() <= noise).then_some(j));
        }
    }
    Ok(found)
}

/// The sides of the first `n_seen` surfaces that (t, x) is on; `None` if no signs fit the functions that contain them.
///
/// Surfaces may contain the signs of others, so that the signs are found by iteration.
fn signs_at(
    system: &dyn PiecewiseSystem,
    n_seen: usize,
    complete: impl Fn(&[f64]) -> Result<Vec<f64>, FieldError>,
    q: &[f64],
    (t, x): (f64, &[f64]),
) -> Result<Option<Sides>, FieldError> {
    let mut signs = vec![1.0; n_seen];
    let mut h = vec![0.0; system.n_surfaces()];
    for _ in 0..=n_seen {
        system.surfaces(&Setting::new(&complete(&signs)?, q).at(t, x), &mut h)?;
        let seen = &h[..n_seen];
        // NaN beyond the domain of an inactive surface: either sign will do.
        let fit = |(h, sign): (&f64, &f64)| h * sign >= 0.0 || h.is_nan();
        if seen.iter().zip(&signs).all(fit) {
            h.truncate(n_seen);
            return Ok(Some(Sides { signs, values: h }));
        }
        signs = seen
            .iter()
            .map(|&h| if h < 0.0 { -1.0 } else { 1.0 })
            .collect();
    }
    Ok(None)
}
