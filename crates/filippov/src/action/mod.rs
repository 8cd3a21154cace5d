//! Actions in an instant, and when they are due.

mod instant;
mod timetable;

pub(crate) use instant::{identity, Instant};
pub(crate) use timetable::Timetable;

pub use crate::system::{Action, ActionMap, Actions, Clock, Trigger};
