//! How sliding on one surface begins where both fields are tangent to it.
//!
//! The multiplier is a quotient of two zeros there. Along a motion that follows the mixture of both fields with
//! lambda(t) = lambda_0 + lambda_1 t + .., a function g changes by dg/dt = w- L-g + w+ L+g with the shares
//! w∓ = (1 ∓ lambda) / 2. So coefficient n of L_w h, with w a word of fields, is
//!
//! ```text
//! n c(w, n) = sum over k < n of  w-_k c(w-, n - 1 - k) + w+_k c(w+, n - 1 - k),     c(w, 0) = L_w h
//! ```
//!
//! The motion slides if all coefficients of h vanish. The first whose words do not all vanish is a polynomial in lambda_0;
//! every further one is linear in the next lambda_k. The guards are the coefficients of L-h and L+h. If the second derivatives
//! do not vanish, the polynomial is the quadratic of Dieci and Lopez (2009), case IV.

use smallvec::{smallvec, SmallVec};

use super::leading::Leading;
use crate::error::FieldError;
use crate::powers::power;
use crate::system::{LieValue, PiecewiseSystem, Place};
use crate::tolerances::{AT_SIDE, DOUBTFUL, MAX_LIE_ORDER, MOST_HALVINGS, TANGENT};

/// A sliding motion through a two-fold. It starts there if it attracts. If it repels it is a solution too, but one that may
/// leave to either side at any time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoFoldMotion {
    /// The share of f+ at the start, in [0, 1].
    pub weight: f64,
    /// lambda(t) in powers of the time since the start, as far as it was needed: in several powers if the normal components
    /// begin with higher ones of time, so that the quotient is lost in rounding for a while.
    series: [f64; MAX_LIE_ORDER],
    n_known: usize,
    /// The first derivative of the normal component of f- that does not vanish along the motion; order 0 if none is known.
    pub minus: Leading,
    /// The same of f+.
    pub plus: Leading,
}

impl TwoFoldMotion {
    /// Do both fields point to the surface along it?
    pub fn attracts(&self) -> bool {
        self.minus.sign() > 0 && self.plus.sign() < 0
    }

    /// Do both fields point away from the surface along it?
    pub fn repels(&self) -> bool {
        self.minus.sign() < 0 && self.plus.sign() > 0
    }

    /// lambda at the two-fold.
    pub fn multiplier(&self) -> f64 {
        2.0 * self.weight - 1.0
    }

    /// The share of f+, and the normal components, this time after the start.
    pub fn after(&self, time: f64) -> (f64, [f64; 2]) {
        let known = self.series[..self.n_known].iter().rev();
        let lambda = known.fold(0.0, |sum, coefficient| sum * time + coefficient);
        let component = |first: Leading| first.coefficient() * time.powi(first.order as i32);
        (
            0.5 * (1.0 + lambda),
            [component(self.minus), component(self.plus)],
        )
    }

    /// How long the series of the multiplier has no larger error than this.
    pub fn reach(&self, tolerance: f64) -> f64 {
        let last = self.n_known.saturating_sub(2).max(1)..self.n_known.max(1);
        let reach = |k: usize| power(tolerance / self.series[k].abs(), 1.0 / k as f64);
        match self.n_known {
            ..=1 => 0.0,
            _ => last.map(reach).fold(f64::INFINITY, f64::min),
        }
    }
}

/// A point where both fields are tangent to surface `j`.
pub struct TwoFold<'s> {
    at: TangentPoint<'s>,
    /// The derivatives of h.
    own: Words,
}

/// Where both fields are tangent.
struct TangentPoint<'s> {
    system: &'s dyn PiecewiseSystem,
    j: usize,
    place: Place<'s>,
    /// Words of h of so many letters are known to vanish.
    known: usize,
    /// As do those below this part of the largest of as many letters.
    noise: f64,
    highest: usize,
}

/// The derivatives of one function along words of both fields, by length and letters: the first one is the highest bit.
struct Words {
    surface: usize,
    values: Vec<Vec<LieValue>>,
}

/// A word: how many letters, and which.
type Word = (usize, usize);

const EMPTY: Word = (0, 0);

fn with_letter((length, bits): Word, letter: usize) -> Word {
    (length + 1, 2 * bits + letter)
}

impl<'s> TwoFold<'s> {
    /// `known` derivatives along both fields are known to vanish.
    pub fn new(system: &'s dyn PiecewiseSystem, j: usize, known: usize, place: Place<'s>) -> Self {
        let at = TangentPoint {
            system,
            j,
            place,
            known: known.max(1),
            noise: TANGENT,
            highest: system.max_lie_order().min(MAX_LIE_ORDER),
        };
        let own = Words::of(j);
        TwoFold { at, own }
    }

