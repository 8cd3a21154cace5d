//! Location of an isolated zero to rounding.

use super::isolate::{Bracket, Sampled};
use crate::error::FieldError;
use crate::tolerances::EPS;

/// A zero, located.
#[derive(Clone, Copy, Debug)]
pub struct Located {
    /// Where.
    pub theta: f64,
    /// How far from zero the function may still be there: large at a pole or a jump.
    pub residual: f64,
    /// The slope there, of the last two secants the steeper one.
    pub slope: f64,
}

/// The zero of `g` in the bracket, within `width` or to rounding.
///
/// A Newton step with the slope of the quartic of the isolation, from its zero (often good to five
/// digits), then secant steps, kept in the bracket; a bisection whenever a step does not halve the one
/// before. A secant step errs by its length times the relative error of its slope, for which the change
/// of the slope stands, and at least the length in units of the bracket: if that is below half the
/// `width` the end of the step is the zero and is not evaluated. Otherwise returns the evaluated point
/// with the smallest |g|.
///
/// # Errors
/// If `g` raises.
pub fn refine(g: Sampled, bracket: Bracket, width: f64) -> Result<Located, FieldError> {
    let Bracket {
        mut lo,
        mut hi,
        g_lo,
        g_hi,
        guess,
        mut slope,
    } = bracket;
    let mut best = match g_lo.abs() < g_hi.abs() {
        true => (lo, g_lo),
        false => (hi, g_hi),
    };
    let mut previous = None;
    let mut at = guess.clamp(lo, hi);
    let length = hi - lo;
    let mut last_move = length;
    let mut steepest = slope.abs();
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
        let chord = previous.map_or(slope, |(x, v)| (value - v) / (at - x));
        steepest = chord.abs().max(slope.abs());
        let secant = at - value / chord;
        let inside = secant > lo && secant < hi;
        let step = (secant - at).abs();
        let doubt = match previous {
            None => 1.0,
            Some(_) => ((chord - slope) / chord).abs().max(step / length).min(1.0),
        };
        if inside && step * doubt <= 0.5 * width.max(EPS * hi.abs()) {
            return Ok(Located {
                theta: secant,
                residual: value.abs() * doubt,
                slope: steepest,
            });
        }
        let next = if inside && step <= 0.5 * last_move {
            secant
        } else {
            0.5 * (lo + hi)
        };
        last_move = (next - at).abs();
        (previous, slope) = (Some((at, value)), chord);
        at = next;
    }
    Ok(Located {
        theta: best.0,
        residual: best.1.abs(),
        slope: steepest,
    })
}
