//! Multipliers: values that are not computed but solved for, so that some functions stay zero.
//!
//! Coefficient k of an equation g(x, lambda) = 0 is linear in lambda_k: it is what it would be with lambda_k = 0,
//! plus J lambda_k, with J the derivative of g by lambda at the start. So each order takes two rounds, and one
//! product with the inverse of J, which is the same for all orders.

use rustc_hash::FxHashMap;

use super::plan::{Plan, Row, Rule};
use crate::node::NodeId;

/// Leaves that are solved for.
#[derive(Debug, Clone, Default)]
pub struct Multipliers {
    /// The leaves, such as signs, and their values at the start, inputs of the program.
    pub unknowns: Vec<(NodeId, NodeId)>,
    /// What they keep at zero, as many functions.
    pub equations: Vec<NodeId>,
    /// The inverse of the derivatives of the equations by the multipliers: for each multiplier, the equations that
    /// matter and the entry, an input of the program.
    pub inverse: Vec<Vec<(usize, NodeId)>>,
}

impl Multipliers {
    /// All nodes that a plan has to have rows for.
    pub(super) fn nodes(&self) -> Vec<NodeId> {
        let mut nodes = Vec::new();
        for &(unknown, start) in &self.unknowns {
            nodes.extend([unknown, start]);
        }
        nodes.extend(&self.equations);
        nodes.extend(self.inverse.iter().flatten().map(|(_, entry)| entry));
        nodes
    }

    /// The start of a leaf that is a multiplier.
    pub(super) fn start(&self, node: NodeId) -> Option<NodeId> {
        let mut unknowns = self.unknowns.iter();
        unknowns.find(|known| known.0 == node).map(|known| known.1)
    }

    /// How each multiplier is solved for, in rows.
    pub(super) fn solved(&self, rows: &FxHashMap<NodeId, Row>) -> Vec<Solved> {
        let each = self.unknowns.iter().zip(&self.inverse);
        each.map(|((unknown, _), entries)| Solved {
            row: rows[unknown],
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