    /// The same at a located event, where the fields are known less well.
    #[must_use]
    pub fn located(mut self) -> Self {
        self.at.noise = DOUBTFUL;
        self
    }

    /// The rate at which h grows along the mean of both fields, in the first order in which they leave the surface; zero if it
    /// is not clear of rounding.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn rate_of_mean(&mut self) -> Result<f64, FieldError> {
        let Some(length) = self.first_length()? else {
            return Ok(0.0);
        };
        let mean = self.own.coefficient(EMPTY, length, &[0.0]);
        let is_clear = mean.value.abs() > self.at.system.lie_tolerance(length) * mean.magnitude;
        Ok(if is_clear { mean.value } else { 0.0 })
    }

    /// Are the first derivatives of h finite that do not vanish? Those of (h_k)^1.5 on h_k = 0 are not. A root is steep at once, and
    /// holds no motion.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn is_regular(&mut self) -> Result<bool, FieldError> {
        let steepest = self.at.known + 1;
        let first = self.first_length()?.filter(|length| *length > steepest);
        let words = first.map_or(&[][..], |length| &self.own.values[length]);
        Ok(words.iter().all(|lie| lie.value.is_finite()))
    }

    /// All sliding motions from here.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn motions(&mut self) -> Result<SmallVec<[TwoFoldMotion; 2]>, FieldError> {
        let mut found = SmallVec::new();
        for weight in self.weights()? {
            let mut lambda: SmallVec<[f64; 6]> = smallvec![2.0 * weight - 1.0];
            let minus = self.first_of_component(0, &mut lambda)?;
            let plus = self.first_of_component(1, &mut lambda)?;
            // With a whole share of one field, along which both components stay zero, it is the motion of a region.
            let is_region = (minus.order, plus.order) == (0, 0) && (weight == 0.0 || weight == 1.0);
            if is_region {
                continue;
            }
            if minus.order.max(plus.order) > 1 || self.neighbours_leave(lambda[0])? {
                while self.continue_series(&mut lambda)? {}
            }
            let mut series = [0.0; MAX_LIE_ORDER];
            let n_known = lambda.len().min(series.len());
            series[..n_known].copy_from_slice(&lambda[..n_known]);
            found.push(TwoFoldMotion {
                weight,
                series,
                n_known,
                minus,
                plus,
            });
        }
        Ok(found)
    }

    /// Do motions with other multipliers near this one move away from it? Then the quotient does not keep to it: with U its value
    /// along a motion of constant multiplier, t dlambda/dt = U - lambda.
    fn neighbours_leave(&mut self, lambda: f64) -> Result<bool, FieldError> {
        let Some(length) = self.first_length()? else {
            return Ok(false);
        };
        let of = |lambda: f64| self.own.coefficient(EMPTY, length, &[lambda]).value;
        Ok(of(lambda + AT_SIDE) > of(lambda - AT_SIDE))
    }

    /// The first derivative of h_i that does not vanish along a motion; order 0 if none is known.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn first_along(&mut self, i: usize, motion: &TwoFoldMotion) -> Result<Leading, FieldError> {
        let mut words = Words::of(i);
        let mut lambda: SmallVec<[f64; 6]> = smallvec![motion.multiplier()];
        let mut factorial = 1.0;
        for n in 1..=self.at.highest {
            factorial *= n as f64;
            if lambda.len() < n && !self.continue_series(&mut lambda)? {
                break;
            }
            words.fill(&self.at, n)?;
            let term = words.coefficient(EMPTY, n, &lambda);
            if term.value.abs() > self.at.system.lie_tolerance(n) * term.magnitude {
                let value = factorial * term.value;
                return Ok(Leading { order: n, value });
            }
        }
        Ok(NONE)
    }

    /// The length of the shortest words that do not vanish.
    fn first_length(&mut self) -> Result<Option<usize>, FieldError> {
        for length in self.at.known + 1..=self.at.highest {
            self.own.fill(&self.at, length)?;
            let mut words = self.own.values[length].iter();
            if words.any(|lie| lie.value != 0.0) {
                return Ok(Some(length));
            }
        }
        Ok(None)
    }

    /// The shares of f+ with which a motion can begin to slide.
    fn weights(&mut self) -> Result<SmallVec<[f64; 4]>, FieldError> {
        let Some(length) = self.first_length()? else {
            return Ok(SmallVec::new());
        };
        let mut by_letters = vec![0.0; length + 1];
        for (bits, lie) in self.own.values[length].iter().enumerate() {
            by_letters[bits.count_ones() as usize] += lie.value;
        }
        Ok(roots(&by_letters))
    }

    /// The first derivative of the normal component of f- (letter 0) or f+ that does not vanish along a motion, whose
    /// multiplier is found as far as it is needed.
    fn first_of_component(
        &mut self,
        letter: usize,
        lambda: &mut SmallVec<[f64; 6]>,
    ) -> Result<Leading, FieldError> {
        let first = self.first_length()?.unwrap_or(0);
        for n in first.saturating_sub(1)..self.at.highest {
            while lambda.len() + first < n + 2 {
                if !self.continue_series(lambda)? {
                    return Ok(NONE);
                }
            }
            self.own.fill(&self.at, n + 1)?;
            let term = self.own.coefficient(with_letter(EMPTY, letter), n, lambda);
            if term.value.abs() > self.at.system.lie_tolerance(n + 1) * term.magnitude {
                let value = (1..=n).fold(term.value, |value, k| value * k as f64);
                return Ok(Leading { order: n, value });
            }
        }
        Ok(NONE)
    }

    /// Finds the next coefficient of the multiplier; `false` if it is not determined.
    fn continue_series(&mut self, lambda: &mut SmallVec<[f64; 6]>) -> Result<bool, FieldError> {
        let Some(first) = self.first_length()? else {
            return Ok(false);
        };
        let n = first + lambda.len();
        if n > self.at.highest {
            return Ok(false);
        }
        self.own.fill(&self.at, n)?;
        lambda.push(0.0);
        let without = self.own.coefficient(EMPTY, n, lambda);
        *lambda.last_mut().expect("it was just added") = 1.0;
        let with = self.own.coefficient(EMPTY, n, lambda);
        let slope = with.value - without.value;
        let is_determined = slope.abs() > TANGENT * with.magnitude;
        lambda.pop();
        if is_determined {
            lambda.push(-without.value / slope);
        }
        Ok(is_determined)
    }
}

