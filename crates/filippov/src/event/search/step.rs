//! The event stage of a step: the earliest zero of what the mode monitors.

use filippov_expr::Motion;
use smallvec::{smallvec, SmallVec};

use super::bounds::{is_known_clear, BoundedCurve};
use super::detector::Detector;
use super::detector::CLEAR_OF_NOISE;
use super::sought::{AtZero, Search, Sought};
use super::StepSearch;
use crate::error::FieldError;
use crate::event::certificate::{prove, Proof};
use crate::event::filter::{least_of_cubic, may_vanish, may_vanish_bent, may_vanish_deflated};
use crate::event::isolate::PROBES;
use crate::event::tube::Tube;
use crate::event::{Event, Found};
use crate::motion::{AffineBounds, Deflation, Guard, KnownMultipliers, ModeField, Monitored};
use crate::options::SlidingRule;
use crate::page::IS_PAGE;
use crate::stepper::Interpolant;
use crate::system::is_zero_within;
use crate::tolerances::{
    CANCELLED, EPS, ERRORS_OF_STEPS, EXTRAPOLATION, HUGGING, MARGIN, ONE_SIDED_AIM,
    PIECES_OF_RANGES, PROOF_DEPTH, ROUNDING, SPARE_SPREAD, TOO_LARGE_A_CHANGE,
};
use crate::vectors::largest;

impl StepSearch<'_, '_> {
    /// The first event of the step that was just computed, and how long the next step may be. Where the field ends beyond
    /// the end of this one that is shorter.
    pub(crate) fn first_event(&mut self, t1: f64, dt: f64) -> Result<(Event, f64), FieldError> {
        let mut sought = Sought::new(dt);
        self.detector.forget_step();
        if self.run.motion.asleep.has_any() {
            self.rouse(dt)?;
        }
        if self.run.motion.monitored.is_empty() {
            return Ok((Event::None, sought.longest));
        }
        if !self.seek(t1, &mut sought)? {
            return Ok((Event::Shorten(0.5 * dt), sought.longest));
        }
        let event = match sought.found.take() {
            Some(found) if self.may_be_multiple(&found) => {
                self.resolve_multiple(found, &mut sought)?
            }
            Some(found) => Event::At(found),
            None => self.wrong_from_the_start()?.map_or(Event::None, Event::At),
        };
        Ok((event, sought.longest))
    }

    /// Monitors the surfaces that the step may reach, if it leaves the box in which they are asleep; all, where the field ends at its
    /// surfaces.
    #[cold]
    #[inline(never)]
    fn rouse(&mut self, dt: f64) -> Result<(), FieldError> {
        self.stepper.extend_cheaply(&self.run.x);
        self.measure_margin(dt)?;
        let (step, margin) = (self.stepper.interpolant(), &self.detector.margin);
        let (system, motion) = (self.run.system, &mut self.run.motion);
        let is_inside = |ranges: &Ranges| motion.asleep.contains_ranges(ranges, &motion.discrete);
        let woken = if self.one_sided {
            motion.wake_all(system)
        } else if is_inside(&rough_ranges(step, margin)) {
            return Ok(());
        } else {
            if is_inside(&ranges(step, margin, 1)) {
                return Ok(());
            }
            let ranges = ranges(step, margin, PIECES_OF_RANGES);
            if is_inside(&ranges) {
                return Ok(());
            }
            motion.wake(system, &ranges)
        };
        for place in woken {
            let (j, side) = match self.run.motion.monitored[place] {
                Monitored {
                    guard: Guard::Surface(j),
                    orientation,
                    ..
                } => (j, orientation),
                _ => continue,
            };
            let at = self.run.motion.setting().at(self.run.t, &self.run.x);
            let velocity = self.stepper.start_derivative();
            let (value, rate) = system.surface_rate(j, &at, velocity)?;
            let woken = &mut self.run.motion.monitored[place];
            (woken.value, woken.rate) = (side * value, side * rate);
        }
        Ok(())
    }

