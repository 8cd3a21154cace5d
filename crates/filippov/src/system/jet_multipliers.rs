//! The multipliers of sliding on several surfaces, as the series of the motion need them: their values at the start,
//! and the inverse of the derivatives of the equations that they solve.

use filippov_expr::{Backend, Gradient, Graph, JetProgram, Multipliers, NodeId};
use smallvec::SmallVec;

use super::blended::Blended;
use super::tiered::TieredProgram;
use super::Place;
use crate::cube::invert;
use crate::tolerances::LARGEST_SERIES_BLOCK;

/// What the multipliers on a set of surfaces follow from, and what others follow from with them.
pub(crate) struct MultiplierEquations {
    surfaces: Vec<usize>,
    /// How many unknowns there are beside the multipliers: the first inputs of the program.
    n_further: usize,
    /// Groups of unknowns that do not enter the equations of one another.
    blocks: Vec<Vec<usize>>,
    /// The equations, then their derivatives, block by block, row by row.
    program: TieredProgram,
    n_outputs: usize,
}

/// The inputs of series.
pub(crate) type SeriesInputs = SmallVec<[f64; 32]>;

impl MultiplierEquations {
    /// Adds the equations of sliding on `surfaces` to the graph, and the field that results, which keeps the signs
    /// of these surfaces; `None` if it is not multilinear in them, or ties too many of them together.
    pub fn new(
        graph: &mut Graph,
        field: &[NodeId],
        surfaces: &[usize],
        backend: Backend,
    ) -> Option<(Self, Vec<NodeId>, Multipliers)> {
        let (sliding, equations, derivatives) = sliding_on(graph, field, surfaces)?;
        let (own, multipliers) =
            MultiplierEquations::of(graph, surfaces, &[], equations, derivatives, backend)?;
        Some((own, sliding, multipliers))
    }

    /// The same with two changes of the motion and the mixed one of both, whose states are given. The field has their rates behind
    /// its own.
    pub fn with_changes(
        graph: &mut Graph,
        field: &[NodeId],
        surfaces: &[usize],
        changes: &[Vec<NodeId>; 3],
        backend: Backend,
    ) -> Option<(Self, Vec<NodeId>, Multipliers)> {
        let (sliding, equations, derivatives) = sliding_on(graph, field, surfaces)?;
        let (n, m) = (sliding.len(), surfaces.len());
        let further: Vec<NodeId> = (0..3 * m).map(|k| graph.input(k as u32)).collect();
        let all = [sliding, equations, derivatives.concat()].concat();
        let mut along = |values: &[NodeId], change: usize| {
            let own = &further[change * m..][..m];
            changes_along(graph, values, surfaces, (&changes[change], own))
        };
        let (first, second) = (along(&all, 0)?, along(&all, 1)?);
        let (mixed, bend) = (along(&all, 2)?, along(&first, 1)?);
        let mixed: Vec<NodeId> = mixed
            .into_iter()
            .zip(bend)
            .map(|(a, b)| graph.add(a, b))
            .collect();
        let orders = [all, first, second, mixed];
        let rates = orders.iter().flat_map(|values| &values[..n]).copied();
        let equations = orders.iter().flat_map(|values| &values[n..n + m]).copied();
        let zero = graph.constant(0.0);
        let entry = |of: Option<usize>, row: usize, column: usize| match of {
            Some(order) => orders[order][n + m + row * m + column],
            None => zero,
        };
        // The derivatives of the equation of each order by the unknowns of each.
        let of = [
            [Some(0), None, None, None],
            [Some(1), Some(0), None, None],
            [Some(2), None, Some(0), None],
            [Some(3), Some(2), Some(1), Some(0)],
        ];
        let rows = of.iter().flat_map(|of| (0..m).map(move |row| (of, row)));
        let derivatives = rows.map(|(of, row)| {
            let columns = of
                .iter()
                .flat_map(|of| (0..m).map(move |column| entry(*of, row, column)));
            columns.collect()
        });
        let (rates, equations) = (rates.collect(), equations.collect());
        let derivatives = derivatives.collect();
        let (own, multipliers) =
            MultiplierEquations::of(graph, surfaces, &further, equations, derivatives, backend)?;
        Some((own, rates, multipliers))
    }

