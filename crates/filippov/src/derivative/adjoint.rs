//! Gradients of costs of a run, from its end back to its start.
//!
//! The gradient w of the cost by the state solves w' = -Df^T w between instants, and at an instant it is multiplied by the transposed
//! saltation matrix. What the parameters have in it is collected on the way. The path is that of the continuous extension of the run;
//! steps are taken back by the transpose of the equations that carry changes forward, so that the product of w with a change is the
//! same at all times, to rounding.

use super::between::{state_at, EventGradient};
use super::borders::{
    differ, is_missed_later, surfaces_at_start, surfaces_landed_on, ticks_at_start, Borders,
};
use super::change::Row;
use super::extended::{Column, Extended};
use super::forms::add;
use super::instant::{arrival, Instant, Passage, Weights};
use super::limit::{is_like, Shares};
use super::piece::{Piece, Surroundings};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::options::Options;
use crate::record::{InstantRecord, KeptInstant, ObservedStep, Observer, Side, Solution};
use crate::system::{Actions, TracedSystem};
use crate::vectors::dot;

/// The instants of a run and the times of its steps, for the way back. An observer.
#[derive(Clone, Debug, Default)]
pub struct Trail {
    start: Option<Start>,
    /// The ends of the steps, and how many instants were before.
    steps: Vec<(f64, usize)>,
    instants: Vec<KeptInstant>,
    /// So many discrete states are states here.
    n_named: usize,
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
        if self.start.is_none() {
            let mut x = vec![0.0; step.x_end.len()];
            step.at(step.t_start(), &mut x);
            self.begin(step.t_start(), &x, step.mode, step.discrete);
        }
        self.steps.push((step.t_end, self.instants.len()));
    }

    fn instant(&mut self, record: &InstantRecord) {
        self.begin(record.t[0], record.x[0], record.mode[0], record.discrete[0]);
        let kept = KeptInstant::with_discrete_as_states(record, self.n_named);
        self.instants.push(kept);
    }
}

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

/// A run, with what its gradients need.
pub struct WayBack<'r> {
    /// The run, kept as a function.
    pub solution: &'r Solution,
    /// Its instants.
    pub trail: &'r Trail,
    /// The system, and its extension by the parameters.
    pub systems: (&'r TracedSystem, &'r Extended<'r>),
    /// By what the gradient is asked for.
    pub kinds: &'r [Column],
    /// The options of the run.
    pub options: &'r Options,
    /// The length of its span of time.
    pub span: f64,
}

/// The gradient on its way back.
struct Walk<'w> {
    run: &'w WayBack<'w>,
    /// By the state, with the shares of the parameters behind it.
    w: Vec<f64>,
    terms: Vec<(f64, &'w Term<'w>)>,
    /// What the limits of infinitely many switches owe to earlier instants.
    owed: Vec<Shares>,
    borders: Borders,
}

impl WayBack<'_> {
    /// The gradient of a sum of terms.
    ///
    /// # Errors
    /// What a function of the user raised.
    pub fn gradient<'t>(&'t self, terms: &'t [Term<'t>]) -> Result<CostGradient, FieldError> {
        let extended = self.systems.1;
        let (n, m) = (extended.n, extended.n_parameters());
        let mut timed: Vec<(f64, &Term)> = Vec::new();
        for term in terms {
            if let When::Time(t) | When::Zero(t, _) = term.at {
                timed.push((t, term));
            }
        }
        timed.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut walk = Walk {
            run: self,
            w: vec![0.0; n + m],
            terms: timed,
            owed: Vec::new(),
            borders: Borders::default(),
        };
        let impacts = extended.impacts();
        let lost = walk.back(terms, &impacts)?;
        let mut found = CostGradient {
            by_parameters: walk.w.split_off(n),
            by_state: walk.w,
            by_start: f64::NAN,
            lost,
            borders: walk.borders,
        };
        if found.lost.is_some() {
            found.by_state.fill(f64::NAN);
            found.by_parameters.fill(f64::NAN);
        } else if let Some(start) = &self.trail.start {
            let mut around = Surroundings::at_start(extended, &impacts, self.options);
            around.take_sides(&start.mode);
            let mut piece = Piece::new(&around, &start.mode, &start.q);
            let z = extended.state(&start.x);
            let field = piece.rates(start.t, &z)?;
            let columns = extended.columns_at_start(self.kinds, &field);
            if let Some(arrival) = arrival(&piece, start.t, &z)? {
                let mut whole = [&found.by_state[..], &found.by_parameters].concat();
                arrival.pull_back(n, &mut whole);
                found.by_parameters = whole.split_off(n);
                found.by_state = whole;
            }
            let borders = &mut found.borders;
            let at = (start.t, &z[..]);
            borders.starts_on = surfaces_at_start(&mut piece, at, self.kinds, &columns)?;
            borders.starts_at_tick = ticks_at_start(&around, &mut piece, at, self.kinds)?;
            found.by_start = -dot(&found.by_state, &field);
        }
        Ok(found)
    }
}