const NONE: Leading = Leading {
    order: 0,
    value: 0.0,
};

impl Words {
    fn of(surface: usize) -> Self {
        Words {
            surface,
            values: Vec::new(),
        }
    }

    /// Finds all words up to a length; those within rounding of zero are zero.
    fn fill(&mut self, at: &TangentPoint<'_>, length: usize) -> Result<(), FieldError> {
        for length in self.values.len()..=length {
            let known = if self.surface == at.j { at.known } else { 0 };
            let mut row = Vec::with_capacity(1 << length);
            for bits in 0..1_usize << length {
                let letter = |k: usize| if bits >> k & 1 == 1 { 1 } else { -1 };
                let word: SmallVec<[i8; 8]> = (0..length).rev().map(letter).collect();
                let mut lie = LieValue {
                    value: 0.0,
                    magnitude: 0.0,
                };
                if length > known {
                    let (i, j) = (self.surface, at.j);
                    lie = at.system.lie_derivative(i, j, &word, &at.place)?;
                    if lie.value.abs() <= at.system.lie_tolerance(length) * lie.magnitude {
                        lie.value = 0.0;
                    }
                }
                row.push(lie);
            }
            let largest = row.iter().fold(0.0_f64, |m, lie| m.max(lie.value.abs()));
            for lie in &mut row {
                if lie.value.abs() <= at.noise * largest {
                    lie.value = 0.0;
                }
            }
            self.values.push(row);
        }
        Ok(())
    }

    /// Coefficient n of a word along the motion with this multiplier, with a bound of the terms that it is made of.
    fn coefficient(&self, word: Word, n: usize, lambda: &[f64]) -> LieValue {
        if n == 0 {
            return self.values[word.0][word.1];
        }
        let (mut value, mut magnitude) = (0.0, 0.0);
        for (k, coefficient) in lambda.iter().enumerate().take(n) {
            let still = if k == 0 { 0.5 } else { 0.0 };
            let shares = [still - 0.5 * coefficient, still + 0.5 * coefficient];
            for (letter, share) in shares.into_iter().enumerate() {
                if share != 0.0 {
                    let inner = self.coefficient(with_letter(word, letter), n - 1 - k, lambda);
                    value += share * inner.value;
                    magnitude += share.abs() * inner.magnitude;
                }
            }
        }
        LieValue {
            value: value / n as f64,
            magnitude: magnitude / n as f64,
        }
    }
}

