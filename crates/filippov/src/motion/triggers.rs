//! What the surfaces do that trigger actions.

use crate::mode::Mode;
use crate::system::{Action, Actions, PiecewiseSystem, Trigger};

/// The surfaces of a system, as far as they trigger actions.
#[derive(Clone, Copy)]
pub(crate) struct Triggers<'p> {
    pub system: &'p dyn PiecewiseSystem,
    pub actions: &'p Actions<'p>,
    /// The side of every surface on which the motion is, or was last: the side of a contact.
    pub sides: &'p [i8],
}

impl Triggers<'_> {
    /// The actions that the surface triggers.
    pub fn at(&self, j: usize) -> impl Iterator<Item = &Action<'_>> {
        let is_here = move |action: &&Action| matches!(action.trigger, Trigger::Surface { index, .. } if index == j);
        self.actions.list.iter().filter(is_here)
    }

    /// Does the surface trigger actions and switch nothing?
    pub fn is_only_trigger(&self, j: usize) -> bool {
        self.actions.at_surface(j).is_some() && !self.system.switches_at(j)
    }

    /// Does the surface trigger nothing but laws of the system, which move no state?
    pub fn is_internal(&self, j: usize) -> bool {
        let mut actions = self.at(j).peekable();
        actions.peek().is_some()
            && actions.all(|action| action.kind.is_none())
            && !self.system.switches_at(j)
    }

    /// Does the surface trigger changes of discrete states by laws of the system only?
    pub fn follows_law(&self, j: usize) -> bool {
        self.is_only_trigger(j) && self.at(j).all(|action| !action.map.moves_state())
    }

    /// The side from which the action at surface `j` is triggered, for a motion that was in this mode.
    pub fn side(&self, j: usize, memory: Option<&Mode>) -> i8 {
        let known = memory.map_or(0, |memory| memory.entries()[j]);
        let last = if known == 0 { self.sides[j] } else { known };
        self.actions.trigger_side(j, last)
    }
}
