//! Exact derivatives of the motions of a traced system: in a region, and sliding on any number of surfaces.

use filippov_expr::{Backend, Gradient, Graph, NodeId};

use super::blended::{Blended, BySign};
use super::tiered::TieredProgram;
use crate::sparse::SparseRows;
use crate::system::{Linearisation, Place};

/// The derivatives of the field of the motions on a set of surfaces; see [`Linearisation`].
///
/// While sliding the field is the multilinear interpolant F(t, x, s) of the fields around the surfaces, evaluated at
/// the multipliers in place of their signs, and G_i = d_t h_i + grad h_i . F.
pub struct MotionJacobian {
    program: TieredProgram,
    n_states: usize,
    /// The pattern.
    matrix: SparseRows,
    /// Entries that are numbers: their place among the values.
    constants: Vec<(usize, f64)>,
    /// Entries that are outputs of the program, in order: their place, and whether their sign is changed.
    computed: Vec<(usize, bool)>,
    /// The derivatives in time follow as outputs: F_t, then G_t.
    n_outputs: usize,
}

impl MotionJacobian {
    /// The derivatives of the motions on these surfaces; `None` if their signs cannot be blended.
    pub(super) fn new(
        graph: &Graph,
        field: &[NodeId],
        sliding: &[usize],
        backend: Backend,
    ) -> Option<MotionJacobian> {
        let mut graph = graph.clone();
        let n = field.len();
        let blended = Blended::new(&mut graph, field, sliding)?;
        let mut entries = Entries {
            matrix: SparseRows::new(n + sliding.len()),
            constants: Vec::new(),
            outputs: Vec::new(),
            computed: Vec::new(),
        };
        let mut times = Vec::with_capacity(n + sliding.len());
        let zero = graph.constant(0.0);
        for (i, (&value, by_sign)) in blended.values.iter().zip(&blended.by_sign).enumerate() {
            let Gradient { time, mut states } = graph.gradient(value);
            if let Err(place) = states.binary_search_by_key(&(i as u32), |entry| entry.0) {
                states.insert(place, (i as u32, zero));
            }
            entries.push_row(&graph, &states, (n, by_sign), true);
            times.push(time);
        }
        for (rate, by_sign) in blended.rates {
            let Gradient { time, states } = graph.gradient(rate);
            entries.push_row(&graph, &states, (n, &by_sign), false);
            times.push(time);
        }
        let mut outputs = entries.outputs;
        outputs.extend(times);
        Some(MotionJacobian {
            n_states: n,
            n_outputs: outputs.len(),
            program: TieredProgram::new(graph, outputs, backend),
            matrix: entries.matrix,
            constants: entries.constants,
            computed: entries.computed,
        })
    }

    /// Space for the derivatives.
    pub fn linearisation(&self) -> Linearisation {
        Linearisation::new(self.n_states, self.matrix.clone(), true)
    }

    /// Evaluates the derivatives; entries of `signs` on the surfaces slid on are their multipliers.
    pub(super) fn eval(&self, place: &Place<'_>, p: &[f64], out: &mut Linearisation) {
        let mut outputs = std::mem::take(&mut out.computed);
        outputs.resize(self.n_outputs, 0.0);
        let program = self.program.program();
        program.eval(place.t, place.x, place.signs, p, &[], &mut outputs);
        out.fill(|values, time| {
            for &(place, value) in &self.constants {
                values[place] = value;
            }
            let (entries, times) = outputs.split_at(self.computed.len());
            for (&(place, is_changed), value) in self.computed.iter().zip(entries) {
                values[place] = if is_changed { -value } else { *value };
            }
            for (i, (to, value)) in time.iter_mut().zip(times).enumerate() {
                *to = if i < self.n_states { *value } else { -value };
            }
        });
        out.computed = outputs;
    }
}

/// The matrix under construction.
struct Entries {
    matrix: SparseRows,
    constants: Vec<(usize, f64)>,
    outputs: Vec<NodeId>,
    computed: Vec<(usize, bool)>,
}

impl Entries {
    /// Adds a row: derivatives by the states, then by the multipliers, whose columns stand behind those of n states.
    fn push_row(
        &mut self,
        graph: &Graph,
        states: &[(u32, NodeId)],
        (n, by_sign): (usize, &BySign),
        is_changed: bool,
    ) {
        let start = self.matrix.n_entries();
        let states = states.iter().map(|&(i, node)| (i as usize, node));
        let multipliers = by_sign.iter().map(|&(k, node)| (n + k, node));
        let row: Vec<(usize, NodeId)> = states.chain(multipliers).collect();
        for (place, &(_, node)) in row.iter().enumerate() {
            let place = start + place;
            match graph.as_constant(node) {
                Some(value) => {
                    let value = if is_changed { -value } else { value };
                    self.constants.push((place, value));
                }
                None => {
                    self.outputs.push(node);
                    self.computed.push((place, is_changed));
                }
            }
        }
        self.matrix
            .push_row(row.into_iter().map(|(column, _)| (column, 0.0)));
    }
}

#[cfg(test)]
mod tests;
