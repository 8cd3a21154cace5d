//! Clocks: ticks at equal intervals, by multiplication, so that rounding does not add up.

use crate::error::Error;
use crate::tolerances::SAME_TICK;

/// Ticks at the times `phase + k * period`, k a whole number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// The time between two ticks.
    pub period: f64,
    /// The time of tick 0.
    pub phase: f64,
}

impl Clock {
    /// Refuses a clock that has no ticks; the names are those of the user's arguments.
    pub(crate) fn check(&self, period: &'static str, phase: &'static str) -> Result<(), Error> {
        let refuse = |name, value, requirement| {
            Err(Error::OutOfRange {
                name,
                value,
                requirement,
            })
        };
        if !(self.period > 0.0 && self.period.is_finite()) {
            return refuse(period, self.period, "must be positive");
        }
        if !self.phase.is_finite() {
            return refuse(phase, self.phase, "must be finite");
        }
        Ok(())
    }

    /// The number of the tick at `t`, up to rounding, if there is one.
    pub fn tick_at(&self, t: f64) -> Option<f64> {
        let count = (t - self.phase) / self.period;
        let size = (t.abs() + self.phase.abs()) / self.period;
        let is_there = (count - count.round()).abs() <= SAME_TICK * size.max(1.0);
        is_there.then(|| count.round())
    }

    /// The number of the last tick up to `t`.
    pub fn last_up_to(&self, t: f64) -> f64 {
        let count = (t - self.phase) / self.period;
        self.tick_at(t).unwrap_or_else(|| count.floor())
    }

    /// The time of a tick.
    pub fn time(&self, tick: f64) -> f64 {
        self.phase + tick * self.period
    }
}

#[cfg(test)]
mod tests {
    use super::Clock;

    #[test]
    fn a_tick_within_rounding_counts_as_there() {
        let clock = Clock {
            period: 0.1,
            phase: 0.0,
        };
        for k in 0..1000 {
            let t = f64::from(k) * 0.1;
            assert_eq!(clock.last_up_to(t), f64::from(k));
            assert_eq!(clock.last_up_to(t + 0.05), f64::from(k));
        }
    }
}
