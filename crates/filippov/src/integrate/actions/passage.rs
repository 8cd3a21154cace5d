//! Does the motion go through a surface that triggers actions?

use smallvec::smallvec;

use crate::error::FieldError;
use crate::field::SmoothField;
use crate::integrate::decisions::transition::Values;
use crate::integrate::integrator::Integrator;
use crate::mode::Mode;
use crate::switching::Leading;
use crate::system::{dot, surfaces_that_matter};
use crate::tolerances::DEPARTS_TANGENTIALLY;

impl Integrator<'_> {
    /// Does the motion lead from this side through a surface that the point lies on? A body that is pressed on
    /// without velocity does not: it stays.
    pub(in crate::integrate) fn goes_through(
        &mut self,
        j: usize,
        side: i8,
        mode: &Mode,
        on_surface: &[bool],
    ) -> Result<bool, FieldError> {
        let mode = mode.with(j, side);
        let leading = match self.rate_of_sliding(j, on_surface)? {
            Some(value) => Leading { order: 1, value },
            None => {
                let others = (0..on_surface.len()).filter(|&k| {
                    k != j && on_surface[k] && !self.is_internal(k) && !self.is_only_trigger(k)
                });
                let others: Vec<usize> = others.collect();
                let meeting = surfaces_that_matter(self.system, &mode, others);
                self.leading_along(j, &mode, &meeting, None)?
            }
        };
        if leading.sign() != -side {
            return Ok(false);
        }
        let is_still = leading.order != 1 || self.is_slow(j, leading.value, &mode)?;
        Ok(!is_still || !self.can_stay(j, &mode)?)
    }

    /// The rate of h_j where the motion slides on, at a point on its surfaces; `None` if it does not, or h_j is tangent.
    fn rate_of_sliding(
        &mut self,
        j: usize,
        on_surface: &[bool],
    ) -> Result<Option<f64>, FieldError> {
        let sliding = self.motion.sliding();
        let may_slide = sliding.iter().all(|&k| k != j && on_surface[k]);
        if sliding.is_empty() || !may_slide || self.motion.is_in_contact() {
            return Ok(None);
        }
        let rate = self.rates_here()?[j];
        let is_admissible = self
            .motion
            .field
            .last_exits()
            .iter()
            .all(|&exit| exit > 0.0);
        let mut gradient = vec![0.0; self.x.len()];
        let signs = &self.motion.signs;
        let ht = self
            .system
            .gradient(j, self.t, &self.x, signs, &mut gradient)?;
        let size = ht.abs() + dot(&gradient, &gradient).sqrt();
        let is_clear = rate.abs() > DEPARTS_TANGENTIALLY * size;
        Ok((is_admissible && is_clear).then_some(rate))
    }

    /// The rates of all switching functions along the motion that arrives here.
    pub(in crate::integrate) fn rates_here(&mut self) -> Result<Values, FieldError> {
        let d = self.system.n_surfaces();
        let (mut h, mut rates): (Values, Values) = (smallvec![0.0; d], smallvec![0.0; d]);
        let mut velocity = vec![0.0; self.x.len()];
        let mut x = self.x.clone();
        self.motion.field.eval(self.t, &mut x, &mut velocity)?;
        let signs = &self.motion.signs;
        self.system
            .surface_rates(self.t, &self.x, signs, &velocity, &mut h, &mut rates)?;
        Ok(rates)
    }
}
