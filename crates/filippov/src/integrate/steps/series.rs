//! Steps by Taylor series.

use crate::error::FieldError;
use crate::event::Seen;
use crate::integrate::integrator::Integrator;
use crate::mode::Signs;
use crate::motion::CurrentMotion;
use crate::motion::ModeField;
use crate::options::Method;
use crate::status::{Warning, WarningCode};
use crate::stepper::Derivatives;
use crate::stepper::{reach as series_reach, Attempt, StepMethod};
use crate::tolerances::{EPS, MOST_AUTO_SERIES, TAYLOR_SHORTEST};

impl Integrator<'_> {
    /// The motion that starts takes Taylor steps if the run may and the motion has series.
    pub(in crate::integrate) fn choose_stepper(&mut self) {
        self.motion.jets = None;
        self.stepper.derivatives = Derivatives::None;
        if self.stepper.rodas5p.is_some() && self.motion.resting.is_empty() {
            return self.start_implicit();
        }
        // Whether a surface is left that h = 0 all along was expected of is seen at the ends of steps only.
        // A series that ends at the surface that is left would be left itself after a step of no length.
        let starts_clear = || self.motion.monitored.iter().all(|m| m.deflation.is_none());
        let may = !self.motion.is_in_contact()
            && self.motion.resting.is_empty()
            && !self.motion.is_drawn_back()
            && !self.motion.slides_by_rule()
            && self.motion.has_bounds()
            && (self.system.is_analytic() || starts_clear());
        if let (Some(taylor), true) = (&self.stepper.taylor, may) {
            let (system, order) = (self.system, taylor.order());
            let is_auto = self.options.method == Method::Auto;
            self.motion.take_jets(|sliding| {
                // Series on many surfaces are long: they are not even made where they are not wanted.
                if is_auto && sliding.len() > MOST_AUTO_SERIES {
                    return None;
                }
                let jets = system.motion_jets(sliding, order);
                jets.filter(|jets| !is_auto || jets.is_unrolled())
            });
        }
        self.stepper.start_with(if self.motion.jets.is_some() {
            StepMethod::Taylor
        } else if self.stepper.dop853.is_some() {
            StepMethod::Dop853
        } else if self.stepper.midpoint.is_some() {
            StepMethod::Midpoint
        } else {
            StepMethod::Dopri5
        });
        if self.motion.jets.is_none() {
            self.note_missing_series();
        }
    }

    /// Where redundant contacts share a load their equations do not determine the multipliers: there are no series, and no
    /// exact derivatives.
    pub(in crate::integrate) fn go_without_equations(&mut self) {
        let is_shared = match &self.motion.field {
            ModeField::Intersection(field) => field.shares_load(),
            _ => false,
        };
        if is_shared && self.motion.jets.is_some() {
            let derivative = self.stepper.start_derivative().to_vec();
            self.motion.jets = None;
            self.stepper.start_with(StepMethod::Dopri5);
            self.stepper
                .start_derivative_mut()
                .copy_from_slice(&derivative);
            self.note_missing_series();
        }
        if is_shared && matches!(self.stepper.derivatives, Derivatives::Exact(_)) {
            self.take_derivatives(Derivatives::Differences);
        }
    }

    /// Warns, once, that a run that was to use series uses another method.
    fn note_missing_series(&mut self) {
        let is_known = self
            .warnings
            .iter()
            .any(|w| w.code == WarningCode::NoSeries);
        if is_known || self.options.method != Method::Taylor {
            return;
        }
        let (t, mode) = (self.t, &self.motion.mode);
        let text = format!(
            "the motion in mode {mode} from t = {t:.10} has no Taylor series (its field is not analytic there, is \
             not traced, slides by another rule than the canopy, sticks, shares a load among redundant contacts, is drawn back to its surface, or is in \
             contact): DOPRI5 integrates it"
        );
        self.warnings.push(Warning {
            t,
            code: WarningCode::NoSeries,
            surfaces: Vec::new(),
            text,
            candidates: Vec::new(),
            rule: "",
        });
    }

    /// Makes the proposed step no longer than the series at its start allows. Where the motion has no series, the
    /// Runge-Kutta method goes on.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub(in crate::integrate) fn expand(&mut self) -> Result<(), FieldError> {
        let (Some(taylor), Some(jets)) = (&mut self.stepper.taylor, &self.motion.jets) else {
            return Ok(());
        };
        let allowed = match self.series_reach.take() {
            Some(allowed) => allowed,
            None if taylor.is_expanded() => return Ok(()),
            None => {
                let (system, t, x) = (self.system, self.t, &self.x);
                let signs = multipliers_in(&self.motion, &self.detector.seen);
                let signs = signs.as_deref().unwrap_or(&self.motion.signs);
                let fill = |rows: &mut [f64]| system.eval_jets(jets, t, x, signs, rows);
                let allowed = taylor.expand(jets.width(), x, &self.scale, fill);
                self.stats.n_field_evaluations += jets.cost();
                self.limited_by_functions(allowed)
            }
        };
        if allowed > TAYLOR_SHORTEST * EPS * self.t.abs() {
            self.dt = self.dt.min(allowed);
            return Ok(());
        }
        self.stepper.go_on_with(StepMethod::Dopri5);
        self.motion.jets = None;
        self.note_missing_series();
        self.dt = f64::NAN;
        self.dt = self.first_step(&[])?;
        Ok(())
    }

    /// Starts a motion in a region with its series: the derivative there is the first coefficient. `false` if it has
    /// none, or none that is finite. Sliding starts with its field: next to a two-fold its series is not accurate.
    pub(in crate::integrate) fn start_with_series(&mut self) -> bool {
        let (Some(taylor), Some(jets)) = (&mut self.stepper.taylor, &self.motion.jets) else {
            return false;
        };
        if !self.motion.sliding.is_empty() {
            return false;
        }
        let (system, t, x) = (self.system, self.t, &self.x);
        let signs = &self.motion.signs;
        let fill = |rows: &mut [f64]| system.eval_jets(jets, t, x, signs, rows);
        let allowed = taylor.expand(jets.width(), x, &self.scale, fill);
        if allowed.is_nan() {
            taylor.forget();
            return false;
        }
        taylor.start_from_series();
        self.stats.n_field_evaluations += jets.cost();
        self.series_reach = Some(self.limited_by_functions(allowed));
        true
    }

    /// The length of step that the states allow, or the monitored functions if they allow less.
    fn limited_by_functions(&self, allowed: f64) -> f64 {
        match &self.motion.jets {
            // Not a number stays: `min` would take the other one.
            Some(jets) if jets.width() > self.x.len() && !allowed.is_nan() => {
                match self.longest_for_functions(allowed) {
                    longest if longest >= allowed => allowed,
                    longest => longest,
                }
            }
            _ => allowed,
        }
    }

    /// How long a step the series of the monitored functions suggest: until their last terms reach the tolerance of
    /// their size over the step, `reach` being what the states allow. Their zeros are found on any step, but on
    /// one of this length with little work.
    fn longest_for_functions(&self, reach: f64) -> f64 {
        let (Some(taylor), Some(jets)) = (&self.stepper.taylor, &self.motion.jets) else {
            return f64::INFINITY;
        };
        let order = taylor.order();
        let mut longest = f64::INFINITY;
        for place in self.x.len()..jets.width() {
            let size = self.function_scale(place, reach);
            let terms = [order - 1, order].map(|k| (taylor.coefficient(place, k).abs(), k));
            if terms.iter().any(|(c, _)| c.is_nan()) {
                return f64::NAN;
            }
            longest = longest.min(match terms {
                [(0.0, _), (0.0, _)] => self.longest_for_polynomial(place),
                _ => series_reach(terms.map(|(c, k)| (c / size, k))),
            });
        }
        longest
    }

    /// How long a step may be for a function that is a polynomial along it: until the rounding of its largest term reaches
    /// the tolerance. On a longer step its zeros near the start are lost.
    fn longest_for_polynomial(&self, place: usize) -> f64 {
        let Some(taylor) = &self.stepper.taylor else {
            return f64::INFINITY;
        };
        let atol = self.options.atol.iter().copied();
        let value = taylor.coefficient(place, 0).abs();
        let tolerance = atol.fold(f64::INFINITY, f64::min) + self.options.rtol * value;
        let reach = |k: usize| {
            let rounding = EPS * taylor.coefficient(place, k).abs();
            (tolerance / rounding).powf(1.0 / k as f64)
        };
        (2..taylor.order() - 1)
            .filter(|&k| taylor.coefficient(place, k) != 0.0)
            .map(reach)
            .fold(f64::INFINITY, f64::min)
    }

    /// The tolerance for a function: relative to what it moves through in a step, exit functions to the larger one.
    fn function_scale(&self, place: usize, reach: f64) -> f64 {
        let (Some(taylor), Some(jets)) = (&self.stepper.taylor, &self.motion.jets) else {
            return f64::INFINITY;
        };
        let size = |place: usize| {
            let slope = taylor.coefficient(place, 1).abs();
            let moved = if reach.is_finite() {
                slope * reach
            } else {
                slope
            };
            taylor.coefficient(place, 0).abs().max(moved)
        };
        // Exit functions come in pairs.
        let first = jets.exit(0).filter(|&first| first <= place);
        let size = match first.map(|first| first + (place - first) / 2 * 2) {
            Some(pair) => size(pair).max(size(pair + 1)),
            None => size(place),
        };
        let atol = self
            .options
            .atol
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min);
        atol + self.options.rtol * size
    }

    /// Attempts a Taylor step.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub(in crate::integrate) fn attempt_series(&mut self, dt: f64) -> Result<Attempt, FieldError> {
        let Some(taylor) = &mut self.stepper.taylor else {
            return Ok(Attempt::NotFinite);
        };
        let field = &mut self.motion.field;
        let attempt = taylor.attempt(field, self.t, &self.x, dt, &self.scale)?;
        self.detector.observer()(&self.motion.field);
        Ok(attempt)
    }
}

/// The signs of sliding on several surfaces, with the multipliers at the start of the step in their places.
fn multipliers_in(motion: &CurrentMotion, seen: &[Seen]) -> Option<Signs> {
    let ModeField::Intersection(_) = motion.field else {
        return None;
    };
    let mut signs = motion.signs.clone();
    for (pair, &j) in seen.chunks_exact(2).zip(motion.sliding()) {
        signs[j] = 0.5 * (pair[0].start - pair[1].start);
    }
    Some(signs)
}
