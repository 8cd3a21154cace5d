//! The switching stage: from a located event to the next motion.

use smallvec::{smallvec, SmallVec};

use crate::error::FieldError;
use crate::event::{Deflation, EventFunction};
use crate::field::{eval_on_side, Projector, SmoothField};
use crate::integrate::detection::detect::Found;
use crate::integrate::integrator::Integrator;
use crate::integrate::motion::ModeField;
use crate::integrate::Stop;
use crate::mode::Mode;
use crate::solution::Switch;
use crate::switching::{decide, first_nonzero, Arrival, Decision, Kind, Leading};
use crate::tolerances::{MOST_SWITCHES_AT_ONE_TIME, NO_PROGRESS, SURFACE_NOISE};

/// One value per surface; few are kept without allocation.
pub(in crate::integrate) type Values = SmallVec<[f64; 8]>;

/// What vanishes at the start of a motion, seldom more than two functions.
pub(in crate::integrate) type Lefts = SmallVec<[Left; 2]>;

/// What follows, and what vanishes at its start; or why the run ends.
pub(in crate::integrate) type Decided = Result<(Mode, Lefts), Stop>;

/// A function that vanishes at the start of a motion, with its first non-vanishing derivative.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrate) enum Left {
    /// The surface is left with this derivative of h.
    Surface(usize, Leading),
    /// Sliding starts with a vanishing exit function; the derivative of the normal component.
    Exit(EventFunction, Leading),
}

impl Left {
    /// What vanishes after the decision at surface `j`.
    pub fn after(j: usize, decision: &Decision) -> Lefts {
        if let Some(motion) = decision.starts_at_two_fold() {
            let first = |value: f64| Leading { order: 1, value };
            return smallvec![
                Left::Exit(EventFunction::ExitMinus, first(motion.minus)),
                Left::Exit(EventFunction::ExitPlus, first(motion.plus)),
            ];
        }
        match decision.entry {
            -1 => smallvec![Left::Surface(j, decision.minus)],
            1 => smallvec![Left::Surface(j, decision.plus)],
            _ => [
                (EventFunction::ExitMinus, decision.minus),
                (EventFunction::ExitPlus, decision.plus),
            ]
            .into_iter()
            .filter(|(_, leading)| leading.order > 1)
            .map(|(function, leading)| {
                // The normal component is the derivative of h: one order less.
                Left::Exit(
                    function,
                    Leading {
                        order: leading.order - 1,
                        value: leading.value,
                    },
                )
            })
            .collect(),
        }
    }

    /// The surface that is left; for an exit function there is none.
    pub fn surface(&self) -> usize {
        match self {
            Left::Surface(j, _) => *j,
            Left::Exit(..) => usize::MAX,
        }
    }

    fn deflation(self, t: f64) -> Option<(EventFunction, Deflation)> {
        let (function, leading) = match self {
            Left::Surface(j, leading) => (EventFunction::Surface(j), leading),
            Left::Exit(function, leading) => (function, leading),
        };
        (leading.order > 0).then(|| {
            let order = i32::try_from(leading.order).unwrap_or(1);
            // In the sense of the mode every monitored function starts out positive.
            (
                function,
                Deflation {
                    t,
                    order,
                    leading: leading.coefficient().abs(),
                    residual: 0.0,
                    is_clean: false,
                    blur: 0.0,
                },
            )
        })
    }
}

/// The surfaces among the functions of an event, in order.
pub(in crate::integrate) fn located_surfaces(event: &Found) -> SmallVec<[usize; 4]> {
    let mut surfaces = SmallVec::new();
    for function in &event.functions {
        if let EventFunction::Surface(j) = *function {
            surfaces.push(j);
        }
    }
    surfaces.sort_unstable();
    surfaces
}

/// How many normal components of sliding on one surface vanish.
fn n_exits(event: &Found) -> usize {
    let exits = [EventFunction::ExitMinus, EventFunction::ExitPlus];
    event.functions.iter().filter(|f| exits.contains(f)).count()
}

