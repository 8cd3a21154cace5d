//! Taylor series of the change of a motion: of M' = Df M + D_p f along the motion itself.

use filippov_expr::{Backend, Graph, JetProgram, Multipliers, NodeId};
use smallvec::SmallVec;

use crate::system::{
    derivative_along, sliding_field, MultiplierEquations, Setting, Tiered, TracedSystem,
};

/// Which changes of a motion have one series.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Changes {
    /// One change, with its shares of the parameters behind it.
    Any,
    /// Two of these, and the mixed second derivative along them.
    Pair,
    /// So many at once, without their shares of the parameters: each is by one parameter, or by none.
    By(SmallVec<[Option<usize>; 4]>),
}

impl Changes {
    /// Those of columns of n states with the shares of the parameters behind them; `None` if one has shares of several.
    pub fn of(columns: &[Vec<f64>], n: usize) -> Option<Self> {
        let parameter = |column: &Vec<f64>| {
            let mut shares = column[n..]
                .iter()
                .enumerate()
                .filter(|share| *share.1 != 0.0);
            match (shares.next(), shares.next()) {
                (None, _) => Some(None),
                (Some((p, 1.0)), None) => Some(Some(p)),
                _ => None,
            }
        };
        columns
            .iter()
            .map(parameter)
            .collect::<Option<_>>()
            .map(Changes::By)
    }
}

/// The series of a motion of a traced system with those of its changes, in a region or on one surface; of pairs of changes on several
/// surfaces too.
pub(super) struct ChangeSeries {
    program: Tiered<JetProgram>,
    /// The equations of the multipliers of several surfaces, and of their changes.
    equations: Option<MultiplierEquations>,
    order: usize,
    /// How many states the extended system has.
    size: usize,
    /// How many changes there are, and how many entries each has.
    n_changes: usize,
    block: usize,
    /// How many entries of each are not shares of parameters.
    n: usize,
}

/// A place with changes behind it, and room for their coefficients.
#[derive(Default)]
pub(super) struct Carried {
    pub at: Vec<f64>,
    rows: Vec<f64>,
}

impl ChangeSeries {
    /// Of the motions on these surfaces, with n states before the parameters; `None` if there are several surfaces and no pair of
    /// changes.
    pub fn new(
        (system, n): (&TracedSystem, usize),
        sliding: &[usize],
        order: usize,
        kind: &Changes,
    ) -> Option<Self> {
        let mut graph = system.graph().clone();
        let size = system.field_nodes().len();
        let (n_changes, block) = match kind {
            Changes::Any => (1, size),
            Changes::Pair => (3, size),
            Changes::By(parameters) => (parameters.len(), n),
        };
        let (zero, one) = (graph.constant(0.0), graph.constant(1.0));
        let mut changes = Vec::with_capacity(n_changes);
        for k in 0..n_changes {
            let entries = (0..block).map(|i| graph.state((size + block * k + i) as u32));
            let mut change: Vec<NodeId> = entries.collect();
            if let Changes::By(parameters) = kind {
                change.resize(size, zero);
                parameters[k].into_iter().for_each(|p| change[n + p] = one);
            }
            changes.push(change);
        }
        let (mut equations, mut multipliers) = (None, Multipliers::default());
        let field = match (sliding, kind, &changes[..]) {
            ([], ..) => {
                let field = system.field_nodes().to_vec();
                with_changes(&mut graph, field, block, (kind, &changes))
            }
            (&[j], ..) => {
                let field = sliding_field(&mut graph, system.field_nodes(), j).0;
                with_changes(&mut graph, field, block, (kind, &changes))
            }
            (_, Changes::Pair, [a, b, mixed]) => {
                let (field, backend) = (system.field_nodes(), Backend::Native);
                let changes = [a.clone(), b.clone(), mixed.clone()];
                let made = MultiplierEquations::with_changes(
                    &mut graph, field, sliding, &changes, backend,
                )?;
                (equations, multipliers) = (Some(made.0), made.2);
                made.1
            }
            _ => return None,
        };
        let make = move |backend| compile(&graph, &field, &multipliers, order, backend);
        Some(ChangeSeries {
            program: Tiered::from(make, Backend::Native),
            equations,
            order,
            size,
            n_changes,
            block,
            n,
        })
    }

    /// How many operations it takes to carry so many changes.
    pub fn operations(&self, count: usize) -> usize {
        self.program.program().operations() * count.div_ceil(self.n_changes)
    }

