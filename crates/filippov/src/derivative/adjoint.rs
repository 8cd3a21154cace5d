//! Gradients of costs of a run, from its end back to its start.
//!
//! The gradient w of the cost by the state solves w' = -Df^T w between instants, and at an instant it is multiplied by the transposed
//! saltation matrix. What the parameters have in it is collected on the way. The path is that of the continuous extension of the run;
//! steps are taken back by the transpose of the equations that carry changes forward, so that the product of w with a change is the
//! same at all times, to rounding.

use std::cell::RefCell;

use super::between::state_at;
use super::borders::{
    differ, is_missed_later, map_has_sides, starts_at_threshold, stays_at_end, surfaces_at_action,
    surfaces_at_start, surfaces_landed_on, ticks_at_start, Borders, Kept,
};
use super::change::Row;
use super::event_gradient::EventGradient;
use super::extended::{Column, Extended};
use super::forms::add;
use super::instant::{arrival, brought_by, Instant, Lost, Passage};
use super::limit::{is_like, Shares, MOST_REMEMBERED};
use super::piece::{Piece, Surroundings};
use super::weights::Weights;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::options::Options;
use crate::record::{InstantRecord, KeptInstant, ObservedStep, Observer, Side, Solution};
use crate::system::{Actions, TracedSystem};
use crate::vectors::dot;

/// The instants of a run, or of a stretch of it, and the times of its steps, for the way back. An observer.
#[derive(Clone, Debug, Default)]
pub struct Trail {
    start: Option<Start>,
    /// The ends of the steps, and how many instants were before.
    steps: Vec<(f64, usize)>,
    instants: Vec<KeptInstant>,
    /// The first so many of them are from before the stretch: limits of infinitely many switches ask for them.
    n_earlier: usize,
    /// How many instants the run had before the first of them.
    n_forgotten: usize,
    /// The side of each surface on which the motion was last before the stretch, 0 if it was on none since the start of the run.
    sides: Vec<i8>,
    /// So many discrete states are states here.
    n_named: usize,
    /// How many bytes steps and instants take, without spare room.
    n_bytes: usize,
    /// Nothing is noted down any more.
    is_closed: bool,
}

#[derive(Clone, Debug)]
struct Start {
    t: f64,
    x: Vec<f64>,
    mode: Mode,
    q: Vec<f64>,
}

impl Trail {
    /// The mode and the discrete states at the start of the run.
    pub fn first(&self) -> Option<(&Mode, &[f64])> {
        let start = self.start.as_ref()?;
        Some((&start.mode, &start.q))
    }

    /// The instants of the run.
    pub fn instants(&self) -> impl Iterator<Item = InstantRecord<'_>> {
        self.instants.iter().map(KeptInstant::record)
    }

    /// Of a run of an extended system.
    pub fn of(extended: &Extended) -> Self {
        Trail {
            n_named: extended.n_named,
            ..Trail::default()
        }
    }

    /// How many bytes steps and instants take.
    pub fn n_bytes(&self) -> usize {
        self.n_bytes
    }

    /// How many bytes more the instants from before a stretch may take.
    pub fn room_for_earlier(&self) -> usize {
        let largest = self.instants.iter().map(KeptInstant::n_bytes).max();
        largest.unwrap_or(0) * (MOST_REMEMBERED - self.n_earlier)
    }

    /// The time at its start; NaN if the run has not started.
    pub fn t_start(&self) -> f64 {
        self.start.as_ref().map_or(f64::NAN, |start| start.t)
    }

    /// Was the record of the run too large?
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Forgets all and notes nothing down any more.
    pub fn close(&mut self) {
        *self = Trail {
            n_named: self.n_named,
            is_closed: true,
            ..Trail::default()
        };
    }

    /// The trail of the stretch that follows, which starts here.
    pub fn next(&self, (t, x): (f64, &[f64]), mode: &Mode, q: &[f64]) -> Self {
        let n_kept = self.instants.len().min(MOST_REMEMBERED);
        let forgotten = self.instants.len() - n_kept;
        let mut sides = self.sides.clone();
        let own = self.instants[self.n_earlier..].iter();
        let modes = own.map(|instant| instant.record().mode[0]);
        for mode in self.start.iter().map(|start| &start.mode).chain(modes) {
            sides.resize(mode.entries().len(), 0);
            take_sides(&mut sides, mode.entries());
        }
        let mut next = Trail {
            instants: self.instants[forgotten..].to_vec(),
            n_earlier: n_kept,
            n_forgotten: self.n_forgotten + forgotten,
            sides,
            n_named: self.n_named,
            ..Trail::default()
        };
        next.n_bytes = next.instants.iter().map(KeptInstant::n_bytes).sum();
        next.begin(t, x, mode, q);
        next
    }

    fn begin(&mut self, t: f64, x: &[f64], mode: &Mode, q: &[f64]) {
        self.start.get_or_insert_with(|| Start {
            t,
            x: [x, &q[..self.n_named]].concat(),
            mode: mode.clone(),
            q: q.to_vec(),
        });
    }
}

