//! Where surfaces meet: what follows at an intersection, from the switching stage.

use super::choice::{asked, choose};
use super::departures::departures;
use super::germs::{decide_by_germs, decide_undecided};
use super::point::{Decided, Lefts, Next, Notes, Point};
use super::rule::{How, Meeting};
use super::spiral::outward_leap;
use super::surroundings::Surroundings;
use crate::cube::{merged_root, stable_roots_with_border, NormalFields};
use crate::error::FieldError;
use crate::error::Undecided;
use crate::mode::Mode;
use crate::motion::{Guard, ModeField, RootEnd};
use crate::status::Stop;
use crate::switching::{resolve_within, Continuation, ExitKind, Incoming, Resolution};
use crate::tolerances::MOST_MEETING;

/// Rule: the first-order data of the fields around the point, for the way in which the motion arrives.
pub(super) fn resolve_first_order(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Decided, FieldError> {
    let around = match meeting.surroundings(at, notes)? {
        Ok(around) => around,
        Err(undecided) => return decide_undecided(at, notes, meeting, Some(undecided)),
    };
    let resolution = resolution(at, notes, meeting, around)?;
    follow(at, notes, meeting, around, resolution)
}

/// The mode to which the hidden dynamics at the point tends, if first-order data determine it.
pub(super) fn hidden_limit(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Mode>, FieldError> {
    let Ok(around) = meeting.surroundings(at, notes)? else {
        return Ok(None);
    };
    let resolution = resolution(at, notes, meeting, around)?.ok();
    let mode = resolution.as_ref().and_then(Resolution::mode);
    Ok(mode.map(|mode| meeting.on_all(mode)))
}

fn resolution(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    around: &Surroundings,
) -> Result<Result<Resolution, Undecided>, FieldError> {
    let kappa = at.policy.law.scaling(meeting.surfaces);
    let resolve = |incoming| resolve_within(&around.fields, &incoming, &kappa, at.patience);
    if !matches!(meeting.how, How::Event(_)) {
        return Ok(resolve(Incoming::Start));
    }
    let incoming = incoming(at, notes, meeting, around)?;
    let is_corner = matches!(incoming, Incoming::Corner { .. });
    Ok(match resolve(incoming) {
        // The last of many turns is within rounding of all surfaces: its region leads past one of them, and has no meaning any
        // more.
        Err(Undecided::NotArriving { .. }) if is_corner => resolve(Incoming::Start),
        decided => decided,
    })
}

/// Rule: more surfaces whose signs multiply one another than all of whose fields can be looked at.
pub(super) fn too_many(
    at: &Point,
    _: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    let groups = at.system.sign_groups(meeting.surfaces).into_iter();
    let largest = groups
        .filter(|group| group.len() > MOST_MEETING)
        .max_by_key(Vec::len);
    Ok(largest.map(|surfaces| {
        Err(Stop::Intersection {
            reason: Undecided::TooMany { n: surfaces.len() },
            surfaces,
            failing: Vec::new(),
        })
    }))
}

/// How the motion came to the intersection.
fn incoming(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    around: &Surroundings,
) -> Result<Incoming, FieldError> {
    let entries = meeting.surfaces.iter().map(|&j| meeting.mode.entries()[j]);
    let entries: Vec<i8> = entries.collect();
    if at.arrival.sliding.is_empty() {
        return Ok(Incoming::Corner { region: entries });
    }
    let mut x = at.x.to_vec();
    at.arrival.field.borrow_mut().exits(at.t, &mut x)?;
    let field = at.arrival.field.borrow();
    let multipliers = match &**field {
        ModeField::Intersection(field) => field.tracked(at.t).to_vec(),
        other => other.multipliers().into_vec(),
    };
    let exit = at
        .arrival
        .functions()
        .iter()
        .find(|guard| !guard.is_surface());
    let (Some(exit), ModeField::Intersection(field), true) = (exit, &**field, meeting.is_exit())
    else {
        return Ok(Incoming::Face {
            mode: entries,
            multipliers,
        });
    };
    let kind = match exit {
        Guard::Root(RootEnd::Fold) => ExitKind::Fold,
        Guard::Root(RootEnd::Stability) => ExitKind::Stability,
        _ => ExitKind::Side,
    };
    let mut lambda = multipliers;
    if let Guard::Multiplier { surface, end } = *exit {
        let position = field.set().iter().position(|&j| j == surface);
        lambda[position.unwrap_or(0)] = f64::from(end);
    }
    if kind == ExitKind::Fold && meeting.surfaces.len() > 2 {
        let merged = merged_root(&around.fields, &lambda);
        lambda = merged.map_or(lambda, |merged| merged.lambda);
    }
    let drift = drift(at, notes, meeting, around, &lambda)?;
    Ok(Incoming::Exit {
        kind,
        lambda,
        drift: Some(drift),
    })
}

/// The rate at which the normal components change along the motion at fixed multipliers.
fn drift(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    around: &Surroundings,
    lambda: &[f64],
) -> Result<Vec<f64>, FieldError> {
    let (mut velocity, mut weights) = (vec![0.0; at.x.len()], Vec::new());
    around.corners.fill_product_weights(lambda, &mut weights);
    around.corners.combine(&weights, &mut velocity);
    let dt = at.moment(notes, &meeting.mode.signs(), &velocity)?;
    let ahead = at.along(&velocity, dt);
    let later = at.moved(at.t + dt, &ahead);
    let corners = later.corners(notes, meeting.surfaces, meeting.mode)?;
    let (now, then) = (around.fields.interpolate(lambda), corners.normal_fields());
    Ok(match then {
        Ok(then) => {
            let pairs = then.interpolate(lambda).into_iter().zip(now);
            pairs.map(|(then, now)| (then - now) / dt).collect()
        }
        Err(_) => vec![f64::NAN; meeting.surfaces.len()],
    })
}

/// Turns a resolution into the motion that follows. Where first-order data do not decide, the first
/// derivatives that do not vanish may still leave only one way.
fn follow(
    at: &Point,
    notes: &mut Notes,
    place: &Meeting,
    around: &Surroundings,
    resolution: Result<Resolution, Undecided>,
) -> Result<Decided, FieldError> {
    let (mode, meeting) = (place.mode, place.surfaces);
    if resolution == Err(Undecided::Interrupted) {
        return Ok(Err(Stop::Interrupted));
    }
    let resolution = match resolution {
        Ok(resolution) if !resolution.degenerate => resolution,
        other => return decide_undecided(at, notes, place, other.err()),
    };
    if !has_root(&around.fields, &resolution, at) {
        if let Ok(decided) = decide_by_germs(at, notes, place)? {
            return Ok(decided);
        }
    }
    notes.leaf = resolution.leaf;
    notes.spirals = resolution.candidates.contains(&Continuation::OutwardSpiral);
    let on_all = |k: &Mode| place.on_all(k);
    let mut candidates: Vec<Mode> = Vec::new();
    for mode in &resolution.candidates {
        let mode = mode.as_mode().map(on_all);
        candidates.extend(mode.filter(|mode| !candidates.contains(mode)));
    }
    let is_spiral = resolution.chosen == Continuation::OutwardSpiral;
    let asked = asked(at, notes).filter(|asked| candidates.contains(asked));
    let (mut after, leap) = match &resolution.chosen {
        Continuation::Mode(chosen) => (on_all(chosen), None),
        Continuation::OutwardSpiral => match asked {
            Some(asked) => (asked.clone(), None),
            None => match outward_leap(at, meeting, mode, around) {
                Some(leap) => (leap.region.clone(), Some(leap)),
                None => return decide_undecided(at, notes, place, None),
            },
        },
    };
    let preferred = after.clone();
    if !resolution.unique || is_spiral || candidates.len() > 1 {
        let modes = candidates.clone();
        if !candidates.contains(&after) {
            candidates.push(after.clone());
        }
        after = match choose(at, notes, meeting, after, candidates) {
            Ok(after) => after,
            Err(stop) => return Ok(Err(stop)),
        };
        if is_spiral {
            // The region that the spiral enters first is no mode in which a motion starts.
            notes.candidates = modes;
        }
    }
    let multipliers: &[f64] = if after == preferred && !is_spiral {
        &resolution.multipliers
    } else {
        &[]
    };
    let left = match &leap {
        // What it leaves is known at the end of the leap.
        Some(_) => Lefts::new(),
        None => departures(at, notes, &after, meeting, multipliers)?,
    };
    let mut next = Next::new(after, left);
    let oscillates = next.mode == preferred && resolution.oscillates;
    if leap.is_some() || oscillates || !multipliers.is_empty() {
        let start = next.start_mut();
        (start.oscillates, start.leap) = (oscillates, leap);
        start.multipliers = multipliers.to_vec();
    }
    Ok(Ok(next))
}

/// Is there a root of its own with which the motion slides on two surfaces? The hidden dynamics may end on a line of them.
fn has_root(fields: &NormalFields, resolution: &Resolution, at: &Point) -> bool {
    let slides_on_two = resolution.mode().filter(|mode| mode.codimension() == 2);
    slides_on_two.is_none_or(|mode| {
        !stable_roots_with_border(&fields.restrict(mode.entries()), at.patience).is_empty()
    })
}
