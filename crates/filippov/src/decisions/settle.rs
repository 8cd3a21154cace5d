//! Surfaces vanish together: the first rule that applies answers.

use super::point::{Decided, Notes, Point};
use super::rule::{How, Meeting, Rule};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::status::Stop;
use crate::switching::Arrival as SurfaceArrival;

/// The answer of the first rule that applies, with its name.
pub(super) fn settle(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<(Rule, Decided), FieldError> {
    let (rule, decided) = first_answer(at, notes, meeting)?;
    let decided = match meeting.surfaces {
        [] | [_] => decided,
        _ => (at.rules.check)(at, notes, meeting, rule, decided)?,
    };
    Ok((rule, decided))
}

fn first_answer(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<(Rule, Decided), FieldError> {
    for &(rule, apply) in at.rules.list {
        if let Some(decided) = apply(at, notes, meeting)? {
            return Ok((rule, decided));
        }
    }
    let (rule, answer) = at.rules.last;
    // A rule of the list does not apply, or was interrupted. Of one or two surfaces none takes long.
    if meeting.surfaces.len() > 2 && at.patience.is_over() {
        return Ok((rule, Err(Stop::Interrupted)));
    }
    Ok((rule, answer(at, notes, meeting)?))
}

/// The motion from a place where these surfaces matter and vanish. The others have the signs of `mode`.
pub(super) fn place_on(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    surfaces: &[usize],
    memory: Option<&Mode>,
) -> Result<(Rule, Decided), FieldError> {
    // Of several continuations that which stays on its side.
    let entry = match (surfaces, memory) {
        (&[j], Some(memory)) => memory.entries()[j],
        _ => 0,
    };
    let meeting = Meeting {
        mode,
        surfaces,
        fresh: surfaces,
        how: How::Start(SurfaceArrival::from_side(entry)),
    };
    settle(at, notes, &meeting)
}