impl Observer for Trail {
    fn step(&mut self, step: &ObservedStep) {
        if self.is_closed {
            return;
        }
        if self.start.is_none() {
            let mut x = vec![0.0; step.x_end.len()];
            step.at(step.t_start(), &mut x);
            self.begin(step.t_start(), &x, step.mode, step.discrete);
        }
        self.steps.push((step.t_end, self.instants.len()));
        self.n_bytes += size_of::<(f64, usize)>();
    }

    fn instant(&mut self, record: &InstantRecord) {
        if self.is_closed {
            return;
        }
        self.begin(record.t[0], record.x[0], record.mode[0], record.discrete[0]);
        let kept = KeptInstant::with_discrete_as_states(record, self.n_named);
        self.n_bytes += kept.n_bytes();
        self.instants.push(kept);
    }
}

/// A trail that is read while the run goes on.
impl Observer for &RefCell<Trail> {
    fn step(&mut self, step: &ObservedStep) {
        self.borrow_mut().step(step);
    }

    fn instant(&mut self, record: &InstantRecord) {
        self.borrow_mut().instant(record);
    }
}

/// Why a term has no gradient.
const TOUCHES: &str = "the function whose zero it is touches zero, and does not pass it";
const READS_MULTIPLIERS: &str = "the cost reads signs of surfaces that the motion slides on";

/// A term of a cost: a function of time, state and parameters at one or more instants.
pub struct Term<'c> {
    /// The function.
    pub cost: &'c EventGradient,
    /// When it counts.
    pub at: When<'c>,
}

