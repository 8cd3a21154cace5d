//! The record of a run: steps, segments, switches.

use crate::error::FieldError;
use crate::event::UserZero;
use crate::mode::Mode;
use crate::motion::Projector;
use crate::motion::{Held, Piece};
use crate::options::SlidingRule;
use crate::record::section::Returns;
use crate::record::{DecisionRecord, Segment, Segments, Switches};
use crate::stats::Stats;
use crate::status::{Stop, Warning};
use crate::stepper::Basis;
use crate::switch::{Kind, Switch};
use crate::system::{Actions, PiecewiseSystem, Setting};

/// A step, or its part up to an event.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    pub t0: f64,
    pub dt: f64,
    pub t_stop: f64,
    /// Where its coefficients begin, and end.
    pub coefficients: (usize, usize),
    pub basis: Basis,
}

/// Which limit is meant at a switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// From earlier times.
    Left,
    /// From later times.
    Right,
}

/// What a run computed.
#[derive(Debug)]
#[non_exhaustive]
pub struct Solution {
    /// Number of states.
    pub n_states: usize,
    /// Times: step ends, or `t_eval`.
    pub t: Vec<f64>,
    /// States at `t`, one after the other.
    pub y: Vec<f64>,
    /// Switches in order of time.
    pub switches: Switches,
    /// Pieces of constant mode; they tile the time span.
    pub segments: Segments,
    /// Zeros of the user's events, per event.
    pub user_zeros: Vec<Vec<UserZero>>,
    /// Why the run ended.
    pub stop: Stop,
    /// The last time reached.
    pub t_last: f64,
    /// The sliding field where several surfaces meet.
    pub sliding: SlidingRule,
    /// Are sliding motions on their surfaces by projection?
    pub is_projected: bool,
    /// The units in which states are moved onto surfaces; empty: one for all.
    pub(crate) units: Vec<f64>,
    /// The mode at the end.
    pub mode: Mode,
    /// The discrete states at the end.
    pub discrete: Vec<f64>,
    /// Those at each of `t`, one after the other, where pieces are forgotten and `t` is `t_eval`; else empty.
    pub discrete_at_t: Vec<f64>,
    /// The side of each surface on which the motion was last, if the run has actions.
    pub(crate) sides: Vec<i8>,
    /// Counters.
    pub stats: Stats,
    /// Warnings.
    pub warnings: Vec<Warning>,
    /// The returns to the section, if the run was observed at one.
    pub returns: Option<Returns>,
    /// The first decisions, if they were asked for ([`crate::Options::keep_decisions`]).
    pub decisions: Vec<DecisionRecord>,
    pub(crate) steps: Vec<Step>,
    pub(crate) coefficients: Vec<f64>,
    pub(crate) y0: Vec<f64>,
    /// The state at `t_last`.
    pub(crate) y_last: Vec<f64>,
    /// The surfaces of the last switches, if there were very many in one place, also where switches are not kept.
    pub(crate) last_switched: Vec<usize>,
    /// The state at the end, if it jumped there.
    pub(crate) y_end: Option<Vec<f64>>,
}

impl Solution {
    /// The state at the initial time.
    pub fn first_state(&self) -> &[f64] {
        &self.y0
    }

    /// The state at the last time.
    pub fn last_state(&self) -> &[f64] {
        &self.y_last
    }

