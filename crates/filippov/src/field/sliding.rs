//! The sliding field on one surface.

use super::{eval_on_side, project, SmoothField};
use crate::error::FieldError;
use crate::system::{dot, PiecewiseSystem};

/// The normal components on both sides of the surface slid on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalComponents {
    /// dh/dt along f-; positive: f- points to the surface.
    pub minus: f64,
    /// dh/dt along f+; negative: f+ points to the surface.
    pub plus: f64,
}

impl NormalComponents {
    /// The multiplier lambda in [-1, 1]: +1 is the field of the side h > 0,
    /// lambda = (minus + plus) / (minus - plus).
    pub fn multiplier(&self) -> f64 {
        (self.minus + self.plus) / (self.minus - self.plus)
    }
}

/// Filippov's field on one surface,
///
///   f_s = (a- f+ - a+ f-) / (a- - a+),   a± = d_t h + grad h . f±,
///
/// evaluated at the projection of the point onto the surface.
///
/// Reference: Filippov (1988); Guglielmi, Hairer (2022), section 4.1.
pub struct SlidingField<'a> {
    system: &'a dyn PiecewiseSystem,
    surface: usize,
    signs_minus: Vec<f64>,
    signs_plus: Vec<f64>,
    f_minus: Vec<f64>,
    f_plus: Vec<f64>,
    h: Vec<f64>,
    gradient: Vec<f64>,
    n_evaluations: u64,
    last: NormalComponents,
}

impl<'a> SlidingField<'a> {
    /// Sliding on surface `j`, the other surfaces with the given signs.
    pub fn new(system: &'a dyn PiecewiseSystem, j: usize, signs: &[f64]) -> Self {
        let n = system.n_states();
        let with = |s: f64| {
            let mut signs = signs.to_vec();
            signs[j] = s;
            signs
        };
        SlidingField {
            system,
            surface: j,
            signs_minus: with(-1.0),
            signs_plus: with(1.0),
            f_minus: vec![0.0; n],
            f_plus: vec![0.0; n],
            h: vec![0.0; system.n_surfaces()],
            gradient: vec![0.0; n],
            n_evaluations: 0,
            last: NormalComponents { minus: f64::NAN, plus: f64::NAN },
        }
    }

    /// The surface slid on.
    pub fn surface(&self) -> usize {
        self.surface
    }

    /// Normal components of the last evaluation.
    pub fn last(&self) -> NormalComponents {
        self.last
    }

    /// Moves `x` onto the surface.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn project(&mut self, t: f64, x: &mut [f64]) -> Result<f64, FieldError> {
        project(self.system, self.surface, t, x, &self.signs_plus, &mut self.h, &mut self.gradient)
    }

    /// The normal components at (t, x), after projection.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn normal_components(&mut self, t: f64, x: &mut [f64]) -> Result<NormalComponents, FieldError> {
        let ht = self.project(t, x)?;
        self.n_evaluations += eval_on_side(self.system, t, x, &self.signs_minus, &mut self.f_minus)?;
        self.n_evaluations += eval_on_side(self.system, t, x, &self.signs_plus, &mut self.f_plus)?;
        self.last = NormalComponents {
            minus: ht + dot(&self.gradient, &self.f_minus),
            plus: ht + dot(&self.gradient, &self.f_plus),
        };
        Ok(self.last)
    }
}

impl SmoothField for SlidingField<'_> {
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        let a = self.normal_components(t, x)?;
        let weight_plus = a.minus / (a.minus - a.plus);
        let sides = self.f_minus.iter().zip(&self.f_plus);
        for (dx, (minus, plus)) in dx.iter_mut().zip(sides) {
            *dx = minus + weight_plus * (plus - minus);
        }
        Ok(())
    }

    fn n_evaluations(&self) -> u64 {
        self.n_evaluations
    }
}
