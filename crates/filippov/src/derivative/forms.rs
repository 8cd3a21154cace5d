//! Second derivatives of functions, as forms in two changes of time and state.

use filippov_expr::{Backend, ExprError, Graph, NodeId, Program};

use crate::system::{derivative_along, sides_of, Place, TracedSystem};
use crate::vectors::dot;

/// Mixed derivatives of the state by two columns, n entries for each pair.
#[derive(Clone, Debug)]
pub(super) struct Second {
    pub pairs: Vec<Vec<f64>>,
}

/// Pairs of columns, each once, in order.
pub(super) fn pairs(n_columns: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n_columns).flat_map(|a| (0..=a).map(move |b| (a, b)))
}

/// A change of time and extended state.
#[derive(Clone)]
pub(super) struct Moved {
    pub time: f64,
    pub z: Vec<f64>,
}

impl Moved {
    /// With a multiple of a motion with these rates.
    pub fn plus(&self, factor: f64, rates: &[f64]) -> Moved {
        let mut z = self.z.clone();
        add(&mut z, factor, rates);
        Moved {
            time: self.time + factor,
            z,
        }
    }
}

/// The second derivative of functions, as a form in two changes of time and state.
pub(super) struct Form {
    program: Program,
    n_values: usize,
}

impl Form {
    /// Of some nodes of a graph with so many states.
    pub fn new(graph: &Graph, nodes: &[NodeId], size: usize) -> Result<Self, ExprError> {
        let mut graph = graph.clone();
        let mut form = nodes.to_vec();
        for first in [size, 2 * size + 1] {
            let along: Vec<NodeId> = (first..=first + size)
                .map(|i| graph.state(i as u32))
                .collect();
            let own = form.iter().map(|&node| {
                let by_time = graph.gradient(node).time;
                let sum = graph.mul(by_time, along[size]);
                let by_state = derivative_along(&mut graph, node, &along[..size]);
                graph.add(sum, by_state)
            });
            form = own.collect();
        }
        Ok(Form {
            program: Program::compile(&graph, &form, Backend::Interpreter)?,
            n_values: nodes.len(),
        })
    }

    /// At a place, along two changes.
    pub fn at(&self, system: &TracedSystem, place: &Place, u: &Moved, v: &Moved) -> Vec<f64> {
        let all = [place.x, &u.z, &[u.time], &v.z, &[v.time]].concat();
        let mut out = vec![0.0; self.n_values];
        let at = Place { x: &all, ..*place };
        system.eval(&self.program, &at, &[], &mut out);
        out
    }
}

/// The first and second derivative of the map of an action at a point.
pub(super) struct MapAt<'m> {
    pub rows: Vec<Vec<f64>>,
    pub by_time: Vec<f64>,
    pub form: &'m Form,
    pub system: &'m TracedSystem,
    pub t: f64,
    /// The state with the parameters behind it.
    pub inputs: Vec<f64>,
    pub n: usize,
}

impl MapAt<'_> {
    /// The change of the extended state behind.
    pub fn image(&self, n: usize, by: &Moved) -> Vec<f64> {
        let rows = self.rows.iter().zip(&self.by_time);
        let states = rows.map(|(row, by_time)| dot(row, &by.z) + by_time * by.time);
        states.chain(by.z[n..].iter().copied()).collect()
    }

    /// The mixed derivative behind, from that before, that of the time, and both changes.
    pub fn second_image(&self, q: &[f64], tau: f64, u: &Moved, v: &Moved) -> Vec<f64> {
        let none: &[f64] = &[];
        let Ok(signs) = sides_of(self.system, (self.t, &self.inputs), none) else {
            return vec![f64::NAN; self.n];
        };
        let place = Place::new(self.t, &self.inputs, &signs);
        let bend = self.form.at(self.system, &place, u, v);
        let rows = self.rows.iter().zip(&self.by_time).zip(&bend);
        rows.map(|((row, by_time), bend)| dot(&row[..self.n], q) + by_time * tau + bend)
            .collect()
    }
}

/// Adds a multiple of a row.
pub(super) fn add(to: &mut [f64], factor: f64, row: &[f64]) {
    let entries = to.iter_mut().zip(row);
    entries.for_each(|(entry, value)| *entry += factor * value);
}
