//! The integrator: steps, events and switches in the right order.

mod actions;
mod detection;
mod integrator;
mod limits;
mod motion;
mod resting;
mod solve;
mod start;
mod stats;
mod steps;
mod transition;
mod watch;

pub use detection::user_functions::UserZero;
pub use integrator::Integrator;
pub use solve::{solve, solve_interruptible, solve_to_section, solve_with_actions};
pub use stats::Stats;
