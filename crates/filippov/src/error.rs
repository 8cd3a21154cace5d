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
    /// A list has the wrong number of entries.
    #[error("{name}: {found} are given, {expected} are needed")]
    WrongCount {
        /// The argument.
        name: &'static str,
        /// How many there are.
        found: usize,
        /// How many are needed.
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
    /// A part of a system that does not exist is referred to.
    #[error("{what} {index} does not exist: the system has {count}")]
    NoSuchIndex {
        /// What is referred to.
        what: &'static str,
        /// Its index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// Parts of a system contradict each other.
    #[error("the system is inconsistent: {detail}")]
    Inconsistent {
        /// What is wrong.
        detail: &'static str,
    },
    /// The map of an action is a function of the caller, which bytes cannot hold.
    #[error("action {name:?}: its map is a function that could not be traced, and is not here")]
    MissingMap {
        /// The name of the action.
        name: String,
    },
    /// An expression graph, or a container, was refused.
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
