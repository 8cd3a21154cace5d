//! Limits of infinitely many switches in finite time, and what follows there.

use super::departures::velocity_in;
use super::point::{Decided, Lefts, Next, Notes, Point};
use super::rule::{How, Meeting};
use crate::error::FieldError;
use crate::field::Projector;
use crate::mode::Mode;
use crate::solution::Switch;
use crate::status::Stop;
use crate::stepper::ErrorScale;
use crate::switching::{accumulate, admissible_within, least_multipliers, Kind, Return, Undecided};
use crate::system::dot;
use crate::tolerances::{LONGEST_TURN, MOST_MEETING, NEAREST_ACCUMULATION, SURFACE_NOISE};

/// The limit of accumulating switches.
pub(crate) struct Limit {
    pub t: f64,
    pub x: Vec<f64>,
    /// The surfaces that meet there.
    pub meeting: Vec<usize>,
}

/// Does a later switch repeat an earlier one?
fn repeats(a: &Switch, b: &Switch) -> bool {
    a.surfaces == b.surfaces && a.mode_before == b.mode_before && a.mode_after == b.mode_after
}

/// The limit that the last switches tend to: turns of equally many switches, each turn shorter and nearer to
/// an intersection than the one before by the same ratio (`docs/theory/intersections.md`).
pub(crate) fn limit_of(at: &Point) -> Result<Option<Limit>, FieldError> {
    let switches = at.arrival.switches;
    let Some(turn) = turn_of(switches) else {
        return Ok(None);
    };
    let last = switches.len() - 1;
    let turns = [3, 2, 1, 0].map(|k| &switches[last - k * turn]);
    let intervals = [1, 2, 3].map(|k| turns[k].t - turns[k - 1].t);
    if !(intervals[2] < intervals[1] && intervals[1] < intervals[0]) {
        return Ok(None);
    }
    let Some(meeting) = meeting_of(&switches[last + 1 - turn..]) else {
        return Ok(None);
    };
    let mut returns = [Return {
        time: 0.0,
        distance: 0.0,
    }; 4];
    for (found, switch) in returns.iter_mut().zip(turns) {
        found.time = switch.t;
        found.distance = distance(at, &meeting, switch)?;
    }
    let Some(limit) = accumulate(&returns, reach(at.scale, at.x)).filter(|limit| limit.time > at.t)
    else {
        return Ok(None);
    };
    let share = limit.ratio / (1.0 - limit.ratio);
    let states = turns[3].y_after.iter().zip(&turns[2].y_after);
    let mut x: Vec<f64> = states.map(|(y, before)| y + share * (y - before)).collect();
    let mut projector = Projector::new(x.len(), at.system.n_surfaces());
    projector.project_onto(at.system, &meeting, limit.time, &mut x, at.arrival.signs)?;
    let limit = Limit {
        t: limit.time,
        x,
        meeting,
    };
    Ok(is_on_all(at, &limit)?.then_some(limit))
}

