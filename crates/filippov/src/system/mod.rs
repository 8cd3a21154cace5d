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
mod capabilities;
mod clock;
mod closures;
mod compiled;
mod compiler;
mod container_sections;
mod definition;
mod differences;
mod enclosures;
mod jacobian;
mod jet_multipliers;
mod jets;
mod laws;
mod lie_derivatives;
mod linearisation;
mod linearisations;
mod map;
mod place;
mod readers;
mod reduction;
mod region_fields;
mod sign_structure;
mod taylor_series;
mod tiered;
mod traced;

pub(crate) use crate::vectors::{dot, dot_magnitude};
pub use action::{Act, Action, ActionMap, Actions, Trigger};
pub(crate) use activity::surfaces_that_matter;
pub use affine::{AffineParts, AffineSigns, SingularSliding};
pub use beside::{
    eval_off_surface, eval_on_side, eval_on_side_in, is_zero_within, move_inside, side_offsets,
};
pub use both_sides::BothSides;
pub use clock::Clock;
pub use closures::ClosureSystem;
pub(crate) use definition::{check_index, inconsistent};
pub use definition::{Definition, Rules};
use differences::central;
pub use enclosures::Enclosures;
pub use jacobian::MotionJacobian;
pub(crate) use jet_multipliers::{derivative_along, MultiplierEquations};
pub(crate) use jets::sliding_field;
pub use jets::MotionJets;
pub use laws::{Law, LawAction, LawMap, Laws, Step};
pub use lie_derivatives::{LieDerivatives, LieValue, RatePartials, Word};
pub use linearisation::Linearisation;
pub use linearisations::Linearisations;
pub use map::TracedMap;
pub(crate) use map::{sides_of, sides_where};
pub(crate) use place::OwnSetting;
pub use place::{Place, Setting};
pub use region_fields::RegionFields;
pub use sign_structure::SignStructure;
pub use taylor_series::TaylorSeries;
pub(crate) use tiered::Tiered;
pub use traced::TracedSystem;

use crate::error::FieldError;
use crate::error_scale::ErrorScale;

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
/// 4. All functions are pure: the same arguments give the same bits. They read the discrete states from the
///    [`Place`].
///
/// What is known of its signs is its [`SignStructure`]: asked too often for a detour. Everything else is a capability, which a
/// system may have: [`AffineSigns`], [`LieDerivatives`], [`TaylorSeries`], [`RegionFields`], [`Enclosures`], [`Linearisations`]. The methods of
/// `dyn PiecewiseSystem` ask for it, with an answer that is always right where it is absent.
pub trait PiecewiseSystem: SignStructure + Sync {
    /// Number of states.
    fn n_states(&self) -> usize;

    /// How many of them are states of the model; parameters that derivatives take as states are behind them.
    fn n_own_states(&self) -> usize {
        self.n_states()
    }

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

    /// h_j and its rate along the velocity `v`: the same as of [`surface_rates`](Self::surface_rates), by itself.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn surface_rate(
        &self,
        j: usize,
        place: &Place<'_>,
        v: &[f64],
    ) -> Result<(f64, f64), FieldError> {
        let mut h = vec![0.0; self.n_surfaces()];
        let mut rate = h.clone();
        self.surface_rates(place, v, &mut h, &mut rate)?;
        Ok((h[j], rate[j]))
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
            gradient[i] = central(x[i], |value| {
                moved[i] = value;
                at(t, &moved)
            })?;
            moved[i] = x[i];
        }
        central(t, |t| at(t, x))
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

    /// How far h_j may be off where each component of the state is off by its tolerance.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn tolerance(
        &self,
        j: usize,
        place: &Place<'_>,
        scale: &ErrorScale,
    ) -> Result<f64, FieldError> {
        let mut gradient = vec![0.0; place.x.len()];
        self.gradient(j, place, &mut gradient)?;
        Ok(scale.along(&gradient, place.x))
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

    /// The system as one whose field is affine in the signs of sets of surfaces, where the multipliers of
    /// sliding follow from a linear system; `None` if it cannot say.
    fn affine_signs(&self) -> Option<&dyn AffineSigns> {
        None
    }

    /// Its Lie derivatives; if there are none, they are found by differences.
    fn lie_derivatives(&self) -> Option<&dyn LieDerivatives> {
        None
    }

    /// Its Taylor series, if there are any.
    fn taylor_series(&self) -> Option<&dyn TaylorSeries> {
        None
    }

    /// Its fields of regions, where the signs alone make much of them.
    fn region_fields(&self) -> Option<&dyn RegionFields> {
        None
    }

    /// Its rigorous bounds; if there are none, zeros are found by sampling.
    fn enclosures(&self) -> Option<&dyn Enclosures> {
        None
    }

    /// The derivatives of its motions by states and multipliers; if there are none, they are found by differences.
    fn linearisations(&self) -> Option<&dyn Linearisations> {
        None
    }

    /// Do field or switching functions contain the time? Yes if nothing is known.
    fn depends_on_time(&self) -> bool {
        true
    }

    /// The reduced system of these surfaces: its motions stay on a surface that both fields cross at the same rate. The rate
    /// replaces the switching function of that surface. `None` if no surface is of this kind: a motion slides on them in
    /// this system itself.
    fn reduced(&self, _surfaces: &[usize]) -> Option<&dyn PiecewiseSystem> {
        None
    }

    /// A readable name of surface `j` for messages.
    fn surface_name(&self, j: usize) -> String {
        format!("h{j}")
    }
}
