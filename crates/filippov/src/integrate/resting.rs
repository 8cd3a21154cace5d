//! Surfaces whose functions are zero all along the motion: those that neither field leaves, and those in the place of the
//! one slid on.

use crate::decisions::Left;
use crate::error::FieldError;
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::motion::first_nonzero;
use crate::motion::{Guard, ModeField, Projector, SlidingSet};
use crate::status::{Stop, Warning, WarningCode};
use crate::tolerances::{DOUBTFUL, LEFT_RESTING};

impl Integrator<'_> {
    /// Notes the surfaces that the motion in `mode` does not leave, and names those that the field beyond would not leave
    /// either and about which nothing was said yet.
    pub(in crate::integrate) fn note_resting(
        &mut self,
        mode: &Mode,
        left: &[Left],
    ) -> Result<(), FieldError> {
        let resting = left.iter().filter(|left| left.leading.order == 0);
        let resting = resting.filter_map(Left::surface);
        self.motion.resting.clear();
        self.motion.resting.extend(resting);
        if self.motion.resting.is_empty() {
            return Ok(());
        }
        let signs = mode.signs();
        for k in 0..self.motion.resting.len() {
            let j = self.motion.resting[k];
            let beyond = -mode.entries()[j];
            let leading = first_nonzero(self.system, j, beyond, 0, self.t, &self.x, &signs)?;
            if leading.order == 0 {
                self.warn_zero_surface(j, mode);
            }
        }
        Ok(())
    }

    /// Was a warning given about this surface alone: its function is zero along a motion, or the solution is not unique there?
    fn is_named(&self, j: usize) -> bool {
        let is_about = |code| matches!(code, WarningCode::ZeroSurface | WarningCode::NonUnique);
        let mut warnings = self.warnings.iter();
        warnings.any(|warning| is_about(warning.code) && warning.surfaces == [j])
    }

    /// Warns of a surface whose function is zero all along the motion in `mode`, unless a warning was given about it.
    ///
    /// It is no mistake where nothing depends on the sign: where bodies touch without any force, and at a kink, where the
    /// values of both signs agree, as those of `max(h, 0)` and `abs(h)` do where h = 0.
    fn warn_zero_surface(&mut self, j: usize, mode: &Mode) {
        if self.is_named(j) || self.triggers().is_only_trigger(j) {
            return;
        }
        let sliding: SlidingSet = mode.sliding_set().collect();
        if !self.system.jumps_across(j, &mode.signs(), &sliding) {
            return;
        }
        let name = self.system.surface_name(j);
        self.warnings.push(Warning {
            t: self.t,
            code: WarningCode::ZeroSurface,
            surfaces: vec![j],
            text: format!(
                "{name} is zero all along the motion from here: its sign means nothing, and that of the mode is taken"
            ),
            candidates: Vec::new(),
            rule: "",
        });
    }

    /// A surface whose function was zero all along the step just made, up to rounding, and about which nothing was said: a
    /// function that becomes zero without a sign in it, as one that is called may do, or a rest that is reached.
    pub(in crate::integrate) fn zero_surface(
        &mut self,
        t1: f64,
    ) -> Result<Option<usize>, FieldError> {
        for index in 0..self.motion.monitored.len() {
            let m = self.motion.monitored[index];
            let (end, _) = self.detector.right[index];
            let Guard::Surface(j) = m.guard else {
                continue;
            };
            // Few functions come this far; the sizes in the noise are not computed for the others.
            if m.deflation.is_some() || m.value.abs().max(end.abs()) > DOUBTFUL {
                continue;
            }
            let noise = self.step_search().0.noise_of(&m)?;
            if m.value.abs().max(end.abs()) > noise {
                continue;
            }
            let signs = self.motion.signs.clone();
            self.stepper.interpolant().at(0.5, &mut self.detector.x);
            let (middle, h) = (0.5 * (self.t + t1), &mut self.detector.h);
            self.system.surfaces(middle, &self.detector.x, &signs, h)?;
            if h[j].abs() <= noise && !self.is_named(j) && !self.motion.settled.contains(&j) {
                return Ok(Some(j));
            }
        }
        Ok(None)
    }

    /// Goes on where h_j has become zero: along the surface, if the fields hold the motion there, as where it has come to rest
    /// by a root of the distance. Beside the surface it would follow what the root makes of rounding.
    pub(in crate::integrate) fn settle_on(&mut self, j: usize) -> Result<Option<Stop>, FieldError> {
        let signs = self.motion.signs.clone();
        let mut projector = Projector::new(self.x.len(), signs.len());
        projector.project(self.system, j, self.t, &mut self.x, &signs)?;
        let stop = self.go_on_from_here()?;
        if !self.motion.sliding().contains(&j) {
            if !self.motion.resting.contains(&j) {
                self.motion.settled.push(j);
            }
            self.warn_zero_surface(j, &self.motion.mode.clone());
        }
        Ok(stop)
    }

    /// Warns where a motion begins at a root around which the regularised motion oscillates.
    pub(in crate::integrate) fn note_oscillation(&mut self) {
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
            surfaces: field.set().to_vec(),
            text: format!(
                "sliding at the intersection of {} is not stable for this scaling of the surfaces: the regularised \
                 motion goes around it, with another mean, or away from it; another kappa= may be stable",
                names.join(", ")
            ),
            candidates: Vec::new(),
            rule: "",
        });
    }

    /// Has the motion left a surface that it was to stay on, by more than the tolerance?
    pub(in crate::integrate) fn has_left_resting(&mut self) -> Result<bool, FieldError> {
        let signs = self.motion.signs.clone();
        let h = self.surface_values(&signs)?;
        let mut gradient = vec![0.0; self.x.len()];
        for &j in &self.motion.resting {
            self.system
                .gradient(j, self.t, &self.x, &signs, &mut gradient)?;
            let tolerance = self.scale.along(&gradient, &self.x);
            // Bodies that touch have to be held apart at once.
            let factor = if self.triggers().is_only_trigger(j) {
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
}
