//! A function that becomes zero without a sign in it: where the motion comes to rest on its surface.

use crate::decisions::{warn_zero_surface, Cause};
use crate::error::FieldError;
use crate::integrate::integrator::Integrator;
use crate::motion::{Guard, Projector};
use crate::status::{is_named, Stop};
use crate::tolerances::DOUBTFUL;

impl Integrator<'_> {
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
            if h[j].abs() <= noise
                && !is_named(&self.warnings, j)
                && !self.motion.settled.contains(&j)
            {
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
        let stop = self.go_on_from_here(&[])?;
        if !self.motion.sliding().contains(&j) {
            if !self.motion.resting.contains(&j) {
                self.motion.settled.push(j);
            }
            let mode = self.motion.mode.clone();
            self.ask(Cause::Start, |at, notes| {
                warn_zero_surface(at, notes, j, &mode);
                Ok(())
            })?;
        }
        Ok(stop)
    }
}
