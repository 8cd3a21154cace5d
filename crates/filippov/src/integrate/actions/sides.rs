//! Warnings about the side from which an action is triggered.

use crate::decisions::{is_slow, leaves_point_alone, Cause};
use crate::error::FieldError;
use crate::integrate::integrator::Integrator;

use crate::mode::Mode;
use crate::status::{Warning, WarningCode};
use crate::switching::first_nonzero;

impl Integrator<'_> {
    /// Warns of triggers that the motion crosses without an action, since their direction is the other one, where the
    /// action would have kept it on its side: a wall that is passed from behind. A count, or a relay with two
    /// thresholds, is crossed either way. Each trigger is looked at once.
    #[cold]
    pub(in crate::integrate) fn warn_against_direction(
        &mut self,
        before: &Mode,
        after: &Mode,
        surfaces: &[usize],
    ) {
        for &j in surfaces {
            let side = before.entries()[j];
            let is_crossed = side != 0 && after.entries()[j] == -side;
            if !is_crossed || !self.triggers().is_only_trigger(j) || self.triggers().follows_law(j)
            {
                continue;
            }
            let is_triggered = self.triggered_at(j, side).next().is_some();
            if is_triggered || self.motion.passed.contains(&j) {
                continue;
            }
            self.motion.passed.push(j);
            // A map that fails here was not asked for.
            if self.would_turn_back(j, before).unwrap_or(false) {
                let text = format!(
                    "the motion crosses {} = 0 against the direction of the reset {}, which does not happen there; \
                     with direction=\"both\" it does",
                    self.system.surface_name(j),
                    self.action_name(j)
                );
                self.warn(WarningCode::AgainstDirection, j, text);
            }
        }
    }

    /// Would the action at surface `j`, on which the point lies, leave the motion on the side of the mode?
    fn would_turn_back(&mut self, j: usize, mode: &Mode) -> Result<bool, FieldError> {
        let (side, signs) = (mode.entries()[j], mode.signs());
        let Some(action) = self.actions.from_side(j, side) else {
            return Ok(false);
        };
        let (mut x, mut q) = (self.x.clone(), self.motion.discrete.clone());
        action.map.apply(self.t, &mut x, &signs, &mut q)?;
        let mut h = vec![0.0; signs.len()];
        self.system.surfaces(self.t, &x, &signs, &mut h)?;
        let cause = Cause::Anew(mode);
        if !self.ask(cause, |at, _| leaves_point_alone(at, j, &signs))? {
            return Ok(h[j] * f64::from(side) > 0.0);
        }
        let mut row = vec![0.0; x.len()];
        let rate = self.system.rate_gradient(j, self.t, &x, &signs, &mut row)?;
        Ok(rate.rate * f64::from(side) > 0.0)
    }

    /// Warns of a start on a trigger without a direction, unless the velocity leads off to the side taken. `mode` has the side
    /// that was taken.
    pub(in crate::integrate) fn warn_unknown_side(
        &mut self,
        j: usize,
        mode: &Mode,
    ) -> Result<(), FieldError> {
        let has_direction = self.actions.at_surface(j).is_none_or(|(_, d)| d != 0);
        if has_direction || self.triggers().follows_law(j) {
            return Ok(());
        }
        let side = mode.entries()[j];
        let leading = first_nonzero(self.system, j, side, 0, self.t, &self.x, &mode.signs())?;
        let leads_off = leading.order == 1
            && leading.sign() == side
            && !self.ask(Cause::Start, |at, _| is_slow(at, j, leading.value, mode))?;
        if !leads_off {
            let text = format!(
                "the run starts on {} = 0, and the reset {} has no direction: the start counts as on the side where the \
                 function of the reset is positive, as with direction=\"down\"; direction=\"up\" is the other side",
                self.system.surface_name(j),
                self.action_name(j)
            );
            self.warn(WarningCode::UnknownSide, j, text);
        }
        Ok(())
    }

    fn action_name(&self, j: usize) -> &str {
        let found = self.actions.at_surface(j);
        found.map_or("", |(action, _)| &action.name)
    }

    fn warn(&mut self, code: WarningCode, j: usize, text: String) {
        self.warnings.push(Warning {
            t: self.t,
            code,
            text,
            candidates: Vec::new(),
            surfaces: vec![j],
            rule: "",
        });
    }
}
