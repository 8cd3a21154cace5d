//! Location of an isolated zero to rounding.

use super::isolate::{Bracket, Sampled};
use crate::error::FieldError;
use crate::tolerances::EPS;

/// The zero of `g` in the bracket, within `width` or to rounding.
///
/// Secant steps from the guess of the isolation (a zero of a quartic, often good to five digits),
/// kept in the bracket; a bisection whenever a step does not halve the one before. Returns the
/// evaluated point with the smallest |g|, or the last secant step if it is shorter than `width`.
///
/// # Errors
/// If `g` raises.
pub fn refine(g: Sampled, bracket: Bracket, width: f64) -> Result<f64, FieldError> {
    let Bracket {
        mut lo,
        mut hi,
        g_lo,
        g_hi,
        guess,
    } = bracket;
    let (mut best, mut previous) = match g_lo.abs() < g_hi.abs() {
        true => ((lo, g_lo), (lo, g_lo)),
        false => ((hi, g_hi), (hi, g_hi)),
    };
    let mut at = guess.clamp(lo, hi);
    let mut last_move = hi - lo;
    while best.1 != 0.0 && hi - lo > width.max(EPS * hi.abs()) && at > lo && at < hi {
        let value = g(at)?;
        if value.abs() < best.1.abs() {
            best = (at, value);
        }
        // The function falls through zero: positive to the left.
        if value > 0.0 {
            lo = at;
        } else {
            hi = at;
        }
        let secant = at - value * (at - previous.0) / (value - previous.1);
        let inside = secant > lo && secant < hi;
        if inside && (secant - at).abs() <= 0.5 * width.max(EPS * hi.abs()) {
            return Ok(secant);
        }
        let next = if inside && (secant - at).abs() <= 0.5 * last_move {
            secant
        } else {
            0.5 * (lo + hi)
        };
        last_move = (next - at).abs();
        previous = (at, value);
        at = next;
    }
    Ok(best.0)
}
