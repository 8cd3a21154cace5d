//! Taylor series of the change of a motion: of M' = Df M + D_p f along the motion itself.

use filippov_expr::{Backend, Graph, JetProgram, Multipliers, NodeId};

use crate::system::{sliding_field, Place, Tiered, TracedSystem};

/// A series may be used for so many steps in the place of one; where it is shorter, the motion is carried on by collocation.
const MOST_STEPS: f64 = 4.0;

/// The series of a motion of a traced system with that of its change, in a region or on one surface.
pub(super) struct ChangeSeries {
    program: Tiered<JetProgram>,
    order: usize,
    /// How many states the system has.
    size: usize,
}

/// Room for the coefficients.
#[derive(Default)]
pub(super) struct Coefficients {
    rows: Vec<f64>,
    start: Vec<f64>,
}

impl ChangeSeries {
    /// Of the motions on these surfaces; `None` if there are more than one.
    pub fn new(system: &TracedSystem, sliding: &[usize], order: usize) -> Option<Self> {
        let mut graph = system.graph().clone();
        let size = system.field_nodes().len();
        let mut field = match *sliding {
            [] => system.field_nodes().to_vec(),
            [j] => sliding_field(&mut graph, system.field_nodes(), j).0,
            _ => return None,
        };
        let zero = graph.constant(0.0);
        let changes: Vec<NodeId> = (0..size).map(|i| graph.state((size + i) as u32)).collect();
        for i in 0..size {
            let gradient = graph.gradient(field[i]);
            let mut rate = zero;
            for (k, partial) in gradient.states {
                let term = graph.mul(partial, changes[k as usize]);
                rate = graph.add(rate, term);
            }
            field.push(rate);
        }
        let make = move |backend| compile(&graph, &field, order, backend);
        Some(ChangeSeries {
            program: Tiered::from(make, Backend::Native),
            order,
            size,
        })
    }

    /// How many operations it takes to carry a change.
    pub fn operations(&self) -> usize {
        self.program.program().operations()
    }

    /// Carries a change of the n first states over a time `dt` from a place, as far as the series allows; returns the time that is
    /// left, `None` if the series is too short.
    pub fn carry(
        &self,
        (system, place): (&TracedSystem, &Place),
        (n, rtol): (usize, f64),
        dt: f64,
        column: &mut [f64],
        room: &mut Coefficients,
    ) -> Option<f64> {
        let width = 2 * self.size;
        room.rows.resize((self.order + 1) * width, 0.0);
        room.start.clear();
        room.start.extend_from_slice(place.x);
        room.start.extend_from_slice(column);
        let at = Place {
            x: &room.start,
            ..*place
        };
        system.eval_series(self.program.program(), &at, &mut room.rows);
        if !room.rows[self.order * width..]
            .iter()
            .all(|c| c.is_finite())
        {
            return None;
        }
        let start = largest(&column[..n]);
        self.sum(&room.rows, dt, &mut column[..n]);
        // The two last terms are to be below the tolerance.
        let bound = 0.5 * rtol * start.max(largest(&column[..n]));
        let mut share = 1.0_f64;
        for k in [self.order - 1, self.order] {
            let term = largest(&room.rows[k * width + self.size..][..n]) * dt.powi(k as i32);
            if term > bound {
                share = share.min((bound / term).powf(1.0 / k as f64));
            }
        }
        if share * MOST_STEPS < 1.0 || !bound.is_finite() {
            return None;
        }
        let step = share * dt;
        if share < 1.0 {
            self.sum(&room.rows, step, &mut column[..n]);
        }
        Some(dt - step)
    }

    /// The change after this time.
    fn sum(&self, rows: &[f64], dt: f64, out: &mut [f64]) {
        out.fill(0.0);
        for row in rows.chunks_exact(2 * self.size).rev() {
            for (entry, c) in out.iter_mut().zip(&row[self.size..]) {
                *entry = *entry * dt + c;
            }
        }
    }
}

fn largest(entries: &[f64]) -> f64 {
    entries.iter().fold(0.0, |most, c| c.abs().max(most))
}

fn compile(graph: &Graph, field: &[NodeId], order: usize, backend: Backend) -> JetProgram {
    let none = Multipliers::default();
    let with = |backend| JetProgram::with_multipliers(graph, field, &[], &none, order, backend);
    with(backend)
        .or_else(|_| with(Backend::Interpreter))
        .expect("the interpreter refuses only nodes of another graph")
}
