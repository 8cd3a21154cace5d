//! Events: which surfaces vanish there, and how the motion comes to them.

use super::choice::choose;
use super::point::{Arrival, Cause, Decided, Left, Lefts, Next, Notes, Point};
use super::rule::{How, Meeting};
use smallvec::SmallVec;

use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::Guard;
use crate::motion::{first_nonzero, normal_component, Leading};
use crate::switching::Arrival as SurfaceArrival;
use crate::system::dot;
use crate::system::{eval_on_side, surfaces_that_matter, BothSides};
use crate::tolerances::{AT_SIDE, ROUNDING};

/// The surfaces among the functions of an event, in order.
#[inline]
pub(crate) fn located_surfaces(functions: &[Guard]) -> SmallVec<[usize; 4]> {
    let mut surfaces = SmallVec::new();
    for function in functions {
        if let Guard::Surface(j) = *function {
            surfaces.push(j);
        }
    }
    if surfaces.len() > 1 {
        surfaces.sort_unstable();
    }
    surfaces
}

/// What vanishes at an event.
#[derive(Default)]
pub(crate) struct Reached {
    /// The surfaces, those slid on left out: those that were located, and all others that vanish there.
    pub surfaces: SmallVec<[usize; 4]>,
    /// The mode before, in which surfaces that do not matter have the signs of the place.
    pub before: Mode,
}

impl Reached {
    /// Finds what vanishes at the event.
    #[inline]
    pub fn find(&mut self, at: &Point, notes: &mut Notes) -> Result<(), FieldError> {
        self.surfaces = located_surfaces(at.arrival.functions());
        self.before.clone_from(at.arrival.mode);
        match only_located_matter(at.arrival, &self.surfaces) {
            true => Ok(()),
            false => look_at_all_surfaces(at, notes, self),
        }
    }
}

/// Adds to what was reached what else vanishes there, and gives surfaces that do not matter the sides of the place.
#[inline(never)]
fn look_at_all_surfaces(
    at: &Point,
    notes: &mut Notes,
    reached: &mut Reached,
) -> Result<(), FieldError> {
    let mut h = at.surface_values(notes, at.arrival.signs)?;
    add_vanishing_surfaces(at, &mut reached.surfaces, &h)?;
    // The functions of those that do not matter may contain signs of others that do not.
    let mut is_new = set_sides_of_inactive(at, &mut reached.before, &h);
    for _ in 0..h.len() {
        if !is_new || !at.system.has_nested_signs() {
            break;
        }
        h = at.surface_values(notes, &reached.before.signs())?;
        is_new = set_sides_of_inactive(at, &mut reached.before, &h);
    }
    add_inactive_that_begin_to_matter(at, reached, &h)
}

/// Adds the surfaces that the point lies on, that did not matter before, and that do on another side of those reached.
fn add_inactive_that_begin_to_matter(
    at: &Point,
    reached: &mut Reached,
    h: &[f64],
) -> Result<(), FieldError> {
    let before = &reached.before;
    let mut zeros = reached.surfaces.to_vec();
    for j in at.arrival.active.inactive() {
        let may_matter = before.entries()[j] != 0 && at.system.switches_at(j);
        if !may_matter || at.arrival.departing.contains(&j) || zeros.contains(&j) {
            continue;
        }
        let size = at.system.surface_size(j, &at.place(&before.signs()))?;
        if h[j].abs() <= ROUNDING * size {
            zeros.push(j);
        }
    }
    if zeros.len() > reached.surfaces.len() {
        let located = reached.surfaces.clone();
        let matter = surfaces_that_matter(at.system, before, zeros);
        let begin = matter.into_iter().filter(|j| !located.contains(j));
        reached.surfaces.extend(begin);
        reached.surfaces.sort_unstable();
    }
    Ok(())
}

/// Gives surfaces that do not matter the sides of these values; whether one of them is another than before.
fn set_sides_of_inactive(at: &Point, mode: &mut Mode, h: &[f64]) -> bool {
    let mut is_new = false;
    for j in at.arrival.active.inactive() {
        let side = if h[j] < 0.0 { -1 } else { 1 };
        if h[j] != 0.0 && mode.entries()[j] != side {
            mode.set(j, side);
            is_new = true;
        }
    }
    is_new
}

/// Are all surfaces slid on, located, or proved to be away from here, so that the values of none are needed?
fn only_located_matter(arrival: &Arrival, located: &[usize]) -> bool {
    let (entries, active) = (arrival.mode.entries(), arrival.active);
    let is_settled = |&j: &usize| entries[j] == 0 || located.contains(&j);
    active.are_all() && active.awake().iter().all(is_settled)
}

/// Adds to the surfaces that were located all others that vanish at the event: they matter, are not being left tangentially
/// and lie within rounding of zero.
pub(crate) fn add_vanishing_surfaces(
    at: &Point,
    surfaces: &mut SmallVec<[usize; 4]>,
    h: &[f64],
) -> Result<(), FieldError> {
    let arrival = at.arrival;
    for &j in arrival.active.awake() {
        let h = h[j];
        // A surface that the motion rests on while it slides is in the place of one that it slides on.
        let slides = arrival.mode.entries()[j] == 0
            || !arrival.sliding.is_empty() && arrival.resting.contains(&j);
        if slides || surfaces.contains(&j) {
            continue;
        }
        let size = at.system.surface_size(j, &at.place(arrival.signs))?;
        // A surface that is being left tangentially stays near for long; one that was crossed at this very instant belongs
        // to the event.
        if h.abs() <= ROUNDING * size && !arrival.departing.contains(&j) {
            surfaces.push(j);
        }
    }
    surfaces.sort_unstable();
    Ok(())
}

