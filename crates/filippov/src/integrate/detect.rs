//! The event stage of a step: the earliest zero of what the mode monitors.

use std::cell::{Cell, RefCell};

use smallvec::{smallvec, SmallVec};

use super::bounds::{BoundedCurve, Piece, RootPiece};
use super::curve::{grazes, Curve};
use super::integrator::Integrator;
use super::motion::{Exits, Motion};
use crate::error::FieldError;
use crate::event::certificate::Proof;
use crate::event::filter::{may_vanish, may_vanish_bent, may_vanish_between, may_vanish_deflated};
use crate::event::isolate::{first_zero_sampled, Evidence, Zero, PROBES};
use crate::event::locate::{refine, Located};
use crate::event::{Deflation, EventFunction, Monitored};
use crate::stepper::nested;
use crate::system::PiecewiseSystem;
use crate::tolerances::{
    BEYOND_TOUCH, EPS, EXTRAPOLATION, ONE_SIDED_AIM, POLE, RESOLVED_DEPTH, SURFACE_NOISE,
    UNBOUNDED_DEPTH, UNPROVED_DEPTH,
};

/// Scratch space of the event stage, and values at the end of the step.
pub(super) struct Detector {
    /// The exit functions of the motion at the seven stages.
    pub stages: Vec<[f64; 7]>,
    /// The step did not resolve a monitored function; it may not grow.
    pub unresolved: bool,
    /// A monitored function could not be searched; the step has to be shortened.
    pub uncertain: bool,
    /// Length of the next step, if the event stage knows better than the error control.
    pub next_dt: Option<f64>,
    /// Exit functions computed in the search of this step, by theta.
    exits: Vec<(f64, Exits)>,
    h: Vec<f64>,
    /// Switching functions at the probes of the step.
    probed: [Vec<f64>; 2],
    rate: Vec<f64>,
    pub x: Vec<f64>,
    /// How far the projection onto a curved surface moves the extension in this step; else empty.
    pub margin: Vec<f64>,
    /// Bounds of the normal components over the last piece of the extension of this step.
    pub enclosed_exits: Cell<Option<Piece>>,
    /// Bounds of the multipliers there, while sliding on an intersection.
    pub enclosed_root: RefCell<Option<RootPiece>>,
    /// Value and rate at the end of the step, per monitored function.
    right: Vec<(f64, f64)>,
    /// Rounding of the exit functions in this step, once it was needed.
    exit_noise: Option<f64>,
    /// Which monitored functions could not be cleared, and whether bounds say anything about them.
    suspects: Vec<(usize, bool)>,
}

/// The earliest zero of a step.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Where, in steps.
    pub theta: f64,
    /// What vanishes there.
    pub functions: SmallVec<[EventFunction; 4]>,
    /// The functions come within rounding of zero without a change of sign.
    pub touch: bool,
}

