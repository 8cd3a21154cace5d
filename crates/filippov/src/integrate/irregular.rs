//! Steps at the edge of the field: where it ends at a surface, and where it jumps without one.

use super::integrator::Integrator;
use super::{Warning, WarningCode};
use crate::event::Monitored;
use crate::tolerances::{JUMP_SHRINK, ONE_SIDED_AIM};

impl Integrator<'_> {
    /// After a step that was not finite: aims at a surface that the motion approaches, close enough
    /// for the continuous extension to reach it, else shortens the step.
    pub(super) fn shorten_to_surface(&mut self, dt: f64) {
        let nearest = self
            .motion
            .monitored
            .iter()
            .map(Monitored::time_to_zero)
            .fold(f64::INFINITY, f64::min);
        let aim = ONE_SIDED_AIM * nearest;
        self.dt = if !self.one_sided && aim < dt {
            aim
        } else {
            0.5 * dt
        };
        self.one_sided = true;
        self.controller.not_finite();
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