/// How the motion comes to one surface, if that surface alone decides.
pub(super) fn arrival_at_surface(arrival: &Arrival, fresh: &[usize]) -> Option<SurfaceArrival> {
    let Cause::Event {
        functions,
        vanishing,
        at_two_fold,
        ..
    } = arrival.cause
    else {
        return None;
    };
    if at_two_fold {
        return Some(SurfaceArrival::TwoFold);
    }
    match (arrival.sliding, fresh, functions) {
        ([], &[j], _) => {
            let side = arrival.mode.entries()[j];
            Some(match vanishing {
                [0, 0] => SurfaceArrival::Region(side),
                _ => SurfaceArrival::Flat(side, vanishing),
            })
        }
        ([_], [], [Guard::Multiplier { end: -1, .. }, ..]) => Some(SurfaceArrival::ExitMinus),
        ([_], [], [Guard::Multiplier { .. }, ..]) => Some(SurfaceArrival::ExitPlus),
        _ => None,
    }
}

/// Rule: the motion touches surfaces and stays in its mode, unless the field beyond leaves the surface too and is chosen.
pub(super) fn touch(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    let (
        How::Event(_),
        Cause::Event {
            touch: true,
            at_two_fold: false,
            vanishing,
            ..
        },
    ) = (meeting.how, at.arrival.cause)
    else {
        return Ok(None);
    };
    let mode = meeting.mode;
    if let (&[j], []) = (meeting.fresh, at.arrival.sliding) {
        if let Some(leading) = goes_on_beyond(at, mode, j, vanishing)? {
            let beyond = mode.with(j, -mode.entries()[j]);
            let candidates = vec![mode.clone(), beyond.clone()];
            match choose(at, notes, &[j], mode.clone(), candidates) {
                Ok(after) if after == beyond => {
                    let left = Lefts::from_elem(Left::beside(j, leading), 1);
                    return Ok(Some(Ok(Next::new(after, left))));
                }
                Ok(_) => {}
                Err(stop) => return Ok(Some(Err(stop))),
            }
        }
    }
    let (mut left, signs) = (Lefts::new(), mode.signs());
    for &j in meeting.fresh {
        let side = mode.entries()[j];
        let known = vanishing[usize::from(side > 0)].max(1);
        let leading = first_nonzero(at.system, j, side, known, &at.place(&signs))?;
        if leading.sign() == side {
            left.push(Left::beside(j, leading));
        }
    }
    Ok(Some(Ok(Next::new(mode.clone(), left))))
}

/// Does the motion touch a surface of higher relative degree? Where its field pushes it onto the surface it arrives, at a rate
/// that is as small as rounding makes that of a touch.
pub(super) fn touches(at: &Point, meeting: &Meeting) -> Result<bool, FieldError> {
    let is_touch = matches!(at.arrival.cause, Cause::Event { touch: true, .. });
    let (true, &[j], mode) = (is_touch, meeting.fresh, meeting.mode) else {
        return Ok(is_touch);
    };
    let Some(reduced) = at.system.reduced(&[j]) else {
        return Ok(true);
    };
    let mut sides = BothSides::new(at.x.len(), mode.entries().len());
    reduced.both_sides(j, &at.place(&mode.signs()), &mut sides)?;
    Ok(match mode.entries()[j] {
        side if side > 0 => sides.normal_plus >= 0.0,
        _ => sides.normal_minus <= 0.0,
    })
}

/// Where the motion in `mode` touches surface j: the first derivative of h along the field beyond, if that
/// leaves the surface too, or stays on it. Then the solution is not unique.
fn goes_on_beyond(
    at: &Point,
    mode: &Mode,
    j: usize,
    vanishing: [usize; 2],
) -> Result<Option<Leading>, FieldError> {
    let (beyond, signs) = (-mode.entries()[j], mode.signs());
    let along = normal_component(at.system, j, j, beyond, &at.place(&signs))?;
    let mut field = vec![0.0; at.x.len()];
    let mut gradient = field.clone();
    let other = mode.with(j, beyond).signs();
    eval_on_side(at.system, &at.place(&other), &mut field)?;
    at.system.gradient(j, &at.place(&signs), &mut gradient)?;
    let size = (dot(&field, &field) * dot(&gradient, &gradient)).sqrt();
    // A touch is located to the square root of rounding: a component of that size vanishes.
    let vanishing =
        vanishing[usize::from(beyond > 0)].max(usize::from(along.value.abs() <= AT_SIDE * size));
    let leading = first_nonzero(at.system, j, beyond, vanishing, &at.place(&signs))?;
    let goes_on = leading.sign() == beyond || leading.order == 0;
    Ok(goes_on.then_some(leading))
}
