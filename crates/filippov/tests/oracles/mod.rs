//! Two surfaces: decision trees for everything that can happen at their intersection, as an independent check.
//!
//! The trees are Figures 4.3 to 4.9 of N. Guglielmi, E. Hairer (2022), derived anew from the hidden dynamics;
//! `docs/theory/intersections.md` states them and says why they hold. They prove what follows for every scaling of the
//! surfaces; the library lists attracting continuations and follows the hidden dynamics.
#![allow(dead_code, unused_imports, clippy::unwrap_used)]

mod entry;
mod exit_fold;
mod exit_side;
mod exit_stability;
mod frame;

pub use entry::enter;
pub use exit_fold::leave_at_fold;
pub use exit_side::leave_at_side;
pub use exit_stability::leave_where_unstable;
pub use frame::{Corners, Frame};

use filippov::switching::Continuation;

/// Where a tree leads.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaf {
    pub name: &'static str,
    /// What follows; `None` where two solutions are equally good.
    pub chosen: Option<Continuation>,
    /// All outcomes that occur for some scaling; the chosen one among them.
    pub candidates: Vec<Continuation>,
}

/// Why a tree does not apply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// The motion before does not arrive at this surface.
    NotArriving(usize),
    /// The normal components of both surfaces are proportional.
    Proportional,
    /// The data of an exit do not fit its kind.
    NotAnExit,
}

impl Leaf {
    /// The same for all scalings.
    fn sure(name: &'static str, chosen: Continuation) -> Self {
        Leaf::among(name, Some(chosen.clone()), vec![chosen])
    }

    /// One of several.
    fn among(
        name: &'static str,
        chosen: Option<Continuation>,
        candidates: Vec<Continuation>,
    ) -> Self {
        Leaf {
            name,
            chosen,
            candidates,
        }
    }

    pub fn is_unique(&self) -> bool {
        self.candidates.len() == 1
    }
}
