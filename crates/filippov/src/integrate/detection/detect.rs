//! The event stage of a step: the earliest zero of what the mode monitors.

use std::cell::RefCell;

use smallvec::smallvec;

use crate::error::FieldError;
use crate::event::certificate::Proof;
use crate::event::filter::{may_vanish, may_vanish_bent, may_vanish_between, may_vanish_deflated};
use crate::event::isolate::PROBES;
use crate::event::{Deflation, EventFunction, Found, Monitored};
use crate::field::Exits;
use crate::integrate::detection::bounds::{Piece, RootPiece};
use crate::integrate::integrator::Integrator;
use crate::integrate::motion::Motion;
use crate::system::PiecewiseSystem;
use crate::tolerances::{EPS, EXTRAPOLATION, ONE_SIDED_AIM, SURFACE_NOISE};

/// A function is clear of a zero that was divided out beyond this multiple of its rounding.
const CLEAR_OF_NOISE: f64 = 1e3;

/// Scratch space of the event stage, and values at the end of the step.
pub(in crate::integrate) struct Detector {
    /// The exit functions of the motion at the seven stages.
    pub stages: Vec<[f64; 7]>,
    /// The step did not resolve a monitored function; it may not grow.
    pub unresolved: bool,
    /// A monitored function could not be searched; the step has to be shortened.
    pub uncertain: bool,
    /// An exit function was not searched though nothing was proved about it.
    pub dismissed: bool,
    /// Rounding blurs the zero that was found: it may be a multiple one.
    pub blurred: bool,
    /// How far below zero the touch that was found may be, else 0.
    pub depth: f64,
    /// Rounding of the function whose multiple zero was found, over the step, else 0.
    pub blur: f64,
    /// How many derivatives along f- and f+ vanish at the multiple zero that was found.
    pub vanishing: [usize; 2],
    /// Length of the next step, if the event stage knows better than the error control.
    pub next_dt: Option<f64>,
    /// Exit functions computed in the search of this step, by theta.
    pub exits: Vec<(f64, Exits)>,
    pub h: Vec<f64>,
    /// Switching functions at the probes of the step.
    probed: [Vec<f64>; 2],
    rate: Vec<f64>,
    pub x: Vec<f64>,
    /// How far the projection onto a curved surface moves the extension in this step; else empty.
    pub margin: Vec<f64>,
    /// Bounds of the normal components over pieces of the extension of this step.
    pub enclosed_exits: RefCell<Vec<Piece>>,
    /// Bounds of the multipliers there, while sliding on an intersection.
    pub enclosed_roots: RefCell<Vec<RootPiece>>,
    /// Value and rate at the end of the step, per monitored function.
    pub right: Vec<(f64, f64)>,
    /// Rounding of the exit functions in this step, once it was needed.
    exit_noise: Option<f64>,
    /// Which monitored functions could not be cleared, and whether bounds say anything about them.
    suspects: Vec<(usize, bool)>,
}

impl Detector {
    pub fn new(n: usize, d: usize) -> Self {
        Detector {
            stages: Vec::new(),
            unresolved: false,
            uncertain: false,
            dismissed: false,
            blurred: false,
            depth: 0.0,
            blur: 0.0,
            vanishing: [0; 2],
            next_dt: None,
            exits: Vec::new(),
            h: vec![0.0; d],
            probed: [vec![0.0; d], vec![0.0; d]],
            rate: vec![0.0; d],
            x: vec![0.0; n],
            margin: Vec::new(),
            enclosed_exits: RefCell::default(),
            enclosed_roots: RefCell::default(),
            right: Vec::new(),
            exit_noise: None,
            suspects: Vec::new(),
        }
    }

    /// Values and rates of the monitored functions at (t, x) with velocity `v`, into `right`.
    pub fn measure(
        &mut self,
        system: &dyn PiecewiseSystem,
        motion: &Motion,
        (t, x, v): (f64, &[f64], &[f64]),
        stage: usize,
    ) -> Result<(), FieldError> {
        let with_surfaces = motion
            .monitored
            .iter()
            .any(|m| matches!(m.function, EventFunction::Surface(_)));
        if with_surfaces {
            system.surface_rates(t, x, &motion.signs, v, &mut self.h, &mut self.rate)?;
        }
        self.right.clear();
        for m in &motion.monitored {
            self.right.push(match m.function {
                EventFunction::Surface(j) => {
                    (m.orientation * self.h[j], m.orientation * self.rate[j])
                }
                EventFunction::ExitMinus => (self.stages[0][stage], f64::NAN),
                EventFunction::ExitPlus => (self.stages[1][stage], f64::NAN),
                EventFunction::Exit(index) => (self.stages[index][stage], f64::NAN),
            });
        }
        Ok(())
    }

