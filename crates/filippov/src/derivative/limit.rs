//! The derivative at the limit of infinitely many switches: that of the formula by which the limit is found.
//!
//! If the times between rounds shrink by the ratio r, the limit of a sequence is x + (x - x') r / (1 - r), x' one round before x. Times,
//! and states at these times, are such sequences; r is the ratio of the last two rounds.

use smallvec::SmallVec;

use crate::mode::Mode;
use crate::motion::Guard;

/// Instants that are remembered: two rounds of up to so many and the last one.
const MOST_REMEMBERED: usize = 17;

/// An instant, seen from the motion before it.
pub(super) struct Past {
    pub t: f64,
    pub x: Vec<f64>,
    pub guards: SmallVec<[Guard; 2]>,
    pub mode: Mode,
    /// The derivative of the time by each column.
    pub dt: Vec<f64>,
    /// The derivative of the state at that time by each column.
    pub dx: Vec<Vec<f64>>,
}

impl Past {
    fn is_like(&self, other: &Past) -> bool {
        self.guards == other.guards && self.mode == other.mode
    }
}

/// The instants so far, the latest last.
#[derive(Default)]
pub(super) struct History(Vec<Past>);

/// The limit of instants: its time by each column, and its state.
pub(super) struct Limit {
    pub dt: Vec<f64>,
    pub dx: Vec<Vec<f64>>,
}

impl History {
    pub fn push(&mut self, past: Past) {
        if self.0.len() == MOST_REMEMBERED {
            self.0.remove(0);
        }
        self.0.push(past);
    }

    /// The limit of the rounds, if the latest instants make any.
    pub fn limit(&self) -> Option<Limit> {
        let last = self.0.len().checked_sub(1)?;
        let rounds = (1..=last / 2).find(|round| {
            let earlier = [last - round, last - 2 * round];
            earlier.iter().all(|&k| self.0[k].is_like(&self.0[last]))
        })?;
        let [now, before, first] = [0, rounds, 2 * rounds].map(|back| &self.0[last - back]);
        let (late, early) = (now.t - before.t, before.t - first.t);
        let ratio = late / early;
        if !(ratio > 0.0 && ratio < 1.0) {
            return None;
        }
        let share = ratio / (1.0 - ratio);
        let (mut dt, mut dx) = (Vec::new(), Vec::new());
        for c in 0..now.dt.len() {
            let (d_late, d_early) = (now.dt[c] - before.dt[c], before.dt[c] - first.dt[c]);
            let d_share = (d_late - ratio * d_early) / early / (1.0 - ratio).powi(2);
            dt.push(now.dt[c] + d_late * share + late * d_share);
            let states = now.dx[c].iter().zip(&before.dx[c]);
            let moved = now.x.iter().zip(&before.x);
            let limit = states.zip(moved).map(|((now, before), (x, x_before))| {
                now + (now - before) * share + (x - x_before) * d_share
            });
            dx.push(limit.collect());
        }
        Some(Limit { dt, dx })
    }
}

/// The derivatives of a state at the time of an instant, from those at one time and of the instant.
pub(super) fn at_its_time(columns: &[Vec<f64>], field: &[f64], dt: &[f64]) -> Vec<Vec<f64>> {
    let moved = columns.iter().zip(dt).map(|(column, dt)| {
        let states = column.iter().zip(field);
        states.map(|(entry, f)| entry + f * dt).collect()
    });
    moved.collect()
}
