//! Questions to any system: the answer of a capability, or what holds where it is absent.

use std::sync::Arc;

use filippov_expr::{Enclosure, Motion};

use super::lie_derivatives::{tolerance_of_differences, HIGHEST_DIFFERENCE};
use super::{
    closures, LieValue, Linearisation, MotionJacobian, MotionJets, PiecewiseSystem, Place,
    RatePartials, Setting, Word,
};
use crate::error::FieldError;

/// The structure of the signs ([`SignStructure`](super::SignStructure)).
impl dyn PiecewiseSystem + '_ {
    /// These surfaces (increasing) in groups such that signs of different groups are nowhere multiplied. One group of
    /// all is always right.
    pub fn sign_groups(&self, surfaces: &[usize]) -> Vec<Vec<usize>> {
        let known = self.known_groups(surfaces);
        known.unwrap_or_else(|| {
            let affine = self.affine_signs();
            match affine.and_then(|affine| affine.affine_parts(surfaces)) {
                Some(_) => surfaces.iter().map(|&j| vec![j]).collect(),
                None => vec![surfaces.to_vec()],
            }
        })
    }
}

/// Lie derivatives ([`LieDerivatives`](super::LieDerivatives)), else differences along the field.
impl dyn PiecewiseSystem + '_ {
    /// The Lie derivative L_{f^w_k} ... L_{f^w_1} h_i, where f^w is the field with entry `j` of the signs replaced by w.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn lie_derivative(
        &self,
        i: usize,
        j: usize,
        word: Word,
        place: &Place<'_>,
    ) -> Result<LieValue, FieldError> {
        match self.lie_derivatives() {
            Some(lie) => lie.lie_derivative(i, j, word, place),
            None => closures::lie_by_differences(self, i, j, word, place),
        }
    }

    /// Below this fraction of its magnitude a Lie derivative of this order counts as zero.
    pub fn lie_tolerance(&self, order: usize) -> f64 {
        match self.lie_derivatives() {
            Some(lie) => lie.lie_tolerance(order),
            None => tolerance_of_differences(order),
        }
    }

    /// Highest order of Lie derivative worth asking for.
    pub fn max_lie_order(&self) -> usize {
        self.lie_derivatives()
            .map_or(HIGHEST_DIFFERENCE, |lie| lie.max_lie_order())
    }

    /// Writes the gradient in x of the rate L_f h_j along the field with these signs.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn rate_gradient(
        &self,
        j: usize,
        place: &Place<'_>,
        gradient: &mut [f64],
    ) -> Result<RatePartials, FieldError> {
        match self.lie_derivatives() {
            Some(lie) => lie.rate_gradient(j, place, gradient),
            None => closures::rate_gradient_by_differences(self, j, place, gradient),
        }
    }
}

/// Taylor series ([`TaylorSeries`](super::TaylorSeries)).
impl dyn PiecewiseSystem + '_ {
    /// Do all fields and switching functions have Taylor series wherever they are finite?
    pub fn is_analytic(&self) -> bool {
        self.taylor_series()
            .is_some_and(|series| series.is_analytic())
    }

    /// Can fields or switching functions change although their Taylor coefficients show no change?
    pub fn hides_changes(&self) -> bool {
        self.taylor_series()
            .is_none_or(|series| series.hides_changes())
    }

    /// Taylor coefficients up to `order` of the motions on these surfaces; `None` if there are none.
    pub fn motion_jets(&self, sliding: &[usize], order: usize) -> Option<Arc<MotionJets>> {
        self.motion_jets_of(sliding, None, order)
    }

    /// The same with those of these curved switching functions, or of all.
    pub fn motion_jets_of(
        &self,
        sliding: &[usize],
        functions: Option<&[usize]>,
        order: usize,
    ) -> Option<Arc<MotionJets>> {
        self.taylor_series()?.motion_jets(sliding, functions, order)
    }

    /// Writes the coefficients at a place: (order + 1) rows. Not finite from the order on that does not exist.
    #[inline]
    pub fn eval_jets(&self, jets: &MotionJets, place: &Place<'_>, out: &mut [f64]) {
        match self.taylor_series() {
            Some(series) => series.eval_jets(jets, place, out),
            None => out.fill(f64::NAN),
        }
    }
}

/// Rigorous bounds ([`Enclosures`](super::Enclosures)).
impl dyn PiecewiseSystem + '_ {
    /// Bounds of h_j and of its rate along a piece of motion; `None` if there are none.
    pub fn enclose_surface(
        &self,
        j: usize,
        motion: &dyn Motion,
        setting: Setting<'_>,
    ) -> Option<Enclosure> {
        self.enclosures()?.enclose_surface(j, motion, setting)
    }

    /// The same of all switching functions, as far as there are any.
    pub fn enclose_surfaces(
        &self,
        motion: &dyn Motion,
        setting: Setting<'_>,
        bounds: &mut [Enclosure],
    ) {
        if let Some(enclosures) = self.enclosures() {
            enclosures.enclose_surfaces(motion, setting, bounds);
        }
    }

    /// Bounds of the normal components of f- and f+ at h_j, and of their rates, along a piece of motion on that surface.
    pub fn enclose_normal_components(
        &self,
        j: usize,
        motion: &dyn Motion,
        setting: Setting<'_>,
    ) -> Option<[Enclosure; 2]> {
        self.enclosures()?
            .enclose_normal_components(j, motion, setting)
    }
}

/// Derivatives of motions ([`Linearisations`](super::Linearisations)).
impl dyn PiecewiseSystem + '_ {
    /// The derivatives of the field of the motions on these surfaces; `None` if there are differences only.
    pub fn motion_jacobian(&self, sliding: &[usize]) -> Option<Arc<MotionJacobian>> {
        self.linearisations()?.motion_jacobian(sliding)
    }

    /// Writes these derivatives at a place; entries of its signs on the surfaces slid on are their multipliers.
    pub fn eval_jacobian(
        &self,
        jacobian: &MotionJacobian,
        place: &Place<'_>,
        out: &mut Linearisation,
    ) {
        match self.linearisations() {
            Some(known) => known.eval_jacobian(jacobian, place, out),
            None => out.fill(|values, _| values.fill(f64::NAN)),
        }
    }
}
