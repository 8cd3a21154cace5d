//! What a decision at an intersection returns.

use crate::mode::Mode;

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
    /// `only`, `exit`, or the kind of outcome of the hidden dynamics (`docs/theory/intersections.md` lists them).
    pub leaf: &'static str,
    /// What follows.
    pub chosen: Continuation,
    /// lambda of the surfaces that the chosen mode slides on, in their order.
    pub multipliers: Vec<f64>,
    /// Is there no other candidate?
    pub unique: bool,
    /// The chosen continuation, and all others that attract, except where the root that is left decides which of them
    /// follows. Of more than six surfaces only the chosen one is known.
    pub candidates: Vec<Continuation>,
    /// Does the hidden dynamics go around the root instead of coming to rest in it? The regularised
    /// motion then oscillates within the intersection, and the multipliers are those of the root.
    pub oscillates: bool,
    /// The smallest magnitude among the quantities whose signs decided, as a fraction of their size.
    pub margin: f64,
    /// Do the fields, perturbed by a little, lead to another mode?
    pub degenerate: bool,
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
