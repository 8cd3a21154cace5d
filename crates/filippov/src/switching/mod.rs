//! Switching: what follows when the motion reaches a surface.
//!
//! Decisions are pure functions of the system, the point, the previous mode and the set of
//! functions that vanish there; they return data. First-order data decide; where they vanish, the
//! first Lie derivative that does not.

mod after_exit;
mod hidden;
mod incoming;
mod one_surface;
mod resolution;
mod resolve;
mod stick;
mod surface_decision;

pub use crate::cube::{
    enclose_root, has_one_mode_only, is_p_matrix, is_scaling_stable, is_stable, is_stable_for,
    is_undetermined, least_multipliers, merged_root, multiplier_rates, newton, roots_in_cube,
    scaling_margin, solve_relay, solve_relay_within, stability_margins, stable_roots,
    stable_roots_with_border, stable_roots_within, Bilinear, EnclosedRoot, IntervalVector,
    KnownUniqueness, Lap, Matrix, MergedRoot, NormalFields, RelayError, RelayProblem,
    RelaySolution, Root, RootBounds, Roots, SharedLoad, SharedLoads, SignGroup, Uniqueness, Vector,
};
pub use crate::error::Undecided;
pub use crate::motion::{first_nonzero, normal_component, Leading, TwoFold, TwoFoldMotion};
pub use crate::patience::Patience;
pub use hidden::{
    admissible, admissible_within, limit as limit_of_hidden_dynamics, Admissible,
    Outcome as HiddenOutcome,
};
pub use incoming::{ExitKind, Incoming};
pub use one_surface::decide;
pub use resolution::{Continuation, Resolution};
pub use resolve::{resolve, resolve_within};
pub use surface_decision::{Arrival, Decision};
