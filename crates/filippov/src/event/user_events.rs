//! The user's own functions and their zeros so far.

use std::cell::RefCell;

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::event::{Found, UserEvent};
use crate::tolerances::AT_SIDE;

/// A zero of a user's function.
#[derive(Clone, Debug, PartialEq)]
pub struct UserZero {
    /// Its time.
    pub t: f64,
    /// The state there.
    pub y: Vec<f64>,
}

/// What happens at the end of a step, for the functions of a user.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StepEnd {
    /// The motion goes on from there: where a function jumps with a sign, the next step tells.
    GoesOn,
    /// Discrete states change, and no state: every function may jump there, and the next step tells.
    Law,
    /// The state jumps, or the run ends.
    Stops,
}

/// What a search knows of a function where it ends.
#[derive(Clone, Copy)]
pub(crate) struct AtEnd {
    /// Its sign, of the piece that ends there.
    pub side: f64,
    /// Its value; NaN if it is not known.
    pub value: f64,
}

impl AtEnd {
    /// The sign alone.
    pub fn of_side(side: f64) -> Self {
        let value = f64::NAN;
        AtEnd { side, value }
    }
}

/// The user's functions and their zeros so far.
pub(crate) struct UserEvents<'a> {
    pub events: &'a [UserEvent<'a>],
    /// Value at the start of the step, per event; NaN if it is not known.
    pub left: Vec<f64>,
    /// Value at the start of the step before, per event.
    pub before: Vec<f64>,
    /// Sign at the end of the last step, per event, of the piece that ends there; 0 if the state has jumped since.
    pub sides: Vec<f64>,
    /// Of the step that is searched, per event.
    pub at_end: RefCell<Vec<AtEnd>>,
    /// Discrete states, as they were when the motion began.
    q: Vec<f64>,
    /// What happens at the end of the step that is searched.
    pub end: StepEnd,
    /// The surfaces at which the motion arrives there; `None` if rounding leaves a doubt.
    pub arrives_at: Option<SmallVec<[usize; 2]>>,
    /// Have they changed where the motion began? Every function may have jumped there.
    pub may_have_jumped: bool,
    /// Which of them have jumped from a value that is not zero to zero there.
    pub jumped_to_zero: Vec<bool>,
    /// Time of the last zero, per event: divided out while it is the start of the search.
    pub last: Vec<f64>,
    pub zeros: Vec<Vec<UserZero>>,
    /// How many zeros each has had, also those that are not kept.
    pub n_zeros: Vec<u64>,
    /// No step has been taken yet: a zero at the very start counts, as in SciPy.
    pub at_start: bool,
    /// The only function is that of the section: its zeros are returns.
    pub is_section: bool,
}

/// Stands for a tick among the indices of functions.
pub const TICK: usize = usize::MAX;

impl<'a> UserEvents<'a> {
    pub fn new(events: &'a [UserEvent<'a>]) -> Self {
        let d = events.len();
        UserEvents {
            events,
            left: vec![f64::NAN; d],
            sides: vec![0.0; d],
            at_end: RefCell::new(vec![AtEnd::of_side(0.0); d]),
            q: Vec::new(),
            end: StepEnd::GoesOn,
            arrives_at: Some(SmallVec::new()),
            may_have_jumped: false,
            jumped_to_zero: vec![false; d],
            before: vec![f64::NAN; d],
            last: vec![f64::NAN; d],
            zeros: vec![Vec::new(); d],
            n_zeros: vec![0; d],
            at_start: true,
            is_section: false,
        }
    }

    /// Takes down where the step that is searched ends: what happens there, and which guards vanish.
    pub fn expect(&mut self, end: StepEnd, found: Option<&Found>) {
        self.end = end;
        let is_clear = found.is_none_or(|event| !event.touch && !event.is_blurred);
        let surfaces = found.into_iter().flat_map(Found::surfaces);
        self.arrives_at = is_clear.then(|| surfaces.collect());
    }

    /// Evaluates the functions at the start of a motion.
    pub fn restart(&mut self, t: f64, x: &[f64], q: &[f64]) -> Result<(), FieldError> {
        for (k, event) in self.events.iter().enumerate() {
            let (before, now) = (self.left[k], event.function.value(t, x, q)?);
            // A zero from which the state has jumped is behind the motion.
            if self.sides[k] == 0.0 && now != before {
                self.last[k] = f64::NAN;
            }
            // One that has come to zero on the way is within rounding of it.
            self.jumped_to_zero[k] = now == 0.0 && before.abs() > AT_SIDE * self.before[k].abs();
            self.left[k] = now;
        }
        self.may_have_jumped = self.end == StepEnd::Law || self.q != q;
        self.q.clear();
        self.q.extend_from_slice(q);
        Ok(())
    }

    /// Keeps the signs that the search of the accepted step found.
    pub fn accept_sides(&mut self) {
        self.may_have_jumped = false;
        let sides = self.sides.iter_mut().zip(self.at_end.get_mut());
        sides.for_each(|(side, found)| *side = found.side);
    }

    /// Forgets the signs before a jump of the state, so that the next step does not compare its own with them.
    pub fn forget_sides(&mut self) {
        self.sides.fill(0.0);
    }

    /// The same without the zeros so far.
    pub fn without_zeros(&self) -> Self {
        UserEvents {
            left: self.left.clone(),
            before: self.before.clone(),
            sides: self.sides.clone(),
            at_end: self.at_end.clone(),
            q: self.q.clone(),
            jumped_to_zero: self.jumped_to_zero.clone(),
            arrives_at: self.arrives_at.clone(),
            last: self.last.clone(),
            zeros: vec![Vec::new(); self.zeros.len()],
            n_zeros: self.n_zeros.clone(),
            ..*self
        }
    }

    pub fn into_zeros(self) -> Vec<Vec<UserZero>> {
        self.zeros
    }
}
