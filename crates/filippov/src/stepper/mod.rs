//! Steppers: advance one smooth field by one step, with an error estimate and a continuous extension.

mod coefficients_dop853;
mod coefficients_dopri5;
mod coefficients_rodas5p;
mod controller;
mod dense;
mod dop853;
mod dopri5;
mod initial_step;
mod method;
mod midpoint;
mod rodas5p;
mod step;
mod taylor;

pub use crate::error_scale::ErrorScale;
pub use controller::Controller;
pub(crate) use dense::{evaluate, powers_of_nested, shift};
pub use dense::{Basis, Expansion, Interpolant};
pub use dop853::Dop853;
pub use dopri5::{Attempt, Dopri5};
pub use initial_step::{initial_step, restart_step, tiny_step};
pub(crate) use method::Derivatives;
pub use method::{StepMethod, Stepper};
pub use midpoint::Midpoint;
pub use rodas5p::Rodas5p;
pub use step::Step;
pub(crate) use taylor::reach;
pub use taylor::Taylor;

#[cfg(test)]
mod tests;
