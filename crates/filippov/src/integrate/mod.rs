//! The integrator: steps, events and switches in the right order.

mod integrator;
mod progress;
mod solve;
mod start;
mod transition;
mod watch;

pub use integrator::Integrator;
pub use solve::{solve, solve_interruptible, solve_to_section, solve_with_actions};
