//! One surface vanishes: the fields of both sides decide.

use std::cell::OnceCell;

use super::choice::choose;
use super::point::{Decided, Left, Next, Notes, Point};
use super::rule::{How, Meeting};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::status::Stop;
use crate::switching::{decide, Arrival, Decision};

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
    let (mode, other_signs) = (meeting.mode, OnceCell::new());
    let signs = match mode == at.arrival.mode {
        true => at.arrival.signs,
        false => other_signs.get_or_init(|| mode.signs()),
    };
    let decision = decide(at.system, j, arrival, &at.place(signs))?;
    let is_event = matches!(meeting.how, How::Event(_));
    let is_rounding = decision.is_rounding();
    if !is_event || is_rounding == [false; 2] {
        return Ok(Some(follow_at_surface(at, notes, mode, j, decision)));
    }
    // A field that is tangent to the surface: beside it, by rounding, it still points somewhere.
    let mut x = at.x.to_vec();
    let mut projector = at.projector();
    projector.project(at.system, j, at.t, &mut x, at.setting(signs))?;
    let arrival = arrival.to_tangency(is_rounding);
    let decision = decide(at.system, j, arrival, &at.place_at(at.t, &x, signs))?;
    let decided = follow_at_surface(at, notes, mode, j, decision);
    Ok(Some(decided.map(|mut next| {
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
