//! A monitored function along a step as a power series.

use filippov_expr::Interval;
use smallvec::SmallVec;

use super::bernstein::{each_zero_between, first_zero_between, to_bernstein, HALVINGS};
use super::certificate::Bound;
use crate::stepper::{shift, Expansion};
use crate::tolerances::{EPS, REST_BESIDE, SAME_VALUE, SMALL_REST};

pub use super::bernstein::{FirstZero, LongestSeries, NO_TERMS};

/// Samples, and steps of Newton's method, in the search for about where a zero is.
const GUESS_SAMPLES: u32 = 3;
const GUESS_STEPS: u32 = 3;

/// How often a bracket of a zero is improved at most: Halley's method takes three steps, halving all others.
const ZERO_STEPS: u32 = 64;

/// A polynomial in theta, lowest coefficient first; there is at least one, and no more than of a step.
#[derive(Clone, Copy, Debug)]
pub struct Series<'a>(&'a [f64]);

/// How many terms stand for a polynomial on [0, 1], and how large the others may be together.
#[derive(Clone, Copy)]
struct FirstTerms {
    used: usize,
    rest: f64,
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

    /// The values at 0 and 1.
    pub fn ends(&self) -> [f64; 2] {
        [self.0[0], self.0.iter().sum()]
    }

    /// Is the polynomial `left` at 0 and `right` at 1, up to rounding?
    pub fn leads_between(&self, left: f64, right: f64) -> bool {
        let [start, end] = self.ends();
        let size: f64 = self.0.iter().map(|c| c.abs()).sum();
        (start - left).abs().max((end - right).abs()) <= SAME_VALUE * size
    }

    /// Is the polynomial above `margin` on [0, 1], as its falling terms tell, or its Bernstein coefficients?
    pub fn stays_above(&self, margin: f64) -> bool {
        let falling: f64 = self.0[1..].iter().map(|c| c.min(0.0)).sum();
        if self.0[0] + falling > margin {
            return true;
        }
        let first = self.first_terms(REST_BESIDE * (self.0[0] - margin));
        let mut coefficients = NO_TERMS;
        let b = &mut coefficients[..first.used];
        to_bernstein(self.0, b);
        b.iter().all(|&b| b > margin + first.rest)
    }

    /// All zeros on [0, 1], each within `width`, in order; none if its Bernstein coefficients do not tell them apart, or come
    /// within `noise` of zero.
    pub fn all_zeros(&self, noise: f64, width: f64) -> Option<SmallVec<[f64; 4]>> {
        let told = |spare: f64| self.zeros_by(self.first_terms(spare), noise, width);
        told(SMALL_REST * self.0[0].abs()).or_else(|| told(0.0))
    }

    /// The same by the signs of the first terms.
    fn zeros_by(&self, first: FirstTerms, noise: f64, width: f64) -> Option<SmallVec<[f64; 4]>> {
        let mut coefficients = NO_TERMS;
        let b = &mut coefficients[..first.used];
        to_bernstein(self.0, b);
        let (mut zeros, mut is_single) = (SmallVec::new(), true);
        let mut sign = self.0[0].signum();
        let mut add = |between, guess| {
            let (zero, slope) = self.only_zero(sign, between, guess, width);
            is_single &= self.is_single(slope, first.rest);
            zeros.push(zero);
            sign = -sign;
        };
        let is_told = each_zero_between(b, (0.0, 1.0), noise + first.rest, HALVINGS, &mut add);
        (is_told && is_single).then_some(zeros)
    }

    /// Is it beyond `margin` on the side of this sign, on [0, 1]?
    pub fn has_sign(&self, sign: f64, margin: f64) -> bool {
        if sign > 0.0 {
            return self.stays_above(margin);
        }
        let mut negated = NO_TERMS;
        let negated = &mut negated[..self.0.len()];
        negated.iter_mut().zip(self.0).for_each(|(n, c)| *n = -c);
        Series(negated).stays_above(margin)
    }

    /// The first terms: the others together are smaller than `spare` all along.
    fn first_terms(&self, spare: f64) -> FirstTerms {
        let (mut rest, mut used) = (0.0, self.0.len());
        while used > 2 {
            let with_last = rest + self.0[used - 1].abs();
            if with_last >= spare {
                break;
            }
            (rest, used) = (with_last, used - 1);
        }
        FirstTerms { used, rest }
    }

