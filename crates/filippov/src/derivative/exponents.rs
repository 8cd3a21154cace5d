//! The growth of small changes along a run: what Lyapunov exponents are made of.
//!
//! The derivative of the state is followed as a basis, which is made orthonormal behind every step and instant; the logarithms of the
//! lengths and heights that this takes away are summed up (Benettin et al., *Meccanica* 15 (1980) 9; P. C. Mueller, *Chaos, Solitons &
//! Fractals* 5 (1995) 1671). Sliding, contact and maps without full rank take directions from the basis: these changes are gone for
//! ever, and their exponents are minus infinity.

use super::extended::{Column, Extended};
use super::instant::Lost;
use super::orthonormal::{orthonormal, rank, Order, Orthonormal};
use super::tangents::Tangents;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::options::{Keep, Options};
use crate::record::{InstantRecord, ObservedStep, Observer};
use crate::system::Actions;
use crate::vectors::dot;

/// Sums are kept at no more times than this: of more every second one goes.
const MOST_SAMPLES: usize = 4096;

/// The growth of small changes along a run.
#[derive(Clone, Debug, Default)]
pub struct Growth {
    /// Times, the first one that from which on growth is counted.
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
/// let mut exponents = Exponents::new(&extended, &impacts, &options, (0.0, 4.0));
/// let problem = Problem::new(&system, (0.0, 4.0), &[1.0, 1.0]);
/// Integrator::new(problem)?.observed_by(&mut exponents).solve();
/// let growth = exponents.finish()?;
/// assert_eq!(growth.n_gone, 1);
/// let last = growth.sums.last().expect("there was a step");
/// assert!((last[0] + 4.0).abs() < 1e-9 && last[1] == f64::NEG_INFINITY);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Exponents<'a> {
    tangents: Tangents<'a>,
    n: usize,
    /// From this time on growth is counted.
    from: f64,
    is_counting: bool,
    /// How many directions the motion leaves.
    left: Option<usize>,
    /// The logarithms of the growth of the directions that are left.
    sums: Vec<f64>,
    /// One step of so many is kept, and how many there were since.
    stride: usize,
    since: usize,
    found: Growth,
    raised: Option<FieldError>,
}

impl<'a> Exponents<'a> {
    /// The growth in a run from its start to its end, counted from `span.0` on. Of `options` what is kept is the last state.
    pub fn new(
        extended: &'a Extended<'a>,
        impacts: &'a Actions<'a>,
        options: &'a Options,
        span: (f64, f64),
    ) -> Self {
        let n = extended.n;
        let kinds = (0..n).map(Column::State).collect();
        let tangents = Tangents::new(extended, impacts, kinds, options, span.1 - span.0);
        Exponents {
            tangents: tangents.keeping(Keep::Last),
            n,
            from: span.0,
            is_counting: false,
            left: None,
            sums: vec![0.0; n],
            stride: 1,
            since: 0,
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
        let gone = self.found.n_gone;
        for row in &mut self.found.sums {
            row.truncate(self.n - gone);
            row.resize(self.n, f64::NEG_INFINITY);
        }
        Ok(self.found)
    }

    fn follow(&mut self, step: &ObservedStep) -> Result<(), FieldError> {
        let left = match self.left {
            Some(left) => left,
            None => self.n - self.tangents.codimension(step.mode, step.discrete).min(self.n),
        };
        let is_first = self.left.replace(left).is_none();
        if is_first && step.t_start() >= self.from {
            self.start_counting(step.t_start());
        }
        self.tangents.step(step);
        self.make_orthonormal(left, is_first, step.t_end);
        self.since += 1;
        if !self.is_counting && step.t_end >= self.from {
            self.fill(left, (step.mode, step.discrete), (step.t_end, step.x_end))?;
            self.start_counting(step.t_end);
        } else if self.is_counting && self.since >= self.stride {
            self.sample(step.t_end);
        }
        Ok(())
    }

    fn pass(&mut self, record: &InstantRecord) {
        let codimension = self.tangents.codimension(record.mode[1], record.discrete[1]);
        let mut left = self.n - codimension.min(self.n);
        if let Some(map) = record.map {
            let normal = (!record.guards.is_empty()).then_some(&record.gradient.state[..]);
            left = left.min(rank_at(self.n, map, normal));
        }
        self.tangents.instant(record);
        let takes = codimension > 0 || record.map.is_some();
        self.make_orthonormal(left, takes, record.t[1]);
        // What a map takes is gone; behind it the motion may have all dimensions.
        self.left = Some(self.n - codimension.min(self.n));
        if let Some(last) = self.found.t.last_mut() {
            if self.is_counting && self.since == 0 && *last == record.t[1] {
                self.found.sums.pop();
                self.found.sums.push(self.sums.clone());
            }
        }
    }

    /// Makes the basis orthonormal. Of its directions no more than `most` are left; if something takes directions, those whose length
    /// is rounding are gone too.
    fn make_orthonormal(&mut self, most: usize, takes: bool, t: f64) {
        if let Some(lost) = self.tangents.lost() {
            self.found.lost.get_or_insert((t, lost));
            return;
        }
        let columns = self.tangents.columns();
        let given = orthonormal(columns, self.n, columns.len(), Order::Given);
        let made = match given {
            Some(made) if columns.len() <= most && !(takes && made.has_rounding()) => made,
            _ => match orthonormal(columns, self.n, most, Order::Longest) {
                Some(made) => made,
                None => return,
            },
        };
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

    /// Adds directions that were lost before, as far as the motion leaves them.
    fn fill(
        &mut self,
        left: usize,
        (mode, q): (&Mode, &[f64]),
        (t, x): (f64, &[f64]),
    ) -> Result<(), FieldError> {
        let known = self.tangents.columns().len();
        if known >= left || self.found.lost.is_some() {
            return Ok(());
        }
        let unit = |i: usize| (0..self.n).map(|r| f64::from(r == i)).collect();
        let mut units: Vec<Vec<f64>> = (0..self.n).map(unit).collect();
        self.tangents.project((mode, q), (t, x), &mut units)?;
        let columns = [self.tangents.columns(), &units].concat();
        if let Some(made) = orthonormal(&columns, self.n, left, Order::GivenThenLongest(known)) {
            self.found.n_gone = self.n - made.columns.len();
            self.tangents.replace(made.columns);
        }
        Ok(())
    }

    fn start_counting(&mut self, t: f64) {
        self.is_counting = true;
        self.sums = vec![0.0; self.n - self.found.n_gone];
        self.sample(t);
    }

    fn sample(&mut self, t: f64) {
        self.since = 0;
        if self.found.t.len() == MOST_SAMPLES {
            let mut k = 0;
            self.found.t.retain(|_| {
                k += 1;
                k % 2 == 1
            });
            k = 0;
            self.found.sums.retain(|_| {
                k += 1;
                k % 2 == 1
            });
            self.stride *= 2;
        }
        self.found.t.push(t);
        self.found.sums.push(self.sums.clone());
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
            self.pass(instant);
        }
    }
}
