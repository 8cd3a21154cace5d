//! What ends a motion.

use smallvec::SmallVec;

/// A function that is positive while a motion lasts. The numbers are those of surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guard {
    /// The switching function h_j, in the sense of the mode.
    Surface(usize),
    /// The multiplier of a surface slid on stays before an end, -1 or +1: 1 + lambda or 1 - lambda. On one surface alone it is
    /// the normal component of f-, or minus that of f+, which vanishes there. For a rule other than the canopy: no motion on
    /// that side of the surface begins to leave the intersection.
    Multiplier {
        /// The surface slid on.
        surface: usize,
        /// The end, -1 or +1.
        end: i8,
    },
    /// The force of the contact at a surface pushes.
    Force(usize),
    /// The multipliers of several surfaces go on as one root.
    Root(RootEnd),
}

/// What ends the root of the multipliers of m >= 2 surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RootEnd {
    /// Two roots meet: (-1)^m det G, for two surfaces the discriminant. For a rule other than the canopy: a
    /// premise of the rule fails.
    Fold,
    /// No scaling of the surfaces makes the root stable any longer: -min(G11, G22). For more than two surfaces, it is
    /// not stable for the given scaling: the last Hurwitz determinant. For a rule other than the canopy: the fields begin to
    /// wind outwards.
    Stability,
}

/// The guards of a motion beside the surfaces that it does not slide on.
pub(crate) type Guards = SmallVec<[Guard; 6]>;

impl Guard {
    /// Both ends of the multiplier of a surface.
    pub fn ends(surface: usize) -> [Guard; 2] {
        [-1, 1].map(|end| Guard::Multiplier { surface, end })
    }

    /// The surface that the motion stays on while this guard is positive.
    pub fn surface_held(self) -> Option<usize> {
        match self {
            Guard::Multiplier { surface, .. } | Guard::Force(surface) => Some(surface),
            Guard::Surface(_) | Guard::Root(_) => None,
        }
    }

    /// The surface that it belongs to, if there is one.
    pub fn surface(self) -> Option<usize> {
        match self {
            Guard::Surface(surface) => Some(surface),
            other => other.surface_held(),
        }
    }

    /// Is it a switching function?
    pub fn is_surface(self) -> bool {
        matches!(self, Guard::Surface(_))
    }
}