impl Detector {
    pub fn new(n: usize, d: usize) -> Self {
        Detector {
            stages: Vec::new(),
            unresolved: false,
            uncertain: false,
            next_dt: None,
            exits: Vec::new(),
            h: vec![0.0; d],
            probed: [vec![0.0; d], vec![0.0; d]],
            rate: vec![0.0; d],
            x: vec![0.0; n],
            margin: Vec::new(),
            enclosed_exits: Cell::new(None),
            enclosed_root: RefCell::new(None),
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
            if m.deflation.is_some() && value > 1e3 * m.noise {
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
    pub(super) fn detect(&mut self, t1: f64, dt: f64) -> Result<Option<Found>, FieldError> {
        let end = (t1, self.stepper.end(), self.stepper.end_derivative());
        self.detector.unresolved = false;
        self.detector.uncertain = false;
        self.detector.exits.clear();
        self.detector.enclosed_exits.set(None);
        self.detector.enclosed_root.take();
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
        if found.is_none() && self.one_sided {
            self.detect_beyond(dt, &mut found)?;
        }
        Ok(found)
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
        self.prepare_bounds()?;
        let mut probed = false;
        for index in 0..self.motion.monitored.len() {
            let m = self.motion.monitored[index];
            let (value, rate) = self.detector.right[index];
            if m.deflation.is_some() {
                let step = (self.t, &self.x[..], self.stepper.end());
                let noise = self
                    .detector
                    .noise(self.system, &self.motion, m.function, step)?;
                self.motion.monitored[index].noise = noise;
            }
            let proof = if is_polynomial(&m) {
                Proof::Silent
            } else {
                self.prove_clear(index, value)
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
                    let Deflation { t, order, leading } = deflation;
                    // A multiple zero stays within rounding for long: the end has to be clear of it.
                    let clear = order == 1 || order == 2 && value > 1e3 * noise;
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
            }
        }
        Ok(())
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
    fn extend(&mut self) -> Result<(), FieldError> {
        if self.stepper.has_order5() {
            return Ok(());
        }
        self.stats.n_extensions += 1;
        self.detector.enclosed_exits.set(None);
        self.detector.enclosed_root.take();
        self.stepper
            .extend_order5(&mut self.motion.field, &self.x)?;
        Ok(())
    }

    /// The first zero of one monitored function on [from, to], refined to rounding.
    fn search(
        &mut self,
        (index, has_bounds): (usize, bool),
        (from, to): (f64, f64),
        dt: f64,
    ) -> Result<Option<(f64, bool)>, FieldError> {
        let m = self.motion.monitored[index];
        let step = (self.t, &self.x[..], self.stepper.end());
        let noise = self
            .detector
            .noise(self.system, &self.motion, m.function, step)?;
        self.motion.monitored[index].noise = noise;
        let width = 0.5 * EPS * (self.t.abs() / dt).max(to);
        let polynomial = match m.function {
            EventFunction::Surface(j) if m.affine && self.motion.is_straight => {
                Some(self.affine_polynomial(j, m, dt)?)
            }
            _ => None,
        };
        let by_multipliers = !self.slides_by_rule() && self.motion.has_bounds(self.system);
        let interpolant = self.stepper.interpolant();
        let bounds = BoundedCurve {
            system: self.system,
            interpolant,
            signs: &self.motion.signs,
            sliding: &self.motion.sliding,
            margin: &self.detector.margin,
            stages: &self.detector.stages,
            affine: self.motion.affine_bounds.as_ref().and_then(Option::as_ref),
            by_multipliers,
            last: &self.detector.enclosed_exits,
            last_root: &self.detector.enclosed_root,
        };
        let mut curve = Curve {
            system: self.system,
            field: &mut self.motion.field,
            signs: &self.motion.signs,
            interpolant,
            is_straight: self.motion.is_straight,
            h: &mut self.detector.h,
            x: &mut self.detector.x,
            exits: &mut self.detector.exits,
            n_evaluations: &mut self.stats.n_surface_evaluations,
        };
        let (t, dt_step) = (self.t, dt);
        let mut g = |theta: f64| {
            let value = match &polynomial {
                Some(rows) => nested(rows, theta),
                None => curve.value(&m, theta)?,
            };
            Ok(m.deflated(value, t + theta * dt_step, dt_step, noise))
        };
        let mut values = [f64::NAN; 5];
        for (i, value) in values.iter_mut().enumerate() {
            let theta = from + (to - from) * 0.25 * i as f64;
            let (start, end) = (m.value, self.detector.right[index].0);
            *value = match theta {
                0.0 => m.deflated(start, t, dt, noise),
                1.0 => m.deflated(end, t + dt, dt, noise),
                _ => g(theta)?,
            };
        }
        let mut over = |a, b| bounds.over(&m, a, b);
        let is_bounded = polynomial.is_none() && has_bounds;
        let evidence = match (m.function, is_bounded) {
            (_, true) => Evidence::Bounds {
                bounds: &mut over,
                divided: m.deflation.is_some(),
                patience: match m.function {
                    EventFunction::Exit(_) => UNPROVED_DEPTH,
                    _ => UNBOUNDED_DEPTH,
                },
            },
            // Along the step an affine surface is a quintic; the quartic and its remainder describe it.
            (EventFunction::Surface(_), _) if m.affine => Evidence::Probes(&[]),
            (EventFunction::Surface(_), _) => Evidence::Probes(&PROBES),
            _ => Evidence::Probes(&PROBES[..1]),
        };
        let isolated = first_zero_sampled(&mut g, from, to, values, noise, evidence)?;
        self.detector.unresolved |= isolated.depth > RESOLVED_DEPTH && !is_bounded;
        self.detector.uncertain |= isolated.exhausted || isolated.not_finite;
        match isolated.zero {
            None => Ok(None),
            Some(Zero::Touch(theta)) if theta <= from => Ok(None),
            // A multiplier that touches its end goes on; it may leave later in the step.
            Some(Zero::Touch(theta)) if matches!(m.function, EventFunction::Exit(_)) => {
                let rest = theta + BEYOND_TOUCH * (to - from);
                if rest >= to {
                    return Ok(None);
                }
                self.search((index, has_bounds), (rest, to), dt)
            }
            Some(Zero::Touch(theta)) => Ok(Some((theta, true))),
            // Beyond the surface from the start, by the rounding of what moved the state: the switch is now.
            Some(Zero::Crossing(bracket)) if bracket.lo >= bracket.hi => {
                Ok(Some((bracket.lo, false)))
            }
            Some(Zero::Crossing(bracket)) => {
                let Located { theta, residual } = refine(&mut g, bracket, width)?;
                let scale = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                if residual > POLE * scale {
                    // A pole: the sign changes without a zero.
                    self.detector.uncertain = true;
                    return Ok(None);
                }
                if bracket.is_steep(scale, noise) {
                    return Ok(Some((theta, false)));
                }
                match grazes(&mut g, theta, from, to, noise)? {
                    Some(vertex) => Ok(Some((vertex, true))),
                    None => Ok(Some((theta, false))),
                }
            }
        }
    }

    /// The rows of an affine h along the continuous extension, in the nested form of the extension.
    fn affine_polynomial(
        &mut self,
        j: usize,
        m: Monitored,
        dt: f64,
    ) -> Result<[f64; 6], FieldError> {
        let (point, signs) = ((self.t, &self.x[..]), &self.motion.signs);
        let extension = self.stepper.interpolant().coefficients();
        let mut rows = [0.0; 6];
        let ht = self
            .system
            .gradient_products(j, point, signs, extension, &mut rows)?;
        rows.iter_mut().for_each(|row| *row *= m.orientation);
        rows[0] = m.value;
        rows[1] += m.orientation * ht * dt;
        Ok(rows)
    }

    /// One-sided fields: the surface just beyond the end of the step, within reach of the continuous extension.
    fn detect_beyond(&mut self, dt: f64, found: &mut Option<Found>) -> Result<(), FieldError> {
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

    fn keep_earliest(
        &self,
        found: &mut Option<Found>,
        index: usize,
        zero: Option<(f64, bool)>,
        dt: f64,
    ) {
        let Some((theta, touch)) = zero else { return };
        let function = self.motion.monitored[index].function;
        let together = 4.0 * EPS * (1.0 + self.t.abs() / dt);
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
