//! How a new switching function is written: it is printed, and evaluated, in this form.

use crate::graph::Graph;
use crate::linear::LinearForm;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};

impl Graph {
    /// The function that a new surface is printed and evaluated as, and its sign relative to the form.
    pub(crate) fn spell(&mut self, spelling: NodeId, form: &LinearForm) -> (NodeId, f64) {
        let leading = self.leading_atom(spelling, form);
        let flip = form.coefficient(leading).signum();
        let magnitude = form.common_magnitude();
        // The user's own spelling, where it has neither the wrong sign nor a common factor.
        if magnitude.is_none() || magnitude == Some(1.0) {
            let own = if flip < 0.0 {
                self.neg(spelling)
            } else {
                spelling
            };
            if !matches!(*self.node(own), Node::Unary(UnaryOp::Neg, _)) {
                return (self.without_factor(own), flip);
            }
        }
        let scale = flip / magnitude.unwrap_or(1.0);
        let lead_first = std::iter::once((leading, form.coefficient(leading)));
        let rest = form.terms.iter().copied().filter(|term| term.0 != leading);
        let mut sum = self.constant(0.0);
        for (atom, c) in lead_first.chain(rest) {
            sum = self.add_multiple(sum, atom, self.rounded_factor(c * scale, magnitude));
        }
        let constant = self.constant(form.constant * scale);
        (self.add(sum, constant), flip)
    }

    /// +-1 for coefficients that share their magnitude to rounding, else as they are.
    fn rounded_factor(&self, c: f64, magnitude: Option<f64>) -> f64 {
        if magnitude.is_some() {
            c.signum()
        } else {
            c
        }
    }

    /// `sum + c * atom`, spelled with a minus where c is negative.
    fn add_multiple(&mut self, sum: NodeId, atom: NodeId, c: f64) -> NodeId {
        let factor = self.constant(c.abs());
        let term = self.mul(factor, atom);
        if c < 0.0 {
            self.sub(sum, term)
        } else {
            self.add(sum, term)
        }
    }

    /// A node without positive constant factors in front of it or below it.
    fn without_factor(&self, id: NodeId) -> NodeId {
        let mut current = id;
        loop {
            current = match *self.node(current) {
                Node::Binary(BinaryOp::Mul, c, a)
                    if self.as_constant(c).is_some_and(|c| c > 0.0) =>
                {
                    a
                }
                Node::Binary(BinaryOp::Div, a, c)
                    if self.as_constant(c).is_some_and(|c| c > 0.0) =>
                {
                    a
                }
                _ => return current,
            }
        }
    }

    /// The atom whose sign is made positive: the leftmost one with a state in the spelling, else the first.
    fn leading_atom(&self, spelling: NodeId, form: &LinearForm) -> NodeId {
        let mut current = spelling;
        loop {
            current = match *self.node(current) {
                Node::Unary(UnaryOp::Neg, a) => a,
                Node::Binary(BinaryOp::Add | BinaryOp::Sub, a, b) => {
                    if self.facts(a).has_state {
                        a
                    } else {
                        b
                    }
                }
                Node::Binary(BinaryOp::Mul, c, a) if self.as_constant(c).is_some() => a,
                Node::Binary(BinaryOp::Div, a, c) if self.as_constant(c).is_some() => a,
                _ => break,
            }
        }
        if self.facts(current).has_state && form.coefficient(current) != 0.0 {
            return current;
        }
        let stateful = form.terms.iter().find(|term| self.facts(term.0).has_state);
        stateful
            .or(form.terms.first())
            .map_or(spelling, |term| term.0)
    }
}
