//! What can go wrong: compiling a program and reading a container.

use crate::container::{Tag, VERSION};

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
    /// The bytes do not begin like a container.
    #[error("not a file of filippov: it begins with other bytes")]
    UnknownFormat,
    /// A container of another version of the format.
    #[error("written in version {found} of the format, this is version {VERSION}: save it again with this release")]
    OtherVersion {
        /// The version found.
        found: u32,
    },
    /// A container that holds something else.
    #[error("holds {found}, {expected} is needed")]
    OtherContent {
        /// The content found.
        found: Tag,
        /// The content asked for.
        expected: Tag,
    },
    /// A container that was cut short, or continued.
    #[error(
        "incomplete, or with something behind its end: {found} bytes{}",
        of_declared(declared)
    )]
    WrongLength {
        /// How many bytes there are.
        found: usize,
        /// How many there should be, if that could be read.
        declared: Option<u64>,
    },
    /// The bytes are not those that were written.
    #[error("damaged: the checksum is wrong")]
    WrongChecksum,
    /// A section ends too early, goes on too long, or contains something impossible.
    #[error("damaged in section {section}, byte {offset}: {detail}")]
    Damaged {
        /// The section.
        section: Tag,
        /// The place in the container where reading stopped.
        offset: usize,
        /// What is wrong there.
        detail: &'static str,
    },
}

fn of_declared(declared: &Option<u64>) -> String {
    declared.map_or_else(String::new, |declared| format!(" of {declared}"))
}