/// The instants at which a term of a cost counts: the state is that before, but for the end.
#[derive(Clone, Copy)]
pub enum When<'c> {
    /// At the end of the run, and at the zero of a function if the run ends there.
    End(Option<&'c EventGradient>),
    /// At a time that does not depend on anything.
    Time(f64),
    /// At a zero of a function of time, state and parameters, at this time.
    Zero(f64, &'c EventGradient),
    /// At every instant at which a guard of this surface ends a motion.
    Surface(usize),
}

/// The gradient of a cost by the start, the initial time and the parameters.
#[derive(Clone, Debug)]
pub struct CostGradient {
    by_state: Vec<f64>,
    by_parameters: Vec<f64>,
    by_start: f64,
    /// The time of an instant at which there is no derivative: the gradient is NaN.
    pub lost: Option<(f64, &'static str)>,
    /// Where it is that of one side.
    pub borders: Borders,
    /// Where terms at instants count, by the place of the term, the last instant of each first.
    pub points: Vec<TermPoint>,
}

/// Where a term of a cost counts: the state is that before the instant.
#[derive(Clone, Debug)]
pub struct TermPoint {
    /// The place of the term.
    pub term: usize,
    /// The time.
    pub t: f64,
    /// The state, the named discrete states behind it.
    pub x: Vec<f64>,
    /// The value of the term; NaN if it is not known.
    pub value: f64,
    /// The term is at a jump or a kink of its own there, and its gradient is that of one side.
    pub has_sides: bool,
}

impl CostGradient {
    /// The entry of a column.
    pub fn by(&self, column: Column) -> f64 {
        match column {
            Column::State(i) => self.by_state[i],
            Column::Start => self.by_start,
            Column::Parameter(p) => self.by_parameters[p],
        }
    }
}

/// What gradients of a run need, beside its record.
pub struct WayBack<'r> {
    /// The system, and its extension by the parameters.
    pub systems: (&'r TracedSystem, &'r Extended<'r>),
    /// The impacts of the extended system.
    pub impacts: &'r Actions<'r>,
    /// By what the gradient is asked for.
    pub kinds: &'r [Column],
    /// The options of the run.
    pub options: &'r Options,
    /// The span of time that was asked for.
    pub t_span: (f64, f64),
}

/// The record of a run, or of a stretch of it: continuous extensions, and instants.
pub struct Stretch<'s> {
    /// The run, kept as a function.
    pub solution: &'s Solution,
    /// Its instants.
    pub trail: &'s Trail,
    /// The run starts with it.
    pub is_first: bool,
}

/// The gradient on its way back.
pub struct Walk<'w> {
    run: &'w WayBack<'w>,
    terms: &'w [Term<'w>],
    /// By the state, with the shares of the parameters behind it.
    w: Vec<f64>,
    /// Those at times, with their places, that are still to come.
    timed: Vec<(f64, usize)>,
    /// The motion that has been reached.
    piece: Option<Piece<'w>>,
    /// The last time of the run, and the state then.
    t_last: f64,
    x_last: Vec<f64>,
    /// What the limits of infinitely many switches owe to earlier instants.
    owed: Vec<Shares>,
    borders: Borders,
    points: Vec<TermPoint>,
    /// The time of the instant that was passed last, and its derivative by the state before it.
    behind: Option<(f64, Row)>,
    /// What the time of the last instant of the run adds, if the run ends with that.
    ends_with: f64,
    /// From where on there is no derivative.
    lost: Option<(f64, &'static str)>,
}

impl WayBack<'_> {
    /// The gradient of a sum of terms, of a run that was kept as a whole.
    ///
    /// # Errors
    /// What a function of the user raised.
    pub fn gradient(
        &self,
        (solution, trail): (&Solution, &Trail),
        terms: &[Term],
    ) -> Result<CostGradient, FieldError> {
        let mut walk = Walk::new(self, terms);
        let whole = Stretch {
            solution,
            trail,
            is_first: true,
        };
        walk.back(&whole)?;
        walk.finish(trail)
    }

    /// The surfaces, among those that the run stays on from its start, whose sides begin to differ where they are not yet left.
    fn begin_to_differ(
        &self,
        stays_on: &[usize],
        trail: &Trail,
        mut around: Surroundings,
        (t_last, x_last): (f64, &[f64]),
    ) -> Result<Vec<usize>, FieldError> {
        let (mut kept, mut found) = (Kept::moved_off(stays_on), Vec::new());
        let first = trail.start.as_ref();
        let mut last = first.map(|start| (&start.mode, &start.q[..]));
        for instant in &trail.instants {
            let record = instant.record();
            let mut piece = Piece::new(&around, record.mode[0], record.discrete[0]);
            let z = piece.extended.state(record.x[0]);
            kept = still_kept(kept, &piece, (record.t[0], &z), &mut found)?;
            for one in &mut kept {
                found.extend(one.bends_what_vanishes(&mut piece, &record)?);
            }
            around.take_sides(record.mode[0]);
            last = Some((record.mode[1], record.discrete[1]));
        }
        if let Some((mode, q)) = last.filter(|_| !kept.is_empty()) {
            let piece = Piece::new(&around, mode, q);
            let z = piece.extended.state(x_last);
            still_kept(kept, &piece, (t_last, &z), &mut found)?;
        }
        Ok(found)
    }
}

