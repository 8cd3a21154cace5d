//! Actions: what changes the state, or a discrete state, in an instant.

pub use crate::system::{Action, ActionMap, Actions, Clock, Trigger};
