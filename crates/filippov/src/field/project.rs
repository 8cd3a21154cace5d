//! Projection onto a surface.

use crate::error::FieldError;
use crate::system::PiecewiseSystem;
use crate::tolerances::SURFACE_NOISE;

/// Scratch space of the projection.
#[derive(Clone, Debug)]
pub struct Projector {
    h: Vec<f64>,
    gradient: Vec<f64>,
}

impl Projector {
    /// Space for a system with n states and d surfaces.
    pub fn new(n: usize, d: usize) -> Self {
        Projector {
            h: vec![0.0; d],
            gradient: vec![0.0; n],
        }
    }

    /// Moves `x` onto h_j(t, x) = 0 along the gradient: x <- x - h grad h / |grad h|^2, repeated
    /// until |h| is at the level of rounding, at most four times; once if h is affine.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn project(
        &mut self,
        system: &dyn PiecewiseSystem,
        j: usize,
        t: f64,
        x: &mut [f64],
        signs: &[f64],
    ) -> Result<(), FieldError> {
        let most = if system.is_affine(j) { 1 } else { 4 };
        for _ in 0..most {
            system.surfaces(t, x, signs, &mut self.h)?;
            let h = self.h[j];
            if h == 0.0 || !h.is_finite() {
                break;
            }
            system.gradient(j, t, x, signs, &mut self.gradient)?;
            let norm2: f64 = self.gradient.iter().map(|g| g * g).sum();
            let size: f64 = self
                .gradient
                .iter()
                .zip(&*x)
                .map(|(g, x)| (g * x).abs())
                .sum();
            if norm2 == 0.0 || h.abs() <= 0.25 * SURFACE_NOISE * size {
                break;
            }
            let shift = h / norm2;
            x.iter_mut()
                .zip(&self.gradient)
                .for_each(|(x, g)| *x -= shift * g);
        }
        Ok(())
    }
}
