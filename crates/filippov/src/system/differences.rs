//! Derivatives by differences.

use crate::error::FieldError;
use crate::tolerances::{EPS, MOST_SHORTENINGS};

/// The derivative of a function at a number, by a central difference.
///
/// A number far from zero tells its size, and the reach of the difference. Near zero the reach is that of a number of size 1, unless
/// a shorter one gives another derivative: of those that agree best the longer one is taken. The unit of a state may be anything.
///
/// # Errors
/// If the function raises.
pub(super) fn central(
    at: f64,
    mut value: impl FnMut(f64) -> Result<f64, FieldError>,
) -> Result<f64, FieldError> {
    let mut slope = |reach: f64| -> Result<f64, FieldError> {
        let (up, down) = (at + reach, at - reach);
        Ok((value(up)? - value(down)?) / (up - down))
    };
    let small = EPS.powf(1.0 / 6.0);
    let mut reach = EPS.cbrt() * (1.0 + at.abs());
    let mut longer = slope(reach)?;
    let rounding = 10.0 * EPS / (reach * small);
    let (mut best, mut least) = (longer, f64::INFINITY);
    if at.abs() > small {
        return Ok(best);
    }
    for _ in 0..MOST_SHORTENINGS {
        reach *= small;
        let shorter = slope(reach)?;
        let apart = (shorter - longer).abs();
        if apart < least {
            (best, least) = (longer, apart);
        }
        // What is left is rounding, which grows as the reach becomes shorter.
        if apart <= rounding * longer.abs() || apart > least {
            break;
        }
        longer = shorter;
    }
    Ok(best)
}