/// The zeros in [0, 1] of the sum of b_m w^m (1 - w)^(n - m).
fn roots(b: &[f64]) -> SmallVec<[f64; 4]> {
    let mut found = SmallVec::new();
    let is_there = |b: &f64| *b != 0.0;
    let (Some(first), Some(last)) = (b.iter().position(is_there), b.iter().rposition(is_there))
    else {
        return found;
    };
    if first > 0 {
        found.push(0.0);
    }
    found.extend(roots_inside(&b[first..=last]));
    if last + 1 < b.len() {
        found.push(1.0);
    }
    found
}

/// Those in (0, 1) at which the sum changes its sign, if b does not end with zeros.
fn roots_inside(b: &[f64]) -> SmallVec<[f64; 4]> {
    let zeros = zeros_inside(b);
    let is_positive_beside = |k: usize| {
        let left = if k == 0 { 0.0 } else { zeros[k - 1] };
        let right = zeros.get(k).copied().unwrap_or(1.0);
        sum_at(b, 0.5 * (left + right)).value > 0.0
    };
    let changes = |k: &usize| is_positive_beside(*k) != is_positive_beside(k + 1);
    (0..zeros.len()).filter(changes).map(|k| zeros[k]).collect()
}

/// All zeros in (0, 1), in increasing order. A multiple one is where the derivative vanishes too: halvings would find it
/// to a few digits only.
fn zeros_inside(b: &[f64]) -> SmallVec<[f64; 4]> {
    let has_both_signs = b.iter().any(|b| *b > 0.0) && b.iter().any(|b| *b < 0.0);
    if !has_both_signs {
        return SmallVec::new();
    }
    let n = b.len() - 1;
    let slopes: SmallVec<[f64; 8]> = (0..n)
        .map(|m| (m + 1) as f64 * b[m + 1] - (n - m) as f64 * b[m])
        .collect();
    let sign = |w: f64| {
        let LieValue { value, magnitude } = sum_at(b, w);
        match value.abs() > TANGENT * magnitude {
            true => value.signum(),
            false => 0.0,
        }
    };
    let mut found = SmallVec::new();
    let mut low = 0.0;
    for end in zeros_inside(&slopes).into_iter().chain([1.0]) {
        if sign(low) * sign(end) < 0.0 {
            let (mut left, mut right) = (low, end);
            for _ in 0..MOST_HALVINGS {
                let middle = 0.5 * (left + right);
                if middle <= left || middle >= right {
                    break;
                }
                match sum_at(b, left).value * sum_at(b, middle).value > 0.0 {
                    true => left = middle,
                    false => right = middle,
                }
            }
            found.push(0.5 * (left + right));
        } else if sign(end) == 0.0 && end < 1.0 {
            found.push(end);
        }
        low = end;
    }
    found
}

/// The sum of b_m w^m (1 - w)^(n - m), and that of the magnitudes of its terms.
fn sum_at(b: &[f64], w: f64) -> LieValue {
    let n = b.len() - 1;
    let terms = b.iter().enumerate();
    let terms = terms.map(|(m, b)| b * w.powi(m as i32) * (1.0 - w).powi((n - m) as i32));
    terms.fold(
        LieValue {
            value: 0.0,
            magnitude: 0.0,
        },
        |sum, term| LieValue {
            value: sum.value + term,
            magnitude: sum.magnitude + term.abs(),
        },
    )
}

#[cfg(test)]
mod tests {
    use super::roots;

    /// The Bernstein form of a product of factors a w + b (1 - w), without the binomial coefficients.
    fn product(factors: &[(f64, f64)]) -> Vec<f64> {
        factors.iter().fold(vec![1.0], |b, (a, c)| {
            let mut product = vec![0.0; b.len() + 1];
            for (m, b) in b.iter().enumerate() {
                product[m] += c * b;
                product[m + 1] += a * b;
            }
            product
        })
    }

    fn assert_roots(factors: &[(f64, f64)], expected: &[f64]) {
        let found = roots(&product(factors));
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
    }

    #[test]
    fn roots_are_where_the_sum_changes_its_sign() {
        let (a, b) = ((3.0, -1.0), (0.3, -0.4));
        assert_roots(&[a, b], &[0.25, 4.0 / 7.0]);
        assert_roots(&[a, a, b], &[4.0 / 7.0]);
        assert_roots(&[a, a, a], &[0.25]);
        assert_roots(&[a, b, a, a], &[0.25, 4.0 / 7.0]);
        assert_roots(&[(0.14, -0.49); 3], &[7.0 / 9.0]);
        assert_roots(&[(0.14, -0.49); 5], &[7.0 / 9.0]);
        assert_roots(&[(1.0, 0.0), a], &[0.0, 0.25]);
    }
}
