//! What is known of the signs of a system, without a look at any point.

use super::Place;

/// How field and switching functions depend on the signs.
///
/// Duties of an implementer:
///
/// 1. Every answer holds at all points, for all discrete states.
/// 2. [`active`](Self::active), [`jumps_across`](Self::jumps_across) and [`switches_at`](Self::switches_at) may say `true` too
///    often, never `false` wrongly; [`is_affine`](Self::is_affine) may say `false` too often.
/// 3. If [`sticks_at`](Self::sticks_at) says `true`, [`stick_ratio`](Self::stick_ratio) and
///    [`both_sides`](super::PiecewiseSystem::both_sides) agree with it.
///
/// The methods as they are given are those of a system of which nothing is known: `impl SignStructure for MySystem {}`.
pub trait SignStructure {
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

    /// These surfaces (increasing) in groups such that the field is a sum of functions of the signs of one group
    /// each: signs of different groups are nowhere multiplied. `None` if that is not known.
    fn known_groups(&self, surfaces: &[usize]) -> Option<Vec<Vec<usize>>> {
        let _ = surfaces;
        None
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
    /// [-r, r] with the ratio r of [`stick_ratio`](Self::stick_ratio), and
    /// [`both_sides`](super::PiecewiseSystem::both_sides) has the fields at the signs -r and +r.
    fn sticks_at(&self, j: usize) -> bool {
        let _ = j;
        false
    }

    /// The ratio of static to kinetic friction at h_j = 0, at least 1.
    fn stick_ratio(&self, j: usize, place: &Place<'_>) -> f64 {
        let _ = (j, place);
        1.0
    }
}
