//! Why a request has no answer.

use filippov::{Error, FieldError};

/// A request, or a model, that is refused.
#[derive(Clone, Debug, PartialEq)]
pub struct Refusal {
    /// A stable word for programs.
    pub code: &'static str,
    /// What is wrong, and what would be right.
    pub text: String,
}

impl Refusal {
    /// A request with a field that is missing or wrong.
    pub fn request(text: impl Into<String>) -> Self {
        Refusal {
            code: "request",
            text: text.into(),
        }
    }

    /// A model that cannot be read or run.
    pub fn model(text: impl Into<String>) -> Self {
        Refusal {
            code: "model",
            text: text.into(),
        }
    }
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, out: &mut std::fmt::Formatter) -> std::fmt::Result {
        out.write_str(&self.text)
    }
}

impl std::error::Error for Refusal {}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Refusal {
            code: "argument",
            text: error.to_string(),
        }
    }
}

impl From<FieldError> for Refusal {
    fn from(error: FieldError) -> Self {
        Refusal {
            code: "function",
            text: error.to_string(),
        }
    }
}
