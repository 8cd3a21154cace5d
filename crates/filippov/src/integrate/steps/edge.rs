//! Steps at the edge of the field: where it ends at a surface, and where it jumps without one.

use crate::error::FieldError;
use crate::event::Found;
use crate::event::{EventFunction, Monitored};
use crate::field::ModeField;
use crate::integrate::integrator::Integrator;
use crate::status::{Warning, WarningCode};
use crate::tolerances::{ARRIVED, JUMP_SHRINK, ONE_SIDED_AIM};

impl Integrator<'_> {
    /// Where a field was found to end at its surfaces, a step that would pass the next one aims at it
    /// from the start, close enough for the continuous extension to reach it.
    pub(in crate::integrate) fn aim_at_surface(&mut self, dt: f64) -> f64 {
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
    pub(in crate::integrate) fn shorten_to_surface(&mut self, dt: f64) {
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
    pub(in crate::integrate) fn halve_step(&mut self, dt: f64) {
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
    pub(in crate::integrate) fn arrival_at_edge(&mut self) -> Result<Option<Found>, FieldError> {
        let mut gradient = vec![0.0; self.x.len()];
        for m in &self.motion.monitored {
            let EventFunction::Surface(j) = m.function else {
                continue;
            };
            let signs = &self.motion.signs;
            self.system
                .gradient(j, self.t, &self.x, signs, &mut gradient)?;
            let tolerance = self.scale.along(&gradient, &self.x);
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

    /// Warns where the field jumps over a step far shorter than its predecessors.
    pub(in crate::integrate) fn note_jump(&mut self, dt: f64) {
        // A step up to a known time is short for that reason.
        let is_short = dt < JUMP_SHRINK * self.recent_dt && dt < self.horizon - self.t;
        // Towards a fold of the multipliers the field of an intersection bends like a square root, and towards a
        // two-fold the multiplier is a quotient of small numbers.
        let may_bend = self.motion.sliding.len() > 1 || self.approaches_two_fold();
        if is_short && !may_bend && !self.meets_edges && self.stepper.field_jumps() {
            let t = self.t + dt;
            self.warnings.push(Warning {
                t,
                code: WarningCode::UndeclaredJump,
                text: "the right-hand side jumps here and no surface is declared; give its switching function in \
                       surfaces="
                    .into(),
                candidates: Vec::new(),
                surfaces: Vec::new(),
                rule: "",
            });
            self.suspect_chatter(self.recent_dt);
            self.recent_dt = 0.0;
        }
        self.recent_dt = dt.max(0.98 * self.recent_dt);
    }
}