    /// Makes the values at the end of the step those at the start of the next one. Returns whether a
    /// surface that the motion departed from is now clear.
    pub fn accept(&mut self, monitored: &mut [Monitored], dt: f64) -> bool {
        let mut cleared = false;
        for (m, &(value, rate)) in monitored.iter_mut().zip(&self.right) {
            m.curvature = (rate - m.rate) / dt;
            (m.value, m.rate) = (value, rate);
            // A zero that rounding still blurs stays divided out.
            if m.deflation.is_some() && value > CLEAR_OF_NOISE * m.noise {
                m.deflation = None;
                cleared = true;
            }
        }
        for stages in &mut self.stages {
            stages[0] = stages[6];
        }
        cleared
    }

    /// Makes the values just measured those at the start of a motion.
    pub fn accept_start(&mut self, monitored: &mut [Monitored]) {
        for (m, &(value, rate)) in monitored.iter_mut().zip(&self.right) {
            (m.value, m.rate) = (value, rate);
            if let Some(zero) = &mut m.deflation {
                zero.blur = self.blur;
                zero.residual = if value.abs() <= self.depth {
                    value
                } else {
                    0.0
                };
            }
        }
    }

    /// Rounding of a monitored function over the step.
    fn noise(
        &mut self,
        system: &dyn PiecewiseSystem,
        motion: &Motion,
        function: EventFunction,
        (t, start, end): (f64, &[f64], &[f64]),
    ) -> Result<f64, FieldError> {
        let EventFunction::Surface(j) = function else {
            let stages = &self.stages;
            let noise = *self.exit_noise.get_or_insert_with(|| {
                let values = stages.iter().flatten();
                4.0 * SURFACE_NOISE * values.fold(0.0_f64, |m, v| m.max(v.abs()))
            });
            return Ok(noise);
        };
        let size = system
            .surface_size(j, t, end, &motion.signs)?
            .max(system.surface_size(j, t, start, &motion.signs)?);
        Ok(SURFACE_NOISE * size)
    }
}

