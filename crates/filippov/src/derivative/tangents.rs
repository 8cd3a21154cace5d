//! The derivatives of a run, as its observer.

use super::borders::{
    differ, is_missed_later, map_has_sides, starts_at_threshold, stays_at_end, surfaces_at_action,
    surfaces_at_start, surfaces_landed_on, ticks_at_start, Borders, Kept,
};
use super::change::Row;
use super::extended::{Column, Extended};
use super::forms::{pairs, Moved, Second};
use super::instant::{arrival, brought_by, Instant, Lost};
use super::limit::History;
use super::passing::InstantDerivative;
use super::piece::{Piece, Surroundings};
use super::second::{at_start, behind, Timed};
use super::weights::Weights;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::options::{Keep, Options};
use crate::record::{InstantRecord, KeptInstant, ObservedStep, Observer};
use crate::system::Actions;
use crate::vectors::dot;

/// So many motions are kept, in case that they come again.
const MOST_PIECES: usize = 16;

/// Where inside of a part of a step the motion is looked at: a fraction that no symmetry singles out.
const INSIDE: f64 = 0.37;

/// The derivatives of a run.
#[derive(Clone, Debug, Default)]
pub struct Derivatives {
    /// The times of the steps, the start included; a time at which an instant lies occurs twice. The last one alone, if the run does
    /// not keep its steps.
    pub t: Vec<f64>,
    /// The derivative of the state at each of them, a column after the other.
    pub values: Vec<f64>,
    /// The mixed second derivatives at each of them, if they are followed: for every pair of columns (a, b) with b <= a, in order, those
    /// of the state. NaN where they are not known.
    pub second: Vec<f64>,
    /// The time from which on derivatives are not known, and why.
    pub lost: Option<(f64, Lost)>,
    /// From when on second derivatives are not known, and why.
    pub second_lost: Vec<LostSecond>,
    /// Those of all instants; if the run keeps its last state only, of the one at which they end.
    pub instants: Vec<InstantDerivative>,
    /// Where they are those of one side.
    pub borders: Borders,
}

/// A time from which on fewer second derivatives are known than before.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct LostSecond {
    /// The time.
    pub t: f64,
    /// Why.
    pub why: SecondLost,
    /// For how many pairs of columns they are known then.
    pub n_known: usize,
}

/// Why second derivatives are not known from a time on, from which first ones may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SecondLost {
    /// The run starts on surfaces slid on.
    Start,
    /// An action puts the state beside surfaces slid on.
    Arrival,
    /// Infinitely many switches were jumped over.
    Accumulation,
    /// The series of the changes are too short for the steps.
    Motion,
    /// Several functions fix the time of an instant.
    Instant,
}

impl SecondLost {
    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            SecondLost::Start => "start",
            SecondLost::Arrival => "arrival",
            SecondLost::Accumulation => "accumulation",
            SecondLost::Motion => "motion",
            SecondLost::Instant => "instant",
        }
    }
}

