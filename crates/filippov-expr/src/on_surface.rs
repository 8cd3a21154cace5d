//! Values on a surface: powers of its switching function are those of zero.

use rustc_hash::FxHashMap;

use crate::graph::Graph;
use crate::linear::LinearForm;
use crate::node::{Node, NodeId};
use crate::op::BinaryOp;

impl Graph {
    /// The values where switching function `index` is zero: a power above 1 of it, or of a multiple of it, is zero there, and no
    /// rounding of h can make it what does not exist. Everything else stays as it is. Roots do: beside the surface they
    /// grow faster than the distance, and tell to which side a motion is drawn.
    ///
    /// # Example
    /// ```
    /// use filippov_expr::Graph;
    /// let mut g = Graph::new();
    /// let (x, power, one) = (g.state(0), g.constant(1.5), g.constant(1.0));
    /// let h = g.sub(x, one);
    /// g.declare_surface(h);
    /// let below = g.neg(h);
    /// let (stiff, soft) = (g.pow(below, power), g.mul(h, x));
    /// let zero = g.constant(0.0);
    /// assert_eq!(g.on_surface(&[stiff, soft], 0), [zero, soft]);
    /// ```
    pub fn on_surface(&mut self, roots: &[NodeId], index: u32) -> Vec<NodeId> {
        let Some((key, _)) = LinearForm::of(self, self.surface(index)).key() else {
            return roots.to_vec();
        };
        let nodes = self.all_below(roots);
        let is_multiple = |graph: &Graph, id: NodeId| {
            let form = LinearForm::of(graph, id).key();
            form.is_some_and(|(form, _)| form.matches(&key))
        };
        let vanishes = |graph: &Graph, id: NodeId| match *graph.node(id) {
            Node::Binary(BinaryOp::Pow, a, b) => {
                graph.as_constant(b).is_some_and(|b| b > 1.0) && is_multiple(graph, a)
            }
            _ => false,
        };
        let mut image: FxHashMap<NodeId, NodeId> = FxHashMap::default();
        for id in nodes {
            let moved = |operand: NodeId| image.get(&operand).copied().unwrap_or(operand);
            let new = if vanishes(self, id) {
                self.constant(0.0)
            } else if self.node(id).operands().any(|a| moved(a) != a) {
                self.with_operands(id, moved)
            } else {
                continue;
            };
            image.insert(id, new);
        }
        roots
            .iter()
            .map(|root| image.get(root).copied().unwrap_or(*root))
            .collect()
    }
}