    /// Writes the state at `t` from the continuous extension; on the surface while sliding, if it is projected.
    /// Returns the mode there, or `None` outside of the span or without dense output.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn evaluate(
        &self,
        system: &dyn PiecewiseSystem,
        t: f64,
        side: Side,
        y: &mut [f64],
    ) -> Result<Option<Mode>, FieldError> {
        let n = self.n_states;
        let (Some(first), Some(last)) = (self.segments.first(), self.segments.last()) else {
            return Ok(None);
        };
        if !(t >= first.t_start && t <= last.t_end) {
            return Ok(None);
        }
        match &self.y_end {
            Some(y_end) if side == Side::Right && t == last.t_end => {
                y.copy_from_slice(y_end);
                return Ok(Some(self.mode.clone()));
            }
            _ => {}
        }
        if self.steps.is_empty() || side == Side::Left && t == first.t_start {
            y.copy_from_slice(&self.y0);
            return Ok((t == first.t_start).then_some(first.mode));
        }
        let index = self.step_at(t, side);
        let step = self.steps[index];
        let theta = (t - step.t0) / step.dt;
        let (from, to) = step.coefficients;
        let Some(coefficients) = self.coefficients.get(from..to) else {
            return Ok(None);
        };
        crate::stepper::evaluate(step.basis, coefficients, n, theta, y);
        let segment = self.segments.partition_point(|_, last| last <= index);
        let segment = segment.min(self.segments.len() - 1);
        let Segment { mode, discrete, .. } = self.segments.at(segment);
        if mode.codimension() > 0 && self.is_projected {
            let (set, signs) = (mode.sliding_set().collect::<Vec<_>>(), mode.signs());
            let setting = Setting::new(&signs, &discrete);
            let projector = Projector::new(n, system.n_surfaces());
            let mut projector = projector.measured_in(self.units.clone());
            projector.project_onto_rates(system, &set, t, y, setting)?;
        }
        Ok(Some(mode))
    }
}

impl Solution {
    /// The switches that a user sees, if these are the first `n` surfaces: not the crossings and touches of the others.
    pub fn switches_of_first(&self, n: usize) -> impl Iterator<Item = Switch> + '_ {
        self.switches.iter().filter(move |s| {
            !matches!(s.kind, Kind::Crossing | Kind::Grazing)
                || s.surfaces.iter().any(|&j| j < n)
                || s.mode_before.first(n) != s.mode_after.first(n)
        })
    }

    /// The times at which a segment begins, one of its steps ends and the next one begins, and at which it ends. Two equal times for
    /// a segment without duration; nothing in between if no steps are kept.
    pub fn knots_of(&self, segment: &Segment) -> impl Iterator<Item = f64> + '_ {
        let (from, to) = segment.steps;
        let steps = self.steps.get(from..to).unwrap_or_default();
        let inner = steps.iter().skip(1).map(|step| step.t0);
        let (start, end) = (segment.t_start, segment.t_end);
        let inner = inner.filter(move |&t| start < t && t < end);
        std::iter::once(start).chain(inner).chain([end])
    }

    /// Writes the derivative in time of the continuous extension; `None` outside of the span or without dense output.
    pub fn rate(&self, t: f64, side: Side, dy: &mut [f64]) -> Option<()> {
        let (first, last) = (self.segments.first()?, self.segments.last()?);
        if self.steps.is_empty() || !(t >= first.t_start && t <= last.t_end) {
            return None;
        }
        let step = self.steps[self.step_at(t, side)];
        let (from, to) = step.coefficients;
        let coefficients = self.coefficients.get(from..to)?;
        let theta = (t - step.t0) / step.dt;
        crate::stepper::derivative(step.basis, coefficients, (theta, step.dt), dy);
        Some(())
    }

    /// The place of the step that `t` belongs to, of at least one.
    fn step_at(&self, t: f64, side: Side) -> usize {
        match side {
            Side::Right => self.steps.partition_point(|s| s.t0 <= t).max(1) - 1,
            Side::Left => {
                let place = self.steps.partition_point(|s| s.t_stop < t);
                place.min(self.steps.len() - 1)
            }
        }
    }

    /// The segment that `t` belongs to.
    pub fn segment_at(&self, t: f64, side: Side) -> Option<Segment> {
        self.segments.get(self.segment_index(t, side)?)
    }

    /// Its place among the segments.
    pub(crate) fn segment_index(&self, t: f64, side: Side) -> Option<usize> {
        let before = match side {
            Side::Right => self.segments.partition_point(|t_start, _| t_start <= t),
            Side::Left => self.segments.partition_point(|t_start, _| t_start < t),
        };
        (!self.segments.is_empty()).then(|| before.saturating_sub(1))
    }

    /// The surfaces slid on at `t` and their multipliers, in a run without actions; none in a region. [`Solution::held`] is the
    /// answer for any run.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn multipliers(
        &self,
        system: &dyn PiecewiseSystem,
        t: f64,
        side: Side,
    ) -> Result<Vec<(usize, f64)>, FieldError> {
        Ok(self.held(system, &Actions::none(), t, side)?.multipliers)
    }

    /// What holds the motion on its surfaces at `t`: nothing in a region, and nothing outside of the span or without dense output.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn held(
        &self,
        system: &dyn PiecewiseSystem,
        actions: &Actions<'_>,
        t: f64,
        side: Side,
    ) -> Result<Held, FieldError> {
        let mut y = vec![0.0; self.n_states];
        if self.evaluate(system, t, side, &mut y)?.is_none() {
            return Ok(Held::default());
        }
        match self.piece_at(system, t, side)? {
            Some(piece) => piece.held(system, actions, self.sliding, (t, &y)),
            None => Ok(Held::default()),
        }
    }

    /// Are the continuous extensions kept?
    pub(crate) fn is_dense(&self) -> bool {
        !self.steps.is_empty()
    }

    /// Replaces the step ends by the wanted times, as far as the run came.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub(crate) fn resample(
        &mut self,
        system: &dyn PiecewiseSystem,
        times: &[f64],
    ) -> Result<(), FieldError> {
        let mut y = vec![0.0; self.n_states];
        let (mut t_out, mut y_out) = (Vec::with_capacity(times.len()), Vec::new());
        for &t in times.iter().filter(|&&t| t <= self.t_last) {
            if self.evaluate(system, t, Side::Right, &mut y)?.is_some() {
                t_out.push(t);
                y_out.extend_from_slice(&y);
            }
        }
        (self.t, self.y) = (t_out, y_out);
        Ok(())
    }
}

