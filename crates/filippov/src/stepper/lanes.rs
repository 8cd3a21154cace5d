//! Sums over all states of a step. Over many states they are taken in the widest registers of the machine, with the same bits.
//!
//! The only file of the core with `unsafe`: calling a function that was compiled for registers which not every machine has.

use super::ErrorScale;
use crate::page::IS_PAGE;

/// The number of states where it is not fixed at compile time.
pub const ANY: usize = 0;

/// So many sums do not wait for one another.
const BLOCK: usize = 32;

/// y + dt (a_1 k_1 + ... + a_R k_R), for `N` states.
#[inline(always)]
pub fn stage<const N: usize, const R: usize>(
    out: &mut [f64],
    y: &[f64],
    dt: f64,
    weights: [f64; R],
    rates: [&[f64]; R],
) {
    if IS_PAGE {
        return short_stage(out, y, dt, (&weights, &rates));
    }
    #[cfg(target_arch = "x86_64")]
    if N == ANY && is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has these registers.
        return unsafe { wide_stage(out, y, dt, weights, rates) };
    }
    plain_stage::<N, R>(out, y, dt, weights, rates);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn wide_stage<const R: usize>(
    out: &mut [f64],
    y: &[f64],
    dt: f64,
    weights: [f64; R],
    rates: [&[f64]; R],
) {
    plain_stage::<ANY, R>(out, y, dt, weights, rates);
}

#[inline(always)]
fn plain_stage<const N: usize, const R: usize>(
    out: &mut [f64],
    y: &[f64],
    dt: f64,
    weights: [f64; R],
    rates: [&[f64]; R],
) {
    let n = if N == ANY { y.len() } else { N };
    let (out, y, rates) = (&mut out[..n], &y[..n], shortened(rates, n));
    for i in 0..n {
        out[i] = y[i] + dt * dot(weights, rates.map(|k| k[i]));
    }
}

/// The sum of the squares of dt (e_1 k_1 + ... + e_R k_R), for `N` states, in units of the tolerances between `y` and `y1`. Over many
/// states in several sums, which do not wait for one another.
#[inline(always)]
pub fn squared_error<const N: usize, const R: usize>(
    scale: &ErrorScale,
    [y, y1]: [&[f64]; 2],
    dt: f64,
    weights: [f64; R],
    rates: [&[f64]; R],
) -> f64 {
    if IS_PAGE {
        return short_squared_error(scale, [y, y1], dt, (&weights, &rates));
    }
    #[cfg(target_arch = "x86_64")]
    if N == ANY && is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has these registers.
        return unsafe { wide_squared_error(scale, [y, y1], dt, weights, rates) };
    }
    plain_squared_error::<N, R>(scale, [y, y1], dt, weights, rates)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn wide_squared_error<const R: usize>(
    scale: &ErrorScale,
    ends: [&[f64]; 2],
    dt: f64,
    weights: [f64; R],
    rates: [&[f64]; R],
) -> f64 {
    plain_squared_error::<ANY, R>(scale, ends, dt, weights, rates)
}

#[inline(always)]
fn plain_squared_error<const N: usize, const R: usize>(
    scale: &ErrorScale,
    [y, y1]: [&[f64]; 2],
    dt: f64,
    weights: [f64; R],
    rates: [&[f64]; R],
) -> f64 {
    let n = if N == ANY { y.len() } else { N };
    let (y, y1, rates) = (&y[..n], &y1[..n], shortened(rates, n));
    let (mut sum, mut first) = (0.0, 0);
    if N == ANY {
        let [y, y1, atol] = [y, y1, scale.atol()].map(in_blocks);
        let (y1, atol) = (&y1[..y.len()], &atol[..y.len()]);
        let rates = rates.map(|k| &in_blocks(k)[..y.len()]);
        let mut sums = [0.0; BLOCK];
        for b in 0..y.len() {
            let (y, y1, atol, rates) = (&y[b], &y1[b], &atol[b], rates.map(|k| &k[b]));
            for i in 0..BLOCK {
                let error = dt * dot(weights, rates.map(|k| k[i]));
                let ratio = error / scale.by(atol[i], y[i], y1[i]);
                sums[i] += ratio * ratio;
            }
        }
        (sum, first) = (sums.iter().sum(), BLOCK * y.len());
    }
    for i in first..n {
        let ratio = dt * dot(weights, rates.map(|k| k[i])) / scale.of(i, y[i], y1[i]);
        sum += ratio * ratio;
    }
    sum
}

/// [`stage`] in few instructions.
#[inline(never)]
fn short_stage(out: &mut [f64], y: &[f64], dt: f64, terms: (&[f64], &[&[f64]])) {
    for (i, (out, y)) in out.iter_mut().zip(y).enumerate() {
        *out = y + dt * short_dot(i, terms);
    }
}

/// [`squared_error`] in few instructions.
#[inline(never)]
fn short_squared_error(
    scale: &ErrorScale,
    [y, y1]: [&[f64]; 2],
    dt: f64,
    terms: (&[f64], &[&[f64]]),
) -> f64 {
    let ends = y.iter().zip(y1).enumerate();
    ends.fold(0.0, |sum, (i, (y, y1))| {
        let ratio = dt * short_dot(i, terms) / scale.of(i, *y, *y1);
        sum + ratio * ratio
    })
}

#[inline(never)]
fn short_dot(i: usize, (weights, rates): (&[f64], &[&[f64]])) -> f64 {
    let terms = weights.iter().zip(rates).map(|(w, k)| w * k[i]);
    terms.reduce(|sum, term| sum + term).unwrap_or_default()
}

/// The first n entries of each. A loop, as the compiler calls the closure of `map` instead.
#[inline(always)]
fn shortened<const R: usize>(mut rates: [&[f64]; R], n: usize) -> [&[f64]; R] {
    for k in &mut rates {
        *k = &k[..n];
    }
    rates
}

#[inline(always)]
fn in_blocks(values: &[f64]) -> &[[f64; BLOCK]] {
    values.as_chunks().0
}

#[inline(always)]
fn dot<const R: usize>(weights: [f64; R], rates: [f64; R]) -> f64 {
    let mut sum = weights[0] * rates[0];
    for r in 1..R {
        sum += weights[r] * rates[r];
    }
    sum
}
