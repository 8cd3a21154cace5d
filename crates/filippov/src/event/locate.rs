//! Location of an isolated zero to rounding.

use super::isolate::Sampled;
use crate::error::FieldError;
use crate::tolerances::EPS;

/// The zero of `g` in [lo, hi], where g(lo) and g(hi) have different signs, within `width`.
///
/// Regula falsi with halved retained value (Illinois), and a bisection whenever three steps did not
/// halve the bracket. Returns the end of the final bracket with the smaller |g|.
///
/// # Errors
/// If `g` raises.
pub fn refine(g: Sampled, lo: f64, hi: f64, width: f64) -> Result<f64, FieldError> {
    let (mut a, mut b) = (lo, hi);
    let (mut ga, mut gb) = (g(a)?, g(b)?);
    // Weighted values for the secant; true ones decide at the end.
    let (mut wa, mut wb) = (ga, gb);
    let mut retained_a = 0_i32;
    let mut checkpoint = (b - a, 0);
    while (b - a).abs() > width.max(2.0 * EPS * b.abs()) && ga != 0.0 && gb != 0.0 {
        checkpoint.1 += 1;
        let mut c = (a * wb - b * wa) / (wb - wa);
        if checkpoint.1 > 3 {
            if b - a > 0.5 * checkpoint.0 {
                c = 0.5 * (a + b);
            }
            checkpoint = (b - a, 0);
        }
        if !(c > a && c < b) {
            c = 0.5 * (a + b);
            if c <= a || c >= b {
                break;
            }
        }
        let gc = g(c)?;
        if (gc > 0.0) == (ga > 0.0) && gc != 0.0 {
            (a, ga, wa) = (c, gc, gc);
            retained_a = retained_a.min(0) - 1;
            if retained_a < -1 {
                wb *= 0.5;
            }
        } else {
            (b, gb, wb) = (c, gc, gc);
            retained_a = retained_a.max(0) + 1;
            if retained_a > 1 {
                wa *= 0.5;
            }
        }
    }
    Ok(if ga.abs() < gb.abs() { a } else { b })
}
