//! Rules where surfaces vanish: how they are named, and what they are asked.

use std::cell::OnceCell;

use super::point::{Decided, Notes, Point};
use super::surroundings::Surroundings;
use crate::error::FieldError;
use crate::error::Undecided;
use crate::mode::Mode;
use crate::switching::Arrival as SurfaceArrival;

/// The rule that made a decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    /// No surface that matters vanishes.
    Region,
    /// The motion touches a surface.
    Touch,
    /// The viable modes, where switching functions jump, or surfaces touch or are in one place.
    Entangled,
    /// The first derivatives that do not vanish on both sides of one surface.
    OneSurface,
    /// Switches accumulate, and the motion stays on all surfaces.
    Limit,
    /// The first derivatives of all guards that do not vanish, where first-order data are doubtful.
    Germs,
    /// The rule of sliding that the caller chose ends.
    SlidingLaw,
    /// The relay problem of a field that is affine in the signs.
    Relay,
    /// Many surfaces meet in groups that do not act on one another. The rules decide each group alone.
    Groups,
    /// First-order data at an intersection: the attracting continuation, among several the limit of the hidden dynamics, and
    /// spirals. Germs decide where those do not.
    FirstOrder,
    /// Bodies in contact: the forces that push.
    Contact,
    /// Triggers of actions are crossed together with other surfaces.
    Triggers,
}

impl Rule {
    /// A stable name.
    pub fn name(self) -> &'static str {
        match self {
            Rule::Region => "region",
            Rule::Touch => "touch",
            Rule::Entangled => "entangled",
            Rule::OneSurface => "one_surface",
            Rule::Limit => "limit",
            Rule::Germs => "germs",
            Rule::SlidingLaw => "sliding_rule",
            Rule::Relay => "relay",
            Rule::Groups => "groups",
            Rule::FirstOrder => "first_order",
            Rule::Contact => "contact",
            Rule::Triggers => "triggers",
        }
    }
}

/// The result of a decision; [`Notes`] have what was found out beside it.
pub(crate) struct Decision {
    pub rule: Rule,
    pub decided: Decided,
}

impl Decision {
    pub fn by(rule: Rule, decided: Decided) -> Self {
        Decision { rule, decided }
    }
}

/// What a rule is asked about: surfaces that vanish together.
pub(crate) struct Meeting<'m> {
    /// The mode before, or at a start the sides of the point.
    pub mode: &'m Mode,
    /// All surfaces that vanish, in increasing order.
    pub surfaces: &'m [usize],
    /// Those among them that were reached now.
    pub fresh: &'m [usize],
    pub how: How,
    /// The fields around them, once they were asked for.
    surroundings: OnceCell<Result<Surroundings, Undecided>>,
}

/// How the motion comes to the surfaces of a meeting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum How {
    /// The motion starts there, or on one surface as it says.
    Start(SurfaceArrival),
    /// It arrives; in this way, if one surface alone decides.
    Event(Option<SurfaceArrival>),
    /// Infinitely many switches end there.
    Limit,
}

impl<'m> Meeting<'m> {
    pub fn new(mode: &'m Mode, surfaces: &'m [usize], fresh: &'m [usize], how: How) -> Self {
        Meeting {
            mode,
            surfaces,
            fresh,
            how,
            surroundings: OnceCell::new(),
        }
    }

    /// The same meeting with further surfaces.
    pub fn with_surfaces<'w>(&'w self, surfaces: &'w [usize]) -> Meeting<'w> {
        Meeting::new(self.mode, surfaces, self.fresh, self.how)
    }

    /// The fields around the surfaces, or why there are none.
    pub fn surroundings(
        &self,
        at: &Point,
        notes: &mut Notes,
    ) -> Result<Result<&Surroundings, Undecided>, FieldError> {
        let known = match self.surroundings.get() {
            Some(known) => known,
            None => {
                let found = Surroundings::of(at, notes, self.surfaces, self.mode)?;
                self.surroundings.get_or_init(|| found)
            }
        };
        Ok(known.as_ref().map_err(Undecided::clone))
    }

    /// The full mode with these entries on the surfaces.
    pub fn on_all(&self, entries: &Mode) -> Mode {
        let mut full = self.mode.clone();
        for (&j, &entry) in self.surfaces.iter().zip(entries.entries()) {
            full.set(j, entry);
        }
        full
    }

    /// Does sliding on all surfaces end here, and none is reached?
    pub fn is_exit(&self) -> bool {
        matches!(self.how, How::Event(_)) && self.fresh.is_empty()
    }
}
