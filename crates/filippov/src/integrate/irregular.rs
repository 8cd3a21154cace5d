//! Steps at the edge of the field: where it ends at a surface, and where it jumps without one.

use super::integrator::Integrator;
use super::{Warning, WarningCode};
use crate::event::Monitored;
use crate::tolerances::{JUMP_SHRINK, ONE_SIDED_AIM};

impl Integrator<'_> {
    /// Where a field was found to end at its surfaces, a step that would pass the next one aims at it
    /// from the start, close enough for the continuous extension to reach it.
    pub(super) fn aim_at_surface(&mut self, dt: f64) -> f64 {
        let nearest = self.nearest_surface();
        if !self.meets_edges || self.one_sided || nearest > dt {
            return dt;
        }
        self.one_sided = true;
        ONE_SIDED_AIM * nearest
    }

    /// After a step that was not finite: aims at the surface that the motion approaches, or shortens
    /// the step if it did so already.
    pub(super) fn shorten_to_surface(&mut self, dt: f64) {
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

    /// Warns where the field jumps over a step far shorter than its predecessors.
    pub(super) fn note_jump(&mut self, dt: f64) {
        if dt < JUMP_SHRINK * self.recent_dt {
            let (a, b) = (
                self.stepper.start_derivative(),
                self.stepper.end_derivative(),
            );
            let jumps = a
                .iter()
                .zip(b)
                .any(|(a, b)| (a - b).abs() > 0.3 * (a.abs() + b.abs()));
            if jumps {
                let t = self.t + dt;
                self.warnings.push(Warning {
                    t,
                    code: WarningCode::UndeclaredJump,
                    text: format!(
                        "the right-hand side jumps near t = {t:.10} and no surface is declared there; \
                         give its switching function in surfaces="
                    ),
                });
                self.recent_dt = 0.0;
            }
        }
        self.recent_dt = dt.max(0.9 * self.recent_dt);
    }
}
