//! What is compiled of a traced system for sliding where its field is affine in the signs.
//!
//! One program for all surfaces: the field blended over all signs, its derivatives by them, and all gradients.
//! As each derivative is free of its own sign, it serves every set of surfaces of which no two multiply each
//! other; a motion that visits many sets compiles nothing anew. Numbers that are constant are kept apart.

use std::sync::OnceLock;

use filippov_expr::{
    Backend, Enclosure, EnclosureProgram, Gradient, Graph, Motion, Node, NodeId, SignDependence,
};

use super::affine::AffineParts;
use super::tiered::TieredProgram;
use super::Place;
use crate::sparse::SparseRows;

/// A value that is a number, or computed by the program.
#[derive(Clone, Copy)]
enum Source {
    Constant(f64),
    Output(usize),
}

/// The nonzero entries of a row: state and value.
type Row = Vec<(usize, Source)>;

/// The compiled parts of all surfaces.
pub(super) struct AffineModel {
    program: TieredProgram,
    n_states: usize,
    time_rates: Vec<Source>,
    gradients: Vec<Row>,
    jumps: Vec<Row>,
    /// Surfaces of which one of these entries is computed.
    varies: Vec<bool>,
    /// Surfaces whose sign the field is multilinear in.
    is_blended: Vec<bool>,
    /// The gradient, and what the sign changes in the rates of switching functions, are the same all along every motion.
    is_steady: Vec<bool>,
    graph: Graph,
    /// dh_j/dt along the blended field, and bounds of it once they were asked for.
    rates: Vec<NodeId>,
    enclosing: Vec<OnceLock<Option<EnclosureProgram>>>,
    /// The states that it contains, once they were asked for; `None` if it contains the time.
    read_by_rate: Vec<OnceLock<Option<Vec<usize>>>>,
    /// Surfaces that may not be slid on together with this one: their signs multiply, or one is in the
    /// gradient of the other.
    conflicts: Vec<Vec<u32>>,
    /// Which signs multiply each other in the field; its values are not kept.
    coupled: SignDependence,
    /// For each surface the signs in its gradient.
    in_gradient: Vec<Vec<u32>>,
}

impl AffineModel {
    pub fn new(graph: &Graph, field: &[NodeId], backend: Backend) -> Self {
        let mut graph = graph.clone();
        let d = graph.n_surfaces();
        let all: Vec<u32> = (0..d as u32).collect();
        let dependence = graph.sign_dependence(field, &all);
        let mut outputs = dependence.values.clone();
        let mut conflicts = vec![Vec::new(); d];
        for &(j, k) in &dependence.couplings {
            conflicts[j as usize].push(k);
            conflicts[k as usize].push(j);
        }
        let (mut time_rates, mut gradients) = (Vec::new(), Vec::<Row>::new());
        let (mut rates, mut is_steady) = (Vec::new(), Vec::new());
        let mut in_gradient = Vec::new();
        for (j, conflicts) in conflicts.iter_mut().enumerate() {
            let Gradient { time, states } = graph.gradient(graph.surface(j as u32));
            let nodes: Vec<NodeId> = [time]
                .into_iter()
                .chain(states.iter().map(|s| s.1))
                .collect();
            let signs = signs_in(&graph, &nodes);
            conflicts.extend(&signs);
            in_gradient.push(signs);
            is_steady.push(!nodes[1..].iter().any(|&node| graph.depends_on_motion(node)));
            rates.push(states.iter().fold(time, |sum, &(i, partial)| {
                let term = graph.mul(partial, dependence.values[i as usize]);
                graph.add(sum, term)
            }));
            time_rates.push(source(&graph, time, &mut outputs));
            let entries = states.iter();
            let row = entries.map(|&(i, node)| (i as usize, source(&graph, node, &mut outputs)));
            gradients.push(row.collect());
        }
        // What a sign changes in other states does not come back to the rates of switching functions.
        let mut is_felt = vec![false; field.len()];
        for &(state, _) in gradients.iter().flat_map(|row: &Row| row) {
            is_felt[state] = true;
        }
        for (state, derivatives) in dependence.derivatives.iter().enumerate() {
            for &(j, node) in derivatives.iter().filter(|_| is_felt[state]) {
                is_steady[j as usize] &= !graph.depends_on_motion(node);
            }
        }
        let jumps = jumps(&graph, &dependence, d, &mut outputs);
        let mut is_blended = vec![false; d];
        for &j in &dependence.surfaces {
            is_blended[j as usize] = true;
        }
        let coupled = SignDependence {
            couplings: couplings(&graph, &dependence, &is_blended),
            ..SignDependence::default()
        };
        let is_computed = |source: &Source| matches!(source, Source::Output(_));
        let row_varies = |row: &Row| row.iter().any(|(_, source)| is_computed(source));
        let varies = (0..d).map(|j| {
            is_computed(&time_rates[j]) || row_varies(&gradients[j]) || row_varies(&jumps[j])
        });
        AffineModel {
            coupled,
            in_gradient,
            varies: varies.collect(),
            program: TieredProgram::new(graph.clone(), outputs, backend),
            read_by_rate: rates.iter().map(|_| OnceLock::new()).collect(),
            enclosing: rates.iter().map(|_| OnceLock::new()).collect(),
            rates,
            graph,
            is_steady,
            n_states: field.len(),
            time_rates,
            gradients,
            jumps,
            is_blended,
            conflicts,
        }
    }

