//! Projection onto a surface.

use crate::error::FieldError;
use crate::system::PiecewiseSystem;
use crate::tolerances::SURFACE_NOISE;

/// Scratch space of the projection.
#[derive(Clone, Debug, Default)]
pub struct Projector {
    h: Vec<f64>,
    gradient: Vec<f64>,
}

impl Projector {
    /// Moves `x` onto h_j(t, x) = 0 along the gradient: x <- x - h grad h / |grad h|^2, repeated
    /// until |h| is at the level of rounding, at most four times.
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
        self.h.resize(system.n_surfaces(), 0.0);
        self.gradient.resize(x.len(), 0.0);
        for _ in 0..4 {
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
