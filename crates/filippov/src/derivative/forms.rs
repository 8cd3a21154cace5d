//! Second derivatives of functions, as forms in two changes of time and state.

use filippov_expr::{Backend, ExprError, Graph, NodeId, Program};

use crate::error::FieldError;
use crate::system::{derivative_along, sides_of, Place, TracedSystem};
use crate::tolerances::EPS;
use crate::vectors::dot;

/// Mixed derivatives of the state by two columns, n entries for each pair; NaN where they are not known.
#[derive(Clone, Debug)]
pub(super) struct Second {
    pub pairs: Vec<Vec<f64>>,
}

impl Second {
    /// How many are known.
    pub fn n_known(&self) -> usize {
        self.pairs.iter().filter(|mixed| is_known(mixed)).count()
    }
}

pub(super) fn is_known(mixed: &[f64]) -> bool {
    mixed.iter().all(|value| value.is_finite())
}

/// Pairs of columns, each once, in order.
pub(super) fn pairs(n_columns: usize) -> impl Iterator<Item = (usize, usize)> + Clone {
    (0..n_columns).flat_map(|a| (0..=a).map(move |b| (a, b)))
}

/// A change of time and extended state.
#[derive(Clone)]
pub(super) struct Moved {
    pub time: f64,
    pub z: Vec<f64>,
}

impl Moved {
    /// A change of the state.
    pub fn of_state(column: &[f64]) -> Moved {
        Moved {
            time: 0.0,
            z: column.to_vec(),
        }
    }

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

/// The second derivative of functions of time and state along two changes, by differences of fourth order.
///
/// It is that of the line by the sum of the changes, less that by their difference, over four.
pub(super) fn form_by_differences(
    mut values: impl FnMut(f64, &[f64]) -> Result<Vec<f64>, FieldError>,
    (t, z): (f64, &[f64]),
    (u, v): (&Moved, &Moved),
) -> Result<Vec<f64>, FieldError> {
    let size = |by: &Moved| {
        let entries = by.z.iter().zip(z);
        let states = entries.map(|(d, z)| d.abs() / (1.0 + z.abs()));
        states.fold(by.time.abs() / (1.0 + t.abs()), f64::max)
    };
    let (of_u, of_v) = (size(u), size(v));
    let mut form = vec![0.0; values(t, z)?.len()];
    if of_u == 0.0 || of_v == 0.0 {
        return Ok(form);
    }
    let d = 2.0 * EPS.powf(1.0 / 6.0);
    for (sign, share) in [(1.0, 0.25), (-1.0, -0.25)] {
        let change = |a: f64, b: f64| a / of_u + sign * b / of_v;
        for (k, weight) in [
            (-2.0, -1.0),
            (-1.0, 16.0),
            (0.0, -30.0),
            (1.0, 16.0),
            (2.0, -1.0),
        ] {
            let entries = z.iter().zip(u.z.iter().zip(&v.z));
            let moved = entries.map(|(z, (a, b))| z + k * d * change(*a, *b));
            let moved: Vec<f64> = moved.collect();
            let found = values(t + k * d * change(u.time, v.time), &moved)?;
            add(
                &mut form,
                share * weight / (12.0 * d * d) * of_u * of_v,
                &found,
            );
        }
    }
    Ok(form)
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
    pub fn image(&self, n: usize, by: &Moved) -> Moved {
        let rows = self.rows.iter().zip(&self.by_time);
        let states = rows.map(|(row, by_time)| dot(row, &by.z) + by_time * by.time);
        Moved {
            time: by.time,
            z: states.chain(by.z[n..].iter().copied()).collect(),
        }
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
