//! What can go wrong: compiling a program and reading a serialised graph.

/// Error of this crate, one variant per cause.
///
/// Building expressions cannot fail (a domain error such as `log(-1)` is a NaN value, as in floating
/// point), so there are few.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExprError {
    /// Native code was asked for, and this build or platform cannot provide it.
    #[error("native code is not available: {reason}; use the interpreter (Backend::Auto falls back to it)")]
    NativeUnavailable {
        /// What the code generator or the self-test reported.
        reason: String,
    },
    /// An output refers to a node that the graph does not have.
    #[error("node {id} does not exist: the graph has {len} nodes")]
    UnknownNode {
        /// The number of the node asked for.
        id: u32,
        /// How many nodes the graph has.
        len: usize,
    },
    /// The index of a state, sign, parameter or input is beyond what a program can address.
    #[error("index {index} of a variable is too large: at most {limit} is possible")]
    IndexTooLarge {
        /// The index found.
        index: u32,
        /// The largest index that is possible.
        limit: u32,
    },
    /// The bytes do not start like a serialised graph of a known version.
    #[error("not a serialised expression graph, or one of another version")]
    UnknownFormat,
    /// The bytes end too early, go on too long, or contain something impossible.
    #[error("damaged expression graph at byte {offset}: {detail}")]
    Damaged {
        /// Where reading stopped.
        offset: usize,
        /// What is wrong there.
        detail: &'static str,
    },
}
