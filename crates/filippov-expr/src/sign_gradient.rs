//! Derivatives by signs, of values that are multilinear in them: all at once, in one reverse sweep.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::blend::mask;
use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};

/// Derivatives by the signs of some surfaces, of values that are multilinear in them.
pub(crate) struct Sweep<'g> {
    graph: &'g mut Graph,
    is_blended: Vec<bool>,
    known: FxHashMap<NodeId, Vec<(u32, NodeId)>>,
}

impl<'g> Sweep<'g> {
    pub fn new(graph: &'g mut Graph, surfaces: &[u32]) -> Self {
        Sweep {
            graph,
            is_blended: mask(surfaces),
            known: FxHashMap::default(),
        }
    }

    /// Pairs of signs with a mixed second derivative that is not 0.
    pub fn couplings(&mut self, derivatives: &[Vec<(u32, NodeId)>]) -> Vec<(u32, u32)> {
        let mut seen = FxHashSet::default();
        let mut pairs = Vec::new();
        for &(j, derivative) in derivatives.iter().flatten() {
            if self.graph.facts(derivative).has_sign && seen.insert((j, derivative)) {
                let second = self.gradient(derivative);
                pairs.extend(second.iter().map(|&(k, _)| (j.min(k), j.max(k))));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// The derivatives of a value by all signs that it contains. As in [`Graph::gradient`], a select is
    /// differentiated by itself, so that the branch not taken has no influence.
    pub fn gradient(&mut self, of: NodeId) -> Vec<(u32, NodeId)> {
        let graph = &self.graph;
        let signed = [of].into_iter().filter(|&id| graph.facts(id).has_sign);
        let nodes = graph.reachable_by(signed, |id| graph.signed_operands(id).collect::<Vec<_>>());
        for &id in &nodes {
            if let Node::Select {
                surface,
                plus,
                minus,
            } = *self.graph.node(id)
            {
                if !self.known.contains_key(&id) {
                    let (above, below) = (self.reverse(plus), self.reverse(minus));
                    let gradient = self.select_gradient(surface, &above, &below);
                    self.known.insert(id, gradient);
                }
            }
        }
        self.reverse(of)
    }

    fn select_gradient(
        &mut self,
        surface: u32,
        above: &[(u32, NodeId)],
        below: &[(u32, NodeId)],
    ) -> Vec<(u32, NodeId)> {
        let zero = self.graph.constant(0.0);
        let mut pairs: FxHashMap<u32, (NodeId, NodeId)> = FxHashMap::default();
        for &(j, derivative) in above {
            pairs.entry(j).or_insert((zero, zero)).0 = derivative;
        }
        for &(j, derivative) in below {
            pairs.entry(j).or_insert((zero, zero)).1 = derivative;
        }
        let selected = pairs
            .into_iter()
            .map(|(j, (plus, minus))| (j, self.graph.select(surface, 1.0, plus, minus)));
        let mut gradient: Vec<_> = selected.collect();
        gradient.sort_unstable();
        gradient
    }

    /// Reverse mode down to the signs and to the selects, whose derivatives are known.
    fn reverse(&mut self, of: NodeId) -> Vec<(u32, NodeId)> {
        if let Some(known) = self.known.get(&of) {
            return known.clone();
        }
        let graph = &self.graph;
        let signed = [of].into_iter().filter(|&id| graph.facts(id).has_sign);
        let nodes = graph.reachable_by(signed, |id| match graph.node(id) {
            Node::Select { .. } => Vec::new(),
            _ => graph.signed_operands(id).collect(),
        });
        let one = self.graph.constant(1.0);
        let mut adjoints = FxHashMap::from_iter([(of, one)]);
        let mut sums: FxHashMap<u32, NodeId> = FxHashMap::default();
        for id in nodes.into_iter().rev() {
            let Some(&adjoint) = adjoints.get(&id) else {
                continue;
            };
            match *self.graph.node(id) {
                Node::Sign(j) => {
                    if self.is_blended.get(j as usize) == Some(&true) {
                        accumulate(self.graph, &mut sums, j, adjoint);
                    }
                }
                Node::Select { .. } => {
                    for (j, inner) in self.known.get(&id).cloned().unwrap_or_default() {
                        let change = self.graph.mul(adjoint, inner);
                        accumulate(self.graph, &mut sums, j, change);
                    }
                }
                node => self.pass_on(node, adjoint, &mut adjoints),
            }
        }
        let mut gradient: Vec<_> = sums
            .into_iter()
            .filter(|&(_, derivative)| self.graph.as_constant(derivative) != Some(0.0))
            .collect();
        gradient.sort_unstable();
        gradient
    }

    /// Hands the adjoint of an operation to its operands. A function of signs is one of signs that are data:
    /// blended ones stand only in sums, products and numerators.
    fn pass_on(&mut self, node: Node, adjoint: NodeId, adjoints: &mut FxHashMap<NodeId, NodeId>) {
        let graph = &mut *self.graph;
        let mut give = |graph: &mut Graph, operand: NodeId, change: NodeId| {
            if graph.facts(operand).has_sign {
                accumulate(graph, adjoints, operand, change);
            }
        };
        match node {
            Node::Unary(UnaryOp::Neg, a) => {
                let change = graph.neg(adjoint);
                give(graph, a, change);
            }
            Node::Binary(BinaryOp::Add, a, b) => {
                give(graph, a, adjoint);
                give(graph, b, adjoint);
            }
            Node::Binary(BinaryOp::Sub, a, b) => {
                give(graph, a, adjoint);
                let change = graph.neg(adjoint);
                give(graph, b, change);
            }
            Node::Binary(BinaryOp::Mul, a, b) => {
                for (operand, other) in [(a, b), (b, a)] {
                    if graph.facts(operand).has_sign {
                        let change = graph.mul(adjoint, other);
                        give(graph, operand, change);
                    }
                }
            }
            Node::Binary(BinaryOp::Div, a, b) if graph.facts(a).has_sign => {
                let change = graph.div(adjoint, b);
                give(graph, a, change);
            }
            _ => {}
        }
    }
}

fn accumulate<K: std::hash::Hash + Eq>(
    graph: &mut Graph,
    sums: &mut FxHashMap<K, NodeId>,
    key: K,
    change: NodeId,
) {
    match sums.get_mut(&key) {
        Some(sum) => *sum = graph.add(*sum, change),
        None => {
            sums.insert(key, change);
        }
    }
}
