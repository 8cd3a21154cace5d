//! First-order data where surfaces meet: what the hidden dynamics tends to from where the motion arrives.

use super::point::{Notes, Point};
use super::rule::{How, Meeting};
use super::surroundings::Surroundings;
use crate::cube::merged_root;
use crate::error::{FieldError, Undecided};
use crate::mode::Mode;
use crate::motion::{Guard, ModeField, RootEnd};
use crate::switching::{resolve_within, ExitKind, Incoming, Resolution};

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

/// The decision for the way in which the motion arrives.
pub(super) fn resolution(
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
    // A meeting with further surfaces, that the motion only passes, begins on a face.
    let ends = meeting.is_exit() && at.arrival.sliding == meeting.surfaces;
    let (Some(exit), ModeField::Intersection(field), true) = (exit, &**field, ends) else {
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
