//! Constants of motion: expressions whose rate along a field is zero in all regions, as its terms cancel.

use crate::graph::Graph;
use crate::linear::LinearForm;
use crate::node::{Node, NodeId};

/// What the rate of an expression is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct RateTerms {
    /// The coefficient of the time.
    pub of_time: f64,
    /// States that the expression is linear in, with their coefficients.
    pub linear: Vec<(u32, f64)>,
    /// States that it contains in another way: they have to stand still.
    pub others: Vec<u32>,
}

impl Graph {
    /// What the rate of an expression is made of; `None` if it contains a sign, or the time other than linearly.
    ///
    /// # Examples
    /// ```
    /// use filippov_expr::{BinaryOp, Graph};
    ///
    /// let mut g = Graph::new();
    /// let (x, y) = (g.state(0), g.state(1));
    /// let sum = g.binary(BinaryOp::Add, x, y);
    /// let inflow = g.parameter(0);
    /// let outflow = g.unary(filippov_expr::UnaryOp::Neg, inflow);
    /// let terms = g.rate_terms(sum).unwrap();
    /// assert!(g.is_constant_of_motion(&terms, &[inflow, outflow]));
    /// assert!(!g.is_constant_of_motion(&terms, &[inflow, inflow]));
    /// ```
    pub fn rate_terms(&self, node: NodeId) -> Option<RateTerms> {
        if self.has_signs(node) {
            return None;
        }
        let (mut of_time, mut linear, mut others) = (0.0, Vec::new(), Vec::new());
        for (atom, coefficient) in LinearForm::of(self, node).terms {
            match *self.node(atom) {
                Node::Time => of_time = coefficient,
                Node::State(index) => linear.push((index, coefficient)),
                _ => {
                    for id in self.all_below(&[atom]) {
                        match *self.node(id) {
                            Node::Time | Node::Input(_) => return None,
                            Node::State(index) => others.push(index),
                            _ => {}
                        }
                    }
                }
            }
        }
        Some(RateTerms {
            of_time,
            linear,
            others,
        })
    }

    /// Whether an expression, perhaps of another graph, with these terms is constant along the motions of a field.
    pub fn is_constant_of_motion(&self, terms: &RateTerms, field: &[NodeId]) -> bool {
        let rate = |index: &u32| field.get(*index as usize).copied();
        let stands_still = |node: NodeId| self.as_constant(node) == Some(0.0);
        if !terms
            .others
            .iter()
            .all(|k| rate(k).is_some_and(stands_still))
        {
            return false;
        }
        let mut rates = Vec::new();
        for (index, coefficient) in &terms.linear {
            let Some(rate) = rate(index) else {
                return false;
            };
            rates.push((rate, *coefficient));
        }
        LinearForm::of_sum(self, &rates, terms.of_time).is_zero()
    }
}
