//! Events: the first zero of a monitored function within a step.
//!
//! A step is searched with a certificate, in two stages. The [`filter`] looks at end values and end
//! slopes (or stage values) and excludes a zero in most steps at the cost of a few operations.
//! Where it cannot, the continuous extension is [`isolate`]d: sampled, turned into Bernstein
//! coefficients and bisected until each piece has no zero, or exactly one. [`locate`] then finds
//! that one to rounding.

pub mod filter;
pub mod function;
pub mod isolate;
pub mod locate;

pub use function::{Deflation, EventFunction, Monitored, UserEvent, UserFunction};

#[cfg(test)]
mod tests;
