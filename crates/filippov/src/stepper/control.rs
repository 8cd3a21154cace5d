//! How long the next step is.

use super::chatter::ChatterWatch;
use super::duties::Ready;
use super::initial_step::{initial_step, restart_step};
use super::pace::{excursion, Paces};
use super::stiffness::{Stiff, Stiffness};
use super::{Controller, Steppers};
use crate::error::FieldError;
use crate::motion::{Leading, ModeField, Run};
use crate::options::Method;
use crate::status::{Stop, Warning, WarningCode};
use crate::system::is_zero_within;
use crate::tolerances::{AIM_MARGINS, EPS, JUMP_SHRINK, ONE_SIDED_AIM, ROUNDING, SMALLEST_GUESS};

/// The control of the step: the proposed length, and what was seen of the steps before.
#[derive(Clone)]
pub(crate) struct StepControl {
    /// Proposed step; NaN if the next motion is to take a guess of its own.
    dt: f64,
    /// The step that was proposed if the next known time shortened it, else 0.
    wanted: f64,
    controller: Controller,
    /// How the last motion went, by mode.
    paces: Paces,
    /// The last attempt met a point where the field does not exist.
    one_sided: bool,
    /// Some attempt of this run met such a point.
    meets_edges: bool,
    /// How often the step was taken anew to end at an event.
    n_aims: usize,
    /// Largest recent step of this motion.
    recent: f64,
    /// Since a jump of the field that no surface declares, if the steps have been short since then.
    chatter: ChatterWatch,
    stiffness: Stiffness,
}

impl StepControl {
    pub fn new() -> Self {
        StepControl {
            dt: f64::NAN,
            wanted: 0.0,
            controller: Controller::default(),
            paces: Paces::default(),
            one_sided: false,
            meets_edges: false,
            n_aims: 0,
            recent: 0.0,
            chatter: ChatterWatch::default(),
            stiffness: Stiffness::default(),
        }
    }

    /// Did the last attempt meet a point where the field does not exist?
    pub fn is_one_sided(&self) -> bool {
        self.one_sided
    }

    /// The time from which on the run counts as stiff.
    pub fn stiff_since(&self) -> Option<f64> {
        self.stiffness.since
    }

    /// Keeps the pace of the motion that ends here, unless a series tells its steps.
    pub fn remember(&mut self, run: &Run, steppers: &Steppers) {
        if !steppers.is_series() {
            let duration = run.t - run.motion.t_start;
            self.paces.remember(&run.motion.mode, self.dt, duration);
        }
    }

    /// A motion starts that lasts at most to `t_end`, and leaves these surfaces with these derivatives.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline(always)]
    pub fn begin(
        &mut self,
        at: &mut Run,
        steppers: &Steppers,
        t_end: f64,
        left: impl Iterator<Item = (usize, Leading)>,
    ) -> Result<(), FieldError> {
        self.controller.restart();
        self.dt = self.first_step(at, steppers, t_end, left)?;
        Ok(())
    }

    /// The first step of a motion: what the last motion in its mode suggests; else the proposal of the
    /// motion before, as far as Hairer's guess for this one supports it. No longer than a short
    /// excursion from the surface.
    fn first_step(
        &self,
        at: &mut Run,
        steppers: &Steppers,
        t_end: f64,
        left: impl Iterator<Item = (usize, Leading)>,
    ) -> Result<f64, FieldError> {
        let remaining = (t_end - at.t).max(f64::MIN_POSITIVE);
        if let (Some(first), true) = (at.options.first_step, self.dt.is_nan()) {
            return Ok(first.max(SMALLEST_GUESS).min(remaining));
        }
        let longest = remaining.min(at.options.max_step);
        if steppers.is_series() {
            // The series tells.
            return Ok(longest);
        }
        let (t, x, scale, field) = (at.t, &at.x, &at.scale, &mut at.motion.field);
        let derivative = steppers.start_derivative();
        let mode = &at.motion.mode;
        // What was proposed while t was nearer to 0 may be too short to go on with here.
        let is_step = |dt: &f64| *dt > shortest_step(t);
        let pace = self.paces.first_step(mode, x, derivative, scale);
        let mut dt = match pace.filter(is_step) {
            Some(dt) => dt.min(longest),
            // At rest a series has proposed any step, and the derivative supports it whatever the load does.
            None if is_step(&self.dt)
                && (self.dt.is_finite() || scale.norm(derivative, x) > 0.0) =>
            {
                restart_step(field, t, x, derivative, scale, self.dt.min(longest))?
            }
            None => initial_step(field, t, x, derivative, scale, longest)?,
        };
        let place = at.motion.setting().at(t, x);
        for (j, leading) in left {
            dt = dt.min(excursion(at.system, &place, mode, j, leading)?);
        }
        Ok(dt)
    }

