//! The first Lie derivative that does not vanish.

use crate::error::FieldError;
use crate::system::PiecewiseSystem;
use crate::tolerances::MAX_LIE_ORDER;

/// The first non-vanishing derivative of h along a field: h(t) = value (t - t0)^order / order! + ...
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leading {
    /// The order; 0 if none was found up to the highest order looked at.
    pub order: usize,
    /// The derivative.
    pub value: f64,
}

impl Leading {
    /// -1, 0 or +1: the side of the surface that the field moves to.
    pub fn sign(&self) -> i8 {
        match self.order {
            0 => 0,
            _ if self.value > 0.0 => 1,
            _ => -1,
        }
    }

    /// The coefficient of (t - t0)^order.
    pub fn coefficient(&self) -> f64 {
        self.value / (1..=self.order).map(|k| k as f64).product::<f64>()
    }
}

/// The first non-vanishing Lie derivative of h_j along f with entry `j` of the signs set to `side`.
///
/// `vanishing` is the number of orders known to be zero (1 where an exit function was just found to
/// vanish): they are skipped.
///
/// # Errors
/// If a function of the user raises.
pub fn first_nonzero(
    system: &dyn PiecewiseSystem,
    j: usize,
    side: i8,
    vanishing: usize,
    t: f64,
    x: &[f64],
    signs: &[f64],
) -> Result<Leading, FieldError> {
    let highest = system.max_lie_order().min(MAX_LIE_ORDER);
    let word = [side; MAX_LIE_ORDER];
    let signs_side: Vec<f64> = signs
        .iter()
        .enumerate()
        .map(|(i, s)| if i == j { f64::from(side) } else { *s })
        .collect();
    for order in vanishing + 1..=highest {
        let lie = system.lie_derivative(j, j, &word[..order], t, x, &signs_side)?;
        if !lie.value.is_finite() {
            break;
        }
        if lie.value.abs() > system.lie_tolerance(order) * lie.magnitude {
            return Ok(Leading {
                order,
                value: lie.value,
            });
        }
    }
    Ok(Leading {
        order: 0,
        value: 0.0,
    })
}
