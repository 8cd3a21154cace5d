//! A run at the place that it has reached.

use std::cell::RefCell;

use super::{Asleep, CurrentMotion, Seen};
use crate::cube::KnownUniqueness;
use crate::error_scale::ErrorScale;
use crate::mode::Mode;
use crate::options::Options;
use crate::stats::Stats;
use crate::system::{Actions, AffineParts, PiecewiseSystem};
use crate::tolerances::{SMALL_JUMP, STAGE_SPREAD};
use crate::vectors::largest;

/// A run: its problem, the place that it has reached, the motion from there, and what was counted.
///
/// Steps, searches, decisions and actions are handed a run.
#[derive(Clone)]
pub(crate) struct Run<'a> {
    pub system: &'a dyn PiecewiseSystem,
    pub options: &'a Options,
    pub actions: &'a Actions<'a>,
    /// The tolerances.
    pub scale: ErrorScale,
    pub t: f64,
    pub x: Vec<f64>,
    /// The largest magnitude of a state at its start.
    pub size: f64,
    pub motion: CurrentMotion<'a>,
    /// The exit functions of the motion in the step.
    pub seen: Vec<Seen>,
    /// How far the point of an event lies off the surfaces that vanish there, by rounding; else empty.
    pub residuals: Vec<f64>,
    /// Triggers whose action leaves the motion as it is: it goes through them.
    pub passing: Vec<usize>,
    /// What its decisions found out of the equations at meetings.
    pub known: RefCell<KnownUniqueness>,
    /// Space for the fields around a meeting.
    pub space: RefCell<AffineParts>,
    pub stats: Stats,
}

impl<'a> Run<'a> {
    /// A run at its start, where no mode is decided yet.
    pub fn new(
        system: &'a dyn PiecewiseSystem,
        options: &'a Options,
        actions: &'a Actions<'a>,
        (t, x): (f64, &[f64]),
    ) -> Self {
        let undecided = Mode::new(vec![1; system.n_surfaces()]);
        Run {
            system,
            options,
            actions,
            scale: ErrorScale::new(options.rtol, &options.atol, x.len()),
            t,
            x: x.to_vec(),
            size: largest(x),
            motion: CurrentMotion::new(
                system,
                t,
                undecided,
                options.into(),
                actions,
                Asleep::new(system, options),
            ),
            seen: Vec::new(),
            residuals: Vec::new(),
            passing: Vec::new(),
            known: RefCell::default(),
            space: RefCell::default(),
            stats: Stats::default(),
        }
    }

    /// How long the step after one of length `dt` may be. A body at rest in contact allows any, however the load on it varies:
    /// the exit functions may not change by more than [`STAGE_SPREAD`] of their size.
    pub fn longest_by_exits(&self, dt: f64) -> f64 {
        if !self.motion.is_in_contact() {
            return f64::INFINITY;
        }
        let change = |seen: &Seen| (seen.range[1] - seen.range[0]) / seen.size();
        let most = self.seen.iter().map(change).fold(0.0, f64::max);
        dt * STAGE_SPREAD / most
    }

    /// While sliding on one surface: is the difference of the normal components at an end of the step so small, compared with
    /// `speed`, that the multiplier may be lost? Far from it nothing else has to be looked at.
    pub fn may_lose_multiplier(&self, speed: f64) -> bool {
        let [minus, plus, ..] = self.seen.as_slice() else {
            return false;
        };
        let least = (minus.start + plus.start).min(minus.end + plus.end);
        least <= (SMALL_JUMP * self.options.rtol).min(1.0) * speed
    }

    /// While sliding on one surface: does the share of f+ change fast in the step just made, towards a two-fold?
    pub fn approaches_two_fold(&self) -> bool {
        let [minus, plus, ..] = self.seen.as_slice() else {
            return false;
        };
        minus.end + plus.end < 0.99 * (minus.start + plus.start)
    }
}
