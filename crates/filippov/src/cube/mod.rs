//! Multilinear functions on the cube [-1, 1]^m: the equations of sliding on m surfaces.
//!
//! Their values at the vertices are the normal components of the fields around an intersection; here are their roots, where
//! roots meet, their stability and bounds, with the small matrices that this takes. No system, no motion and no
//! decision may enter.

mod bilinear;
mod enclosed_root;
mod fold;
mod lap;
mod normal_fields;
mod p_matrix;
mod redundant;
mod relay;
mod roots;
mod shared_load;
mod small_matrix;
mod stability;

pub use bilinear::{Bilinear, Root};
pub use enclosed_root::{enclose_root, EnclosedRoot, IntervalVector, RootBounds};
pub use fold::{merged_root, MergedRoot};
pub use lap::Lap;
pub use normal_fields::{NormalFields, SignGroup};
pub use p_matrix::is_p_matrix;
pub(crate) use p_matrix::symmetrising_scale;
pub use redundant::{Limit, Solutions};
pub use relay::{solve_relay, solve_relay_within, RelayError, RelayProblem, RelaySolution};
pub use roots::{
    is_undetermined, least_multipliers, multiplier_rates, newton, roots_in_cube, stable_roots,
    stable_roots_with_border, stable_roots_within, zero_between, Roots,
};
pub use shared_load::{
    stay_together, KnownUniqueness, PartsTaken, SharedLoad, SharedLoads, Uniqueness,
};
pub(crate) use small_matrix::{invert, Elimination};
pub use small_matrix::{Matrix, Vector};
pub use stability::{
    has_one_mode_only, is_scaling_stable, is_stable, is_stable_for, scaling_margin,
    stability_margins, uncoupled_margins,
};

#[cfg(test)]
pub(crate) use p_matrix::tests::smallest_minor;
