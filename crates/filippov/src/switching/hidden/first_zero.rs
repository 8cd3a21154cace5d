//! The first time at which a polynomial becomes negative.

use smallvec::{smallvec, SmallVec};

use crate::tolerances::{SAME_NUMBER, ZERO_SEARCHES};

/// The first time in (0, end] at which `p`, not negative at 0, becomes negative. A zero at 0 itself is
/// divided out.
///
/// Intervals are excluded, or found to be monotone, by a bound of the derivative, and halved
/// otherwise: no pair of zeros is lost, except one nearer together than rounding. `tests` counts them.
pub(super) fn first_loss(p: &[f64], end: f64, tests: &mut usize) -> Option<f64> {
    if p[0] > largest_change(p, end) {
        return None;
    }
    let p = if p[0] > 0.0 { p } else { &p[1..] };
    if p[0] < 0.0 {
        return Some(0.0);
    }
    let mut pending: SmallVec<[(f64, f64); 8]> = smallvec![(0.0, end)];
    for _ in 0..ZERO_SEARCHES {
        let (a, b) = pending.pop()?;
        *tests += 1;
        match has_zero(p, a, b, end) {
            Some(false) => {}
            Some(true) => return Some(falling_zero(a, b, |t| (value(p, t), derivative(p, t)))),
            None => {
                let middle = 0.5 * (a + b);
                pending.extend([(middle, b), (a, middle)]);
            }
        }
    }
    None
}

/// A bound of how far p moves until `end`.
pub(super) fn largest_change(p: &[f64], end: f64) -> f64 {
    let terms = p[1..].iter().rev();
    terms.fold(0.0, |sum, c| sum * end + c.abs()) * end
}

/// Does p become negative in [a, b]? Known is p(a) >= 0; the derivative at the middle and a bound of the second one
/// settle most intervals.
fn has_zero(p: &[f64], a: f64, b: f64, end: f64) -> Option<bool> {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let slope = derivative(p, middle);
    let bend = bound_of_second_derivative(p, b);
    let lowest = value(p, middle) - slope.abs() * half - 0.5 * bend * half * half;
    if lowest > 0.0 {
        return Some(false);
    }
    let is_monotone = slope.abs() > bend * half;
    (is_monotone || b - a <= SAME_NUMBER * end).then(|| value(p, b) < 0.0)
}

/// The zero of a function that falls from `a` to `b`, from its values with their derivatives: Newton's steps that stay
/// inside, and the middle in the place of others.
pub(super) fn falling_zero(mut a: f64, mut b: f64, motion: impl Fn(f64) -> (f64, f64)) -> f64 {
    let mut t = 0.5 * (a + b);
    while a < t && t < b {
        let (value, slope) = motion(t);
        *(if value < 0.0 { &mut b } else { &mut a }) = t;
        let newton = t - value / slope;
        let is_inside = newton > a && newton < b;
        let next = if is_inside { newton } else { 0.5 * (a + b) };
        if (next - t).abs() <= f64::EPSILON * t {
            return next;
        }
        t = next;
    }
    b
}

/// p(t).
pub(super) fn value(p: &[f64], t: f64) -> f64 {
    p.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

fn derivative(p: &[f64], t: f64) -> f64 {
    let powers = p.iter().enumerate().skip(1).rev();
    powers.fold(0.0, |sum, (k, c)| sum * t + k as f64 * c)
}

fn bound_of_second_derivative(p: &[f64], t: f64) -> f64 {
    let powers = p.iter().enumerate().skip(2).rev();
    powers.fold(0.0, |sum, (k, c)| sum * t + (k * (k - 1)) as f64 * c.abs())
}