impl Integrator<'_> {
    /// Values of all switching functions at the current point.
    pub(in crate::integrate) fn surface_values(
        &mut self,
        signs: &[f64],
    ) -> Result<Values, FieldError> {
        let mut h: Values = smallvec![0.0; self.system.n_surfaces()];
        self.system.surfaces(self.t, &self.x, signs, &mut h)?;
        self.stats.n_surface_evaluations += 1;
        Ok(h)
    }

    /// Decides what follows the event and starts it.
    pub(in crate::integrate) fn switch(
        &mut self,
        event: &Found,
    ) -> Result<Option<Stop>, FieldError> {
        self.stats.n_switches += 1;
        let (since, before) = self.last_switch;
        let is_progress = self.t != since && self.t - since > NO_PROGRESS * self.t.abs();
        let repeated = if is_progress || since.is_nan() {
            self.last_switch = (self.t, 0);
            0
        } else {
            self.last_switch.1 = before + 1;
            before + 1
        };
        if repeated > MOST_SWITCHES_AT_ONE_TIME {
            if let Some(limit) = self.limit_here()? {
                let mode = self.motion.mode.clone();
                return self.jump_to(limit, mode);
            }
            let mut surfaces = self.recorder.surfaces_switched_at(self.t);
            if surfaces.is_empty() {
                let named = event.functions.iter().filter_map(|f| match f {
                    EventFunction::Surface(j) => Some(*j),
                    _ => None,
                });
                surfaces.extend(named);
            }
            return Ok(Some(Stop::NoProgress { surfaces }));
        }
        if !self.actions.list.is_empty() {
            let signs = self.motion.signs.clone();
            let h = self.surface_values(&signs)?;
            if let Some(done) = self.act_at_event(event, &h)? {
                return Ok(done);
            }
        }
        let mut mode = self.motion.mode.clone();
        let mut surfaces = located_surfaces(event);
        if !self.only_located_matter(&surfaces) {
            let signs = self.motion.signs.clone();
            let h = self.surface_values(&signs)?;
            for (j, h) in h.iter().enumerate() {
                if !self.motion.active[j] && *h != 0.0 {
                    mode.set(j, if *h < 0.0 { -1 } else { 1 });
                }
            }
            self.add_vanishing_surfaces(&mut surfaces, &h)?;
        }
        if let Some(done) = self.pass_double_zero(event, &mode, &surfaces)? {
            return Ok(done);
        }
        let vanishing = std::mem::take(&mut self.detector.vanishing);
        let at_two_fold = self.arrives_at_two_fold(event, &surfaces)?;
        if event.touch && !at_two_fold {
            return self.graze(&mode, &surfaces, vanishing);
        }
        let arrival = if at_two_fold {
            Some(Arrival::TwoFold)
        } else {
            self.arrival(event, &surfaces, vanishing)
        };
        let fresh = SmallVec::<[usize; 4]>::from_slice(&surfaces);
        for &j in self.motion.sliding() {
            if !surfaces.contains(&j) {
                surfaces.push(j);
            }
        }
        surfaces.sort_unstable();
        let jumping = self.decide_where_others_jump(&mode, &fresh)?;
        let decided = match (jumping, surfaces.as_slice(), arrival) {
            (Some(decided), ..) => decided,
            (_, &[j], Some(arrival)) => self.decide_at_surface(&mode, j, arrival)?,
            _ => {
                let decided = self.decide_at_intersection(event, &mode, &surfaces, &fresh)?;
                self.unless_not_held(decided, &surfaces)?
            }
        };
        let (after, left) = match decided {
            Ok(decided) => self.leave_coinciding(decided)?,
            Err(stop) => return Ok(Some(stop)),
        };
        // Stability is lost, and the motion stays all the same: it oscillates around the root from now on.
        let slides_on = after
            .sliding_set()
            .eq(self.motion.sliding().iter().copied());
        self.decided.oscillates |= slides_on && self.loses_stability(event);
        self.loosen(event, mode == after);
        let is_changed = |j: &usize| mode.entries()[*j] != after.entries()[*j];
        if surfaces.len() > 1 && surfaces.iter().any(is_changed) {
            surfaces.retain(|j| is_changed(j));
        }
        self.record(mode, after.clone(), &surfaces);
        if let Some(limit) = self.accumulation()? {
            return self.jump_to(limit, after);
        }
        self.begin(after, &left)
    }

    /// What follows at one surface.
    fn decide_at_surface(
        &mut self,
        mode: &Mode,
        j: usize,
        arrival: Arrival,
    ) -> Result<Decided, FieldError> {
        let signs = mode.signs();
        let mut decision = decide(self.system, j, arrival, self.t, &self.x, &signs)?;
        if decision.leaves_with_rounding() {
            // A field that comes to rest on the surface: beside it, by rounding, it still points somewhere.
            let mut projector = Projector::new(self.x.len(), signs.len());
            projector.project(self.system, j, self.t, &mut self.x, &signs)?;
            decision = decide(self.system, j, arrival, self.t, &self.x, &signs)?;
        }
        Ok(self.follow_at_surface(mode, j, decision))
    }

    /// Are all surfaces slid on or located, so that the values of none are needed?
    fn only_located_matter(&self, located: &[usize]) -> bool {
        let entries = self.motion.mode.entries().iter().enumerate();
        let mut settled = entries.map(|(j, &e)| e == 0 || located.contains(&j));
        settled.all(|settled| settled) && self.motion.active.iter().all(|active| *active)
    }

    /// Adds to the surfaces that were located all others that vanish at the event: they matter, are not being left
    /// tangentially and lie within rounding of zero.
    pub(in crate::integrate) fn add_vanishing_surfaces(
        &mut self,
        surfaces: &mut SmallVec<[usize; 4]>,
        h: &[f64],
    ) -> Result<(), FieldError> {
        for (j, h) in h.iter().enumerate() {
            // One that the motion rests on while it slides is in the place of that it slides on.
            let slides = self.motion.mode.entries()[j] == 0
                || !self.motion.sliding().is_empty() && self.motion.resting.contains(&j);
            if !self.motion.active[j] || slides || surfaces.contains(&j) {
                continue;
            }
            let signs = &self.motion.signs;
            let size = self.system.surface_size(j, self.t, &self.x, signs)?;
            if h.abs() > SURFACE_NOISE * size {
                continue;
            }
            // A surface that is being left tangentially stays near for long; one that was crossed at
            // this very instant belongs to the event.
            let departs = self.motion.monitored.iter().any(|m| {
                m.function == EventFunction::Surface(j) && m.deflation.is_some_and(|d| d.order > 1)
            });
            if !departs {
                surfaces.push(j);
            }
        }
        surfaces.sort_unstable();
        Ok(())
    }

    /// How the motion arrived, if one surface decides.
    fn arrival(&self, event: &Found, surfaces: &[usize], vanishing: [usize; 2]) -> Option<Arrival> {
        match (self.motion.sliding(), surfaces, event.functions.as_slice()) {
            ([], &[j], _) => {
                let side = self.motion.mode.entries()[j];
                Some(match vanishing {
                    [0, 0] => Arrival::Region(side),
                    _ => Arrival::Flat(side, vanishing),
                })
            }
            ([_], [], [EventFunction::ExitMinus, ..]) => Some(Arrival::ExitMinus),
            ([_], [], [EventFunction::ExitPlus, ..]) => Some(Arrival::ExitPlus),
            _ => None,
        }
    }

    /// Goes on beyond a double zero of the difference of the normal components, if sliding has come to one: what came of
    /// that.
    fn pass_double_zero(
        &mut self,
        event: &Found,
        mode: &Mode,
        surfaces: &[usize],
    ) -> Result<Option<Option<Stop>>, FieldError> {
        let &[j] = self.motion.sliding() else {
            return Ok(None);
        };
        if n_exits(event) == 0 || !surfaces.is_empty() || !self.may_lose_multiplier() {
            return Ok(None);
        }
        let Some((t, end)) = self.beyond_double_zero(j)? else {
            return Ok(None);
        };
        self.record(mode.clone(), mode.clone(), &[]);
        self.move_straight(t, end)?;
        Ok(Some(self.begin(mode.clone(), &[])?))
    }

    /// Has sliding on one surface come to a two-fold? Then the point is moved there.
    fn arrives_at_two_fold(
        &mut self,
        event: &Found,
        surfaces: &[usize],
    ) -> Result<bool, FieldError> {
        let n_exits = n_exits(event);
        let is_exit = n_exits == 2 || n_exits == 1 && self.approaches_two_fold();
        if !is_exit || !surfaces.is_empty() {
            return Ok(false);
        }
        let Some((t, x)) = self.two_fold_here()? else {
            return Ok(false);
        };
        if t > self.t {
            self.move_straight(t, x)?;
        }
        Ok(true)
    }

    /// A touch: recorded, the mode stays.
    fn graze(
        &mut self,
        mode: &Mode,
        surfaces: &[usize],
        vanishing: [usize; 2],
    ) -> Result<Option<Stop>, FieldError> {
        let mut left = Lefts::new();
        let signs = mode.signs();
        if let (&[j], []) = (surfaces, self.motion.sliding()) {
            if let Some(leading) = self.goes_on_beyond(mode, j, vanishing)? {
                let beyond = mode.with(j, -mode.entries()[j]);
                let candidates = vec![mode.clone(), beyond.clone()];
                match self.choose(&[j], mode.clone(), candidates) {
                    Ok(after) if after == beyond => {
                        self.record(mode.clone(), after.clone(), &[j]);
                        return self.begin(after, &[Left::Surface(j, leading)]);
                    }
                    Ok(_) => {}
                    Err(stop) => return Ok(Some(stop)),
                }
            }
        }
        for &j in surfaces {
            let side = mode.entries()[j];
            let known = vanishing[usize::from(side > 0)].max(1);
            let leading = first_nonzero(self.system, j, side, known, self.t, &self.x, &signs)?;
            if leading.sign() == side {
                left.push(Left::Surface(j, leading));
            }
        }
        self.record(mode.clone(), mode.clone(), surfaces);
        self.begin(mode.clone(), &left)
    }

    pub(in crate::integrate) fn record(&mut self, before: Mode, after: Mode, surfaces: &[usize]) {
        let kind = Kind::between(&before, &after);
        if kind == Kind::Crossing && !self.actions.list.is_empty() {
            self.warn_against_direction(&before, &after, surfaces);
        }
        self.recorder.switch(Switch {
            t: self.t,
            y_before: SmallVec::from_slice(&self.x),
            y_after: SmallVec::from_slice(&self.x),
            kind,
            surfaces: SmallVec::from_slice(surfaces),
            mode_before: before,
            mode_after: after,
            note: String::new(),
        });
    }

    /// Starts a motion at the current point; `left` are the functions that vanish there.
    pub(in crate::integrate) fn begin(
        &mut self,
        mode: Mode,
        left: &[Left],
    ) -> Result<Option<Stop>, FieldError> {
        self.stats.n_field_evaluations += self.motion.field.n_evaluations();
        self.remember_pace();
        let slid = !self.motion.sliding().is_empty();
        let leaps = self.begin_with_leap()?;
        let deflations: SmallVec<[_; 2]> =
            left.iter().filter_map(|l| l.deflation(self.t)).collect();
        self.note_resting(&mode, left)?;
        self.motion.restart(self.system, self.t, mode, &deflations);
        let zeros = self.motion.monitored.iter_mut();
        for zero in zeros.filter_map(|m| m.deflation.as_mut()) {
            zero.is_clean = !slid;
        }
        self.choose_stepper();
        let decided = std::mem::take(&mut self.decided);
        match (&mut self.motion.field, decided.at_two_fold) {
            (ModeField::Intersection(field), _) => {
                field.begin(&decided.multipliers, decided.oscillates);
                for &(index, slack) in &self.slacks {
                    field.set_slack(index, slack);
                }
            }
            (ModeField::Sliding(field), Some(multiplier)) => {
                field.begin_at_two_fold(self.t, multiplier);
            }
            _ => {}
        }
        self.motion.project(self.t, &mut self.x)?;
        self.rest_on_coinciding()?;
        self.evaluate_start()?;
        self.note_oscillation();
        if !leaps {
            let multipliers = self.motion.multipliers();
            self.recorder.begin_segment(
                self.t,
                &self.motion.mode,
                multipliers,
                &self.motion.discrete,
            );
        }
        if let Some(stop) = self.refusal() {
            return Ok(Some(stop));
        }
        if self.system.has_nested_signs() {
            let x = self.x.clone();
            if let Some(stop) = self.differs_between_sides(self.t, &x)? {
                return Ok(Some(stop));
            }
        }
        let derivative = self.stepper.start_derivative();
        if derivative.iter().any(|v| !v.is_finite()) {
            return Ok(Some(Stop::NotFinite));
        }
        let start = (self.t, &self.x[..], derivative);
        self.detector.measure(self.system, &self.motion, start, 0)?;
        self.detector.accept_start(&mut self.motion.monitored);
        self.user_events.restart(self.t, &self.x)?;
        self.controller.restart();
        self.dt = self.first_step(left)?;
        Ok(None)
    }

    /// The derivative at the start of the motion, and its exit functions there.
    fn evaluate_start(&mut self) -> Result<(), FieldError> {
        self.series_reach = None;
        if self.start_with_series() {
            // Known.
        } else if let ModeField::Region(_) = &self.motion.field {
            let (signs, derivative) = (&self.motion.signs, self.stepper.start_derivative_mut());
            self.stats.n_field_evaluations +=
                eval_on_side(self.system, self.t, &self.x, signs, derivative)?;
        } else {
            let derivative = self.stepper.start_derivative_mut();
            self.motion.field.eval(self.t, &mut self.x, derivative)?;
            self.go_without_equations();
        }
        let exits = self.motion.field.last_exits();
        self.detector.stages.clear();
        let stages = exits.iter().map(|&exit| [exit; 7]);
        self.detector.stages.extend(stages);
        Ok(())
    }
}
