//! The derivatives of a run at any of its times, and of the zeros of functions along it.

use super::event_gradient::EventGradient;
use super::extended::{Column, Extended};
use super::forms::{pairs, Second};
use super::piece::{Piece, Surroundings};
use super::tangents::Derivatives;
use super::weights::Weights;
use crate::error::FieldError;
use crate::options::Options;
use crate::record::{Side, Solution};
use crate::system::{Actions, TracedSystem};
use crate::vectors::dot;

/// A run with its derivatives.
pub struct Differentiated<'r> {
    run: DifferentiatedRun<'r>,
    /// The motion at the time asked for last, and the start of its segment.
    latest: Option<(f64, Box<Piece<'r>>)>,
}

/// What is known of a run with its derivatives.
#[derive(Clone, Copy)]
pub struct DifferentiatedRun<'r> {
    /// The run.
    pub solution: &'r Solution,
    /// The derivatives at its steps.
    pub found: &'r Derivatives,
    /// By what was differentiated.
    pub kinds: &'r [Column],
    /// The system, and its extension by the parameters among these.
    pub systems: (&'r TracedSystem, &'r Extended<'r>),
    /// The impacts of the extended system.
    pub impacts: &'r Actions<'r>,
    /// The options of the run.
    pub options: &'r Options,
}

impl<'r> Differentiated<'r> {
    /// To be asked for derivatives, soonest in the order of time.
    pub fn new(run: DifferentiatedRun<'r>) -> Self {
        Differentiated { run, latest: None }
    }