/// Do the surfaces meet at the limit? Three lines in a plane need not.
fn is_on_all(at: &Point, limit: &Limit) -> Result<bool, FieldError> {
    let (signs, mut h) = (at.arrival.signs, vec![0.0; at.system.n_surfaces()]);
    at.system.surfaces(limit.t, &limit.x, signs, &mut h)?;
    for &j in &limit.meeting {
        let size = at.system.surface_size(j, limit.t, &limit.x, signs)?;
        if h[j].abs() > SURFACE_NOISE * size {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The current point as a limit: crossings of the surfaces `meeting` follow one another without any progress of time, as the
/// last turns of a spiral do that shrinks a thousandfold with each.
pub(crate) fn limit_here(at: &Point, meeting: &[usize]) -> Result<Option<Limit>, FieldError> {
    let switches = at.arrival.switches.iter().rev();
    let mut now = switches.take_while(|s| s.t == at.t);
    let only_crosses = now.all(|s| s.kind == Kind::Crossing);
    if !only_crosses || !(2..=MOST_MEETING).contains(&meeting.len()) {
        return Ok(None);
    }
    let mut x = at.x.to_vec();
    let mut projector = Projector::new(x.len(), at.system.n_surfaces());
    projector.project_onto(at.system, meeting, at.t, &mut x, at.arrival.signs)?;
    Ok(Some(Limit {
        t: at.t,
        x,
        meeting: meeting.to_vec(),
    }))
}

/// Rule: a limit of infinitely many switches, where the motion slides on all surfaces if that is possible.
pub(super) fn stay_at_limit(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    if meeting.how != How::Limit {
        return Ok(None);
    }
    let (mode, meeting) = (meeting.mode, meeting.surfaces);
    let fields = at.corners(notes, meeting, mode)?;
    let telling = fields.telling();
    let silent = (0..meeting.len()).find(|place| !telling.contains(place));
    if let Some(surface) = silent {
        if !stays_tangent(at, notes, mode, meeting, &telling)? {
            return Ok(Some(Err(Stop::Intersection {
                surfaces: meeting.to_vec(),
                failing: Vec::new(),
                reason: Undecided::Tangent { surface },
            })));
        }
    }
    let stays = fields.normal_fields().is_ok_and(|fields| {
        if silent.is_some() {
            return least_multipliers(&fields, &telling).is_some();
        }
        let found = admissible_within(&fields, at.patience);
        let mut modes = found
            .iter()
            .filter_map(|found| found.continuation.as_mode());
        modes.any(|mode| mode.codimension() == meeting.len())
    });
    let mut after = mode.clone();
    meeting.iter().for_each(|&j| after.set(j, 0));
    Ok(stays.then(|| Ok(Next::new(after, Lefts::new()))))
}

/// Do the equations that say nothing at the limit say nothing either a moment later, along the motion on all surfaces?
fn stays_tangent(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    meeting: &[usize],
    telling: &[usize],
) -> Result<bool, FieldError> {
    let mut after = mode.clone();
    meeting.iter().for_each(|&j| after.set(j, 0));
    let mut velocity = vec![0.0; at.x.len()];
    velocity_in(at, notes, &after, &[], at.t, at.x, &mut velocity)?;
    let moment = at.moment(notes, &after.signs(), &velocity)?;
    let pairs = at.x.iter().zip(&velocity);
    let mut ahead: Vec<f64> = pairs.map(|(x, v)| x + moment * v).collect();
    let t = at.t + moment;
    let mut projector = Projector::new(ahead.len(), at.system.n_surfaces());
    projector.project_onto(at.system, meeting, t, &mut ahead, &after.signs())?;
    let later = at.moved(t, &ahead).corners(notes, meeting, &after)?;
    Ok(later.telling() == telling)
}

/// Distance of a switch to the intersection, h_j in units of its gradient.
pub(crate) fn distance(at: &Point, meeting: &[usize], switch: &Switch) -> Result<f64, FieldError> {
    let (signs, n) = (switch.mode_after.signs(), switch.y_after.len());
    let mut h = vec![0.0; at.system.n_surfaces()];
    let mut gradient = vec![0.0; n];
    at.system
        .surfaces(switch.t, &switch.y_after, &signs, &mut h)?;
    let mut square = 0.0;
    for &j in meeting {
        at.system
            .gradient(j, switch.t, &switch.y_after, &signs, &mut gradient)?;
        square += h[j] * h[j] / dot(&gradient, &gradient);
    }
    Ok(square.sqrt())
}

/// From where the limit is known to the tolerance: its error is a multiple of the square of the distance.
pub(crate) fn reach(scale: &ErrorScale, x: &[f64]) -> f64 {
    let scales = x.iter().enumerate();
    let scales = scales.map(|(i, x)| scale.tolerance(i, *x, *x));
    scales
        .fold(f64::INFINITY, f64::min)
        .max(NEAREST_ACCUMULATION)
        .sqrt()
}

/// How many switches a turn has, if the last three turns repeat.
fn turn_of(switches: &[Switch]) -> Option<usize> {
    let last = switches.last()?;
    let earlier = switches.iter().rev().skip(1).take(LONGEST_TURN);
    let turn = earlier
        .take_while(|s| !matches!(s.kind, Kind::Accumulation | Kind::Reset | Kind::Clock))
        .position(|s| repeats(s, last))?
        + 1;
    let index = switches.len() - 1;
    let again = |k: usize| {
        index
            .checked_sub(k * turn)
            .is_some_and(|i| repeats(&switches[i], last))
    };
    (again(2) && again(3)).then_some(turn)
}

/// The surfaces of a turn, with those slid on all along; at least two, and not too many.
fn meeting_of(turn: &[Switch]) -> Option<Vec<usize>> {
    let mut meeting: Vec<usize> = turn
        .iter()
        .flat_map(|s| s.surfaces.iter().copied())
        .collect();
    let (first, rest) = turn.split_first()?;
    let always = first.mode_after.sliding_set();
    meeting.extend(always.filter(|&j| rest.iter().all(|s| s.mode_after.entries()[j] == 0)));
    meeting.sort_unstable();
    meeting.dedup();
    (2..=MOST_MEETING)
        .contains(&meeting.len())
        .then_some(meeting)
}
