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

#[cfg(test)]
mod tests {
    use filippov_expr::Interval;

    use super::{prove, Bound, Proof};

    /// f = height + bend (theta - vertex)^2 over [0, 1], with its slope and nothing else known.
    fn parabola(height: f64, bend: f64, vertex: f64) -> (impl Fn(f64) -> f64, Bound) {
        let slopes = [2.0 * bend * -vertex, 2.0 * bend * (1.0 - vertex)];
        let bound = Bound {
            value: Interval::hull(-1e3, 1e3),
            slope: Interval::hull(slopes[0].min(slopes[1]), slopes[0].max(slopes[1])),
        };
        (move |theta| height + bend * (theta - vertex).powi(2), bound)
    }

    #[test]
    fn a_function_lies_above_the_lines_from_its_ends() {
        for k in 0..200_u32 {
            let vertex = f64::from(k % 20) / 10.0 - 0.5;
            let bend = if k % 2 == 0 { 1.0 } else { -1.0 } * (0.1 + f64::from(k) / 50.0);
            let (f, bound) = parabola(0.3, bend, vertex);
            let least = (0..=100)
                .map(|i| f(f64::from(i) / 100.0))
                .fold(f64::INFINITY, f64::min);
            let (left, right) = (Some(f(0.0)), Some(f(1.0)));
            for ends in [(left, right), (left, None), (None, right), (None, None)] {
                assert!(bound.lowest(1.0, ends.0, ends.1) <= least + 1e-12);
            }
            let by_one = bound.lowest(1.0, left, None);
            let by_one = by_one.max(bound.lowest(1.0, None, right));
            assert!(bound.lowest(1.0, left, right) >= by_one - 1e-12);
        }
    }

    #[test]
    fn slopes_that_cannot_reach_zero_between_the_ends_prove_that_there_is_none() {
        // From 0.3 over 0.05 back to 0.3: at most 1 down and 1 up.
        let (f, bound) = parabola(0.05, 1.0, 0.5);
        let ends = (f(0.0), Some(f(1.0)));
        assert_eq!(
            prove(&mut |_, _| Some(bound), 1.0, ends, 1e-12, 0),
            Proof::Open
        );
        let (f, bound) = parabola(0.3, 1.0, 0.5);
        let ends = (f(0.0), Some(f(1.0)));
        assert_eq!(
            prove(&mut |_, _| Some(bound), 1.0, ends, 1e-12, 0),
            Proof::Clear
        );
    }
}
