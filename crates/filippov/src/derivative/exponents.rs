//! The growth of small changes along a run: what Lyapunov exponents are made of.
//!
//! The derivative of the state is followed as a basis, which is made orthonormal behind every step and instant; the logarithms of the
//! lengths and heights that this takes away are summed up (Benettin et al., *Meccanica* 15 (1980) 9; P. C. Mueller, *Chaos, Solitons &
//! Fractals* 5 (1995) 1671). Sliding, contact and maps without full rank take directions from the basis: these changes are gone for
//! ever, and their exponents are minus infinity.

use super::extended::{Column, Extended};
use super::instant::Lost;
use super::orthonormal::{orthonormal, rank, Choice, Orthonormal};
use super::tangents::Tangents;
use crate::error::FieldError;
use crate::options::{Keep, Options};
use crate::record::{InstantRecord, ObservedStep, Observer};
use crate::system::Actions;
use crate::vectors::dot;

/// The growth of small changes along a run.
#[derive(Clone, Debug, Default)]
pub struct Growth {
    /// The times asked for as far as the run came, and the last one if it ended before the last of them.
    pub t: Vec<f64>,
    /// At each of them, for every direction of the basis the logarithm of the growth since the first time; minus infinity for
    /// directions that are gone by the end. They are the last ones.
    pub sums: Vec<Vec<f64>>,
    /// How many directions are gone by the end.
    pub n_gone: usize,
    /// From when on the derivative is not known, and why.
    pub lost: Option<(f64, Lost)>,
}

/// Follows the growth of small changes along a run.
///
/// # Example
///
/// ```
/// use filippov::derivative::{Exponents, Extension};
/// use filippov_expr::{Backend, Graph, Names};
/// use filippov::{Integrator, Options, Problem, Rules, TracedSystem};
///
/// // x' = -x, y' = -sign(y): the second state slides from t = 1 on.
/// let mut graph = Graph::new();
/// let (x, y) = (graph.state(0), graph.state(1));
/// let sign = graph.sign(y);
/// let field = vec![graph.neg(x), graph.neg(sign)];
/// let system = TracedSystem::new(graph, field, Vec::new(), Names::default(), Backend::Interpreter)?;
///
/// let none = filippov::action::Actions::none();
/// let extension = Extension::new(&system, &Rules::default(), &[])?;
/// let extended = extension.at(&[], &none)?.expect("no map is called");
/// let impacts = extended.impacts();
/// let options = Options::default();
/// let mut exponents = Exponents::new(&extended, &impacts, &options, &[0.0, 4.0]);
/// let problem = Problem::new(&system, (0.0, 4.0), &[1.0, 1.0]);
/// Integrator::new(problem)?.observed_by(&mut exponents).solve();
/// let growth = exponents.finish()?;
/// assert_eq!(growth.n_gone, 1);
/// let last = growth.sums.last().expect("there was a step");
/// assert!((last[0] + 4.0).abs() < 1e-3 && last[1] == f64::NEG_INFINITY);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Exponents<'a> {
    tangents: Tangents<'a>,
    n: usize,
    /// The times at which the sums are kept, the next one last.
    marks: Vec<f64>,
    is_counting: bool,
    /// How many directions the motion leaves; not known before the first step.
    left: Option<usize>,
    /// The logarithms of the growth of the directions that are left.
    sums: Vec<f64>,
    t: f64,
    found: Growth,
    raised: Option<FieldError>,
}

impl<'a> Exponents<'a> {
    /// The growth in a run, counted from the first of these times on and kept at each of them.
    pub fn new(
        extended: &'a Extended<'a>,
        impacts: &'a Actions<'a>,
        options: &'a Options,
        marks: &[f64],
    ) -> Self {
        let n = extended.n;
        let kinds = (0..n).map(Column::State).collect();
        let tangents = Tangents::new(extended, impacts, kinds, options, 1.0);
        Exponents {
            tangents: tangents.keeping(Keep::Last),
            n,
            marks: marks.iter().rev().copied().collect(),
            is_counting: false,
            left: None,
            sums: vec![0.0; n],
            t: f64::NAN,
            found: Growth::default(),
            raised: None,
        }
    }

    /// What was found.
    ///
    /// # Errors
    /// What a function of the user raised.
    pub fn finish(mut self) -> Result<Growth, FieldError> {
        if let Some(raised) = self.raised {
            return Err(raised);
        }
        self.tangents.finish()?;
        if self.found.t.last().is_some_and(|t| *t < self.t) && !self.marks.is_empty() {
            self.found.t.push(self.t);
            self.found.sums.push(self.sums);
        }
        let gone = self.found.n_gone;
        for row in &mut self.found.sums {
            row.truncate(self.n - gone);
            row.resize(self.n, f64::NEG_INFINITY);
        }
        Ok(self.found)
    }

    fn follow(&mut self, step: &ObservedStep) -> Result<(), FieldError> {
        let is_first = self.left.is_none();
        let left = match self.left {
            Some(left) => left,
            None => {
                self.n
                    - self
                        .tangents
                        .codimension(step.mode, step.discrete)
                        .min(self.n)
            }
        };
        self.left = Some(left);
        let mut t = step.t_start();
        if is_first {
            self.tangents.begin(step)?;
            self.make_orthonormal(left, left < self.n, t);
        }
        let mut x = vec![0.0; self.n];
        while let Some(&mark) = self.marks.last().filter(|mark| **mark <= step.t_end) {
            if mark > t {
                step.at(mark, &mut x);
                self.advance(step, (t, mark), &x)?;
                t = mark;
            }
            self.marks.pop();
            if !self.is_counting {
                let end = if mark == step.t_end { step.x_end } else { &x };
                self.start_counting(step, t, end)?;
            }
            self.found.t.push(t);
            self.found.sums.push(self.sums.clone());
        }
        if t < step.t_end {
            self.advance(step, (t, step.t_end), step.x_end)?;
        }
        Ok(())
    }

