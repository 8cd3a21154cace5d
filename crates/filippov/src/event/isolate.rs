//! Isolation of the first zero of a function of theta.

use crate::error::FieldError;
use crate::tolerances::{MAX_DEPTH, QUARTIC_REMAINDER};

/// A scalar function of theta.
pub type Sampled<'a> = &'a mut dyn FnMut(f64) -> Result<f64, FieldError>;

/// The first zero, as far as it is known before it is refined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Zero {
    /// The function changes from positive to not positive in the bracket.
    Crossing(Bracket),
    /// The function comes within rounding of zero at theta and does not change sign.
    Touch(f64),
}

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
}

impl Bracket {
    /// Does the function fall too steeply to turn back within the noise? With a slope c and second
    /// differences of at most 1e4 times the values, the lowest depth is far above it.
    pub fn is_steep(&self, noise: f64) -> bool {
        let size = self.g_lo.abs().max(self.g_hi.abs());
        let slope = (self.g_lo - self.g_hi) / (self.hi - self.lo);
        slope * slope > 2e4 * size * noise
    }
}

/// The result of a search, with the number of bisections it took.
#[derive(Clone, Copy, Debug)]
pub struct Isolated {
    /// The first zero, if there is one.
    pub zero: Option<Zero>,
    /// The deepest bisection; a large number means that the step does not resolve the function.
    pub depth: u32,
}

/// The first zero of `g` on [a, b], where `g(a) > 0`; `noise` is the rounding of g.
///
/// Five samples give the Bernstein coefficients of a quartic. A piece is free of zeros if all of
/// them exceed the remainder, estimated from the fourth difference; it has exactly one zero if they
/// decrease by more than that from a positive to a negative value; else it is bisected. A function
/// within `noise` everywhere has no zero: it vanishes identically.
///
/// # Errors
/// If `g` raises.
pub fn first_zero(g: Sampled, a: f64, b: f64, noise: f64) -> Result<Isolated, FieldError> {
    let mut values = [0.0; 5];
    for (i, value) in values.iter_mut().enumerate() {
        *value = g(a + (b - a) * 0.25 * i as f64)?;
    }
    first_zero_sampled(g, a, b, values, noise)
}

/// As [`first_zero`], with the values at the quarters of [a, b] already known.
///
/// # Errors
/// If `g` raises.
pub fn first_zero_sampled(
    g: Sampled,
    a: f64,
    b: f64,
    values: [f64; 5],
    noise: f64,
) -> Result<Isolated, FieldError> {
    if values.iter().all(|v| v.abs() <= noise) {
        return Ok(Isolated { zero: None, depth: 0 });
    }
    if values[0] < -noise {
        let here = Bracket { lo: a, hi: a, g_lo: values[0], g_hi: values[0], guess: a };
        return Ok(Isolated { zero: Some(Zero::Crossing(here)), depth: 0 });
    }
    let mut deepest = 0;
    let zero = search(g, a, b, values, noise, 0, &mut deepest)?;
    Ok(Isolated { zero, depth: deepest })
}

fn search(
    g: Sampled,
    a: f64,
    b: f64,
    v: [f64; 5],
    noise: f64,
    depth: u32,
    deepest: &mut u32,
) -> Result<Option<Zero>, FieldError> {
    *deepest = depth.max(*deepest);
    let coefficients = bernstein(&v);
    let remainder = QUARTIC_REMAINDER * (v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4]).abs();
    if coefficients.iter().all(|&c| c > remainder) {
        return Ok(None);
    }
    let falls = coefficients.windows(2).all(|w| w[0] - w[1] > 2.0 * remainder);
    let unresolved = depth >= MAX_DEPTH || v.iter().all(|v| v.abs() <= noise);
    let m = 0.5 * (a + b);
    if falls && v[0] > 0.0 && v[4] <= 0.0 || unresolved || m <= a || m >= b {
        return Ok(bracket(a, b, &v, &coefficients, noise));
    }
    let quarter = 0.125 * (b - a);
    let left = [v[0], g(a + quarter)?, v[1], g(a + 3.0 * quarter)?, v[2]];
    if let Some(zero) = search(g, a, m, left, noise, depth + 1, deepest)? {
        return Ok(Some(zero));
    }
    let right = [v[2], g(m + quarter)?, v[3], g(m + 3.0 * quarter)?, v[4]];
    search(g, m, b, right, noise, depth + 1, deepest)
}

/// The first change of sign among the samples, else a touch if the smallest is within the noise.
fn bracket(a: f64, b: f64, v: &[f64; 5], coefficients: &[f64; 5], noise: f64) -> Option<Zero> {
    let at = |i: usize| if i == 4 { b } else { a + (b - a) * 0.25 * i as f64 };
    if let Some(i) = (0..4).find(|&i| v[i] > 0.0 && v[i + 1] <= 0.0) {
        let (mut low, mut high) = (0.25 * i as f64, 0.25 * (i + 1) as f64);
        let (mut p_low, mut p_high) = (v[i], v[i + 1]);
        let mut x = low;
        // Regula falsi with the halved retained value; six steps give more digits than the quartic has.
        for _ in 0..6 {
            x = low + (high - low) * p_low / (p_low - p_high);
            let p = casteljau(*coefficients, x);
            if p > 0.0 {
                (low, p_low) = (x, p);
                p_high *= 0.5;
            } else {
                (high, p_high) = (x, p);
                p_low *= 0.5;
            }
        }
        let guess = a + (b - a) * x;
        let crossing = Bracket { lo: at(i), hi: at(i + 1), g_lo: v[i], g_hi: v[i + 1], guess };
        return Some(Zero::Crossing(crossing));
    }
    let smallest = (0..5).min_by(|&i, &j| v[i].abs().total_cmp(&v[j].abs()))?;
    (v[smallest].abs() <= noise).then(|| Zero::Touch(at(smallest)))
}

/// The polynomial with these Bernstein coefficients.
fn casteljau(mut c: [f64; 5], x: f64) -> f64 {
    for n in (1..5).rev() {
        for i in 0..n {
            c[i] += x * (c[i + 1] - c[i]);
        }
    }
    c[0]
}

/// Bernstein coefficients of the quartic through values at 0, 1/4, 1/2, 3/4, 1.
fn bernstein(v: &[f64; 5]) -> [f64; 5] {
    [
        v[0],
        (-13.0 * v[0] + 48.0 * v[1] - 36.0 * v[2] + 16.0 * v[3] - 3.0 * v[4]) / 12.0,
        (13.0 * (v[0] + v[4]) - 64.0 * (v[1] + v[3]) + 120.0 * v[2]) / 18.0,
        (-3.0 * v[0] + 16.0 * v[1] - 36.0 * v[2] + 48.0 * v[3] - 13.0 * v[4]) / 12.0,
        v[4],
    ]
}
