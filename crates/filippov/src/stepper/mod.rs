//! Steppers: advance one smooth field by one step, with an error estimate and a continuous extension.

mod coefficients_dopri5;
mod controller;
mod dense;
mod dopri5;
mod initial_step;

pub use controller::{Controller, ErrorScale};
pub use dense::Interpolant;
pub(crate) use dense::{evaluate, nested};
pub use dopri5::{Attempt, Dopri5};
pub use initial_step::{initial_step, restart_step, tiny_step};

#[cfg(test)]
mod tests;
