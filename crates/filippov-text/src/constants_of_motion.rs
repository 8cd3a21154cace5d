//! Constants of motion: what no motion changes is compared as Python compares it, at starts and after resets.
//!
//! Whether an expression is one is known when the whole function was read once; a second trace makes use of it.

use filippov_expr::{Graph, NodeId};

/// The constants of motion of a traced field; none of a map.
#[derive(Clone, Debug, Default)]
pub struct Constants {
    field: Option<(Graph, Vec<NodeId>)>,
}

impl Constants {
    pub fn of(graph: &Graph, field: &[NodeId]) -> Self {
        Constants {
            field: Some((graph.clone(), field.to_vec())),
        }
    }

    /// Is an expression of this or another trace of the function one of them?
    pub fn have(&self, graph: &Graph, node: NodeId) -> bool {
        let Some((own, field)) = &self.field else {
            return false;
        };
        if !graph.depends_on_motion(node) {
            return false;
        }
        let terms = graph.rate_terms(node);
        terms.is_some_and(|terms| own.is_constant_of_motion(&terms, field))
    }
}
