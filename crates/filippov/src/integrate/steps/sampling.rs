//! Wanted times, sampled as the run goes on where the continuous extensions are not kept; the section of a run.

use crate::error::FieldError;
use crate::integrate::integrator::Integrator;
use crate::record::section::{Observer, Place, Section};
use crate::status::Stop;

impl Integrator<'_> {
    /// Observes the run at a section; its function, if it has one, is the only one of the user's events.
    pub(in crate::integrate) fn observe(&mut self, section: &Section) {
        self.user_events.is_section = matches!(section.place, Place::Function { .. });
        self.recorder.observer = Some(Observer::new(section, self.t));
    }

    /// Why the run ends at this point because of its section, if it does.
    pub(in crate::integrate) fn stop_at_section(&self) -> Option<Stop> {
        self.recorder.observer.as_ref()?.stop()
    }

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