/// Follows the derivatives of a run, step by step and through its instants. Where they end they are NaN.
///
/// # Example
///
/// ```
/// use filippov::derivative::{Column, Extension, Tangents};
/// use filippov_expr::{Backend, Graph, Names};
/// use filippov::{Integrator, Options, Problem, Rules, TracedSystem};
///
/// // x' = -a sign(x) from x = 1: zero is reached at t = 1 / a.
/// let mut graph = Graph::new();
/// let (x, a) = (graph.state(0), graph.parameter(0));
/// let sign = graph.sign(x);
/// let pull = graph.mul(a, sign);
/// let field = vec![graph.neg(pull)];
/// let names = Names { states: Vec::new(), parameters: vec!["a".into()] };
/// let system = TracedSystem::new(graph, field, vec![2.0], names, Backend::Interpreter)?;
///
/// let problem = Problem::new(&system, (0.0, 1.0), &[1.0]);
/// let none = filippov::action::Actions::none();
/// let extension = Extension::new(&system, &Rules::default(), &[0])?;
/// let extended = extension.at(system.parameters(), &none)?.expect("no map is called");
/// let options = Options::default();
/// let impacts = extended.impacts();
/// let mut tangents = Tangents::new(&extended, &impacts, vec![Column::State(0), Column::Parameter(0)], &options, 1.0);
/// Integrator::new(problem)?.observed_by(&mut tangents).solve();
/// let derivatives = tangents.finish()?;
/// let entry = &derivatives.instants[0];
/// assert!((entry.dt[0] - 0.5).abs() < 1e-12 && (entry.dt[1] + 0.25).abs() < 1e-12);
/// assert!(derivatives.values.ends_with(&[0.0, 0.0]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Tangents<'a> {
    around: Surroundings<'a>,
    weights: Weights,
    kept: Keep,
    kinds: Vec<Column>,
    /// For each column the derivative of the state, and its shares of the parameters behind it.
    columns: Vec<Vec<f64>>,
    /// The same before an instant.
    columns_before: Vec<Vec<f64>>,
    has_second: bool,
    /// The mixed derivatives, as long as they are known, and why they are not.
    second: Option<Second>,
    second_lost: SecondLost,
    /// Motions that were met, the latest last. They are moved in and out.
    #[allow(clippy::vec_box)]
    pieces: Vec<Box<Piece<'a>>>,
    history: History,
    /// Surfaces at which the sides differ, and on which the run has stayed since it came there.
    kept_on: Vec<Kept>,
    t_start: Option<f64>,
    lost: Option<Lost>,
    found: Derivatives,
    raised: Option<FieldError>,
}

impl<'a> Tangents<'a> {
    /// The derivatives by these columns of a run over `span` units of time.
    pub fn new(
        extended: &'a Extended<'a>,
        impacts: &'a Actions<'a>,
        kinds: Vec<Column>,
        options: &'a Options,
        span: f64,
    ) -> Self {
        Tangents {
            around: Surroundings::at_start(extended, impacts, options),
            weights: Weights::new(f64::INFINITY, span, options),
            columns: Vec::new(),
            columns_before: Vec::new(),
            kept: options.keep,
            has_second: false,
            second: None,
            second_lost: SecondLost::Instant,
            kinds,
            pieces: Vec::new(),
            history: History::default(),
            kept_on: Vec::new(),
            t_start: None,
            lost: None,
            found: Derivatives::default(),
            raised: None,
        }
    }

    /// With second derivatives.
    #[must_use]
    pub fn with_second(mut self) -> Self {
        self.has_second = true;
        self
    }

    /// Keeping this of the derivatives.
    #[must_use]
    pub(super) fn keeping(mut self, kept: Keep) -> Self {
        self.kept = kept;
        self
    }

    /// The derivatives.
    ///
    /// # Errors
    /// What a function of the user raised.
    pub fn finish(self) -> Result<Derivatives, FieldError> {
        match self.raised {
            Some(raised) => Err(raised),
            None => Ok(self.found),
        }
    }

