//! Which modes are consistent with their own signs: switching functions may contain signs of others, and jump where those change.

use super::point::{Notes, Point, Values};
use super::rule::Meeting;
use crate::error::{FieldError, Undecided};
use crate::mode::Mode;
use crate::motion::{CurrentMotion, Guard};
use crate::status::Stop;
use crate::system::{PiecewiseSystem, Setting};
use crate::tolerances::{DOUBTFUL, EPS, MOST_MEETING, ROUNDING};

/// What the switching functions at a point say of a mode.
pub(super) enum Consistency {
    /// They agree with it.
    Agrees {
        /// With the signs that other functions have in it.
        mode: Mode,
        /// Which surfaces of the meeting the point lies on in it, on some side of what it slides on.
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
    if !at.system.has_nested_signs() {
        let vanishing = vec![true; surfaces.len()];
        return Ok(Consistency::Agrees { mode, vanishing });
    }
    let mut vanishing = vec![false; surfaces.len()];
    let known = Known::of(at, notes, meeting)?;
    let slid: Vec<usize> = mode
        .sliding_set()
        .filter(|j| surfaces.contains(j))
        .collect();
    let mut first: Option<Mode> = None;
    for pattern in 0..1_usize << slid.len() {
        let region = mode.on_sides(&slid, pattern);
        let Jumps {
            jumped, h, region, ..
        } = known.let_others_jump(at, notes, meeting, region)?;
        for (i, (&j, entry)) in surfaces.iter().zip(entries.entries()).enumerate() {
            if known.is_zero(at, j, h[j], &region)? {
                vanishing[i] = true;
            } else if h[j] * f64::from(*entry) <= 0.0 {
                return Ok(Consistency::Contradicts(j));
            }
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

/// A mode that follows at a meeting of many surfaces, with the signs that other functions have in it; why the run ends if the
/// mode does not agree with its own signs. Of few surfaces between which functions jump a rule of theirs has decided before.
pub(super) fn agreeing_with_own_signs(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    mode: Mode,
) -> Result<Result<Mode, Stop>, FieldError> {
    let entries: Vec<i8> = meeting
        .surfaces
        .iter()
        .map(|&j| mode.entries()[j])
        .collect();
    let entries = Mode::new(entries);
    let is_few = meeting.surfaces.len() <= MOST_MEETING;
    if !at.system.has_nested_signs() || is_few || entries.codimension() > MOST_MEETING {
        return Ok(Ok(mode));
    }
    let surfaces = meeting.surfaces.to_vec();
    Ok(match consistency(at, notes, meeting, &entries)? {
        Consistency::Agrees { mode, .. } => Ok(mode),
        Consistency::Contradicts(j) => Err(Stop::Intersection {
            surfaces,
            failing: vec![(mode, Guard::Surface(j))],
            reason: Undecided::NoOutcome,
        }),
        Consistency::Between(jumping) => Err(Stop::SlidesAcrossJump { surfaces, jumping }),
    })
}

/// What jumps between two modes.
struct Jumps {
    /// To the other side, or to zero.
    jumped: Vec<usize>,
    /// To zero: they keep their side.
    landed: Vec<usize>,
    /// The second mode, with the signs that the functions have in it.
    region: Mode,
    /// The functions in it.
    h: Values,
}

/// The functions in the mode of a meeting.
struct Known {
    h: Values,
    /// How far functions may be from zero at a point that lies on surfaces to this: their values, and some times as much for
    /// other slopes.
    residual: f64,
}

impl Known {
    fn of(at: &Point, notes: &mut Notes, meeting: &Meeting) -> Result<Self, FieldError> {
        let h = at.surface_values(notes, &meeting.mode.signs())?;
        let reached = meeting.fresh.iter().chain(at.arrival.sliding);
        let residual = reached.fold(0.0, |most, &j| h[j].abs().max(most));
        let residual = ROUNDING / EPS * residual;
        Ok(Known { h, residual })
    }

    fn noise(&self, at: &Point, j: usize, h: f64, region: &Mode) -> Result<f64, FieldError> {
        let size = at.system.surface_size(j, &at.place(&region.signs()))?;
        Ok(ROUNDING * (size + self.h[j].abs() + h.abs()) + self.residual)
    }

    /// Is this value of h_j in a region zero?
    fn is_zero(&self, at: &Point, j: usize, h: f64, region: &Mode) -> Result<bool, FieldError> {
        Ok(h.abs() <= self.noise(at, j, h, region)?)
    }

    /// Gives all surfaces that jump between the mode of the meeting and `region` the side that they are on in the second one.
    /// Those of the meeting are not looked at; the point lies on them, up to what their values are.
    fn let_others_jump(
        &self,
        at: &Point,
        notes: &mut Notes,
        meeting: &Meeting,
        mut region: Mode,
    ) -> Result<Jumps, FieldError> {
        let (mut jumped, mut landed) = (Vec::new(), Vec::new());
        let (before, mut round) = (region.clone(), 0);
        // A jump may make others jump, and may take back what a sign that was still the old one told.
        loop {
            let h = at.surface_values(notes, &region.signs())?;
            let mut is_settled = true;
            landed.clear();
            for j in (0..h.len()).filter(|j| !meeting.surfaces.contains(j)) {
                let noise = self.noise(at, j, h[j], &region)?;
                let jumps = (h[j] - self.h[j]).abs() > noise;
                let side = match jumps && h[j].abs() > noise {
                    true if h[j] < 0.0 => -1,
                    true => 1,
                    false => before.entries()[j],
                };
                if jumps && h[j].abs() <= noise {
                    landed.push(j);
                }
                if region.entries()[j] != side {
                    region.set(j, side);
                    is_settled = false;
                }
            }
            round += 1;
            if is_settled || round > h.len() + 1 {
                let pairs = before.entries().iter().zip(region.entries()).enumerate();
                jumped.extend(pairs.filter(|(_, (a, b))| a != b).map(|(j, _)| j));
                jumped.extend(&landed);
                return Ok(Jumps {
                    jumped,
                    landed,
                    region,
                    h,
                });
            }
        }
    }
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
    let functions = Known::of(at, notes, meeting)?;
    let mut surfaces = meeting.surfaces.to_vec();
    let mut any = false;
    let mut known = 0;
    while known < surfaces.len() && surfaces.len() <= MOST_MEETING {
        known = surfaces.len();
        let extended = surfaces.clone();
        let wider = meeting.with_surfaces(&extended);
        for pattern in 0..1_usize << known {
            let region = meeting.mode.on_sides(&extended, pattern);
            let jumps = functions.let_others_jump(at, notes, &wider, region)?;
            any |= !jumps.jumped.is_empty();
            for &j in &jumps.landed {
                if !surfaces.contains(&j) {
                    surfaces.push(j);
                }
            }
            for &j in &extended {
                any |= !functions.is_zero(at, j, jumps.h[j], &jumps.region)?;
            }
        }
        surfaces.sort_unstable();
    }
    Ok((any && surfaces.len() <= MOST_MEETING).then_some(surfaces))
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
            let rate = at.system.gradient(j, &at.place(&minus), &mut near)?;
            let other = at.system.gradient(j, &at.place(&plus), &mut far)?;
            if near != far || rate != other {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// Surfaces that have another sign on some side of what is slid on than in the mode: the motion would slide between fields
/// that differ in several signs at once. Those that do not matter
/// and those that it rests on are not looked at.
pub(crate) fn differs_between_sides(
    system: &dyn PiecewiseSystem,
    (t, x): (f64, &[f64]),
    motion: &CurrentMotion,
) -> Result<Option<Stop>, FieldError> {
    let CurrentMotion { mode, sliding, .. } = motion;
    let is_checked = |k: usize| motion.known.active().has(k) && !motion.resting.contains(&k);
    if !(1..=MOST_MEETING).contains(&sliding.len()) {
        return Ok(None);
    }
    let (n, patterns) = (mode.entries().len(), 1_usize << sliding.len());
    let mut values = vec![0.0; n * patterns];
    for (pattern, h) in values.chunks_exact_mut(n).enumerate() {
        let signs = mode.on_sides(sliding, pattern).signs();
        system.surfaces(&Setting::new(&signs, &motion.discrete).at(t, x), h)?;
    }
    for pattern in 0..patterns {
        let side = mode.on_sides(sliding, pattern);
        let signs = side.signs();
        let place = Setting::new(&signs, &motion.discrete).at(t, x);
        for k in (0..n).filter(|k| !sliding.contains(k) && is_checked(*k)) {
            let h = |pattern: usize| values[n * pattern + k];
            let beyond = -h(pattern) * f64::from(side.entries()[k]);
            let size = system.surface_size(k, &place)?;
            // If the value lies beyond the surface on every side, the rounding of the event put it there.
            let differs = |other: usize| (h(other) - h(pattern)).abs() > DOUBTFUL * beyond;
            if beyond > DOUBTFUL * (1.0 + size) && (0..patterns).any(differs) {
                return Ok(Some(Stop::SlidesAcrossJump {
                    surfaces: sliding.to_vec(),
                    jumping: vec![k],
                }));
            }
        }
    }
    Ok(None)
}
