//! Steps by Taylor series: which motions have them, and how long the steps are.

use smallvec::SmallVec;

use super::duties::Ready;
use super::taylor::reach as reach_of;
use super::{Attempt, Controller, ErrorScale, ExitSeries, Step, Stepper, Taylor};
use crate::error::FieldError;
use crate::mode::Signs;
use crate::motion::{observer, CurrentMotion, ModeField, Motion, Run, Seen, SmoothField};
use crate::options::{Method, Options};
use crate::powers::power;
use crate::status::{Warning, WarningCode};
use crate::system::MotionJets;
use crate::tolerances::{EPS, MOST_AUTO_SERIES, STIFF_SERIES, TAYLOR_SHORTEST};

impl Taylor {
    /// The method of a run over an interval of length `span`. What counts for its order are the series of the regions, without functions
    /// that are asleep at the start.
    pub(super) fn of_run(start: &Run, span: f64) -> Self {
        let (system, options, motion) = (start.system, start.options, &start.motion);
        let awake = motion.asleep.curved_awake(system);
        let operations = |order| {
            let jets = system.motion_jets_of(&[], awake.as_deref(), order);
            Some(jets?.operations())
        };
        let order = Taylor::order_for(options.rtol, operations);
        let taylor = Taylor::new(system.n_states(), order);
        match system.hides_changes() {
            true => taylor.wary_over(span),
            false => taylor,
        }
    }

    /// Takes the coefficients at the start of a step, under the signs of the motion or under others; returns the length of
    /// step that they allow.
    #[inline(always)]
    fn expand_motion(&mut self, at: &Run, jets: &MotionJets, signs: Option<&[f64]>) -> f64 {
        let setting = at.motion.setting();
        let setting = setting.with_signs(signs.unwrap_or(setting.signs));
        let place = setting.at(at.t, &at.x);
        let Some(series) = at.system.taylor_series() else {
            return f64::NAN;
        };
        let fill = |rows: &mut [f64]| series.eval_jets(jets, &place, rows);
        self.expand(jets.width(), &at.x, &at.scale, fill)
    }

    /// The length of step that the states allow, or the monitored functions if they allow less.
    fn limited_by_functions(&self, jets: &MotionJets, options: &Options, allowed: f64) -> f64 {
        // Not a number stays: `min` would take the other one.
        if jets.width() > self.step().end.len() && !allowed.is_nan() {
            match self.longest_for_functions(jets, options, allowed) {
                longest if longest >= allowed => allowed,
                longest => longest,
            }
        } else {
            allowed
        }
    }

    /// How long a step the series of the monitored functions suggest: until their last terms reach the tolerance of
    /// their size over the step, `reach` being what the states allow. Their zeros are found on any step, but on
    /// one of this length with little work.
    fn longest_for_functions(&self, jets: &MotionJets, options: &Options, reach: f64) -> f64 {
        let order = self.order();
        let mut longest = f64::INFINITY;
        // Of several multipliers the exit functions of both ends have the same terms but for their signs.
        let of_several = jets.exit(2).and(jets.exit(0));
        let is_other_end = |place: &usize| {
            of_several.is_some_and(|first| *place > first && (place - first) % 2 == 1)
        };
        let places = self.step().end.len()..jets.width();
        for place in places.filter(|place| !is_other_end(place)) {
            let size = self.function_scale(jets, options, place, reach);
            let terms = [order - 1, order].map(|k| (self.coefficient(place, k).abs(), k));
            if terms.iter().any(|(c, _)| c.is_nan()) {
                return f64::NAN;
            }
            longest = longest.min(match terms {
                [(0.0, _), (0.0, _)] if self.has_underflow(place) => return f64::NAN,
                [(0.0, _), (0.0, _)] => self.longest_for_polynomial(options, place),
                _ => reach_of(terms.map(|(c, k)| (c / size, k))),
            });
        }
        longest
    }

    /// How long a step may be for a function that is a polynomial along it: until the rounding of its largest term reaches
    /// the tolerance. On a longer step its zeros near the start are lost.
    fn longest_for_polynomial(&self, options: &Options, place: usize) -> f64 {
        let atol = options.atol.iter().copied();
        let value = self.coefficient(place, 0).abs();
        let tolerance = atol.fold(f64::INFINITY, f64::min) + options.rtol * value;
        let reach = |k: usize| {
            let rounding = EPS * self.coefficient(place, k).abs();
            power(tolerance / rounding, 1.0 / k as f64)
        };
        (2..self.order() - 1)
            .filter(|&k| self.coefficient(place, k) != 0.0)
            .map(reach)
            .fold(f64::INFINITY, f64::min)
    }

