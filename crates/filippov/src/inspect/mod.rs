//! Inspection: the field of a mode at a point, what happens at a point, its hidden dynamics, and motions that are held in a mode.
//!
//! Nothing here is part of a run; the decisions are those of a run.

mod classify;
mod hidden_dynamics;
mod itinerary;
mod leg;
mod message;
mod mode_field;
mod not_finite;
mod off_surfaces;

pub use classify::{classify, contradicts, Classification, Inspection, PointKind};
pub use hidden_dynamics::{hidden_dynamics, HiddenDynamics, HiddenRoot};
pub use itinerary::{
    equations, Dip, Equations, GuardRates, ItineraryLeg, LegEnd, Passage, Unknowns,
};
pub use leg::{state_after, Leg, LegError};
pub use message::message_of;
pub use mode_field::{intersection_field, IntersectionValue};
pub use not_finite::{not_finite, state_text, NotFinitePlace};
pub use off_surfaces::{field_off_surfaces, surfaces_of_rounding, OffSurfaces};

#[cfg(test)]
mod tests;
