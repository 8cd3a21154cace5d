//! When returns count as periodic.

use std::collections::VecDeque;

use super::returns::Return;
use crate::tolerances::{COMING_TOGETHER, LEAST_AGREEMENTS};

/// The test: returns number k and k - q agree, `q` times in a row (at least [`LEAST_AGREEMENTS`] times), and those
/// between do not come together.
///
/// Returns that come to an orbit of period p from alternating sides (a negative multiplier), or turn around it, agree
/// with those q before, q a multiple of p, long before they agree with those p before. Their distances at lag p then
/// shrink geometrically; the limit of these distances, by Aitken's extrapolation from three of them q returns apart,
/// says whether q is the period of the orbit or only of the way to it.
///
/// Two states agree if every component differs by at most `atol + rtol * |x|`. It is a heuristic: an orbit that
/// drifts by less than that from one return to the next counts as periodic.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// Relative tolerance.
    pub rtol: f64,
    /// Absolute tolerance per component.
    pub atol: Vec<f64>,
    /// Components that count up to a multiple of this, angles and phases; 0 for all others.
    pub moduli: Vec<f64>,
    /// The longest period that is looked for.
    pub longest: usize,
    /// Does the run end there?
    pub ends_run: bool,
}

impl Cycle {
    /// The period of the latest returns, the newest last, if there is one by now.
    pub(super) fn period(&self, latest: &VecDeque<Return>) -> Option<usize> {
        // A longer one would need more returns than there are.
        let longest = self.longest.min(latest.len() / 2);
        (1..=longest).find(|&q| self.repeats(q, latest) && self.is_settled(q, latest))
    }

    /// Do as many returns in a row agree with those `q` before as have to?
    fn repeats(&self, q: usize, latest: &VecDeque<Return>) -> bool {
        let in_a_row = q.max(LEAST_AGREEMENTS);
        if latest.len() < in_a_row + q {
            return false;
        }
        let before = latest.iter().rev().skip(q);
        let mut pairs = latest.iter().rev().zip(before).take(in_a_row);
        pairs.all(|(a, b)| self.agree(&a.y, &b.y))
    }

    /// Do two states agree?
    fn agree(&self, a: &[f64], b: &[f64]) -> bool {
        (0..a.len()).all(|i| self.apart(i, a[i], b[i]) <= 1.0)
    }

    /// The largest difference of two states, in units of what counts as agreement.
    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let apart = (0..a.len()).map(|i| self.apart(i, a[i], b[i]));
        apart.fold(0.0, f64::max)
    }

    /// The difference of component i in these units. That of what is not finite is no number: it does not agree.
    fn apart(&self, i: usize, a: f64, b: f64) -> f64 {
        let modulus = self.moduli[i];
        let mut difference = a - b;
        let mut size = a.abs();
        if modulus > 0.0 {
            difference -= modulus * (difference / modulus).round();
            size = modulus;
        }
        if difference == 0.0 {
            return 0.0;
        }
        difference.abs() / (self.atol[i] + self.rtol * size)
    }

    /// Is `q` the period, and not a divisor of it, to which the returns still come together?
    fn is_settled(&self, q: usize, latest: &VecDeque<Return>) -> bool {
        let divisors = (1..q).filter(|p| q.is_multiple_of(*p));
        divisors.into_iter().all(|p| {
            let Some(newest) = latest.len().checked_sub(1).filter(|&k| k + 1 >= 3 * q + p) else {
                return false;
            };
            // The largest distance over one period: single ones may vanish.
            let spread = |end: usize| {
                let distance = |k: usize| self.distance(&latest[k].y, &latest[k - p].y);
                (0..q).map(|k| distance(end - k)).fold(0.0, f64::max)
            };
            let spreads = [2 * q, q, 0].map(|back| spread(newest - back));
            !comes_to_zero(spreads)
        })
    }
}

/// Do these distances shrink to less than half of the last one, if they go on geometrically?
fn comes_to_zero([a, b, c]: [f64; 3]) -> bool {
    let (first, second) = (a - b, b - c);
    if second <= 0.0 || first <= 0.0 {
        return false;
    }
    let ratio = second / first;
    if ratio >= 1.0 {
        // Far from the orbit, or rounding.
        return second > COMING_TOGETHER * c;
    }
    second * ratio / (1.0 - ratio) > 0.5 * c
}