    fn start(&mut self, t: f64, x: &[f64], mode: &Mode, q: &[f64]) -> Result<(), FieldError> {
        self.t_start = Some(t);
        self.weights.start = t;
        self.around.take_sides(mode);
        let n = self.around.extended.n;
        let z = self.around.extended.state(x);
        let mut piece = Piece::new(&self.around, mode, q);
        let field = piece.rates(t, &z)?;
        if self.has_second {
            let at = (t, &z[..]);
            self.second = Some(at_start(&mut piece, at, &field, &self.kinds)?);
        }
        self.columns = self.around.extended.columns_at_start(&self.kinds, &field);
        let (starts_on, stays_on) =
            surfaces_at_start(&mut piece, (t, &z), &self.kinds, &self.columns)?;
        if let Some(arrival) = arrival(&piece, t, &z)? {
            let beside = brought_by(&arrival, n, &mut self.columns);
            if let Some(second) = &mut self.second {
                self.second_lost = SecondLost::Start;
                second.arrive((&piece, &arrival), (t, &z), &self.columns, &beside)?;
            }
        }
        let borders = &mut self.found.borders;
        self.kept_on = Kept::all(&starts_on, true, &piece, (t, &z), &self.columns)?;
        let quiet = Kept::all(&stays_on, false, &piece, (t, &z), &self.columns)?;
        self.kept_on.extend(quiet);
        borders.stays_at_end = stays_at_end(&mut piece, (t, &z), &self.columns)?.then_some(t);
        borders.starts_on = starts_on;
        borders.starts_at_threshold = starts_at_threshold(&piece, (t, &z), &self.kinds)?;
        borders.starts_at_tick = ticks_at_start(&self.around, &mut piece, (t, &z), &self.kinds)?;
        if piece.is_unsupported() {
            self.lose(t, Lost::Unsupported);
        }
        self.put_back(Box::new(piece));
        self.keep(t);
        Ok(())
    }

    fn keep(&mut self, t: f64) {
        if self.kept != Keep::Steps {
            self.found.t.clear();
            self.found.values.clear();
            self.found.second.clear();
        }
        self.found.t.push(t);
        for column in &self.columns {
            let states = &column[..self.around.extended.n];
            self.found.values.extend_from_slice(states);
        }
        if self.has_second {
            let n = self.around.extended.n;
            let all = pairs(self.kinds.len());
            match &self.second {
                Some(second) => self.found.second.extend(second.pairs.iter().flatten()),
                None => {
                    let unknown = all.clone().flat_map(|_| vec![f64::NAN; n]);
                    self.found.second.extend(unknown);
                }
            }
            let known = self.n_second_known();
            let before = self.found.second_lost.last().map(|lost| lost.n_known);
            if known < before.unwrap_or_else(|| all.count()) {
                let lost = LostSecond {
                    t,
                    why: self.second_lost,
                    n_known: known,
                };
                self.found.second_lost.push(lost);
            }
        }
    }

    /// For how many pairs of columns the second derivative is known.
    fn n_second_known(&self) -> usize {
        self.second.as_ref().map_or(0, Second::n_known)
    }

    fn keep_instant(&mut self, found: InstantDerivative) {
        let is_end = found.lost.is_some() && self.found.instants.is_empty();
        if self.kept != Keep::Last || is_end {
            self.found.instants.push(found);
        }
    }

    fn lose(&mut self, t: f64, lost: Lost) {
        self.lost = Some(lost);
        self.found.lost.get_or_insert((t, lost));
        self.second = None;
        self.columns
            .iter_mut()
            .for_each(|column| column.fill(f64::NAN));
    }

