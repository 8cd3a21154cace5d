//! Location of an isolated zero to rounding.

use crate::error::FieldError;
use crate::tolerances::EPS;

/// A scalar function of theta.
pub type Sampled<'a> = &'a mut dyn FnMut(f64) -> Result<f64, FieldError>;

/// An interval with one change of sign, from positive to not positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bracket {
    /// Left end.
    pub lo: f64,
    /// Right end.
    pub hi: f64,
    /// Value at the left end.
    pub g_lo: f64,
    /// Value at the right end.
    pub g_hi: f64,
    /// Where the interpolating polynomial vanishes.
    pub guess: f64,
    /// Its slope there.
    pub slope: f64,
}

impl Bracket {
    /// A zero that is known to be here.
    pub fn at(theta: f64, value: f64) -> Self {
        Bracket {
            lo: theta,
            hi: theta,
            g_lo: value,
            g_hi: value,
            guess: theta,
            slope: f64::NAN,
        }
    }

    /// Does the function fall too steeply to turn back within the noise? With the mean slope c of the
    /// bracket and second derivatives of at most 1e3 times the `scale` of its values, the lowest
    /// point ahead is c^2 / (2e3 scale) below zero.
    pub fn is_steep(&self, scale: f64, noise: f64) -> bool {
        is_steep((self.g_lo - self.g_hi) / (self.hi - self.lo), scale, noise)
    }
}

/// Does a function with this slope at its zero not turn back within the noise, if its second derivatives are at most 1e3
/// times the `scale` of its values?
pub fn is_steep(slope: f64, scale: f64, noise: f64) -> bool {
    slope * slope > 2e3 * scale * noise
}

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
/// `width` the end of the step is the zero and is not evaluated. Otherwise returns the end of the last
/// bracket with the smaller |g|: beside a jump, points far from it may have as small values.
///
/// # Errors
/// If `g` raises.
pub fn refine(g: Sampled, bracket: Bracket, width: f64) -> Result<Located, FieldError> {
    let Bracket {
        mut lo,
        mut hi,
        mut g_lo,
        mut g_hi,
        guess,
        mut slope,
    } = bracket;
    let mut previous = None;
    // A guess may lie at an end to rounding, where the values differ by orders of magnitude.
    let mut at = match guess > lo && guess < hi {
        true => guess,
        false => 0.5 * (lo + hi),
    };
    let length = hi - lo;
    let mut last_move = length;
    let mut steepest = slope.abs();
    while g_lo != 0.0 && g_hi != 0.0 && hi - lo > width.max(EPS * hi.abs()) && at > lo && at < hi {
        let value = g(at)?;
        // The function falls through zero: positive to the left.
        if value > 0.0 {
            (lo, g_lo) = (at, value);
        } else {
            (hi, g_hi) = (at, value);
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
        let resolved = width.max(EPS * hi.abs());
        let mut converges = inside && step <= 0.5 * last_move;
        if inside && step * doubt <= 0.5 * resolved {
            // A slope between values that are much larger does not locate this zero. A second value checks that the sign changes.
            let is_zero = value.abs() >= EPS * g_lo.max(-g_hi) || {
                let ahead = secant + value.signum() * resolved;
                let beyond = g(ahead.clamp(lo, hi))?;
                (beyond > 0.0) != (value > 0.0)
            };
            if is_zero {
                return Ok(Located {
                    theta: secant,
                    residual: value.abs() * doubt,
                    slope: steepest,
                });
            }
            converges = false;
        }
        let next = match converges {
            true => secant,
            false => 0.5 * (lo + hi),
        };
        last_move = (next - at).abs();
        (previous, slope) = (Some((at, value)), chord);
        at = next;
    }
    let (theta, value) = match g_lo.abs() < g_hi.abs() {
        true => (lo, g_lo),
        false => (hi, g_hi),
    };
    Ok(Located {
        theta,
        residual: value.abs(),
        slope: steepest,
    })
}