    /// Makes the proposed step no longer than this.
    pub fn limit(&mut self, longest: f64) {
        self.dt = self.dt.min(longest);
    }

    /// The proposed step.
    pub fn proposal(&self) -> f64 {
        self.dt
    }

    /// The next motion takes a guess of its own: the steps have shrunk towards an edge of the field.
    pub fn forget_proposal(&mut self) {
        self.dt = f64::NAN;
        self.one_sided = false;
    }

    /// The motion has jumped or switched: its steps before say nothing about those to come.
    pub fn forget_steps(&mut self) {
        self.recent = 0.0;
    }

    /// The motion has switched: steps are short for another reason now.
    pub fn switched(&mut self) {
        self.recent = 0.0;
        self.chatter.forget();
    }

    /// Prepares the next step. If the method of the motion takes no more steps of it, DOPRI5 starts with a guess of its own,
    /// and a warning is returned if the user asked for the other one.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline(always)]
    pub fn prepare(
        &mut self,
        at: &mut Run,
        steppers: &mut Steppers,
        t_end: f64,
    ) -> Result<Option<Box<Warning>>, FieldError> {
        match steppers.prepare(at)? {
            Ready::UpTo(longest) => self.limit(longest),
            Ready::NotThisStep => {}
            Ready::NotThisMotion => {
                let warning = steppers.leave_motion(at);
                self.dt = f64::NAN;
                self.dt = self.first_step(at, steppers, t_end, std::iter::empty())?;
                return Ok(warning);
            }
        }
        Ok(None)
    }

    /// The length of the next step: at most `max_step`, and at most the time that `remains` up to the next known time, which is
    /// the end of the run or not.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[inline(always)]
    pub fn next(&mut self, at: &Run, (remains, is_end): (f64, bool)) -> Result<f64, FieldError> {
        let dt = self.aim_at_surface(self.dt.min(at.options.max_step), at)?;
        self.wanted = 0.0;
        if dt < remains * 0.99 {
            return Ok(dt);
        }
        if !is_end {
            self.wanted = dt;
        }
        Ok(remains)
    }

    /// Where a field was found to end at its surfaces, a step that would pass the next one aims at it
    /// from the start, close enough for the continuous extension to reach it.
    #[inline(always)]
    fn aim_at_surface(&mut self, dt: f64, at: &Run) -> Result<f64, FieldError> {
        if !self.meets_edges || self.one_sided {
            return Ok(dt);
        }
        let nearest = nearest_surface(at)?;
        if nearest > dt {
            return Ok(dt);
        }
        self.one_sided = true;
        Ok(ONE_SIDED_AIM * nearest)
    }

    /// After an attempt with an error that is too large.
    pub fn reject(&mut self, steppers: &Steppers, dt: f64, error: f64) {
        self.dt = dt * steppers.after_rejection(&mut self.controller, error);
    }

