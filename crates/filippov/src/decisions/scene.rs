//! Where a question is asked: what is known of the run there.

use std::cell::RefCell;

use smallvec::SmallVec;

use super::point::{Arrival, Cause, Notes, Point};
use crate::motion::{Asleep, Run};
use crate::patience::Patience;
use crate::switch::Switch;

/// The place that a motion has come to, and what is known of the run there.
pub(crate) struct Scene<'s, 'a> {
    pub run: &'s mut Run<'a>,
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
        let run = self.run;
        let motion = &mut run.motion;
        let mut departing = SmallVec::new();
        motion.departing().for_each(|j| departing.push(j));
        let (asleep, everywhere) = (&motion.asleep, &mut None);
        let active = motion.known.active();
        let active = match asleep.has_any() {
            true if !asleep.contains_point(run.t, &run.x, &motion.discrete) => {
                &*everywhere.insert(active.beside(&Asleep::default()))
            }
            _ => active,
        };
        let arrival = Arrival {
            cause,
            mode: &motion.mode,
            signs: &motion.signs,
            sliding: &motion.sliding,
            sides: &motion.sides,
            active,
            resting: &motion.resting,
            departing,
            switches: self.switches,
            residuals: &run.residuals,
            passing: &run.passing,
            velocity: self.velocity,
            field: RefCell::new(&mut motion.field),
        };
        let at = Point {
            system: run.system,
            actions: run.actions,
            scale: &run.scale,
            t: run.t,
            x: &run.x,
            q: &motion.discrete,
            arrival: &arrival,
            policy: run.options.into(),
            known: &run.known,
            space: &run.space,
            patience: self.patience,
        };
        question(&at, notes)
    }
}
