//! A monitored function along a step as a power series.

use filippov_expr::Interval;

use super::certificate::Bound;
use crate::stepper::{shift, Expansion};
use crate::tolerances::EPS;

/// Samples, and steps of Newton's method, in the search for about where a zero is.
const GUESS_SAMPLES: u32 = 5;
const GUESS_STEPS: u32 = 3;

/// A polynomial in theta, lowest coefficient first; there is at least one.
#[derive(Clone, Copy, Debug)]
pub struct Series<'a>(&'a [f64]);

impl<'a> Series<'a> {
    /// The polynomial with these coefficients.
    pub fn new(coefficients: &'a [f64]) -> Self {
        Series(coefficients)
    }

    /// Divided by theta^order, the lower coefficients being zero.
    #[must_use]
    pub fn divided(self, order: usize) -> Self {
        Series(&self.0[order.min(self.0.len() - 1)..])
    }

    /// The value at theta.
    pub fn value(&self, theta: f64) -> f64 {
        self.0.iter().rev().fold(0.0, |value, c| value * theta + c)
    }

    /// Is the polynomial greater than `noise` on all of [0, 1]? Looks at the sum of its falling terms, then at
    /// its Bernstein coefficients; `false` may mean that they do not tell.
    pub fn is_above(&self, noise: f64) -> bool {
        let falling: f64 = self.0[1..].iter().map(|c| c.min(0.0)).sum();
        if self.0[0] + falling > noise {
            return true;
        }
        // The coefficient of degree i is the sum of C(i, k)/C(n, k) c_k: a triangle of differences.
        let mut b = Expansion::from_slice(self.0);
        let degree = b.len() - 1;
        let mut binomial = 1.0;
        for (k, b) in b.iter_mut().enumerate() {
            *b /= binomial;
            binomial *= (degree - k) as f64 / (k + 1) as f64;
        }
        for first in 0..degree {
            for k in (first..degree).rev() {
                b[k + 1] += b[k];
            }
            if first == 0 && b[degree] <= noise {
                return false;
            }
        }
        b.iter().all(|&b| b > noise)
    }

    /// About where the polynomial, positive at 0, first falls through zero on [0, 1], found by a few samples and
    /// Newton's method, and the slope there; none if the samples show no zero.
    pub fn near_zero(&self) -> Option<(f64, f64)> {
        let mut previous = self.0[0];
        for i in 1..=GUESS_SAMPLES {
            let theta = f64::from(i) / f64::from(GUESS_SAMPLES);
            let value = self.value(theta);
            if value <= 0.0 {
                let share = previous / (previous - value);
                let mut at = theta - (1.0 - share) / f64::from(GUESS_SAMPLES);
                let mut slope = f64::NAN;
                for _ in 0..GUESS_STEPS {
                    let (value, here) = self.with_slope(at);
                    slope = here;
                    at -= value / slope;
                }
                return (at > 0.0 && at <= 1.0).then_some((at, slope));
            }
            previous = value;
        }
        None
    }

    fn with_slope(&self, theta: f64) -> (f64, f64) {
        let (mut value, mut slope) = (0.0, 0.0);
        for c in self.0.iter().rev() {
            slope = slope * theta + value;
            value = value * theta + c;
        }
        (value, slope)
    }

    /// Bounds of value and slope from theta = `a` to `b`, rounding included.
    pub fn bound(&self, a: f64, b: f64) -> Bound {
        let mut d = Expansion::from_slice(self.0);
        shift(&mut d, 0.5 * (a + b));
        let radius = 0.5 * (b - a);
        let (mut spread, mut slope_spread, mut power, mut size) = (0.0, 0.0, 1.0, 0.0);
        for (k, c) in d.iter().enumerate().skip(1) {
            let magnitude = c.abs();
            if k > 1 {
                slope_spread += k as f64 * magnitude * power;
            }
            power *= radius;
            spread += magnitude * power;
            size += magnitude;
        }
        let slope = d.get(1).copied().unwrap_or(0.0);
        Bound {
            value: Interval::around(d[0], spread + 8.0 * EPS * (size + d[0].abs())),
            slope: Interval::around(slope, slope_spread + 16.0 * EPS * size),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Series;

    #[test]
    fn a_polynomial_is_above_what_it_stays_above() {
        // (theta - 0.4)^2 + d
        for (d, is_above) in [(0.05, true), (0.0, false), (-0.1, false)] {
            let coefficients = [0.16 + d, -0.8, 1.0];
            let series = Series::new(&coefficients);
            let lowest = (0..=100).map(|k| series.value(f64::from(k) * 0.01));
            assert_eq!(lowest.fold(f64::INFINITY, f64::min) > 1e-9, is_above);
            assert!(is_above || !series.is_above(1e-9));
        }
        // Bernstein coefficients tell where the falling terms do not.
        assert!(Series::new(&[1.0, -1.5, 1.0, 0.0]).is_above(0.0));
        assert!(!Series::new(&[1.0, -2.5, 1.0]).is_above(0.0));
    }

    #[test]
    fn bounds_hold_the_values_and_slopes_of_a_piece() {
        let series = Series::new(&[0.3, -1.0, 0.5, 2.0, -1.5]);
        for (a, b) in [(0.0, 1.0), (0.2, 0.3), (0.9, 1.0)] {
            let bound = series.bound(a, b);
            for k in 0..=20 {
                let (theta, d) = (a + (b - a) * f64::from(k) / 20.0, 1e-6);
                let slope = (series.value(theta + d) - series.value(theta - d)) / (2.0 * d);
                let value = series.value(theta);
                assert!(bound.value.lo <= value && value <= bound.value.hi);
                assert!(bound.slope.lo - 1e-8 <= slope && slope <= bound.slope.hi + 1e-8);
            }
        }
    }

    #[test]
    fn a_zero_at_the_start_is_divided_out() {
        let series = Series::new(&[0.0, 0.0, 2.0, 1.0]).divided(2);
        assert_eq!((series.value(0.0), series.value(1.0)), (2.0, 3.0));
    }
}
