//! Isolation of the first zero of a function of theta.

use super::certificate::{Bound, Bounds, Verdict};
use crate::error::FieldError;
pub use crate::locate::{is_steep, Bracket, Sampled};
use crate::tolerances::{
    CANCELLED, FLAT_PIECE, HUGGING, MAX_DEPTH, MOST_OPEN, MOST_SAMPLES, MOST_UNPROVED, PROOF_DEPTH,
    REMAINDER,
};

/// The first zero, as far as it is known before it is refined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Zero {
    /// The function changes from positive to not positive in the bracket.
    Crossing(Bracket),
    /// The function comes within rounding of zero at theta and does not change sign.
    Touch(f64),
}

/// The result of a search, with the number of bisections it took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Isolated {
    /// The first zero, if there is one.
    pub zero: Option<Zero>,
    /// The deepest bisection; a large number means that the step does not resolve the function.
    pub depth: u32,
    /// The function was not finite at a sample: there is no certificate.
    pub not_finite: bool,
    /// The search took more evaluations than it may: there is no certificate, and a shorter step is
    /// needed.
    pub exhausted: bool,
}

/// The first zero of `g` on [a, b], where `g(a) > 0`; `noise` is the rounding of g.
///
/// A piece is free of zeros, or has exactly one, where bounds of the function or of its slope prove it.
/// Where there are none, five samples give the Bernstein coefficients of a quartic: no zero if all of
/// them exceed the remainder, estimated from the fourth difference; exactly one if they decrease by more
/// than that from a positive to a negative value. Other pieces are bisected. A function within `noise`
/// everywhere has no zero: it vanishes identically.
///
/// # Errors
/// If `g` raises.
pub fn first_zero(
    g: Sampled,
    a: f64,
    b: f64,
    noise: f64,
    evidence: Evidence,
) -> Result<Isolated, FieldError> {
    let mut values = [0.0; 5];
    for (i, value) in values.iter_mut().enumerate() {
        *value = g(a + (b - a) * 0.25 * i as f64)?;
    }
    first_zero_sampled(g, a, b, values, noise, evidence)
}

/// What tells that the samples of a piece describe the function.
pub enum Evidence<'a> {
    /// The quartic is believed where it also agrees at these points of the piece (in [0, 1]). A polynomial
    /// of low degree needs none.
    Probes(&'a [f64]),
    /// Bounds of the function before division by a zero at the start, of order `divided` if there is one, else 0.
    Bounds {
        /// The bounds.
        bounds: Bounds<'a>,
        /// The order of the zero that the samples are divided by.
        divided: i32,
        /// Where the bounds say nothing after that many bisections, the samples decide.
        patience: u32,
    },
}

/// As [`first_zero`], with the values at the quarters of [a, b] already known.
///
/// # Errors
/// If `g` raises.
pub fn first_zero_sampled(
    g: Sampled,
    a: f64,
    b: f64,
    values: [f64; 5],
    noise: f64,
    evidence: Evidence,
) -> Result<Isolated, FieldError> {
    if values.iter().all(|v| v.abs() <= noise) {
        return Ok(Isolated::default());
    }
    // Below zero, or there up to rounding and falling from there on.
    let falls = values[0] <= 0.0 && values[1..].iter().all(|&v| v < 0.0) && values[4] < -noise;
    if values[0] < -noise || falls {
        return Ok(Isolated {
            zero: Some(Zero::Crossing(Bracket::at(a, values[0]))),
            ..Isolated::default()
        });
    }
    // There up to rounding: the first value that is clear of it tells, however near to the start that is.
    if values[0] <= 0.0 {
        let clear = HUGGING * noise;
        for k in (1..=FIRST_PLACES).rev() {
            let value = g(a + (b - a) * 16.0_f64.powi(-k))?;
            if value < -clear {
                return Ok(Isolated {
                    zero: Some(Zero::Crossing(Bracket::at(a, values[0]))),
                    ..Isolated::default()
                });
            }
            if value > clear {
                break;
            }
        }
    }
    let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let mut search = Search {
        g,
        noise,
        evidence,
        budget: MOST_SAMPLES,
        unproved: 0,
        open: 0,
        start: a,
        flat: (FLAT_PIECE * largest).max(CANCELLED * noise),
        result: Isolated {
            not_finite: !values.iter().all(|v| v.is_finite()),
            ..Isolated::default()
        },
    };
    let [left, first, middle, third, right] = values;
    let zero = search.first((a, b), [left, middle, right], Some([first, third]), 0)?;
    Ok(Isolated {
        zero: zero.filter(|_| search.is_certain()),
        ..search.result
    })
}

