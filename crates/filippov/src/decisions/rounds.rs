//! Rounds that shrink without end: where a round is smaller than the tolerance, the mean of its motion takes over.
//!
//! Where the ratio of successive rounds tends to 1, the rounds have no limit in finite time, and their number grows without bound
//! (`docs/theory/intersections.md`).

use super::limits::{is_on_all, meeting_of, project, repeats, turn_of, Limit, Reach};
use super::point::{Notes, Point};
use crate::error::FieldError;
use crate::error_scale::ErrorScale;
use crate::status::{Warning, WarningCode};
use crate::switch::{Kind, Switch};
use crate::tolerances::{SAME_MEAN, STEADY_ROUNDS};

/// The rounds that the last switches make, one after the other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rounds {
    /// Switches of one round; none if the last switches make no rounds.
    turn: Option<usize>,
    /// Switches since the rounds began.
    n: usize,
    /// The largest round since then, in units of the tolerance, and the longest.
    largest: f64,
    longest: f64,
}

impl Rounds {
    /// Takes the last of these switches down; the last turns have `turn` switches each, if there are any. Is the last round, of crossings only, smaller than the tolerance, after one of at least
    /// twice its size, and twice as long?
    pub fn are_small(
        &mut self,
        switches: &[Switch],
        turn: Option<usize>,
        scale: &ErrorScale,
    ) -> bool {
        let Some(last) = switches.len().checked_sub(1) else {
            return false;
        };
        let goes_on = |turn: &usize| {
            let before = last.checked_sub(*turn);
            before.is_some_and(|before| repeats(&switches[before], &switches[last]))
        };
        if self.turn.filter(goes_on).is_none() {
            *self = Rounds {
                turn,
                ..Rounds::default()
            };
        }
        let Some(turn) = self.turn else { return false };
        self.n += 1;
        if !self.n.is_multiple_of(turn) {
            return false;
        }
        let round = &switches[last - turn..];
        let size = scale.largest(&extents_of(round), &switches[last].y_after);
        let duration = switches[last].t - round[0].t;
        self.largest = self.largest.max(size);
        self.longest = self.longest.max(duration);
        let is_half = 2.0 * size <= self.largest && 2.0 * duration <= self.longest;
        size <= 1.0 && is_half && round.iter().all(|s| s.kind == Kind::Crossing)
    }
}

/// How far every component moves in a round.
fn extents_of(round: &[Switch]) -> Vec<f64> {
    let n = round.first().map_or(0, |switch| switch.y_after.len());
    let extent = |i: usize| {
        let values = || round.iter().map(|switch| switch.y_after[i]);
        let most = values().fold(f64::NEG_INFINITY, f64::max);
        most - values().fold(f64::INFINITY, f64::min)
    };
    (0..n).map(extent).collect()
}

/// The place from which the mean of the rounds is followed: on all their surfaces. `None` if the mean is that of another motion
/// than the one that stays there. What is neglected is in a warning.
pub(crate) fn mean_of_rounds(at: &Point, notes: &mut Notes) -> Result<Option<Limit>, FieldError> {
    let switches = at.arrival.switches;
    let Some(turn) = turn_of(switches) else {
        return Ok(None);
    };
    let last = switches.len() - 1;
    let round = &switches[last - turn..];
    let Some(meeting) = meeting_of(at, &round[1..]) else {
        return Ok(None);
    };
    let [before, now] = [&switches[last - turn], &switches[last]];
    let reach = Reach::at(at);
    let ratio = reach.distance(at, &meeting, now)? / reach.distance(at, &meeting, before)?;
    let shrinks_slowly = ratio > STEADY_ROUNDS && ratio < 1.0;
    if !shrinks_slowly {
        return Ok(None);
    }
    let mut limit = Limit {
        t: at.t,
        x: at.x.to_vec(),
        surfaces: meeting,
        is_rest: false,
    };
    project(at, &mut limit)?;
    if !is_on_all(at, &limit)? {
        return Ok(None);
    }
    let mut mode = now.mode_after.clone();
    limit.surfaces.iter().for_each(|&j| mode.set(j, 0));
    let there = at.moved(limit.t, &limit.x);
    let velocity = there.velocity(notes, &mode, &[])?;
    let dt = now.t - before.t;
    let (mut difference, mut speed) = (0.0_f64, 0.0_f64);
    for (i, v) in velocity.iter().enumerate() {
        let mean = (now.y_after[i] - before.y_after[i]) / dt;
        let path = round
            .windows(2)
            .map(|pair| pair[1].y_after[i] - pair[0].y_after[i]);
        speed = speed.max(path.map(f64::abs).sum::<f64>() / dt);
        difference = difference.max((mean - v).abs());
    }
    // A velocity that is not a number is that of no motion.
    let is_mean = difference <= SAME_MEAN * speed;
    if is_mean {
        warn_of_mean(at, notes, &limit.surfaces, &extents_of(round));
    }
    Ok(is_mean.then_some(limit))
}

fn warn_of_mean(at: &Point, notes: &mut Notes, surfaces: &[usize], extents: &[f64]) {
    let names = surfaces.iter().map(|&j| at.system.surface_name(j) + " = 0");
    let names: Vec<String> = names.collect();
    let size = extents
        .iter()
        .fold(0.0_f64, |most, extent| most.max(*extent));
    notes.warnings.push(Warning {
        t: at.t,
        code: WarningCode::Averaged,
        surfaces: surfaces.to_vec(),
        text: format!(
            "the motion turns around {} in ever smaller rounds that do not end: from here the mean motion is followed, which stays \
             there. The last round, and all that are left out, move no component of the state by more than {size:.1e}",
            names.join(", ")
        ),
        candidates: Vec::new(),
        rule: "",
    });
}
