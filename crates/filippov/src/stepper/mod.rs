//! Steppers: advance one smooth field by one step, with an error estimate and a continuous extension.
//!
//! [`Stepper`] is what is asked of a method, `Steppers` holds the methods of a run, and `StepControl` chooses the length of
//! the next step. A new Runge-Kutta pair is a file here, a line in the table of `chosen.rs` and a
//! name in `options.rs` (CONTRIBUTING has the list). What a method needs of a
//! run is in `Run`; no method knows of events or of the integrator.

mod chatter;
mod chosen;
mod coefficients_dop853;
mod coefficients_dopri5;
mod coefficients_rodas5p;
mod control;
mod controller;
mod dense;
mod dop853;
mod dopri5;
mod duties;
mod initial_step;
mod lanes;
mod midpoint;
mod pace;
mod rodas5p;
mod series_steps;
mod step;
mod steppers;
mod stiffness;
mod taylor;

pub use crate::error_scale::ErrorScale;
pub(crate) use control::{shortest_step, StepControl};
pub use controller::Controller;
pub(crate) use dense::{derivative, evaluate, powers_of_nested, shift};
pub use dense::{Basis, Expansion, Interpolant};
pub use dop853::Dop853;
pub use dopri5::Dopri5;
pub use duties::Attempt;
pub(crate) use duties::{ExitSeries, Stepper};
pub use initial_step::{initial_step, restart_step, tiny_step};
pub use midpoint::Midpoint;
pub use rodas5p::Rodas5p;
pub use step::Step;
pub(crate) use steppers::Steppers;
pub(crate) use stiffness::Stiff;
pub use taylor::Taylor;

#[cfg(test)]
mod tests;
