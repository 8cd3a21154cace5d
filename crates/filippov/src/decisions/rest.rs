//! Points that no motion leaves: the motion stays.

use super::limits::stay_on_all;
use super::point::{Lefts, Next, Notes, Point};
use super::rule::{How, Meeting};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{shares_of_rows, SmoothField};
use crate::status::{Warning, WarningCode};
use crate::system::{eval_on_side, is_zero_within};
use crate::tolerances::{AT_SIDE, FEW_SURFACES, PLACES_BESIDE_REST, STEPS_INSIDE};
use crate::vectors::largest;

/// Rest, where the motions of all modes lead back to the surfaces: tried at points beside them, as far as the tolerance and
/// nearer. Multipliers keep the state where it is; or the point is isolated, the system does not depend on time, and no
/// component of the state grows, or falls, by the fields of all regions. `None` if a motion leaves.
pub(super) fn stay_if_nothing_leaves(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Next>, FieldError> {
    let m = meeting.surfaces.len();
    if !(2..=FEW_SURFACES).contains(&m) {
        return Ok(None);
    }
    for distance in PLACES_BESIDE_REST {
        for number in 0..3_usize.pow(m as u32) {
            let digit = |k: usize| (number / 3_usize.pow(k as u32) % 3) as i8 - 1;
            let entries: Vec<i8> = (0..m).map(digit).collect();
            let is_all = entries.iter().all(|&entry| entry == 0);
            if !is_all && leaves(at, notes, meeting, &Mode::new(entries), distance)? {
                return Ok(None);
            }
        }
    }
    // On the surfaces |v|^0.4 is zero. At the place it may not be: rounding makes 1e-12 of it where v is 1e-30.
    let (mut x, signs) = (at.x.to_vec(), meeting.mode.signs());
    let (mut projector, setting) = (at.projector(), at.setting(&signs));
    projector.project_onto(at.system, meeting.surfaces, at.t, &mut x, setting)?;
    let at = &at.moved(at.t, if is_near(at, &x) { &x } else { at.x });
    let meeting = &meeting.with_surfaces(meeting.surfaces);
    if let Some(Ok(stays)) = stay_on_all(at, notes, meeting)? {
        let velocity = at.velocity(notes, &stays.mode, &[])?;
        let corners = at.corners(notes, meeting.surfaces, meeting.mode)?;
        let units = at.units();
        let pace = corners.pace(&|i| units.of_state(i));
        if velocity.iter().all(|v| v.is_finite()) {
            let mut parts = velocity.iter().enumerate();
            let is_rest = parts.all(|(i, v)| v.abs() <= AT_SIDE * pace * units.of_state(i));
            return Ok(is_rest.then_some(stays));
        }
    }
    let is_isolated = m >= at.x.len();
    if !is_isolated || at.system.depends_on_time() || moves_on(at, notes, meeting)? {
        return Ok(None);
    }
    warn_of_rest(at, notes, meeting);
    let mut next = Next::new(meeting.on_all(&Mode::new(vec![0; m])), Lefts::new());
    next.start_mut().is_rest = true;
    Ok(Some(next))
}

/// A place at which a motion rests that can be followed no further.
pub(crate) struct RestingPlace {
    pub x: Vec<f64>,
    pub surfaces: Vec<usize>,
    pub next: Next,
}

/// The rest that a motion has come to, up to the tolerance, where it can be followed no further: several surfaces vanish within the
/// tolerance, they meet within it, and no motion leaves them from there.
pub(crate) fn rest_within_tolerance(
    at: &Point,
    notes: &mut Notes,
) -> Result<Option<RestingPlace>, FieldError> {
    let signs = at.arrival.signs;
    let h = at.surface_values(notes, signs)?;
    let mut surfaces = Vec::new();
    for (j, &h) in h.iter().enumerate() {
        let place = at.place(signs);
        if at.arrival.active.has(j) && is_zero_within(at.system, &place, (j, h), at.scale)? {
            surfaces.push(j);
        }
    }
    let triggers = at.triggers();
    let is_trigger = |j: &usize| triggers.is_only_trigger(*j);
    if !(2..=FEW_SURFACES).contains(&surfaces.len()) || surfaces.iter().any(is_trigger) {
        return Ok(None);
    }
    let mut x = at.x.to_vec();
    let mut projector = at.projector();
    projector.project_onto_rates(at.system, &surfaces, at.t, &mut x, at.setting(signs))?;
    let there = at.moved(at.t, &x);
    let h = there.surface_values(notes, signs)?;
    let mut row = vec![0.0; at.x.len()];
    for &j in &surfaces {
        at.system.gradient(j, &there.place(signs), &mut row)?;
        let is_on = h[j].abs() <= AT_SIDE * at.scale.along(&row, at.x);
        if !is_on {
            return Ok(None);
        }
    }
    if !is_near(at, &x) {
        return Ok(None);
    }
    let meeting = Meeting::new(at.arrival.mode, &surfaces, &surfaces, How::Limit);
    let next = stay_if_nothing_leaves(&there, notes, &meeting)?;
    Ok(next.map(|next| RestingPlace { x, surfaces, next }))
}

/// Is the state within the tolerance of the point?
fn is_near(at: &Point, x: &[f64]) -> bool {
    let shift: Vec<f64> = x.iter().zip(at.x).map(|(x, before)| x - before).collect();
    at.scale.largest(&shift, at.x) <= 1.0
}

/// Does a component of the state grow, or fall, by the fields of all regions? Then zero is not among their combinations.
fn moves_on(at: &Point, notes: &mut Notes, meeting: &Meeting) -> Result<bool, FieldError> {
    let (n, m) = (at.x.len(), meeting.surfaces.len());
    let (mut least, mut most) = (vec![f64::INFINITY; n], vec![f64::NEG_INFINITY; n]);
    let mut field = vec![0.0; n];
    for number in 0..1_usize << m {
        let side = |k: usize| if number >> k & 1 == 1 { 1 } else { -1 };
        let region = meeting.on_all(&Mode::new((0..m).map(side).collect()));
        notes.n_field_evaluations +=
            eval_on_side(at.system, &at.place(&region.signs()), &mut field)?;
        // Outside its domain a field is not a number, and no field of the point.
        for (i, v) in field.iter().enumerate().filter(|(_, v)| !v.is_nan()) {
            least[i] = least[i].min(*v);
            most[i] = most[i].max(*v);
        }
    }
    let values = least.iter().chain(&most).map(|v| v.abs());
    let size = values.filter(|v| v.is_finite()).fold(0.0, f64::max);
    let is_one_sided = |i: usize| {
        let is_known = least[i] <= most[i];
        is_known && (least[i] > AT_SIDE * size || most[i] < -AT_SIDE * size)
    };
    Ok((0..n).any(is_one_sided))
}

/// Does a motion in the mode with these entries on the surfaces lead away from them, if it starts beside them?
fn leaves(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    entries: &Mode,
    distance: f64,
) -> Result<bool, FieldError> {
    let mode = meeting.on_all(entries);
    let Some(mut x) = place_beside(at, meeting, entries, distance)? else {
        return Ok(false);
    };
    let mut velocity = vec![0.0; x.len()];
    let mut field = at.field_of(&mode, None);
    field.eval(at.t, &mut x, &mut velocity)?;
    notes.n_field_evaluations += field.n_evaluations();
    let goes_on = |exit: &f64| *exit >= 0.0;
    if !field.last_exits().iter().all(goes_on) || velocity.iter().any(|v| !v.is_finite()) {
        return Ok(false);
    }
    let (beside, signs) = (at.moved(at.t, &x), mode.signs());
    let mut is_leaving = false;
    for (&j, &entry) in meeting.surfaces.iter().zip(entries.entries()) {
        let rate = f64::from(entry) * beside.rate_of(j, &signs, &velocity)?.0;
        if entry != 0 && (rate.is_nan() || rate < 0.0) {
            return Ok(false);
        }
        is_leaving |= rate > 0.0;
    }
    Ok(is_leaving)
}

/// A point at which the functions of the surfaces have the signs of these entries, and the size of this multiple of the
/// tolerance; `None` if none is found.
fn place_beside(
    at: &Point,
    meeting: &Meeting,
    entries: &Mode,
    distance: f64,
) -> Result<Option<Vec<f64>>, FieldError> {
    let (n, signs) = (at.x.len(), meeting.on_all(entries).signs());
    let tolerances = at.x.iter().enumerate();
    let tolerances = tolerances.map(|(i, x)| at.scale.tolerance(i, *x, *x));
    let length = distance * tolerances.fold(f64::MIN_POSITIVE, f64::max);
    let pairs = || meeting.surfaces.iter().zip(entries.entries());
    let (mut x, mut row) = (at.x.to_vec(), vec![0.0; n]);
    // A gradient may be infinite on a surface, and is finite beside it.
    for (&j, &entry) in pairs() {
        at.system
            .gradient(j, &at.place_at(at.t, &x, &signs), &mut row)?;
        let norm = row.iter().map(|g| g * g).sum::<f64>().sqrt();
        if norm.is_finite() && norm > 0.0 {
            let shift = f64::from(entry) * length / norm;
            x.iter_mut().zip(&row).for_each(|(x, g)| *x += shift * g);
        }
    }
    let mut h = vec![0.0; signs.len()];
    for _ in 0..STEPS_INSIDE {
        let place = at.place_at(at.t, &x, &signs);
        at.system.surfaces(&place, &mut h)?;
        let mut rows = Vec::with_capacity(n * meeting.surfaces.len());
        let mut differences = crate::cube::Vector::new();
        for (&j, &entry) in pairs() {
            at.system.gradient(j, &place, &mut row)?;
            differences.push(h[j] - f64::from(entry) * length);
            rows.extend_from_slice(&row);
        }
        let Some(shifts) = shares_of_rows(&rows, &differences) else {
            return Ok(None);
        };
        for (row, shift) in rows.chunks_exact(n).zip(shifts) {
            x.iter_mut().zip(row).for_each(|(x, g)| *x -= shift * g);
        }
    }
    at.system.surfaces(&at.place_at(at.t, &x, &signs), &mut h)?;
    let is_there = pairs().all(|(&j, &entry)| {
        let difference = (h[j] - f64::from(entry) * length).abs();
        difference <= 0.5 * length
    });
    Ok(is_there.then_some(x))
}

fn warn_of_rest(at: &Point, notes: &mut Notes, meeting: &Meeting) {
    let names = meeting.surfaces.iter();
    let names: Vec<String> = names.map(|&j| at.system.surface_name(j) + " = 0").collect();
    let size = largest(at.x);
    notes.warnings.push(Warning {
        t: at.t,
        code: WarningCode::AtRest,
        surfaces: meeting.surfaces.to_vec(),
        text: format!(
            "the motion rests from here at the intersection of {}: the fields are not regular there, and every motion that \
             was tried beside it leads back. The largest component of the state is {size:.1e}",
            names.join(", ")
        ),
        candidates: Vec::new(),
        rule: "",
    });
}
