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

impl Graph {
    /// An expression with the same sign, without the poles of quotients and tangents; `None` if there are none, or too many.
    pub(crate) fn without_poles(&mut self, id: NodeId) -> Option<NodeId> {
        let graph = &*self;
        let nodes = graph.reachable_by([id], |id| graph.terms_and_factors(id));
        let n_poles = nodes.iter().filter(|&&id| graph.has_pole(id)).count();
        if n_poles == 0 || n_poles > MOST_DENOMINATORS {
            return None;
        }
        let mut fractions = FxHashMap::default();
        for node in nodes {
            let fraction = self.as_fraction(node, &fractions);
            fractions.insert(node, fraction);
        }
        let Fraction {
            numerator,
            denominator,
        } = fractions[&id];
        let denominator = denominator?;
        let form = LinearForm::of(self, denominator);
        Some(match self.known_sign(&form) {
            Some(Switching::Constant(1.0)) => numerator,
            Some(Switching::Constant(-1.0)) => self.neg(numerator),
            _ => self.mul(numerator, denominator),
        })
    }

    /// The operands that a sum, a product or a quotient is made of.
    fn terms_and_factors(&self, id: NodeId) -> Vec<NodeId> {
        use BinaryOp::{Add, Div, Mul, Sub};
        match *self.node(id) {
            Node::Unary(UnaryOp::Neg, a) => vec![a],
            Node::Binary(Add | Sub | Mul | Div, a, b) => vec![a, b],
            _ => Vec::new(),
        }
    }

    /// Is this a quotient whose divisor may vanish along a motion, or a tangent? Of a divisor that is a smooth function of one
    /// sign the poles change no sign, and are left.
    fn has_pole(&self, id: NodeId) -> bool {
        match *self.node(id) {
            Node::Unary(UnaryOp::Tan, a) => self.facts(a).varies,
            Node::Binary(BinaryOp::Div, _, b) => {
                let facts = self.facts(b);
                let form = LinearForm::of(self, b);
                facts.varies
                    && match self.known_sign(&form) {
                        Some(Switching::Constant(_)) => form.constant == 0.0 && facts.has_sign,
                        _ => true,
                    }
            }
            _ => false,
        }
    }

    /// A node as a quotient, from those of its operands.
    fn as_fraction(&mut self, id: NodeId, known: &FxHashMap<NodeId, Fraction>) -> Fraction {
        let whole = |id| Fraction {
            numerator: id,
            denominator: None,
        };
        let is_pole = self.has_pole(id);
        match *self.node(id) {
            Node::Unary(UnaryOp::Tan, a) if is_pole => Fraction {
                numerator: self.unary(UnaryOp::Sin, a),
                denominator: Some(self.unary(UnaryOp::Cos, a)),
            },
            Node::Unary(UnaryOp::Neg, a) if known[&a].denominator.is_some() => Fraction {
                numerator: self.neg(known[&a].numerator),
                ..known[&a]
            },
            Node::Binary(op, a, b) if known.contains_key(&a) && known.contains_key(&b) => {
                let (of_a, of_b) = (known[&a], known[&b]);
                if !is_pole && of_a.denominator.is_none() && of_b.denominator.is_none() {
                    return whole(id);
                }
                match op {
                    // s (n/d) is n/(s d): the divisor of 1/abs(v) has one sign.
                    BinaryOp::Mul if matches!(*self.node(a), Node::Sign(_)) => Fraction {
                        denominator: of_b.denominator.map(|divisor| self.mul(a, divisor)),
                        ..of_b
                    },
                    BinaryOp::Mul => Fraction {
                        numerator: self.mul(of_a.numerator, of_b.numerator),
                        denominator: self
                            .product_of_denominators(of_a.denominator, of_b.denominator),
                    },
                    BinaryOp::Div => {
                        let numerator =
                            self.product_of_denominators(Some(of_a.numerator), of_b.denominator);
                        Fraction {
                            numerator: numerator.unwrap_or(of_a.numerator),
                            denominator: self
                                .product_of_denominators(of_a.denominator, Some(of_b.numerator)),
                        }
                    }
                    _ => self.sum_of_fractions(op, of_a, of_b),
                }
            }
            _ => whole(id),
        }
    }

    /// a + b or a - b over a common denominator.
    fn sum_of_fractions(&mut self, op: BinaryOp, a: Fraction, b: Fraction) -> Fraction {
        let is_common = a.denominator == b.denominator;
        let mut over = |own: NodeId, other: Option<NodeId>| match other {
            Some(other) if !is_common => self.mul(own, other),
            _ => own,
        };
        let left = over(a.numerator, b.denominator);
        let right = over(b.numerator, a.denominator);
        Fraction {
            numerator: self.binary(op, left, right),
            denominator: match is_common {
                true => a.denominator,
                false => self.product_of_denominators(a.denominator, b.denominator),
            },
        }
    }

    fn product_of_denominators(&mut self, a: Option<NodeId>, b: Option<NodeId>) -> Option<NodeId> {
        match (a, b) {
            (Some(a), Some(b)) => Some(self.mul(a, b)),
            _ => a.or(b),
        }
    }
}
