//! Motion that chatters along a jump of the field for which no surface is declared.

use crate::status::Stop;
use crate::tolerances::{CHATTER_STEPS, JUMP_SHRINK};

/// Short steps since a jump of the field that no surface declares.
#[derive(Clone)]
struct Chatter {
    /// The step before the jump.
    pace: f64,
    since: f64,
    n_steps: u32,
    n_jumps: u32,
}

/// Looks for chatter.
#[derive(Clone, Default)]
pub(super) struct ChatterWatch(Option<Chatter>);

impl ChatterWatch {
    /// A jump was noticed at `t`; the step before it was `pace`.
    pub fn suspect(&mut self, t: f64, pace: f64) {
        self.0.get_or_insert(Chatter {
            pace,
            since: t,
            n_steps: 0,
            n_jumps: 0,
        });
    }

    /// The motion has switched: what came before is over.
    pub fn forget(&mut self) {
        self.0 = None;
    }

    /// After a step of length `dt`, within which the field jumps or not: ends the run if it has made nothing but short steps
    /// since the jump, many of them across another jump. Any solver would go on like that for ever, with a step per tolerance.
    pub fn note_step(&mut self, dt: f64, jumps: impl FnOnce() -> bool) -> Option<Stop> {
        let chatter = self.0.as_mut()?;
        if dt >= JUMP_SHRINK * chatter.pace {
            self.0 = None;
            return None;
        }
        chatter.n_steps += 1;
        chatter.n_jumps += u32::from(jumps());
        let does = chatter.n_steps >= CHATTER_STEPS && chatter.n_jumps >= CHATTER_STEPS / 10;
        does.then_some(Stop::Chatter {
            since: chatter.since,
        })
    }
}
