//! Zeros of a user's own functions.

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::event::certificate::Bound;
use crate::event::isolate::{first_zero_sampled, Evidence, Zero};
use crate::event::locate::refine;
use crate::event::tube::Tube;
use crate::event::{UserEvent, UserFunction};
use crate::integrate::integrator::Integrator;
use crate::integrate::motion::Motion;
use crate::integrate::Stop;
use crate::stepper::Interpolant;
use crate::tolerances::{
    EPS, MOST_ZEROS, PIECES_OF_SERIES, SAME_TICK, SURFACE_NOISE, UNBOUNDED_DEPTH,
};

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
    events: &'a [UserEvent<'a>],
    /// Value at the start of the step, per event.
    left: Vec<f64>,
    /// Value at the start of the step before, per event.
    before: Vec<f64>,
    /// Time of the last zero, per event: divided out while it is the start of the search.
    last: Vec<f64>,
    zeros: Vec<Vec<UserZero>>,
    /// No step has been taken yet: a zero at the very start counts, as in SciPy.
    at_start: bool,
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
            let mut y: SmallVec<[f64; 8]> = SmallVec::from_elem(0.0, self.x.len());
            self.stepper.interpolant().at(at, &mut y);
            self.motion.project(t, &mut y)?;
            if let Some(stop) = self.record_zero(index, t, &y) {
                self.sample(t)?;
                self.recorder.step(self.stepper.interpolant(), t, &y);
                self.t = t;
                self.x.copy_from_slice(&y);
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

    /// How many pieces of a step are searched one after the other for zeros of a user's function.
    fn sampled_pieces(&self, index: usize) -> u32 {
        let is_sampled = !self.user_events.events[index].function.has_bounds();
        if is_sampled && self.stepper.has_series() {
            PIECES_OF_SERIES
        } else {
            1
        }
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

    fn user_value(&mut self, index: usize, theta: f64) -> Result<f64, FieldError> {
        let function = self.user_events.events[index].function;
        value_along(
            function,
            self.stepper.interpolant(),
            &mut self.motion,
            theta,
        )
    }

    /// All zeros in (0, theta], in no order. A function that is not finite has none in this step.
    fn search_user_zeros(&mut self, theta: f64) -> Result<Option<Vec<(f64, usize)>>, FieldError> {
        let mut zeros = Vec::new();
        for index in 0..self.user_events.events.len() {
            let (t0, dt) = (self.stepper.interpolant().t0, self.stepper.interpolant().dt);
            let start = self.user_events.left[index];
            let mut from = 0.0;
            let mut divided = self.user_events.last[index] == t0 || start == 0.0;
            let mut sign = if divided { 0.0 } else { start.signum() };
            let mut pieces = self.sampled_pieces(index);
            loop {
                // A function without bounds is sampled: on a long step in pieces.
                let to = theta - (theta - from) * (pieces - 1) as f64 / pieces as f64;
                if divided {
                    let probe = from + 1e-7 * (to - from);
                    sign = self.user_value(index, probe)?.signum();
                }
                if self.user_events.at_start && start == 0.0 && from == 0.0 {
                    let direction = self.user_events.events[index].direction;
                    if sign != 0.0 && direction * sign >= 0.0 {
                        zeros.push((0.0, index));
                    }
                }
                let limit = (to - from) * 1e-7;
                let function = self.user_events.events[index].function;
                let (interpolant, motion) = (self.stepper.interpolant(), &mut self.motion);
                let mut g = |at: f64| {
                    if !divided {
                        return Ok(sign * value_along(function, interpolant, motion, at)?);
                    }
                    // The zero at the start is divided out; its limit is the difference quotient.
                    let away = (at - from).max(limit);
                    Ok(sign * value_along(function, interpolant, motion, from + away)? / away)
                };
                let margin = &self.detector.margin;
                let mut bounds = |a: f64, b: f64| {
                    let enclosure = function.enclose(&Tube::new(interpolant, (a, b), margin))?;
                    Some(Bound::new(enclosure, sign, dt))
                };
                let evidence = Evidence::Bounds {
                    bounds: &mut bounds,
                    divided: i32::from(divided),
                    patience: UNBOUNDED_DEPTH,
                };
                let mut values = [0.0; 5];
                for (i, value) in values.iter_mut().enumerate() {
                    *value = g(from + (to - from) * 0.25 * i as f64)?;
                }
                // Rounding of a function whose terms are not known: that of its values.
                let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                let noise = SURFACE_NOISE * largest;
                let isolated = first_zero_sampled(&mut g, from, to, values, noise, evidence)?;
                if isolated.exhausted && !isolated.not_finite {
                    return Ok(None);
                }
                // Zero up to rounding where the motion may end, as a switching function at its switch.
                let ends_there = pieces == 1 && largest > 0.0 && values[4].abs() <= noise;
                let at = match isolated.zero {
                    Some(Zero::Crossing(bracket)) => {
                        let width = 0.5 * EPS * (t0.abs() / dt).max(1.0);
                        refine(&mut g, bracket, width)?.theta
                    }
                    _ if ends_there => theta,
                    _ if pieces == 1 => break,
                    _ => {
                        (from, divided, pieces) = (to, false, pieces - 1);
                        continue;
                    }
                };
                // A zero at the end of the step is there to the bit: the next step knows it.
                let is_last = at >= theta - self.together(dt);
                let at = if is_last { theta } else { at };
                let direction = self.user_events.events[index].direction;
                if direction * sign <= 0.0 {
                    zeros.push((at, index));
                }
                if zeros.len() > MOST_ZEROS {
                    return Ok(None);
                }
                if at <= from || is_last {
                    break;
                }
                (from, divided) = (at, true);
            }
        }
        Ok(Some(zeros))
    }
}

/// The value of a user's function along the motion.
fn value_along(
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