    /// The tolerance for a function: relative to what it moves through in a step, exit functions to the larger one.
    fn function_scale(
        &self,
        jets: &MotionJets,
        options: &Options,
        place: usize,
        reach: f64,
    ) -> f64 {
        let size = |place: usize| {
            let slope = self.coefficient(place, 1).abs();
            let moved = if reach.is_finite() {
                slope * reach
            } else {
                slope
            };
            self.coefficient(place, 0).abs().max(moved)
        };
        // Exit functions come in pairs.
        let first = jets.exit(0).filter(|&first| first <= place);
        let size = match first.map(|first| first + (place - first) / 2 * 2) {
            Some(pair) => size(pair).max(size(pair + 1)),
            None => size(place),
        };
        let atol = options.atol.iter().copied().fold(f64::INFINITY, f64::min);
        atol + options.rtol * size
    }
}

impl Stepper for Taylor {
    #[inline(always)]
    fn step(&self) -> &Step {
        &self.step
    }

    fn step_mut(&mut self) -> &mut Step {
        &mut self.step
    }

    #[inline(always)]
    fn attempt(&mut self, at: &mut Run, dt: f64) -> Result<Option<Attempt>, FieldError> {
        let attempt = self.attempt_along(&mut at.motion.field, at.t, &at.x, dt, &at.scale)?;
        observer(&mut at.seen)(&at.motion.field);
        Ok(Some(attempt))
    }

    fn extrapolation_error(&self, theta: f64, _: &ErrorScale) -> f64 {
        self.error_beyond(theta)
    }

    #[inline(always)]
    fn begin(&mut self, at: &mut Run) -> Ready {
        (self.series.jets, self.series.reach) = (None, None);
        let (system, motion, order) = (at.system, &mut at.motion, self.order());
        // Whether a surface is left that h = 0 all along was expected of is seen at the ends of steps only.
        // A series that ends at the surface that is left would be left itself after a step of no length.
        let starts_clear = || motion.monitored.iter().all(|m| m.deflation.is_none());
        let may = !motion.is_in_contact()
            && motion.resting.is_empty()
            && !motion.is_drawn_back()
            && !motion.slides_by_rule()
            && motion.has_bounds()
            && (system.is_analytic() || starts_clear());
        if may {
            let is_auto = at.options.method == Method::Auto;
            self.series.jets = motion.jets(system, |sliding, functions| {
                // Series on many surfaces are long: they are not even made where they are not wanted.
                if is_auto && sliding.len() > MOST_AUTO_SERIES {
                    return None;
                }
                let jets = system.motion_jets_of(sliding, functions, order);
                jets.filter(|jets| !is_auto || jets.is_unrolled())
            });
        }
        match self.series.jets {
            Some(_) => Ready::ANY,
            None => Ready::NotThisMotion,
        }
    }

    /// The derivative is the first coefficient, and of sliding on one surface the exit functions are those of the series.
    /// Sliding on several starts with its field: the series begins with the multipliers that the field finds.
    #[inline(always)]
    fn start(&mut self, at: &mut Run) -> Result<bool, FieldError> {
        let Some(jets) = self.series.jets.take() else {
            return Ok(false);
        };
        let first_exit = jets.exit(0);
        match &mut at.motion.field {
            ModeField::Region(_) => {}
            // Where the motion sticks its limits are others than those of the series.
            ModeField::Sliding(field)
                if first_exit.is_some()
                    && !at.system.sticks_at(field.surface())
                    && !field.is_at_two_fold(at.t) =>
            {
                field.project(at.t, &mut at.x)?;
            }
            _ => {
                self.series.jets = Some(jets);
                return Ok(false);
            }
        }
        let allowed = self.expand_motion(at, &jets, None);
        let is_known = !allowed.is_nan();
        if is_known {
            self.start_from_series();
            at.stats.n_field_evaluations += jets.cost();
            if let (ModeField::Sliding(field), Some(first)) = (&mut at.motion.field, first_exit) {
                let exits = [first, first + 1].map(|place| self.coefficient(place, 0));
                field.set_exits(at.t, exits);
            }
            self.series.reach = Some(self.limited_by_functions(&jets, at.options, allowed));
        } else {
            self.forget();
        }
        self.series.jets = Some(jets);
        Ok(is_known)
    }

