//! Multipliers: values that are not computed but solved for, so that some functions stay zero.
//!
//! Coefficient k of an equation g(x, lambda) = 0 is linear in lambda_k: it is what it would be with lambda_k = 0,
//! plus J lambda_k, with J the derivative of g by lambda at the start. So each order takes two rounds, and one
//! product with the inverse of J, which is the same for all orders.

use rustc_hash::FxHashMap;

use super::plan::{Plan, Row, Rule};
use crate::graph::Graph;
use crate::node::{Node, NodeId};

/// Signs that are solved for.
#[derive(Debug, Clone, Default)]
pub struct Multipliers {
    /// The surfaces whose signs they are, and their values at the start, inputs of the program.
    pub signs: Vec<(u32, NodeId)>,
    /// What they keep at zero, as many functions.
    pub equations: Vec<NodeId>,
    /// The inverse of the derivatives of the equations by the multipliers: for each multiplier, the equations that
    /// matter and the entry, an input of the program.
    pub inverse: Vec<Vec<(usize, NodeId)>>,
}

impl Multipliers {
    /// All nodes that a plan has to have rows for.
    pub(super) fn nodes(&self, graph: &mut Graph) -> Vec<NodeId> {
        let mut nodes = Vec::new();
        for &(j, start) in &self.signs {
            nodes.extend([graph.sign_of(j), start]);
        }
        nodes.extend(&self.equations);
        nodes.extend(self.inverse.iter().flatten().map(|(_, entry)| entry));
        nodes
    }

    /// The start of a sign that is a multiplier.
    pub(super) fn start(&self, node: Node) -> Option<NodeId> {
        let Node::Sign(j) = node else { return None };
        self.signs
            .iter()
            .find(|sign| sign.0 == j)
            .map(|sign| sign.1)
    }

    /// How each multiplier is solved for, in rows.
    pub(super) fn solved(&self, graph: &mut Graph, rows: &FxHashMap<NodeId, Row>) -> Vec<Solved> {
        let each = self.signs.iter().zip(&self.inverse);
        each.map(|(&(j, _), entries)| Solved {
            row: rows[&graph.sign_of(j)],
            terms: entries
                .iter()
                .map(|(equation, entry)| (rows[&self.equations[*equation]], rows[entry]))
                .collect(),
        })
        .collect()
    }
}

/// The row of a multiplier: minus the sum of entries times equations.
#[derive(Debug, Clone, Default)]
pub(super) struct Solved {
    pub row: Row,
    pub terms: Vec<(Row, Row)>,
}

/// Which rows an order computes when.
#[derive(Debug, Default)]
pub(super) struct Rounds {
    pub solved: Vec<Solved>,
    /// Rows that have to be there before the multipliers.
    pub first: Vec<bool>,
    /// Rows that depend on the multipliers.
    pub second: Vec<bool>,
}

impl Rounds {
    pub fn new(plan: &Plan, solved: Vec<Solved>) -> Self {
        let n = plan.rules.len();
        let mut depends = vec![false; n];
        solved.iter().for_each(|s| depends[s.row] = true);
        // Rows may stand before those that they are made of, as the sine before the cosine.
        loop {
            let mut changed = false;
            for row in 0..n {
                if !depends[row] && plan.rules[row].operands().any(|a| depends[a]) {
                    depends[row] = true;
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
        let mut feeds = vec![false; n];
        let mut pending: Vec<Row> = solved
            .iter()
            .flat_map(|s| s.terms.iter().map(|t| t.0))
            .collect();
        while let Some(row) = pending.pop() {
            if !std::mem::replace(&mut feeds[row], true) {
                pending.extend(plan.rules[row].operands());
            }
        }
        let is_solved = |row: Row| matches!(plan.rules[row], Rule::Multiplier(_));
        Rounds {
            first: (0..n)
                .map(|row| !is_solved(row) && (!depends[row] || feeds[row]))
                .collect(),
            second: (0..n).map(|row| !is_solved(row) && depends[row]).collect(),
            solved,
        }
    }
}
