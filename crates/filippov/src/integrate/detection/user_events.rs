//! Zeros of a user's own functions.

use crate::error::FieldError;
use crate::event::{UserEvent, UserFunction};
use crate::integrate::integrator::Integrator;
use crate::integrate::motion::Motion;
use crate::status::Stop;
use crate::stepper::Interpolant;
use crate::tolerances::{EPS, SAME_TICK};

/// A zero of a user's function.
#[derive(Clone, Debug, PartialEq)]
pub struct UserZero {
    /// Its time.
    pub t: f64,
    /// The state there.
    pub y: Vec<f64>,
}

/// The user's functions and their zeros so far.
pub(in crate::integrate) struct UserEvents<'a> {
    pub(super) events: &'a [UserEvent<'a>],
    /// Value at the start of the step, per event.
    pub(super) left: Vec<f64>,
    /// Value at the start of the step before, per event.
    before: Vec<f64>,
    /// Time of the last zero, per event: divided out while it is the start of the search.
    pub(super) last: Vec<f64>,
    zeros: Vec<Vec<UserZero>>,
    /// No step has been taken yet: a zero at the very start counts, as in SciPy.
    pub(super) at_start: bool,
    /// The only function is that of the section: its zeros are returns.
    pub(in crate::integrate) is_section: bool,
}

/// Stands for a tick among the indices of functions.
const TICK: usize = usize::MAX;

impl<'a> UserEvents<'a> {
    pub fn new(events: &'a [UserEvent<'a>]) -> Self {
        let d = events.len();
        UserEvents {
            events,
            left: vec![f64::NAN; d],
            before: vec![f64::NAN; d],
            last: vec![f64::NAN; d],
            zeros: vec![Vec::new(); d],
            at_start: true,
            is_section: false,
        }
    }

    /// Evaluates the functions at the start of a motion.
    pub fn restart(&mut self, t: f64, x: &[f64]) -> Result<(), FieldError> {
        for (event, left) in self.events.iter().zip(&mut self.left) {
            *left = event.function.value(t, x)?;
        }
        Ok(())
    }

    pub fn into_zeros(self) -> Vec<Vec<UserZero>> {
        self.zeros
    }
}

impl Integrator<'_> {
    /// The zeros (theta, index) of the user's functions up to `theta`, in order; `None` if a shorter step
    /// is needed to tell them apart.
    pub(in crate::integrate) fn find_user_zeros(
        &mut self,
        theta: f64,
        t_stop: f64,
    ) -> Result<Option<Vec<(f64, usize)>>, FieldError> {
        let observer = self.recorder.observer.as_ref();
        let has_ticks = observer.is_some_and(|observer| observer.has_tick_up_to(t_stop));
        if self.user_events.events.is_empty() && !has_ticks {
            return Ok(Some(Vec::new()));
        }
        self.stepper.extend_order4(&self.x);
        let found = self.search_user_zeros(theta)?;
        if !has_ticks && found.as_ref().is_none_or(|zeros| zeros.is_empty()) {
            return Ok(found);
        }
        self.stepper.extend(&mut self.motion.field, &self.x)?;
        let mut found = self.search_user_zeros(theta)?;
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
    pub(in crate::integrate) fn record_user_zeros(
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
                self.sample(t)?;
                self.recorder.step(self.stepper.interpolant(), t, &y);
                self.t = t;
                self.x = y;
                return Ok(Some(stop));
            }
        }
        self.user_events.at_start = false;
        for k in 0..self.user_events.events.len() {
            self.user_events.before[k] = self.user_events.left[k];
            self.user_events.left[k] = self.user_value(k, theta)?;
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
    pub(in crate::integrate) fn record_zeros_here(&mut self) -> Option<Stop> {
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

    pub(super) fn user_value(&mut self, index: usize, theta: f64) -> Result<f64, FieldError> {
        let function = self.user_events.events[index].function;
        value_along(
            function,
            self.stepper.interpolant(),
            &mut self.motion,
            theta,
        )
    }
}

/// The value of a user's function along the motion.
pub(super) fn value_along(
    function: &dyn UserFunction,
    interpolant: &Interpolant,
    motion: &mut Motion,
    theta: f64,
) -> Result<f64, FieldError> {
    let t = interpolant.t0 + theta * interpolant.dt;
    let mut y = vec![0.0; interpolant.n_states()];
    interpolant.at(theta, &mut y);
    motion.project(t, &mut y)?;
    function.value(t, &y)
}
