//! The zeros of the user's functions, and ticks of a section, in the step that is accepted.

use filippov_expr::sort_few;
use smallvec::{smallvec, SmallVec};

use super::Recorder;
use crate::error::FieldError;
use crate::event::search::StepSearch;
use crate::event::{StepEnd, TICK};
use crate::status::Stop;
use crate::tolerances::ROUNDING;

impl Recorder<'_> {
    /// The zeros (theta, index) of the user's functions up to `theta`, in order; `None` if a shorter step is needed to tell
    /// them apart.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline(always)]
    pub fn find_user_zeros(
        &self,
        search: &mut StepSearch,
        theta: f64,
        t_stop: f64,
    ) -> Result<Option<Vec<(f64, usize)>>, FieldError> {
        let visits = self.visits.as_ref();
        let has_ticks = visits.is_some_and(|visits| visits.has_tick_up_to(t_stop));
        if self.user_events.events.is_empty() && !has_ticks {
            return Ok(Some(Vec::new()));
        }
        let mut found = search.user_zeros(&self.user_events, theta, has_ticks)?;
        if let Some(zeros) = &mut found {
            zeros.extend(self.ticks(search.stepper.interpolant(), theta, t_stop));
            sort_few(zeros, |a, b| a.0.total_cmp(&b.0).is_lt());
        }
        Ok(found)
    }

    /// Records zeros of the step up to `theta`, at `t_stop`; at one that ends the run, moves the run there and returns why.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline(always)]
    pub fn record_user_zeros(
        &mut self,
        search: &mut StepSearch,
        zeros: Vec<(f64, usize)>,
        (theta, t_stop): (f64, f64),
    ) -> Result<Option<Stop>, FieldError> {
        if self.user_events.events.is_empty() && zeros.is_empty() {
            return Ok(None);
        }
        let extension = search.stepper.interpolant();
        let (t0, dt) = (extension.t0, extension.dt);
        for (at, index) in zeros {
            // The start is no return to the section, up to rounding.
            let is_start = self.user_events.at_start && self.user_events.is_section;
            if is_start && index != TICK && at <= ROUNDING {
                self.user_events.last[index] = t0;
                continue;
            }
            let t = match &mut self.visits {
                Some(visits) if index == TICK => {
                    let tick = visits.next_tick().unwrap_or(t_stop);
                    visits.pass_tick();
                    tick.min(t_stop)
                }
                _ if at == theta => t_stop,
                _ => (t0 + at * dt).min(t_stop),
            };
            let run = &mut *search.run;
            let mut y: SmallVec<[f64; 8]> = smallvec![0.0; run.x.len()];
            search.stepper.interpolant().at(at, &mut y);
            run.motion.project(t, &mut y)?;
            if let Some(stop) = self.zero(index, t, &y) {
                self.sample_step(t, &run.x, search.stepper, &mut run.motion)?;
                self.step(search.stepper.interpolant(), t, &y);
                (run.t, run.x) = (t, y.into_vec());
                return Ok(Some(stop));
            }
        }
        let events = &mut self.user_events;
        events.at_start = false;
        events.accept_sides();
        // Where the motion ends, the next one evaluates the functions anew.
        let is_needed = theta == 1.0 || events.end == StepEnd::Stops;
        for k in 0..events.events.len() {
            events.before[k] = events.left[k];
            let known = events.at_end.get_mut()[k].value;
            events.left[k] = match is_needed {
                true if known.is_nan() => search.user_value(events.events[k].function, theta)?,
                true => known,
                false => f64::NAN,
            };
        }
        Ok(None)
    }
}
