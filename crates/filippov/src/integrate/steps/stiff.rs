//! Stiff motions: noticed by the explicit methods, and integrated by the method for them.

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::integrate::integrator::Integrator;
use crate::motion::{ModeField, SmoothField};
use crate::options::Method;
use crate::status::{Warning, WarningCode};
use crate::stepper::Derivatives;
use crate::stepper::{Attempt, Rodas5p, StepMethod};
use crate::system::Linearisation;
use crate::tolerances::{AIM_MARGINS, EPS, STIFF_DOP853, STIFF_DOPRI5, STIFF_SERIES};

impl Integrator<'_> {
    /// Gives the motion that starts to the method for stiff motions.
    #[cold]
    #[inline(never)]
    pub(in crate::integrate) fn start_implicit(&mut self) {
        self.stepper.start_with(StepMethod::Rodas5p);
        let by_graph = self.motion.has_canopy_field() && !self.motion.is_drawn_back();
        let jacobian = by_graph
            .then(|| self.system.motion_jacobian(self.motion.sliding()))
            .flatten();
        self.take_derivatives(jacobian.map_or(Derivatives::Differences, Derivatives::Exact));
    }

    pub(in crate::integrate) fn take_derivatives(&mut self, derivatives: Derivatives) {
        if let Some(rodas5p) = &mut self.stepper.rodas5p {
            rodas5p.restart(match &derivatives {
                Derivatives::Exact(jacobian) => jacobian.linearisation(),
                _ => Linearisation::dense(self.x.len()),
            });
        }
        self.stepper.derivatives = derivatives;
    }

    /// Finds the derivatives at the start of the step. Where they are not finite DOPRI5 takes the step.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[cold]
    #[inline(never)]
    pub(in crate::integrate) fn linearise(&mut self) -> Result<(), FieldError> {
        self.stepper.go_on_with(StepMethod::Rodas5p);
        let is_known = |rodas5p: &crate::stepper::Rodas5p| rodas5p.is_linearised();
        if self.stepper.rodas5p.as_deref().is_none_or(is_known) {
            return Ok(());
        }
        let begins_at_two_fold = match &self.motion.field {
            ModeField::Sliding(field) => field.is_at_two_fold(self.t),
            _ => false,
        };
        if begins_at_two_fold {
            // The equation of the multiplier is 0 = 0.
            self.stepper.go_on_with(StepMethod::Dopri5);
            return Ok(());
        }
        self.stats.n_jacobians += 1;
        let is_finite = match self.stepper.derivatives.clone() {
            Derivatives::Exact(jacobian) => {
                let signs = self.signs_and_multipliers()?;
                let (system, t, x) = (self.system, self.t, &self.x);
                let Some(rodas5p) = &mut self.stepper.rodas5p else {
                    return Ok(());
                };
                rodas5p.linearise(|out| system.eval_jacobian(&jacobian, t, x, &signs, out))
            }
            _ => self.linearise_by_differences()?,
        };
        if !is_finite {
            self.stepper.go_on_with(StepMethod::Dopri5);
        }
        Ok(())
    }

    /// The signs of the mode, with the signs that stand for the multipliers at the start of the step.
    fn signs_and_multipliers(&mut self) -> Result<Vec<f64>, FieldError> {
        let mut signs = self.motion.signs.to_vec();
        if self.motion.sliding.is_empty() {
            return Ok(signs);
        }
        let (mut x, mut rates) = (self.x.clone(), vec![0.0; self.x.len()]);
        self.motion.field.eval(self.t, &mut x, &mut rates)?;
        let multipliers = self.motion.multipliers();
        for (k, &j) in self.motion.sliding.iter().enumerate() {
            let at_signs = &self.motion.signs;
            let ratio = self.system.stick_ratio(j, self.t, &self.x, at_signs);
            signs[j] = ratio * multipliers.get(k).copied().unwrap_or(f64::NAN);
        }
        Ok(signs)
    }

    /// Derivatives by one difference per state and one in time. Where the field is not there on one side of the
    /// start the other is taken.
    fn linearise_by_differences(&mut self) -> Result<bool, FieldError> {
        let (t, n) = (self.t, self.x.len());
        let start = self.stepper.start_derivative().to_vec();
        let mut columns = vec![0.0; n * n];
        let mut at_rates = vec![0.0; n];
        let field = &mut self.motion.field;
        let mut difference = |i: Option<usize>, out: &mut [f64]| -> Result<(), FieldError> {
            let value = i.map_or(t, |i| self.x[i]);
            for side in [1.0, -1.0] {
                // Radau5's choice (Hairer, Wanner 1996, section IV.8).
                let moved = value + side * (EPS * value.abs().max(1e-5)).sqrt();
                let mut x = self.x.clone();
                let time = match i {
                    Some(i) => {
                        x[i] = moved;
                        t
                    }
                    None => moved,
                };
                field.eval(time, &mut x, &mut at_rates)?;
                for ((out, there), here) in out.iter_mut().zip(&at_rates).zip(&start) {
                    *out = (there - here) / (moved - value);
                }
                if out.iter().all(|v| v.is_finite()) {
                    break;
                }
            }
            Ok(())
        };
        for (i, column) in columns.chunks_exact_mut(n).enumerate() {
            difference(Some(i), column)?;
        }
        let mut in_time = vec![0.0; n];
        difference(None, &mut in_time)?;
        let Some(rodas5p) = &mut self.stepper.rodas5p else {
            return Ok(false);
        };
        Ok(rodas5p.linearise(|out| {
            out.fill(|values, time| {
                for (place, value) in values.iter_mut().enumerate() {
                    *value = -columns[place % n * n + place / n];
                }
                time.copy_from_slice(&in_time);
            });
        }))
    }

    /// Is the step to be taken anew, so that it ends just behind the event at `theta`? Inside of a step the extension of
    /// a stiff motion lies beside the manifold to which the fast components keep; within the tolerance, but the
    /// direction of the field there says nothing about the motion. At its end the step is on it.
    #[cold]
    #[inline(never)]
    pub(in crate::integrate) fn aims_again(&mut self, theta: f64, dt: f64) -> bool {
        let Some(margin) = AIM_MARGINS.get(self.n_aims) else {
            return false;
        };
        let aimed = theta * dt * (1.0 + margin);
        if aimed >= dt || theta * dt * margin <= EPS * self.t.abs() {
            return false;
        }
        self.n_aims += 1;
        self.dt = aimed;
        true
    }

    /// Attempts a step by the method for stiff motions; by DOPRI5 if its matrix has no inverse.
    ///
    /// # Errors
    /// If a function of the user raises.
    #[cold]
    #[inline(never)]
    pub(in crate::integrate) fn attempt_implicit(
        &mut self,
        dt: f64,
    ) -> Result<Attempt, FieldError> {
        let Some(rodas5p) = &mut self.stepper.rodas5p else {
            return Ok(Attempt::NotFinite);
        };
        self.stats.n_factorisations += 1;
        if !rodas5p.factor(dt) {
            self.stepper.go_on_with(StepMethod::Dopri5);
            return self.attempt_explicit(dt);
        }
        let (field, observe) = (&mut self.motion.field, self.detector.observer());
        let attempt = rodas5p.attempt(field, observe, self.t, &self.x, dt, &self.scale)?;
        let is_beside = rodas5p.linearisation().is_exact() && !self.motion.is_straight;
        if attempt == Attempt::NotFinite && is_beside {
            // The field may not be there beside a curved surface: at its projection it is.
            self.take_derivatives(Derivatives::Differences);
        }
        Ok(attempt)
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
            StepMethod::Dopri5 if matches!(self.stepper.derivatives, Derivatives::None) => {
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
            surfaces: Vec::new(),
            text,
            candidates: Vec::new(),
            rule: "",
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
