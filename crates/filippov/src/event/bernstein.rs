//! Polynomials on an interval by their Bernstein coefficients, which change their sign at least as often (Descartes' rule).

use crate::tolerances::TAYLOR_LARGEST_ORDER;

/// Room for the coefficients of a step of the highest order.
pub type LongestSeries = [f64; MOST_COEFFICIENTS];
const MOST_COEFFICIENTS: usize = TAYLOR_LARGEST_ORDER + 1;
/// Room that is yet empty.
pub const NO_TERMS: LongestSeries = [0.0; MOST_COEFFICIENTS];

/// 1 / C(n, k) for every degree n.
const INVERSE_BINOMIALS: [LongestSeries; MOST_COEFFICIENTS] = {
    let mut table = [[1.0; MOST_COEFFICIENTS]; MOST_COEFFICIENTS];
    let mut n = 0;
    while n < MOST_COEFFICIENTS {
        let mut k = 0;
        while k < n {
            table[n][k + 1] = table[n][k] * (k + 1) as f64 / (n - k) as f64;
            k += 1;
        }
        n += 1;
    }
    table
};

/// How often an interval is halved whose coefficients do not tell its zeros apart: a long step has a few, and comes near
/// to others.
pub(super) const HALVINGS: u32 = 10;

/// What is known about the first zero of a polynomial that is positive at 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FirstZero {
    /// There is none: it is positive.
    Nowhere,
    /// Between `lo` and `hi` it falls from positive to negative values, once; before there is no zero.
    Between {
        /// Where it is positive.
        lo: f64,
        /// Where it is negative.
        hi: f64,
        /// Very roughly where it vanishes.
        guess: f64,
    },
    /// Nothing.
    Unknown,
}

/// The Bernstein coefficients, as many as `b` has, of the first coefficients of a polynomial; returns the sum of the sizes
/// of these. Most steps call this function once per surface; inlined, it takes 8 % fewer instructions.
#[inline(always)]
pub(super) fn to_bernstein(coefficients: &[f64], b: &mut [f64]) -> f64 {
    // The coefficient of degree i is the sum of C(i, k)/C(n, k) c_k.
    let mut size = 0.0;
    let weights = &INVERSE_BINOMIALS[b.len() - 1];
    for ((b, c), weight) in b.iter_mut().zip(coefficients).zip(weights) {
        size += c.abs();
        *b = weight * c;
    }
    sum_binomially(b);
    size
}

/// The first zero of a polynomial with Bernstein coefficients `b` from `lo` to `hi`. Of a coefficient within `noise` of
/// zero the sign may be lost in rounding: between the positive and the negative ones there may be one. From `reach` on
/// nothing is looked for.
pub(super) fn first_zero_between(
    b: &mut [f64],
    (lo, hi): (f64, f64),
    reach: f64,
    noise: f64,
    halvings: u32,
) -> FirstZero {
    if lo >= reach {
        return FirstZero::Nowhere;
    }
    let positive = b.iter().take_while(|&&b| b > noise).count();
    if positive == b.len() {
        return FirstZero::Nowhere;
    }
    if positive == 0 {
        return FirstZero::Unknown;
    }
    if let Some(found) = only_change(b, positive, (lo, hi), noise) {
        return found;
    }
    if halvings == 0 {
        return FirstZero::Unknown;
    }
    let mut first = NO_TERMS;
    let first = &mut first[..b.len()];
    first.copy_from_slice(b);
    halve(first);
    let middle = 0.5 * (lo + hi);
    match first_zero_between(first, (lo, middle), reach, noise, halvings - 1) {
        FirstZero::Nowhere => {
            b.reverse();
            halve(b);
            b.reverse();
            first_zero_between(b, (middle, hi), reach, noise, halvings - 1)
        }
        found => found,
    }
}

/// The zero of a polynomial with Bernstein coefficients `b` from `lo` to `hi`, the first `positive` of which are, if they change
/// their sign once. One coefficient within `noise` of zero may be among those that do.
fn only_change(b: &[f64], positive: usize, (lo, hi): (f64, f64), noise: f64) -> Option<FirstZero> {
    let degree = b.len() - 1;
    let negative = b.iter().rev().take_while(|&&b| b < -noise).count();
    if negative == 0 || positive + negative < degree {
        return None;
    }
    // Where the polygon of the coefficients falls through zero.
    let (left, right) = (positive - 1, degree + 1 - negative);
    let share = b[left] / (b[left] - b[right]) * (right - left) as f64;
    let guess = lo + (hi - lo) * (left as f64 + share) / degree as f64;
    Some(FirstZero::Between { lo, hi, guess })
}

/// Calls `found` with (lo, hi) and about where each zero is of a polynomial with Bernstein coefficients `b` from `lo` to
/// `hi`: between these two it is the only one. False if the signs do not tell, or some are within `noise` of zero.
pub(super) fn each_zero_between(
    b: &mut [f64],
    (lo, hi): (f64, f64),
    noise: f64,
    halvings: u32,
    found: &mut impl FnMut((f64, f64), f64),
) -> bool {
    let sign = b[0].signum();
    b.iter_mut().for_each(|b| *b *= sign);
    let positive = b.iter().take_while(|&&b| b > noise).count();
    if positive == b.len() {
        return true;
    }
    if positive == 0 {
        return false;
    }
    if let Some(FirstZero::Between { guess, .. }) = only_change(b, positive, (lo, hi), noise) {
        found((lo, hi), guess);
        return true;
    }
    if halvings == 0 {
        return false;
    }
    let mut first = NO_TERMS;
    let first = &mut first[..b.len()];
    first.copy_from_slice(b);
    halve(first);
    b.reverse();
    halve(b);
    b.reverse();
    let middle = 0.5 * (lo + hi);
    each_zero_between(first, (lo, middle), noise, halvings - 1, found)
        && each_zero_between(b, (middle, hi), noise, halvings - 1, found)
}

/// Makes Bernstein coefficients those of the first half, and reversed ones those of the second: de Casteljau's means of
/// neighbours, halved at the end.
fn halve(b: &mut [f64]) {
    sum_binomially(b);
    let mut scale = 1.0;
    for b in b {
        *b *= scale;
        scale *= 0.5;
    }
}

/// Rows of the triangle that are summed at a time.
const ROWS: usize = 4;

/// Makes entry i the sum of C(i, k) b_k: a triangle of sums of neighbours, some rows of it at a time.
fn sum_binomially(mut b: &mut [f64]) {
    while b.len() > 1 {
        let end = ROWS.min(b.len());
        let (first, rest) = std::mem::take(&mut b).split_at_mut(end);
        // The entry before in each row.
        let mut before = [0.0; ROWS];
        for (i, entry) in first.iter_mut().enumerate() {
            for neighbour in &mut before[..i] {
                *entry += std::mem::replace(neighbour, *entry);
            }
            before[i] = *entry;
        }
        for entry in rest.iter_mut() {
            let mut sum = *entry;
            for neighbour in &mut before {
                sum += std::mem::replace(neighbour, sum);
            }
            *entry = sum;
        }
        b = rest;
    }
}
