//! The search of a step for the first event, and for zeros of the user's functions.

mod along_series;
mod bounds;
mod curve;
mod detector;
mod guard;
mod multiple_zero;
mod sought;
mod step;
mod user;

pub(crate) use detector::Detector;

use crate::error_scale::ErrorScale;
use crate::motion::{CurrentMotion, Guard};
use crate::options::SlidingRule;
use crate::stats::Stats;
use crate::stepper::Steppers;
use crate::system::PiecewiseSystem;

/// A step that was computed, and is searched before it is accepted.
pub(crate) struct StepSearch<'s, 'a> {
    pub system: &'a dyn PiecewiseSystem,
    pub scale: &'s ErrorScale,
    /// Where the step starts.
    pub t: f64,
    pub x: &'s [f64],
    pub motion: &'s mut CurrentMotion<'a>,
    /// The methods; that in use has the step with its continuous extension.
    pub stepper: &'s mut Steppers,
    pub detector: &'s mut Detector,
    pub stats: &'s mut Stats,
    /// What guards may go beyond zero.
    pub slacks: &'s [(Guard, f64)],
    /// How several surfaces are slid on.
    pub rule: SlidingRule,
    /// No event is looked for behind this time.
    pub horizon: f64,
    /// The field ends near to the end of the step: a surface a little beyond that is looked for too.
    pub one_sided: bool,
}
