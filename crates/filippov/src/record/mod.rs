//! What is kept of a run: steps, segments, switches, decisions, returns to a section.

mod columns;
mod decision_record;
mod end_only;
mod kinks;
mod observer;
mod recorder;
pub mod section;
mod segment;
mod solution;
mod user_zeros;

pub use columns::{Columns, Rows, SegmentColumns, Segments, SwitchColumns, Switches};
pub(crate) use decision_record::decide_and_record;
pub use decision_record::{
    replay_decision, DecisionCause, DecisionOutcome, DecisionPoint, DecisionRecord, StartingZero,
};
pub use end_only::EndOnly;
pub use observer::{Gradient, InstantRecord, ObservedStep, Observer};
pub(crate) use observer::{KeptInstant, Observed};
pub(crate) use recorder::Recorder;
pub use segment::Segment;
pub(crate) use solution::Step;
pub use solution::{Side, Solution};
