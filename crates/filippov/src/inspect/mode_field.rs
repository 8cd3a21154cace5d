//! The field of sliding on an intersection at a point.

use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{IntersectionField, Motion, SmoothField};
use crate::system::{PiecewiseSystem, Setting};

/// The sliding field of an intersection at a point.
#[derive(Clone, Debug, PartialEq)]
pub struct IntersectionValue {
    /// The field.
    pub dx: Vec<f64>,
    /// lambda of the surfaces slid on, in their order.
    pub multipliers: Vec<f64>,
}

/// The field of a mode with two and more zero entries, at the projection of `x` onto the intersection, at the discrete
/// states `q`.
///
/// `near` holds multipliers from which those of the mode are found by Newton's method, where there are
/// three surfaces and more; if it is empty, they are those of the only stable root. `None` if no multipliers
/// make the field tangent. For two surfaces the multipliers may lie outside of [-1, 1]: then the mode is no
/// sliding motion at this point.
///
/// # Errors
/// If a function of the user raises.
pub fn intersection_field(
    system: &dyn PiecewiseSystem,
    (t, x): (f64, &[f64]),
    q: &[f64],
    mode: &Mode,
    near: &[f64],
) -> Result<Option<IntersectionValue>, FieldError> {
    let set: Vec<usize> = mode.sliding_set().collect();
    let signs = mode.signs();
    let mut field = IntersectionField::new(system, &set, Setting::new(&signs, q), near);
    let mut dx = vec![0.0; x.len()];
    field.eval(t, &mut x.to_vec(), &mut dx)?;
    let multipliers = field.multipliers().to_vec();
    Ok((multipliers.len() == set.len()).then_some(IntersectionValue { dx, multipliers }))
}
