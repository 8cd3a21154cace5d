//! Zeros of the user's functions and ticks of a section: taken down as the run goes on.

use super::integrator::Integrator;
use crate::error::FieldError;
use crate::event::{UserZero, TICK};
use crate::status::Stop;
use crate::tolerances::{EPS, SAME_TICK};

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
        if self.user_events.events.is_empty() && !has_ticks {
            return Ok(Some(Vec::new()));
        }
        let (mut search, events) = self.step_search();
        let mut found = search.user_zeros(events, theta, has_ticks)?;
        if let Some(zeros) = &mut found {
            zeros.extend(self.ticks(theta, t_stop));
            zeros.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        Ok(found)
    }

    /// The ticks of the section's clock in a step up to `theta`, where the time is `t_stop`.
    fn ticks(&self, theta: f64, t_stop: f64) -> Vec<(f64, usize)> {
        let (t0, dt) = (self.stepper.interpolant().t0, self.stepper.interpolant().dt);
        let latest = t_stop + SAME_TICK * t_stop.abs();
        let observer = self.recorder.observer.as_ref();
        let tick = |k| observer.and_then(|observer| observer.tick_after(k));
        let times = (0..).map_while(tick).take_while(|&t| t <= latest);
        let place = |t: f64| if t >= t_stop { theta } else { (t - t0) / dt };
        times.map(|t| (place(t).min(theta), TICK)).collect()
    }

    /// Records zeros; at one that ends the run, accepts the step up to there and returns why.
    pub(super) fn record_user_zeros(
        &mut self,
        zeros: Vec<(f64, usize)>,
        theta: f64,
        t_stop: f64,
    ) -> Result<Option<Stop>, FieldError> {
        if self.user_events.events.is_empty() && zeros.is_empty() {
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
            if let Some(stop) = self.record_zero(index, t, &y) {
                let (stepper, motion) = (&mut self.stepper, &mut self.motion);
                self.recorder.sample_step(t, &self.x, stepper, motion)?;
                self.recorder.step(self.stepper.interpolant(), t, &y);
                self.t = t;
                self.x = y;
                return Ok(Some(stop));
            }
        }
        self.user_events.at_start = false;
        for k in 0..self.user_events.events.len() {
            self.user_events.before[k] = self.user_events.left[k];
            let function = self.user_events.events[k].function;
            let (mut search, _) = self.step_search();
            self.user_events.left[k] = search.user_value(function, theta)?;
        }
        Ok(None)
    }

    /// Takes down a zero, or a return to the section; says whether the run ends with it, and why.
    fn record_zero(&mut self, index: usize, t: f64, y: &[f64]) -> Option<Stop> {
        let events = &mut self.user_events;
        if index != TICK {
            events.last[index] = t;
        }
        if index == TICK || events.is_section {
            let observer = self.recorder.observer.as_mut()?;
            observer.returned(t, y);
            return observer.stop();
        }
        events.zeros[index].push(UserZero { t, y: y.to_vec() });
        let terminal = events.events[index].terminal;
        let is_last = terminal > 0 && events.zeros[index].len() as u64 >= terminal;
        is_last.then_some(Stop::TerminalEvent(index))
    }

    /// Records the zeros of functions that are within rounding of zero where the state is about to jump; returns the
    /// reason if one of them ends the run.
    pub(super) fn record_zeros_here(&mut self) -> Option<Stop> {
        let t = self.t;
        if self.user_events.at_start {
            return None;
        }
        for k in 0..self.user_events.events.len() {
            let events = &self.user_events;
            let (before, here) = (events.before[k], events.left[k]);
            let is_zero = here.abs() <= 4.0 * EPS * before.abs();
            let direction = events.events[k].direction;
            if !is_zero || events.last[k] == t || direction * before > 0.0 {
                continue;
            }
            let y = self.x.clone();
            if let Some(stop) = self.record_zero(k, t, &y) {
                return Some(stop);
            }
        }
        None
    }
}
