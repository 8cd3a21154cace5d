//! Sliding on an intersection whose root, or whose stability, ends; forces that balance to rounding.

use smallvec::smallvec;

use crate::event::EventFunction;
use crate::field::IntersectionExit;
use crate::integrate::detection::detect::Found;
use crate::integrate::integrator::Integrator;
use crate::integrate::motion::ModeField;
use crate::integrate::{Warning, WarningCode};
use crate::tolerances::{AT_FOLD, AT_SIDE, FIRST_SLACK};

impl Integrator<'_> {
    /// Sliding on an intersection whose steps shrink to nothing has come to a fold: beyond it there are no
    /// multipliers.
    pub(in crate::integrate) fn lost_root(&self) -> Option<Found> {
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
    pub(in crate::integrate) fn loses_stability(&self, event: &Found) -> bool {
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
    pub(in crate::integrate) fn loosen(&mut self, event: &Found, stays: bool) {
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
    pub(in crate::integrate) fn note_oscillation(&mut self) {
        let ModeField::Intersection(field) = &self.motion.field else {
            return;
        };
        if !field.oscillates() {
            return;
        }
        let surfaces = field.set().to_vec();
        let names = surfaces
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
            surfaces,
        });
    }
}