    /// The motion of this mode, to be put back.
    fn take_piece(&mut self, mode: &Mode, q: &[f64]) -> Box<Piece<'a>> {
        let around = &self.around;
        let mut known = self.pieces.iter();
        match known.rposition(|piece| piece.is_of(around, mode, q)) {
            Some(place) => self.pieces.remove(place),
            None => Box::new(Piece::new(&self.around, mode, q)),
        }
    }

    fn put_back(&mut self, piece: Box<Piece<'a>>) {
        if self.pieces.len() == MOST_PIECES {
            self.pieces.remove(0);
        }
        self.pieces.push(piece);
    }

    fn follow(&mut self, step: &ObservedStep) -> Result<(), FieldError> {
        self.follow_part(step, (step.t_start(), step.t_end), step.x_end)
    }

    /// Takes the columns of the start, if the step is the first one.
    pub(super) fn begin(&mut self, step: &ObservedStep) -> Result<(), FieldError> {
        if self.t_start.is_some() {
            return Ok(());
        }
        let extended = self.around.extended;
        let mut x = vec![0.0; extended.n];
        extended.write_with_named(&mut x, step.discrete, |x| step.at(step.t_start(), x));
        self.start(step.t_start(), &x, step.mode, step.discrete)
    }

    /// Follows the derivatives over a part of a step, at whose end the state is `x_end`.
    pub(super) fn follow_part(
        &mut self,
        step: &ObservedStep,
        (t0, t1): (f64, f64),
        x_end: &[f64],
    ) -> Result<(), FieldError> {
        self.begin(step)?;
        if self.lost.is_none() {
            let mut piece = self.take_piece(step.mode, step.discrete);
            let extended = self.around.extended;
            let along = |t: f64, x: &mut [f64]| {
                extended.write_with_named(x, step.discrete, |x| step.at(t, x));
                Ok(())
            };
            if let Some(second) = &mut self.second {
                let known = second.n_known();
                let columns = &self.columns;
                let is_carried = piece.advance_pairs(along, (t0, t1), columns, second)?;
                if !is_carried || second.n_known() < known {
                    self.second_lost = SecondLost::Motion;
                }
                self.second = self.second.take().filter(|_| is_carried);
            }
            piece.advance(along, (t0, t1), &mut self.columns)?;
            if piece.codimension() > 0 {
                let z = extended.state(&extended.with_named(x_end, step.discrete));
                piece.project(t1, &z, &mut self.columns)?;
                if let Some(second) = &mut self.second {
                    second.hold(&piece, (t1, &z), &self.columns)?;
                }
            }
            let is_crossed = self.crosses_kept(&piece, step, (t0, t1), x_end)?;
            self.put_back(piece);
            if self.columns.iter().flatten().any(|v| !v.is_finite()) {
                self.lose(t1, Lost::NotFinite);
            } else if is_crossed {
                self.lose(t1, Lost::Crossed);
            }
        }
        self.found.borders.ends_at_instant = false;
        self.keep(t1);
        Ok(())
    }

    /// Does a run beside this one cross, in a part of a step, a surface on which this one stays?
    fn crosses_kept(
        &mut self,
        piece: &Piece,
        step: &ObservedStep,
        (t0, t): (f64, f64),
        x: &[f64],
    ) -> Result<bool, FieldError> {
        if self.kept_on.is_empty() {
            return Ok(false);
        }
        // A motion that leaves a surface may come back to it at the end.
        let (between, extended) = (t0 + INSIDE * (t - t0), self.around.extended);
        let mut inside = vec![0.0; extended.n];
        extended.write_with_named(&mut inside, step.discrete, |x| step.at(between, x));
        let [inside, z] = [&inside[..], x].map(|x| extended.state(x));
        let (mut kept_on, mut is_crossed) = (Vec::new(), false);
        for mut kept in std::mem::take(&mut self.kept_on) {
            if kept.holds(piece, between, &inside)? && kept.holds(piece, t, &z)? {
                is_crossed |= kept.is_crossed(piece, (t, &z), &self.columns)?;
                let differs = kept.begins_to_differ(piece, (t, &z))?;
                self.found.borders.starts_on.extend(differs);
                kept_on.push(kept);
            }
        }
        self.kept_on = kept_on;
        Ok(is_crossed)
    }

    pub(super) fn pass(&mut self, record: &InstantRecord) -> Result<(), FieldError> {
        if self.t_start.is_none() {
            self.start(record.t[0], record.x[0], record.mode[0], record.discrete[0])?;
        }
        let mut before = self.take_piece(record.mode[0], record.discrete[0]);
        for kept in &mut self.kept_on {
            let differs = kept.bends_what_vanishes(&mut before, record)?;
            self.found.borders.starts_on.extend(differs);
        }
        self.around.take_sides(record.mode[0]);
        let mut after = self.take_piece(record.mode[1], record.discrete[1]);
        let is_accumulation = record.t[0] != record.t[1];
        let mut instant = Instant {
            around: &self.around,
            extended: self.around.extended,
            record,
            before: &mut before,
            after: &mut after,
        };
        let known = self.n_second_known();
        if is_accumulation {
            let time = instant.time(&self.weights, &mut 0.0)?.ok();
            let timed = match (&time, self.second.take()) {
                (Some(time), Some(second)) => {
                    let mut order = instant.second_order(time, false);
                    order.timed(&self.columns, &second)?
                }
                _ => None,
            };
            self.second_lost = SecondLost::Accumulation;
            self.jump(record, time, timed, &mut after)?;
        } else {
            self.columns_before.clone_from(&self.columns);
            let (all, timed) = instant.pass(&self.weights, &mut self.columns, &mut self.second)?;
            if let Some(last) = all.last() {
                self.history
                    .push(record, &self.columns_before, &last.dt, timed);
            }
            if self.n_second_known() < known {
                let arrives = all.iter().any(|found| found.arrives);
                self.second_lost = match arrives {
                    true => SecondLost::Arrival,
                    false => SecondLost::Instant,
                };
            }
            let is_timed = |c: usize| all.iter().any(|found| found.dt[c] != 0.0);
            let mut pairs = self.columns_before.iter().zip(&self.columns).enumerate();
            self.found.borders.ends_at_instant = pairs
                .any(|(c, (before, after))| is_timed(c) && differ(before, after))
                || all.iter().any(|found| found.arrives);
            let start = self.t_start.unwrap_or(record.t[0]);
            self.found.borders.starts_at_action |=
                is_missed_later(self.around.extended, record, start, &self.kinds);
            if let (None, None, Some(last)) = (&self.found.borders.lands_on, self.lost, all.last())
            {
                let arrives = all.iter().any(|found| found.arrives);
                let columns = &self.columns;
                let mut landed =
                    surfaces_landed_on(&mut after, record, &last.dt, columns, arrives)?;
                let z = self.around.extended.state(record.x[1]);
                let kept = Kept::all(&landed, true, &after, (record.t[1], &z), columns)?;
                self.kept_on.extend(kept);
                if landed.is_empty() {
                    let columns = &self.columns_before;
                    landed = surfaces_at_action(&mut before, record, &last.dt, columns)?;
                }
                let lands_on = (!landed.is_empty()).then_some((record.t[1], landed));
                self.found.borders.lands_on = lands_on;
            }
            if let (None, None, Some(last)) =
                (self.found.borders.acts_at_sides, self.lost, all.last())
            {
                let (extended, columns) = (self.around.extended, &self.columns_before);
                let has_sides = map_has_sides(extended, record, &last.dt, columns, &self.weights)?;
                self.found.borders.acts_at_sides = has_sides.then_some(record.t[1]);
            }
            let replaced = record.replaces.then_some(Lost::Accumulation);
            for mut found in all {
                found.lost = self.lost.or(replaced).or(found.lost);
                found
                    .lost
                    .into_iter()
                    .for_each(|lost| self.lose(found.t, lost));
                self.keep_instant(found);
            }
            if let (None, None) = (self.found.borders.stays_at_end, self.lost) {
                let (t, z) = (record.t[1], self.around.extended.state(record.x[1]));
                let stays = stays_at_end(&mut after, (t, &z), &self.columns)?;
                self.found.borders.stays_at_end = stays.then_some(t);
            }
        }
        self.put_back(before);
        self.put_back(after);
        self.keep(record.t[1]);
        Ok(())
    }
}

