//! A monitored function along a step as a power series.

use filippov_expr::Interval;

use super::certificate::Bound;
use crate::stepper::{shift, Expansion};
use crate::tolerances::{EPS, TAYLOR_LARGEST_ORDER};

/// Samples, and steps of Newton's method, in the search for about where a zero is.
const GUESS_SAMPLES: u32 = 3;
const GUESS_STEPS: u32 = 3;

/// Room for the coefficients of a step of the highest order.
pub type LongestSeries = [f64; MOST_COEFFICIENTS];
const MOST_COEFFICIENTS: usize = TAYLOR_LARGEST_ORDER + 1;

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

/// A polynomial in theta, lowest coefficient first; there is at least one, and no more than of a step.
#[derive(Clone, Copy, Debug)]
pub struct Series<'a>(&'a [f64]);

/// What is known about the zeros of a polynomial on [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Zeros {
    /// There is none: it is positive.
    Nowhere,
    /// There is exactly one, where it falls from positive to negative values; very roughly here.
    One(f64),
    /// Nothing.
    Unknown,
}

/// Where a zero is expected.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    /// About here.
    pub theta: f64,
    /// The slope there.
    pub slope: f64,
    /// The slope at 0.
    pub slope_at_start: f64,
}

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

    /// Is the polynomial positive on [0, 1] for its falling terms alone?
    pub fn is_far_from_zero(&self) -> bool {
        let falling: f64 = self.0[1..].iter().map(|c| c.min(0.0)).sum();
        self.0[0] + falling > 0.0
    }

    /// What is known about the zeros on [0, `to`], by the signs of the Bernstein coefficients there, which change at
    /// least as often as those of the polynomial (Descartes' rule).
    pub fn zeros(&self, to: f64) -> Zeros {
        let mut coefficients = LongestSeries::default();
        let b = &mut coefficients[..self.0.len()];
        // The coefficient of degree i is the sum of C(i, k)/C(n, k) c_k to^k.
        let degree = b.len() - 1;
        let (mut size, mut power) = (0.0, 1.0);
        let weights = &INVERSE_BINOMIALS[degree];
        for ((b, c), weight) in b.iter_mut().zip(self.0).zip(weights) {
            let c = c * power;
            size += c.abs();
            *b = weight * c;
            power *= to;
        }
        sum_binomially(b);
        if b.iter().all(|&b| b > 0.0) {
            return Zeros::Nowhere;
        }
        // Of the coefficient between the positive and the negative ones the sign may be lost in rounding.
        let noise = 16.0 * EPS * size;
        let positive = b.iter().take_while(|&&b| b > noise).count();
        let negative = b.iter().rev().take_while(|&&b| b < -noise).count();
        if positive == 0 || negative == 0 || positive + negative < degree {
            return Zeros::Unknown;
        }
        // Where the polygon of the coefficients falls through zero.
        let (left, right) = (positive - 1, degree + 1 - negative);
        let share = b[left] / (b[left] - b[right]) * (right - left) as f64;
        Zeros::One(to * (left as f64 + share) / degree as f64)
    }

    /// About where the polynomial, positive at 0, first falls through zero on [0, 1], found by a few samples and
    /// Newton's method; none if the samples show no zero.
    pub fn near_zero(&self) -> Option<Near> {
        let mut previous = self.0[0];
        for i in 1..=GUESS_SAMPLES {
            let theta = f64::from(i) / f64::from(GUESS_SAMPLES);
            let value = self.value(theta);
            if value <= 0.0 {
                let share = previous / (previous - value);
                let guess = theta - (1.0 - share) / f64::from(GUESS_SAMPLES);
                return self.newton(guess).map(|(theta, slope)| Near {
                    theta,
                    slope,
                    slope_at_start: self.0.get(1).copied().unwrap_or(0.0),
                });
            }
            previous = value;
        }
        None
    }

    /// The zero on [0, 1] that a few steps of Newton's method lead to, and the slope there.
    pub fn newton(&self, mut at: f64) -> Option<(f64, f64)> {
        let mut slope = f64::NAN;
        for _ in 0..GUESS_STEPS {
            let (value, here) = self.with_slope(at);
            slope = here;
            at -= value / slope;
        }
        (at > 0.0 && at <= 1.0).then_some((at, slope))
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
        let mut coefficients = Expansion::from_slice(self.0);
        let d = &mut coefficients[..];
        shift(d, 0.5 * (a + b));
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

#[cfg(test)]
mod tests {
    use super::{Series, Zeros};

    #[test]
    fn a_polynomial_is_above_what_it_stays_above() {
        // (theta - 0.4)^2 + d
        for (d, is_above) in [(0.05, true), (0.0, false), (-0.1, false)] {
            let coefficients = [0.16 + d, -0.8, 1.0];
            let series = Series::new(&coefficients);
            let lowest = (0..=100).map(|k| series.value(f64::from(k) * 0.01));
            assert_eq!(lowest.fold(f64::INFINITY, f64::min) > 1e-9, is_above);
            assert_eq!(series.zeros(1.0), Zeros::Unknown);
        }
        assert!(Series::new(&[1.0, -0.5, 1.0, -0.4]).is_far_from_zero());
        // Bernstein coefficients tell where the falling terms do not.
        let turning = [1.0, -1.5, 1.0, 0.0];
        let series = Series::new(&turning);
        assert!(!series.is_far_from_zero());
        assert_eq!(series.zeros(1.0), Zeros::Nowhere);
        assert_eq!(Series::new(&[1.0, -2.5, 1.6]).zeros(1.0), Zeros::Unknown);
    }

    #[test]
    fn one_change_of_sign_is_one_zero() {
        // (1 - 2 theta) (1 + theta + theta^2)
        let series = Series::new(&[1.0, -1.0, -1.0, -2.0]);
        let Zeros::One(guess) = series.zeros(1.0) else {
            panic!("not found");
        };
        let (zero, slope) = series.newton(guess).unwrap();
        // Three steps of Newton's method; the slope is that before the last.
        assert!((zero - 0.5).abs() < 1e-6 && (slope + 3.5).abs() < 1e-2);
        // Touching zero, or vanishing at an end, is not decided.
        for coefficients in [[0.25, -1.0, 1.0], [1.0, -1.0, 0.0], [0.0, 1.0, -2.0]] {
            assert_eq!(Series::new(&coefficients).zeros(1.0), Zeros::Unknown);
        }
    }

    #[test]
    fn of_several_zeros_the_first_is_told_apart() {
        // (0.3 - theta) (0.9 - theta)
        let coefficients = [0.27, -1.2, 1.0];
        let series = Series::new(&coefficients);
        assert_eq!(series.zeros(1.0), Zeros::Unknown);
        let Zeros::One(guess) = series.zeros(0.4) else {
            panic!("not found");
        };
        assert!((guess - 0.3).abs() < 0.1);
        assert_eq!(series.zeros(0.2), Zeros::Nowhere);
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
