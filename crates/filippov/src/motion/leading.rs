//! The first Lie derivative that does not vanish.

use crate::error::FieldError;
use crate::mode::Signs;
use crate::system::{move_inside, side_offsets};
use crate::system::{LieValue, PiecewiseSystem, Place};
use crate::tolerances::{MAX_LIE_ORDER, SAME_VALUE, SIDE_REACH};

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
/// vanish): they are skipped. Where a derivative does not exist on the surface (a power of the distance),
/// all orders are looked at just inside of the region.
///
/// # Errors
/// If a function of the user raises.
pub fn first_nonzero(
    system: &dyn PiecewiseSystem,
    j: usize,
    side: i8,
    vanishing: usize,
    place: &Place<'_>,
) -> Result<Leading, FieldError> {
    let mut signs_side = Signs::from_slice(place.signs);
    signs_side[j] = f64::from(side);
    let on_side = place.with_signs(&signs_side);
    if let Some(leading) = scan(system, j, side, vanishing, &on_side)? {
        return Ok(leading);
    }
    for offset in side_offsets(place.x) {
        let (t, inside) = move_inside(system, &on_side, offset, SIDE_REACH * offset)?;
        if let Some(leading) = scan(system, j, side, 0, &on_side.moved(t, &inside))? {
            return Ok(leading);
        }
    }
    by_difference(system, j, &on_side)
}

/// What two values of h along the field tell, where no derivative is finite: a root of what is zero all around has none.
fn by_difference(
    system: &dyn PiecewiseSystem,
    j: usize,
    place: &Place<'_>,
) -> Result<Leading, FieldError> {
    let mut rate = vec![0.0; place.x.len()];
    system.field(place, &mut rate)?;
    let speed = rate.iter().fold(1.0_f64, |most, v| most.max(v.abs()));
    let duration = side_offsets(place.x).last().unwrap_or(0.0) / speed;
    let moved: Vec<f64> = (place.x.iter().zip(&rate))
        .map(|(x, v)| x + duration * v)
        .collect();
    let mut h = [
        vec![0.0; system.n_surfaces()],
        vec![0.0; system.n_surfaces()],
    ];
    system.surfaces(place, &mut h[0])?;
    system.surfaces(&place.moved(place.t + duration, &moved), &mut h[1])?;
    let change = h[1][j] - h[0][j];
    let is_clear = change.abs() > SAME_VALUE * (h[0][j].abs() + h[1][j].abs());
    Ok(match is_clear && change.is_finite() {
        true => Leading {
            order: 1,
            value: change / duration,
        },
        false => Leading {
            order: 0,
            value: 0.0,
        },
    })
}

/// As [`first_nonzero`] for both sides, f- and f+, at once: where neither is tangent one evaluation may do.
///
/// # Errors
/// If a function of the user raises.
pub(crate) fn first_nonzero_of_both(
    system: &dyn PiecewiseSystem,
    j: usize,
    vanishing: [usize; 2],
    place: &Place<'_>,
) -> Result<[Leading; 2], FieldError> {
    let (firsts, tolerance) = match system.lie_derivatives() {
        Some(lie) => (lie.first_lie_derivatives(j, place), lie.lie_tolerance(1)),
        None => (None, 0.0),
    };
    let leading = |index: usize, side: i8| match firsts.map(|firsts| firsts[index]) {
        Some(LieValue { value, magnitude })
            if vanishing[index] == 0
                && value.is_finite()
                && value.abs() > tolerance * magnitude =>
        {
            Ok(Leading { order: 1, value })
        }
        _ => first_nonzero(system, j, side, vanishing[index], place),
    };
    Ok([leading(0, -1)?, leading(1, 1)?])
}

/// As [`first_nonzero`] at this very point; `None` where a derivative is not finite.
#[inline]
fn scan(
    system: &dyn PiecewiseSystem,
    j: usize,
    side: i8,
    vanishing: usize,
    place: &Place<'_>,
) -> Result<Option<Leading>, FieldError> {
    let highest = system.max_lie_order().min(MAX_LIE_ORDER);
    let word = [side; MAX_LIE_ORDER];
    for order in vanishing + 1..=highest {
        let LieValue { value, magnitude } = system.lie_derivative(j, j, &word[..order], place)?;
        if !value.is_finite() {
            return Ok(None);
        }
        if value.abs() > system.lie_tolerance(order) * magnitude {
            return Ok(Some(Leading { order, value }));
        }
    }
    Ok(Some(Leading {
        order: 0,
        value: 0.0,
    }))
}

/// The normal component dh_i/dt along f with entry `j` of the signs set to `side`, taken just inside of
/// the region where it does not exist on the surface.
///
/// # Errors
/// If a function of the user raises.
pub fn normal_component(
    system: &dyn PiecewiseSystem,
    i: usize,
    j: usize,
    side: i8,
    place: &Place<'_>,
) -> Result<LieValue, FieldError> {
    let mut signs_side = Signs::from_slice(place.signs);
    signs_side[j] = f64::from(side);
    let on_side = place.with_signs(&signs_side);
    let mut lie = system.lie_derivative(i, j, &[side], &on_side)?;
    for offset in side_offsets(place.x) {
        if lie.value.is_finite() {
            break;
        }
        let (t, inside) = move_inside(system, &on_side, offset, SIDE_REACH * offset)?;
        lie = system.lie_derivative(i, j, &[side], &on_side.moved(t, &inside))?;
    }
    Ok(lie)
}
