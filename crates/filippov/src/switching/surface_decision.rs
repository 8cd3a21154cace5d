//! What a decision at one surface is asked, and what it returns.

use smallvec::SmallVec;

use crate::motion::{Leading, TwoFoldMotion};
use crate::tolerances::TANGENT;

/// How the motion came to the surface, and which normal components are known to vanish.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// From the region with this sign (+1 or -1).
    Region(i8),
    /// From the region with this sign to a multiple zero of h: so many derivatives are known to vanish along f- and f+.
    Flat(i8, [usize; 2]),
    /// Sliding, with the normal component of f- known to vanish.
    ExitMinus,
    /// Sliding, with the normal component of f+ known to vanish.
    ExitPlus,
    /// Sliding, with both normal components known to vanish.
    TwoFold,
    /// The run starts here.
    Start,
}

impl Arrival {
    /// The arrival of a motion whose mode had this entry.
    pub fn from_side(entry: i8) -> Self {
        match entry {
            0 => Arrival::Start,
            side => Arrival::Region(side),
        }
    }

    /// The same, from a region, where the normal components of these fields are known to vanish.
    #[must_use]
    pub fn to_tangency(self, vanishing: [bool; 2]) -> Self {
        let (side, known) = match self {
            Arrival::Region(side) => (side, [0, 0]),
            Arrival::Flat(side, known) => (side, known),
            _ => return self,
        };
        Arrival::Flat(
            side,
            [0, 1].map(|i| known[i].max(usize::from(vanishing[i]))),
        )
    }
}

/// The decision at one surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// The new entry of the mode: -1, 0 (sliding) or +1.
    pub entry: i8,
    /// All entries that are Filippov continuations; more than one where the point is not unique.
    pub candidates: SmallVec<[i8; 3]>,
    /// The sliding motion from here, if this is a two-fold: one that attracts, if there is one.
    pub two_fold: Option<Box<TwoFoldMotion>>,
    /// First non-vanishing derivative of h along f-.
    pub minus: Leading,
    /// First non-vanishing derivative of h along f+.
    pub plus: Leading,
}

impl Decision {
    /// Of which of f- and f+ is the normal component no more than rounding of that of the other one?
    pub fn is_rounding(&self) -> [bool; 2] {
        let is_small = |own: Leading, other: Leading| {
            own.order == 1 && own.value.abs() <= TANGENT * other.value.abs()
        };
        [
            is_small(self.minus, self.plus),
            is_small(self.plus, self.minus),
        ]
    }

    /// The motion that sliding starts with at a two-fold, if it does.
    pub fn starts_at_two_fold(&self) -> Option<&TwoFoldMotion> {
        let starts = |motion: &&TwoFoldMotion| self.entry == 0 && motion.attracts();
        self.two_fold.as_deref().filter(starts)
    }

    /// Does neither side continue, nor sliding that attracts? Both fields turn back to the surface, at a two-fold that is
    /// invisible from both sides.
    pub fn has_no_continuation(&self) -> bool {
        let leading = match self.entry {
            -1 => self.minus,
            1 => self.plus,
            _ => return false,
        };
        leading.sign() == -self.entry
    }
}
