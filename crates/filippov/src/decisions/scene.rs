//! Where a question is asked: what is known of the run there.

use std::cell::RefCell;

use smallvec::SmallVec;

use super::point::{Arrival, Cause, Notes, Point, Policy};
use crate::error_scale::ErrorScale;
use crate::motion::{CurrentMotion, Deflation, Guard};
use crate::patience::Patience;
use crate::switch::Switch;
use crate::system::{Actions, PiecewiseSystem};

/// The place that a motion has come to, and what is known of the run there.
pub(crate) struct Scene<'s, 'a> {
    pub system: &'a dyn PiecewiseSystem,
    pub actions: &'a Actions<'a>,
    pub scale: &'s ErrorScale,
    pub policy: Policy<'a>,
    pub t: f64,
    pub x: &'s [f64],
    /// The motion that comes there.
    pub motion: &'s mut CurrentMotion<'a>,
    /// How far the point lies off each surface by rounding; empty: not at all.
    pub residuals: &'s [f64],
    /// Triggers whose action leaves the motion as it is: it crosses them.
    pub passing: &'s [usize],
    /// The velocity of the motion a little before.
    pub velocity: &'s [f64],
    /// The last switches of the run.
    pub switches: &'s [Switch],
    pub patience: Patience<'s>,
}

impl<'a> Scene<'_, 'a> {
    /// Asks a question.
    #[inline]
    pub fn ask<R>(
        self,
        cause: Cause,
        notes: &mut Notes,
        question: impl FnOnce(&Point<'_, '_, 'a>, &mut Notes) -> R,
    ) -> R {
        let mut departing = SmallVec::new();
        for monitored in &self.motion.monitored {
            if let (Guard::Surface(j), Some(Deflation { order: 2.., .. })) =
                (monitored.guard, monitored.deflation)
            {
                departing.push(j);
            }
        }
        let motion = self.motion;
        let arrival = Arrival {
            cause,
            mode: &motion.mode,
            signs: &motion.signs,
            sliding: &motion.sliding,
            sides: &motion.sides,
            active: &motion.active,
            resting: &motion.resting,
            departing,
            switches: self.switches,
            residuals: self.residuals,
            passing: self.passing,
            velocity: self.velocity,
            field: RefCell::new(&mut motion.field),
        };
        let at = Point {
            system: self.system,
            actions: self.actions,
            scale: self.scale,
            t: self.t,
            x: self.x,
            q: &motion.discrete,
            arrival: &arrival,
            policy: self.policy,
            patience: self.patience,
        };
        question(&at, notes)
    }
}
