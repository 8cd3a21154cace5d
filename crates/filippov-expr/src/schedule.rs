//! The order in which a program computes its nodes, and what it reads.

use rustc_hash::FxHashMap;

use crate::error::ExprError;
use crate::graph::Graph;
use crate::node::{Node, NodeId};

/// The largest index of a variable: its byte offset has to fit the displacement of an instruction.
pub(crate) const LARGEST_INDEX: u32 = (i32::MAX as u32) / 8 - 1;

/// Room is made for so many nodes at once.
const SOME_NODES: usize = 1024;

/// How long the argument slices of a program have to be at least.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Lengths {
    /// Of the states x.
    pub states: usize,
    /// Of the signs s.
    pub signs: usize,
    /// Of the parameters p.
    pub parameters: usize,
    /// Of the extra vector v.
    pub inputs: usize,
}

/// Nodes in the order of computation.
#[derive(Debug, Clone, Default)]
pub(crate) struct Schedule {
    /// Every needed node once, operands first.
    pub order: Vec<NodeId>,
    /// (position in `order` after which to store, output index), by position.
    pub stores: Vec<(usize, u32)>,
    /// Position of the last use of each node as an operand.
    pub last_use: FxHashMap<NodeId, usize>,
    /// What the program reads.
    pub lengths: Lengths,
}

impl Schedule {
    /// Orders the nodes output by output, operands first: values are used soon after they are computed,
    /// which keeps few of them alive (creation order would keep whole arrays of them).
    ///
    /// # Errors
    /// [`ExprError::UnknownNode`] for an output that is not of the graph, [`ExprError::IndexTooLarge`] for
    /// a variable beyond 2^28.
    pub fn new(graph: &Graph, outputs: &[NodeId]) -> Result<Self, ExprError> {
        let mut schedule = Schedule::default();
        // Most programs read most of their graph; of a large graph they may read little.
        let mut position_of: FxHashMap<NodeId, usize> = FxHashMap::default();
        let some = graph.len().min(SOME_NODES);
        position_of.reserve(some);
        schedule.last_use.reserve(some);
        schedule.order.reserve(some);
        let mut pending = Vec::new();
        for (output, &root) in outputs.iter().enumerate() {
            if !graph.contains(root) {
                return Err(ExprError::UnknownNode {
                    id: root.0,
                    len: graph.len(),
                });
            }
            // A node is pushed once to visit its operands and stays below them to be computed after.
            pending.push((root, false));
            while let Some((id, operands_done)) = pending.pop() {
                if position_of.contains_key(&id) {
                    continue;
                }
                let node = graph.node(id);
                if operands_done {
                    let position = schedule.order.len();
                    schedule.order.push(id);
                    position_of.insert(id, position);
                    for operand in node.operands() {
                        schedule.last_use.insert(operand, position);
                    }
                    schedule.lengths.include(node)?;
                } else {
                    pending.push((id, true));
                    let (first, second) = {
                        let mut operands = node.operands();
                        (operands.next(), operands.next())
                    };
                    let operands = second.into_iter().chain(first);
                    pending.extend(operands.map(|operand| (operand, false)));
                }
            }
            schedule.stores.push((position_of[&root], output as u32));
        }
        schedule.stores.sort_unstable();
        Ok(schedule)
    }
}

impl Graph {
    /// How long the arguments of any function of this graph have to be at least.
    ///
    /// # Errors
    /// [`ExprError::IndexTooLarge`] for a variable beyond 2^28.
    pub fn lengths(&self) -> Result<Lengths, ExprError> {
        let mut lengths = Lengths::default();
        for node in &self.nodes {
            lengths.include(node)?;
        }
        Ok(lengths)
    }
}

impl Lengths {
    fn include(&mut self, node: &Node) -> Result<(), ExprError> {
        let (length, index) = match *node {
            Node::State(i) => (&mut self.states, i),
            Node::Sign(j) => (&mut self.signs, j),
            Node::Select { surface, .. } => (&mut self.signs, surface),
            Node::Parameter(i) => (&mut self.parameters, i),
            Node::Input(i) => (&mut self.inputs, i),
            _ => return Ok(()),
        };
        if index > LARGEST_INDEX {
            return Err(ExprError::IndexTooLarge {
                index,
                limit: LARGEST_INDEX,
            });
        }
        *length = (*length).max(index as usize + 1);
        Ok(())
    }
}