impl Solution {
    /// The motion that `t` belongs to.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn piece_at(
        &self,
        system: &dyn PiecewiseSystem,
        t: f64,
        side: Side,
    ) -> Result<Option<Piece>, FieldError> {
        let Some(index) = self.segment_index(t, side) else {
            return Ok(None);
        };
        if self.y_end.is_some() && t == self.t_last && side == Side::Right {
            return Ok(Some(self.last_piece()));
        }
        let segment = self.segments.at(index);
        let mut start = Vec::new();
        if segment.mode.codimension() == 1 {
            start.resize(self.n_states, 0.0);
            self.evaluate(system, segment.t_start, Side::Right, &mut start)?;
        }
        Ok(Some(Piece {
            mode: segment.mode,
            discrete: segment.discrete,
            sides: self.sides_before(index),
            near: segment.multipliers.to_vec(),
            start,
        }))
    }

    /// The motion at the end of the run.
    pub fn last_piece(&self) -> Piece {
        let last = self.segments.last().filter(|last| last.mode == self.mode);
        Piece {
            mode: self.mode.clone(),
            discrete: self.discrete.clone(),
            sides: self.sides.clone(),
            near: last.map_or_else(Vec::new, |last| last.multipliers.to_vec()),
            start: Vec::new(),
        }
    }

    /// The side on which the motion was last before a segment, for the surfaces that it stays on; 0 if on none, and for the others.
    fn sides_before(&self, index: usize) -> Vec<i8> {
        let mode = self.segments.at(index).mode;
        let mut sides = vec![0; mode.entries().len()];
        for j in mode.sliding_set() {
            let earlier = (0..index).rev().map(|k| self.segments.at(k));
            let mut entries = earlier.map(|segment| segment.mode.entries()[j]);
            sides[j] = entries.find(|&entry| entry != 0).unwrap_or(0);
        }
        sides
    }
}
