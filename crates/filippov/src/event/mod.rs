//! Events: the first zero of a monitored function within a step.
//!
//! A step is searched with a certificate, in two stages. The first excludes a zero in most steps at
//! the cost of a few operations: for affine functions the [`filter`] on end values and end slopes, for
//! all others bounds of the function and of its rate over the step (its [`tube`], the
//! [`certificate`]). Where it cannot, the continuous extension is [`isolate`]d: sampled and bisected
//! until each piece provably has no zero, or exactly one. `locate` then finds that one to rounding.

mod bernstein;
pub mod certificate;
pub mod filter;
pub mod function;
pub mod isolate;
pub mod proved;
pub(crate) mod search;
pub mod series;
pub mod tube;
mod user_events;

pub use function::{AffinePart, Event, Found, Multiple, SmoothParts, UserEvent, UserFunction};
pub use user_events::UserZero;
pub(crate) use user_events::{AtEnd, StepEnd, UserEvents, TICK};

#[cfg(test)]
mod tests;
