//! Oscillations of the hidden dynamics of three and more surfaces, watched for a long time.

use crate::tolerances::{AT_THE_ROOT, FIRST_WATCH, LAST_WATCH, STEADY_CYCLE};

/// The range of each component over windows of time, each twice as long as the one before.
///
/// A component that oscillates has the same range in both; one that grows leaves its range. This is
/// an observation, not a proof: growth by less than the tolerance over thousands of oscillations is
/// not seen.
pub(super) struct Watch {
    time: f64,
    end: f64,
    before: Option<Vec<[f64; 2]>>,
    now: Vec<[f64; 2]>,
}

impl Watch {
    pub fn new(u: &[f64]) -> Self {
        Watch {
            time: 0.0,
            end: FIRST_WATCH,
            before: None,
            now: u.iter().map(|&v| [v, v]).collect(),
        }
    }

    pub fn is_over(&self) -> bool {
        self.end > LAST_WATCH
    }

    /// Notes the state after a step; at the end of a window the mode in which the motion
    /// oscillates, if so.
    pub fn note(&mut self, time: f64, u: &[f64]) -> Option<Vec<i8>> {
        self.time += time;
        for (range, &v) in self.now.iter_mut().zip(u) {
            *range = [range[0].min(v), range[1].max(v)];
        }
        if self.time < self.end {
            return None;
        }
        self.end = 2.0 * self.time;
        let mode = self.steady_mode();
        let next = u.iter().map(|&v| [v, v]).collect();
        self.before = Some(std::mem::replace(&mut self.now, next));
        mode.filter(|mode| mode.contains(&0))
    }

    fn steady_mode(&self) -> Option<Vec<i8>> {
        let pairs = self.before.as_ref()?.iter().zip(&self.now);
        pairs
            .map(|(&before, &now)| steady_entry(before, now))
            .collect()
    }
}

/// 0 for a component that keeps to its range, its side for one that leaves the range outwards.
fn steady_entry([low, high]: [f64; 2], [next_low, next_high]: [f64; 2]) -> Option<i8> {
    let width = high - low;
    let same = |a: f64, b: f64| (a - b).abs() <= STEADY_CYCLE * width + AT_THE_ROOT;
    if same(low, next_low) && same(high, next_high) {
        Some(0)
    } else if next_low > 1.0 && next_low >= high {
        Some(1)
    } else if next_high < -1.0 && next_high <= low {
        Some(-1)
    } else {
        None
    }
}
