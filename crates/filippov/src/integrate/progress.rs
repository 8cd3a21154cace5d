//! Does time go on between switches?

use crate::tolerances::NO_PROGRESS;

/// The switches since time last went on.
#[derive(Default)]
pub(super) struct Progress {
    /// The time of the first of them.
    since: Option<f64>,
    /// How many came after it.
    n_since: u32,
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
}
