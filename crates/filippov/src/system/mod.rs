//! Piecewise-smooth systems: what the integrator needs to know of them.
//!
//! A system is x' = f(t, x, s), where the entry `s_j` of the sign vector is the sign of the
//! switching function h_j(t, x). The signs are *data*: the caller says which smooth field it
//! wants, also slightly beyond a surface, and the field never looks at the sign of h itself. So are the discrete
//! states: nothing that a function reads is kept behind a reference to the system.

mod action;
mod activity;
mod affine;
mod affine_model;
mod beside;
mod blended;
mod both_sides;
mod clock;
mod closures;
mod compiled;
mod definition;
mod jacobian;
mod jet_multipliers;
mod jets;
mod laws;
mod linearisation;
mod map;
mod place;
mod sections;
mod tiered;
mod traced;

pub(crate) use crate::vectors::{dot, dot_magnitude};
pub use action::{Action, ActionMap, Actions, Trigger};
pub(crate) use activity::surfaces_that_matter;
pub use affine::{AffineParts, AffineSigns, SingularSliding};
pub use beside::{eval_off_surface, eval_on_side, move_inside, side_offsets};
pub use both_sides::BothSides;
pub use clock::Clock;
pub use closures::ClosureSystem;
pub(crate) use definition::{check_index, inconsistent};
pub use definition::{Definition, Rules};
pub use jacobian::MotionJacobian;
pub use jets::MotionJets;
pub use laws::{Law, LawAction, LawMap, Laws};
pub use linearisation::Linearisation;
pub use map::TracedMap;
pub(crate) use place::OwnSetting;
pub use place::{Place, Setting};
pub use traced::TracedSystem;

use std::sync::Arc;

use filippov_expr::{Enclosure, Motion};

use crate::error::FieldError;
use crate::tolerances::EPS;

/// The value of a Lie derivative and the sum of the magnitudes that make it up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LieValue {
    /// The derivative.
    pub value: f64,
    /// Sum of the absolute values of the terms; `value` counts as zero far below it.
    pub magnitude: f64,
}

/// The rate of a switching function along a field, with what it depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatePartials {
    /// L_f h.
    pub rate: f64,
    /// The size of its terms; `rate` counts as zero far below it.
    pub magnitude: f64,
    /// Its derivative in t.
    pub time: f64,
}

/// Which sides a step of differentiation takes: +1 for f+, -1 for f- of the surface concerned.
pub type Word<'a> = &'a [i8];

/// A piecewise-smooth system.
///
/// Duties of an implementer:
///
/// 1. [`field`](Self::field) depends on `signs` only through its entries -1.0 and +1.0, and is the
///    smooth extension of the field of that region slightly beyond its boundary. Where it has no
///    extension it returns NaN.
/// 2. [`surfaces`](Self::surfaces) writes h_j for every j; `signs` is for switching functions that
///    are themselves piecewise smooth (an `abs` inside of a `sign`).
/// 3. [`gradient`](Self::gradient) is the gradient of h_j in x, and returns the partial derivative in t.
/// 4. [`active`](Self::active) may say `true` too often, never `false` wrongly.
/// 5. All functions are pure: the same arguments give the same bits. They read the discrete states from the
///    [`Place`].
pub trait PiecewiseSystem: Sync {
    /// Number of states.
    fn n_states(&self) -> usize;

    /// Number of switching functions.
    fn n_surfaces(&self) -> usize;

    /// Writes f(t, x, s).
    ///
    /// # Errors
    /// If a function of the user raises.
    fn field(&self, place: &Place<'_>, dx: &mut [f64]) -> Result<(), FieldError>;

    /// Writes h_j(t, x), j = 0..n_surfaces.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn surfaces(&self, place: &Place<'_>, h: &mut [f64]) -> Result<(), FieldError>;

    /// Writes h_j and its rate along the velocity `v`, dh_j/dt = d_t h_j + grad h_j . v.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn surface_rates(
        &self,
        place: &Place<'_>,
        v: &[f64],
        h: &mut [f64],
        rate: &mut [f64],
    ) -> Result<(), FieldError> {
        self.surfaces(place, h)?;
        let mut gradient = vec![0.0; self.n_states()];
        for (j, rate) in rate.iter_mut().enumerate() {
            let ht = self.gradient(j, place, &mut gradient)?;
            *rate = ht + dot(&gradient, v);
        }
        Ok(())
    }

