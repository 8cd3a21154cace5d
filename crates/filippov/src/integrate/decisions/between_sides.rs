//! Sliding between fields in which other functions have different signs.

use crate::error::FieldError;
use crate::integrate::decisions::nested::between;
use crate::integrate::integrator::Integrator;
use crate::integrate::Stop;
use crate::tolerances::{BETWEEN_SIDES, MOST_MEETING};

impl Integrator<'_> {
    /// Surfaces that have another sign on some side of what is slid on than in the mode: the motion would slide between fields
    /// that differ in several signs at once.
    pub(in crate::integrate) fn differs_between_sides(
        &mut self,
        t: f64,
        x: &[f64],
    ) -> Result<Option<Stop>, FieldError> {
        let sliding = self.motion.sliding.clone();
        if !(1..=MOST_MEETING).contains(&sliding.len()) {
            return Ok(None);
        }
        let mut h = vec![0.0; self.motion.signs.len()];
        for pattern in 0..1_usize << sliding.len() {
            let side = self.motion.mode.on_sides(&sliding, pattern);
            let signs = side.signs();
            self.system.surfaces(t, x, &signs, &mut h)?;
            for k in (0..h.len()).filter(|k| !sliding.contains(k) && self.motion.active[*k]) {
                let beyond = -h[k] * f64::from(side.entries()[k]);
                let size = self.system.surface_size(k, t, x, &signs)?;
                let is_known = self.motion.resting.contains(&k);
                if !is_known && beyond > BETWEEN_SIDES * (1.0 + size) {
                    return Ok(Some(between(&sliding, &[k])));
                }
            }
        }
        Ok(None)
    }
}