impl<'w> Walk<'w> {
    /// From the end to the start; where it was lost, if it was.
    fn back(
        &mut self,
        terms: &[Term],
        impacts: &Actions,
    ) -> Result<Option<(f64, &'static str)>, FieldError> {
        let trail = self.run.trail;
        let Some(start) = &trail.start else {
            return Ok(None);
        };
        let pieces = self.surroundings(impacts);
        let mut steps = trail.steps.iter().rev().peekable();
        let last = trail.instants.last().map(KeptInstant::record);
        let (mode, q) = last.map_or((&start.mode, &start.q[..]), |record| {
            (record.mode[1], record.discrete[1])
        });
        let mut piece = Piece::new(&pieces[trail.instants.len()], mode, q);
        let x = self
            .run
            .systems
            .1
            .with_named(self.run.solution.last_state(), q);
        let end = (self.run.solution.t_last, &x[..]);
        for term in terms {
            if let When::End(zero) = term.at {
                self.add_term(&mut piece, (term.cost, zero), end)?;
            }
        }
        for number in (0..=trail.instants.len()).rev() {
            let earlier = number.checked_sub(1);
            let record = earlier.map(|earlier| trail.instants[earlier].record());
            let first = record.map_or(start.t, |record| record.t[1]);
            while let Some(&(end, _)) = steps.next_if(|step| step.1 == number) {
                let before = steps.peek().map_or(start.t, |step| step.0);
                self.step(&mut piece, (before.max(first), end))?;
            }
            let (Some(earlier), Some(record)) = (earlier, record) else {
                self.terms_at(&mut piece, start.t)?;
                break;
            };
            let mut before = Piece::new(&pieces[earlier], record.mode[0], record.discrete[0]);
            let both = (&mut before, &mut piece);
            if let Some(lost) = self.pass(earlier, &record, &pieces[earlier], both, terms)? {
                return Ok(Some((record.t[0], lost)));
            }
            piece = before;
        }
        Ok(None)
    }

    /// The surroundings of the pieces, in order.
    fn surroundings<'s>(&self, impacts: &'s Actions<'s>) -> Vec<Surroundings<'s>>
    where
        'w: 's,
    {
        let run = self.run;
        let mut around = Surroundings::at_start(run.systems.1, impacts, run.options);
        if let Some(start) = &run.trail.start {
            around.take_sides(&start.mode);
        }
        let mut all = vec![around.clone()];
        for instant in &run.trail.instants {
            let record = instant.record();
            around.take_sides(record.mode[0]);
            all.push(around.clone());
        }
        all
    }

    /// Takes the gradient back over a step, and adds the terms in it.
    fn step(&mut self, piece: &mut Piece, (begin, end): (f64, f64)) -> Result<(), FieldError> {
        let mut at = end;
        loop {
            self.terms_at(piece, at)?;
            let next = self.terms.last().map_or(begin, |term| term.0.max(begin));
            if at <= begin {
                return Ok(());
            }
            let run = self.run;
            let path = |t: f64, x: &mut [f64]| {
                // The continuous extension of this step, also at its end.
                let side = if t >= end { Side::Left } else { Side::Right };
                state_at(run.solution, run.systems, (t, side), x)
            };
            let mut x = vec![0.0; run.systems.1.n];
            path(at, &mut x)?;
            let z = run.systems.1.state(&x);
            if let Some(projection) = piece.projection(&[], at, &z)? {
                projection.pull_back(run.systems.1.n, &mut self.w);
            }
            piece.pull_back(path, (next, at), &mut self.w)?;
            at = next;
            if at <= begin {
                return Ok(());
            }
        }
    }

    /// Adds the terms at a time and later, of the motion before.
    fn terms_at(&mut self, piece: &mut Piece, t: f64) -> Result<(), FieldError> {
        while let Some((at, term)) = self.terms.pop_if(|term| term.0 >= t) {
            let run = self.run;
            let mut x = vec![0.0; run.systems.1.n];
            state_at(run.solution, run.systems, (at, Side::Left), &mut x)?;
            let zero = match term.at {
                When::Zero(_, function) => Some(function),
                _ => None,
            };
            self.add_term(piece, (term.cost, zero), (at, &x))?;
        }
        Ok(())
    }

