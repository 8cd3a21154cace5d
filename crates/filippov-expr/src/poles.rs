//! Poles of switching functions: N/D changes its sign where D vanishes, too. So does N D, which is smooth there.

use rustc_hash::FxHashMap;

use crate::graph::Graph;
use crate::linear::LinearForm;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::switching::Switching;

/// More denominators than these are left as they are: the numerator of a sum grows with the square of their number.
const MOST_DENOMINATORS: usize = 8;

/// An expression as a quotient; without a denominator it has no poles.
#[derive(Clone, Copy)]
struct Fraction {
    numerator: NodeId,
    denominator: Option<NodeId>,
}

/// The nodes of an expression as quotients.
struct Fractions<'g> {
    graph: &'g mut Graph,
    known: FxHashMap<NodeId, Fraction>,
}

/// An expression with the same sign, without the poles of quotients and tangents; `None` if there are none, or too many.
pub(crate) fn without_poles(graph: &mut Graph, id: NodeId) -> Option<NodeId> {
    if let Some(inner) = inside_of_monotone(graph, id) {
        return without_poles(graph, inner);
    }
    let (numerator, denominator) = as_quotient(graph, id)?;
    let form = LinearForm::of(graph, denominator);
    Some(match graph.known_sign(&form) {
        Some(Switching::Constant(1.0)) => numerator,
        Some(Switching::Constant(-1.0)) => graph.neg(numerator),
        _ => graph.mul(numerator, denominator),
    })
}

/// An expression that has poles as numerator and denominator; `None` if it has none, or too many.
pub(crate) fn as_quotient(graph: &mut Graph, id: NodeId) -> Option<(NodeId, NodeId)> {
    let nodes = graph.reachable_by([id], |id| terms_and_factors(graph, id));
    let n_poles = nodes.iter().filter(|&&id| has_pole(graph, id)).count();
    if n_poles == 0 || n_poles > MOST_DENOMINATORS {
        return None;
    }
    let mut fractions = Fractions {
        graph,
        known: FxHashMap::default(),
    };
    for node in nodes {
        let fraction = fractions.of(node);
        fractions.known.insert(node, fraction);
    }
    let fraction = fractions.known[&id];
    Some((fraction.numerator, fraction.denominator?))
}

/// `exp(u) - c` has the sign of `u - log(c)`, which is a quotient where u is one; likewise `tanh(u) - c`.
fn inside_of_monotone(graph: &mut Graph, id: NodeId) -> Option<NodeId> {
    let form = LinearForm::of(graph, id);
    let (atom, coefficient) = form
        .terms
        .first()
        .copied()
        .filter(|_| form.terms.len() == 1)?;
    let Node::Unary(function, inner) = *graph.node(atom) else {
        return None;
    };
    let level = -form.constant / coefficient;
    let level = match function {
        UnaryOp::Tanh if level.abs() < 1.0 => level.atanh(),
        UnaryOp::Exp if level > 0.0 => level.ln(),
        _ => return None,
    };
    let level = graph.constant(level);
    Some(match coefficient > 0.0 {
        true => graph.sub(inner, level),
        false => graph.sub(level, inner),
    })
}

/// The operands that a sum, a product or a quotient is made of.
fn terms_and_factors(graph: &Graph, id: NodeId) -> Vec<NodeId> {
    use BinaryOp::{Add, Div, Mul, Sub};
    match *graph.node(id) {
        Node::Unary(UnaryOp::Neg, a) => vec![a],
        Node::Binary(Add | Sub | Mul | Div, a, b) => vec![a, b],
        _ => Vec::new(),
    }
}

/// Is this a quotient whose divisor may vanish along a motion, or a tangent? Of a divisor that is a smooth function of one
/// sign the poles change no sign, and are left.
fn has_pole(graph: &Graph, id: NodeId) -> bool {
    match *graph.node(id) {
        Node::Unary(UnaryOp::Tan, a) => graph.facts(a).varies,
        Node::Binary(BinaryOp::Div, _, b) => {
            let facts = graph.facts(b);
            let form = LinearForm::of(graph, b);
            facts.varies
                && match graph.known_sign(&form) {
                    Some(Switching::Constant(_)) => form.constant == 0.0 && facts.has_sign,
                    _ => true,
                }
        }
        _ => false,
    }
}

impl Fractions<'_> {
    /// A node as a quotient, from those of its operands.
    fn of(&mut self, id: NodeId) -> Fraction {
        let whole = Fraction {
            numerator: id,
            denominator: None,
        };
        let is_pole = has_pole(self.graph, id);
        match *self.graph.node(id) {
            Node::Unary(UnaryOp::Tan, a) if is_pole => Fraction {
                numerator: self.graph.unary(UnaryOp::Sin, a),
                denominator: Some(self.graph.unary(UnaryOp::Cos, a)),
            },
            Node::Unary(UnaryOp::Neg, a) if self.known[&a].denominator.is_some() => Fraction {
                numerator: self.graph.neg(self.known[&a].numerator),
                ..self.known[&a]
            },
            Node::Binary(op, a, b)
                if self.known.contains_key(&a) && self.known.contains_key(&b) =>
            {
                let (of_a, of_b) = (self.known[&a], self.known[&b]);
                if !is_pole && of_a.denominator.is_none() && of_b.denominator.is_none() {
                    return whole;
                }
                match op {
                    // s (n/d) is n/(s d): the divisor of 1/abs(v) has one sign.
                    BinaryOp::Mul if matches!(*self.graph.node(a), Node::Sign(_)) => Fraction {
                        denominator: self.product(Some(a), of_b.denominator),
                        ..of_b
                    },
                    BinaryOp::Mul => Fraction {
                        numerator: self.graph.mul(of_a.numerator, of_b.numerator),
                        denominator: self.product(of_a.denominator, of_b.denominator),
                    },
                    BinaryOp::Div => Fraction {
                        numerator: match of_b.denominator {
                            Some(divisor) => self.graph.mul(of_a.numerator, divisor),
                            None => of_a.numerator,
                        },
                        denominator: self.product(of_a.denominator, Some(of_b.numerator)),
                    },
                    _ => self.sum(op, of_a, of_b),
                }
            }
            _ => whole,
        }
    }

    /// a + b or a - b over a common denominator.
    fn sum(&mut self, op: BinaryOp, a: Fraction, b: Fraction) -> Fraction {
        let is_common = a.denominator == b.denominator;
        let mut over = |own: NodeId, other: Option<NodeId>| match other {
            Some(other) if !is_common => self.graph.mul(own, other),
            _ => own,
        };
        let left = over(a.numerator, b.denominator);
        let right = over(b.numerator, a.denominator);
        Fraction {
            numerator: self.graph.binary(op, left, right),
            denominator: match is_common {
                true => a.denominator,
                false => self.product(a.denominator, b.denominator),
            },
        }
    }

    fn product(&mut self, a: Option<NodeId>, b: Option<NodeId>) -> Option<NodeId> {
        match (a, b) {
            (Some(a), Some(b)) => Some(self.graph.mul(a, b)),
            _ => a.or(b),
        }
    }
}
