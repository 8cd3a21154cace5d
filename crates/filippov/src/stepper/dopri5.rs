//! DOPRI5(4): one step, its error estimate and its continuous extensions.

use super::coefficients_dopri5::{A2, A3, A4, A5, A6, A8, A9, B, C, C8, C9, D, E, STABILITY_END};
use super::lanes::{self, ANY};
use super::{Attempt, ErrorScale, Interpolant, Step, Stepper};
use crate::error::FieldError;
use crate::motion::{observer, ModeField, Run, SlidingField, SmoothField};
use crate::page::IS_PAGE;
use crate::tolerances::{JUMP_SHARE, JUMP_SIZE};

/// The number of states for which loops are unrolled. A page gets one loop for all: its module is to be small, and fields that
/// are interpreted take longer than the sums around them.
const fn unrolled(n_states: usize) -> usize {
    if IS_PAGE {
        ANY
    } else {
        n_states
    }
}

/// The Dormand-Prince pair of order 5(4) with seven stages, the last of which is the first of the
/// next step.
///
/// Reference: Hairer, Norsett, Wanner, Solving ODEs I (1993), table II.5.2.
#[derive(Clone)]
pub struct Dopri5 {
    /// Its derivatives are those at the first and at the last stage.
    step: Step,
    /// Derivatives at the stages in between.
    k: [Vec<f64>; 5],
    /// Derivatives at the two extra stages.
    extra: [Vec<f64>; 2],
    stage: Vec<f64>,
    /// Quartic coefficient of the free extension, kept when the extension is raised to order 5.
    free_quartic: Vec<f64>,
    /// Order of the extension of the attempted step, as far as it was computed.
    extended: Option<u8>,
}

impl Dopri5 {
    /// A stepper for n states. Space for its stages is made at its first attempt: a run whose steps another method takes
    /// needs none.
    pub fn new(n: usize) -> Self {
        Dopri5 {
            step: Step::new(n, Interpolant::empty(n)),
            k: Default::default(),
            extra: Default::default(),
            stage: Vec::new(),
            free_quartic: Vec::new(),
            extended: None,
        }
    }

    #[cold]
    fn make_room(&mut self, n: usize) {
        let stages = self.k.iter_mut().chain(&mut self.extra);
        let rows = stages.chain([&mut self.stage, &mut self.free_quartic]);
        rows.for_each(|row| *row = vec![0.0; n]);
    }

