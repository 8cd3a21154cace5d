//! Sums as linear forms `sum_k c_k a_k + c`, the normal form by which switching functions are recognised.

use std::collections::BinaryHeap;

use rustc_hash::FxHashMap;

use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};

/// An expression as `sum_k coefficient_k * atom_k + constant`; atoms are what is not a sum or a multiple.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LinearForm {
    /// Atoms in increasing order with their coefficients, none of them zero.
    pub terms: Vec<(NodeId, f64)>,
    /// The constant term.
    pub constant: f64,
}

/// Coefficients that differ by less than this relative amount are meant to be the same: rounding errors
/// of a few operations, while thresholds that differ in the 14th digit stay two.
const SAME_COEFFICIENT: f64 = 32.0 * f64::EPSILON;

/// A linear form up to a factor.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LinearKey {
    /// The atoms in increasing order.
    pub atoms: Vec<NodeId>,
    /// Their coefficients and then the constant, divided by the first coefficient.
    pub ratios: Vec<f64>,
}

impl LinearKey {
    /// Whether two forms are the same up to a factor and rounding errors.
    pub fn matches(&self, other: &LinearKey) -> bool {
        let same = |a: f64, b: f64| (a - b).abs() <= SAME_COEFFICIENT * a.abs().max(b.abs());
        self.atoms == other.atoms
            && self
                .ratios
                .iter()
                .zip(&other.ratios)
                .all(|(&a, &b)| same(a, b))
    }
}

/// A coefficient and the sum of the magnitudes that it was made of.
#[derive(Clone, Copy, Default)]
struct Accumulated {
    value: f64,
    magnitude: f64,
}

impl Accumulated {
    fn add(&mut self, value: f64) {
        self.value += value;
        self.magnitude += value.abs();
    }

    /// The value, or 0 if nothing but rounding errors is left of it.
    fn rounded(self) -> f64 {
        if self.magnitude.is_finite() && self.value.abs() <= 8.0 * f64::EPSILON * self.magnitude {
            0.0
        } else {
            self.value
        }
    }
}

impl Graph {
    /// An expression without the terms that cancel in it: 0.25 for `x + 0.25 - x`.
    pub fn without_cancelled(&mut self, id: NodeId) -> NodeId {
        let (form, cancels) = LinearForm::collected(self, &[(id, 1.0)], 0.0);
        match cancels {
            true => form.expression(self),
            false => id,
        }
    }
}

impl LinearForm {
    /// The linear form of an expression, at a cost linear in its size (shared parts are visited once).
    pub fn of(graph: &Graph, root: NodeId) -> Self {
        Self::of_sum(graph, &[(root, 1.0)], 0.0)
    }

    /// That of a sum of multiples of expressions and of a number.
    pub fn of_sum(graph: &Graph, roots: &[(NodeId, f64)], number: f64) -> Self {
        Self::collected(graph, roots, number).0
    }

    /// The same, and whether some of its terms cancelled.
    fn collected(graph: &Graph, roots: &[(NodeId, f64)], number: f64) -> (Self, bool) {
        let mut coefficients: FxHashMap<NodeId, Accumulated> = FxHashMap::default();
        let mut pending = BinaryHeap::new();
        for &(root, coefficient) in roots {
            pending.push(root);
            coefficients.entry(root).or_default().add(coefficient);
        }
        let mut terms = Vec::new();
        let mut constant = Accumulated::default();
        constant.add(number);
        let mut cancels = false;
        // Largest number first: when a node is taken, everything that uses it has been taken.
        while let Some(id) = pending.pop() {
            let Some(sum) = coefficients.remove(&id) else {
                continue;
            };
            let c = sum.rounded();
            if c == 0.0 {
                cancels = true;
                continue;
            }
            let mut push = |operand: NodeId, coefficient: f64| {
                let entry = coefficients.entry(operand).or_insert_with(|| {
                    pending.push(operand);
                    Accumulated::default()
                });
                entry.add(coefficient);
            };
            match *graph.node(id) {
                Node::Constant(value) => constant.add(c * value),
                Node::Unary(UnaryOp::Neg, a) => push(a, -c),
                Node::Binary(BinaryOp::Add, a, b) => {
                    push(a, c);
                    push(b, c);
                }
                Node::Binary(BinaryOp::Sub, a, b) => {
                    push(a, c);
                    push(b, -c);
                }
                Node::Binary(BinaryOp::Mul, a, b) => match graph.as_constant(a) {
                    Some(factor) => push(b, c * factor),
                    None => terms.push((id, c)),
                },
                Node::Binary(BinaryOp::Div, a, b) => match graph.as_constant(b) {
                    Some(divisor) => push(a, c / divisor),
                    None => terms.push((id, c)),
                },
                _ => terms.push((id, c)),
            }
        }
        terms.reverse();
        let form = LinearForm {
            terms,
            constant: constant.rounded(),
        };
        match form.is_finite() {
            true => (form, cancels),
            false => {
                let form = LinearForm {
                    terms: roots.to_vec(),
                    constant: number,
                };
                (form, false)
            }
        }
    }

    /// The expression of the form.
    pub fn expression(&self, graph: &mut Graph) -> NodeId {
        let mut sum = graph.constant(self.constant);
        for &(atom, coefficient) in &self.terms {
            let factor = graph.constant(coefficient);
            let term = graph.mul(factor, atom);
            sum = graph.add(sum, term);
        }
        sum
    }

    /// Whether nothing is left of it.
    pub fn is_zero(&self) -> bool {
        self.terms.is_empty() && self.constant == 0.0
    }

    /// The coefficient of an atom, 0 if it does not occur.
    pub fn coefficient(&self, atom: NodeId) -> f64 {
        match self.terms.binary_search_by_key(&atom, |term| term.0) {
            Ok(k) => self.terms[k].1,
            Err(_) => 0.0,
        }
    }

    /// The atom and its coefficient if the form is nothing else.
    pub fn single_atom(&self) -> Option<(NodeId, f64)> {
        match (self.terms.as_slice(), self.constant == 0.0) {
            ([term], true) => Some(*term),
            _ => None,
        }
    }

    /// The magnitude that all coefficients and the constant share, if they do (to rounding).
    pub fn common_magnitude(&self) -> Option<f64> {
        let magnitude = self.terms.first()?.1.abs();
        let is_same = |c: f64| (c.abs() - magnitude).abs() <= SAME_COEFFICIENT * magnitude;
        let same = self.terms.iter().all(|term| is_same(term.1))
            && (self.constant == 0.0 || is_same(self.constant));
        same.then_some(magnitude)
    }

    /// The form up to a factor, and the sign of that factor. `None` without atoms.
    pub fn key(&self) -> Option<(LinearKey, f64)> {
        let leading = self.terms.first()?.1;
        let coefficients = self.terms.iter().map(|term| term.1);
        let ratios = coefficients
            .chain([self.constant])
            .map(|c| c / leading)
            .collect();
        let atoms = self.terms.iter().map(|term| term.0).collect();
        Some((LinearKey { atoms, ratios }, leading.signum()))
    }

    fn is_finite(&self) -> bool {
        self.constant.is_finite() && self.terms.iter().all(|term| term.1.is_finite())
    }
}

#[cfg(test)]
mod tests;
