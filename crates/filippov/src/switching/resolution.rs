//! What a decision at an intersection returns.

use crate::mode::Mode;
use crate::tolerances::MOST_IN_LOOP;

/// How the motion goes on.
#[derive(Clone, Debug, PartialEq)]
pub enum Continuation {
    /// In this mode; one entry per surface of the intersection, in their order.
    Mode(Mode),
    /// It winds around the intersection of two surfaces, further out with each lap, without any mode
    /// of its own near to it ([`super::Lap`]).
    OutwardSpiral,
}

impl Continuation {
    /// The continuation in the mode with these entries.
    pub fn mode(entries: &[i8]) -> Self {
        Continuation::Mode(Mode::new(entries.to_vec()))
    }

    /// The mode, unless the motion spirals.
    pub fn as_mode(&self) -> Option<&Mode> {
        match self {
            Continuation::Mode(mode) => Some(mode),
            Continuation::OutwardSpiral => None,
        }
    }
}

/// The decision at an intersection: the common currency of all rules for two and more surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolution {
    /// `only`, or the kind of outcome of the hidden dynamics (`docs/theory/intersections.md` lists them).
    pub leaf: &'static str,
    /// What follows.
    pub chosen: Continuation,
    /// lambda of the surfaces that the chosen mode slides on, in their order.
    pub multipliers: Vec<f64>,
    /// Is there no other candidate?
    pub unique: bool,
    /// The chosen continuation, and all others that are possible: of one and two surfaces those that attract, except
    /// where the root that is left decides which of them follows; of more those that a trial of scalings finds.
    pub candidates: Vec<Continuation>,
    /// Does the hidden dynamics go around the root instead of coming to rest in it? The regularised
    /// motion then oscillates within the intersection, and the multipliers are those of the root.
    pub oscillates: bool,
    /// The smallest magnitude among the quantities whose signs decided, as a fraction of their size.
    pub margin: f64,
    /// Do the fields, perturbed by a little, lead to another mode?
    pub degenerate: bool,
    /// How many motions of the hidden dynamics the decision followed: nearly all of its work. Motions for perturbed
    /// fields that led to an error are not among them.
    pub n_motions: usize,
}

impl Resolution {
    /// A decision with one candidate.
    pub(super) fn sure(leaf: &'static str, chosen: Continuation) -> Self {
        Resolution {
            leaf,
            candidates: vec![chosen.clone()],
            chosen,
            multipliers: Vec::new(),
            unique: true,
            oscillates: false,
            margin: f64::INFINITY,
            degenerate: false,
            n_motions: 0,
        }
    }

    /// The chosen mode, unless the motion spirals.
    pub fn mode(&self) -> Option<&Mode> {
        self.chosen.as_mode()
    }

    /// Adds the candidates of another decision, each once.
    pub(super) fn add_candidates(&mut self, others: &[Continuation]) {
        for other in others {
            if !self.candidates.contains(other) {
                self.candidates.push(other.clone());
            }
        }
    }
}

/// Why there is no decision: one variant per cause.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
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
        "{n} contacts close loops with one another and share one load; at most {MOST_IN_LOOP} may"
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

    /// The reason for a part of an intersection, with its surfaces counted within the whole.
    pub(super) fn in_whole(self, part: &[usize]) -> Self {
        let place = |surface: usize| part.get(surface).copied().unwrap_or(surface);
        match self {
            Undecided::Tangent { surface } => Undecided::Tangent {
                surface: place(surface),
            },
            Undecided::NotArriving { surface } => Undecided::NotArriving {
                surface: place(surface),
            },
            other => other,
        }
    }
}
