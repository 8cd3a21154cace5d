//! The integrator: steps, events and switches in the right order.

mod curve;
mod detect;
mod integrator;
mod motion;
mod start;
mod stats;
mod status;
mod transition;
mod user_events;

pub use integrator::{solve, solve_interruptible, Integrator};
pub use stats::Stats;
pub use status::{Stop, Warning, WarningCode};
pub use user_events::UserZero;
