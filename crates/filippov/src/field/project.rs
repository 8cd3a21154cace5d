//! Projection onto a surface.

use crate::error::FieldError;
use crate::system::PiecewiseSystem;
use crate::tolerances::SURFACE_NOISE;

/// Moves `x` onto h_j(t, x) = 0 along the gradient: x <- x - h grad h / |grad h|^2, repeated until
/// |h| is at the level of rounding, at most four times. Writes the gradient of the last point and
/// returns the partial derivative in t.
///
/// # Errors
/// If a function of the user raises.
pub fn project(
    system: &dyn PiecewiseSystem,
    j: usize,
    t: f64,
    x: &mut [f64],
    signs: &[f64],
    h: &mut [f64],
    gradient: &mut [f64],
) -> Result<f64, FieldError> {
    let mut ht = 0.0;
    for _ in 0..4 {
        system.surfaces(t, x, signs, h)?;
        ht = system.gradient(j, t, x, signs, gradient)?;
        let norm2: f64 = gradient.iter().map(|g| g * g).sum();
        let size: f64 = gradient.iter().zip(&*x).map(|(g, x)| (g * x).abs()).sum();
        if norm2 == 0.0 || h[j].abs() <= 0.25 * SURFACE_NOISE * size || !h[j].is_finite() || h[j] == 0.0 {
            break;
        }
        let shift = h[j] / norm2;
        x.iter_mut().zip(&*gradient).for_each(|(x, g)| *x -= shift * g);
    }
    Ok(ht)
}
