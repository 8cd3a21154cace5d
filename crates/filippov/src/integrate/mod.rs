//! The integrator: steps, events and switches in the right order.

mod actions;
mod decisions;
mod detection;
mod integrator;
mod motion;
mod solve;
mod start;
mod stats;
mod status;
mod steps;

pub use detection::user_events::UserZero;
pub use integrator::Integrator;
pub use solve::{solve, solve_interruptible, solve_to_section, solve_with_actions};
pub use stats::Stats;
pub use status::{Stop, Warning, WarningCode};
