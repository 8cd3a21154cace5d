//! The integrator: steps, events and switches in the right order.

mod accumulation;
mod actions;
mod bounds;
mod choice;
mod contact;
mod curve;
mod detect;
mod impacts;
mod integrator;
mod irregular;
mod leave_by_rule;
mod meeting;
mod motion;
mod nested;
mod one_sided_steps;
mod pace;
mod placement;
mod relay;
mod sampling;
mod search;
mod series;
mod solve;
mod spiral;
mod start;
mod stats;
mod status;
mod stiff;
mod stiffness;
mod timetable;
mod transition;
mod user_events;

pub use integrator::Integrator;
pub use solve::{solve, solve_interruptible, solve_with_actions};
pub use stats::Stats;
pub use status::{Stop, Warning, WarningCode};
pub use user_events::UserZero;
