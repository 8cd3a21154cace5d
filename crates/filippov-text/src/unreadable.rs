//! What cannot be read, and where.

use ruff_text_size::{Ranged, TextSize};

/// What a text has that is not read.
#[derive(Clone, Debug, PartialEq)]
pub struct Unreadable {
    /// What it is, and what to write instead if there is something.
    pub error: String,
    /// The line, from 1.
    pub line: usize,
    /// The column in characters, from 1.
    pub column: usize,
}

impl std::fmt::Display for Unreadable {
    fn fmt(&self, out: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Unreadable {
            error,
            line,
            column,
        } = self;
        write!(out, "line {line}, column {column}: {error}")
    }
}

impl std::error::Error for Unreadable {}

/// The same before lines are counted.
#[derive(Clone, Debug)]
pub struct Refused {
    pub error: String,
    pub at: TextSize,
}

/// A part of the text is refused.
pub fn refuse<T>(part: &impl Ranged, error: impl Into<String>) -> Result<T, Refused> {
    Err(Refused {
        error: error.into(),
        at: part.start(),
    })
}

impl Refused {
    /// With line and column in the text.
    pub fn placed(self, source: &str) -> Unreadable {
        let before = &source[..usize::from(self.at).min(source.len())];
        let line_start = before.rfind('\n').map_or(0, |end| end + 1);
        Unreadable {
            error: self.error,
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
        }
    }
}