    /// Makes parts those of these surfaces, if the field is affine in their signs together.
    pub fn refit(&self, surfaces: &[usize], parts: &mut AffineParts) -> bool {
        let mut among = vec![false; self.is_blended.len()];
        for &j in surfaces {
            among[j] = true;
        }
        let fits = |&j: &usize| {
            self.is_blended[j] && !self.conflicts[j].iter().any(|&k| among[k as usize])
        };
        if !surfaces.iter().all(fits) {
            return false;
        }
        let fill = |matrix: &mut SparseRows, rows: &[Row]| {
            let n_entries = surfaces.iter().map(|&j| rows[j].len()).sum();
            matrix.clear_for(self.n_states, (surfaces.len(), n_entries));
            for &j in surfaces {
                let pattern = rows[j].iter();
                matrix.push_row(pattern.map(|&(state, value)| match value {
                    Source::Constant(value) => (state, value),
                    Source::Output(_) => (state, 0.0),
                }));
            }
        };
        fill(&mut parts.gradients, &self.gradients);
        fill(&mut parts.jumps, &self.jumps);
        parts.refit(self.n_states, surfaces);
        let own = parts.time_rates.iter_mut().zip(surfaces);
        for (rate, &j) in own {
            if let Source::Constant(value) = self.time_rates[j] {
                *rate = value;
            }
        }
        true
    }

    /// These surfaces in groups whose signs multiply one another in the field.
    pub fn groups(&self, surfaces: &[usize]) -> Vec<Vec<usize>> {
        let bends = |&j: &usize| {
            let mut signs = self.in_gradient[j].iter();
            signs.any(|&k| surfaces.binary_search(&(k as usize)).is_ok())
        };
        if surfaces.iter().any(bends) {
            return vec![surfaces.to_vec()];
        }
        let indices: Vec<u32> = surfaces.iter().map(|&j| j as u32).collect();
        // Nothing is known of how signs that could not be blended depend on one another.
        let (mut entangled, mut groups) = (Vec::new(), Vec::new());
        for group in self.coupled.groups(&indices) {
            let group = group.into_iter().map(|j| j as usize);
            let group: Vec<usize> = group.collect();
            if group.iter().all(|&j| self.is_blended[j]) {
                groups.push(group);
            } else {
                entangled.extend(group);
            }
        }
        if !entangled.is_empty() {
            entangled.sort_unstable();
            groups.push(entangled);
        }
        groups
    }

    /// Are the gradient of h_j, and what its sign changes in the rates of switching functions, the same all along every
    /// motion?
    pub fn is_steady(&self, j: usize) -> bool {
        self.is_steady[j]
    }

    /// The states in dh_j/dt; `None` if it contains the time.
    pub fn read_by_rate(&self, j: usize) -> Option<&[usize]> {
        let read = || states_in(&self.graph, self.rates[j]);
        self.read_by_rate[j].get_or_init(read).as_deref()
    }