    /// Evaluates the field at the start; needed after every restart, not between steps.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn restart(
        &mut self,
        field: &mut dyn SmoothField,
        t: f64,
        y: &mut [f64],
    ) -> Result<(), FieldError> {
        field.eval(t, y, &mut self.step.start_derivative)
    }

    /// Attempts a step of length `dt`; `observe` is called with the field after each evaluation, last
    /// at the end.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn attempt_along<F: SmoothField>(
        &mut self,
        field: &mut F,
        observe: impl FnMut(&F),
        t: f64,
        y: &[f64],
        dt: f64,
        scale: &ErrorScale,
    ) -> Result<Attempt, FieldError> {
        if self.stage.is_empty() {
            self.make_room(y.len());
        }
        match unrolled(y.len()) {
            1 => self.attempt_sized::<1, F>(field, observe, t, y, dt, scale),
            2 => self.attempt_sized::<2, F>(field, observe, t, y, dt, scale),
            3 => self.attempt_sized::<3, F>(field, observe, t, y, dt, scale),
            4 => self.attempt_sized::<4, F>(field, observe, t, y, dt, scale),
            _ => self.attempt_sized::<ANY, F>(field, observe, t, y, dt, scale),
        }
    }

    /// As [`attempt_along`](Self::attempt_along) for `N` states: the loops over few states are unrolled.
    fn attempt_sized<const N: usize, F: SmoothField>(
        &mut self,
        field: &mut F,
        mut observe: impl FnMut(&F),
        t: f64,
        y: &[f64],
        dt: f64,
        scale: &ErrorScale,
    ) -> Result<Attempt, FieldError> {
        let n = if N == ANY { y.len() } else { N };
        let y = &y[..n];
        self.extended = None;
        (self.step.interpolant.t0, self.step.interpolant.dt) = (t, dt);
        let (k1, k7) = (
            &self.step.start_derivative[..n],
            &mut self.step.end_derivative[..n],
        );
        let (stage, y1) = (&mut self.stage[..n], &mut self.step.end[..n]);
        let [k2, k3, k4, k5, k6] = &mut self.k;
        let (k2, k3, k4) = (&mut k2[..n], &mut k3[..n], &mut k4[..n]);
        let (k5, k6) = (&mut k5[..n], &mut k6[..n]);

        lanes::stage::<N, 1>(stage, y, dt, A2, [k1]);
        field.eval(t + C[1] * dt, stage, k2)?;
        observe(field);
        lanes::stage::<N, 2>(stage, y, dt, A3, [k1, k2]);
        field.eval(t + C[2] * dt, stage, k3)?;
        observe(field);
        lanes::stage::<N, 3>(stage, y, dt, A4, [k1, k2, k3]);
        field.eval(t + C[3] * dt, stage, k4)?;
        observe(field);
        lanes::stage::<N, 4>(stage, y, dt, A5, [k1, k2, k3, k4]);
        field.eval(t + C[4] * dt, stage, k5)?;
        observe(field);
        lanes::stage::<N, 5>(stage, y, dt, A6, [k1, k2, k3, k4, k5]);
        field.eval(t + dt, stage, k6)?;
        observe(field);
        // The second stage has no weight.
        let weights = [B[0], B[2], B[3], B[4], B[5]];
        lanes::stage::<N, 5>(y1, y, dt, weights, [k1, k3, k4, k5, k6]);
        field.eval(t + dt, y1, k7)?;
        observe(field);

        let weights = [E[0], E[2], E[3], E[4], E[5], E[6]];
        let rates = [k1, k3, k4, k5, k6, k7];
        let sum = lanes::squared_error::<N, 6>(scale, [y, y1], dt, weights, rates);
        let error = (sum / n as f64).sqrt();
        // The second stage is not in the estimate: look at it separately.
        let finite = error.is_finite() && k2.iter().all(|v| v.is_finite());
        Ok(if finite {
            Attempt::Error(error)
        } else {
            Attempt::NotFinite
        })
    }

    /// The product of the step and the fastest rate of the field, from the two evaluations at the end of the step;
    /// `None` once the extension of order 5 has used the space of the first.
    pub fn stiffness(&self) -> Option<f64> {
        if self.has_order5() {
            return None;
        }
        let states = [&self.step.end[..], &self.stage];
        stiffness_of(
            self.step.interpolant.dt,
            states,
            [&self.step.end_derivative, &self.k[4]],
        )
    }

    /// Is the continuous extension of order 5 already there?
    pub fn has_order5(&self) -> bool {
        self.extended == Some(5)
    }

    /// The continuous extension of the attempted step from `y`, of order 4 unless it was raised to
    /// order 5; costs no evaluation.
    pub fn extend_order4(&mut self, y: &[f64]) -> &Interpolant {
        if self.extended.is_none() {
            match unrolled(y.len()) {
                1 => self.extend_sized::<1>(y),
                2 => self.extend_sized::<2>(y),
                3 => self.extend_sized::<3>(y),
                4 => self.extend_sized::<4>(y),
                _ => self.extend_sized::<ANY>(y),
            }
            self.extended = Some(4);
        }
        &self.step.interpolant
    }

    #[inline(always)]
    fn extend_sized<const N: usize>(&mut self, y: &[f64]) {
        let n = if N == ANY { y.len() } else { N };
        let (y, dt) = (&y[..n], self.step.interpolant.dt);
        let (k1, k7) = (
            &self.step.start_derivative[..n],
            &self.step.end_derivative[..n],
        );
        let [k3, k4, k5, k6] = [1, 2, 3, 4].map(|stage: usize| &self.k[stage][..n]);
        let y1 = &self.step.end[..n];
        let [y0, r1, r2, r3, r4, r5] = self.step.interpolant.rows().map(|row| &mut row[..n]);
        for i in 0..n {
            y0[i] = y[i];
            r5[i] = 0.0;
            r1[i] = y1[i] - y[i];
            r2[i] = dt * k1[i] - r1[i];
            r3[i] = r1[i] - dt * k7[i] - r2[i];
            r4[i] = dt
                * (D[0] * k1[i]
                    + D[2] * k3[i]
                    + D[3] * k4[i]
                    + D[4] * k5[i]
                    + D[5] * k6[i]
                    + D[6] * k7[i]);
        }
    }

    /// Makes the continuous extension a straight line: the record of a motion that was not stepped.
    pub fn set_straight(&mut self, t: f64, dt: f64, from: &[f64], to: &[f64]) {
        (self.step.interpolant.t0, self.step.interpolant.dt) = (t, dt);
        let [y0, r1, rest @ ..] = self.step.interpolant.rows();
        y0.copy_from_slice(from);
        let ends = from.iter().zip(to);
        r1.iter_mut().zip(ends).for_each(|(r, (a, b))| *r = b - a);
        rest.into_iter().for_each(|row| row.fill(0.0));
        self.extended = Some(5);
    }

    /// Raises the continuous extension of the attempted step to order 5, with two evaluations.
    ///
    /// The polynomial takes y and y' at both ends and y' at 1/5 and 1/2 of the step.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn extend_order5(
        &mut self,
        field: &mut dyn SmoothField,
        y: &[f64],
    ) -> Result<&Interpolant, FieldError> {
        if self.has_order5() {
            return Ok(&self.step.interpolant);
        }
        self.extend_order4(y);
        let (t, dt) = (self.step.interpolant.t0, self.step.interpolant.dt);
        for ((row, c), out) in [(&A8, C8), (&A9, C9)].into_iter().zip(&mut self.extra) {
            for (i, s) in self.stage.iter_mut().enumerate() {
                let ends = [&self.step.start_derivative, &self.step.end_derivative];
                let all = ends[..1].iter().copied().chain(&self.k).chain([ends[1]]);
                let increment: f64 = row.iter().zip(all).map(|(a, k)| a * k[i]).sum();
                *s = y[i] + dt * increment;
            }
            field.eval(t + c * dt, &mut self.stage, out)?;
        }
        let [_, r1, r2, r3, r4, r5] = self.step.interpolant.rows();
        for i in 0..y.len() {
            let at_fifth = dt * self.extra[0][i] - (r1[i] + 0.6 * r2[i] + 0.28 * r3[i]);
            let at_half = dt * self.extra[1][i] - (r1[i] + 0.25 * r3[i]);
            let quintic = 16.0 * at_half;
            let quartic = (at_fifth - 0.0256 * quintic) / 0.192 - 0.2 * quintic;
            self.free_quartic[i] = r4[i];
            if quintic.is_finite() && quartic.is_finite() {
                r5[i] = quintic;
                r4[i] = quartic;
            }
        }
        self.extended = Some(5);
        Ok(&self.step.interpolant)
    }

    /// As [`Stepper::attempt`]; for the field of a region, and of sliding on one surface, without calls by a table.
    #[inline(always)]
    pub(super) fn attempt_by_kind(&mut self, at: &mut Run, dt: f64) -> Result<Attempt, FieldError> {
        let (t, x, scale, seen) = (at.t, &at.x, &at.scale, &mut at.seen);
        match &mut at.motion.field {
            ModeField::Region(field) => self.attempt_along(field, |_| {}, t, x, dt, scale),
            ModeField::Sliding(field) => {
                let observe = |field: &SlidingField| {
                    let a = field.last();
                    seen[0].see(a.minus);
                    seen[1].see(-a.plus);
                };
                self.attempt_along(&mut **field, observe, t, x, dt, scale)
            }
            field => self.attempt_along(field, observer(seen), t, x, dt, scale),
        }
    }
}

