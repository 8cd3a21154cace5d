//! The multipliers of sliding on several surfaces, as the series of the motion need them: their values at the start,
//! and the inverse of the derivatives of the equations that they solve.

use filippov_expr::{Backend, Gradient, Graph, Multipliers, NodeId};
use smallvec::SmallVec;

use super::blended::Blended;
use super::tiered::TieredProgram;
use crate::cube::invert;
use crate::tolerances::LARGEST_SERIES_BLOCK;

/// What the multipliers on a set of surfaces follow from.
pub(super) struct MultiplierEquations {
    surfaces: Vec<usize>,
    /// Groups of multipliers that do not enter the equations of one another.
    blocks: Vec<Vec<usize>>,
    /// The equations, then their derivatives, block by block, row by row.
    program: TieredProgram,
    n_outputs: usize,
}

impl MultiplierEquations {
    /// Adds the equations of sliding on `surfaces` to the graph, and the field that results, which keeps the signs
    /// of these surfaces; `None` if it is not multilinear in them, or ties too many of them together.
    pub fn new(
        graph: &mut Graph,
        field: &[NodeId],
        surfaces: &[usize],
        backend: Backend,
    ) -> Option<(Self, Vec<NodeId>, Multipliers)> {
        let blended = Blended::new(graph, field, surfaces)?;
        let zero = graph.constant(0.0);
        let mut sliding = blended.values;
        let (mut equations, mut derivatives) = (Vec::new(), Vec::new());
        for (&j, (rate, by_sign)) in surfaces.iter().zip(&blended.rates) {
            let Gradient { time, states } = graph.gradient(graph.surface(j as u32));
            // On a surface x_i = constant the state x_i stands still; computed, that would be so up to rounding.
            if let ([(i, _)], true) = (&states[..], time == zero) {
                sliding[*i as usize] = zero;
            }
            let mut row = vec![zero; surfaces.len()];
            by_sign.iter().for_each(|&(place, node)| row[place] = node);
            equations.push(*rate);
            derivatives.push(row);
        }
        let blocks = tied_together(&derivatives, zero);
        if blocks
            .iter()
            .any(|block| block.len() > LARGEST_SERIES_BLOCK)
        {
            return None;
        }
        let mut outputs = equations.clone();
        let mut input = 0..;
        let mut next = |graph: &mut Graph| graph.input(input.next().expect("there is no end"));
        let signs = surfaces.iter().map(|&j| (j as u32, next(graph))).collect();
        let mut inverse = vec![Vec::new(); surfaces.len()];
        for block in &blocks {
            for &row in block {
                outputs.extend(block.iter().map(|&column| derivatives[row][column]));
                inverse[row] = block
                    .iter()
                    .map(|&equation| (equation, next(graph)))
                    .collect();
            }
        }
        let n_outputs = outputs.len();
        let own = MultiplierEquations {
            surfaces: surfaces.to_vec(),
            blocks,
            program: TieredProgram::new(graph.clone(), outputs, backend),
            n_outputs,
        };
        let multipliers = Multipliers {
            signs,
            equations,
            inverse,
        };
        Some((own, sliding, multipliers))
    }

    /// The inputs of the series at (t, x), the multipliers being nearly those among the signs: the multipliers after
    /// a step of Newton's method, which is exact where they enter linearly, and the inverse by blocks. `None` if the
    /// equations do not determine them.
    pub fn inputs(
        &self,
        t: f64,
        x: &[f64],
        signs: &[f64],
        p: &[f64],
    ) -> Option<SmallVec<[f64; 32]>> {
        let m = self.surfaces.len();
        let mut values: SmallVec<[f64; 32]> = SmallVec::from_elem(0.0, self.n_outputs);
        self.program
            .program()
            .eval(t, x, signs, p, &[], &mut values);
        let (equations, mut rest) = values.split_at_mut(m);
        let mut lambda: SmallVec<[f64; 8]> = self.surfaces.iter().map(|&j| signs[j]).collect();
        for block in &self.blocks {
            let (matrix, after) = rest.split_at_mut(block.len() * block.len());
            if !invert(matrix, block.len()) {
                return None;
            }
            for (row, &place) in matrix.chunks_exact(block.len()).zip(block) {
                let terms = row.iter().zip(block);
                lambda[place] -= terms.map(|(entry, &k)| entry * equations[k]).sum::<f64>();
            }
            rest = after;
        }
        values[..m].copy_from_slice(&lambda);
        Some(values)
    }
}

/// Groups of rows and columns between which all entries vanish.
fn tied_together(matrix: &[Vec<NodeId>], zero: NodeId) -> Vec<Vec<usize>> {
    let m = matrix.len();
    let mut group: Vec<usize> = (0..m).collect();
    for row in 0..m {
        for column in 0..m {
            let (a, b) = (group[row], group[column]);
            if a != b && matrix[row][column] != zero {
                group.iter_mut().filter(|g| **g == b).for_each(|g| *g = a);
            }
        }
    }
    let mut blocks: Vec<Vec<usize>> = Vec::new();
    for first in 0..m {
        if group[..first].contains(&group[first]) {
            continue;
        }
        blocks.push((first..m).filter(|&k| group[k] == group[first]).collect());
    }
    blocks
}
