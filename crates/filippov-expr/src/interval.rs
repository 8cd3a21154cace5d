//! Intervals: a set of numbers that is known to contain a value.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::op::{BinaryOp, UnaryOp};

/// The numbers from `lo` to `hi`. An end that is infinite or NaN means that nothing is known.
///
/// Results are rounded outwards by a few units in the last place, more than the operations of [`UnaryOp`]
/// and [`BinaryOp`] err.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub lo: f64,
    /// Upper end.
    pub hi: f64,
}

/// Relative error allowed for elementary functions: 4 units in the last place.
const LIBRARY: f64 = 4.0 * f64::EPSILON;
/// Beyond it sine and cosine are not followed: an interval of that size has lost the phase.
const LARGEST_ANGLE: f64 = 1e9;

impl Interval {
    /// All numbers: nothing is known.
    pub const ALL: Interval = Interval {
        lo: f64::NEG_INFINITY,
        hi: f64::INFINITY,
    };

    /// The single number 0.
    pub const ZERO: Interval = Interval { lo: 0.0, hi: 0.0 };

    /// A single number.
    pub const fn point(value: f64) -> Self {
        Interval {
            lo: value,
            hi: value,
        }
    }

    /// The numbers between `a` and `b`, in either order.
    pub fn hull(a: f64, b: f64) -> Self {
        Interval {
            lo: a.min(b),
            hi: a.max(b),
        }
    }

    /// The smallest interval that contains two; everything if one of them is not known.
    #[must_use]
    pub fn joined(self, other: Self) -> Self {
        if !self.is_bounded() || !other.is_bounded() {
            return Interval::ALL;
        }
        Interval {
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
        }
    }

    /// The numbers within `radius` of `centre`.
    pub fn around(centre: f64, radius: f64) -> Self {
        Interval {
            lo: centre - radius,
            hi: centre + radius,
        }
        .outwards(f64::EPSILON)
    }

    /// Is there a bound on both sides?
    pub fn is_bounded(self) -> bool {
        self.lo.is_finite() && self.hi.is_finite()
    }

    /// Is the interval known to hold the number 0 only?
    pub fn is_zero(self) -> bool {
        self.lo == 0.0 && self.hi == 0.0
    }

    /// May 0 be in the interval?
    pub fn contains_zero(self) -> bool {
        !(self.lo > 0.0 || self.hi < 0.0)
    }