/// What is needed where the columns are a basis that is changed on the way.
impl Tangents<'_> {
    /// The columns at this moment.
    pub(super) fn columns(&self) -> &[Vec<f64>] {
        &self.columns
    }

    /// Takes combinations of the columns in their place.
    pub(super) fn change(&mut self, columns: Vec<Vec<f64>>, change: &[Vec<f64>]) {
        self.columns = columns;
        self.history.change(change);
    }

    /// Takes other columns; the instants so far are forgotten.
    pub(super) fn replace(&mut self, columns: Vec<Vec<f64>>) {
        self.columns = columns;
        self.history.clear();
    }

    /// Why the derivatives are not known any more.
    pub(super) fn lost(&self) -> Option<Lost> {
        self.lost
    }

    /// How many dimensions the motion in a mode has lost.
    pub(super) fn codimension(&mut self, mode: &Mode, q: &[f64]) -> usize {
        let piece = self.take_piece(mode, q);
        let found = piece.codimension();
        self.put_back(piece);
        found
    }

    /// Takes from changes what leads off the surfaces of a mode.
    pub(super) fn project(
        &mut self,
        (mode, q): (&Mode, &[f64]),
        (t, x): (f64, &[f64]),
        changes: &mut [Vec<f64>],
    ) -> Result<(), FieldError> {
        let piece = self.take_piece(mode, q);
        let extended = self.around.extended;
        piece.project(t, &extended.state(&extended.with_named(x, q)), changes)?;
        self.put_back(piece);
        Ok(())
    }
}

