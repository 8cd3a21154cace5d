//! Ends of multipliers within a short part of a step, before another end that is found.

use crate::error::FieldError;
use crate::event::EventFunction;
use crate::event::Found;
use crate::integrate::integrator::Integrator;

impl Integrator<'_> {
    /// Where an exit function of sliding on an intersection vanishes, others may have vanished before that were dismissed
    /// without a proof: as the determinant of their equations vanishes the multipliers go to infinity, some of them past
    /// their ends, within so short a time that nothing else in the step tells.
    pub(in crate::integrate) fn look_before_exit(
        &mut self,
        found: &mut Option<Found>,
        dt: f64,
    ) -> Result<(), FieldError> {
        let is_exit = |f: &EventFunction| matches!(f, EventFunction::Exit(_));
        let Some(theta) = found
            .as_ref()
            .filter(|event| self.detector.dismissed && event.functions.iter().any(is_exit))
            .map(|event| event.theta)
        else {
            return Ok(());
        };
        let n_sides = 2 * self.motion.sliding.len();
        let mut before = None;
        let mut gap = 0.5 * theta;
        while before.is_none() && gap > self.together(dt) {
            let at = theta - gap;
            self.stepper.interpolant().at(at, &mut self.detector.x);
            let x = &mut self.detector.x;
            let exits = self.motion.field.exits(self.t + at * dt, x)?;
            let is_beyond = exits.iter().take(n_sides).any(|&exit| exit <= 0.0);
            before = is_beyond.then_some(at);
            gap *= 0.25;
        }
        let Some(before) = before else {
            return Ok(());
        };
        for index in 0..self.motion.monitored.len() {
            let function = self.motion.monitored[index].function;
            if matches!(function, EventFunction::Exit(side) if side < n_sides) {
                let zero = self.search((index, false), (0.0, before), dt)?;
                self.keep_earliest(found, index, zero, dt);
            }
        }
        Ok(())
    }
}
