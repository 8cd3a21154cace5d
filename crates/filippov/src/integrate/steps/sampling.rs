//! Wanted times, sampled as the run goes on where the continuous extensions are not kept.

use crate::error::FieldError;
use crate::integrate::integrator::Integrator;

impl Integrator<'_> {
    /// Samples the wanted times of the step that was just computed, before `t_stop`, where it ends.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub(in crate::integrate) fn sample(&mut self, t_stop: f64) -> Result<(), FieldError> {
        if self.recorder.wanted_before(t_stop).is_none() {
            return Ok(());
        }
        self.stepper.extend_order4(&self.x);
        let mut y = vec![0.0; self.x.len()];
        while let Some(t) = self.recorder.wanted_before(t_stop) {
            let step = self.stepper.interpolant();
            step.at((t - step.t0) / step.dt, &mut y);
            self.motion.project(t, &mut y)?;
            self.recorder.sample(&y);
        }
        Ok(())
    }
}
