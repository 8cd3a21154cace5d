//! Which modes can follow at a point: those that are consistent with their own signs, and all of whose guards begin positive.

use super::candidate::{Candidate, Verdict, Viable};
use super::consistency::{consistency, Consistency};
use super::point::{Cause, Lefts, Next, Notes, Point};
use super::rule::Meeting;
use super::surroundings::Surroundings;
use super::touching::{keeps_together, together, Parallels, Together, Touch};
use super::trial::{try_mode, Trial};

use crate::error::{FieldError, Undecided};
use crate::mode::Mode;
use crate::motion::{normal_component, Guard};
use crate::system::surfaces_that_matter;
use crate::tolerances::{MOST_MEETING, ROUNDING};

/// All modes at a point.
#[derive(Clone, Debug, Default)]
pub(super) struct Survey {
    pub viable: Vec<Viable>,
    /// The others, each with a guard that begins negative.
    pub failing: Vec<(Mode, Guard)>,
    /// Modes about which derivatives at the point do not decide, nor a trial.
    pub open: Vec<Mode>,
    /// Modes that would slide between fields that differ in the signs of these functions too.
    pub between: Vec<(Mode, Vec<usize>)>,
}

impl Survey {
    /// The functions that jump on what could be slid on.
    pub fn jumping(self) -> Vec<usize> {
        let mut jumping: Vec<usize> = self.between.into_iter().flat_map(|(_, j)| j).collect();
        jumping.sort_unstable();
        jumping.dedup();
        jumping
    }
}

