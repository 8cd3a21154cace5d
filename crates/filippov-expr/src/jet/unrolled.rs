//! Jets as expressions.

use super::plan::Plan;
use super::recurrence::{fill, Arithmetic, Table};
use crate::graph::Graph;
use crate::node::NodeId;
use crate::op::{BinaryOp, UnaryOp};

/// The coefficients as nodes, order by order: states, then functions.
pub(super) fn unroll(plan: &Plan, graph: &mut Graph, order: usize) -> Vec<NodeId> {
    graph.reserve(plan.unrolled_size(order));
    let zero = graph.constant(0.0);
    let mut table = Table::new(plan.rules.len(), order, zero);
    let mut expressions = Expressions { graph };
    fill(plan, &mut table, order, &mut expressions);
    let mut outputs = Vec::with_capacity((order + 1) * (plan.field.len() + plan.functions.len()));
    for k in 0..=order {
        for (i, &rate) in plan.field.iter().enumerate() {
            outputs.push(match k {
                0 => expressions.graph.state(i as u32),
                _ => expressions.scaled(table.at(rate, k - 1), 1.0 / k as f64),
            });
        }
        outputs.extend(plan.functions.iter().map(|&row| table.at(row, k)));
    }
    outputs
}

struct Expressions<'a> {
    graph: &'a mut Graph,
}

impl Arithmetic for Expressions<'_> {
    type Value = NodeId;

    fn constant(&mut self, value: f64) -> NodeId {
        self.graph.constant(value)
    }

    fn time(&mut self) -> NodeId {
        self.graph.time()
    }

    fn state(&mut self, index: u32) -> NodeId {
        self.graph.state(index)
    }

    fn still(&mut self, leaf: NodeId) -> NodeId {
        leaf
    }

    fn unary(&mut self, op: UnaryOp, a: NodeId) -> NodeId {
        self.graph.unary(op, a)
    }

    fn binary(&mut self, op: BinaryOp, a: NodeId, b: NodeId) -> NodeId {
        self.graph.binary(op, a, b)
    }

    fn select(&mut self, surface: u32, plus: NodeId, minus: NodeId) -> NodeId {
        self.graph.select(surface, 1.0, plus, minus)
    }

    fn scaled(&mut self, a: NodeId, factor: f64) -> NodeId {
        let factor = self.graph.constant(factor);
        self.graph.mul(factor, a)
    }

    fn is_zero(&self, a: NodeId) -> bool {
        self.graph.as_constant(a) == Some(0.0)
    }
}