    /// Bounds of dh_j/dt, and of its derivative, along a piece of motion.
    pub fn enclose_rate(
        &self,
        j: usize,
        motion: &dyn Motion,
        signs: &[f64],
        parameters: &[f64],
    ) -> Option<Enclosure> {
        let compile = || EnclosureProgram::compile(&self.graph, &[self.rates[j]]).ok();
        let program = self.enclosing[j].get_or_init(compile).as_ref()?;
        let mut out = [Enclosure::UNKNOWN];
        program.eval(motion, signs, parameters, &mut out);
        Some(out[0])
    }

    /// Evaluates what varies of parts [made to fit](Self::refit); with `anew`, for parts whose jumps have been stretched, everything.
    pub fn fill(&self, place: &Place<'_>, parameters: &[f64], parts: &mut AffineParts, anew: bool) {
        let program = self.program.program();
        let mut outputs = std::mem::take(&mut parts.outputs);
        outputs.resize(program.n_outputs(), 0.0);
        program.eval(place.t, place.x, place.signs, parameters, &[], &mut outputs);
        parts.field.copy_from_slice(&outputs[..self.n_states]);
        let value = |source: Source| match source {
            Source::Constant(value) => value,
            Source::Output(k) => outputs[k],
        };
        let (mut in_gradients, mut in_jumps) = (0, 0);
        for row in 0..parts.surfaces().len() {
            let j = parts.surfaces()[row];
            if !(anew || self.varies[j]) {
                in_gradients += self.gradients[j].len();
                in_jumps += self.jumps[j].len();
                continue;
            }
            parts.time_rates[row] = value(self.time_rates[j]);
            let gradients = &mut parts.gradients.values_mut()[in_gradients..];
            for (entry, &(_, source)) in gradients.iter_mut().zip(&self.gradients[j]) {
                *entry = value(source);
            }
            in_gradients += self.gradients[j].len();
            let jumps = &mut parts.jumps.values_mut()[in_jumps..];
            for (entry, &(_, source)) in jumps.iter_mut().zip(&self.jumps[j]) {
                *entry = value(source);
            }
            in_jumps += self.jumps[j].len();
        }
        parts.outputs = outputs;
    }
}

/// The value of a node: its number, or an output more.
fn source(graph: &Graph, node: NodeId, outputs: &mut Vec<NodeId>) -> Source {
    match graph.as_constant(node) {
        Some(value) => Source::Constant(value),
        None => {
            outputs.push(node);
            Source::Output(outputs.len() - 1)
        }
    }
}

/// Pairs of signs that are multiplied, those that could not be blended included.
fn couplings(graph: &Graph, dependence: &SignDependence, is_blended: &[bool]) -> Vec<(u32, u32)> {
    let mut couplings = dependence.couplings.clone();
    if is_blended.iter().all(|&blended| blended) {
        return couplings;
    }
    for &(j, derivative) in dependence.derivatives.iter().flatten() {
        let others = signs_in(graph, &[derivative]).into_iter();
        let entangled = others.filter(|&k| !is_blended[k as usize]);
        couplings.extend(entangled.map(|k| (j, k)));
    }
    couplings.sort_unstable();
    couplings.dedup();
    couplings
}

/// For each surface the components of the field that jump there.
fn jumps(
    graph: &Graph,
    dependence: &SignDependence,
    d: usize,
    outputs: &mut Vec<NodeId>,
) -> Vec<Row> {
    let mut jumps = vec![Row::new(); d];
    for (state, derivatives) in dependence.derivatives.iter().enumerate() {
        for &(j, node) in derivatives {
            jumps[j as usize].push((state, source(graph, node, outputs)));
        }
    }
    jumps
}

/// The states that a value contains; `None` if it contains the time.
fn states_in(graph: &Graph, value: NodeId) -> Option<Vec<usize>> {
    let mut states = Vec::new();
    for id in graph.all_below(&[value]) {
        match *graph.node(id) {
            Node::State(i) => states.push(i as usize),
            Node::Time | Node::Input(_) => return None,
            _ => {}
        }
    }
    Some(states)
}

/// The surfaces whose signs these values contain.
fn signs_in(graph: &Graph, nodes: &[NodeId]) -> Vec<u32> {
    if nodes.iter().all(|&node| graph.as_constant(node).is_some()) {
        return Vec::new();
    }
    let found = graph.sign_dependencies(nodes, &[]);
    let indices = found.into_iter().enumerate().filter(|entry| entry.1);
    indices.map(|(j, _)| j as u32).collect()
}
