//! Taylor series of the change of a motion: of M' = Df M + D_p f along the motion itself.

use filippov_expr::{Backend, Graph, JetProgram, Multipliers, NodeId};

use crate::system::{
    derivative_along, sliding_field, MultiplierEquations, Place, Tiered, TracedSystem,
};

/// The series of a motion of a traced system with those of its changes, in a region or on one surface: of one change, or of two with
/// the mixed second derivative along them. Those of two exist on several surfaces too.
pub(super) struct ChangeSeries {
    program: Tiered<JetProgram>,
    /// Of the multipliers of several surfaces, and of their changes.
    equations: Option<MultiplierEquations>,
    order: usize,
    /// How many states the system has, and how many changes of these there are.
    size: usize,
    n_changes: usize,
}

/// Room for the coefficients.
#[derive(Default)]
pub(super) struct Coefficients {
    rows: Vec<f64>,
    start: Vec<f64>,
    end: Vec<f64>,
}

impl ChangeSeries {
    /// Of the motions on these surfaces; `None` if there are several surfaces and only one change.
    pub fn new(
        system: &TracedSystem,
        sliding: &[usize],
        order: usize,
        of_pairs: bool,
    ) -> Option<Self> {
        let mut graph = system.graph().clone();
        let size = system.field_nodes().len();
        let n_changes = if of_pairs { 3 } else { 1 };
        let changes: Vec<Vec<NodeId>> = (1..=n_changes)
            .map(|k| {
                let states = size * k..size * (k + 1);
                states.map(|i| graph.state(i as u32)).collect()
            })
            .collect();
        let (mut equations, mut multipliers) = (None, Multipliers::default());
        let field = match (sliding, &changes[..]) {
            ([], _) => with_changes(&mut graph, system.field_nodes().to_vec(), &changes),
            (&[j], _) => {
                let field = sliding_field(&mut graph, system.field_nodes(), j).0;
                with_changes(&mut graph, field, &changes)
            }
            (_, [a, b, mixed]) => {
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
        })
    }

    /// How many operations it takes to carry a change.
    pub fn operations(&self) -> usize {
        self.program.program().operations()
    }

    /// Carries changes, one behind the other, with n components that are not parameters, over a time `dt` from a place, as far as
    /// the series allows and at least over `least` of it; returns the time that is left, `None` if the series is too short.
    pub fn carry(
        &self,
        (system, place): (&TracedSystem, &Place),
        (n, rtol, least): (usize, f64, f64),
        dt: f64,
        changes: &mut [f64],
        room: &mut Coefficients,
    ) -> Option<f64> {
        let width = (1 + self.n_changes) * self.size;
        room.rows.resize((self.order + 1) * width, 0.0);
        room.start.clear();
        room.start.extend_from_slice(place.x);
        room.start.extend_from_slice(changes);
        let at = Place {
            x: &room.start,
            ..*place
        };
        let equations = self.equations.as_ref();
        system.eval_series(self.program.program(), equations, &at, &mut room.rows);
        if !room.rows[self.order * width..]
            .iter()
            .all(|c| c.is_finite())
        {
            return None;
        }
        // The two last terms are to be below the tolerance.
        let mut share = 1.0_f64;
        for block in 0..self.n_changes {
            let own = block * self.size..block * self.size + n;
            // Not the size at the end: a series that is too long for a fast motion has an end beyond all bounds.
            let term = |k: usize| {
                let row = &room.rows[k * width + self.size..][own.clone()];
                largest(row) * dt.powi(k as i32)
            };
            let size = (0..=self.order).map(term).find(|size| *size > 0.0);
            let bound = 0.5 * rtol * size.unwrap_or(0.0);
            if !bound.is_finite() {
                return None;
            }
            for k in [self.order - 1, self.order] {
                let term = term(k);
                if term > bound {
                    share = share.min((bound / term).powf(1.0 / k as f64));
                }
            }
        }
        if share < least {
            return None;
        }
        let step = share * dt;
        room.end.resize(changes.len(), 0.0);
        self.sum(&room.rows, step, &mut room.end);
        changes.copy_from_slice(&room.end);
        Some(dt - step)
    }

    /// The changes after this time.
    fn sum(&self, rows: &[f64], dt: f64, out: &mut [f64]) {
        out.fill(0.0);
        let width = (1 + self.n_changes) * self.size;
        for row in rows.chunks_exact(width).rev() {
            for (entry, c) in out.iter_mut().zip(&row[self.size..]) {
                *entry = *entry * dt + c;
            }
        }
    }
}

fn largest(entries: &[f64]) -> f64 {
    entries.iter().fold(0.0, |most, c| c.abs().max(most))
}

/// A field with the rates of changes behind it: of one, or of two and of the mixed one of both.
fn with_changes(graph: &mut Graph, field: Vec<NodeId>, changes: &[Vec<NodeId>]) -> Vec<NodeId> {
    let mut along = |values: &[NodeId], change: &[NodeId]| -> Vec<NodeId> {
        let rates = values.iter();
        rates
            .map(|&rate| derivative_along(graph, rate, change))
            .collect()
    };
    let mut rates: Vec<Vec<NodeId>> = changes.iter().map(|own| along(&field, own)).collect();
    if let [first, _, mixed] = &mut rates[..] {
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