    /// Follows the growth over a part of a step.
    fn advance(
        &mut self,
        step: &ObservedStep,
        (t0, t1): (f64, f64),
        x_end: &[f64],
    ) -> Result<(), FieldError> {
        self.tangents.follow_part(step, (t0, t1), x_end)?;
        let left = self.left.unwrap_or(self.n);
        self.make_orthonormal(left, false, t1);
        Ok(())
    }

    /// Sets the sums to zero, and adds directions that were lost before, as far as the motion leaves them.
    fn start_counting(&mut self, step: &ObservedStep, t: f64, x: &[f64]) -> Result<(), FieldError> {
        self.is_counting = true;
        let known = self.tangents.columns().len();
        let left = self.left.unwrap_or(self.n);
        if known < left && self.found.lost.is_none() {
            let unit = |i: usize| (0..self.n).map(|r| f64::from(u8::from(r == i))).collect();
            let mut units: Vec<Vec<f64>> = (0..self.n).map(unit).collect();
            self.tangents
                .project((step.mode, step.discrete), (t, x), &mut units)?;
            let columns = [self.tangents.columns(), &units].concat();
            let choice = Choice {
                in_order: known,
                most: left,
                size: Some(1.0),
            };
            let made = orthonormal(&columns, self.n, choice);
            self.found.n_gone = self.n - made.columns.len();
            self.tangents.replace(made.columns);
        }
        self.sums = vec![0.0; self.n - self.found.n_gone];
        Ok(())
    }

    fn pass(&mut self, record: &InstantRecord) -> Result<(), FieldError> {
        let [before, after] = [0, 1].map(|k| {
            let found = self
                .tangents
                .codimension(record.mode[k], record.discrete[k]);
            found.min(self.n)
        });
        if self.left.is_none() {
            // What is done at the start comes after it.
            let is_at_start = |mark: &mut f64| *mark <= record.t[0];
            if let Some(mark) = self.marks.pop_if(is_at_start) {
                self.is_counting = true;
                self.found.t.push(mark);
                self.found.sums.push(self.sums.clone());
            }
        }
        self.left.get_or_insert(self.n - before);
        let mut left = self.n - after;
        if let Some(map) = record.map {
            let normal = (!record.guards.is_empty()).then_some(&record.gradient.state[..]);
            left = left.min(rank_at(self.n, map, normal));
        }
        self.tangents.pass(record)?;
        let takes = before > 0 || left < self.n;
        self.make_orthonormal(left, takes, record.t[1]);
        // What a map takes is gone; behind it the motion may have all dimensions.
        self.left = Some(self.n - after);
        Ok(())
    }

    /// Makes the basis orthonormal. Of its directions no more than `most` are left; if something takes directions, those whose length
    /// is rounding are gone too.
    fn make_orthonormal(&mut self, most: usize, takes: bool, t: f64) {
        if let Some(lost) = self.tangents.lost() {
            self.found.lost.get_or_insert((t, lost));
            return;
        }
        self.t = t;
        let columns = self.tangents.columns();
        let choice = Choice {
            in_order: columns.len(),
            most,
            // Before what takes directions the columns had length 1.
            size: takes.then_some(1.0),
        };
        let made = orthonormal(columns, self.n, choice);
        self.take(made);
    }

    fn take(&mut self, made: Orthonormal) {
        let count = made.order.len();
        if count < self.sums.len() {
            let order = &made.order;
            for row in &mut self.found.sums {
                *row = order.iter().map(|&k| row[k]).collect();
            }
        }
        let sums = made.order.iter().zip(&made.lengths);
        self.sums = sums.map(|(&k, r)| self.sums[k] + r.ln()).collect();
        self.found.n_gone = self.n - count;
        self.tangents.change(made.columns, &made.change);
    }
}

/// How many directions a map with these rows leaves, if its time is fixed by a guard with this gradient: what moves along the guard
/// goes through the map, and what moves across it becomes a delay.
fn rank_at(n: usize, map: &[f64], normal: Option<&[f64]>) -> usize {
    let size = map.iter().fold(0.0, |size: f64, v| size.max(v.abs()));
    let square = normal.map_or(0.0, |normal| dot(normal, normal));
    let Some(normal) = normal.filter(|_| square > 0.0) else {
        return rank(map, n, size);
    };
    let mut along = map.to_vec();
    for row in along.chunks_exact_mut(n) {
        let product = dot(row, normal);
        let entries = row.iter_mut().zip(normal);
        entries.for_each(|(entry, v)| *entry -= product * v / square);
    }
    (rank(&along, n, size) + 1).min(n)
}

impl Observer for Exponents<'_> {
    fn step(&mut self, step: &ObservedStep) {
        if self.raised.is_none() && self.found.lost.is_none() {
            self.raised = self.follow(step).err();
        }
    }

    fn instant(&mut self, instant: &InstantRecord) {
        if self.raised.is_none() && self.found.lost.is_none() {
            self.raised = self.pass(instant).err();
        }
    }
}
