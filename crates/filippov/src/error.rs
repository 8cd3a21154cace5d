//! The errors of the library: one variant per cause, with the offending quantity.

use std::any::Any;

use crate::tolerances::MOST_IN_LOOP;

/// Why a run could not be started.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
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
#[derive(Debug, thiserror::Error)]
#[error("a function of the system could not be evaluated")]
pub struct FieldError(pub Box<dyn Any + Send>);

impl FieldError {
    /// Wraps the payload of an exception.
    pub fn new(payload: impl Any + Send) -> Self {
        FieldError(Box::new(payload))
    }
}

/// Why there is no decision: one variant per cause.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Undecided {
    /// The caller has waited long enough.
    #[error("the decision was interrupted")]
    Interrupted,
    /// The number of values does not fit the number of surfaces.
    #[error("{found} normal components do not fit {m} surfaces: each group needs m * 2^(its surfaces), of which it may have 6")]
    Shape {
        /// The number of surfaces.
        m: usize,
        /// The number of values.
        found: usize,
    },
    /// The signs of too many surfaces multiply one another.
    #[error("the signs of {n} of the surfaces that meet multiply one another in the field; at most 6 may")]
    TooMany {
        /// How many.
        n: usize,
    },
    /// Too many redundant contacts share one load.
    #[error(
        "{n} contacts close loops with one another and share one load; at most {MOST_IN_LOOP} may do so: \
                 remove contacts, or replace the sign by a smooth function in some of them"
    )]
    TooRedundant {
        /// How many.
        n: usize,
    },
    /// The motion before is given for another number of surfaces, or a region by a mode with zeros.
    #[error("the motion before does not fit the {m} surfaces that meet")]
    IncomingShape {
        /// The number of surfaces.
        m: usize,
    },
    /// The scaling is not one positive number per surface.
    #[error("kappa must have {m} positive entries")]
    Scaling {
        /// The number of surfaces.
        m: usize,
    },
    /// A normal component is not finite.
    #[error("a normal component is not finite; look at the fields at this point")]
    NotFinite,
    /// No field has a component normal to a surface.
    #[error("all fields are tangent to surface {surface} of the intersection; first-order data do not decide")]
    Tangent {
        /// The surface, counted within the intersection.
        surface: usize,
    },
    /// The normal components of both surfaces are proportional.
    #[error("the normal components of both surfaces are proportional: are they the same surface?")]
    Proportional,
    /// The motion before does not arrive at the intersection.
    #[error("the motion before does not arrive at surface {surface} of the intersection")]
    NotArriving {
        /// The surface, counted within the intersection.
        surface: usize,
    },
    /// The data of an exit do not fit its kind.
    #[error("these normal components are not those of an exit of this kind")]
    NotAnExit,
    /// An exit from three and more surfaces needs the rate at which the normal components change.
    #[error("an exit from {m} surfaces needs the drift of the normal components")]
    NoDrift {
        /// The number of surfaces.
        m: usize,
    },
    /// The hidden dynamics rests at a point that does not attract.
    #[error("the hidden dynamics rests at a point that does not attract; perturb the state")]
    AtRest,
    /// The hidden dynamics stays within the intersection and goes around no root.
    #[error(
        "the hidden dynamics goes around in a cycle with no stable root: the regularised motion slides with a mean \
         that depends on how it is regularised; another kappa= may have a root"
    )]
    Cycle,
    /// In each mode a guard begins negative.
    #[error("no motion can follow")]
    NoneViable,
    /// The hidden dynamics came to no certain outcome.
    #[error(
        "the hidden dynamics came to no certain outcome; perturb the state or change the scaling"
    )]
    NoOutcome,
}

impl Undecided {
    /// The reason in words, with the surfaces of the intersection by their names.
    pub fn named(&self, name: impl Fn(usize) -> String) -> String {
        match *self {
            Undecided::Tangent { surface } => format!(
                "all fields are tangent to {} here; first-order data do not decide",
                name(surface)
            ),
            Undecided::NotArriving { surface } => {
                format!("the motion before does not arrive at {}", name(surface))
            }
            _ => self.to_string(),
        }
    }
}
