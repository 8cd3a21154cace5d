//! Gradients of costs of a run whose record is too large to be kept: its way back goes over stretches, each of which is run again.
//!
//! The run is made once more from its start. Whenever the record of a stretch has reached its share of the memory, a checkpoint is
//! put on a stack and the record is forgotten. At the end the last stretch is there and is taken back. What comes before it is run
//! again from the checkpoint on top of the stack, in the same way: where the stack was full and checkpoints between were dropped,
//! new ones take the room that has become free. The steps are the same each time, to the bit.

use std::cell::RefCell;

use super::checkpoint::{take_record, Checkpoint};
use super::{Integrator, Problem, Reached};
use crate::derivative::{CostGradient, Stretch, Term, Trail, Walk, WayBack};
use crate::error::{Error, FieldError};
use crate::record::{Observed, Solution};
use crate::status::Stop;

/// The record of a stretch has this part of the memory, twice that with the spare room of its vectors; as much is for checkpoints.
const SHARE: usize = 4;

/// Why a run could not be repeated.
#[derive(Debug)]
pub enum ReplayError {
    /// The arguments are wrong.
    Refused(Error),
    /// A function of the user raised.
    Raised(FieldError),
    /// The caller asked to stop.
    Interrupted,
    /// The memory does not hold two checkpoints: so many bytes do.
    TooSmall(usize),
    /// It ended elsewhere.
    Differs,
}

impl From<FieldError> for ReplayError {
    fn from(error: FieldError) -> Self {
        ReplayError::Raised(error)
    }
}

/// The start of a stretch.
struct StretchStart<'a> {
    checkpoint: Checkpoint<'a>,
    trail: Trail,
    /// How many steps, accepted or not, were made up to it.
    number: u64,
}

impl StretchStart<'_> {
    fn n_bytes(&self) -> usize {
        self.checkpoint.n_bytes() + size_of::<Self>() + self.trail.n_bytes()
    }

    /// How many bytes it may come to take later in a run of such motions.
    fn most_bytes(&self) -> usize {
        self.n_bytes() + self.checkpoint.room_for_switches() + self.trail.room_for_earlier()
    }
}

impl<'a> Problem<'a> {
    /// As [`solve_observed`](Self::solve_observed) by a trail. If the record comes to need more than `memory`, in bytes, it is
    /// forgotten: then only the last state is known at the end, and the trail is empty.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_with_trail(
        self,
        trail: Trail,
        memory: usize,
        interrupt: &mut dyn FnMut(Reached) -> bool,
    ) -> Result<(Solution, Trail), Error> {
        let shared = RefCell::new(trail);
        let mut observer = &shared;
        let mut run = Integrator::new(self)?
            .interruptible(interrupt)
            .observed_by(&mut observer);
        let mut is_kept = true;
        let stop = loop {
            match run.step() {
                Ok(None) => {}
                Ok(Some(stop)) => break stop,
                Err(raised) => break Stop::FieldRaised(raised),
            }
            if is_kept && run.recorder.n_bytes() + shared.borrow().n_bytes() > memory / SHARE {
                is_kept = false;
                shared.borrow_mut().close();
                run.recorder.keep_last_only();
            }
        };
        let solution = run.finish(stop);
        Ok((solution, shared.into_inner()))
    }

    /// The gradient of a sum of terms along the run that ended as `solution` did, with so many bytes of memory for its record.
    ///
    /// # Errors
    /// If the memory does not suffice for two checkpoints, or a function of the user raises.
    pub fn gradient_within(
        self,
        (solution, memory): (&Solution, usize),
        (way, trail, terms): (&WayBack, Trail, &[Term]),
        interrupt: &mut dyn FnMut(Reached) -> bool,
    ) -> Result<CostGradient, ReplayError> {
        let shared = RefCell::new(trail);
        let mut observer = &shared;
        let run = Integrator::new(self).map_err(ReplayError::Refused)?;
        let mut repeated = Repeated {
            run: run.interruptible(interrupt).observed_by(&mut observer),
            trail: &shared,
            share: memory / SHARE,
        };
        let mut stack = vec![repeated.place(0)];
        let mut walk = Walk::new(way, terms);
        let mut end = None;
        // Where the stretch has to end, to the bit.
        let mut reached = (solution.t_last, solution.last_state().to_vec());
        while let Some(top) = stack.last() {
            let mut start = top.number;
            repeated.return_to(top);
            while let Some(next) = repeated.go_on(start, end)? {
                let needed = SHARE * (2 * next.most_bytes());
                if needed > memory {
                    return Err(ReplayError::TooSmall(needed));
                }
                repeated.return_to(&next);
                start = next.number;
                stack.push(next);
                thin(&mut stack, repeated.share);
            }
            let (record, trail) = repeated.take_record();
            let is_same = |one: &[f64], other: &[f64]| {
                let mut pairs = one.iter().zip(other);
                pairs.all(|(one, other)| one.to_bits() == other.to_bits())
            };
            if record.t_last.to_bits() != reached.0.to_bits()
                || !is_same(record.last_state(), &reached.1)
            {
                return Err(ReplayError::Differs);
            }
            reached = (trail.t_start(), record.first_state().to_vec());
            walk.back(&Stretch {
                solution: &record,
                trail: &trail,
                is_first: start == 0,
            })?;
            if start == 0 {
                return Ok(walk.finish(&trail)?);
            }
            end = Some(start);
            while stack.last().is_some_and(|place| place.number >= start) {
                stack.pop();
            }
        }
        Err(ReplayError::Differs)
    }
}

