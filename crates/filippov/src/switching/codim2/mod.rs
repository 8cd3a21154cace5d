//! Two surfaces: decision trees for everything that can happen at their intersection.
//!
//! The trees are Figures 4.3 to 4.9 of N. Guglielmi, E. Hairer (2022), derived anew from the hidden
//! dynamics; `docs/theory/intersections.md` states them and says why they hold.

mod bilinear;
mod entry;
mod exit_fold;
mod exit_side;
mod exit_stability;
mod frame;
mod spiral;

pub use bilinear::{Bilinear, Root};
pub use entry::enter;
pub use exit_fold::leave_at_fold;
pub use exit_side::leave_at_side;
pub use exit_stability::leave_where_unstable;
pub use frame::{Corners, Frame};
pub use spiral::{extrapolated_jump, Jump, Lap};

#[cfg(test)]
mod tests;
