//! The decision where several surfaces meet, as far as codimension 1 answers it.

use super::lie::{first_nonzero, normal_component, Leading};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::system::PiecewiseSystem;

/// Largest number of surfaces whose modes are enumerated.
const MOST_SURFACES: usize = 6;

/// What is known at an intersection.
#[derive(Clone, Debug, PartialEq)]
pub struct IntersectionDecision {
    /// All attracting modes of codimension 0 and 1.
    pub candidates: Vec<Mode>,
    /// For each candidate, the surfaces left with their leading derivatives.
    pub left: Vec<Vec<(usize, Leading)>>,
    /// May the motion stay on the whole intersection?
    pub may_stay: bool,
}

impl IntersectionDecision {
    /// The candidate that follows, if it is the only one.
    pub fn unique(&self) -> Option<(&Mode, &[(usize, Leading)])> {
        match (self.candidates.as_slice(), self.may_stay) {
            ([mode], false) => Some((mode, &self.left[0])),
            _ => None,
        }
    }
}

/// Lists the attracting modes of codimension 0 and 1 at a point where all surfaces of `meeting` vanish.
///
/// A region k attracts if f^k leaves every surface on the side k; sliding on j attracts if it
/// is attractive there and its field leaves every other surface on the side of the mode
/// (Guglielmi, Hairer 2022; `docs/theory/switching.md`).
///
/// # Errors
/// If a function of the user raises.
pub fn decide_intersection(
    system: &dyn PiecewiseSystem,
    meeting: &[usize],
    mode: &Mode,
    t: f64,
    x: &[f64],
) -> Result<IntersectionDecision, FieldError> {
    let mut decision = IntersectionDecision {
        candidates: Vec::new(),
        left: Vec::new(),
        may_stay: true,
    };
    let m = meeting.len();
    if m > MOST_SURFACES {
        return Ok(decision);
    }
    for pattern in 0..1_usize << m {
        let mut candidate = mode.clone();
        for (bit, &j) in meeting.iter().enumerate() {
            candidate.set(j, if pattern >> bit & 1 == 1 { 1 } else { -1 });
        }
        if let Some(left) = region_attracts(system, meeting, &candidate, t, x)? {
            decision.candidates.push(candidate.clone());
            decision.left.push(left);
        }
        // Sliding on j is met once, from the pattern with +1 at j.
        for (bit, &j) in meeting.iter().enumerate() {
            if pattern >> bit & 1 == 1 {
                if let Some(left) = sliding_attracts(system, meeting, j, &candidate, t, x)? {
                    decision.candidates.push(candidate.with(j, 0));
                    decision.left.push(left);
                }
            }
        }
    }
    decision.may_stay = may_stay(system, meeting, mode, t, x)?;
    Ok(decision)
}

fn region_attracts(
    system: &dyn PiecewiseSystem,
    meeting: &[usize],
    region: &Mode,
    t: f64,
    x: &[f64],
) -> Result<Option<Vec<(usize, Leading)>>, FieldError> {
    let signs = region.signs();
    let mut left = Vec::with_capacity(meeting.len());
    for &i in meeting {
        let side = region.entries()[i];
        let leading = first_nonzero(system, i, side, 0, t, x, &signs)?;
        if leading.sign() != side {
            return Ok(None);
        }
        left.push((i, leading));
    }
    Ok(Some(left))
}

fn sliding_attracts(
    system: &dyn PiecewiseSystem,
    meeting: &[usize],
    j: usize,
    region: &Mode,
    t: f64,
    x: &[f64],
) -> Result<Option<Vec<(usize, Leading)>>, FieldError> {
    let signs = region.signs();
    let along = |i: usize, side: i8| normal_component(system, i, j, side, t, x, &signs);
    let (minus, plus) = (along(j, -1)?, along(j, 1)?);
    let tolerance = system.lie_tolerance(1);
    if minus.value <= tolerance * minus.magnitude || plus.value >= -tolerance * plus.magnitude {
        return Ok(None);
    }
    let weight = minus.value / (minus.value - plus.value);
    let mut left = Vec::with_capacity(meeting.len() - 1);
    for &i in meeting.iter().filter(|&&i| i != j) {
        let (a, b) = (along(i, -1)?, along(i, 1)?);
        let value = a.value + weight * (b.value - a.value);
        if value * f64::from(region.entries()[i]) <= tolerance * (a.magnitude + b.magnitude) {
            return Ok(None);
        }
        left.push((i, Leading { order: 1, value }));
    }
    Ok(Some(left))
}

/// Could the motion stay on the intersection of two surfaces? It cannot if one normal component has
/// one sign over the whole square of multipliers. For more surfaces: not excluded.
fn may_stay(
    system: &dyn PiecewiseSystem,
    meeting: &[usize],
    mode: &Mode,
    t: f64,
    x: &[f64],
) -> Result<bool, FieldError> {
    let &[i, j] = meeting else { return Ok(true) };
    // Coefficients of g = a + b x + c y + d x y for both normal components.
    let mut g = [[0.0; 4]; 2];
    for (si, sj) in [(-1, -1), (-1, 1), (1, -1), (1, 1)] {
        let signs = mode.with(i, si).with(j, sj).signs();
        let (p, q) = (f64::from(si), f64::from(sj));
        for (row, k) in g.iter_mut().zip([i, j]) {
            let value = normal_component(system, k, j, sj, t, x, &signs)?.value / 4.0;
            for (entry, factor) in row.iter_mut().zip([1.0, p, q, p * q]) {
                *entry += factor * value;
            }
        }
    }
    Ok(stable_root(g).is_some())
}

/// The only root of g_1 = g_2 = 0 with positive determinant, if it lies in the square and is stable
/// for some scaling of the surfaces (`docs/theory/switching.md`, section "Two equations").
fn stable_root(g: [[f64; 4]; 2]) -> Option<(f64, f64)> {
    let normalised = g.map(|row| {
        let largest = row.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        row.map(|v| v / largest)
    });
    let [[a1, b1, c1, d1], [a2, b2, c2, d2]] = normalised;
    let q2 = b2 * d1 - b1 * d2;
    let q1 = a2 * d1 + b2 * c1 - a1 * d2 - b1 * c2;
    let q0 = a2 * c1 - a1 * c2;
    let s2 = c2 * d1 - c1 * d2;
    let s1 = a2 * d1 + c2 * b1 - a1 * d2 - c1 * b2;
    let s0 = a2 * b1 - a1 * b2;
    let r = (q1 * q1 - 4.0 * q0 * q2).sqrt();
    if !r.is_finite() {
        return None;
    }
    let x = if q1 > 0.0 {
        (-q1 - r) / (2.0 * q2)
    } else {
        2.0 * q0 / (-q1 + r)
    };
    let y = if s1 > 0.0 {
        -2.0 * s0 / (s1 + r)
    } else {
        (-s1 + r) / (2.0 * s2)
    };
    let g11 = b1 + d1 * y;
    let g22 = c2 + d2 * x;
    (x.abs() < 1.0 && y.abs() < 1.0 && g11.min(g22) < 0.0).then_some((x, y))
}
