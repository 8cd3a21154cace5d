//! Zeros of the user's functions and ticks of a section: taken down as the run goes on.

use super::integrator::Integrator;
use crate::error::FieldError;
use crate::event::TICK;
use crate::status::Stop;

impl Integrator<'_> {
    /// The zeros (theta, index) of the user's functions up to `theta`, in order; `None` if a shorter step
    /// is needed to tell them apart.
    pub(super) fn find_user_zeros(
        &mut self,
        theta: f64,
        t_stop: f64,
    ) -> Result<Option<Vec<(f64, usize)>>, FieldError> {
        let observer = self.recorder.observer.as_ref();
        let has_ticks = observer.is_some_and(|observer| observer.has_tick_up_to(t_stop));
        if self.recorder.user_events.events.is_empty() && !has_ticks {
            return Ok(Some(Vec::new()));
        }
        let (mut search, events) = self.step_search();
        let mut found = search.user_zeros(events, theta, has_ticks)?;
        if let Some(zeros) = &mut found {
            zeros.extend(
                self.recorder
                    .ticks(self.stepper.interpolant(), theta, t_stop),
            );
            zeros.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        Ok(found)
    }

    /// Records zeros; at one that ends the run, accepts the step up to there and returns why.
    pub(super) fn record_user_zeros(
        &mut self,
        zeros: Vec<(f64, usize)>,
        theta: f64,
        t_stop: f64,
    ) -> Result<Option<Stop>, FieldError> {
        if self.recorder.user_events.events.is_empty() && zeros.is_empty() {
            return Ok(None);
        }
        let (t0, dt) = (self.stepper.interpolant().t0, self.stepper.interpolant().dt);
        for (at, index) in zeros {
            let t = match &mut self.recorder.observer {
                Some(observer) if index == TICK => {
                    let tick = observer.next_tick().unwrap_or(t_stop);
                    observer.pass_tick();
                    tick.min(t_stop)
                }
                _ if at == theta => t_stop,
                _ => (t0 + at * dt).min(t_stop),
            };
            let mut y = vec![0.0; self.x.len()];
            self.stepper.interpolant().at(at, &mut y);
            self.motion.project(t, &mut y)?;
            if let Some(stop) = self.recorder.zero(index, t, &y) {
                let (stepper, motion) = (&mut self.stepper, &mut self.motion);
                self.recorder.sample_step(t, &self.x, stepper, motion)?;
                self.recorder.step(self.stepper.interpolant(), t, &y);
                self.t = t;
                self.x = y;
                return Ok(Some(stop));
            }
        }
        self.recorder.user_events.at_start = false;
        for k in 0..self.recorder.user_events.events.len() {
            self.recorder.user_events.before[k] = self.recorder.user_events.left[k];
            let function = self.recorder.user_events.events[k].function;
            let (mut search, _) = self.step_search();
            self.recorder.user_events.left[k] = search.user_value(function, theta)?;
        }
        Ok(None)
    }
}
