//! The smooth field of a mode: what a stepper integrates.

mod affine;
mod affine_bounds;
mod asleep;
mod by_mode;
mod by_rule;
mod canopy;
mod contact;
mod current;
mod duties;
mod far_ends;
mod guard;
mod held;
mod intersection;
mod known_modes;
mod leading;
mod meeting;
mod monitored;
mod project;
mod region;
mod rest;
mod run;
mod seen;
mod slack;
mod sliding;
mod ties;
mod triggers;
mod two_fold_motion;
pub mod weights;

pub use affine::AffineLaw;
pub use affine_bounds::{AffineBounds, EnclosedMultipliers, KnownMultipliers};
pub(crate) use asleep::Asleep;
pub(crate) use by_mode::{Law, ModeField, SlidingSet};
pub use by_rule::RuleLaw;
pub use canopy::Canopy;
pub use contact::ContactField;
pub(crate) use current::CurrentMotion;
pub(crate) use duties::Exits;
pub use duties::Motion;
pub use guard::{Guard, RootEnd};
pub use held::{as_multiplier, Held, Piece};
pub use intersection::IntersectionField;
pub(crate) use known_modes::{ActiveSurfaces, OwnJets};
pub(crate) use leading::first_nonzero_of_both;
pub use leading::{first_nonzero, normal_component, Leading};
pub use meeting::MeetingFields;
pub use monitored::{Deflation, Monitored};
pub(crate) use project::Level;
pub use project::{shares_of_rows, Projector};
pub use region::RegionField;
pub use rest::RestField;
pub(crate) use run::Run;
pub(crate) use seen::observer;
pub use seen::Seen;
pub(crate) use slack::Slacks;
pub use sliding::{NormalComponents, SlidingField};
pub use ties::Tie;
pub(crate) use ties::{are_parallel, beside_on, in_the_place_of, normal, parallel, sense_of};
pub(crate) use triggers::Triggers;
pub use two_fold_motion::{TwoFold, TwoFoldMotion};
pub(crate) use weights::product_weights;

use crate::error::FieldError;

/// One smooth field. A stepper sees nothing else of the system.
///
/// Duties of an implementer:
///
/// 1. `eval` may move `x` onto the manifold that the motion stays on, by an amount of the order
///    of the local error; it does so before it evaluates.
/// 2. A point where the field does not exist gives NaN, not an error.
/// 3. `n_evaluations` counts evaluations of the user's right-hand side.
pub trait SmoothField {
    /// Writes x' at (t, x), after moving x onto the manifold of the motion.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError>;

    /// As [`eval`](Self::eval), at the point as it is, beside the manifold too, as far as there is a field.
    ///
    /// # Errors
    /// If a function of the user raises.
    fn eval_unprojected(
        &mut self,
        t: f64,
        x: &mut [f64],
        dx: &mut [f64],
    ) -> Result<(), FieldError> {
        self.eval(t, x, dx)
    }

    /// Evaluations of the right-hand side so far.
    fn n_evaluations(&self) -> u64;
}