    /// The numbers times a factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Interval::spanning([self.lo * factor, self.hi * factor], f64::EPSILON)
    }

    fn outwards(self, relative: f64) -> Self {
        // Exact zeros stay exact, so that what does not move stays a point; the products keep
        // an underflow from claiming a bound that is too tight only beyond 1e-292.
        Interval {
            lo: self.lo - relative * self.lo.abs(),
            hi: self.hi + relative * self.hi.abs(),
        }
        .checked()
    }

    /// NaN and crossed ends know nothing.
    fn checked(self) -> Self {
        if self.lo <= self.hi {
            self
        } else {
            Interval::ALL
        }
    }

    /// a - b for single numbers without rounding outwards, so that an integer stays one.
    #[must_use]
    pub(crate) fn sub_exactly(self, b: Self) -> Self {
        Interval {
            lo: self.lo - b.hi,
            hi: self.hi - b.lo,
        }
        .checked()
    }

    /// a^2.
    #[must_use]
    pub fn square(self) -> Self {
        if !self.is_bounded() {
            return Interval::ALL;
        }
        let (low, high) = self.magnitudes();
        Interval {
            lo: low * low,
            hi: high * high,
        }
        .outwards(f64::EPSILON)
    }

    /// Smallest and largest absolute value.
    fn magnitudes(self) -> (f64, f64) {
        let (a, b) = (self.lo.abs(), self.hi.abs());
        let low = if self.contains_zero() { 0.0 } else { a.min(b) };
        (low, a.max(b))
    }

    /// What a function of one operand may be.
    #[must_use]
    pub fn unary(self, op: UnaryOp) -> Self {
        use UnaryOp::{
            Acos, Acosh, Asin, Asinh, Atan, Atanh, Cbrt, Cos, Cosh, Erf, Exp, Exp2, Expm1, Log,
            Log10, Log1p, Log2, NotNegative, Sin, Sinh, Sqrt, Tan, Tanh,
        };
        if !self.is_bounded() {
            // The operand may be NaN: a bound of its sine would hide that.
            return Interval::ALL;
        }
        match op {
            UnaryOp::Neg => -self,
            Sin => self.sine(),
            Cos => self.cosine(),
            Tan => self.tangent(),
            Cosh => {
                let (low, high) = self.magnitudes();
                Interval::spanning([low.cosh(), high.cosh()], LIBRARY)
            }
            NotNegative => Interval {
                lo: op.apply(self.lo),
                hi: op.apply(self.hi),
            },
            // A NaN of an operand outside of the domain is noticed: nothing is known.
            Sqrt | Cbrt | Exp | Expm1 | Exp2 | Log | Log1p | Log2 | Log10 | Asin | Acos | Atan
            | Sinh | Tanh | Asinh | Acosh | Atanh | Erf => {
                Interval::spanning([op.apply(self.lo), op.apply(self.hi)], LIBRARY)
            }
        }
    }

    /// What a function of two operands may be.
    #[must_use]
    pub fn binary(self, op: BinaryOp, b: Self) -> Self {
        if !self.is_bounded() || !b.is_bounded() {
            return Interval::ALL;
        }
        match op {
            BinaryOp::Add => self + b,
            BinaryOp::Sub => self - b,
            BinaryOp::Mul => self * b,
            BinaryOp::Div => self / b,
            BinaryOp::Pow => self.power(b),
            BinaryOp::Atan2 => self.angle(b),
            BinaryOp::Hypot => {
                let ((a_low, a_high), (b_low, b_high)) = (self.magnitudes(), b.magnitudes());
                Interval::spanning([a_low.hypot(b_low), a_high.hypot(b_high)], LIBRARY)
            }
        }
    }

    /// The smallest interval with some values.
    fn spanning<const N: usize>(values: [f64; N], relative: f64) -> Self {
        let (mut lo, mut hi, mut has_nan) = (values[0], values[0], false);
        for value in values {
            // Not `f64::min`, which looks for NaN each time.
            has_nan |= value.is_nan();
            lo = if value < lo { value } else { lo };
            hi = if value > hi { value } else { hi };
        }
        if has_nan {
            return Interval::ALL;
        }
        Interval { lo, hi }.outwards(relative)
    }

    fn cosine(self) -> Self {
        self.wave(0.0, [self.lo.cos(), self.hi.cos()])
    }

    fn sine(self) -> Self {
        self.wave(0.5, [self.lo.sin(), self.hi.sin()])
    }

    /// Sine and cosine, which take little more together than one of them.
    pub(crate) fn sine_and_cosine(self) -> (Self, Self) {
        if !self.is_bounded() {
            return (Interval::ALL, Interval::ALL);
        }
        let ((sin_lo, cos_lo), (sin_hi, cos_hi)) = (self.lo.sin_cos(), self.hi.sin_cos());
        let (sine, cosine) = ([sin_lo, sin_hi], [cos_lo, cos_hi]);
        (self.wave(0.5, sine), self.wave(0.0, cosine))
    }

    /// A sine wave with extrema at (k + offset) pi, maxima for even k, given its values at the ends.
    fn wave(self, offset: f64, ends: [f64; 2]) -> Self {
        use std::f64::consts::FRAC_1_PI;
        let size = self.lo.abs().max(self.hi.abs());
        if size >= LARGEST_ANGLE {
            return Interval::hull(-1.0, 1.0);
        }
        // The slack covers the rounding of the products.
        let slack = LIBRARY * (1.0 + size);
        let before = floor((self.lo - slack) * FRAC_1_PI - offset);
        let last = floor((self.hi + slack) * FRAC_1_PI - offset);
        let range = Interval::spanning(ends, LIBRARY);
        let (mut lo, mut hi) = (range.lo.max(-1.0), range.hi.min(1.0));
        // The extrema in between: two are of both kinds.
        if last > before {
            let both = last > before + 1;
            if both || last % 2 == 0 {
                hi = 1.0;
            }
            if both || last % 2 != 0 {
                lo = -1.0;
            }
        }
        Interval { lo, hi }
    }

    fn tangent(self) -> Self {
        if self.cosine().contains_zero() {
            return Interval::ALL;
        }
        Interval::spanning([self.lo.tan(), self.hi.tan()], LIBRARY)
    }

    fn power(self, exponent: Self) -> Self {
        let n = exponent.lo;
        if n == exponent.hi && n.fract() == 0.0 {
            let (low, high) = self.magnitudes();
            if n < 0.0 {
                return Interval::point(1.0) / self.power(Interval::point(-n));
            }
            let even = (0.5 * n).fract() == 0.0;
            return if even {
                Interval::spanning([low.powf(n), high.powf(n)], LIBRARY)
            } else {
                Interval::spanning([self.lo.powf(n), self.hi.powf(n)], LIBRARY)
            };
        }
        if self.lo < 0.0 || self.lo == 0.0 && exponent.lo <= 0.0 {
            return Interval::ALL;
        }
        // Monotone in each operand for a fixed other one: extrema at the corners.
        let corners = [
            self.lo.powf(exponent.lo),
            self.lo.powf(exponent.hi),
            self.hi.powf(exponent.lo),
            self.hi.powf(exponent.hi),
        ];
        Interval::spanning(corners, LIBRARY)
    }

    /// atan2(self, x): monotone along every edge of a box that stays away from its branch cut.
    fn angle(self, x: Self) -> Self {
        if self.contains_zero() && x.lo <= 0.0 {
            return Interval::ALL;
        }
        let corners = [
            self.lo.atan2(x.lo),
            self.lo.atan2(x.hi),
            self.hi.atan2(x.lo),
            self.hi.atan2(x.hi),
        ];
        Interval::spanning(corners, LIBRARY)
    }
}

