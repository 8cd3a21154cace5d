//! What is kept of a run while it goes on.

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::error_scale::Units;
use crate::event::{UserEvent, UserEvents, UserZero, TICK};
use crate::mode::Mode;
use crate::motion::{CurrentMotion, Guard, Run};
use crate::options::{Keep, Options, Stabilization};
use crate::record::section::{Place, Section, Visits};
use crate::record::{
    DecisionRecord, Observed, ObservedStep, Segment, Segments, Solution, Step, Switches,
};
use crate::stats::Stats;
use crate::status::{Stop, Warning};
use crate::stepper::{Interpolant, Steppers};
use crate::switch::{Kind, Switch};
use crate::tolerances::{
    EPS, LATEST_SWITCHES, MOST_TOUCHES_AT_ONE_TIME, MOST_TOUCHES_IN_A_ROW, SAME_TICK,
};

/// Room that is made at once for so many steps and switches: more of them take more room then.
const USUAL_LENGTH: usize = 64;

/// Of so many last switches a message names the surfaces.
const SWITCHES_NAMED: usize = 32;

/// About so many bytes are a switch of n states.
fn bytes_of_switch(n: usize) -> usize {
    size_of::<Switch>() + 2 * n * size_of::<f64>()
}

/// Keeps what a run produces, as far as it is wanted.
///
/// The last switches are kept in any case: they tell whether switches accumulate.
pub(crate) struct Recorder<'a> {
    n: usize,
    keep: Keep,
    t: Vec<f64>,
    y: Vec<f64>,
    y0: Vec<f64>,
    /// The discrete states at `t`, where times are sampled and pieces forgotten.
    discrete_at_t: Vec<f64>,
    keep_dense: bool,
    steps: Vec<Step>,
    coefficients: Vec<f64>,
    segments: Segments,
    switches: Switches,
    /// Those that were recorded, also the ones forgotten since.
    n_switches: u64,
    /// How often the last of them, a touch, was repeated without any progress of time.
    n_repeated: usize,
    /// The last jump of the state.
    jump: Option<(f64, Vec<f64>)>,
    /// Wanted times that are sampled as the run goes on, the next one first.
    wanted: Vec<f64>,
    next: usize,
    is_sampled: bool,
    pub user_events: UserEvents<'a>,
    /// Those to the section, if there is one.
    pub visits: Option<Visits>,
    /// Is handed every step and every instant, if there is one.
    pub observed: Option<Observed<'a>>,
    /// The decisions, if they are wanted.
    pub decisions: Vec<DecisionRecord>,
}

