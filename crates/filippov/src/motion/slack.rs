//! How far multipliers may go beyond their ends: where forces balance to rounding, a motion slides on with one at its end.

use super::{Guard, IntersectionField};
use crate::tolerances::{AT_SIDE, TANGENT};

/// What the guards of the present mode may fall below zero by.
#[derive(Clone, Default)]
pub(crate) struct Slacks(Vec<(Guard, f64)>);

impl Slacks {
    /// After an event with these guards whose decision is that the motion slides on. Ten times as far each time, so that the
    /// motion gets on.
    pub fn loosen(&mut self, guards: &[Guard]) {
        let is_end = |guard: &&Guard| matches!(guard, Guard::Multiplier { .. });
        for &guard in guards.iter().filter(is_end) {
            match self.0.iter_mut().find(|held| held.0 == guard) {
                Some(held) => held.1 = (10.0 * held.1).min(AT_SIDE),
                None => self.0.push((guard, TANGENT)),
            }
        }
    }

    /// Another mode has begun.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// That of one guard.
    pub fn of(&self, guard: Guard) -> f64 {
        let own = self.0.iter().find(|held| held.0 == guard);
        own.map_or(0.0, |held| held.1)
    }

    /// Hands them to the field.
    pub fn set(&self, field: &mut IntersectionField) {
        for &(guard, slack) in &self.0 {
            field.set_slack(guard, slack);
        }
    }
}