    /// The derivative of the state at a time, a column of n states after the other, found from that at the last step before;
    /// `None` outside of the run, or if its continuous extension was not kept.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn at(&mut self, t: f64, side: Side) -> Result<Option<Vec<f64>>, FieldError> {
        let (columns, n) = (self.columns(t, side)?, self.run.systems.1.n);
        let states = |columns: Vec<Vec<f64>>| {
            let columns = columns.into_iter();
            columns
                .flat_map(|column| column.into_iter().take(n))
                .collect()
        };
        Ok(columns.map(states))
    }

    /// The derivatives of the time of a zero of g, by the columns; `None` as for [`at`](Self::at). The first component of the
    /// field of `function` is g.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn time_of_zero(
        &mut self,
        function: &EventGradient,
        t: f64,
    ) -> Result<Option<Vec<f64>>, FieldError> {
        let side = Side::Left;
        let Some(columns) = self.columns(t, side)? else {
            return Ok(None);
        };
        let (path, run) = (self.path(t, side), self.run);
        let extended = run.systems.1;
        let Some(piece) = self.piece(t, side) else {
            return Ok(None);
        };
        let mut x = vec![0.0; extended.n];
        path(t, &mut x)?;
        let z = extended.state(&x);
        let zero = function.at_zero(piece, (t, &z))?;
        // Where the function jumps with an instant of the run, it is zero when that comes.
        let mut instants = run.found.instants.iter();
        let instant = instants.find(|instant| zero.is_brought_by(instant.t));
        if let Some(instant) = instant {
            return Ok(Some(instant.dt.clone()));
        }
        let start = run.found.t.first().copied().unwrap_or(t);
        let weights = Weights::new(start, run.solution.t_last - start, run.options);
        if function.touches(piece, (t, &z), &zero, &weights)? {
            return Ok(Some(vec![f64::NAN; columns.len()]));
        }
        let shift = |column: &Vec<f64>| -dot(&zero.gradient, column) / zero.rate;
        Ok(Some(columns.iter().map(shift).collect()))
    }

    /// The mixed second derivatives of the state at a time, for every pair of columns (a, b) with b <= a those of n states; `None` as
    /// for [`at`](Self::at), or if they were not followed.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn second_at(&mut self, t: f64, side: Side) -> Result<Option<Vec<f64>>, FieldError> {
        let DifferentiatedRun { found, kinds, .. } = self.run;
        let n = self.run.systems.1.n;
        let size = n * pairs(kinds.len()).count();
        let Some(index) = self
            .last_known(t, side)
            .filter(|_| !found.second.is_empty())
        else {
            return Ok(None);
        };
        let known = &found.second[index * size..][..size];
        if found.t[index] == t {
            return Ok(Some(known.to_vec()));
        }
        let columns = self.known_columns(index);
        let mut second = Second {
            pairs: known.chunks_exact(n).map(<[f64]>::to_vec).collect(),
        };
        let path = self.path(t, side);
        let Some(there) = self.columns(t, side)? else {
            return Ok(None);
        };
        let Some(piece) = self.piece(t, side) else {
            return Ok(None);
        };
        let span = (found.t[index], t);
        if !piece.advance_pairs(path, span, &columns, &mut second)? {
            return Ok(Some(vec![f64::NAN; size]));
        }
        let mut x = vec![0.0; n];
        path(t, &mut x)?;
        second.hold(piece, (t, &piece.extended.state(&x)), &there)?;
        Ok(Some(second.pairs.concat()))
    }

    /// The place among the known times of the last one before a time.
    fn last_known(&self, t: f64, side: Side) -> Option<usize> {
        let times = &self.run.found.t;
        let is_known = |&known: &f64| match side {
            Side::Left => known < t,
            Side::Right => known <= t,
        };
        let next = times.partition_point(is_known);
        if side == Side::Left && times.get(next) == Some(&t) {
            return Some(next);
        }
        next.checked_sub(1)
    }

    /// The columns at a known time, with the shares of the parameters.
    fn known_columns(&self, index: usize) -> Vec<Vec<f64>> {
        let DifferentiatedRun { found, kinds, .. } = self.run;
        let extended = self.run.systems.1;
        let (n, size) = (extended.n, extended.n * kinds.len());
        let known = found.values[index * size..][..size].chunks_exact(n);
        let columns = kinds.iter().zip(known);
        columns
            .map(|(kind, states)| extended.column(*kind, states))
            .collect()
    }

    /// The path of the run to a time, which is reached from this side: the motion to it starts behind an instant.
    fn path(
        &self,
        end: f64,
        side: Side,
    ) -> impl Fn(f64, &mut [f64]) -> Result<(), FieldError> + Copy + 'r {
        let (solution, systems) = (self.run.solution, self.run.systems);
        move |t: f64, x: &mut [f64]| {
            let side = if t < end { Side::Right } else { side };
            state_at(solution, systems, (t, side), x)
        }
    }

    /// The derivative of the state, with the shares of the parameters behind each column.
    fn columns(&mut self, t: f64, side: Side) -> Result<Option<Vec<Vec<f64>>>, FieldError> {
        let Some(index) = self.last_known(t, side) else {
            return Ok(None);
        };
        let mut columns = self.known_columns(index);
        let start = self.run.found.t[index];
        if start == t {
            return Ok(Some(columns));
        }
        let (path, extended) = (self.path(t, side), self.run.systems.1);
        let Some(piece) = self.piece(t, side) else {
            return Ok(None);
        };
        piece.advance(path, (start, t), &mut columns)?;
        let mut x = vec![0.0; extended.n];
        path(t, &mut x)?;
        piece.project(t, &extended.state(&x), &mut columns)?;
        Ok(Some(columns))
    }

    /// The motion of the extended system at a time.
    fn piece(&mut self, t: f64, side: Side) -> Option<&mut Piece<'r>> {
        let run = self.run;
        let segment = run.solution.segment_at(t, side);
        let segment = segment.filter(|_| run.solution.is_dense())?;
        let latest = self.latest.take();
        let latest = latest.filter(|latest| latest.0 == segment.t_start);
        let (_, piece) = self.latest.insert(latest.unwrap_or_else(|| {
            let mut around = Surroundings::at_start(run.systems.1, run.impacts, run.options);
            let segments = run.solution.segments.iter();
            let so_far = segments.take_while(|earlier| earlier.t_start <= segment.t_start);
            so_far.for_each(|earlier| around.take_sides(&earlier.mode));
            let piece = Piece::new(&around, &segment.mode, &segment.discrete);
            (segment.t_start, Box::new(piece))
        }));
        Some(piece)
    }
}

/// Writes the state at a time, with the named discrete states behind it; NaN outside of the run.
pub(super) fn state_at(
    solution: &Solution,
    (system, extended): (&TracedSystem, &Extended),
    (t, side): (f64, Side),
    x: &mut [f64],
) -> Result<(), FieldError> {
    let (own, named) = x.split_at_mut(extended.n - extended.n_named);
    let segment = solution.segment_at(t, side);
    match segment.filter(|_| !named.is_empty()) {
        Some(segment) => named.copy_from_slice(&segment.discrete[..named.len()]),
        None => named.fill(f64::NAN),
    }
    if solution.evaluate(system, t, side, own)?.is_none() {
        x.fill(f64::NAN);
    }
    Ok(())
}