    fn of(
        graph: &mut Graph,
        surfaces: &[usize],
        further: &[NodeId],
        equations: Vec<NodeId>,
        derivatives: Vec<Vec<NodeId>>,
        backend: Backend,
    ) -> Option<(Self, Multipliers)> {
        let zero = graph.constant(0.0);
        let blocks = tied_together(&derivatives, zero);
        if blocks
            .iter()
            .any(|block| block.len() > LARGEST_SERIES_BLOCK)
        {
            return None;
        }
        let mut outputs = equations.clone();
        let mut input = further.len() as u32..;
        let mut next = |graph: &mut Graph| graph.input(input.next().expect("there is no end"));
        let signs = surfaces.iter().map(|&j| graph.sign_of(j as u32));
        let unknowns: Vec<NodeId> = signs.chain(further.iter().copied()).collect();
        let unknowns: Vec<_> = unknowns
            .into_iter()
            .map(|unknown| (unknown, next(graph)))
            .collect();
        let mut inverse = vec![Vec::new(); unknowns.len()];
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
            n_further: further.len(),
            blocks,
            program: TieredProgram::new(graph.clone(), outputs, backend),
            n_outputs,
        };
        let multipliers = Multipliers {
            unknowns,
            equations,
            inverse,
        };
        Some((own, multipliers))
    }

    /// The inputs of the series at (t, x), the multipliers being nearly those among the signs: the unknowns after steps of Newton's
    /// method, and the inverse by blocks. One step is exact where the multipliers enter linearly; first changes are linear in theirs,
    /// mixed ones in their own and the products of these. `None` if the equations do not determine them.
    pub fn inputs(&self, t: f64, x: &[f64], signs: &[f64], p: &[f64]) -> Option<SeriesInputs> {
        let (m, further) = (self.surfaces.len(), self.n_further);
        let mut signs: SmallVec<[f64; 8]> = SmallVec::from_slice(signs);
        let mut all: SeriesInputs = SmallVec::from_elem(0.0, further + self.n_outputs);
        let rounds = if further == 0 { 1 } else { 3 };
        for _ in 0..rounds {
            let mut values: SeriesInputs = SmallVec::from_elem(0.0, self.n_outputs);
            let program = self.program.program();
            program.eval(t, x, &signs, p, &all[..further], &mut values);
            let (equations, mut rest) = values.split_at_mut(m + further);
            let known = self.surfaces.iter().map(|&j| signs[j]);
            let mut unknowns: SeriesInputs = known.chain(all[..further].iter().copied()).collect();
            for block in &self.blocks {
                let (matrix, after) = rest.split_at_mut(block.len() * block.len());
                if !invert(matrix, block.len()) {
                    return None;
                }
                for (row, &place) in matrix.chunks_exact(block.len()).zip(block) {
                    let terms = row.iter().zip(block);
                    unknowns[place] -= terms.map(|(entry, &k)| entry * equations[k]).sum::<f64>();
                }
                rest = after;
            }
            equations.copy_from_slice(&unknowns);
            for (&j, value) in self.surfaces.iter().zip(&unknowns) {
                signs[j] = *value;
            }
            all[..further].copy_from_slice(&unknowns[m..]);
            all[further..].copy_from_slice(&values);
        }
        Some(all)
    }

    /// Writes a series at a place, NaN if the equations do not determine the unknowns.
    pub fn eval(
        equations: Option<&Self>,
        series: &JetProgram,
        &Place { t, x, signs, .. }: &Place<'_>,
        p: &[f64],
        out: &mut [f64],
    ) {
        match equations.map(|equations| equations.inputs(t, x, signs, p)) {
            None => series.eval(t, x, signs, p, &[], out),
            Some(Some(inputs)) => series.eval(t, x, signs, p, &inputs, out),
            Some(None) => out.fill(f64::NAN),
        }
    }
}

/// The field of sliding on surfaces in their signs, the rates of these, and the derivatives of the rates by the signs; `None` if it is not
/// multilinear in them.
#[allow(clippy::type_complexity)]
fn sliding_on(
    graph: &mut Graph,
    field: &[NodeId],
    surfaces: &[usize],
) -> Option<(Vec<NodeId>, Vec<NodeId>, Vec<Vec<NodeId>>)> {
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
    Some((sliding, equations, derivatives))
}

/// The derivatives of values along a change of the states and of the multipliers on surfaces; `None` if they are not multilinear in these.
fn changes_along(
    graph: &mut Graph,
    values: &[NodeId],
    surfaces: &[usize],
    (states, multipliers): (&[NodeId], &[NodeId]),
) -> Option<Vec<NodeId>> {
    let signs: Vec<u32> = surfaces.iter().map(|&j| j as u32).collect();
    let dependence = graph.sign_dependence(values, &signs);
    if dependence.surfaces != signs {
        return None;
    }
    let pairs = dependence.values.iter().zip(&dependence.derivatives);
    let along = pairs.map(|(&value, by_sign)| {
        let mut sum = derivative_along(graph, value, states);
        for (j, derivative) in by_sign {
            let Ok(place) = signs.binary_search(j) else {
                continue;
            };
            let term = graph.mul(*derivative, multipliers[place]);
            sum = graph.add(sum, term);
        }
        sum
    });
    Some(along.collect())
}

/// The derivative of a value along a change of the states.
pub(crate) fn derivative_along(graph: &mut Graph, value: NodeId, change: &[NodeId]) -> NodeId {
    let gradient = graph.gradient(value);
    let mut sum = graph.constant(0.0);
    for (k, partial) in gradient.states {
        if let Some(&own) = change.get(k as usize) {
            let term = graph.mul(partial, own);
            sum = graph.add(sum, term);
        }
    }
    sum
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
