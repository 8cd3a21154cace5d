//! The field of a region.

use super::SmoothField;
use crate::error::FieldError;
use crate::system::PiecewiseSystem;
use crate::tolerances::{EPS, SIDE_OFFSET};

/// The smooth field of one region: f(t, x, s) with fixed signs.
pub struct RegionField<'a> {
    system: &'a dyn PiecewiseSystem,
    signs: Vec<f64>,
    n_evaluations: u64,
}

impl<'a> RegionField<'a> {
    /// The field of the region with these signs.
    pub fn new(system: &'a dyn PiecewiseSystem, signs: Vec<f64>) -> Self {
        RegionField { system, signs, n_evaluations: 0 }
    }
}

impl SmoothField for RegionField<'_> {
    #[inline]
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        self.n_evaluations += 1;
        self.system.field(t, x, &self.signs, dx)
    }

    fn n_evaluations(&self) -> u64 {
        self.n_evaluations
    }
}

/// Evaluates the field of one side at a point that lies on a surface up to rounding.
///
/// If the field is not finite there (a power 3/2 of the distance, a black box that looks at the
/// sign of h itself), the point is moved off the surfaces into the region of `signs` by some
/// units of rounding, just far enough. Returns the number of evaluations.
///
/// # Errors
/// If a function of the user raises.
pub fn eval_on_side<S: PiecewiseSystem + ?Sized>(
    system: &S,
    t: f64,
    x: &[f64],
    signs: &[f64],
    dx: &mut [f64],
) -> Result<u64, FieldError> {
    system.field(t, x, signs, dx)?;
    if dx.iter().all(|v| v.is_finite()) {
        return Ok(1);
    }
    let n = x.len();
    let d = system.n_surfaces();
    let mut h = vec![0.0; d];
    let mut gradient = vec![0.0; n];
    let size = x.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
    let mut offset = SIDE_OFFSET * EPS * size;
    let mut evaluations = 1;
    for _ in 0..6 {
        let mut moved = x.to_vec();
        system.surfaces(t, x, signs, &mut h)?;
        for j in 0..d {
            system.gradient(j, t, x, signs, &mut gradient)?;
            let norm2: f64 = gradient.iter().map(|g| g * g).sum();
            let wanted = offset * norm2.sqrt();
            if norm2 > 0.0 && signs[j] * h[j] < wanted && h[j].abs() <= 1e3 * wanted {
                let shift = (signs[j] * wanted - h[j]) / norm2;
                moved.iter_mut().zip(&gradient).for_each(|(x, g)| *x += shift * g);
            }
        }
        system.field(t, &moved, signs, dx)?;
        evaluations += 1;
        if dx.iter().all(|v| v.is_finite()) {
            break;
        }
        offset *= 16.0;
    }
    Ok(evaluations)
}
