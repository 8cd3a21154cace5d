//! Steps at the edge of the field: where it ends at a surface, where it jumps without one, and where stages have to stay on
//! the side of the motion.

use crate::error::FieldError;
use crate::event::isolate::Bracket;
use crate::event::locate::refine;
use crate::event::Found;
use crate::integrate::integrator::Integrator;
use crate::motion::Monitored;
use crate::motion::{Guard, ModeField, SmoothField};
use crate::status::{Warning, WarningCode};
use crate::stepper::Attempt;
use crate::tolerances::{ARRIVED, EPS, JUMP_SHRINK, ONE_SIDED_AIM};

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
    pub(in crate::integrate) fn shorten_step(&mut self, dt: f64) {
        self.dt = dt;
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
            let Guard::Surface(j) = m.guard else {
                continue;
            };
            let signs = &self.motion.signs;
            self.system
                .gradient(j, self.t, &self.x, signs, &mut gradient)?;
            let tolerance = self.scale.along(&gradient, &self.x);
            if m.rate < 0.0 && m.value <= ARRIVED * tolerance {
                return Ok(Some(Found::here(smallvec::smallvec![m.guard])));
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
        let may_bend = match self.motion.sliding.len() {
            0 => false,
            1 => self.detector.approaches_two_fold(),
            _ => true,
        };
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
            self.chatter.suspect(self.t, self.recent_dt);
            self.recent_dt = 0.0;
        }
        self.recent_dt = dt.max(0.98 * self.recent_dt);
    }
}

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
            let Guard::Surface(j) = m.guard else {
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
        // On a surface the field is there at the end too, which is projected onto it.
        let evaluates_end = !matches!(self.motion.field, ModeField::Region(_));
        let field = (&mut self.motion.field, evaluates_end);
        midpoint.attempt(
            field,
            self.detector.observer(),
            self.t,
            &self.x,
            dt,
            &self.scale,
        )
    }
}
