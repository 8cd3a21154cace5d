//! Sections: where a run is looked at, its returns there, and when it stops.
//!
//! A run that is observed at a section keeps its returns and nothing else: its memory does not grow with its length.

mod cycle;
mod returns;
#[cfg(test)]
mod tests;
mod visits;

pub use cycle::Cycle;
pub use returns::{Return, Returns};
pub(crate) use visits::Visits;

use crate::event::UserFunction;
use crate::switch::Kind;
use crate::system::Clock;

/// Where a motion is looked at.
pub enum Place<'a> {
    /// The zeros of a function along the motion.
    Function {
        /// The function h_P.
        function: &'a dyn UserFunction,
        /// Only zeros where it rises (+1) or falls (-1); both if 0.
        direction: f64,
    },
    /// Switches at a surface.
    Surface {
        /// The surface j.
        index: usize,
        /// Arrivals from h < 0 (+1) or from h > 0 (-1) only; for a kind that starts on the surface, departures to
        /// h > 0 (+1) or to h < 0 (-1). All if 0.
        direction: i8,
        /// Switches of this kind only; else every arrival at the surface that is no touch.
        kind: Option<Kind>,
    },
    /// The ticks of a clock: the stroboscopic map. The motion does not stop there.
    Ticks(Clock),
}

/// A section, and what is kept of a run that is observed there.
pub struct Section<'a> {
    /// Where.
    pub place: Place<'a>,
    /// So many first returns are not kept.
    pub transient: u64,
    /// The run ends after so many returns that are kept.
    pub most: u64,
    /// When the returns count as periodic.
    pub cycle: Option<Cycle>,
    /// Is the piece of motion that leads to each return kept with it?
    pub keeps_pieces: bool,
}
