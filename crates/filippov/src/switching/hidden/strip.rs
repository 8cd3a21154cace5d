//! Hidden dynamics of two surfaces where one component is clipped, in closed form.

use crate::tolerances::MOST_HALVINGS;

/// The motion s' = alpha + beta s, w' = p + q s from (s, w): s the component within the transition,
/// w >= 0 the distance of the other one to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strip {
    pub s: f64,
    pub w: f64,
    pub alpha: f64,
    pub beta: f64,
    pub p: f64,
    pub q: f64,
}

/// How the motion leaves a strip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum StripEnd {
    /// s reaches its border; w is left.
    Across {
        /// The border.
        s: f64,
        /// The other component there.
        w: f64,
    },
    /// w reaches 0.
    Inwards {
        /// s there.
        s: f64,
    },
    /// Never: s tends to this value, and w grows.
    Outwards {
        /// The limit of s.
        s: f64,
    },
    /// Never: s tends to a value at which w does not change.
    AtRest,
}

impl Strip {
    /// Follows the motion until s reaches `low` or `high`, or w reaches 0.
    pub fn pass(&self, low: f64, high: f64) -> StripEnd {
        let velocity = self.alpha + self.beta * self.s;
        let border = if velocity > 0.0 { high } else { low };
        let end = self.time_to(border);
        let s_end = if end.is_finite() {
            border
        } else if velocity == 0.0 {
            self.s
        } else {
            -self.alpha / self.beta
        };
        // w' is monotone in s, and s in time.
        let (first, last) = (self.p + self.q * self.s, self.p + self.q * s_end);
        let turn = if first * last < 0.0 {
            self.time_to(-self.p / self.q).min(end)
        } else {
            0.0
        };
        let falls = match (first < 0.0, last < 0.0) {
            (true, false) if last == 0.0 => Some((0.0, end)),
            (true, false) => Some((0.0, turn)),
            (false, true) => Some((turn, end)),
            (true, true) => Some((0.0, end)),
            (false, false) => None,
        };
        if let Some(t) = falls.and_then(|(from, to)| self.time_of_return(from, to, last)) {
            return StripEnd::Inwards { s: self.s_at(t) };
        }
        if end.is_finite() {
            let w = self.w_at(end).max(0.0);
            StripEnd::Across { s: border, w }
        } else if last > 0.0 {
            StripEnd::Outwards { s: s_end }
        } else {
            StripEnd::AtRest
        }
    }

    /// When s passes this value: infinite if never.
    fn time_to(&self, s: f64) -> f64 {
        let theta = (s - self.s) / (self.alpha + self.beta * self.s);
        let z = self.beta * theta;
        if !theta.is_finite() || theta < 0.0 || z <= -1.0 {
            f64::INFINITY
        } else if z == 0.0 {
            theta
        } else {
            z.ln_1p() / self.beta
        }
    }

    fn s_at(&self, t: f64) -> f64 {
        self.s + (self.alpha + self.beta * self.s) * self.phi(t)
    }

    fn w_at(&self, t: f64) -> f64 {
        let velocity = self.alpha + self.beta * self.s;
        self.w + (self.p + self.q * self.s) * t + self.q * velocity * self.psi(t)
    }

    /// Integral of exp(beta t).
    fn phi(&self, t: f64) -> f64 {
        if self.beta == 0.0 {
            t
        } else {
            (self.beta * t).exp_m1() / self.beta
        }
    }

    /// Integral of phi; by its series where the closed form cancels.
    fn psi(&self, t: f64) -> f64 {
        let z = self.beta * t;
        if z.abs() > 0.5 {
            return (self.phi(t) - t) / self.beta;
        }
        let terms = (3..20).rev();
        0.5 * t * t * terms.fold(1.0, |sum, k| 1.0 + sum * z / f64::from(k))
    }

    /// The zero of w in [from, to], where w falls; `last` is its final slope if `to` is infinite.
    fn time_of_return(&self, from: f64, to: f64, last: f64) -> Option<f64> {
        let (mut low, mut high) = (from, to);
        if high == f64::INFINITY {
            if from == f64::INFINITY || last == 0.0 {
                return None;
            }
            // w is about w(from) + last t; where this is too short, double it.
            let guess = self.w_at(from).max(self.w) / last.abs();
            let mut length = guess.max(1.0 / self.beta.abs());
            high = from + length;
            while self.w_at(high) > 0.0 {
                low = high;
                length *= 2.0;
                high = from + length;
                if !high.is_finite() {
                    return None;
                }
            }
        }
        if self.w_at(high) > 0.0 {
            return None;
        }
        Some(self.zero_between(low, high))
    }

    fn zero_between(&self, mut low: f64, mut high: f64) -> f64 {
        let mut t = 0.5 * (low + high);
        for _ in 0..MOST_HALVINGS {
            let w = self.w_at(t);
            if w > 0.0 {
                low = t;
            } else {
                high = t;
            }
            let newton = t - w / (self.p + self.q * self.s_at(t));
            let next = if newton > low && newton < high {
                newton
            } else {
                0.5 * (low + high)
            };
            if (next - t).abs() <= f64::EPSILON * t {
                return next;
            }
            t = next;
        }
        t
    }
}