/// Those that a run still stays on; the surfaces of those whose sides begin to differ are put to `found`.
fn still_kept(
    kept: Vec<Kept>,
    piece: &Piece,
    (t, z): (f64, &[f64]),
    found: &mut Vec<usize>,
) -> Result<Vec<Kept>, FieldError> {
    let mut still = Vec::new();
    for mut one in kept {
        if one.holds(piece, t, z)? {
            found.extend(one.begins_to_differ(piece, (t, z))?);
            still.push(one);
        }
    }
    Ok(still)
}

impl<'w> Walk<'w> {
    /// At the end of the run.
    pub fn new(run: &'w WayBack<'w>, terms: &'w [Term<'w>]) -> Self {
        let mut timed: Vec<(f64, usize)> = Vec::new();
        for (place, term) in terms.iter().enumerate() {
            if let When::Time(t) | When::Zero(t, _) = term.at {
                timed.push((t, place));
            }
        }
        timed.sort_by(|a, b| a.0.total_cmp(&b.0));
        let extended = run.systems.1;
        Walk {
            run,
            terms,
            w: vec![0.0; extended.n + extended.n_parameters()],
            timed,
            piece: None,
            t_last: f64::NAN,
            x_last: Vec::new(),
            owed: Vec::new(),
            borders: Borders::default(),
            points: Vec::new(),
            behind: None,
            ends_with: 0.0,
            lost: None,
        }
    }

    /// The gradient, at the start of the run, whose first stretch has this trail.
    ///
    /// # Errors
    /// What a function of the user raised.
    pub fn finish(mut self, trail: &Trail) -> Result<CostGradient, FieldError> {
        let WayBack { impacts, .. } = *self.run;
        let (extended, options, kinds) = (self.run.systems.1, self.run.options, self.run.kinds);
        let n = extended.n;
        let mut found = CostGradient {
            by_parameters: self.w.split_off(n),
            by_state: self.w,
            by_start: f64::NAN,
            lost: self.lost,
            borders: self.borders,
            points: self.points,
        };
        if let (None, Some(start)) = (found.lost, &trail.start) {
            let mut around = Surroundings::at_start(extended, impacts, options);
            around.take_sides(&start.mode);
            let mut piece = Piece::new(&around, &start.mode, &start.q);
            if piece.is_unsupported() {
                found.lost = Some((start.t, Lost::Unsupported.name()));
            }
            let z = extended.state(&start.x);
            let field = piece.rates(start.t, &z)?;
            let columns = extended.columns_at_start(kinds, &field);
            let mut arrived = columns.clone();
            if let Some(arrival) = arrival(&piece, start.t, &z)? {
                brought_by(&arrival, n, &mut arrived);
                let mut whole = [&found.by_state[..], &found.by_parameters].concat();
                arrival.pull_back(n, &mut whole);
                found.by_parameters = whole.split_off(n);
                found.by_state = whole;
            }
            let borders = &mut found.borders;
            let at = (start.t, &z[..]);
            let stays_on;
            (borders.starts_on, stays_on) = surfaces_at_start(&mut piece, at, kinds, &columns)?;
            if stays_at_end(&mut piece, at, &arrived)? {
                borders.stays_at_end = Some(start.t);
            }
            borders.starts_at_threshold = starts_at_threshold(&piece, at, kinds)?;
            borders.starts_at_tick = ticks_at_start(&around, &mut piece, at, kinds)?;
            let end = (self.t_last, &self.x_last[..]);
            let later = self.run.begin_to_differ(&stays_on, trail, around, end)?;
            borders.starts_on.extend(later);
            found.by_start = -dot(&found.by_state, &field);
        }
        if found.lost.is_some() {
            found.by_state.fill(f64::NAN);
            found.by_parameters.fill(f64::NAN);
            found.by_start = f64::NAN;
        }
        Ok(found)
    }

    /// From the end of a stretch to its start. The first one is that in which the run ends, then each that comes before.
    ///
    /// # Errors
    /// What a function of the user raised.
    pub fn back(&mut self, stretch: &Stretch) -> Result<(), FieldError> {
        let trail = stretch.trail;
        let Some(start) = &trail.start else {
            return Ok(());
        };
        let pieces = self.surroundings(trail);
        let around = |number: usize| &pieces[number - trail.n_earlier];
        let mut piece = match self.piece.take() {
            Some(piece) => piece,
            None => self.at_end(stretch, start, around(trail.instants.len()))?,
        };
        let mut steps = trail.steps.iter().rev().peekable();
        for number in (trail.n_earlier..=trail.instants.len()).rev() {
            let earlier = number.checked_sub(1).filter(|&k| k >= trail.n_earlier);
            let record = earlier.map(|earlier| trail.instants[earlier].record());
            let first = record.map_or(start.t, |record| record.t[1]);
            while let Some(&(end, _)) = steps.next_if(|step| step.1 == number) {
                let before = steps.peek().map_or(start.t, |step| step.0);
                let span = (before.max(first), end);
                self.step(stretch.solution, &mut piece, span)?;
            }
            let (Some(earlier), Some(record)) = (earlier, record) else {
                if stretch.is_first {
                    self.terms_at(stretch.solution, &mut piece, start.t)?;
                }
                break;
            };
            let mut before = Piece::new(around(earlier), record.mode[0], record.discrete[0]);
            self.note_points(&record, &mut before)?;
            if self.lost.is_none() {
                let both = (&mut before, &mut piece);
                let lost = self.pass((trail, earlier), &record, around(earlier), both)?;
                self.lost = lost.map(|lost| (record.t[0], lost));
            }
            piece = before;
        }
        self.piece = Some(piece);
        Ok(())
    }

    /// The motion at the end of the run, with the terms there.
    fn at_end(
        &mut self,
        stretch: &Stretch,
        start: &Start,
        around: &Surroundings<'w>,
    ) -> Result<Piece<'w>, FieldError> {
        let last = stretch.trail.instants.last().map(KeptInstant::record);
        let (mode, q) = last.map_or((&start.mode, &start.q[..]), |record| {
            (record.mode[1], record.discrete[1])
        });
        let mut piece = Piece::new(around, mode, q);
        let extended = self.run.systems.1;
        let x = extended.with_named(stretch.solution.last_state(), q);
        self.t_last = stretch.solution.t_last;
        self.x_last = x.to_vec();
        let end = (self.t_last, &x[..]);
        for (place, term) in self.terms.iter().enumerate() {
            if let When::End(zero) = term.at {
                self.add_term(&mut piece, (place, zero), end, last)?;
            }
        }
        Ok(piece)
    }

    /// Notes down where terms of a surface count, if this instant is brought about by one; `before` is the motion before.
    fn note_points(
        &mut self,
        record: &InstantRecord,
        before: &mut Piece,
    ) -> Result<(), FieldError> {
        let z = self.run.systems.1.state(record.x[0]);
        for (term, _) in self.at_surfaces(record) {
            let (t, x) = (record.t[0], record.x[0].to_vec());
            let slopes = self.terms[term].cost.on(before, (t, &z))?;
            let value = slopes.map_or(f64::NAN, |slopes| slopes.value);
            self.points.push(TermPoint {
                term,
                t,
                x,
                value,
                has_sides: false,
            });
        }
        Ok(())
    }

    /// The surroundings of the pieces, in order.
    fn surroundings(&self, trail: &Trail) -> Vec<Surroundings<'w>> {
        let run = self.run;
        let mut around = Surroundings::at_start(run.systems.1, run.impacts, run.options);
        take_sides(&mut around.sides, &trail.sides);
        if let Some(start) = &trail.start {
            around.take_sides(&start.mode);
        }
        let mut all = vec![around.clone()];
        for instant in &trail.instants[trail.n_earlier..] {
            let record = instant.record();
            around.take_sides(record.mode[0]);
            all.push(around.clone());
        }
        all
    }

    /// Takes the gradient back over a step, and adds the terms in it.
    fn step(
        &mut self,
        solution: &Solution,
        piece: &mut Piece,
        (begin, end): (f64, f64),
    ) -> Result<(), FieldError> {
        let mut at = end;
        loop {
            self.terms_at(solution, piece, at)?;
            let next = self.timed.last().map_or(begin, |term| term.0.max(begin));
            if at <= begin {
                return Ok(());
            }
            let run = self.run;
            let path = |t: f64, x: &mut [f64]| {
                // The continuous extension of this step, also at its end, which rounding may go beyond.
                let t = t.min(end);
                let side = if t >= end { Side::Left } else { Side::Right };
                state_at(solution, run.systems, (t, side), x)
            };
            if self.lost.is_none() {
                let mut x = vec![0.0; run.systems.1.n];
                path(at, &mut x)?;
                let z = run.systems.1.state(&x);
                if let Some(projection) = piece.projection(&[], at, &z)? {
                    projection.pull_back(run.systems.1.n, &mut self.w);
                }
                piece.pull_back(path, (next, at), &mut self.w)?;
            }
            at = next;
            if at <= begin {
                return Ok(());
            }
        }
    }

    /// Adds the terms at a time and later, of the motion before.
    fn terms_at(
        &mut self,
        solution: &Solution,
        piece: &mut Piece,
        t: f64,
    ) -> Result<(), FieldError> {
        while let Some((t, place)) = self.timed.pop_if(|term| term.0 >= t) {
            let (run, term) = (self.run, &self.terms[place]);
            let mut x = vec![0.0; run.systems.1.n];
            state_at(solution, run.systems, (t, Side::Left), &mut x)?;
            let zero = match term.at {
                When::Zero(_, function) => Some(function),
                _ => None,
            };
            self.add_term(piece, (place, zero), (t, &x), None)?;
        }
        Ok(())
    }

    /// Adds a term at a point, and at the zero of a function if that is given; `before` is the instant at which the motion began.
    fn add_term(
        &mut self,
        piece: &mut Piece,
        (place, zero): (usize, Option<&EventGradient>),
        (t, x): (f64, &[f64]),
        before: Option<InstantRecord>,
    ) -> Result<(), FieldError> {
        let extended = self.run.systems.1;
        let z = extended.state(x);
        let cost = self.terms[place].cost;
        let slopes = cost.on(piece, (t, &z))?;
        // At a zero of a function the cost may have its sides by that function.
        let has_sides = zero.is_none() && cost.has_sides(piece, (t, &z), &self.weights())?;
        self.points.push(TermPoint {
            term: place,
            t,
            x: x.to_vec(),
            value: slopes.as_ref().map_or(f64::NAN, |slopes| slopes.value),
            has_sides,
        });
        if self.lost.is_some() {
            return Ok(());
        }
        let Some(slopes) = slopes else {
            self.lost = Some((t, READS_MULTIPLIERS));
            return Ok(());
        };
        add(&mut self.w, 1.0, &slopes.gradient);
        let Some(function) = zero else {
            return Ok(());
        };
        let field = piece.rates(t, &z)?;
        let moved = slopes.time + dot(&slopes.gradient[..extended.n], &field);
        let zero = function.at_zero(piece, (t, &z))?;
        match &self.behind {
            // Where the function jumps with an instant of the run, it is zero when that comes.
            Some((instant, by)) if zero.is_brought_by(*instant) => add(&mut self.w, moved, by),
            _ if before.is_some_and(|instant| zero.is_brought_by(instant.t[0])) => {
                self.ends_with += moved;
            }
            _ => {
                let weights = self.weights();
                if function.touches(piece, (t, &z), &zero, &weights)? {
                    self.lost = Some((t, TOUCHES));
                }
                add(&mut self.w, -moved / zero.rate, &zero.gradient);
            }
        }
        Ok(())
    }

    /// By what time and states are measured.
    fn weights(&self) -> Weights {
        let (start, end) = self.run.t_span;
        Weights::new(start, end - start, self.run.options)
    }

    /// Takes the gradient back through an instant.
    fn pass<'p>(
        &mut self,
        (trail, place): (&Trail, usize),
        record: &InstantRecord,
        around: &Surroundings<'p>,
        (before, after): (&mut Piece<'p>, &mut Piece<'p>),
    ) -> Result<Option<&'static str>, FieldError> {
        let extended = before.extended;
        let n = extended.n;
        let weights = self.weights();
        if record.replaces {
            return Ok(Some("accumulation"));
        }
        let is_limit = record.t[0] != record.t[1];
        let mut instant = Instant {
            extended,
            around,
            record,
            before,
            after,
        };
        let time = if is_limit {
            match instant.time(&weights, &mut 0.0)? {
                Ok(time) => time,
                Err(lost) => return Ok(Some(lost.name())),
            }
        } else {
            match instant.through(&weights, &mut 0.0)? {
                Ok(passages) => {
                    self.land(record, (instant.before, instant.after), &passages)?;
                    self.pull_back(record, &passages, n)
                }
                Err(lost) => return Ok(Some(lost.name())),
            }
        };
        if is_limit {
            let z = extended.state(record.x[1]);
            if let Some(projection) = instant.after.projection(&[], record.t[1], &z)? {
                projection.pull_back(n, &mut self.w);
            }
            let Some(shares) = self.shares(trail, place, record) else {
                return Ok(Some("accumulation"));
            };
            self.w[..n].fill(0.0);
            self.owed.extend(shares);
        }
        add(&mut self.w, std::mem::take(&mut self.ends_with), &time);
        for owed in std::mem::take(&mut self.owed) {
            if owed.instant != trail.n_forgotten + place {
                self.owed.push(owed);
                continue;
            }
            add(&mut self.w[..n], 1.0, &owed.by_state);
            let moved = dot(&owed.by_state, record.field[0]) + owed.by_time;
            add(&mut self.w, moved, &time);
        }
        for (place, guard) in self.at_surfaces(record) {
            let z = extended.state(record.x[0]);
            let cost = self.terms[place].cost;
            let Some(slopes) = cost.on(instant.before, (record.t[0], &z))? else {
                return Ok(Some(READS_MULTIPLIERS));
            };
            add(&mut self.w, 1.0, &slopes.gradient);
            let moved = slopes.time + dot(&slopes.gradient[..n], record.field[0]);
            match guard {
                0 => add(&mut self.w, moved, &time),
                _ => add(&mut self.w, moved, &instant.time_of(record.guards[guard])?),
            }
        }
        self.behind = Some((record.t[0], time));
        let is_finite = self.w.iter().all(|value| value.is_finite());
        Ok((!is_finite).then_some("not_finite"))
    }

    /// The places of the terms that count at an instant since surfaces bring it about, and of the guards of these.
    fn at_surfaces<'r>(
        &self,
        record: &'r InstantRecord,
    ) -> impl Iterator<Item = (usize, usize)> + use<'r, 'w> {
        let guards = record.guards;
        self.terms
            .iter()
            .enumerate()
            .filter_map(move |(place, term)| {
                let When::Surface(j) = term.at else {
                    return None;
                };
                let guard = guards.iter().position(|guard| guard.surface() == Some(j))?;
                Some((place, guard))
            })
    }

    /// Notes on which surfaces the state is before and behind actions, and whether a multiplier stays at its end behind an instant, for
    /// changes of the state before it and of what is asked for.
    fn land(
        &mut self,
        record: &InstantRecord,
        (before, after): (&mut Piece, &mut Piece),
        passages: &[Passage],
    ) -> Result<(), FieldError> {
        let extended = after.extended;
        let Some(last) = passages.last() else {
            return Ok(());
        };
        let states = (0..extended.n).map(Column::State);
        let others = self.run.kinds.iter().copied();
        let parameters = others.filter(|kind| matches!(kind, Column::Parameter(_)));
        let kinds: Vec<Column> = states.chain(parameters).collect();
        let mut columns = extended.columns_at_start(&kinds, &[]);
        // A changed run is on the surfaces slid on too.
        before.project(record.t[0], &extended.state(record.x[0]), &mut columns)?;
        let columns_before = columns.clone();
        let dt: Vec<f64> = columns.iter().map(|c| dot(&last.time, c)).collect();
        let mut arrives = false;
        for passage in passages {
            arrives |= !passage.apply(extended.n, &mut columns).is_empty();
        }
        let z = extended.state(record.x[1]);
        if stays_at_end(after, (record.t[1], &z), &columns)? {
            self.borders.stays_at_end = Some(record.t[1]);
        }
        if record.acts.is_empty() {
            return Ok(());
        }
        self.borders.ends_at_instant |= arrives && record.t[1] == self.t_last;
        if map_has_sides(extended, record, &dt, &columns_before, &self.weights())? {
            self.borders.acts_at_sides = Some(record.t[1]);
        }
        let mut landed = surfaces_landed_on(after, record, &dt, &columns, arrives)?;
        if landed.is_empty() {
            landed = surfaces_at_action(before, record, &dt, &columns_before)?;
        }
        if !landed.is_empty() {
            self.borders.lands_on = Some((record.t[1], landed));
        }
        Ok(())
    }

    /// Takes the gradient back through what happens at an instant; returns the derivative of the time of the guard.
    fn pull_back(&mut self, record: &InstantRecord, passages: &[Passage], n: usize) -> Row {
        let after = self.w.clone();
        let mut is_timed = false;
        for passage in passages.iter().rev() {
            for change in passage.changes.iter().rev() {
                change.pull_back(n, &mut self.w);
            }
            is_timed |= passage.time.iter().any(|entry| *entry != 0.0);
        }
        if is_timed && record.t[1] == self.t_last {
            self.borders.ends_at_instant |= differ(&after, &self.w);
        }
        let start = self.run.t_span.0;
        self.borders.starts_at_action |=
            is_missed_later(self.run.systems.1, record, start, self.run.kinds);
        let guarded = passages.last();
        guarded.map_or_else(Row::new, |passage| passage.time.clone())
    }

    /// What the limit of infinitely many switches takes from the instants before, of which as many count as on the way forward.
    fn shares(&self, trail: &Trail, place: usize, record: &InstantRecord) -> Option<[Shares; 3]> {
        let instants = &trail.instants[..=place];
        let like = |k: usize| is_like(&instants[k].record(), record);
        let mut rounds = 1..=place.min(MOST_REMEMBERED - 1) / 2;
        let round = rounds.find(|r| like(place - r) && like(place - 2 * r))?;
        let all = [place, place - round, place - 2 * round];
        let numbers = all.map(|k| trail.n_forgotten + k);
        Shares::of(
            numbers,
            all.map(|k| instants[k].record()),
            &self.w[..record.x[1].len()],
        )
    }
}

/// Takes those that are not 0.
fn take_sides(sides: &mut [i8], entries: &[i8]) {
    let pairs = sides.iter_mut().zip(entries);
    pairs
        .filter(|(_, entry)| **entry != 0)
        .for_each(|(side, entry)| *side = *entry);
}
