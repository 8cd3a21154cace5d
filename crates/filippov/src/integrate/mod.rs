//! The integrator: steps, events and switches in the right order.

mod actions;
mod integrator;
mod limits;
mod progress;
mod resting;
mod solve;
mod start;
mod transition;
mod user_zeros;
mod watch;

pub use integrator::Integrator;
pub use solve::{solve, solve_interruptible, solve_to_section, solve_with_actions};
