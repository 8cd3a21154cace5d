//! Intersections at which first-order data do not decide: the first derivatives that do not vanish.

use super::choice::choose;
use super::look_ahead::decide_by_trial;
use super::point::{Decided, Left, Next, Notes, Point};
use super::resting::rest_in;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::status::Stop;
use crate::switching::{decide_intersection, Resolution, Undecided};

/// What follows at an intersection of which first-order data do not tell enough: the only mode of codimension 0 or 1 that
/// attracts. `rest` is a region whose field is at rest, which is a solution in any case.
pub(super) fn decide_by_higher_order(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    meeting: &[usize],
    resolution: Result<Resolution, Undecided>,
    rest: Option<Mode>,
) -> Result<Decided, FieldError> {
    let ends = meeting.iter().all(|j| at.arrival.sliding.contains(j));
    let decision = decide_intersection(at.system, meeting, mode, ends, (at.t, at.x), at.patience)?;
    let only = decision.unique();
    notes.leaf = "higher-order";
    let next = match (only, rest) {
        (Some((after, left)), rest) => {
            let mut candidates = vec![after.clone()];
            candidates.extend(rest.filter(|rest| rest != after));
            let left = left.iter().map(|&(j, l)| Left::Surface(j, l)).collect();
            let mut chosen = after.clone();
            if candidates.len() > 1 {
                chosen = match choose(at, notes, meeting, chosen, candidates) {
                    Ok(chosen) => chosen,
                    Err(stop) => return Ok(Err(stop)),
                };
            }
            match &chosen == after {
                true => Next::new(chosen, left),
                false => rest_in(at, chosen, meeting)?,
            }
        }
        // What stays on as many surfaces as there are states stays at the point.
        (None, Some(rest)) if decision.candidates.is_empty() && meeting.len() == at.x.len() => {
            notes.leaf = "rest";
            rest_in(at, rest, meeting)?
        }
        _ => {
            if decision.candidates.is_empty() {
                if let Some(decided) = decide_by_trial(at, notes, mode, meeting)? {
                    return Ok(decided);
                }
            }
            return Ok(Err(Stop::Intersection {
                surfaces: meeting.to_vec(),
                candidates: decision.candidates,
                reason: resolution.err().unwrap_or(Undecided::NoOutcome),
            }));
        }
    };
    Ok(Ok(next))
}
