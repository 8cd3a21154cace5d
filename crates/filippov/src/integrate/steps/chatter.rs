//! Motion that chatters along a jump of the field for which no surface is declared.

use crate::integrate::integrator::Integrator;
use crate::status::Stop;
use crate::tolerances::{CHATTER_STEPS, JUMP_SHRINK};

/// Short steps since a jump of the field that no surface declares.
pub(in crate::integrate) struct Chatter {
    /// The step before the jump.
    pace: f64,
    since: f64,
    n_steps: u32,
    n_jumps: u32,
}

impl Integrator<'_> {
    /// A jump was noticed; the step before it was `pace`.
    pub(in crate::integrate) fn suspect_chatter(&mut self, pace: f64) {
        self.chatter.get_or_insert(Chatter {
            pace,
            since: self.t,
            n_steps: 0,
            n_jumps: 0,
        });
    }

    /// After a step: ends the run if it has made nothing but short steps since the jump, many of them across another
    /// jump. Any solver would go on like that for ever, with a step per tolerance.
    pub(in crate::integrate) fn chatters(&mut self, dt: f64) -> Option<Stop> {
        let chatter = self.chatter.as_mut()?;
        if dt >= JUMP_SHRINK * chatter.pace {
            self.chatter = None;
            return None;
        }
        chatter.n_steps += 1;
        chatter.n_jumps += u32::from(self.stepper.field_jumps());
        let does = chatter.n_steps >= CHATTER_STEPS && chatter.n_jumps >= CHATTER_STEPS / 10;
        does.then_some(Stop::Chatter {
            since: chatter.since,
        })
    }
}