impl<'a> Recorder<'a> {
    pub fn new(n: usize, options: &Options, events: &'a [UserEvent<'a>]) -> Self {
        let keeps_steps = options.keep == Keep::Steps;
        let keep_dense = keeps_steps && options.dense_output;
        let wanted = options.t_eval.clone().filter(|_| !keep_dense);
        let room = if keeps_steps { USUAL_LENGTH } else { 0 };
        Recorder {
            n,
            keep: options.keep,
            t: Vec::with_capacity(room),
            y: Vec::with_capacity(room * n),
            y0: vec![0.0; n],
            discrete_at_t: Vec::new(),
            keep_dense,
            steps: Vec::new(),
            coefficients: Vec::new(),
            segments: Segments::with_capacity(room),
            switches: Switches::with_capacity(room),
            n_switches: 0,
            n_repeated: 0,
            jump: None,
            is_sampled: wanted.is_some(),
            wanted: wanted.unwrap_or_default(),
            next: 0,
            user_events: UserEvents::new(events),
            visits: None,
            observed: None,
            decisions: Vec::new(),
        }
    }

    /// A recorder for a run that goes on from here, without what was recorded up to here but for the latest switches.
    pub fn without_record(&self, t: f64, x: &[f64]) -> Self {
        let latest = self.switches.latest();
        let mut switches = Switches::default();
        for switch in &latest[latest.len().saturating_sub(LATEST_SWITCHES)..] {
            switches.push(switch.clone());
        }
        let mut recorder = Recorder {
            n: self.n,
            keep: self.keep,
            t: Vec::new(),
            y: Vec::new(),
            y0: vec![0.0; self.n],
            discrete_at_t: Vec::new(),
            keep_dense: self.keep_dense,
            steps: Vec::new(),
            coefficients: Vec::new(),
            segments: Segments::default(),
            switches,
            n_switches: 0,
            n_repeated: self.n_repeated,
            jump: self.jump.clone(),
            wanted: self.wanted.clone(),
            next: self.next,
            is_sampled: self.is_sampled,
            user_events: self.user_events.without_zeros(),
            visits: None,
            observed: None,
            decisions: Vec::new(),
        };
        recorder.start(t, x);
        if let Some(last) = self.segments.latest().last() {
            recorder.segments.push(Segment {
                t_start: t,
                t_end: t,
                steps: (0, 0),
                ..last.clone()
            });
        }
        recorder
    }

    /// Forgets the steps and all but the last segment and the latest switches, and keeps no more from here on.
    pub fn keep_last_only(&mut self) {
        (self.keep, self.keep_dense) = (Keep::Last, false);
        (self.t, self.y) = (Vec::new(), Vec::new());
        (self.steps, self.coefficients) = (Vec::new(), Vec::new());
        self.segments.forget_before(1);
        if let Some(last) = self.segments.latest_mut().last_mut() {
            last.steps = (0, 0);
        }
        self.switches.forget_before(LATEST_SWITCHES);
    }

    /// How many bytes steps, segments and switches take, spare room not counted.
    pub fn n_bytes(&self) -> usize {
        let numbers = self.t.len() + self.y.len() + self.coefficients.len();
        let rows = self.segments.len() * size_of::<Segment>();
        let switches = self.switches.len() * bytes_of_switch(self.n);
        numbers * size_of::<f64>() + self.steps.len() * size_of::<Step>() + rows + switches
    }

    /// How many bytes more the latest switches may take, if there are any.
    pub fn room_for_switches(&self) -> usize {
        let missing = match self.switches.is_empty() {
            true => 0,
            false => LATEST_SWITCHES.saturating_sub(self.switches.len()),
        };
        missing * bytes_of_switch(self.n)
    }

    /// Are the continuous extensions kept, or shown to an observer?
    pub fn needs_extensions(&self) -> bool {
        self.keep_dense || self.observed.is_some()
    }

    /// Does every step go into the result?
    fn keeps_steps(&self) -> bool {
        self.keep == Keep::Steps && !self.is_sampled
    }

    fn push(&mut self, t: f64, y: &[f64]) {
        self.t.push(t);
        self.y.extend_from_slice(y);
    }

    pub fn start(&mut self, t: f64, y: &[f64]) {
        self.y0.copy_from_slice(y);
        if self.keeps_steps() {
            self.push(t, y);
        }
    }

    /// Samples the wanted times of the step from `x` that was just computed, before `t_stop`, where it ends.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline(always)]
    pub fn sample_step(
        &mut self,
        t_stop: f64,
        x: &[f64],
        stepper: &mut Steppers,
        motion: &mut CurrentMotion,
    ) -> Result<(), FieldError> {
        match self.wanted_before(t_stop) {
            None => Ok(()),
            Some(_) => self.sample_wanted(t_stop, x, stepper, motion),
        }
    }

    #[inline(never)]
    fn sample_wanted(
        &mut self,
        t_stop: f64,
        x: &[f64],
        stepper: &mut Steppers,
        motion: &mut CurrentMotion,
    ) -> Result<(), FieldError> {
        stepper.extend_cheaply(x);
        let mut y = vec![0.0; x.len()];
        while let Some(t) = self.wanted_before(t_stop) {
            let step = stepper.interpolant();
            step.at((t - step.t0) / step.dt, &mut y);
            motion.project(t, &mut y)?;
            self.sample(&y);
        }
        Ok(())
    }

    /// The next wanted time before `t_stop`, if times are sampled.
    fn wanted_before(&self, t_stop: f64) -> Option<f64> {
        let t = self.wanted.get(self.next).copied();
        t.filter(|&t| t < t_stop)
    }

    /// The state at the next wanted time.
    fn sample(&mut self, y: &[f64]) {
        let t = self.wanted[self.next];
        self.next += 1;
        self.push(t, y);
        if self.keep == Keep::Last {
            if let Some(piece) = self.segments.latest().last() {
                self.discrete_at_t.extend(&piece.discrete);
            }
        }
    }

    /// The state just recorded has jumped: the limit from the right is kept.
    pub fn jump(&mut self, t: f64, y: &[f64]) {
        self.jump = Some((t, y.to_vec()));
        if self.keeps_steps() {
            let start = self.y.len() - self.n;
            self.y[start..].copy_from_slice(y);
        }
    }

    /// The states before the first switch of this instant, which is `first`, and after the last one.
    pub fn set_jump(&mut self, first: usize, before: &[f64], after: &[f64]) {
        if let Some(switch) = self.switches.latest_mut().get_mut(first) {
            switch.y_before = SmallVec::from_slice(before);
        }
        if let Some(switch) = self.switches.latest_mut()[first..].last_mut() {
            switch.y_after = SmallVec::from_slice(after);
        }
    }

    /// The mode after the switches of this instant, of which `first` is the first.
    pub fn set_last_mode(&mut self, first: usize, after: &Mode) {
        if let Some(last) = self.switches.latest_mut()[first..].last_mut() {
            last.mode_after = after.clone();
        }
    }

    pub fn begin_segment(
        &mut self,
        t: f64,
        mode: &Mode,
        multipliers: SmallVec<[f64; 2]>,
        discrete: &[f64],
    ) {
        if let Some(visits) = &mut self.visits {
            visits.begin(t, mode);
            visits.set_piece(mode, &multipliers, discrete);
        }
        let step = self.steps.len();
        self.close_segment(t);
        self.segments.pack_earlier();
        if self.keep == Keep::Last {
            self.segments.forget_before(0);
        }
        self.segments.push(Segment {
            t_start: t,
            t_end: t,
            mode: mode.clone(),
            steps: (step, step),
            multipliers,
            discrete: discrete.to_vec(),
        });
    }

    /// Has no motion begun?
    pub fn has_no_segment(&self) -> bool {
        self.segments.is_empty()
    }

    fn close_segment(&mut self, t: f64) {
        let n_steps = self.steps.len();
        if let Some(segment) = self.segments.latest_mut().last_mut() {
            segment.t_end = t;
            segment.steps.1 = n_steps;
        }
    }

    /// A step up to `t_stop`, where the state is `y`.
    pub fn step(&mut self, interpolant: &Interpolant, t_stop: f64, y: &[f64]) {
        let (t0, dt) = (interpolant.t0, interpolant.dt);
        if t_stop <= t0 {
            return;
        }
        if self.observed.is_some() {
            self.show_step(interpolant, t_stop, y);
        }
        if self.keep_dense {
            let (from, coefficients) = (self.coefficients.len(), interpolant.coefficients());
            if from == 0 {
                self.steps.reserve(USUAL_LENGTH);
                self.coefficients.reserve(USUAL_LENGTH * coefficients.len());
            }
            self.coefficients.extend_from_slice(coefficients);
            self.steps.push(Step {
                t0,
                dt,
                t_stop,
                coefficients: (from, self.coefficients.len()),
                basis: interpolant.basis(),
            });
        }
        if self.keeps_steps() {
            self.push(t_stop, y);
        }
        if self.keep != Keep::Last {
            self.switches.pack_earlier();
        } else if self.switches.len() > 2 * LATEST_SWITCHES {
            self.switches.forget_before(LATEST_SWITCHES);
        }
    }

    /// A motion ends where these guards vanish, or at a known time: the observer is told, if there is one.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[cold]
    #[inline(never)]
    pub fn leave(&mut self, run: &mut Run, guards: &[Guard]) -> Result<(), FieldError> {
        match &mut self.observed {
            Some(observed) => observed.leave(run, guards),
            None => Ok(()),
        }
    }

    /// The motion that follows this instant is the same as that of the system up to the tolerance only.
    pub fn replace(&mut self) {
        if let Some(observed) = &mut self.observed {
            observed.replace();
        }
    }

    #[cold]
    #[inline(never)]
    fn show_step(&mut self, interpolant: &Interpolant, t_stop: f64, y: &[f64]) {
        if let (Some(observed), Some(segment)) = (&mut self.observed, self.segments.latest().last())
        {
            let motion = (&segment.mode, &segment.discrete[..]);
            observed.step(&ObservedStep::new(motion, (t_stop, y), interpolant));
        }
    }

    /// Watches the run at a section; its function, if it has one, is the only one of the user's events.
    pub fn observe(&mut self, section: &Section, t_start: f64) {
        self.user_events.is_section = matches!(section.place, Place::Function { .. });
        self.visits = Some(Visits::new(section, t_start));
    }

    /// Why the run ends because of its section, if it does.
    pub fn stop_at_section(&self) -> Option<Stop> {
        self.visits.as_ref()?.stop()
    }

    /// The ticks of the section's clock in a step up to `theta`, where the time is `t_stop`.
    pub fn ticks(&self, step: &Interpolant, theta: f64, t_stop: f64) -> Vec<(f64, usize)> {
        let latest = t_stop + SAME_TICK * t_stop.abs();
        let tick = |k| self.visits.as_ref()?.tick_after(k);
        let times = (0..).map_while(tick).take_while(|&t| t <= latest);
        let place = |t: f64| match t >= t_stop {
            true => theta,
            false => (t - step.t0) / step.dt,
        };
        times.map(|t| (place(t).min(theta), TICK)).collect()
    }

    /// Takes down a zero of a user's function, or a return to the section; says whether the run ends with it, and why.
    pub fn zero(&mut self, index: usize, t: f64, y: &[f64]) -> Option<Stop> {
        let events = &mut self.user_events;
        if index != TICK {
            events.last[index] = t;
        }
        if index == TICK || events.is_section {
            let visits = self.visits.as_mut()?;
            visits.returned(t, y);
            return visits.stop();
        }
        events.zeros[index].push(UserZero { t, y: y.to_vec() });
        events.n_zeros[index] += 1;
        let terminal = events.events[index].terminal;
        let is_last = terminal > 0 && events.n_zeros[index] >= terminal;
        is_last.then_some(Stop::TerminalEvent(index))
    }

    /// Takes down the zeros of functions that are within rounding of zero where the state is about to jump; why the run ends
    /// with one of them, if it does.
    pub fn zeros_before_jump(&mut self, t: f64, y: &[f64]) -> Option<Stop> {
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
            if let Some(stop) = self.zero(k, t, y) {
                return Some(stop);
            }
        }
        None
    }

    pub fn switch(&mut self, switch: Switch) {
        if let Some(visits) = &mut self.visits {
            visits.switched(&switch);
        }
        self.n_repeated = 0;
        self.n_switches += 1;
        self.switches.push(switch);
    }

    /// The latest switches: all of them, or many.
    pub fn switches(&self) -> &[Switch] {
        self.switches.latest()
    }

    /// The surfaces of the switches recorded at this time.
    pub fn surfaces_switched_at(&self, t: f64) -> Vec<usize> {
        let latest = self.switches().iter().rev().take_while(|s| s.t == t);
        let mut surfaces: Vec<usize> = latest.flat_map(|s| s.surfaces.iter().copied()).collect();
        surfaces.sort_unstable();
        surfaces.dedup();
        surfaces
    }

    /// Are the last switches so many touches at this very time that they look endless?
    pub fn only_touches_at(&self, t: f64) -> bool {
        let latest = self.switches().iter().rev();
        let touches = latest.take_while(|s| s.t == t && s.kind == Kind::Grazing);
        let recorded = touches.take(MOST_TOUCHES_AT_ONE_TIME).count();
        recorded > 0 && recorded + self.n_repeated >= MOST_TOUCHES_AT_ONE_TIME
    }

    /// Is a switch between these modes, at these surfaces, the touch that was recorded last? Then nothing happens.
    pub fn repeats_touch(
        &mut self,
        t: f64,
        (before, after): (&Mode, &Mode),
        surfaces: &[usize],
    ) -> bool {
        let is_same = |last: &Switch| {
            last.kind == Kind::Grazing
                && last.t == t
                && last.mode_after == *after
                && last.surfaces[..] == *surfaces
        };
        let repeats = before == after && self.switches().last().is_some_and(is_same);
        if repeats {
            self.n_repeated += 1;
            if let Some(observed) = &mut self.observed {
                observed.stay();
            }
        }
        repeats
    }

    /// The surface that the last switches have touched, if they are so many touches of it that it may be at rest there.
    pub fn surface_touched_in_a_row(&self) -> Option<usize> {
        let &[j] = &self.switches().last()?.surfaces[..] else {
            return None;
        };
        let latest = self.switches().iter().rev();
        let touches = latest.take_while(|s| s.kind == Kind::Grazing && s.surfaces[..] == [j]);
        let recorded = touches.take(MOST_TOUCHES_IN_A_ROW).count();
        (recorded + self.n_repeated >= MOST_TOUCHES_IN_A_ROW).then_some(j)
    }

    /// Makes the switches, if they are wanted, and the ends the points of the result.
    fn list_switches(&mut self, t_last: f64, x: &[f64]) {
        if self.keep == Keep::Switches {
            let t_start = self.segments.first().map_or(t_last, |s| s.t_start);
            let y0 = self.y0.clone();
            self.push(t_start, &y0);
            let switches = std::mem::take(&mut self.switches);
            for switch in switches.iter().filter(|s| s.t > t_start && s.t < t_last) {
                self.push(switch.t, &switch.y_after);
            }
            self.switches = switches;
        }
        if self.t.last() != Some(&t_last) {
            self.push(t_last, x);
        }
    }

    #[allow(clippy::too_many_arguments)]
    pub fn finish(
        mut self,
        (t_last, x, options): (f64, &[f64], &Options),
        (mode, discrete, sides): (Mode, Vec<f64>, Vec<i8>),
        stop: Stop,
        mut stats: Stats,
        warnings: Vec<Warning>,
    ) -> Solution {
        stats.n_switches = self.n_switches;
        self.close_segment(t_last);
        let jump = self.jump.take().filter(|(t, _)| *t == t_last);
        if self.is_sampled {
            while self.wanted.get(self.next) == Some(&t_last) {
                self.sample(x);
            }
        } else if self.keep != Keep::Steps {
            self.list_switches(t_last, x);
        }
        let mut last_switched: Vec<usize> = Vec::new();
        if stats.here_since.is_some() {
            let latest = self.switches().iter().rev().take(SWITCHES_NAMED);
            last_switched.extend(latest.flat_map(|switch| &switch.surfaces));
            last_switched.sort_unstable();
            last_switched.dedup();
        }
        if self.keep == Keep::Last {
            self.switches = Switches::default();
        }
        if self.keep != Keep::Steps {
            // A result may be kept for long, beside many others.
            self.switches.pack();
            self.segments.pack();
            self.t.shrink_to_fit();
            self.y.shrink_to_fit();
        }
        Solution {
            y_end: jump.map(|(_, y)| y),
            n_states: self.n,
            t: self.t,
            y: self.y,
            switches: self.switches,
            segments: self.segments,
            user_zeros: self.user_events.into_zeros(),
            stop,
            t_last,
            sliding: options.sliding,
            is_projected: options.stabilization == Stabilization::Projection,
            units: Units::from(options).parts(self.n),
            mode,
            discrete,
            discrete_at_t: self.discrete_at_t,
            sides,
            stats,
            warnings,
            steps: self.steps,
            coefficients: self.coefficients,
            returns: self.visits.map(Visits::into_returns),
            decisions: self.decisions,
            y0: self.y0,
            y_last: x.to_vec(),
            last_switched,
        }
    }
}
