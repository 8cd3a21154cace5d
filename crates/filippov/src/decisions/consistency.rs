//! Which modes are consistent with their own signs: switching functions may contain signs of others, and jump where those change.

use super::point::{Notes, Point};
use super::rule::Meeting;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::tolerances::{EPS, MOST_MEETING, SURFACE_NOISE};

/// What the switching functions at a point say of a mode.
pub(super) enum Consistency {
    /// They agree with it.
    Agrees {
        /// With the signs that other functions have in it.
        mode: Mode,
        /// Which surfaces of the meeting the point lies on in it.
        vanishing: Vec<bool>,
    },
    /// This function is on the other side than the mode says, or not zero where the mode slides on it.
    Contradicts(usize),
    /// The fields around what the mode slides on differ in the signs of these too.
    Between(Vec<usize>),
}

/// Asks all functions about the mode with these entries on the surfaces of the meeting.
pub(super) fn consistency(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    entries: &Mode,
) -> Result<Consistency, FieldError> {
    let surfaces = meeting.surfaces;
    let mut mode = meeting.on_all(entries);
    let mut vanishing = vec![true; surfaces.len()];
    if !at.system.has_nested_signs() {
        return Ok(Consistency::Agrees { mode, vanishing });
    }
    let old = at.surface_values(notes, &meeting.mode.signs())?;
    let residual = residual(&old, at, meeting);
    let slid: Vec<usize> = mode
        .sliding_set()
        .filter(|j| surfaces.contains(j))
        .collect();
    let mut first: Option<Mode> = None;
    for pattern in 0..1_usize << slid.len() {
        let mut region = mode.on_sides(&slid, pattern);
        let jumped = let_others_jump(at, notes, meeting, &mut region)?.jumped;
        let signs = region.signs();
        let h = at.surface_values(notes, &signs)?;
        for (i, &j) in surfaces.iter().enumerate() {
            let size = at.system.surface_size(j, at.t, at.x, &signs)?;
            let noise = SURFACE_NOISE * (size + old[j].abs() + h[j].abs()) + residual;
            if h[j].abs() <= noise {
                continue;
            }
            if h[j] * f64::from(entries.entries()[i]) <= 0.0 {
                return Ok(Consistency::Contradicts(j));
            }
            vanishing[i] = false;
        }
        let first = first.get_or_insert_with(|| region.clone());
        let pairs = first.entries().iter().zip(region.entries()).enumerate();
        let differing = pairs.filter(|(j, (a, b))| a != b && !slid.contains(j));
        let differing: Vec<usize> = differing.map(|(j, _)| j).collect();
        if !differing.is_empty() {
            let mut all = [jumped, differing].concat();
            all.sort_unstable();
            all.dedup();
            return Ok(Consistency::Between(all));
        }
    }
    if let Some(region) = first {
        mode = region;
        slid.iter().for_each(|&j| mode.set(j, 0));
    }
    Ok(Consistency::Agrees { mode, vanishing })
}

/// What jumps between two modes.
#[derive(Default)]
pub(super) struct Jumps {
    /// To the other side, or to zero.
    pub jumped: Vec<usize>,
    /// To zero: they keep their side.
    pub landed: Vec<usize>,
}

/// Gives all surfaces that jump between the mode of the meeting and `after` the side that they are on in the second one. Those
/// of the meeting are not looked at; the point lies on them, up to what their values are.
fn let_others_jump(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    after: &mut Mode,
) -> Result<Jumps, FieldError> {
    let old = at.surface_values(notes, &meeting.mode.signs())?;
    let residual = residual(&old, at, meeting);
    let mut jumps = Jumps::default();
    // A jump may make others jump.
    for _ in 0..old.len() {
        let signs = after.signs();
        let new = at.surface_values(notes, &signs)?;
        let mut is_final = true;
        jumps.landed.clear();
        for j in (0..new.len()).filter(|j| !meeting.surfaces.contains(j)) {
            let size = at.system.surface_size(j, at.t, at.x, &signs)?;
            let noise = SURFACE_NOISE * (size + old[j].abs() + new[j].abs()) + residual;
            if (new[j] - old[j]).abs() <= noise {
                continue;
            }
            let side = if new[j] < 0.0 { -1 } else { 1 };
            if new[j].abs() <= noise {
                jumps.landed.push(j);
            } else if after.entries()[j] != side {
                after.set(j, side);
                jumps.jumped.push(j);
                is_final = false;
            }
        }
        if is_final {
            break;
        }
    }
    jumps.jumped.extend(&jumps.landed);
    Ok(jumps)
}

/// The surfaces of a meeting, with those that vanish in some region around it only; `None` if no function jumps between the
/// regions.
pub(super) fn with_those_that_jump(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Vec<usize>>, FieldError> {
    if !at.system.has_nested_signs() || meeting.surfaces.len() > MOST_MEETING {
        return Ok(None);
    }
    let mut surfaces = meeting.surfaces.to_vec();
    let mut any = false;
    let mut known = 0;
    while known < surfaces.len() && surfaces.len() <= MOST_MEETING {
        known = surfaces.len();
        let extended = surfaces.clone();
        let wider = Meeting {
            surfaces: &extended,
            ..*meeting
        };
        for pattern in 0..1_usize << known {
            let mut region = meeting.mode.on_sides(&extended, pattern);
            let jumps = let_others_jump(at, notes, &wider, &mut region)?;
            any |= !jumps.jumped.is_empty();
            let new = jumps.landed.iter().filter(|j| !extended.contains(j));
            for &j in new {
                if !surfaces.contains(&j) {
                    surfaces.push(j);
                }
            }
            any |= contradicts_itself(at, notes, &wider, &region)?;
        }
        surfaces.sort_unstable();
    }
    Ok((any && surfaces.len() <= MOST_MEETING).then_some(surfaces))
}

/// Is a surface of the meeting not zero in this region?
fn contradicts_itself(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    region: &Mode,
) -> Result<bool, FieldError> {
    let old = at.surface_values(notes, &meeting.mode.signs())?;
    let residual = residual(&old, at, meeting);
    let signs = region.signs();
    let h = at.surface_values(notes, &signs)?;
    for &j in meeting.surfaces {
        let size = at.system.surface_size(j, at.t, at.x, &signs)?;
        if h[j].abs() > SURFACE_NOISE * (size + old[j].abs() + h[j].abs()) + residual {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Has one of the surfaces another normal on the other side of one of them?
pub(super) fn bends(at: &Point, meeting: &Meeting) -> Result<bool, FieldError> {
    if !at.system.has_nested_signs() {
        return Ok(false);
    }
    let (mut near, mut far) = (vec![0.0; at.x.len()], vec![0.0; at.x.len()]);
    for &k in meeting.surfaces {
        let [minus, plus] = [-1, 1].map(|side| meeting.mode.with(k, side).signs());
        for &j in meeting.surfaces.iter().filter(|&&j| j != k) {
            let rate = at.system.gradient(j, at.t, at.x, &minus, &mut near)?;
            let other = at.system.gradient(j, at.t, at.x, &plus, &mut far)?;
            if near != far || rate != other {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// How far functions may be from zero at a point that lies on surfaces to this: their values, and some times as much for other
/// slopes.
fn residual(h: &[f64], at: &Point, meeting: &Meeting) -> f64 {
    let reached = meeting.fresh.iter().chain(at.arrival.sliding);
    SURFACE_NOISE / EPS * reached.fold(0.0, |most, &j| h[j].abs().max(most))
}
