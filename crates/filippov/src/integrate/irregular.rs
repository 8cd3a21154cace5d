//! Steps at the edge of the field: where it ends at a surface, and where it jumps without one.

use smallvec::smallvec;

use super::choice::NOT_UNIQUE_AT;
use super::detect::Found;
use super::integrator::Integrator;
use super::motion::ModeField;
use super::transition::Left;
use super::{Warning, WarningCode};
use crate::error::FieldError;
use crate::event::{EventFunction, Monitored};
use crate::field::IntersectionExit;
use crate::tolerances::{
    ARRIVED, AT_FOLD, AT_SIDE, FIRST_SLACK, JUMP_SHRINK, LEFT_RESTING, NEARLY_ZERO, ONE_SIDED_AIM,
};

impl Integrator<'_> {
    /// Where a field was found to end at its surfaces, a step that would pass the next one aims at it
    /// from the start, close enough for the continuous extension to reach it.
    pub(super) fn aim_at_surface(&mut self, dt: f64) -> f64 {
        if !self.meets_edges || self.one_sided {
            return dt;
        }
        let nearest = self.nearest_surface();
        if nearest > dt {
            return dt;
        }
        self.one_sided = true;
        ONE_SIDED_AIM * nearest
    }

    /// After a step that was not finite: aims at the surface that the motion approaches, or shortens
    /// the step if it did so already.
    pub(super) fn shorten_to_surface(&mut self, dt: f64) {
        if let ModeField::Intersection(field) = &self.motion.field {
            if field.is_rootless() {
                // No edge of the field: the multipliers end, or move fast.
                self.dt = 0.5 * dt;
                self.controller.not_finite();
                return;
            }
        }
        let aim = ONE_SIDED_AIM * self.nearest_surface();
        let aims = !self.one_sided && aim < dt;
        self.dt = if aims { aim } else { 0.5 * dt };
        self.one_sided = true;
        self.meets_edges = true;
        self.controller.not_finite();
    }

    /// After a step whose events could not be decided.
    pub(super) fn halve_step(&mut self, dt: f64) {
        self.dt = 0.5 * dt;
        self.one_sided = true;
        self.controller.not_finite();
    }

    /// Predicted time to the next zero of what is monitored.
    fn nearest_surface(&self) -> f64 {
        let times = self.motion.monitored.iter().map(Monitored::time_to_zero);
        times.fold(f64::INFINITY, f64::min)
    }

    /// The event at the current point, if the motion can go no further because its field ends at a
    /// surface that it has reached to a small part of the tolerance.
    pub(super) fn arrival_at_edge(&mut self) -> Result<Option<Found>, FieldError> {
        let mut gradient = vec![0.0; self.x.len()];
        for m in &self.motion.monitored {
            let EventFunction::Surface(j) = m.function else {
                continue;
            };
            let signs = &self.motion.signs;
            self.system
                .gradient(j, self.t, &self.x, signs, &mut gradient)?;
            let components = gradient.iter().zip(&self.x).enumerate();
            let tolerance: f64 = components
                .map(|(i, (g, x))| g.abs() * self.scale.of(i, *x, *x))
                .sum();
            if m.rate < 0.0 && m.value <= ARRIVED * tolerance {
                return Ok(Some(Found {
                    theta: 0.0,
                    functions: smallvec::smallvec![m.function],
                    touch: false,
                }));
            }
        }
        Ok(None)
    }

    /// Sliding on an intersection whose steps shrink to nothing has come to a fold: beyond it there are no
    /// multipliers.
    pub(super) fn lost_root(&self) -> Option<Found> {
        let ModeField::Intersection(field) = &self.motion.field else {
            return None;
        };
        let fold = 2 * field.set().len();
        let ends = self.detector.stages.get(fold..=fold)?;
        let is_lost = field.set().len() > 2 && field.is_rootless();
        (is_lost || ends[0][0].abs() < AT_FOLD).then(|| Found {
            theta: 0.0,
            functions: smallvec![EventFunction::Exit(fold)],
            touch: false,
        })
    }

    /// Is it the root of three and more surfaces that is no longer stable?
    pub(super) fn loses_stability(&self, event: &Found) -> bool {
        let ModeField::Intersection(field) = &self.motion.field else {
            return false;
        };
        let is_stability = |f: &EventFunction| match f {
            EventFunction::Exit(index) => field.exit(*index) == IntersectionExit::Stability,
            _ => false,
        };
        field.set().len() > 2 && event.functions.iter().any(is_stability)
    }

    /// Where a multiplier reaches its end and the decision is that it slides on, forces balance to rounding: the
    /// multiplier may go a little beyond, ten times as far each time, so that the motion gets on.
    pub(super) fn loosen(&mut self, event: &Found, stays: bool) {
        let ModeField::Intersection(field) = &self.motion.field else {
            self.slacks.clear();
            return;
        };
        if !stays {
            self.slacks.clear();
            return;
        }
        for function in &event.functions {
            let EventFunction::Exit(index) = *function else {
                continue;
            };
            if !matches!(field.exit(index), IntersectionExit::Side { .. }) {
                continue;
            }
            match self.slacks.iter_mut().find(|held| held.0 == index) {
                Some(held) => held.1 = (10.0 * held.1).min(AT_SIDE),
                None => self.slacks.push((index, FIRST_SLACK)),
            }
        }
    }

    /// Warns where a motion begins at a root around which the regularised motion oscillates.
    pub(super) fn note_oscillation(&mut self) {
        let ModeField::Intersection(field) = &self.motion.field else {
            return;
        };
        if !field.oscillates() {
            return;
        }
        let names = field
            .set()
            .iter()
            .map(|&j| self.system.surface_name(j) + " = 0");
        let names: Vec<String> = names.collect();
        self.warnings.push(Warning {
            t: self.t,
            code: WarningCode::Oscillation,
            text: format!(
                "sliding at the intersection of {} is not stable for this scaling of the surfaces: the regularised \
                 motion goes around it, with another mean, or away from it; another kappa= may be stable",
                names.join(", ")
            ),
            candidates: Vec::new(),
        });
    }

    /// Notes the surfaces that neither field leaves, and names those about which nothing was said yet.
    pub(super) fn note_resting(&mut self, left: &[Left]) {
        let resting = left.iter().filter_map(|left| match left {
            Left::Surface(j, leading) if leading.order == 0 => Some(*j),
            _ => None,
        });
        self.motion.resting = resting.collect();
        for k in 0..self.motion.resting.len() {
            self.warn_zero_surface(self.motion.resting[k]);
        }
    }

    /// Names a surface whose function is zero all along the motion, unless something was said about it.
    fn warn_zero_surface(&mut self, j: usize) {
        let name = self.system.surface_name(j);
        let zero = format!("{name} is zero all along the motion from here");
        let is_named = |warning: &Warning| {
            let not_unique = warning.text.strip_prefix(NOT_UNIQUE_AT);
            let surfaces = not_unique.and_then(|text| text.split_once(" is not unique"));
            warning.text.starts_with(&zero)
                || surfaces.is_some_and(|(names, _)| names == format!("{name} = 0"))
        };
        if !self.warnings.iter().any(is_named) {
            self.warnings.push(Warning {
                t: self.t,
                code: WarningCode::ZeroSurface,
                text: format!("{zero}: its sign means nothing, and that of the mode is taken"),
                candidates: Vec::new(),
            });
        }
    }

    /// Names the surfaces whose functions were zero all along the step just made, up to rounding: a function that becomes
    /// zero without a sign in it, as one that is called may do.
    pub(super) fn note_zero_surfaces(&mut self, t1: f64) -> Result<(), FieldError> {
        for index in 0..self.motion.monitored.len() {
            let m = self.motion.monitored[index];
            let (end, _) = self.detector.right[index];
            let EventFunction::Surface(j) = m.function else {
                continue;
            };
            // Few functions come this far; the sizes in the noise are not computed for the others.
            if m.deflation.is_some() || m.value.abs().max(end.abs()) > NEARLY_ZERO {
                continue;
            }
            let noise = self.noise_of(m.function)?;
            if m.value.abs().max(end.abs()) > noise {
                continue;
            }
            let signs = self.motion.signs.clone();
            self.stepper.interpolant().at(0.5, &mut self.detector.x);
            let (middle, h) = (0.5 * (self.t + t1), &mut self.detector.h);
            self.system.surfaces(middle, &self.detector.x, &signs, h)?;
            if h[j].abs() <= noise {
                self.warn_zero_surface(j);
            }
        }
        Ok(())
    }

    /// Has the motion left a surface that it was to stay on, by more than the tolerance?
    pub(super) fn has_left_resting(&mut self) -> Result<bool, FieldError> {
        let signs = self.motion.signs.clone();
        let h = self.surface_values(&signs)?;
        let mut gradient = vec![0.0; self.x.len()];
        for &j in &self.motion.resting {
            self.system
                .gradient(j, self.t, &self.x, &signs, &mut gradient)?;
            let components = gradient.iter().zip(&self.x).enumerate();
            let tolerance: f64 = components
                .map(|(i, (g, x))| g.abs() * self.scale.of(i, *x, *x))
                .sum();
            // Bodies that touch have to be held apart at once.
            let factor = if self.is_only_trigger(j) {
                1.0
            } else {
                LEFT_RESTING
            };
            if h[j].abs() > factor * tolerance {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Warns where the field jumps over a step far shorter than its predecessors.
    pub(super) fn note_jump(&mut self, dt: f64) {
        let is_short = dt < JUMP_SHRINK * self.recent_dt;
        // Towards a fold of the multipliers the field of an intersection bends like a square root, and towards a
        // two-fold the multiplier is a quotient of small numbers.
        let may_bend = self.motion.sliding.len() > 1 || self.approaches_two_fold();
        if is_short && !may_bend && !self.meets_edges && self.stepper.field_jumps() {
            let t = self.t + dt;
            self.warnings.push(Warning {
                t,
                code: WarningCode::UndeclaredJump,
                text: format!(
                    "the right-hand side jumps near t = {t:.10} and no surface is declared there; \
                     give its switching function in surfaces="
                ),
                candidates: Vec::new(),
            });
            self.suspect_chatter(self.recent_dt);
            self.recent_dt = 0.0;
        }
        self.recent_dt = dt.max(0.98 * self.recent_dt);
    }
}