/// Looks at all modes on the surfaces of `meeting`.
pub(super) fn survey(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Survey>, FieldError> {
    let m = meeting.surfaces.len();
    if m > MOST_MEETING {
        return Ok(None);
    }
    let Surroundings {
        corners,
        fields,
        noise,
    } = match meeting.surroundings(at, notes)? {
        Ok(around) => around,
        Err(Undecided::NotFinite) => return by_trial(at, notes, meeting).map(Some),
        Err(_) => return Ok(None),
    };
    let pace = corners.pace(&|i| at.size(i));
    let touching = Parallels::of(at, meeting.surfaces, meeting.mode)?.touching;
    // Then derivatives at the point are not those where the surfaces touch.
    let is_beside = touching.iter().any(|touch| !touch.is_exact);
    let mut found = Survey::default();
    let (mut pressed, mut fading) = (Vec::new(), Vec::new());
    for index in 0..3_usize.pow(m as u32) {
        let entries = (0..m).map(|i| 1 - (index / 3_usize.pow(i as u32) % 3) as i8);
        if at.patience.is_over() {
            return Ok(None);
        }
        let entries = Mode::new(entries.collect());
        if !corners
            .ties()
            .iter()
            .all(|tie| tie.allows(entries.entries()))
        {
            continue;
        }
        let (mode, vanishing) = match consistency(at, notes, meeting, &entries)? {
            Consistency::Agrees { mode, vanishing } => (mode, vanishing),
            Consistency::Contradicts(j) => {
                let guard = Guard::Surface(j);
                found.failing.push((meeting.on_all(&entries), guard));
                continue;
            }
            Consistency::Between(jumping) => {
                found.between.push((meeting.on_all(&entries), jumping));
                continue;
            }
        };
        let others;
        // Normals, and signs of other functions, are those of the mode.
        let fields = match at.system.has_nested_signs() {
            true => match at.corners(notes, meeting.surfaces, &mode)?.normal_fields() {
                Ok(fields) => {
                    others = fields;
                    &others
                }
                Err(Undecided::NotFinite) => {
                    try_candidate(at, notes, meeting, (mode, &vanishing), &mut found)?;
                    continue;
                }
                Err(_) => return Ok(None),
            },
            false => fields,
        };
        let candidate = Candidate {
            meeting,
            fields,
            noise,
            pace,
            entries: &entries,
            mode: &mode,
            guarded: &vanishing,
            corners,
        };
        let slides_on = |touch: &&Touch| touch.pair.iter().all(|&i| entries.entries()[i] == 0);
        let verdict = if has_ended(at, meeting, &mode) {
            Verdict::Fails(at.arrival.functions()[0])
        } else if let Some(touch) = touching.iter().find(slides_on) {
            match together(at, notes, &candidate, touch.pair)? {
                Together::Never => Verdict::Fails(Guard::Surface(meeting.surfaces[touch.pair[1]])),
                // Other rules may know.
                Together::Perhaps => continue,
                Together::Lost => Verdict::Untold,
                Together::By(fields) => {
                    let fields = &fields;
                    Candidate {
                        fields,
                        ..candidate
                    }
                    .verdict(at, notes)?
                }
            }
        } else if is_beside {
            Verdict::Open(Next::new(mode.clone(), Lefts::new()))
        } else {
            candidate.verdict(at, notes)?
        };
        match verdict {
            Verdict::Viable(viable) => found.viable.push(viable),
            Verdict::Fails(guard) => found.failing.push((mode, guard)),
            Verdict::Fades(guard, viable) => fading.push((guard, viable)),
            Verdict::Slides(j, viable) => pressed.push((j, viable)),
            Verdict::Untold => found.open.push(mode),
            Verdict::Open(next) => match try_mode(at, notes, &next, meeting.surfaces, ROUNDING)? {
                Trial::Leaves(left) => {
                    found.viable.push(Viable::strictly(Next { left, ..next }));
                }
                Trial::Ends => found.failing.push((mode.clone(), candidate.guard())),
                Trial::WithinRounding if is_beside => {}
                Trial::WithinRounding => found.open.push(mode),
            },
        }
    }
    let is_other = !found.viable.is_empty();
    for (guard, viable) in fading {
        match is_other {
            true => found.failing.push((viable.next.mode, guard)),
            false => found.viable.push(viable),
        }
    }
    for (j, viable) in pressed {
        // Where the surfaces touch, the equations of both multipliers are singular, and the motion has the name of the side.
        let mode = &viable.next.mode;
        let slides = mode.with(j, 0);
        let mut is_singular = false;
        for touch in &touching {
            let pair = touch.pair.map(|i| meeting.surfaces[i]);
            if pair.contains(&j) && pair.iter().all(|&k| slides.entries()[k] == 0) {
                let velocity = at.velocity_from(notes, mode, viable.next.start.as_deref())?;
                is_singular |= keeps_together(at, pair, (mode, &velocity), corners)?;
            }
        }
        if is_singular {
            found.open.retain(|mode| *mode != slides);
            found.viable.retain(|other| other.next.mode != slides);
            found.viable.push(viable);
        } else {
            found.failing.push((viable.next.mode, Guard::Surface(j)));
        }
    }
    Ok(Some(found))
}

/// Looks at all modes where a field around the point, or the slope of a function, is not finite: of a logarithm beyond its end,
/// in a region that is not there, or of a root. What agrees with its own signs, and has a field, is tried for a moment.
fn by_trial(at: &Point, notes: &mut Notes, meeting: &Meeting) -> Result<Survey, FieldError> {
    let m = meeting.surfaces.len();
    let mut found = Survey::default();
    for index in 0..3_usize.pow(m as u32) {
        let entries = (0..m).map(|i| 1 - (index / 3_usize.pow(i as u32) % 3) as i8);
        if at.patience.is_over() {
            return Ok(Survey::default());
        }
        let entries = Mode::new(entries.collect());
        match consistency(at, notes, meeting, &entries)? {
            Consistency::Agrees { mode, vanishing } => {
                try_candidate(at, notes, meeting, (mode, &vanishing), &mut found)?;
            }
            Consistency::Contradicts(j) => {
                let guard = Guard::Surface(j);
                found.failing.push((meeting.on_all(&entries), guard));
            }
            Consistency::Between(jumping) => {
                found.between.push((meeting.on_all(&entries), jumping));
            }
        }
    }
    Ok(found)
}

/// Follows a mode that agrees with its own signs for a moment. Without a field it is no motion. Signs that do not matter in it
/// are no guards, and modes that differ only in them are one.
fn try_candidate(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    (mode, vanishing): (Mode, &[bool]),
    found: &mut Survey,
) -> Result<(), FieldError> {
    let idle: Vec<usize> = meeting
        .surfaces
        .iter()
        .copied()
        .filter(|&j| surfaces_that_matter(at.system, &mode, vec![j]).is_empty())
        .collect();
    let is_same = |other: &Mode| {
        let mut pairs = mode.entries().iter().zip(other.entries()).enumerate();
        pairs.all(|(j, (a, b))| a == b || idle.contains(&j))
    };
    let known = found.viable.iter().map(|viable| &viable.next.mode);
    let slides_on_nothing = mode.sliding_set().any(|j| idle.contains(&j));
    if slides_on_nothing || known.chain(&found.open).any(is_same) {
        return Ok(());
    }
    let velocity = at.velocity(notes, &mode, &[])?;
    let surfaces = meeting.surfaces.iter().copied();
    let mut guards = surfaces
        .clone()
        .filter(|&j| mode.entries()[j] == 0)
        .chain(surfaces.clone());
    let guard = Guard::Surface(guards.next().unwrap_or_default());
    if velocity.iter().any(|v| !v.is_finite()) {
        found.failing.push((mode, guard));
        return Ok(());
    }
    if let Some(j) = mode.sliding() {
        let sides =
            [-1, 1].map(|side| normal_component(at.system, j, j, side, &at.place(&mode.signs())));
        let [minus, plus] = sides;
        if !(minus?.value > 0.0 && plus?.value < 0.0) {
            found.failing.push((mode, guard));
            return Ok(());
        }
    }
    let next = Next::new(mode.clone(), Lefts::new());
    let met = surfaces.zip(vanishing).filter(|(_, vanishes)| **vanishes);
    let met: Vec<usize> = met.map(|(j, _)| j).filter(|j| !idle.contains(j)).collect();
    match try_mode(at, notes, &next, &met, ROUNDING)? {
        Trial::Leaves(left) => found.viable.push(Viable::strictly(Next { left, ..next })),
        Trial::Ends => found.failing.push((mode, guard)),
        Trial::WithinRounding => found.open.push(mode),
    }
    Ok(())
}

/// Is this the mode of a motion that one of its own exit functions has just ended?
fn has_ended(at: &Point, meeting: &Meeting, mode: &Mode) -> bool {
    let is_touch = matches!(at.arrival.cause, Cause::Event { touch: true, .. });
    meeting.is_exit() && !is_touch && mode == meeting.mode && !at.arrival.functions().is_empty()
}