    /// Adds a function at a point, and at the zero of another one if that is given.
    fn add_term(
        &mut self,
        piece: &mut Piece,
        (cost, zero): (&EventGradient, Option<&EventGradient>),
        (t, x): (f64, &[f64]),
    ) -> Result<(), FieldError> {
        let extended = self.run.systems.1;
        let z = extended.state(x);
        let (by_time, gradient) = cost.at(t, &z, &piece.q)?;
        add(&mut self.w, 1.0, &gradient);
        if let Some(function) = zero {
            let field = piece.rates(t, &z)?;
            let (time, normal) = function.at(t, &z, &piece.q)?;
            let rate = time + dot(&normal, &field);
            let moved = by_time + dot(&gradient[..extended.n], &field);
            add(&mut self.w, -moved / rate, &normal);
        }
        Ok(())
    }

    /// Takes the gradient back through an instant.
    fn pass<'p>(
        &mut self,
        number: usize,
        record: &InstantRecord,
        around: &Surroundings<'p>,
        (before, after): (&mut Piece<'p>, &mut Piece<'p>),
        terms: &[Term],
    ) -> Result<Option<&'static str>, FieldError> {
        let extended = before.extended;
        let n = extended.n;
        let options = self.run.options;
        let weights = Weights {
            span: self.run.span,
            rtol: options.rtol,
            atol: options.atol.clone(),
        };
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
                    self.land(record, instant.after, &passages)?;
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
            let Some(shares) = self.shares(number, record) else {
                return Ok(Some("accumulation"));
            };
            self.w[..n].fill(0.0);
            self.owed.extend(shares);
        }
        for owed in std::mem::take(&mut self.owed) {
            if owed.instant != number {
                self.owed.push(owed);
                continue;
            }
            add(&mut self.w[..n], 1.0, &owed.by_state);
            let moved = dot(&owed.by_state, record.field[0]) + owed.by_time;
            add(&mut self.w, moved, &time);
        }
        for term in terms {
            let surface = record.guards.first().and_then(|guard| guard.surface());
            if matches!(term.at, When::Surface(j) if surface == Some(j)) {
                let z = extended.state(record.x[0]);
                let (by_time, gradient) = term.cost.at(record.t[0], &z, record.discrete[0])?;
                add(&mut self.w, 1.0, &gradient);
                let moved = by_time + dot(&gradient[..n], record.field[0]);
                add(&mut self.w, moved, &time);
            }
        }
        let is_finite = self.w.iter().all(|value| value.is_finite());
        Ok((!is_finite).then_some("not_finite"))
    }

    /// Notes on which surfaces actions put the state, for changes of the state before them and of what is asked for.
    fn land(
        &mut self,
        record: &InstantRecord,
        after: &mut Piece,
        passages: &[Passage],
    ) -> Result<(), FieldError> {
        let extended = after.extended;
        let Some(last) = passages.last().filter(|_| !record.acts.is_empty()) else {
            return Ok(());
        };
        let states = (0..extended.n).map(Column::State);
        let others = self.run.kinds.iter().copied();
        let parameters = others.filter(|kind| matches!(kind, Column::Parameter(_)));
        let kinds: Vec<Column> = states.chain(parameters).collect();
        let mut columns = extended.columns_at_start(&kinds, &[]);
        let dt: Vec<f64> = columns.iter().map(|c| dot(&last.time, c)).collect();
        let mut arrives = false;
        for passage in passages {
            arrives |= passage.apply(extended.n, &mut columns);
        }
        self.borders.ends_at_instant |= arrives && record.t[1] == self.run.solution.t_last;
        let landed = surfaces_landed_on(after, record, &dt, &columns, arrives)?;
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
        if is_timed && record.t[1] == self.run.solution.t_last {
            self.borders.ends_at_instant |= differ(&after, &self.w);
        }
        let start = self
            .run
            .trail
            .start
            .as_ref()
            .map_or(record.t[0], |start| start.t);
        self.borders.starts_at_action |=
            is_missed_later(self.run.systems.1, record, start, self.run.kinds);
        let guarded = passages.last();
        guarded.map_or_else(Row::new, |passage| passage.time.clone())
    }

    /// What the limit of infinitely many switches takes from the instants before.
    fn shares(&self, number: usize, record: &InstantRecord) -> Option<[Shares; 3]> {
        let instants = &self.run.trail.instants[..=number];
        let like = |k: usize| is_like(&instants[k].record(), record);
        let round = (1..=number / 2).find(|r| like(number - r) && like(number - 2 * r))?;
        let of = |k: usize| instants[k].record();
        let all = [number, number - round, number - 2 * round];
        Shares::of(all, all.map(of), &self.w[..record.x[1].len()])
    }
}
