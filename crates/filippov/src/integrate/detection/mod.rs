//! The event stage of a step: the first zero of what is monitored.

pub(super) mod along_series;
pub(super) mod bounds;
pub(super) mod curve;
pub(super) mod detect;
pub(super) mod detector;
pub(super) mod multiple_zero;
pub(super) mod search;
pub(super) mod user_events;
pub(super) mod user_functions;