/// Drops every other place, but the first and the last, if all of them take more than this.
fn thin(stack: &mut Vec<StretchStart>, share: usize) {
    let bytes: usize = stack.iter().map(StretchStart::n_bytes).sum();
    if bytes <= share {
        return;
    }
    let last = stack.len() - 1;
    let mut place = 0..;
    stack.retain(|_| place.next().is_some_and(|k| k % 2 == 0 || k == last));
}

/// A run that is repeated, stretch by stretch.
struct Repeated<'a, 't> {
    run: Integrator<'a>,
    /// Its observer.
    trail: &'t RefCell<Trail>,
    /// How many bytes the record of a stretch may take.
    share: usize,
}

impl<'a> Repeated<'a, '_> {
    /// The place that it has come to, where the next stretch starts.
    fn place(&self, number: u64) -> StretchStart<'a> {
        let (run, trail) = (&self.run, self.trail.borrow());
        let trail = match number {
            0 => trail.clone(),
            _ => trail.next((run.t(), run.x()), run.mode(), &run.run.motion.discrete),
        };
        StretchStart {
            checkpoint: Checkpoint::of(run),
            trail,
            number,
        }
    }

    fn return_to(&mut self, place: &StretchStart<'a>) {
        place.checkpoint.return_to(&mut self.run);
        *self.trail.borrow_mut() = place.trail.clone();
    }

    /// Runs up to the step of the number `end`, or to the end of the run; or, if the record comes to take too much, up to the place
    /// that is returned.
    fn go_on(
        &mut self,
        start: u64,
        end: Option<u64>,
    ) -> Result<Option<StretchStart<'a>>, ReplayError> {
        let mut number = start;
        while end != Some(number) {
            match self.run.step()? {
                None => number += 1,
                Some(Stop::Interrupted) => return Err(ReplayError::Interrupted),
                Some(_) if end.is_some() => return Err(ReplayError::Differs),
                Some(_) => return Ok(None),
            }
            let n_bytes = self.run.recorder.n_bytes() + self.trail.borrow().n_bytes();
            if n_bytes > self.share && end != Some(number) && !self.is_in_instant() {
                return Ok(Some(self.place(number)));
            }
        }
        Ok(None)
    }

    /// Is it between the end of a motion and the start of the next one?
    fn is_in_instant(&self) -> bool {
        let observed = self.run.recorder.observed.as_ref();
        observed.is_some_and(Observed::is_in_instant)
    }

    fn take_record(&mut self) -> (Solution, Trail) {
        let solution = take_record(&mut self.run);
        (solution, self.trail.take())
    }
}