impl Stepper for Dopri5 {
    #[inline(always)]
    fn step(&self) -> &Step {
        &self.step
    }

    fn step_mut(&mut self) -> &mut Step {
        &mut self.step
    }

    fn attempt(&mut self, at: &mut Run, dt: f64) -> Result<Option<Attempt>, FieldError> {
        self.attempt_by_kind(at, dt).map(Some)
    }

    /// Distance of the extensions of order 4 and 5 at theta, in units of the tolerance: an estimate of
    /// the error of an extrapolation. Needs the extension of order 5.
    fn extrapolation_error(&self, theta: f64, scale: &ErrorScale) -> f64 {
        let weight = (theta * (1.0 - theta)).powi(2);
        let rows: Vec<&[f64]> = self
            .step
            .interpolant
            .coefficients()
            .chunks_exact(self.step.end.len())
            .collect();
        let defect: Vec<f64> = (0..self.step.end.len())
            .map(|i| weight * (rows[4][i] - self.free_quartic[i] + theta * rows[5][i]))
            .collect();
        scale.norm(&defect, &self.step.end)
    }

    #[inline]
    fn extends_freely(&self) -> bool {
        false
    }

    #[inline]
    fn is_extended(&self) -> bool {
        self.has_order5()
    }

    #[inline]
    fn extend_cheaply(&mut self, y: &[f64]) {
        self.extend_order4(y);
    }

    fn extend(&mut self, field: &mut dyn SmoothField, y: &[f64]) -> Result<(), FieldError> {
        self.extend_order5(field, y)?;
        Ok(())
    }

    /// Does the field jump within the attempted step?
    fn field_jumps(&self) -> bool {
        let [k2, k3, k4, k5, _] = &self.k;
        let Step {
            start_derivative,
            end_derivative,
            ..
        } = &self.step;
        jumps_between(&[start_derivative, k2, k3, k4, k5, end_derivative])
    }

    fn is_limited_by_stability(&mut self, _: &mut Run) -> Result<Option<bool>, FieldError> {
        let product = self.stiffness();
        Ok(Some(product.is_some_and(|product| product > STABILITY_END)))
    }
}

/// Do these derivatives, in order of time, jump? Then nearly all of the range of some component falls between two
/// neighbours; a smooth layer spreads it.
pub(super) fn jumps_between(ordered: &[&[f64]]) -> bool {
    (0..ordered[0].len()).any(|i| {
        let values = ordered.iter().map(|k| k[i]);
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        let largest = ordered.windows(2).map(|w| (w[1][i] - w[0][i]).abs());
        let largest = largest.fold(0.0_f64, f64::max);
        let size = low.abs().max(high.abs());
        high - low > JUMP_SIZE * size && largest > JUMP_SHARE * (high - low)
    })
}

/// dt |k - k'| / |y - y'|: the product of the step and the fastest rate, from two states at one time and their derivatives;
/// `None` where they are the same.
pub(super) fn stiffness_of(dt: f64, states: [&[f64]; 2], rates: [&[f64]; 2]) -> Option<f64> {
    let distance = |[a, b]: [&[f64]; 2]| {
        let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f64>().sqrt()
    };
    let apart = distance(states);
    (apart > 0.0).then(|| dt * distance(rates) / apart)
}
