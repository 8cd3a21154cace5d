//! The certificate: what bounds of a function along a piece of a step say about its zeros.

use filippov_expr::{Enclosure, Interval};

use crate::tolerances::HUGGING;

/// Bounds of a monitored function over a piece of a step.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// Of the function, in the sense of the mode: positive inside.
    pub value: Interval,
    /// Of its derivative in theta.
    pub slope: Interval,
}

/// What the bounds prove about a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// There is no zero.
    Clear,
    /// The function rises throughout.
    Rising,
    /// The function falls throughout.
    Falling,
    /// Nothing, but shorter pieces may be decided.
    Open,
    /// Nothing: the function, or its slope, is not known to be finite. Shorter pieces may be decided.
    Unbounded,
    /// Nothing: there are no bounds, or the function is too near to zero for them all along.
    Unavailable,
}

/// Bounds of a function on the piece from one theta to another.
pub type Bounds<'a> = &'a mut dyn FnMut(f64, f64) -> Option<Bound>;

impl Bound {
    /// From the enclosure in time of a function that is positive inside of the mode after
    /// multiplication by `orientation`.
    pub fn new(enclosure: Enclosure, orientation: f64, dt: f64) -> Self {
        Bound {
            value: enclosure.value.scaled(orientation),
            slope: enclosure.rate.scaled(orientation * dt),
        }
    }

    /// What is proved about a piece of this length; `middle` is the value in its middle, if known.
    pub fn verdict(&self, length: f64, middle: Option<f64>, noise: f64) -> Verdict {
        let Bound { value, slope } = *self;
        if !value.is_bounded() {
            return Verdict::Unbounded;
        }
        if value.lo > noise {
            return Verdict::Clear;
        }
        if !slope.is_bounded() {
            return Verdict::Unbounded;
        }
        if slope.lo > 0.0 {
            return Verdict::Rising;
        }
        if slope.hi < 0.0 {
            return Verdict::Falling;
        }
        let reach = 0.5 * length * self.steepest();
        if middle.is_some_and(|middle| middle - reach > noise) {
            return Verdict::Clear;
        }
        let size = value.hi.max(-value.lo);
        if middle.map_or(size, |middle| size.min(middle.abs() + reach)) <= HUGGING * noise {
            return Verdict::Unavailable;
        }
        Verdict::Open
    }

    /// The least value that the function can have on a piece of this length, by its bounds and by its values at the ends,
    /// as far as they are known.
    pub fn lowest(&self, length: f64, left: Option<f64>, right: Option<f64>) -> f64 {
        let (fall, rise) = (self.slope.lo.min(0.0), self.slope.hi.max(0.0));
        // It lies above the lines from both ends that are as steep as its slope allows.
        let by_ends = match (left, right) {
            (Some(left), Some(right)) if rise > fall => {
                let at = ((left - right + rise * length) / (rise - fall)).clamp(0.0, length);
                (left + fall * at).min(right - rise * (length - at))
            }
            (Some(left), _) => left + fall * length,
            (None, Some(right)) => right - rise * length,
            (None, None) => f64::NEG_INFINITY,
        };
        if by_ends > self.value.lo {
            by_ends
        } else {
            self.value.lo
        }
    }

    /// The largest slope, up or down.
    pub fn steepest(&self) -> f64 {
        self.slope.hi.max(-self.slope.lo)
    }
}

/// What the bounds prove about a whole step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Proof {
    /// There is no zero.
    Clear,
    /// There may be one.
    Open,
    /// There are no bounds, or none of its parts is known to be finite: they say nothing about this function.
    Silent,
}

/// What is proved about a function that is `left` > 0 at the start of a step, and `right` at its part up to `reach`,
/// if that is known. Halves the part up to `depth` times.
pub fn prove(
    bounds: Bounds,
    reach: f64,
    (left, right): (f64, Option<f64>),
    noise: f64,
    depth: u32,
) -> Proof {
    // A change of sign needs no proof.
    let is_beyond = right.is_some_and(|right| right <= 0.0);
    if is_beyond && bounds(0.0, reach).is_some_and(|bound| bound.value.is_bounded()) {
        return Proof::Open;
    }
    prove_between(bounds, (0.0, reach), (Some(left), right), noise, depth)
}

fn prove_between(
    bounds: Bounds,
    (a, b): (f64, f64),
    (left, right): (Option<f64>, Option<f64>),
    noise: f64,
    depth: u32,
) -> Proof {
    let above = |value: Option<f64>| value.is_some_and(|value| value > noise);
    let Some(bound) = bounds(a, b) else {
        return Proof::Silent;
    };
    let verdict = bound.verdict(b - a, None, noise);
    let known = |value: Option<f64>| value.filter(|v| v.is_finite());
    match verdict {
        Verdict::Clear => Proof::Clear,
        Verdict::Open if bound.lowest(b - a, known(left), known(right)) > noise => Proof::Clear,
        Verdict::Rising if above(left) => Proof::Clear,
        Verdict::Falling if above(right) => Proof::Clear,
        Verdict::Unbounded if depth == 0 => Proof::Silent,
        Verdict::Open | Verdict::Rising | Verdict::Falling
            if depth == 0 || !above(left.or(right)) =>
        {
            Proof::Open
        }
        _ if depth == 0 => Proof::Open,
        _ => {
            let m = 0.5 * (a + b);
            let first = prove_between(bounds, (a, m), (left, None), noise, depth - 1);
            if first == Proof::Open {
                return Proof::Open;
            }
            let second = prove_between(bounds, (m, b), (None, right), noise, depth - 1);
            match (first, second) {
                (Proof::Clear, Proof::Clear) => Proof::Clear,
                (Proof::Silent, Proof::Silent) => Proof::Silent,
                _ => Proof::Open,
            }
        }
    }
}
