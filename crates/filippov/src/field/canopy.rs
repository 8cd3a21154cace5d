//! The law of sliding on a few surfaces: the multilinear combination of all fields around them.

use super::MeetingFields;
use crate::error::FieldError;
use crate::switching::codim2::Bilinear;
use crate::switching::{least_multipliers, newton, stability_margins, stable_roots, NormalFields};
use crate::system::PiecewiseSystem;

/// The canopy of the 2^m fields around an intersection, and the root that the motion follows.
pub struct Canopy {
    fields: MeetingFields,
    weights: Vec<f64>,
    /// The scaling of the surfaces, for the stability of the root of three and more.
    kappa: Vec<f64>,
}

impl Canopy {
    /// Room for the fields around the surfaces of `set`.
    pub fn new(system: &dyn PiecewiseSystem, set: &[usize]) -> Self {
        Canopy {
            fields: MeetingFields::new(system, set),
            weights: Vec::new(),
            kappa: vec![1.0; set.len()],
        }
    }

    /// Sets the scaling of the surfaces.
    pub fn set_scaling(&mut self, kappa: &[f64]) {
        self.kappa.copy_from_slice(kappa);
    }

    /// Evaluates all fields at a point of the intersection. Returns the number of evaluations.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn evaluate(
        &mut self,
        system: &dyn PiecewiseSystem,
        t: f64,
        x: &[f64],
        signs: &[f64],
    ) -> Result<u64, FieldError> {
        self.fields.evaluate(system, t, x, signs)
    }

    /// Finds the multipliers, near those in `lambda` if there are any, and writes the field. Returns the exit
    /// functions of the root, fold and stability; `None` if there is no root.
    pub fn solve(&mut self, lambda: &mut Vec<f64>, dx: &mut [f64]) -> Option<[f64; 2]> {
        let fields = self.fields.normal_fields().ok()?;
        let telling = self.fields.telling();
        let ends = if telling.len() < fields.m() {
            // Sliding of higher order: some equations hold for all multipliers, and only their ends end it.
            *lambda = least_multipliers(&fields, &telling)?;
            [1.0, 1.0]
        } else if fields.m() == 2 {
            solve_two(&fields, lambda)?
        } else {
            solve_many(&fields, lambda, &self.kappa)?
        };
        self.fields.fill_product_weights(lambda, &mut self.weights);
        self.fields.combine(&self.weights, dx);
        Some(ends)
    }
}

/// Two surfaces: the root with det G > 0 in closed form, extended slightly beyond a fold.
fn solve_two(fields: &NormalFields, lambda: &mut Vec<f64>) -> Option<[f64; 2]> {
    let canopy = Bilinear::of_fields(fields);
    let root = canopy.extended_root()?;
    let jacobian = canopy.jacobian(root);
    lambda.clear();
    lambda.extend(root);
    let sizes = [fields.row_size(0), fields.row_size(1)];
    let stability = -(jacobian[0][0] / sizes[0]).min(jacobian[1][1] / sizes[1]);
    Some([canopy.discriminant(), stability])
}

/// More surfaces: Newton's method from the last multipliers; at the start from the only stable root.
fn solve_many(fields: &NormalFields, lambda: &mut Vec<f64>, kappa: &[f64]) -> Option<[f64; 2]> {
    if lambda.len() != fields.m() {
        *lambda = stable_roots(fields).into_iter().next()?;
    }
    *lambda = newton(fields, lambda)?;
    // Stable for the scaling that decides where the motion began.
    Some(stability_margins(
        &fields.jacobian(lambda).with_rows_scaled(kappa),
    ))
}