    /// After a step that was not finite: aims at the surface that the motion approaches, or shortens
    /// the step if it did so already.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn shorten_to_surface(&mut self, dt: f64, at: &Run) -> Result<(), FieldError> {
        self.controller.not_finite();
        if let ModeField::Intersection(field) = &at.motion.field {
            if field.is_rootless() {
                // No edge of the field: the multipliers end, or move fast.
                self.dt = 0.5 * dt;
                return Ok(());
            }
        }
        let aim = ONE_SIDED_AIM * nearest_surface(at)?;
        let aims = !self.one_sided && aim < dt;
        self.dt = if aims { aim } else { 0.5 * dt };
        self.one_sided = true;
        self.meets_edges = true;
        Ok(())
    }

    /// After a step whose events could not be decided.
    pub fn shorten(&mut self, dt: f64) {
        self.dt = dt;
        self.one_sided = true;
        self.controller.not_finite();
    }

    /// Is the step of length `dt` from `t` to be taken anew, so that it ends just behind the event at `theta`?
    #[cold]
    #[inline(never)]
    pub fn aims_again(&mut self, t: f64, theta: f64, dt: f64) -> bool {
        let Some(margin) = AIM_MARGINS.get(self.n_aims) else {
            return false;
        };
        let aimed = theta * dt * (1.0 + margin);
        if aimed >= dt || theta * dt * margin <= EPS * t.abs() {
            return false;
        }
        self.n_aims += 1;
        self.dt = aimed;
        true
    }

    /// After a step with this error was accepted.
    #[inline(always)]
    pub fn accept(&mut self, steppers: &Steppers, dt: f64, error: f64) {
        self.n_aims = 0;
        let next = steppers.after_acceptance(&mut self.controller, dt, error);
        self.dt = next.max(self.wanted);
    }

    /// The field ends beyond the accepted step of length `dt` if the next one may only be as long as `longest`.
    #[inline(always)]
    pub fn note_edge(&mut self, longest: f64, dt: f64) {
        self.one_sided = longest < dt;
        self.dt = self.dt.min(longest);
    }

    /// Is an accepted step of length `dt` far shorter than its predecessors, and than the time that `remains`?
    #[inline(always)]
    pub fn is_short(&self, dt: f64, remains: f64) -> bool {
        dt < JUMP_SHRINK * self.recent && dt < remains
    }

    /// Warns if the field jumps over the short step from `t` of length `dt` that was accepted.
    #[cold]
    pub fn look_for_jump(&mut self, steppers: &Steppers, (t, dt): (f64, f64)) -> Option<Warning> {
        if self.meets_edges || !steppers.field_jumps() {
            return None;
        }
        self.chatter.suspect(t, self.recent);
        self.recent = 0.0;
        Some(Warning {
            t: t + dt,
            code: WarningCode::UndeclaredJump,
            text: "the right-hand side jumps here and no surface is declared; give its switching function in \
                   surfaces="
                .into(),
            candidates: Vec::new(),
            surfaces: Vec::new(),
            rule: "",
        })
    }

    /// Keeps the length of an accepted step.
    #[inline(always)]
    pub fn note_length(&mut self, dt: f64) {
        self.recent = dt.max(0.98 * self.recent);
    }

    /// The end of the run if the motion chatters along jumps of the field, the accepted step being this long.
    #[inline(always)]
    pub fn look_for_chatter(&mut self, steppers: &Steppers, dt: f64) -> Option<Stop> {
        self.chatter.note_step(dt, || steppers.field_jumps())
    }

    /// Is the step after that many accepted ones to be looked at for stiffness?
    #[inline(always)]
    pub fn stiffness_is_due(&self, n_steps: u64) -> bool {
        self.stiffness.is_due(n_steps)
    }

    /// Looks for stiffness in an accepted step.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[cold]
    #[inline(never)]
    pub fn look_for_stiffness(
        &mut self,
        at: &mut Run,
        steppers: &mut Steppers,
    ) -> Result<Stiff, FieldError> {
        let Some(is_limited) = steppers.is_limited_by_stability(at)? else {
            return Ok(Stiff::Nothing);
        };
        if !self.stiffness.count(is_limited) {
            return Ok(Stiff::Nothing);
        }
        self.stiffness.since = Some(at.t);
        if at.options.method == Method::Auto {
            return Ok(Stiff::GoOnImplicitly);
        }
        let (t, mode, dt) = (at.t, &at.motion.mode, steppers.interpolant().dt);
        let text = format!(
            "the motion in mode ({mode}) is stiff near t = {t:.10}: stability and not accuracy keeps its steps at \
             {dt:.3e}; method=\"Rodas5P\" takes longer ones"
        );
        Ok(Stiff::Warning(Box::new(Warning {
            t,
            code: WarningCode::Stiff,
            surfaces: Vec::new(),
            text,
            candidates: Vec::new(),
            rule: "",
        })))
    }

    /// Leaves the rest of the motion to the method for stiff motions.
    pub fn go_on_implicitly(&mut self, at: &mut Run, steppers: &mut Steppers) {
        // A Taylor step has no proposal for the next one.
        self.dt = steppers.interpolant().dt;
        steppers.go_on_implicitly(at);
        self.controller.restart();
    }
}

/// The shortest step from this time: below it the time does not move.
pub(crate) fn shortest_step(t: f64) -> f64 {
    (ROUNDING * t.abs()).max(f64::MIN_POSITIVE)
}

/// Predicted time to the next zero of what is monitored. A zero within the shortest step has to be near by its value too:
/// beside a root the slope of a function far from zero is so large that it would vanish at once.
fn nearest_surface(at: &Run) -> Result<f64, FieldError> {
    let (mut nearest, shortest) = (f64::INFINITY, shortest_step(at.t));
    for m in &at.motion.monitored {
        let time = m.time_to_zero();
        if time >= nearest {
            continue;
        }
        if let (Some(j), true) = (m.surface(), ONE_SIDED_AIM * time < shortest) {
            let place = at.motion.setting().at(at.t, &at.x);
            let value = (j, m.orientation * m.value);
            if !is_zero_within(at.system, &place, value, &at.scale)? {
                continue;
            }
        }
        nearest = time;
    }
    Ok(nearest)
}