    /// The first zero on [0, 1] before `reach`, by the signs of the Bernstein coefficients, which change at least as
    /// often as those of the polynomial (Descartes' rule); where they say nothing, by those of the halves. The pieces do
    /// not depend on `reach`: neither does a zero. With it comes how large the last terms are together, which are left out
    /// if they are below `spare` times the first.
    ///
    /// What is told holds for every function within `margin` of the polynomial, but that it may have more zeros than one
    /// where the polynomial is as small as what was left out: see [`is_single`](Self::is_single).
    pub fn first_zero(&self, reach: f64, margin: f64, spare: f64) -> (FirstZero, f64) {
        let FirstTerms { used, rest } = self.first_terms(spare * self.0[0]);
        let mut coefficients = NO_TERMS;
        let b = &mut coefficients[..used];
        let size = to_bernstein(self.0, b);
        let doubt = margin + rest;
        if b.iter().all(|&b| b > doubt) {
            return (FirstZero::Nowhere, rest);
        }
        let noise = 16.0 * EPS * size + doubt;
        let found = first_zero_between(b, (0.0, 1.0), reach, noise, HALVINGS);
        (found, rest)
    }

    /// Is a zero with this slope the only one in the place where polynomials within `doubt` of this one have theirs?
    /// Within 4 doubt / slope of it the polynomial falls, and beyond that it is further than `doubt` from zero, if its
    /// second derivative is small enough.
    pub fn is_single(&self, slope: f64, doubt: f64) -> bool {
        // Sums of k (k - 1) |c_k|.
        let (mut bend, mut weight, mut step) = (0.0, 2.0, 4.0);
        for c in self.0.iter().skip(2) {
            bend += weight * c.abs();
            weight += step;
            step += 2.0;
        }
        8.0 * bend * doubt <= slope * slope
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

    /// The only zero between two points, before which the polynomial has this sign and behind it the other one, within
    /// `width` of it; and the slope there. By Halley's method from a guess, kept in the bracket: an error e becomes one of
    /// order e^3.
    pub fn only_zero(
        &self,
        sign: f64,
        (mut lo, mut hi): (f64, f64),
        guess: f64,
        width: f64,
    ) -> (f64, f64) {
        let (mut at, length) = (guess.clamp(lo, hi), hi - lo);
        let (mut slope, mut before) = (f64::NAN, f64::INFINITY);
        for _ in 0..ZERO_STEPS {
            let (value, here, half_bend) = self.with_bend(at);
            slope = here;
            if value == 0.0 {
                break;
            }
            if sign * value > 0.0 {
                lo = at;
            } else {
                hi = at;
            }
            let newton = value / slope;
            let bend = newton * half_bend / slope;
            let next = at - newton / (1.0 - bend);
            let step = (next - at).abs();
            let converges = bend.abs() < 0.25 && next >= lo && next <= hi && step <= 0.5 * before;
            let doubt = bend.abs() + step / length;
            if converges && step * doubt * doubt <= 0.125 * width {
                return (next, slope);
            }
            (at, before) = match converges {
                true => (next, step),
                false => (0.5 * (lo + hi), 0.5 * (hi - lo)),
            };
        }
        (at, slope)
    }

    /// Value, slope and half the second derivative.
    fn with_bend(&self, theta: f64) -> (f64, f64, f64) {
        let (mut value, mut slope, mut half_bend) = (0.0, 0.0, 0.0);
        for c in self.0.iter().rev() {
            half_bend = half_bend * theta + slope;
            slope = slope * theta + value;
            value = value * theta + c;
        }
        (value, slope, half_bend)
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

#[cfg(test)]
mod tests {
    use super::{FirstZero, Series};

    /// Numbers between 0 and 1.
    fn random_numbers(mut state: u64) -> impl FnMut() -> f64 {
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    #[test]
    fn a_polynomial_is_above_what_it_stays_above() {
        // (theta - 0.4)^2 + d
        for (d, is_above) in [(0.05, true), (0.0, false), (-0.1, false)] {
            let coefficients = [0.16 + d, -0.8, 1.0];
            let series = Series::new(&coefficients);
            let lowest = (0..=100).map(|k| series.value(f64::from(k) * 0.01));
            assert_eq!(lowest.fold(f64::INFINITY, f64::min) > 1e-9, is_above);
            let nowhere = series.first_zero(1.0, 0.0, 0.0).0 == FirstZero::Nowhere;
            assert_eq!(nowhere, is_above);
        }
        // Bernstein coefficients tell where the falling terms do not.
        let turning = [1.0, -1.5, 1.0, 0.0];
        let series = Series::new(&turning);
        assert!(series.stays_above(0.0) && !series.stays_above(0.5));
        assert_eq!(series.first_zero(1.0, 0.0, 0.0).0, FirstZero::Nowhere);
    }

    #[test]
    fn one_change_of_sign_is_one_zero() {
        // (1 - 2 theta) (1 + theta + theta^2)
        let series = Series::new(&[1.0, -1.0, -1.0, -2.0]);
        let FirstZero::Between { guess, .. } = series.first_zero(1.0, 0.0, 0.0).0 else {
            panic!("not found");
        };
        let (zero, slope) = series.newton(guess).unwrap();
        // Three steps of Newton's method; the slope is that before the last.
        assert!((zero - 0.5).abs() < 1e-6 && (slope + 3.5).abs() < 1e-2);
        // Touching zero, or vanishing at an end, is not decided.
        for coefficients in [[0.25, -1.0, 1.0], [1.0, -1.0, 0.0], [0.0, 1.0, -2.0]] {
            let series = Series::new(&coefficients);
            assert_eq!(series.first_zero(1.0, 0.0, 0.0).0, FirstZero::Unknown);
        }
    }

    #[test]
    fn all_zeros_are_told_apart_or_none_is() {
        let mut number = random_numbers(5);
        for _ in 0..500 {
            let mut roots: Vec<f64> = (0..4).map(|_| 1.4 * number() - 0.2).collect();
            roots.sort_by(f64::total_cmp);
            // With two complex ones.
            let mut coefficients = vec![1.3, -2.0 * number(), 1.0];
            for root in &roots {
                coefficients.push(0.0);
                for k in (1..coefficients.len()).rev() {
                    coefficients[k] = coefficients[k - 1] - root * coefficients[k];
                }
                coefficients[0] *= -root;
            }
            roots.retain(|root| (0.0..=1.0).contains(root));
            if let Some(zeros) = Series::new(&coefficients).all_zeros(1e-14, 1e-15) {
                assert_eq!(zeros.len(), roots.len(), "{roots:?}");
                assert!(zeros.iter().zip(&roots).all(|(a, b)| (a - b).abs() < 1e-9));
            } else {
                let all = [0.0, 1.0].iter().chain(&roots).copied();
                let mut gaps = all.clone().flat_map(|a| {
                    let all = all.clone();
                    all.map(move |b| (a - b).abs()).filter(|gap| *gap > 0.0)
                });
                assert!(gaps.any(|gap| gap < 1e-2), "{roots:?}");
            }
        }
        // A double zero, and one at an end.
        for coefficients in [[0.25, -1.0, 1.0], [1.0, -1.0, 0.0], [0.0, 1.0, -2.0]] {
            assert_eq!(Series::new(&coefficients).all_zeros(1e-14, 1e-15), None);
        }
    }

    #[test]
    fn of_several_zeros_the_first_is_told_apart() {
        // (0.3 - theta) (0.9 - theta)
        let coefficients = [0.27, -1.2, 1.0];
        let series = Series::new(&coefficients);
        let FirstZero::Between { lo, hi, guess } = series.first_zero(1.0, 0.0, 0.0).0 else {
            panic!("not found");
        };
        assert!(lo < 0.3 && 0.3 < hi && hi < 0.9 && (guess - 0.3).abs() < 0.2);
        assert_eq!(
            series.first_zero(0.2, 0.0, 0.0).0,
            series.first_zero(1.0, 0.0, 0.0).0
        );
        let late = [0.72, -1.7, 1.0]; // (0.8 - theta) (0.9 - theta)
        assert_eq!(
            Series::new(&late).first_zero(0.4, 0.0, 0.0).0,
            FirstZero::Nowhere
        );
        assert_eq!(
            Series::new(&[0.3, -1.2, 1.25]).first_zero(1.0, 0.0, 0.0).0,
            FirstZero::Nowhere
        );
    }

    /// Products (r1 - theta) ... (rn - theta), also with roots outside of [0, 1] and pairs of complex ones.
    #[test]
    fn the_first_zero_of_a_product_is_between_its_neighbours() {
        let mut random = random_numbers(1);
        let mut n_found = 0;
        for _ in 0..2000 {
            let mut coefficients = vec![1.0];
            let mut roots = Vec::new();
            for _ in 0..1 + (6.0 * random()) as usize {
                let (root, width) = (3.0 * random() - 1.0, random());
                let factor = if random() < 0.3 {
                    vec![root * root + width, -2.0 * root, 1.0]
                } else if root > 0.0 {
                    roots.push(root);
                    vec![root, -1.0]
                } else {
                    vec![-root, 1.0]
                };
                let mut product = vec![0.0; coefficients.len() + factor.len() - 1];
                for (i, c) in coefficients.iter().enumerate() {
                    for (k, f) in factor.iter().enumerate() {
                        product[i + k] += c * f;
                    }
                }
                coefficients = product;
            }
            roots.sort_by(f64::total_cmp);
            let inside: Vec<f64> = roots.into_iter().filter(|r| *r < 1.0).collect();
            match Series::new(&coefficients).first_zero(1.0, 0.0, 0.0).0 {
                FirstZero::Nowhere => assert!(inside.is_empty()),
                FirstZero::Between { lo, hi, guess } => {
                    n_found += 1;
                    assert!(lo < inside[0] && inside[0] < hi && lo <= guess && guess <= hi);
                    assert!(inside.get(1).is_none_or(|second| *second > hi));
                }
                FirstZero::Unknown => {}
            }
        }
        assert!(n_found > 800);
    }

    /// Products of random roots, with small terms of higher order that may make one zero into three.
    #[test]
    fn what_is_left_out_does_not_hide_a_zero() {
        let mut random = random_numbers(7);
        let (mut n_single, mut n_doubted) = (0, 0);
        for _ in 0..4000 {
            // A fall at `root`, flat there to some degree, and a wave of small size.
            let (root, flatness) = (0.3 + 0.4 * random(), 10_f64.powf(-8.0 * random()));
            let cubic = [
                root * root * root + flatness * root,
                -3.0 * root * root - flatness,
                3.0 * root,
                -1.0,
            ];
            let size = 10_f64.powf(-4.0 - 5.0 * random());
            let mut coefficients = cubic.to_vec();
            coefficients.extend((0..8).map(|_| size * (2.0 * random() - 1.0)));
            let series = Series::new(&coefficients);
            let (FirstZero::Between { lo, hi, guess }, rest) = series.first_zero(1.0, 0.0, 1e-3)
            else {
                continue;
            };
            let (zero, slope) = series.only_zero(1.0, (lo, hi), guess, 1e-15);
            if !series.is_single(slope, rest) {
                n_doubted += 1;
                continue;
            }
            n_single += 1;
            let is_right = |i: u32| {
                let theta = f64::from(i) / 2000.0;
                let clear = (theta - zero).abs() < 1e-9 || theta > hi;
                clear || (series.value(theta) > 0.0) == (theta < zero)
            };
            assert!((0..=2000).all(is_right));
        }
        assert!(n_single > 500 && n_doubted > 100);
    }

    #[test]
    fn the_only_zero_is_found_to_rounding() {
        // (1 - theta/r) (1 + theta^2), its factor also to the third power, and a wave around its bend.
        for root in [1e-3, 0.2, 0.5, 0.999] {
            let simple = [1.0, -1.0 / root, 1.0, -1.0 / root];
            let (zero, slope) = Series::new(&simple).only_zero(1.0, (0.0, 1.0), 0.7, 1e-16);
            assert!((zero - root).abs() < 1e-15 && slope < 0.0);
            let triple = [1.0, -3.0 / root, 3.0 / (root * root), -1.0 / root.powi(3)];
            let (zero, _) = Series::new(&triple).only_zero(1.0, (0.0, 1.0), 0.7, 1e-16);
            assert!((zero - root).abs() < 1e-4);
            let (zero, _) = Series::new(&triple).only_zero(1.0, (0.0, 1.0), root, 1e-16);
            assert!((zero - root).abs() < 1e-4);
        }
        let mut wave = [0.0; 24];
        let mut term = 1.0;
        for (k, c) in wave.iter_mut().enumerate() {
            // cos(3 theta), which has no second derivative where it vanishes.
            *c = [term, 0.0, -term, 0.0][k % 4];
            term *= 3.0 / (k + 1) as f64;
        }
        let (zero, slope) = Series::new(&wave).only_zero(1.0, (0.0, 1.0), 0.3, 1e-16);
        assert!((zero - std::f64::consts::FRAC_PI_6).abs() < 1e-15 && (slope + 3.0).abs() < 1e-9);
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
