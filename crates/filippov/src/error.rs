//! The errors of the library: one variant per cause, with the offending quantity.

use std::any::Any;

/// Why a run could not be started.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A vector has the wrong length.
    #[error("{name} has length {found}, but the system has {expected} states")]
    WrongLength {
        /// The argument.
        name: &'static str,
        /// Its length.
        found: usize,
        /// The length needed.
        expected: usize,
    },
    /// An argument is outside of its range.
    #[error("{name} = {value}: {requirement}")]
    OutOfRange {
        /// The argument.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must fulfil.
        requirement: &'static str,
    },
    /// The expression graph was refused.
    #[error(transparent)]
    Expression(#[from] filippov_expr::ExprError),
}

/// A function of the user that could not be evaluated.
///
/// The payload is whatever the caller's language has for an exception; it is handed back in
/// [`crate::Stop::FieldRaised`] unchanged.
#[derive(Debug)]
pub struct FieldError(pub Box<dyn Any + Send>);

impl FieldError {
    /// Wraps the payload of an exception.
    pub fn new(payload: impl Any + Send) -> Self {
        FieldError(Box::new(payload))
    }
}