impl Integrator<'_> {
    /// The earliest event of the step that was just computed.
    pub(in crate::integrate) fn detect(
        &mut self,
        t1: f64,
        dt: f64,
    ) -> Result<Option<Found>, FieldError> {
        let end = (t1, self.stepper.end(), self.stepper.end_derivative());
        self.detector.unresolved = false;
        self.detector.uncertain = false;
        self.detector.dismissed = false;
        self.detector.blurred = false;
        self.detector.depth = 0.0;
        self.detector.blur = 0.0;
        self.detector.vanishing = [0; 2];
        self.detector.exits.clear();
        self.detector.enclosed_exits.get_mut().clear();
        self.detector.enclosed_roots.get_mut().clear();
        self.detector.margin.clear();
        self.detector.exit_noise = None;
        self.detector.next_dt = None;
        if self.motion.monitored.is_empty() {
            return Ok(None);
        }
        self.detector.measure(self.system, &self.motion, end, 6)?;
        self.stats.n_surface_evaluations += 1;
        if self.detector.right.iter().any(|(value, _)| value.is_nan()) {
            self.detector.uncertain = true;
            return Ok(None);
        }
        if self.detector.right.iter().any(|&(value, _)| value <= 0.0) {
            // There will be a search: the extension that it needs serves the filter too.
            self.extend()?;
        }
        let mut found = if self.stepper.has_series() {
            self.detect_along_series(dt)?
        } else {
            self.detect_among_suspects(dt)?
        };
        if found.is_none() && !self.detector.uncertain {
            found = self.wrong_from_the_start()?;
        }
        Ok(found)
    }

    /// The earliest event of a step without series: the filter, then a search for what it lets through.
    fn detect_among_suspects(&mut self, dt: f64) -> Result<Option<Found>, FieldError> {
        self.collect_suspects(dt)?;
        let mut found: Option<Found> = None;
        if !self.detector.suspects.is_empty() {
            self.extend()?;
            for k in 0..self.detector.suspects.len() {
                let (index, bounded) = self.detector.suspects[k];
                let zero = self.search((index, bounded), (0.0, 1.0), dt)?;
                self.keep_earliest(&mut found, index, zero, dt);
            }
        }
        self.look_before_exit(&mut found, dt)?;
        if found.is_none() && self.one_sided && !self.detector.uncertain {
            self.detect_beyond(dt, &mut found)?;
        }
        Ok(found)
    }

    /// A surface that the motion was to leave to one side and is on the other side of, without a zero in between: rounding
    /// decided on the side, and it is decided anew.
    fn wrong_from_the_start(&mut self) -> Result<Option<Found>, FieldError> {
        for index in 0..self.motion.monitored.len() {
            let m = self.motion.monitored[index];
            let (value, _) = self.detector.right[index];
            let is_surface = matches!(m.function, EventFunction::Surface(_));
            if m.deflation.is_none() || !is_surface || value >= 0.0 {
                continue;
            }
            if value < -CLEAR_OF_NOISE * self.noise_beside(&m)? {
                return Ok(Some(Found {
                    theta: 0.0,
                    functions: smallvec![m.function],
                    touch: false,
                }));
            }
        }
        Ok(None)
    }

    /// The filter: which functions may vanish within the step?
    fn collect_suspects(&mut self, dt: f64) -> Result<(), FieldError> {
        self.detector.suspects.clear();
        let is_polynomial =
            |m: &Monitored| m.affine && matches!(m.function, EventFunction::Surface(_));
        if !self.motion.monitored.iter().all(is_polynomial) {
            self.stepper.extend_order4(&self.x);
        }
        self.measure_margin(dt)?;
        if self.motion.sliding.len() > 1 {
            self.prepare_bounds();
        }
        let mut probed = false;
        for index in 0..self.motion.monitored.len() {
            let m = self.motion.monitored[index];
            let (value, rate) = self.detector.right[index];
            if m.deflation.is_some() {
                self.motion.monitored[index].noise = self.noise_beside(&m)?;
            }
            let proof = if is_polynomial(&m) {
                Proof::Silent
            } else {
                self.prove_clear(index, value, 1.0)
            };
            let suspect = match (m.function, m.deflation, proof) {
                (_, _, Proof::Clear) => false,
                (_, _, Proof::Open) => true,
                (EventFunction::Surface(_), None, _) if m.affine => {
                    may_vanish(m.value, m.rate * dt, value, rate * dt)
                }
                (EventFunction::Surface(j), None, _) => {
                    if !probed {
                        self.probe_surfaces(dt)?;
                        probed = true;
                    }
                    let at = &self.detector.probed;
                    let probes = [0, 1].map(|k| (PROBES[k], m.orientation * at[k][j]));
                    may_vanish_bent(m.value, m.rate * dt, value, rate * dt, &probes)
                }
                (EventFunction::Surface(_), Some(deflation), _) => {
                    let noise = self.motion.monitored[index].noise;
                    let Deflation {
                        t, order, leading, ..
                    } = deflation;
                    // A multiple zero stays within rounding for long: the end has to be clear of it.
                    let clear = order == 1 || order == 2 && value > CLEAR_OF_NOISE * noise;
                    let leading = leading * dt.powi(order);
                    let known = m.affine && t == self.t && clear;
                    !known || may_vanish_deflated(leading, order, value, rate * dt)
                }
                (EventFunction::ExitMinus, None, _) => may_vanish_between(&self.detector.stages[0]),
                (EventFunction::ExitPlus, None, _) => may_vanish_between(&self.detector.stages[1]),
                (EventFunction::Exit(index), None, _) => {
                    may_vanish_between(&self.detector.stages[index])
                }
                (_, Some(_), _) => true,
            };
            if suspect {
                self.detector.suspects.push((index, proof == Proof::Open));
            } else if proof == Proof::Silent {
                self.detector.dismissed |= matches!(m.function, EventFunction::Exit(_));
            }
        }
        Ok(())
    }

    /// The earliest event of a Taylor step. Functions that are beyond zero at its end come first: the others need not
    /// be looked at after the first zero.
    fn detect_along_series(&mut self, dt: f64) -> Result<Option<Found>, FieldError> {
        self.measure_margin(dt)?;
        if self.motion.sliding.len() > 1 {
            self.prepare_bounds();
        }
        let mut found: Option<Found> = None;
        // What was searched for the first zero is all that the others are searched for.
        let mut reach = 1.0;
        for is_beyond in [true, false] {
            for index in 0..self.motion.monitored.len() {
                let (value, _) = self.detector.right[index];
                if (value <= 0.0) != is_beyond {
                    continue;
                }
                let (zero, searched) = self.search_along_series(index, reach, dt)?;
                self.keep_earliest(&mut found, index, zero, dt);
                reach = searched;
            }
        }
        self.look_before_exit(&mut found, dt)?;
        if found.is_none() && self.one_sided && !self.detector.uncertain {
            self.detect_beyond(dt, &mut found)?;
        }
        Ok(found)
    }

    /// Rounding of a monitored function over the step.
    pub(in crate::integrate) fn noise_of(
        &mut self,
        function: EventFunction,
    ) -> Result<f64, FieldError> {
        let step = (self.t, &self.x[..], self.stepper.end());
        self.detector
            .noise(self.system, &self.motion, function, step)
    }

    /// The same, or what blurred the zero that is divided out.
    pub(in crate::integrate) fn noise_beside(&mut self, m: &Monitored) -> Result<f64, FieldError> {
        let blur = m.deflation.map_or(0.0, |zero| zero.blur);
        Ok(self.noise_of(m.function)?.max(blur))
    }

    /// All switching functions at the probes of the step.
    fn probe_surfaces(&mut self, dt: f64) -> Result<(), FieldError> {
        for (theta, h) in PROBES.into_iter().zip(&mut self.detector.probed) {
            self.stepper.interpolant().at(theta, &mut self.detector.x);
            let t = self.t + theta * dt;
            self.system
                .surfaces(t, &self.detector.x, &self.motion.signs, h)?;
            self.stats.n_surface_evaluations += 1;
        }
        Ok(())
    }

    /// Raises the continuous extension to order 5.
    pub(in crate::integrate) fn extend(&mut self) -> Result<(), FieldError> {
        if self.stepper.is_extended() {
            return Ok(());
        }
        self.stats.n_extensions += 1;
        self.detector.enclosed_exits.get_mut().clear();
        self.detector.enclosed_roots.get_mut().clear();
        self.stepper.extend(&mut self.motion.field, &self.x)?;
        Ok(())
    }

    /// One-sided fields: the surface just beyond the end of the step, within reach of the continuous extension.
    pub(in crate::integrate) fn detect_beyond(
        &mut self,
        dt: f64,
        found: &mut Option<Found>,
    ) -> Result<(), FieldError> {
        for index in 0..self.motion.monitored.len() {
            let (value, rate) = self.detector.right[index];
            let near = rate < 0.0 && value < -rate * dt * 1.5 * (EXTRAPOLATION - 1.0);
            if near {
                self.extend()?;
                let zero = self.search((index, false), (1.0, EXTRAPOLATION), dt)?;
                // What lies beyond the end of the step may not exist; that is no reason to shorten it.
                self.detector.uncertain = false;
                let Some((theta, _)) = zero else { continue };
                if self.t + theta * dt > self.horizon {
                    continue;
                }
                // An extrapolation that is not accurate enough still says how far to go.
                if self.stepper.extension_defect(theta, &self.scale) > 1.0 {
                    let gap = ONE_SIDED_AIM * (theta - 1.0) * dt;
                    self.detector.next_dt = Some(self.detector.next_dt.map_or(gap, |d| d.min(gap)));
                } else {
                    self.keep_earliest(found, index, zero, dt);
                }
            }
        }
        Ok(())
    }

    /// Zeros that are closer than this, in steps, are one event.
    pub(in crate::integrate) fn together(&self, dt: f64) -> f64 {
        4.0 * EPS * (1.0 + self.t.abs() / dt)
    }

    pub(in crate::integrate) fn keep_earliest(
        &self,
        found: &mut Option<Found>,
        index: usize,
        zero: Option<(f64, bool)>,
        dt: f64,
    ) {
        let Some((theta, touch)) = zero else { return };
        let function = self.motion.monitored[index].function;
        let together = self.together(dt);
        match found {
            Some(event) if theta > event.theta + together => {}
            Some(event) if theta >= event.theta - together => {
                event.functions.push(function);
                event.touch &= touch;
            }
            _ => {
                *found = Some(Found {
                    theta,
                    functions: smallvec![function],
                    touch,
                })
            }
        }
    }
}