/// Places behind a start within rounding of zero that are looked at: each is a sixteenth of the next one.
const FIRST_PLACES: i32 = 12;

/// Points off the regular grid, so that an oscillation in step with the samples is noticed.
pub const PROBES: [f64; 2] = [0.39, 0.815];

struct Search<'a, 'b> {
    g: Sampled<'a>,
    noise: f64,
    evidence: Evidence<'b>,
    budget: u32,
    /// Pieces of which nothing could be proved so far.
    unproved: u32,
    /// Flat ones among the pieces that shorter ones may decide.
    open: u32,
    /// Where the search starts.
    start: f64,
    /// A piece with values below this is flat.
    flat: f64,
    result: Isolated,
}

impl Search<'_, '_> {
    fn is_certain(&self) -> bool {
        !self.result.not_finite && !self.result.exhausted
    }

    fn sample(&mut self, at: f64) -> Result<f64, FieldError> {
        let value = (self.g)(at)?;
        self.budget = self.budget.saturating_sub(1);
        self.result.exhausted |= self.budget == 0;
        self.result.not_finite |= !value.is_finite();
        Ok(value)
    }

    /// The first zero on [a, b], given the values at its ends and in its middle. Those at the quarters
    /// between are sampled where they are not given and bounds do not clear the piece without them.
    fn first(
        &mut self,
        (a, b): (f64, f64),
        [left, middle, right]: [f64; 3],
        quarters: Option<[f64; 2]>,
        depth: u32,
    ) -> Result<Option<Zero>, FieldError> {
        self.result.depth = depth.max(self.result.depth);
        if !self.is_certain() {
            return Ok(None);
        }
        let verdict = self.verdict(a, b, middle);
        match verdict {
            Verdict::Clear => return Ok(None),
            Verdict::Rising if left >= -self.noise && right > 0.0 => return Ok(None),
            Verdict::Falling if right > 0.0 => return Ok(None),
            _ => {}
        }
        let [first, third] = match quarters {
            Some(quarters) => quarters,
            None => {
                let quarter = 0.25 * (b - a);
                [self.sample(a + quarter)?, self.sample(a + 3.0 * quarter)?]
            }
        };
        if !self.is_certain() {
            return Ok(None);
        }
        let v = [left, first, middle, third, right];
        let coefficients = bernstein(&v);
        if verdict == Verdict::Falling && v[0] > 0.0 {
            return Ok(bracket(a, b, &v, &coefficients, self.noise));
        }
        let believed = match verdict {
            Verdict::Unavailable => true,
            Verdict::Unbounded => {
                self.unproved += 1;
                depth >= self.patience() || self.unproved > MOST_UNPROVED
            }
            Verdict::Open if self.is_flat(b, &v) || self.is_below_bounds((a, b), &v, depth) => {
                self.open += 1;
                self.open > MOST_OPEN
            }
            _ => false,
        };
        let remainder = REMAINDER * (v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4]).abs();
        let lowest = coefficients.iter().copied().fold(f64::INFINITY, f64::min);
        if believed && lowest > remainder && self.agrees(a, b, &coefficients, lowest)? {
            return Ok(None);
        }
        let m = 0.5 * (a + b);
        let unresolved =
            depth >= MAX_DEPTH || v.iter().all(|v| v.abs() <= self.noise) || m <= a || m >= b;
        let steepness = coefficients
            .windows(2)
            .map(|w| w[0] - w[1])
            .fold(f64::INFINITY, f64::min);
        let single = believed && steepness > 2.0 * remainder && v[0] > 0.0 && v[4] <= 0.0;
        if unresolved || single && self.agrees(a, b, &coefficients, steepness)? {
            return Ok(bracket(a, b, &v, &coefficients, self.noise));
        }
        if let Some(zero) = self.first((a, m), [v[0], v[1], v[2]], None, depth + 1)? {
            return Ok(Some(zero));
        }
        self.first((m, b), [v[2], v[3], v[4]], None, depth + 1)
    }

    fn patience(&self) -> u32 {
        match self.evidence {
            Evidence::Bounds { patience, .. } => patience,
            Evidence::Probes(_) => 0,
        }
    }

    /// May the piece lie beside a multiple zero, so that bounds of the function are far wider than itself?
    fn is_flat(&self, end: f64, values: &[f64; 5]) -> bool {
        let power = match self.evidence {
            Evidence::Bounds { divided: 2.., .. } => return true,
            Evidence::Bounds { divided: 1, .. } => end - self.start,
            _ => 1.0,
        };
        values.iter().all(|v| v.abs() * power <= self.flat)
    }

    /// Are the bounds of a single point wider than the function is on the piece? The motion is then not known better than
    /// that, and no shorter piece will be decided.
    fn is_below_bounds(&mut self, (a, b): (f64, f64), values: &[f64; 5], depth: u32) -> bool {
        let Evidence::Bounds {
            bounds, divided: 0, ..
        } = &mut self.evidence
        else {
            return false;
        };
        let middle = 0.5 * (a + b);
        depth >= PROOF_DEPTH
            && bounds(middle, middle).is_some_and(|Bound { value, .. }| {
                values.iter().all(|v| v.abs() <= value.hi - value.lo)
            })
    }

    /// What the bounds prove about a piece.
    fn verdict(&mut self, a: f64, b: f64, middle: f64) -> Verdict {
        let Evidence::Bounds {
            bounds, divided, ..
        } = &mut self.evidence
        else {
            return Verdict::Unavailable;
        };
        let middle = (*divided == 0).then_some(middle);
        let Some(bound) = bounds(a, b) else {
            return Verdict::Unavailable;
        };
        let verdict = bound.verdict(b - a, middle, self.noise);
        // From the zero that is divided out the function rises no faster than this.
        let hugs =
            *divided > 0 && a == self.start && bound.steepest() * (b - a) <= HUGGING * self.noise;
        match verdict {
            Verdict::Open if hugs => Verdict::Unavailable,
            _ => verdict,
        }
    }

    /// Does the quartic agree with g at the probes, to half the margin?
    fn agrees(
        &mut self,
        a: f64,
        b: f64,
        coefficients: &[f64; 5],
        margin: f64,
    ) -> Result<bool, FieldError> {
        let probes = match self.evidence {
            Evidence::Probes(probes) => probes,
            Evidence::Bounds { .. } => &PROBES,
        };
        for &probe in probes {
            let value = self.sample(a + (b - a) * probe)?;
            let close = (value - quartic(*coefficients, probe).0).abs() <= 0.5 * margin;
            if !close {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// The first change of sign among the samples, else a touch if the smallest is within the noise.
fn bracket(a: f64, b: f64, v: &[f64; 5], coefficients: &[f64; 5], noise: f64) -> Option<Zero> {
    let at = |i: usize| {
        if i == 4 {
            b
        } else {
            a + (b - a) * 0.25 * i as f64
        }
    };
    if let Some(i) = (0..4).find(|&i| v[i] > 0.0 && v[i + 1] <= 0.0) {
        let (mut low, mut high) = (0.25 * i as f64, 0.25 * (i + 1) as f64);
        let (mut p_low, mut p_high) = (v[i], v[i + 1]);
        let mut x = low;
        // Regula falsi with the halved retained value; six steps give more digits than the quartic has.
        for _ in 0..6 {
            x = low + (high - low) * p_low / (p_low - p_high);
            let p = quartic(*coefficients, x).0;
            if p > 0.0 {
                (low, p_low) = (x, p);
                p_high *= 0.5;
            } else {
                (high, p_high) = (x, p);
                p_low *= 0.5;
            }
        }
        let (p, slope) = quartic(*coefficients, x);
        let newton = x - p / slope;
        if newton > low && newton < high {
            x = newton;
        }
        let crossing = Bracket {
            lo: at(i),
            hi: at(i + 1),
            g_lo: v[i],
            g_hi: v[i + 1],
            guess: a + (b - a) * x,
            slope: slope / (b - a),
        };
        return Some(Zero::Crossing(crossing));
    }
    let smallest = (0..5).min_by(|&i, &j| v[i].abs().total_cmp(&v[j].abs()))?;
    (v[smallest].abs() <= noise).then(|| Zero::Touch(at(smallest)))
}

/// The polynomial with these Bernstein coefficients and its slope, by de Casteljau's scheme.
fn quartic(mut c: [f64; 5], x: f64) -> (f64, f64) {
    for n in (2..5).rev() {
        for i in 0..n {
            c[i] += x * (c[i + 1] - c[i]);
        }
    }
    let difference = c[1] - c[0];
    (c[0] + x * difference, 4.0 * difference)
}

/// Bernstein coefficients of the quartic through values at 0, 1/4, 1/2, 3/4, 1.
fn bernstein(v: &[f64; 5]) -> [f64; 5] {
    [
        v[0],
        (-13.0 * v[0] + 48.0 * v[1] - 36.0 * v[2] + 16.0 * v[3] - 3.0 * v[4]) / 12.0,
        (13.0 * (v[0] + v[4]) - 64.0 * (v[1] + v[3]) + 120.0 * v[2]) / 18.0,
        (-3.0 * v[0] + 16.0 * v[1] - 36.0 * v[2] + 48.0 * v[3] - 13.0 * v[4]) / 12.0,
        v[4],
    ]
}