    /// Moves a zero that may be a multiple one to its place. Other functions that vanish on the way there belong to the event,
    /// unless it is an action, which looks at them itself.
    fn resolve_multiple(&mut self, found: Found, sought: &mut Sought) -> Result<Event, FieldError> {
        let (guards, from) = (found.guards.clone(), found.theta);
        let triggers = self.run.motion.triggers(self.run.system);
        let acts =
            |guard: &Guard| matches!(guard, Guard::Surface(j) if triggers.is_only_trigger(*j));
        let is_action = guards.iter().any(acts);
        let mut event = match self.resolve_multiple_zero(found, sought.dt)? {
            Event::At(event) if event.theta > from && !is_action => event,
            event => return Ok(event),
        };
        let to = (event.theta + self.together(sought.dt)).min(1.0);
        for index in 0..self.run.motion.monitored.len() {
            let m = self.run.motion.monitored[index];
            if guards.contains(&m.guard) || m.deflation.is_some() {
                continue;
            }
            if let Search::At(_, kind) = self.search_on(index, (from, to), sought)? {
                event.guards.push(m.guard);
                event.touch &= kind == AtZero::Touch;
                event.is_blurred |= kind != AtZero::Steep;
            }
        }
        Ok(Event::At(event))
    }

    /// Searches the step for the first zero; `false` if a shorter step is needed. Guards that are beyond zero at the end come
    /// first: the others need not be looked at after the first zero.
    fn seek(&mut self, t1: f64, sought: &mut Sought) -> Result<bool, FieldError> {
        let end = (t1, self.stepper.end(), self.stepper.end_derivative());
        self.detector.measure(self.run, end)?;
        self.run.stats.n_surface_evaluations += 1;
        if self.detector.right.iter().any(|(value, _)| value.is_nan()) {
            return Ok(false);
        }
        if self.drowns(sought.dt)? || self.spans_magnitudes(sought.dt)? {
            return Ok(false);
        }
        if self.detector.right.iter().any(|&(value, _)| value <= 0.0) {
            // There will be a search: the extension that it needs serves the filter too.
            self.extend()?;
        }
        if !self
            .run
            .motion
            .monitored
            .iter()
            .all(|m| self.is_polynomial(m))
        {
            self.stepper.extend_cheaply(&self.run.x);
        }
        self.measure_margin(sought.dt)?;
        if self.is_carried_along() {
            return Ok(false);
        }
        if self.run.motion.sliding.len() > 1 {
            self.prepare_bounds();
            self.watch_far_ends();
        }
        for is_beyond in [true, false] {
            for index in 0..self.run.motion.monitored.len() {
                let (value, _) = self.detector.right[index];
                if (value <= 0.0) == is_beyond && !self.search(index, sought)? {
                    return Ok(false);
                }
            }
        }
        if !self.look_before_exit(sought)? {
            return Ok(false);
        }
        if sought.found.is_none() && self.one_sided {
            self.seek_beyond(sought)?;
        }
        Ok(true)
    }

