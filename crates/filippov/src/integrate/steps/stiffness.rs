//! Stiffness noticed by the explicit methods.

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::field::SmoothField;
use crate::integrate::integrator::Integrator;
use crate::integrate::steps::stiff::Derivatives;
use crate::integrate::{Warning, WarningCode};
use crate::options::Method;
use crate::stepper::{Rodas5p, StepMethod};
use crate::tolerances::{NOT_STIFF_SIGNS, STIFF_DOP853, STIFF_DOPRI5, STIFF_SERIES, STIFF_SIGNS};

/// Accepted steps between two looks, a power of two.
const LOOK_EVERY: u64 = 128;

/// What was seen of the steps so far: Hairer's count.
///
/// Every [`LOOK_EVERY`] steps, and at every step once there is a sign, the product of the step and the fastest rate of the
/// field is estimated. Where it lies at the end of the region of stability in 15 steps, not six in a row between them
/// without, stability and not accuracy limits the steps.
///
/// Reference: Hairer, Wanner (1996), section IV.2, "stiffness detection".
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::integrate) struct Stiffness {
    signs: u32,
    signs_against: u32,
    /// The time from which on the run counts as stiff.
    pub since: Option<f64>,
}

impl Stiffness {
    /// Is the step after that many accepted ones to be looked at?
    #[inline(always)]
    pub fn is_due(&self, n_steps: u64) -> bool {
        (n_steps & (LOOK_EVERY - 1) == 0 || self.signs > 0) && self.since.is_none()
    }

    /// Counts a step; returns whether the run counts as stiff now.
    fn count(&mut self, is_limited: bool) -> bool {
        if is_limited {
            self.signs_against = 0;
            self.signs += 1;
        } else if self.signs > 0 {
            self.signs_against += 1;
            if self.signs_against == NOT_STIFF_SIGNS {
                (self.signs, self.signs_against) = (0, 0);
            }
        }
        self.signs == STIFF_SIGNS
    }
}

impl Integrator<'_> {
    /// Looks at the step just computed, of length `dt`, before it is accepted; returns whether the rest of the run is left
    /// to the method for stiff motions.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[cold]
    #[inline(never)]
    pub(in crate::integrate) fn look_at_stiffness(&mut self, dt: f64) -> Result<bool, FieldError> {
        let is_limited = match self.stepper.in_use() {
            StepMethod::Dopri5 if matches!(self.motion.derivatives, Derivatives::None) => {
                let product = self.stepper.dopri5.stiffness();
                product.is_some_and(|product| product > STIFF_DOPRI5)
            }
            StepMethod::Dop853 => {
                let product = self.stepper.dop853.as_ref().and_then(|d| d.stiffness());
                product.is_some_and(|product| product > STIFF_DOP853)
            }
            StepMethod::Taylor => self.is_series_limited(dt)?,
            _ => return Ok(false),
        };
        if !self.stiffness.count(is_limited) {
            return Ok(false);
        }
        self.stiffness.since = Some(self.t);
        if self.options.method == Method::Auto {
            self.stepper.rodas5p = Some(Box::new(Rodas5p::new(self.x.len())));
            return Ok(true);
        }
        let (t, mode) = (self.t, &self.motion.mode);
        let text = format!(
            "the motion in mode ({mode}) is stiff near t = {t:.10}: stability and not accuracy keeps its steps at \
             {dt:.3e}; method=\"Rodas5P\" takes longer ones"
        );
        self.warnings.push(Warning {
            t,
            code: WarningCode::Stiff,
            text,
            candidates: Vec::new(),
            surfaces: Vec::new(),
        });
        Ok(false)
    }

    /// Is a Taylor step far shorter than the motion takes to change? The fastest rate is that between the last two sums
    /// of the series, whose difference is what grows fastest.
    fn is_series_limited(&mut self, dt: f64) -> Result<bool, FieldError> {
        let Some(taylor) = &self.stepper.taylor else {
            return Ok(false);
        };
        let Some(mut beside) = taylor.slow_end_without_last(&self.x, &self.scale) else {
            return Ok(false);
        };
        let (t, end, rates) = (
            self.t + dt,
            &taylor.step().end,
            &taylor.step().end_derivative,
        );
        let apart: SmallVec<[f64; 16]> = beside.iter().zip(end).map(|(a, b)| a - b).collect();
        let mut rates_beside: SmallVec<[f64; 16]> = SmallVec::from_elem(0.0, beside.len());
        self.motion
            .field
            .eval_unprojected(t, &mut beside, &mut rates_beside)?;
        rates_beside
            .iter_mut()
            .zip(rates)
            .for_each(|(a, b)| *a -= b);
        let rate = self.scale.norm(&rates_beside, end) / self.scale.norm(&apart, end);
        Ok(rate * dt > STIFF_SERIES)
    }

    /// Leaves the rest of the motion to the method for stiff motions.
    pub(in crate::integrate) fn go_on_implicitly(&mut self) {
        let start = self.stepper.start_derivative().to_vec();
        // A Taylor step has no proposal for the next one.
        let last = self.stepper.interpolant().dt;
        self.start_implicit();
        self.stepper.start_derivative_mut().copy_from_slice(&start);
        self.motion.jets = None;
        self.controller.restart();
        self.dt = last;
    }
}
