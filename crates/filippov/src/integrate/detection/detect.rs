//! The event stage of a step: the earliest zero of what the mode monitors.

use smallvec::smallvec;

use crate::error::FieldError;
use crate::event::certificate::{prove, Proof};
use crate::event::filter::{may_vanish, may_vanish_bent, may_vanish_between, may_vanish_deflated};
use crate::event::isolate::PROBES;
use crate::event::{Deflation, Found, Monitored};
use crate::field::{AffineBounds, Guard, ModeField};
use crate::integrate::detection::bounds::BoundedCurve;
use crate::integrate::detection::detector::Detector;
use crate::integrate::detection::detector::CLEAR_OF_NOISE;
use crate::integrate::integrator::Integrator;
use crate::options::SlidingRule;
use crate::tolerances::{EPS, EXTRAPOLATION, MARGIN, ONE_SIDED_AIM, PROOF_DEPTH};

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
        self.detector.measure(self.system, &self.motion, end)?;
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
            let is_surface = m.guard.is_surface();
            if m.deflation.is_none() || !is_surface || value >= 0.0 {
                continue;
            }
            if value < -CLEAR_OF_NOISE * self.noise_beside(&m)? {
                return Ok(Some(Found {
                    theta: 0.0,
                    functions: smallvec![m.guard],
                    touch: false,
                }));
            }
        }
        Ok(None)
    }

    /// The filter: which functions may vanish within the step?
    fn collect_suspects(&mut self, dt: f64) -> Result<(), FieldError> {
        self.detector.suspects.clear();
        let is_polynomial = |m: &Monitored| m.affine && m.guard.is_surface();
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
            let suspect = match (m.guard, m.deflation, proof) {
                (_, _, Proof::Clear) => false,
                (_, _, Proof::Open) => true,
                (Guard::Surface(_), None, _) if m.affine => {
                    may_vanish(m.value, m.rate * dt, value, rate * dt)
                }
                (Guard::Surface(j), None, _) => {
                    if !probed {
                        self.probe_surfaces(dt)?;
                        probed = true;
                    }
                    let at = &self.detector.probed;
                    let probes = [0, 1].map(|k| (PROBES[k], m.orientation * at[k][j]));
                    may_vanish_bent(m.value, m.rate * dt, value, rate * dt, &probes)
                }
                (Guard::Surface(_), Some(deflation), _) => {
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
                (_, None, _) => may_vanish_between(self.detector.seen[m.place].range),
                (_, Some(_), _) => true,
            };
            if suspect {
                self.detector.suspects.push((index, proof == Proof::Open));
            } else if proof == Proof::Silent {
                self.detector.dismissed |= self.motion.ends_root(&m);
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
    pub(in crate::integrate) fn noise_of(&mut self, m: &Monitored) -> Result<f64, FieldError> {
        let step = (self.t, &self.x[..], self.stepper.end());
        self.detector.noise(self.system, &self.motion, m, step)
    }

    /// The same, or what blurred the zero that is divided out.
    pub(in crate::integrate) fn noise_beside(&mut self, m: &Monitored) -> Result<f64, FieldError> {
        let blur = m.deflation.map_or(0.0, |zero| zero.blur);
        Ok(self.noise_of(m)?.max(blur))
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
        let guard = self.motion.monitored[index].guard;
        let together = self.together(dt);
        match found {
            Some(event) if theta > event.theta + together => {}
            Some(event) if theta >= event.theta - together => {
                event.functions.push(guard);
                event.touch &= touch;
            }
            _ => {
                *found = Some(Found {
                    theta,
                    functions: smallvec![guard],
                    touch,
                })
            }
        }
    }

    /// What bounds over the step up to `reach` prove about a function.
    pub(in crate::integrate) fn prove_clear(
        &self,
        index: usize,
        value_at_end: f64,
        reach: f64,
    ) -> Proof {
        let m = self.motion.monitored[index];
        let curve = BoundedCurve {
            system: self.system,
            interpolant: self.stepper.interpolant(),
            signs: &self.motion.signs,
            sliding: self.motion.sliding(),
            margin: &self.detector.margin,
            seen: &self.detector.seen,
            affine: self.motion.affine_bounds(),
            by_multipliers: !self.motion.slides_by_rule() && self.motion.has_bounds(),
            known_exits: &self.detector.enclosed_exits,
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
    pub(in crate::integrate) fn prepare_bounds(&mut self) {
        let motion = &mut self.motion;
        if !motion.has_bounds()
            || motion.affine_bounds.is_some()
            || self.options.sliding != SlidingRule::Canopy
        {
            return;
        }
        if let ModeField::Intersection(field) = &motion.field {
            motion.affine_bounds = Some(field.steady_normal().and_then(AffineBounds::new));
        }
    }

    /// How far the motion lies beside the continuous extension, from the probes of the step.
    pub(in crate::integrate) fn measure_margin(&mut self, dt: f64) -> Result<(), FieldError> {
        let Detector { margin, x, .. } = &mut self.detector;
        if self.motion.is_straight {
            return Ok(());
        }
        margin.resize(x.len(), 0.0);
        let mut moved = x.clone();
        for theta in PROBES {
            self.stepper.interpolant().at(theta, x);
            moved.copy_from_slice(x);
            self.motion.project(self.t + theta * dt, &mut moved)?;
            for ((margin, x), moved) in margin.iter_mut().zip(&*x).zip(&moved) {
                *margin = margin.max(MARGIN * (moved - x).abs());
            }
        }
        Ok(())
    }
}
