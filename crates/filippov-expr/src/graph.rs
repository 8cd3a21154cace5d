//! The expression graph: nodes kept once each, in an order in which operands come first.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::derivative::DerivativeCache;
use crate::node::{Facts, Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::switching::SurfaceTable;

/// A graph of expressions in t, x, p and the signs s, with every node kept once (hash-consing).
///
/// Construction simplifies what is exact or safe: constants are folded, `x + 0`, `1 * x`, `x - x`, `s * s`
/// and the like disappear, small integer powers become products. `0 * x` is 0 and `x / x` is 1 also where x
/// is not finite. Sums are never reordered, so a traced function agrees with the original to a few ulp.
///
/// Operands always have smaller numbers than the nodes that use them: a loop over the numbers is a
/// topological order, and no algorithm here recurses, however deep the expression.
///
/// Methods that take a [`NodeId`] panic if it is not of this graph ([`Graph::contains`]).
#[derive(Debug, Clone, Default)]
pub struct Graph {
    pub(crate) nodes: Vec<Node>,
    pub(crate) facts: Vec<Facts>,
    pub(crate) ids: FxHashMap<Node, NodeId>,
    /// Shared by copies, most of which add no surfaces.
    pub(crate) surfaces: Arc<SurfaceTable>,
    pub(crate) derivatives: DerivativeCache,
    /// Expressions that are known not to be negative, by what the signs and discrete states in them are.
    pub(crate) not_negative: Vec<NodeId>,
}

impl Graph {
    /// Creates an empty graph.
    pub fn new() -> Self {
        Self::default()
    }

    /// The node of a number.
    ///
    /// # Panics
    /// If `id` is not of this graph.
    pub fn node(&self, id: NodeId) -> &Node {
        &self.nodes[id.index()]
    }

    /// Whether `id` is the number of a node of this graph.
    pub fn contains(&self, id: NodeId) -> bool {
        id.index() < self.nodes.len()
    }

    /// How many nodes there are.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there are no nodes yet.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// A number. All NaN are one node.
    pub fn constant(&mut self, value: f64) -> NodeId {
        self.insert(Node::Constant(if value.is_nan() {
            f64::NAN
        } else {
            value
        }))
    }

    /// The time t.
    pub fn time(&mut self) -> NodeId {
        self.insert(Node::Time)
    }

    /// The state variable x_`index`.
    pub fn state(&mut self, index: u32) -> NodeId {
        self.insert(Node::State(index))
    }

    /// The parameter p_`index`.
    pub fn parameter(&mut self, index: u32) -> NodeId {
        self.insert(Node::Parameter(index))
    }

    /// Component `index` of the extra vector v handed in at evaluation, e.g. the direction of a directional
    /// derivative `h_t + grad h . v`. Derivatives treat it as constant.
    pub fn input(&mut self, index: u32) -> NodeId {
        self.insert(Node::Input(index))
    }

    /// The sign s_`surface`, which is data in {-1, +1}; see [`Graph::sign`] for the sign of an expression.
    pub fn sign_of(&mut self, surface: u32) -> NodeId {
        self.insert(Node::Sign(surface))
    }

    /// `a + b`.
    pub fn add(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.binary(BinaryOp::Add, a, b)
    }

    /// `a - b`.
    pub fn sub(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.binary(BinaryOp::Sub, a, b)
    }

    /// `a * b`.
    pub fn mul(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.binary(BinaryOp::Mul, a, b)
    }

    /// `a / b`.
    pub fn div(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.binary(BinaryOp::Div, a, b)
    }

    /// `a ** b`; see [`BinaryOp::Pow`].
    pub fn pow(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.binary(BinaryOp::Pow, a, b)
    }

    /// `-a`.
    pub fn neg(&mut self, a: NodeId) -> NodeId {
        self.unary(UnaryOp::Neg, a)
    }

    /// The value of a node that is a number, else `None`.
    pub fn as_constant(&self, id: NodeId) -> Option<f64> {
        match *self.node(id) {
            Node::Constant(value) => Some(value),
            _ => None,
        }
    }

    /// The index of a node that is a state, else `None`.
    pub fn as_state(&self, id: NodeId) -> Option<usize> {
        match *self.node(id) {
            Node::State(index) => Some(index as usize),
            _ => None,
        }
    }

    /// Makes known that an expression is not negative along motions, which does not follow from what it is made of: between
    /// two whole numbers a quantity is within 1 of them. What an expression is in a region is found with it.
    pub fn declare_not_negative(&mut self, id: NodeId) {
        if !self.not_negative.contains(&id) {
            self.not_negative.push(id);
        }
    }

    pub(crate) fn surfaces_mut(&mut self) -> &mut SurfaceTable {
        Arc::make_mut(&mut self.surfaces)
    }

    /// Makes room for so many more nodes.
    pub(crate) fn reserve(&mut self, more: usize) {
        self.nodes.reserve(more);
        self.facts.reserve(more);
        self.ids.reserve(more);
    }

    pub(crate) fn facts(&self, id: NodeId) -> Facts {
        self.facts[id.index()]
    }

    /// The number of a node, which is new or was there already. No simplification.
    pub(crate) fn insert(&mut self, node: Node) -> NodeId {
        if let Some(&id) = self.ids.get(&node) {
            return id;
        }
        let is_absolute = self.is_absolute_value(&node);
        let id = NodeId(self.nodes.len() as u32);
        let mut facts = self.facts_of(&node);
        facts.nonnegative |= is_absolute;
        self.ids.insert(node, id);
        self.nodes.push(node);
        self.facts.push(facts);
        id
    }

    /// What follows from the facts of the operands.
    fn facts_of(&self, node: &Node) -> Facts {
        let mut operands = node.operands().map(|operand| self.facts(operand));
        let (a, b) = (
            operands.next().unwrap_or_default(),
            operands.next().unwrap_or_default(),
        );
        Facts::of(node, a, b)
    }

    /// The nodes that were known to be absolute values when they were made; no other fact is more than what
    /// follows from the operands.
    pub(crate) fn absolute_values(&self) -> impl Iterator<Item = NodeId> + '_ {
        let known = self.nodes.iter().zip(&self.facts).enumerate();
        known.filter_map(|(k, (node, facts))| {
            (facts.nonnegative && !self.facts_of(node).nonnegative).then_some(NodeId(k as u32))
        })
    }

    /// Whether the node is `s_j * v` with the known sign s_j of v itself: |v|.
    pub(crate) fn is_absolute_value(&self, node: &Node) -> bool {
        let Node::Binary(BinaryOp::Mul, left, right) = *node else {
            return false;
        };
        match *self.node(left) {
            Node::Sign(j) => self.surfaces.switch_of(right) == Some((j, 1.0)),
            _ => false,
        }
    }

    /// Whether an expression changes only where signs or discrete states inside of it do.
    pub fn is_stepwise(&self, node: NodeId) -> bool {
        let moves = |id: &NodeId| matches!(self.node(*id), Node::Time | Node::State(_));
        !self.all_below(&[node]).iter().any(moves)
    }

    /// All nodes that the roots are made of, in increasing order.
    pub fn all_below(&self, roots: &[NodeId]) -> Vec<NodeId> {
        self.reachable_by(roots.iter().copied(), |id| self.node(id).operands())
    }

    /// The same, as far as `operands` says which operands of a node are followed.
    pub(crate) fn reachable_by<I: IntoIterator<Item = NodeId>>(
        &self,
        roots: impl IntoIterator<Item = NodeId>,
        operands: impl Fn(NodeId) -> I,
    ) -> Vec<NodeId> {
        let mut seen = rustc_hash::FxHashSet::default();
        let mut found = Vec::new();
        let mut pending: Vec<NodeId> = roots.into_iter().collect();
        while let Some(id) = pending.pop() {
            if seen.insert(id) {
                found.push(id);
                pending.extend(
                    operands(id)
                        .into_iter()
                        .filter(|operand| !seen.contains(operand)),
                );
            }
        }
        found.sort_unstable();
        found
    }
}

#[cfg(test)]
mod tests;