    /// Is its program unrolled?
    pub fn is_unrolled(&self) -> bool {
        self.program.program().is_unrolled()
    }

    /// How many changes are carried at once.
    pub fn n_changes(&self) -> usize {
        self.n_changes
    }

    /// Takes these changes behind a place.
    pub fn take<'c>(
        &self,
        point: &[f64],
        changes: impl IntoIterator<Item = &'c [f64]>,
        carried: &mut Carried,
    ) {
        carried.at.clear();
        carried.at.extend_from_slice(point);
        for change in changes {
            carried.at.extend_from_slice(&change[..self.block]);
        }
    }

    /// The changes that are carried.
    pub fn changes<'c>(&self, carried: &'c Carried) -> impl Iterator<Item = &'c [f64]> {
        carried.at[self.size..].chunks_exact(self.block)
    }

    /// Carries changes over a time `dt` from a place, as far as the series allows and at least over `least` of it; returns the time
    /// that is left, `None` if the series is too short.
    pub fn carry(
        &self,
        (system, setting, t): (&TracedSystem, &Setting, f64),
        (rtol, least): (f64, f64),
        dt: f64,
        carried: &mut Carried,
    ) -> Option<f64> {
        let (order, width) = (self.order, self.size + self.n_changes * self.block);
        let Carried { at, rows } = carried;
        rows.resize((order + 1) * width, 0.0);
        let (program, equations) = (self.program.program(), self.equations.as_ref());
        system.eval_series(program, equations, &setting.at(t, at), rows);
        let rows = &rows[..(order + 1) * width];
        if !rows[order * width..].iter().all(|c| c.is_finite()) {
            return None;
        }
        // The two last terms are to be below the tolerance.
        let below = dt.powi(order as i32 - 1);
        let powers = [(order - 1, below), (order, below * dt)];
        let mut share = 1.0_f64;
        for block in 0..self.n_changes {
            let first = self.size + block * self.block;
            let largest = |k: usize| {
                let row = &rows[k * width + first..][..self.n];
                row.iter().fold(0.0_f64, |most, c| c.abs().max(most))
            };
            // Not the size at the end: a series that is too long for a fast motion has an end beyond all bounds.
            let mut size = largest(0);
            if size == 0.0 {
                let terms = (1..=order).map(|k| largest(k) * dt.powi(k as i32));
                size = terms.into_iter().find(|size| *size > 0.0).unwrap_or(0.0);
            }
            let bound = 0.5 * rtol * size;
            if !bound.is_finite() {
                return None;
            }
            for (k, power) in powers {
                let term = largest(k) * power;
                if term > bound {
                    share = share.min((bound / term).powf(1.0 / k as f64));
                }
            }
        }
        if share < least {
            return None;
        }
        let step = share * dt;
        for (i, entry) in at.iter_mut().enumerate().skip(self.size) {
            let coefficients = (0..=order).rev().map(|k| rows[k * width + i]);
            *entry = coefficients.fold(0.0, |sum, c| sum * step + c);
        }
        Some(dt - step)
    }
}

/// A field with the rates of changes behind it, so many of each; with those of the mixed one behind a pair.
fn with_changes(
    graph: &mut Graph,
    field: Vec<NodeId>,
    block: usize,
    (kind, changes): (&Changes, &[Vec<NodeId>]),
) -> Vec<NodeId> {
    let mut along = |values: &[NodeId], change: &[NodeId]| -> Vec<NodeId> {
        let rates = values.iter();
        rates
            .map(|&rate| derivative_along(graph, rate, change))
            .collect()
    };
    let own = changes.iter().map(|change| along(&field[..block], change));
    let mut rates: Vec<Vec<NodeId>> = own.collect();
    if let (Changes::Pair, [first, _, mixed]) = (kind, &mut rates[..]) {
        let bends = along(first, &changes[1]);
        for (rate, bend) in mixed.iter_mut().zip(bends) {
            *rate = graph.add(*rate, bend);
        }
    }
    [field, rates.concat()].concat()
}

fn compile(
    graph: &Graph,
    field: &[NodeId],
    multipliers: &Multipliers,
    order: usize,
    backend: Backend,
) -> JetProgram {
    let with =
        |backend| JetProgram::with_multipliers(graph, field, &[], multipliers, order, backend);
    with(backend)
        .or_else(|_| with(Backend::Interpreter))
        .expect("the interpreter refuses only nodes of another graph")
}
