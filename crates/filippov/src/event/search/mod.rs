//! The search of a step for the first event, and for zeros of the user's functions.

mod along_series;
mod bounds;
mod curve;
mod detector;
mod multiple_zero;
mod one_guard;
mod sought;
mod step;
mod user;
mod user_piece;

pub(crate) use detector::Detector;

use crate::motion::{Run, Slacks};
use crate::stepper::Steppers;

/// A step that was computed, and is searched before it is accepted.
pub(crate) struct StepSearch<'s, 'a> {
    /// The run at the start of the step.
    pub run: &'s mut Run<'a>,
    /// The methods; that in use has the step with its continuous extension.
    pub stepper: &'s mut Steppers,
    pub detector: &'s mut Detector,
    /// What guards may go beyond zero.
    pub slacks: &'s Slacks,
    /// No event is looked for behind this time.
    pub horizon: f64,
    /// The field ends near to the end of the step: a surface a little beyond that is looked for too.
    pub one_sided: bool,
}
