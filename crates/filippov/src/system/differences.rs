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

#[cfg(test)]
mod tests {
    use super::central;

    /// The slope of (x / u)^3 - x / u in units u of any size.
    #[test]
    fn the_unit_of_a_number_may_be_anything() {
        for unit in [1e-9, 1e-6, 1e-3, 1.0, 1e6] {
            for share in [0.0, 0.1, -0.7, 2.0] {
                let cubic = |x: f64| Ok((x / unit).powi(3) - x / unit);
                let slope = central(share * unit, cubic).map(|slope| slope * unit);
                let exact = 3.0 * share * share - 1.0;
                assert!(
                    slope.is_ok_and(|slope| (slope - exact).abs() < 1e-5),
                    "{unit}, {share}"
                );
            }
        }
    }

    #[test]
    fn a_constant_has_no_slope() {
        assert!(central(0.0, |_| Ok(0.3)).is_ok_and(|slope| slope == 0.0));
    }
}