/// The largest integer up to a number of moderate size: `f64::floor` is a call on many machines.
fn floor(x: f64) -> i64 {
    let k = x as i64;
    k - i64::from(k as f64 > x)
}

impl Add for Interval {
    type Output = Self;

    fn add(self, b: Self) -> Self {
        Interval {
            lo: self.lo + b.lo,
            hi: self.hi + b.hi,
        }
        .outwards(f64::EPSILON)
    }
}

impl Sub for Interval {
    type Output = Self;

    fn sub(self, b: Self) -> Self {
        self + -b
    }
}

impl Mul for Interval {
    type Output = Self;

    fn mul(self, b: Self) -> Self {
        if self.is_zero() && b.is_bounded() || b.is_zero() && self.is_bounded() {
            return Interval::ZERO;
        }
        let products = [
            self.lo * b.lo,
            self.lo * b.hi,
            self.hi * b.lo,
            self.hi * b.hi,
        ];
        Interval::spanning(products, f64::EPSILON)
    }
}

impl Div for Interval {
    type Output = Self;

    /// Nothing is known where b may vanish.
    fn div(self, b: Self) -> Self {
        if b.contains_zero() {
            return Interval::ALL;
        }
        let inverse = Interval {
            lo: 1.0 / b.hi,
            hi: 1.0 / b.lo,
        };
        self * inverse.outwards(f64::EPSILON)
    }
}

impl Neg for Interval {
    type Output = Self;

    fn neg(self) -> Self {
        Interval {
            lo: -self.hi,
            hi: -self.lo,
        }
    }
}
