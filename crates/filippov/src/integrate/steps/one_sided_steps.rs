//! Steps by the midpoint rule, whose stages stay on the side of the motion.

use crate::error::FieldError;
use crate::event::isolate::Bracket;
use crate::event::locate::refine;
use crate::event::EventFunction;
use crate::field::ModeField;
use crate::field::SmoothField;
use crate::integrate::integrator::Integrator;
use crate::stepper::Attempt;
use crate::tolerances::EPS;

impl Integrator<'_> {
    /// The step `dt`, or the longest one whose stage in the middle is not beyond a surface that the motion in a region comes to:
    /// then it lies on the surface, and the end behind it (Dieci, Lopez 2009, theorem 5.2).
    ///
    /// # Errors
    /// If a function of the user raises.
    #[cold]
    pub(in crate::integrate) fn keep_to_side(&mut self, dt: f64) -> Result<f64, FieldError> {
        let Some(midpoint) = &mut self.stepper.midpoint else {
            return Ok(dt);
        };
        if !midpoint.is_started() {
            let mut x = self.x.clone();
            let derivative = midpoint.start_derivative_mut();
            self.motion.field.eval(self.t, &mut x, derivative)?;
        }
        if !matches!(self.motion.field, ModeField::Region(_)) {
            return Ok(dt);
        }
        let (system, t, signs) = (self.system, self.t, &self.motion.signs);
        let (x, derivative) = (&self.x, &midpoint.step().start_derivative);
        let mut h = vec![0.0; system.n_surfaces()];
        let mut stage = x.clone();
        let mut at = |index: usize, dt: f64| -> Result<f64, FieldError> {
            let points = stage.iter_mut().zip(x.iter().zip(derivative));
            points.for_each(|(stage, (x, k))| *stage = x + 0.5 * dt * k);
            system.surfaces(t + 0.5 * dt, &stage, signs, &mut h)?;
            Ok(h[index])
        };
        let mut longest = dt;
        for m in &self.motion.monitored {
            let EventFunction::Surface(j) = m.function else {
                continue;
            };
            if m.deflation.is_some() || m.value <= 0.0 {
                continue;
            }
            let mut side = |theta: f64| Ok(m.orientation * at(j, theta * longest)?);
            let end = side(1.0)?;
            // A function that is not finite there has its surface before.
            if end >= 0.0 || end.is_nan() {
                continue;
            }
            let bracket = Bracket {
                lo: 0.0,
                hi: 1.0,
                g_lo: m.value,
                g_hi: end,
                guess: m.value / (m.value - end),
                slope: end - m.value,
            };
            let mut theta = refine(&mut side, bracket, EPS)?.theta;
            // Rounding may blur the zero far beyond the rounding of the step: growing strides get out of that.
            let mut stride = 4.0 * EPS;
            while side(theta)? < 0.0 && theta > 0.0 {
                theta *= 1.0 - stride;
                stride = (2.0 * stride).min(0.5);
            }
            longest *= theta;
        }
        Ok(longest)
    }

    /// Attempts a step by the midpoint rule.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub(in crate::integrate) fn attempt_midpoint(
        &mut self,
        dt: f64,
    ) -> Result<Attempt, FieldError> {
        let Some(midpoint) = &mut self.stepper.midpoint else {
            return Ok(Attempt::NotFinite);
        };
        let stages = &mut self.detector.stages;
        let observe = |number: usize, field: &ModeField| {
            for (exit, value) in stages.iter_mut().zip(field.last_exits()) {
                match number {
                    6 => exit[6] = value,
                    _ => exit[1..6].fill(value),
                }
            }
        };
        // On a surface the field is there at the end too, which is projected onto it.
        let evaluates_end = !matches!(self.motion.field, ModeField::Region(_));
        let field = (&mut self.motion.field, evaluates_end);
        midpoint.attempt(field, observe, self.t, &self.x, dt, &self.scale)
    }
}