    /// Writes the gradient of h_j in x and returns its derivative in t; by central differences
    /// unless overridden.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn gradient(
        &self,
        j: usize,
        place: &Place<'_>,
        gradient: &mut [f64],
    ) -> Result<f64, FieldError> {
        let &Place { t, x, .. } = place;
        let mut h = vec![0.0; self.n_surfaces()];
        let mut at = |t: f64, x: &[f64]| -> Result<f64, FieldError> {
            self.surfaces(&place.moved(t, x), &mut h)?;
            Ok(h[j])
        };
        let mut moved = x.to_vec();
        for i in 0..x.len() {
            let d = EPS.cbrt() * (1.0 + x[i].abs());
            let (up, down) = (x[i] + d, x[i] - d);
            moved[i] = up;
            let above = at(t, &moved)?;
            moved[i] = down;
            let below = at(t, &moved)?;
            moved[i] = x[i];
            gradient[i] = (above - below) / (up - down);
        }
        let d = EPS.cbrt() * (1.0 + t.abs());
        let (up, down) = (t + d, t - d);
        Ok((at(up, x)? - at(down, x)?) / (up - down))
    }

    /// Writes the products of the gradient of h_j with vectors of n entries that stand one after the other, and
    /// returns its derivative in t.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn gradient_products(
        &self,
        j: usize,
        place: &Place<'_>,
        vectors: &[f64],
        products: &mut [f64],
    ) -> Result<f64, FieldError> {
        let n = place.x.len();
        let mut gradient = vec![0.0; n];
        let ht = self.gradient(j, place, &mut gradient)?;
        for (product, vector) in products.iter_mut().zip(vectors.chunks_exact(n)) {
            *product = dot(&gradient, vector);
        }
        Ok(ht)
    }

    /// The size of the terms that h_j is made of at a point, sum |d_i h_j x_i| + |d_t h_j t|, and where it is known
    /// that of the terms that cancel in it: h_j is zero up to rounding far below it.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn surface_size(&self, j: usize, place: &Place<'_>) -> Result<f64, FieldError> {
        let mut gradient = vec![0.0; place.x.len()];
        let ht = self.gradient(j, place, &mut gradient)?;
        Ok(dot_magnitude(&gradient, place.x) + (ht * place.t).abs())
    }

    /// Everything that sliding on h_j needs at a point of the surface: fields and normal components of
    /// both sides. `signs[j]` is ignored. Returns the number of evaluations of the right-hand side.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn both_sides(
        &self,
        j: usize,
        place: &Place<'_>,
        out: &mut BothSides,
    ) -> Result<u64, FieldError> {
        out.both_sides_by_parts(self, j, place)
    }

    /// Marks the surfaces whose sign matters for the motion with these signs (and with either
    /// sign of the surfaces slid on).
    fn active(&self, signs: &[f64], sliding: &[usize], active: &mut [bool]) {
        let _ = (signs, sliding);
        active.fill(true);
    }

    /// Do switching functions contain signs of others? Then they may jump where those change.
    fn has_nested_signs(&self) -> bool {
        false
    }

    /// Is h_j affine in (t, x)? Then the filter on end values and slopes decides more steps.
    fn is_affine(&self, j: usize) -> bool {
        let _ = j;
        false
    }

    /// Rigorous bounds of h_j and of its rate along a piece of motion; `None` if the system cannot say,
    /// and zeros are then found by sampling.
    fn enclose_surface(
        &self,
        j: usize,
        motion: &dyn Motion,
        setting: Setting<'_>,
    ) -> Option<Enclosure> {
        let _ = (j, motion, setting);
        None
    }

    /// Rigorous bounds of the normal components of f- and f+ at h_j, and of their rates, along a piece of
    /// motion on that surface; `None` if the system cannot say.
    fn enclose_normal_components(
        &self,
        j: usize,
        motion: &dyn Motion,
        setting: Setting<'_>,
    ) -> Option<[Enclosure; 2]> {
        let _ = (j, motion, setting);
        None
    }

    /// The Lie derivative L_{f^w_k} ... L_{f^w_1} h_i, where f^w is the field with entry `j` of the
    /// signs replaced by w; by differences along the field unless overridden.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn lie_derivative(
        &self,
        i: usize,
        j: usize,
        word: Word,
        place: &Place<'_>,
    ) -> Result<LieValue, FieldError> {
        closures::lie_by_differences(self, i, j, word, place)
    }

    /// The first Lie derivatives of h_j along f- and f+, where one evaluation gives both; `signs[j]` is ignored.
    fn first_lie_derivatives(&self, j: usize, place: &Place<'_>) -> Option<[LieValue; 2]> {
        let _ = (j, place);
        None
    }

    /// Below this fraction of its magnitude a Lie derivative of this order counts as zero.
    fn lie_tolerance(&self, order: usize) -> f64 {
        match order {
            0 | 1 => 1e-8,
            2 => 1e-4,
            _ => 1e-2,
        }
    }

    /// Highest order of Lie derivative worth asking for.
    fn max_lie_order(&self) -> usize {
        3
    }

    /// The system as one whose field is affine in the signs of sets of surfaces, where the multipliers of
    /// sliding follow from a linear system; `None` if it cannot say.
    fn affine_signs(&self) -> Option<&dyn AffineSigns> {
        None
    }

    /// Do all fields and switching functions have Taylor series wherever they are finite? Square roots and powers
    /// do not.
    fn is_analytic(&self) -> bool {
        false
    }

    /// May fields or switching functions change where no Taylor coefficient tells, as pulses exp(-t^2) do?
    fn hides_changes(&self) -> bool {
        true
    }

    /// Taylor coefficients up to `order` of the motions on these surfaces, in a region if there are none; `None`
    /// if the system has none.
    fn motion_jets(&self, sliding: &[usize], order: usize) -> Option<Arc<MotionJets>> {
        let _ = (sliding, order);
        None
    }

    /// Writes the coefficients at a point: (order + 1) rows. Not finite from the order on that does not exist.
    fn eval_jets(&self, jets: &MotionJets, place: &Place<'_>, out: &mut [f64]) {
        let _ = (jets, place);
        out.fill(f64::NAN);
    }

    /// The derivatives of the field of the motions on these surfaces, in a region if there are none; `None` if the
    /// system has them by differences only.
    fn motion_jacobian(&self, sliding: &[usize]) -> Option<Arc<MotionJacobian>> {
        let _ = sliding;
        None
    }

    /// Writes these derivatives at a point; entries of `signs` on the surfaces slid on are their multipliers.
    fn eval_jacobian(&self, jacobian: &MotionJacobian, place: &Place<'_>, out: &mut Linearisation) {
        let _ = (jacobian, place);
        out.fill(|values, _| values.fill(f64::NAN));
    }

    /// These surfaces (increasing) in groups such that the field is a sum of functions of the signs of one group
    /// each: signs of different groups are nowhere multiplied. One group of all is always right.
    fn sign_groups(&self, surfaces: &[usize]) -> Vec<Vec<usize>> {
        let affine = self.affine_signs();
        match affine.and_then(|affine| affine.affine_parts(surfaces)) {
            Some(_) => surfaces.iter().map(|&j| vec![j]).collect(),
            None => vec![surfaces.to_vec()],
        }
    }

    /// Does the field, or a switching function, depend on the sign of h_j? If not, h_j only triggers actions, and
    /// motion that stays on it is contact.
    fn switches_at(&self, j: usize) -> bool {
        let _ = j;
        true
    }

    /// May the field, or an active switching function, jump at h_j = 0 in the mode with these signs, sliding on these
    /// surfaces (increasing)? If not, the sign of h_j makes no difference where h_j is zero.
    fn jumps_across(&self, j: usize, signs: &[f64], sliding: &[usize]) -> bool {
        let _ = (j, signs, sliding);
        true
    }

    /// Is static friction above kinetic at h_j = 0? Then the motion sticks there while the sign that it needs lies in
    /// [-r, r] with the ratio r of [`stick_ratio`](Self::stick_ratio), and [`both_sides`](Self::both_sides) has the
    /// fields at the signs -r and +r.
    fn sticks_at(&self, j: usize) -> bool {
        let _ = j;
        false
    }

    /// The ratio of static to kinetic friction at h_j = 0, at least 1.
    fn stick_ratio(&self, j: usize, place: &Place<'_>) -> f64 {
        let _ = (j, place);
        1.0
    }

    /// Writes the gradient in x of the rate L_f h_j along the field with these signs; by central differences
    /// unless overridden.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn rate_gradient(
        &self,
        j: usize,
        place: &Place<'_>,
        gradient: &mut [f64],
    ) -> Result<RatePartials, FieldError> {
        closures::rate_gradient_by_differences(self, j, place, gradient)
    }

    /// A readable name of surface `j` for messages.
    fn surface_name(&self, j: usize) -> String {
        format!("h{j}")
    }
}
