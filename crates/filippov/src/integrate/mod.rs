//! The integrator: steps, events and switches in the right order.

mod checkpoint;
mod integrator;
mod problem;
mod progress;
mod solve;
mod stretches;
mod transition;
mod watch;

pub use integrator::Integrator;
pub use problem::Problem;
pub use progress::Reached;
pub use stretches::ReplayError;