    /// Is the state at the end of the step so large that its rounding drowns what a surface is at the start, or its leading term if
    /// that is left? So long may a step of a series be that ends, as that of a polynomial.
    fn drowns(&mut self, dt: f64) -> Result<bool, FieldError> {
        let start = largest(&self.run.x).max(self.run.size);
        if start == 0.0 || largest(self.stepper.end()) <= CANCELLED * start {
            return Ok(false);
        }
        for index in 0..self.run.motion.monitored.len() {
            let m = self.run.motion.monitored[index];
            let leading = |zero: Deflation| zero.leading.abs() * dt.powi(zero.order);
            let value = m.deflation.map_or(m.value, leading);
            if m.guard.is_surface() && value < CANCELLED * self.noise_of(&m)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Is a switching function so much larger at one end of the step that its rounding there drowns what it is at the other end,
    /// as that of `exp(-100 x)` may be?
    fn spans_magnitudes(&mut self, dt: f64) -> Result<bool, FieldError> {
        if IS_PAGE || dt <= HUGGING * EPS * self.run.t.abs() {
            return Ok(false);
        }
        for index in 0..self.run.motion.monitored.len() {
            let m = self.run.motion.monitored[index];
            let Some(j) = m.surface().filter(|_| !m.affine && m.deflation.is_none()) else {
                continue;
            };
            let (left, right) = (m.value.abs(), self.detector.right[index].0.abs());
            let small = left.min(right);
            if CANCELLED * small >= left.max(right) || small > HUGGING * self.noise_of(&m)? {
                continue;
            }
            let x = match left < right {
                true => &self.run.x,
                false => self.stepper.end(),
            };
            let place = self.run.motion.setting().at(self.run.t, x);
            if small > HUGGING * ROUNDING * self.run.system.surface_size(j, &place)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// A surface that the motion was to leave to one side and is on the other side of, without a zero in between: rounding
    /// decided on the side, and it is decided anew.
    fn wrong_from_the_start(&mut self) -> Result<Option<Found>, FieldError> {
        for index in 0..self.run.motion.monitored.len() {
            let m = &self.run.motion.monitored[index];
            let (value, _) = self.detector.right[index];
            if value >= 0.0 || m.deflation.is_none() || !m.guard.is_surface() {
                continue;
            }
            let m = *m;
            if value < -CLEAR_OF_NOISE * self.noise_beside(&m)? {
                return Ok(Some(Found::here(smallvec![m.guard])));
            }
        }
        Ok(None)
    }

    /// Asks whether a guard may vanish within a step whose extension costs evaluations. Returns the answer of the bounds, or
    /// `None` if the guard does not vanish.
    pub(super) fn filter(
        &mut self,
        index: usize,
        sought: &mut Sought,
    ) -> Result<Option<Proof>, FieldError> {
        let m = self.run.motion.monitored[index];
        let (dt, (value, rate)) = (sought.dt, self.detector.right[index]);
        let proof = match m.affine && m.guard.is_surface() {
            true => Proof::Silent,
            false => self.prove_clear(index, value, 1.0),
        };
        let may_vanish = match (m.surface(), m.deflation) {
            _ if proof != Proof::Silent => proof == Proof::Open,
            (Some(j), None) if m.affine => {
                may_vanish(m.value, m.rate * dt, value, rate * dt)
                    || self.is_within_tolerance(j, dt, (&m, value, rate))?
            }
            (Some(j), None) => {
                self.probe_surfaces(dt)?;
                let at = &self.detector.probed;
                let probes = [0, 1].map(|k| (PROBES[k], m.orientation * at[k][j]));
                may_vanish_bent(m.value, m.rate * dt, value, rate * dt, &probes)
            }
            (Some(_), Some(zero)) => {
                // A multiple zero stays within rounding for long: the end has to be clear of it.
                let is_clear = zero.order == 1
                    || zero.order == 2
                        && value > CLEAR_OF_NOISE * self.run.motion.monitored[index].noise;
                let leading = zero.leading * dt.powi(zero.order);
                let is_known = m.affine && zero.t == self.run.t && is_clear;
                !is_known || may_vanish_deflated(leading, zero.order, value, rate * dt)
            }
            (None, _) => self.exit_may_vanish(&m),
        };
        sought.dismissed |= !may_vanish && proof == Proof::Silent && self.run.motion.ends_root(&m);
        Ok(may_vanish.then_some(proof))
    }

    /// Does an affine function come to zero within what the step may err by? There its extension is errors of the stages, which
    /// values and slopes at the ends do not show.
    fn is_within_tolerance(
        &mut self,
        j: usize,
        dt: f64,
        (m, value, rate): (&Monitored, f64, f64),
    ) -> Result<bool, FieldError> {
        let least = least_of_cubic(m.value, m.rate * dt, value, rate * dt);
        let run = &*self.run;
        let place = run.motion.setting().at(run.t, &run.x);
        Ok(least <= run.system.tolerance(j, &place, &run.scale)?)
    }

    /// The event at the start of the step, if the motion can go no further because its field ends at a surface that it has
    /// reached to the tolerance.
    pub(crate) fn arrival_at_edge(&self) -> Result<Option<Found>, FieldError> {
        let (run, setting) = (&self.run, self.run.motion.setting());
        for m in &run.motion.monitored {
            let Guard::Surface(j) = m.guard else {
                continue;
            };
            // Where a root begins the slope is infinite: then nothing counts as near.
            if !(m.rate < 0.0 && m.rate.is_finite()) {
                continue;
            }
            let (place, value) = (setting.at(run.t, &run.x), m.orientation * m.value);
            if m.value <= 0.0 || is_zero_within(run.system, &place, (j, value), &run.scale)? {
                return Ok(Some(Found::here(smallvec![m.guard])));
            }
        }
        Ok(None)
    }

    /// Rounding of a monitored function over the step.
    pub(crate) fn noise_of(&mut self, m: &Monitored) -> Result<f64, FieldError> {
        self.detector.noise(self.run, m, self.stepper.end())
    }

    /// The same, or what blurred the zero that is divided out.
    pub(crate) fn noise_beside(&mut self, m: &Monitored) -> Result<f64, FieldError> {
        let blur = m.deflation.map_or(0.0, |zero| zero.blur);
        Ok(self.noise_of(m)?.max(blur))
    }

    /// Evaluates all switching functions at the probes of the step, once.
    fn probe_surfaces(&mut self, dt: f64) -> Result<(), FieldError> {
        if std::mem::replace(&mut self.detector.is_probed, true) {
            return Ok(());
        }
        for (theta, h) in PROBES.into_iter().zip(&mut self.detector.probed) {
            self.stepper.interpolant().at(theta, &mut self.detector.x);
            h.resize(self.detector.h.len(), 0.0);
            let run = &mut *self.run;
            let t = run.t + theta * dt;
            let place = run.motion.setting().at(t, &self.detector.x);
            run.system.surfaces(&place, h)?;
            run.stats.n_surface_evaluations += 1;
        }
        Ok(())
    }

    /// Raises the continuous extension to order 5.
    pub(crate) fn extend(&mut self) -> Result<(), FieldError> {
        if self.stepper.is_extended() {
            return Ok(());
        }
        self.run.stats.n_extensions += 1;
        self.detector.enclosed_exits.get_mut().clear();
        self.detector.enclosed_roots.get_mut().clear();
        self.stepper
            .extend(&mut self.run.motion.field, &self.run.x)?;
        Ok(())
    }

    /// One-sided fields: the surface just beyond the end of the step, within reach of the continuous extension.
    fn seek_beyond(&mut self, sought: &mut Sought) -> Result<(), FieldError> {
        for index in 0..self.run.motion.monitored.len() {
            let (dt, (value, rate)) = (sought.dt, self.detector.right[index]);
            let near = rate < 0.0 && value < -rate * dt * 1.5 * (EXTRAPOLATION - 1.0);
            if near {
                self.extend()?;
                // What lies beyond the end of the step may not exist; that is no reason to shorten it.
                let zero = self.search_on(index, (1.0, EXTRAPOLATION), sought)?;
                let Search::At(theta, _) = zero else { continue };
                if self.run.t + theta * dt > self.horizon {
                    continue;
                }
                // An extrapolation that is not accurate enough still says how far to go.
                if self.stepper.extrapolation_error(theta, &self.run.scale) > 1.0 {
                    let gap = ONE_SIDED_AIM * (theta - 1.0) * dt;
                    sought.longest = sought.longest.min(gap);
                } else {
                    self.keep(index, zero, sought);
                }
            }
        }
        Ok(())
    }

    /// Zeros that are closer than this, in steps, are one event.
    pub(crate) fn together(&self, dt: f64) -> f64 {
        4.0 * EPS * (1.0 + self.run.t.abs() / dt)
    }

    /// What bounds over the step up to `reach` prove about a function.
    pub(crate) fn prove_clear(&self, index: usize, value_at_end: f64, reach: f64) -> Proof {
        let m = self.run.motion.monitored[index];
        let is_far = || {
            let is_end = matches!(m.guard, Guard::Multiplier { .. });
            is_end && self.run.motion.far_ends.is_far(m.place / 2)
        };
        let is_clear = || is_known_clear(&m, &self.detector.enclosed_roots.borrow(), reach);
        if value_at_end > 0.0 && (is_far() || is_clear()) {
            return Proof::Clear;
        }
        let curve = BoundedCurve {
            system: self.run.system,
            sliding_system: self.run.motion.sliding_system(self.run.system),
            interpolant: self.stepper.interpolant(),
            setting: self.run.motion.setting(),
            sliding: self.run.motion.sliding(),
            margin: &self.detector.margin,
            seen: &self.run.seen,
            affine: self.run.motion.affine_bounds(),
            by_multipliers: !self.run.motion.slides_by_rule() && self.run.motion.has_bounds(),
            known_exits: &self.detector.enclosed_exits,
            far: self.run.motion.far_ends.places(),
            known_roots: &self.detector.enclosed_roots,
        };
        // Next to a zero that is divided out the function itself may only rise.
        let at_start = if m.deflation.is_some() {
            f64::INFINITY
        } else {
            m.value
        };
        prove(
            &mut |a, b| curve.over(&m, a, b),
            reach,
            (at_start, (reach == 1.0).then_some(value_at_end)),
            m.noise,
            PROOF_DEPTH,
        )
    }

    /// Prepares the bounds of many multipliers, once per motion.
    pub(crate) fn prepare_bounds(&mut self) {
        let motion = &mut self.run.motion;
        if !motion.has_bounds()
            || motion.affine_bounds.is_some()
            || self.run.options.sliding != SlidingRule::Canopy
        {
            return;
        }
        if let ModeField::Intersection(field) = &motion.field {
            motion.affine_bounds = Some(field.steady_normal().and_then(AffineBounds::new));
        }
    }

    /// Finds out which multipliers stay away from their ends along the step, and for how long.
    fn watch_far_ends(&mut self) {
        let motion = &mut self.run.motion;
        let has_bounds = matches!(motion.affine_bounds, Some(Some(_))) && motion.has_bounds();
        if !has_bounds || motion.slides_by_rule() || !motion.far_ends.is_due() {
            return;
        }
        let ranges = rough_ranges(self.stepper.interpolant(), &self.detector.margin);
        let mut ends = std::mem::take(&mut motion.far_ends);
        let (set, setting) = (motion.sliding(), motion.setting());
        let near = motion.multipliers();
        let affine = motion.sliding_system(self.run.system).affine_signs();
        ends.follow(&ranges, |around| {
            let bounds = motion.affine_bounds()?;
            let known = KnownMultipliers {
                near: &near,
                ..KnownMultipliers::default()
            };
            let found = bounds.enclose(affine?, set, around, setting, known)?;
            Some(found.values)
        });
        self.run.motion.far_ends = ends;
    }

    /// Do the surfaces that the motion slides on jump within the step? The motion stays on them, and is then beside its extension by a
    /// part of the step, and by more than errors.
    fn is_carried_along(&mut self) -> bool {
        let Detector {
            margin, x: last, ..
        } = &mut self.detector;
        let run = &self.run;
        if run.motion.is_straight || run.motion.sliding.is_empty() {
            return false;
        }
        let end = self.stepper.end();
        self.stepper.interpolant().at(1.0, last);
        let (mut beside, mut moved) = (0.0_f64, 0.0_f64);
        for (i, (margin, (x, end))) in margin.iter().zip(run.x.iter().zip(end)).enumerate() {
            let unit = run.scale.of(i, *x, *end);
            beside = beside.max((margin / MARGIN).max((last[i] - end).abs()) / unit);
            moved = moved.max((end - x).abs() / unit);
        }
        beside > (TOO_LARGE_A_CHANGE * moved).max(ERRORS_OF_STEPS * ERRORS_OF_STEPS)
    }

    /// How far the motion lies beside the continuous extension, from the probes of the step.
    pub(crate) fn measure_margin(&mut self, dt: f64) -> Result<(), FieldError> {
        let Detector { margin, x, .. } = &mut self.detector;
        if self.run.motion.is_straight {
            return Ok(());
        }
        margin.resize(x.len(), 0.0);
        let mut moved = x.clone();
        for theta in PROBES {
            self.stepper.interpolant().at(theta, x);
            moved.copy_from_slice(x);
            self.run
                .motion
                .project(self.run.t + theta * dt, &mut moved)?;
            for ((margin, x), moved) in margin.iter_mut().zip(&*x).zip(&moved) {
                *margin = margin.max(MARGIN * (moved - x).abs());
            }
        }
        Ok(())
    }
}

/// Least and largest values, time first.
type Ranges = SmallVec<[[f64; 2]; 9]>;

/// Where a step leads at most: the sums of its coefficients bound its polynomials in either basis, all factors in them being at
/// most 1.
fn rough_ranges(step: &Interpolant, margin: &[f64]) -> Ranges {
    let (n, rows) = (step.n_states(), step.coefficients());
    let state = |i: usize| {
        let moving = rows[n..].chunks_exact(n);
        let spread: f64 = moving.map(|row| row[i].abs()).sum();
        let spread = SPARE_SPREAD * spread + margin.get(i).copied().unwrap_or(0.0);
        [rows[i] - spread, rows[i] + spread]
    };
    let time = [step.t0, step.t0 + step.dt];
    std::iter::once(time).chain((0..n).map(state)).collect()
}

/// The same from bounds of so many pieces, with room for an extension of higher order.
fn ranges(step: &Interpolant, margin: &[f64], n_pieces: u32) -> Ranges {
    let length = 1.0 / f64::from(n_pieces);
    let pieces = (0..n_pieces).map(|k| {
        let start = f64::from(k) * length;
        Tube::new(step, (start, start + length), margin)
    });
    let pieces: SmallVec<[Tube; 4]> = pieces.collect();
    let state = |i: usize| {
        let bounds = pieces.iter().map(|piece| piece.state(i).value);
        let [lo, hi] = bounds.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], bound| {
            [lo.min(bound.lo), hi.max(bound.hi)]
        });
        let spare = (SPARE_SPREAD - 1.0) * (hi - lo);
        [lo - spare, hi + spare]
    };
    let time = [step.t0, step.t0 + step.dt];
    std::iter::once(time)
        .chain((0..step.n_states()).map(state))
        .collect()
}
