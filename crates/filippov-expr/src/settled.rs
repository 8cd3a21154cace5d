//! What of some values follows from signs and parameters alone: it stays the same all along a motion.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::error::ExprError;
use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::schedule::Schedule;

/// Values with fewer operations are computed where they are used.
const FEWEST_OPERATIONS: usize = 16;

/// Outputs whose settled values are parameters.
#[derive(Debug, Clone)]
pub struct Settled {
    /// A graph that has the outputs.
    pub graph: Graph,
    /// The outputs: they read the values as parameters, behind the first [`n_parameters`](Self::n_parameters).
    pub outputs: Vec<NodeId>,
    /// The values, in the order of these parameters.
    pub values: Vec<NodeId>,
    /// So many parameters the outputs had before.
    pub n_parameters: usize,
}

impl Graph {
    /// Takes out of some outputs what neither time nor states change, so that it is computed once for many evaluations with the
    /// same signs; the results are the same bits. `None` if that is little.
    ///
    /// # Errors
    /// As of [`Program::compile`](crate::Program::compile).
    ///
    /// # Example
    /// ```
    /// use filippov_expr::Graph;
    /// let mut g = Graph::new();
    /// let x = g.state(0);
    /// let mut sum = g.constant(0.0);
    /// for k in 0..20 {
    ///     let level = g.constant(f64::from(k));
    ///     let h = g.sub(x, level);
    ///     let sign = g.sign(h);
    ///     let term = g.mul(sign, level);
    ///     sum = g.add(sum, term);
    /// }
    /// let rate = g.sub(sum, x);
    /// let settled = g.settled(&[rate])?.expect("40 operations on signs");
    /// assert_eq!((settled.values, settled.n_parameters), (vec![sum], 0));
    /// assert_eq!(settled.graph.all_below(&settled.outputs).len(), 3); // p0 - x0
    /// # Ok::<(), filippov_expr::ExprError>(())
    /// ```
    pub fn settled(&self, outputs: &[NodeId]) -> Result<Option<Settled>, ExprError> {
        let n_parameters = Schedule::new(self, outputs)?.lengths.parameters;
        let nodes = self.all_below(outputs);
        let mut moving = FxHashSet::default();
        let mut n_operations = 0;
        for &id in &nodes {
            let node = self.node(id);
            let is_leaf = node.operands().next().is_none();
            if matches!(node, Node::Time | Node::State(_) | Node::Input(_))
                || node.operands().any(|operand| moving.contains(&operand))
            {
                moving.insert(id);
            } else if !is_leaf {
                n_operations += 1;
            }
        }
        if n_operations < FEWEST_OPERATIONS {
            return Ok(None);
        }
        // A value is what something that moves reads, or an output.
        let read = nodes.iter().filter(|id| moving.contains(id));
        let read = read.flat_map(|&id| self.node(id).operands());
        let mut values: Vec<NodeId> = read
            .chain(outputs.iter().copied())
            .filter(|id| !moving.contains(id) && self.node(*id).operands().next().is_some())
            .collect();
        values.sort_unstable();
        values.dedup();
        let mut graph = self.clone();
        let mut image: FxHashMap<NodeId, NodeId> = FxHashMap::default();
        for (k, &value) in values.iter().enumerate() {
            image.insert(value, graph.parameter((n_parameters + k) as u32));
        }
        for id in nodes.into_iter().filter(|id| moving.contains(id)) {
            let at = |operand: NodeId| image.get(&operand).copied().unwrap_or(operand);
            // The operation as it is: no rule that makes it simpler may change its bits.
            let made = match *self.node(id) {
                Node::Unary(op, a) => Node::Unary(op, at(a)),
                Node::Binary(op, a, b) => Node::Binary(op, at(a), at(b)),
                Node::Select {
                    surface,
                    plus,
                    minus,
                } => Node::Select {
                    surface,
                    plus: at(plus),
                    minus: at(minus),
                },
                leaf => leaf,
            };
            let made = graph.insert(made);
            image.insert(id, made);
        }
        let outputs = outputs.iter();
        Ok(Some(Settled {
            outputs: outputs
                .map(|id| image.get(id).copied().unwrap_or(*id))
                .collect(),
            graph,
            values,
            n_parameters,
        }))
    }
}
