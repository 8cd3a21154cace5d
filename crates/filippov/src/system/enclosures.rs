//! Rigorous bounds along pieces of motion.

use filippov_expr::{Enclosure, Motion};

use super::Setting;

/// A system that bounds its functions along a piece of motion.
///
/// Duties of an implementer:
///
/// 1. A value that is taken on the piece lies within the bounds, rounding included, and so does its rate.
/// 2. `None` where a function has no bounds: its zeros are then found by sampling.
pub trait Enclosures {
    /// Bounds of h_j and of its rate.
    fn enclose_surface(
        &self,
        j: usize,
        motion: &dyn Motion,
        setting: Setting<'_>,
    ) -> Option<Enclosure>;

    /// The same of all switching functions; [`Enclosure::UNKNOWN`] of one that has none.
    fn enclose_surfaces(
        &self,
        motion: &dyn Motion,
        setting: Setting<'_>,
        bounds: &mut [Enclosure],
    ) {
        for (j, bounds) in bounds.iter_mut().enumerate() {
            let found = self.enclose_surface(j, motion, setting);
            *bounds = found.unwrap_or(Enclosure::UNKNOWN);
        }
    }

    /// Bounds of the normal components of f- and f+ at h_j, and of their rates, along a piece of motion on that surface.
    fn enclose_normal_components(
        &self,
        j: usize,
        motion: &dyn Motion,
        setting: Setting<'_>,
    ) -> Option<[Enclosure; 2]>;
}
