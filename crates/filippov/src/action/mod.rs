//! Actions in an instant, and when they are due.

mod instant;
mod quiet;
mod timetable;

pub(crate) use instant::{identity, Instant};
pub(crate) use quiet::quiet_change;
pub(crate) use timetable::Timetable;

pub use crate::system::{Act, Action, ActionMap, Actions, Clock, Trigger};