impl Tangents<'_> {
    /// Goes to the limit of infinitely many switches.
    fn jump(
        &mut self,
        record: &InstantRecord,
        time: Option<Row>,
        timed: Option<Timed>,
        after: &mut Piece,
    ) -> Result<(), FieldError> {
        let extended = self.around.extended;
        let (n, sizes) = (extended.n, (extended.n, extended.n_parameters()));
        let unknown = |t: f64| InstantDerivative::unknown(t, self.kinds.len(), sizes);
        let [mut last, mut limit] = record.t.map(unknown);
        let time = time.filter(|_| !record.replaces);
        let found = time.and_then(|time| {
            let dt: Vec<f64> = self.columns.iter().map(|c| dot(&time, c)).collect();
            last.dt.clone_from(&dt);
            self.history.push(record, &self.columns, &dt, timed);
            self.history.limit()
        });
        match found.filter(|_| self.lost.is_none()) {
            None => {
                limit.lost = self.lost.or(Some(Lost::Accumulation));
                limit
                    .lost
                    .into_iter()
                    .for_each(|lost| self.lose(limit.t, lost));
            }
            Some(found) => {
                for ((column, dx), dt) in self.columns.iter_mut().zip(&found.dx).zip(&found.dt) {
                    for r in 0..n {
                        column[r] = dx[r] - record.field[1][r] * dt;
                    }
                }
                let z = extended.state(record.x[1]);
                let (t, field) = (record.t[1], record.field[1]);
                let second = found.second.as_ref().map(|(times, states)| {
                    let changes = self.columns.iter().zip(&found.dt);
                    let changes: Vec<(f64, Moved)> = changes
                        .map(|(column, dt)| (*dt, Moved::of_state(column).plus(*dt, field)))
                        .collect();
                    limit.second_dt.clone_from(times);
                    behind(after, (t, &z, field), &changes, (states, times))
                });
                after.project(t, &z, &mut self.columns)?;
                if let Some(second) = second {
                    let mut second = second?;
                    second.hold(after, (t, &z), &self.columns)?;
                    self.second = Some(second);
                }
                limit.dt = found.dt;
            }
        }
        [last, limit]
            .into_iter()
            .for_each(|found| self.keep_instant(found));
        Ok(())
    }
}

impl Observer for Tangents<'_> {
    fn step(&mut self, step: &ObservedStep) {
        if self.raised.is_none() {
            self.raised = self.follow(step).err();
        }
    }

    fn instant(&mut self, instant: &InstantRecord) {
        if self.raised.is_some() {
            return;
        }
        self.raised = match self.around.extended.n_named {
            0 => self.pass(instant).err(),
            count => {
                let kept = KeptInstant::with_discrete_as_states(instant, count);
                self.pass(&kept.record()).err()
            }
        };
    }
}
