//! The decision where several surfaces meet, as far as codimension 1 answers it.

use super::lie::{first_nonzero, normal_component, Leading};
use crate::cube::Bilinear;
use crate::cube::NormalFields;
use crate::error::FieldError;
use crate::field::MeetingFields;
use crate::mode::Mode;
use crate::patience::Patience;
use crate::system::PiecewiseSystem;
use crate::tolerances::{AT_SIDE, TANGENT};

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
/// (Guglielmi, Hairer 2022; `docs/theory/switching.md`). Where the motion has slid on all of them until now (`ends`), it does
/// not stay with a multiplier at its end. When the caller has waited long enough, not all are listed.
///
/// # Errors
/// If a function of the user raises.
pub fn decide_intersection(
    system: &dyn PiecewiseSystem,
    meeting: &[usize],
    mode: &Mode,
    ends: bool,
    (t, x): (f64, &[f64]),
    patience: Patience,
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
        if patience.is_over() {
            return Ok(decision);
        }
        let candidate = mode.on_sides(meeting, pattern);
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
    let room = if ends { AT_SIDE } else { 0.0 };
    decision.may_stay = may_stay(system, meeting, mode, room, (t, x))?;
    Ok(decision)
}

/// A region at the intersection of some surfaces whose field is at rest at this point, which is a solution whatever the
/// others do. Looked for where all fields around the point are known one by one.
///
/// # Errors
/// If a function of the user raises.
pub fn region_at_rest(
    system: &dyn PiecewiseSystem,
    corners: &MeetingFields,
    mode: &Mode,
    t: f64,
    x: &[f64],
) -> Result<Option<Mode>, FieldError> {
    let meeting = corners.set();
    if !corners.has_all_patterns() || meeting.iter().any(|&j| system.sticks_at(j)) {
        return Ok(None);
    }
    let patterns = 0..1_usize << meeting.len();
    let size = |pattern: usize| {
        let entries = corners.field(pattern).iter();
        entries.fold(0.0_f64, |most, v| most.max(v.abs()))
    };
    let largest = patterns.clone().map(size).fold(0.0, f64::max);
    'patterns: for pattern in patterns.filter(|&pattern| size(pattern) <= TANGENT * largest) {
        let region = mode.on_sides(meeting, pattern);
        let signs = region.signs();
        for &j in meeting {
            let side = region.entries()[j];
            if first_nonzero(system, j, side, 0, t, x, &signs)?.order > 0 {
                continue 'patterns;
            }
        }
        return Ok(Some(region));
    }
    Ok(None)
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

/// Could the motion stay on the intersection of two surfaces, its multipliers at least `room` away from their ends? It
/// cannot if one normal component has one sign over the whole square of multipliers. For more surfaces: not excluded.
fn may_stay(
    system: &dyn PiecewiseSystem,
    meeting: &[usize],
    mode: &Mode,
    room: f64,
    (t, x): (f64, &[f64]),
) -> Result<bool, FieldError> {
    let &[i, j] = meeting else { return Ok(true) };
    let mut values = Vec::with_capacity(8);
    for (sj, si) in [(-1, -1), (-1, 1), (1, -1), (1, 1)] {
        let signs = mode.with(i, si).with(j, sj).signs();
        for k in [i, j] {
            values.push(normal_component(system, k, j, sj, t, x, &signs)?.value);
        }
    }
    let fields = NormalFields::new(2, values);
    Ok(fields.map_or(true, |fields| {
        let root = Bilinear::of_fields(&fields).sliding_root();
        root.is_some_and(|root| root.point.iter().all(|v| v.abs() < 1.0 - room))
    }))
}
