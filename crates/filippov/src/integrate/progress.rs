//! Does a run go on between its switches, in time and in space?

use crate::decisions::Rounds;
use crate::error_scale::ErrorScale;
use crate::stats::Stats;
use crate::tolerances::{MANY_SWITCHES, NO_PROGRESS, SAME_PLACE};

/// What a run has come to.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Reached {
    /// The time.
    pub t: f64,
    /// Switches in the place that it is in, without a switch elsewhere, if they are very many; else 0.
    pub n_switches_here: u64,
}

/// The switches since time last went on, and since the state last did.
#[derive(Default)]
pub(super) struct Progress {
    /// The time of the first of them.
    since: Option<f64>,
    /// How many came after it.
    n_since: u32,
    /// Where the state was at a switch, since when it has not left this place, and how many switches there were since.
    place: Vec<f64>,
    here_since: f64,
    n_here: u64,
    /// Where it was asked last whether the motion rests.
    pub rested: Option<f64>,
    /// The rounds that the last switches make.
    pub rounds: Rounds,
}

impl Progress {
    /// How many switches came before this one, at `t`, without any progress of time.
    pub fn n_switches_at(&mut self, t: f64) -> u32 {
        match self.since {
            Some(since) if t == since || t - since <= NO_PROGRESS * t.abs() => self.n_since += 1,
            _ => (self.since, self.n_since) = (Some(t), 0),
        }
        self.n_since
    }

    /// Since when time has not gone on, at `t`.
    pub fn stands_since(&self, t: f64) -> f64 {
        let is_near = |since: &f64| t - since <= NO_PROGRESS * t.abs();
        self.since.filter(is_near).unwrap_or(t)
    }

    /// A switch happens here.
    pub fn note_place(&mut self, t: f64, x: &[f64], scale: &ErrorScale) {
        let mut pairs = self.place.iter().zip(x).enumerate();
        let is_here = |(i, (place, x)): (usize, (&f64, &f64))| {
            (x - place).abs() <= SAME_PLACE * scale.size(i, *place)
        };
        if self.place.len() == x.len() && pairs.all(is_here) {
            self.n_here += 1;
            return;
        }
        self.place.clear();
        self.place.extend_from_slice(x);
        (self.here_since, self.n_here) = (t, 1);
    }

    /// What the run has come to.
    pub fn reached(&self, t: f64) -> Reached {
        let n_switches_here = match self.n_here > MANY_SWITCHES {
            true => self.n_here,
            false => 0,
        };
        Reached { t, n_switches_here }
    }

    /// Writes down what there is to say at the end of a run.
    pub fn note_end(&self, stats: &mut Stats) {
        if self.n_here > MANY_SWITCHES {
            (stats.n_switches_here, stats.here_since) = (self.n_here, Some(self.here_since));
        }
    }
}
