//! Does a run go on between its switches, in time and in space?

use crate::decisions::Rounds;
use crate::error_scale::ErrorScale;
use crate::stats::Stats;
use crate::switch::Switch;
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
#[derive(Clone, Default)]
pub(super) struct Progress {
    /// The time of the first of them.
    since: Option<f64>,
    /// How many came after it.
    n_since: u32,
    /// Where the state was at a switch, since when it has not left this place, and how many switches there were since; 0 if it was
    /// never asked.
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

    /// The time of the first of the switches between which time did not advance, at `t`.
    pub fn stands_since(&self, t: f64) -> f64 {
        let is_near = |since: &f64| t - since <= NO_PROGRESS * t.abs();
        self.since.filter(is_near).unwrap_or(t)
    }

    /// A switch happens here, after these. A run of few switches need not ask.
    #[cold]
    #[inline(never)]
    pub fn note_place(&mut self, t: f64, x: &[f64], before: &[Switch], scale: &ErrorScale) {
        let is_here = |place: &[f64], x: &[f64]| {
            let mut pairs = place.iter().zip(x).enumerate();
            pairs.all(|(i, (place, x))| (x - place).abs() <= SAME_PLACE * scale.size(i, *place))
        };
        if self.n_here > 0 && is_here(&self.place, x) {
            self.n_here += 1;
            return;
        }
        // The first time the switches before count too.
        let before = if self.n_here > 0 { &[] } else { before };
        let here = before.iter().rev();
        let here = here.take_while(|switch| is_here(x, &switch.y_before));
        (self.here_since, self.n_here) = (t, 1);
        for switch in here {
            (self.here_since, self.n_here) = (switch.t, self.n_here + 1);
        }
        self.place.clear();
        self.place.extend_from_slice(x);
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
