//! One surface vanishes: the fields of both sides decide.

use super::choice::choose;
use super::point::{Decided, Left, Next, Notes, Point};
use super::rule::{How, Meeting};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{Leading, Projector};
use crate::status::Stop;
use crate::switching::{decide, Arrival, Decision};
use crate::system::PiecewiseSystem;
use crate::tolerances::SURFACE_NOISE;
use smallvec::smallvec;

/// Rule: one surface, by the first derivatives of h that do not vanish along the fields of both sides.
#[inline(always)]
pub(super) fn one_surface(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    let &[j] = meeting.surfaces else {
        return Ok(None);
    };
    let arrival = match meeting.how {
        How::Start(arrival) | How::Event(Some(arrival)) => arrival,
        How::Event(None) => return Ok(None),
        How::Limit => Arrival::Start,
    };
    if let Some(reduced) = at.system.reduced(&[j]) {
        if let Some(decided) = of_higher_degree(at, notes, meeting.mode, (j, arrival), reduced)? {
            return Ok(Some(decided));
        }
    }
    let (mode, signs) = (meeting.mode, meeting.mode.signs());
    let decision = decide(at.system, j, arrival, &at.place(&signs))?;
    let is_event = matches!(meeting.how, How::Event(_));
    let is_rounding = decision.is_rounding();
    if !is_event || is_rounding == [false; 2] {
        return Ok(Some(follow_at_surface(at, notes, mode, j, decision)));
    }
    // A field that is tangent to the surface: beside it, by rounding, it still points somewhere.
    let mut x = at.x.to_vec();
    let mut projector = Projector::new(x.len(), signs.len());
    projector.project(at.system, j, at.t, &mut x, at.setting(&signs))?;
    let arrival = arrival.to_tangency(is_rounding);
    let decision = decide(at.system, j, arrival, &at.place_at(at.t, &x, &signs))?;
    let decided = follow_at_surface(at, notes, mode, j, decision);
    Ok(Some(decided.map(|mut next| {
        next.start_mut().moved = Some(x);
        next
    })))
}

/// The motion at a surface that both fields cross at the same rate. While the rate is not zero it crosses. Where the rate is zero
/// the fields decide on the surface rate = 0 of the reduced system. `None` if they are not finite there.
#[cold]
#[inline(never)]
fn of_higher_degree(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    (j, arrival): (usize, Arrival),
    reduced: &dyn PiecewiseSystem,
) -> Result<Option<Decided>, FieldError> {
    let (signs, n) = (mode.signs(), at.x.len());
    let (mut x, mut h) = (at.x.to_vec(), vec![0.0; signs.len()]);
    let mut projector = Projector::new(n, signs.len());
    projector.project(at.system, j, at.t, &mut x, at.setting(&signs))?;
    let place = at.place_at(at.t, &x, &signs);
    reduced.surfaces(&place, &mut h)?;
    let (rate, noise) = (h[j], SURFACE_NOISE * reduced.surface_size(j, &place)?);
    if !rate.is_finite() {
        return Ok(None);
    }
    let ends_sliding = matches!(
        arrival,
        Arrival::ExitMinus | Arrival::ExitPlus | Arrival::TwoFold
    );
    if !ends_sliding && rate.abs() > noise {
        let (entry, leading) = (
            rate.signum() as i8,
            Leading {
                order: 1,
                value: rate,
            },
        );
        let crossing = Decision {
            entry,
            candidates: smallvec![entry],
            two_fold: None,
            minus: leading,
            plus: leading,
        };
        return Ok(Some(follow_at_surface(at, notes, mode, j, crossing)));
    }
    projector.project(reduced, j, at.t, &mut x, at.setting(&signs))?;
    let arrival = match arrival {
        Arrival::Flat(side, _) => Arrival::Region(side),
        arrival => arrival,
    };
    let decision = decide(reduced, j, arrival, &at.place_at(at.t, &x, &signs))?;
    if !(decision.minus.value.is_finite() && decision.plus.value.is_finite()) {
        return Ok(None);
    }
    let decided = follow_at_surface(at, notes, mode, j, decision);
    Ok(Some(decided.map(|mut next| {
        // The rate is the first derivative of h.
        let surfaces = next.left.iter_mut().filter(|left| left.surface().is_some());
        surfaces
            .filter(|left| left.leading.order > 0)
            .for_each(|left| left.leading.order += 1);
        next.start_mut().moved = Some(x);
        next
    })))
}

/// The motion after the decision at one surface.
#[inline]
fn follow_at_surface(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    j: usize,
    mut decision: Decision,
) -> Decided {
    if decision.has_no_continuation() {
        return Err(Stop::InvisibleTwoFold {
            surface: j,
            sliding: decision.two_fold,
        });
    }
    let mut after = mode.with(j, decision.entry);
    if decision.candidates.len() > 1 {
        let candidates = decision.candidates.iter();
        let candidates = candidates.map(|&entry| mode.with(j, entry)).collect();
        after = choose(at, notes, &[j], after, candidates)?;
        decision.entry = after.entries()[j];
    }
    let mut next = Next::new(after, Left::after(j, &decision));
    if let Some(motion) = decision.starts_at_two_fold() {
        let start = next.start_mut();
        (start.multipliers, start.is_given) = (vec![motion.multiplier()], true);
        start.two_fold = Some(*motion);
    }
    Ok(next)
}
