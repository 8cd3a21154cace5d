//! Known times of actions: which come next.

use crate::system::{Actions, Clock, Trigger};
use crate::tolerances::SAME_TICK;

/// What is left of the known times of one action.
#[derive(Clone, Copy, Debug)]
enum Pending {
    /// The index of the next time.
    Times(usize),
    /// The number of the next tick.
    Tick(Clock, f64),
}

/// The known times of all actions.
#[derive(Clone)]
pub(crate) struct Timetable {
    /// The action with what is left of its times.
    rows: Vec<(usize, Pending)>,
}

impl Timetable {
    /// All times from `t0` on.
    pub fn new(actions: &Actions, t0: f64) -> Self {
        let row = |(index, trigger): (usize, &Trigger)| match trigger {
            Trigger::Surface { .. } | Trigger::Jump => None,
            Trigger::Times(times) => {
                Some((index, Pending::Times(times.partition_point(|&t| t < t0))))
            }
            Trigger::Clock { clock, at_start } => {
                let here = clock.tick_at(t0).filter(|_| *at_start);
                let next = here.unwrap_or_else(|| clock.last_up_to(t0) + 1.0);
                Some((index, Pending::Tick(*clock, next)))
            }
        };
        let triggers = actions.list.iter().map(|action| &action.trigger);
        Timetable {
            rows: triggers.enumerate().filter_map(row).collect(),
        }
    }

    /// The next time at which something happens.
    fn next(&self, actions: &Actions) -> Option<f64> {
        let times = self.rows.iter().filter_map(|row| row_time(row, actions));
        times.min_by(f64::total_cmp)
    }

    /// The next such time from `t` on, up to `t_end`.
    pub fn horizon(&self, actions: &Actions, t: f64, t_end: f64) -> f64 {
        self.next(actions)
            .map_or(t_end, |next| next.max(t).min(t_end))
    }

    /// The actions whose time is `t`, up to rounding, in their order; their next times follow.
    pub fn take(&mut self, actions: &Actions, t: f64) -> Vec<usize> {
        let mut due = Vec::new();
        for row in &mut self.rows {
            let is_near =
                row_time(row, actions).is_some_and(|time| time <= t + SAME_TICK * t.abs());
            // Near zero a time says little of its rounding.
            let is_tick =
                || matches!(row.1, Pending::Tick(clock, next) if clock.tick_at(t) == Some(next));
            if is_near || is_tick() {
                due.push(row.0);
                match &mut row.1 {
                    Pending::Times(next) => *next += 1,
                    Pending::Tick(_, next) => *next += 1.0,
                }
            }
        }
        due
    }
}

fn row_time((index, pending): &(usize, Pending), actions: &Actions) -> Option<f64> {
    match (pending, &actions.list[*index].trigger) {
        (Pending::Times(next), Trigger::Times(times)) => times.get(*next).copied(),
        (Pending::Tick(clock, next), _) => Some(clock.time(*next)),
        _ => None,
    }
}
