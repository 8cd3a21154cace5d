//! The cheap filter: can a step contain a zero at all?

use crate::tolerances::{REMAINDER, STAGE_SPREAD};

/// May a function with these end values and end slopes (times the step) vanish inside of the step?
///
/// The cubic Hermite polynomial has Bernstein coefficients
/// g0, g0 + g0'/3, g1 - g1'/3, g1; it is bounded by them, and its distance to the function is taken
/// as at most a fixed part of their spread ([`REMAINDER`]). `g0 > 0` is the side of the mode.
#[inline]
pub fn may_vanish(g0: f64, slope0: f64, g1: f64, slope1: f64) -> bool {
    let [b1, b2] = between_ends(g0, slope0, g1, slope1);
    let low = g0.min(g1).min(b1).min(b2);
    let high = g0.max(g1).max(b1).max(b2);
    let remainder = REMAINDER * (high - low);
    // Written so that a NaN asks for the search.
    let excluded = low > remainder && (g0 + slope0 + g1 + slope1).is_finite();
    !(excluded || stays_positive([g0, b1, b2, g1], remainder))
}

/// The least Bernstein coefficient of the cubic: that is nowhere less.
pub fn least_of_cubic(g0: f64, slope0: f64, g1: f64, slope1: f64) -> f64 {
    let [b1, b2] = between_ends(g0, slope0, g1, slope1);
    g0.min(g1).min(b1).min(b2)
}

/// The inner Bernstein coefficients of the cubic.
fn between_ends(g0: f64, slope0: f64, g1: f64, slope1: f64) -> [f64; 2] {
    [g0 + slope0 / 3.0, g1 - slope1 / 3.0]
}

/// Is a function positive whose distance to the cubic with these Bernstein coefficients is at most
/// `remainder`? The error of Hermite's interpolation vanishes twice at both ends, so that the function
/// lies above the quartic
///
///   cubic(theta) - 16 remainder theta^2 (1-theta)^2,
///
/// which is positive if its Bernstein coefficients on both halves of the step are.
fn stays_positive([b0, b1, b2, b3]: [f64; 4], remainder: f64) -> bool {
    if !(b0 > 0.0 && b3 > 0.0) {
        return false;
    }
    let middle = 0.5 * (b1 + b2) - 16.0 / 6.0 * remainder;
    let mut c = [b0, 0.25 * b0 + 0.75 * b1, middle, 0.75 * b2 + 0.25 * b3, b3];
    // De Casteljau's scheme in the middle: the first entries are the coefficients of the left half, the
    // last ones those of the right half.
    for last in (1..5).rev() {
        for i in 0..last {
            c[i] = 0.5 * (c[i] + c[i + 1]);
        }
        if !(c[0] > 0.0 && c[last - 1] > 0.0) {
            return false;
        }
    }
    true
}

/// As [`may_vanish`], for a function that is not a polynomial of low degree along the step: four times
/// its largest distance to the cubic, among the `probes` (theta, value), is added to the remainder.
#[inline]
pub fn may_vanish_bent(g0: f64, slope0: f64, g1: f64, slope1: f64, probes: &[(f64, f64)]) -> bool {
    let distance = |&(theta, value): &(f64, f64)| {
        let u = 1.0 - theta;
        let ends = u * u * (g0 * (1.0 + 2.0 * theta) + slope0 * theta);
        (value - ends - theta * theta * (g1 * (3.0 - 2.0 * theta) - slope1 * u)).abs()
    };
    let shift = 4.0
        * probes
            .iter()
            .map(distance)
            .fold(0.0, |a: f64, b| if b > a || b.is_nan() { b } else { a });
    may_vanish(g0 - shift, slope0, g1 - shift, slope1)
}

/// May a function vanish inside of the step whose values at both ends and at the stages have this range?
#[inline]
pub fn may_vanish_between([least, most]: [f64; 2]) -> bool {
    let spread = most - least;
    let excluded = least > STAGE_SPREAD * spread && spread.is_finite();
    !excluded
}

/// As [`may_vanish`] for a function g with a zero of some `order` at the start of the step divided out:
/// the quotient at the start is `leading` (a simple zero: the slope of g there times the step).
///
/// The quotient q = g/theta^k has q(1) = g1 and q'(1) = g1' - k g1; the quadratic through q(0), q(1), q'(1)
/// is trusted half as far as the cubic.
#[inline]
pub fn may_vanish_deflated(leading: f64, order: i32, g1: f64, slope1: f64) -> bool {
    let middle = g1 - 0.5 * (slope1 - f64::from(order) * g1);
    let low = leading.min(g1).min(middle);
    let high = leading.max(g1).max(middle);
    let excluded = low > 2.0 * REMAINDER * (high - low) && (leading + g1 + slope1).is_finite();
    !excluded
}
