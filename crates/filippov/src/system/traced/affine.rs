//! A traced system whose field is affine in signs.

use filippov_expr::{Enclosure, Motion};

use super::TracedSystem;
use crate::error::FieldError;
use crate::page::IS_PAGE;
use crate::system::{AffineParts, AffineSigns, Place, Setting, SignStructure};

impl AffineSigns for TracedSystem {
    fn affine_parts(&self, surfaces: &[usize]) -> Option<AffineParts> {
        let mut parts = AffineParts::default();
        let is_affine = self.refit_affine_parts(surfaces, &mut parts);
        is_affine.then_some(parts)
    }

    fn refit_affine_parts(&self, surfaces: &[usize], parts: &mut AffineParts) -> bool {
        let is_affine = self.model.affine_signs().refit(surfaces, parts);
        parts.set_steady(surfaces.iter().all(|&j| self.is_steady(j)));
        is_affine
    }

    fn fill_affine_parts(
        &self,
        place: &Place<'_>,
        parts: &mut AffineParts,
    ) -> Result<u64, FieldError> {
        let compiled = self.model.affine_signs();
        if !self.model.has_sticking() {
            self.with_values(place.q, |p| compiled.fill(place, p, parts, false));
            return Ok(1);
        }
        let mut stretched = place.signs.to_vec();
        let ratios: Vec<f64> = parts
            .surfaces()
            .iter()
            .map(|&j| self.stick_ratio(j, place))
            .collect();
        for (&j, ratio) in parts.surfaces().iter().zip(&ratios) {
            stretched[j] *= ratio;
        }
        let place = place.with_signs(&stretched);
        self.with_values(place.q, |p| compiled.fill(&place, p, parts, true));
        parts.stretch(&ratios);
        Ok(1)
    }

    fn is_steady(&self, j: usize) -> bool {
        !self.model.sticks_at(j) && self.model.affine_signs().is_steady(j)
    }

    fn rate_moves(&self, j: usize, motion: &dyn Motion) -> bool {
        if IS_PAGE {
            return true;
        }
        let model = self.model.affine_signs();
        model.read_by_rate(j).is_none_or(|states| {
            let mut rates = states.iter().map(|&i| motion.state(i).rate);
            rates.any(|rate| !rate.is_zero())
        })
    }

    fn enclose_rate(
        &self,
        j: usize,
        motion: &dyn Motion,
        setting: Setting<'_>,
    ) -> Option<Enclosure> {
        let model = self.model.affine_signs();
        self.with_values(setting.q, |p| {
            model.enclose_rate(j, motion, setting.signs, p)
        })
    }
}