    /// If redundant contacts share a load their equations do not determine the multipliers: there are no series.
    fn started(&mut self, at: &mut Run) -> Ready {
        match at.motion.shares_load() {
            true => Ready::NotThisMotion,
            false => Ready::ANY,
        }
    }

    /// Once, in a run that was to use series.
    #[cold]
    #[inline(never)]
    fn refusal(&mut self, at: &Run) -> Option<Box<Warning>> {
        if at.options.method != Method::Taylor || self.series.has_warned {
            return None;
        }
        self.series.has_warned = true;
        let (t, mode) = (at.t, &at.motion.mode);
        let text = format!(
            "the motion in mode {mode} from t = {t:.10} has no Taylor series (its field is not analytic there, is \
             not traced, slides by another rule than the canopy, sticks, shares a load among redundant contacts, is drawn back to its surface, or is in \
             contact): DOPRI5 integrates it"
        );
        Some(Box::new(Warning {
            t,
            code: WarningCode::NoSeries,
            surfaces: Vec::new(),
            text,
            candidates: Vec::new(),
            rule: "",
        }))
    }

    fn start_derivative_mut(&mut self) -> &mut [f64] {
        self.forget();
        &mut self.step.start_derivative
    }

    #[inline(always)]
    fn prepare(&mut self, at: &mut Run) -> Result<Ready, FieldError> {
        // At a two-fold the multiplier of the series is a quotient of rounding.
        if matches!(&at.motion.field, ModeField::Sliding(field) if field.is_at_two_fold(at.t)) {
            return Ok(Ready::NotThisStep);
        }
        let allowed = match self.series.reach.take() {
            Some(allowed) => allowed,
            None if self.is_expanded() => return Ok(Ready::ANY),
            None => {
                let Some(jets) = self.series.jets.take() else {
                    return Ok(Ready::NotThisMotion);
                };
                let signs = multipliers_in(&at.motion, &at.seen);
                let allowed = self.expand_motion(at, &jets, signs.as_deref());
                at.stats.n_field_evaluations += jets.cost();
                let allowed = self.limited_by_functions(&jets, at.options, allowed);
                self.series.jets = Some(jets);
                allowed
            }
        };
        Ok(if allowed > TAYLOR_SHORTEST * EPS * at.t.abs() {
            Ready::UpTo(allowed)
        } else {
            Ready::NotThisMotion
        })
    }

    #[inline(always)]
    fn accept(&mut self, y: &mut [f64]) {
        self.step.accept(y);
        self.forget();
    }

    /// As long as the next series allows.
    #[inline(always)]
    fn after_acceptance(&self, _: &mut Controller, _: f64, _: f64) -> f64 {
        f64::INFINITY
    }

    fn after_rejection(&self, _: &mut Controller, error: f64) -> f64 {
        self.reject(error)
    }

    #[inline(always)]
    fn is_series(&self) -> bool {
        true
    }

    #[inline(always)]
    fn exit_series(&self, index: usize, rows: &mut [f64]) -> Option<ExitSeries> {
        let jets = self.series.jets.as_ref()?;
        self.column(jets.exit(index)?, rows);
        Some(ExitSeries {
            is_affine: jets.has_affine_exits(),
            is_complete: jets.tells_of_exits(),
        })
    }

    /// Is the step far shorter than the motion takes to change? The fastest rate is that between the last two sums of the
    /// series, whose difference is what grows fastest.
    fn is_limited_by_stability(&mut self, at: &mut Run) -> Result<Option<bool>, FieldError> {
        let Some(mut beside) = self.slow_end_without_last(&at.x, &at.scale) else {
            return Ok(Some(false));
        };
        let (dt, end) = (self.step.interpolant.dt, &self.step.end);
        let apart: SmallVec<[f64; 16]> = beside.iter().zip(end).map(|(a, b)| a - b).collect();
        let mut rates_beside: SmallVec<[f64; 16]> = SmallVec::from_elem(0.0, beside.len());
        at.motion
            .field
            .eval_unprojected(at.t + dt, &mut beside, &mut rates_beside)?;
        rates_beside
            .iter_mut()
            .zip(&self.step.end_derivative)
            .for_each(|(a, b)| *a -= b);
        let rate = at.scale.norm(&rates_beside, end) / at.scale.norm(&apart, end);
        Ok(Some(rate * dt > STIFF_SERIES))
    }
}

/// The signs of sliding on several surfaces, with the multipliers at the start of the step in their places.
#[inline(always)]
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
