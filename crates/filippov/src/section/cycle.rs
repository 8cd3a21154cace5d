//! When returns count as periodic.

use std::collections::VecDeque;

use super::observer::Return;
use crate::tolerances::LEAST_AGREEMENTS;

/// The test: returns number k and k - q agree, `q` times in a row (at least [`LEAST_AGREEMENTS`] times).
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
    /// Do two states agree?
    fn agree(&self, a: &[f64], b: &[f64]) -> bool {
        a.iter().zip(b).enumerate().all(|(i, (a, b))| {
            let modulus = self.moduli[i];
            let mut difference = a - b;
            let mut size = a.abs();
            if modulus > 0.0 {
                difference -= modulus * (difference / modulus).round();
                size = modulus;
            }
            difference.abs() <= self.atol[i] + self.rtol * size
        })
    }
}

/// How often in a row returns have agreed with those `q` before, q = 1, 2, ...
pub(super) struct Agreements {
    counts: Vec<u64>,
}

impl Agreements {
    pub fn new(longest: usize) -> Self {
        Agreements {
            counts: vec![0; longest],
        }
    }

    /// Takes the newest return, the last of `latest`; returns the period if there is one by now.
    pub fn take(&mut self, cycle: &Cycle, latest: &VecDeque<Return>) -> Option<usize> {
        let (newest, before) = (latest.back()?, latest.len() - 1);
        let mut period = None;
        for (index, count) in self.counts.iter_mut().enumerate() {
            let q = index + 1;
            if q > before {
                break;
            }
            let agrees = cycle.agree(&newest.y, &latest[before - q].y);
            *count = if agrees { *count + 1 } else { 0 };
            if period.is_none() && *count >= LEAST_AGREEMENTS.max(q as u64) {
                period = Some(q);
            }
        }
        period
    }
}
