//! What a run leaves at its section.

use crate::mode::Mode;
use crate::motion::Piece;

/// A return to the section.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Return {
    /// Its time.
    pub t: f64,
    /// The state there; where the state jumps, just before.
    pub y: Vec<f64>,
    /// The time since the return before, or since the start.
    pub duration: f64,
    /// The part of it that was spent sliding.
    pub sliding: f64,
    /// The modes of the pieces in between, in their order.
    pub modes: Vec<Mode>,
    /// The piece that leads there, if pieces are kept.
    pub piece: Option<Box<Piece>>,
}

/// What a run leaves at its section.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Returns {
    /// The returns that were kept: those after the transient, or one period if the run ended because of it.
    pub kept: Vec<Return>,
    /// How many there were, those not kept included.
    pub count: u64,
    /// After how many returns the motion repeats; 0 if that was not found.
    pub period: usize,
}
