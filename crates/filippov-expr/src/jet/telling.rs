//! What the Taylor coefficients of a value tell of it.

use rustc_hash::FxHashMap;

use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};

/// Factors of a product of which the first coefficients tell.
const MOST_FACTORS: u32 = 4;

impl Graph {
    /// Do the values have a Taylor series wherever they are finite? Roots, powers, logarithms and some inverse
    /// functions do not: they end, or bend sharply, at a finite value. An angle has none at the origin, where it has no value.
    pub fn is_analytic(&self, nodes: &[NodeId]) -> bool {
        use BinaryOp::{Hypot, Pow};
        use UnaryOp::{Acos, Acosh, Asin, Atanh, Cbrt, Log, Log10, Log1p, Log2, Sqrt};
        let all = self.all_below(nodes);
        !all.into_iter().any(|id| match *self.node(id) {
            Node::Unary(op, a) => {
                let is_edged = matches!(
                    op,
                    Sqrt | Cbrt | Log | Log1p | Log2 | Log10 | Asin | Acos | Acosh | Atanh
                );
                is_edged && self.facts(a).varies
            }
            Node::Binary(op, a, b) => {
                let is_edged = matches!(op, Pow | Hypot);
                is_edged && (self.facts(a).varies || self.facts(b).varies)
            }
            _ => false,
        })
    }

    /// May a value bend, jump or end: where a sign inside of it changes, a root begins, or an angle has its cut?
    pub fn has_kinks(&self, node: NodeId) -> bool {
        let is_angle = |id: &NodeId| matches!(self.node(*id), Node::Binary(BinaryOp::Atan2, ..));
        self.has_signs(node)
            || !self.is_analytic(&[node])
            || self.all_below(&[node]).iter().any(is_angle)
    }

    /// May the values change where no Taylor coefficient tells? Exponential functions, and what is made of them, come up
    /// from below rounding: far from a pulse exp(-t^2) all coefficients are as good as zero.
    pub fn hides_changes(&self, nodes: &[NodeId]) -> bool {
        use UnaryOp::{Cosh, Exp, Exp2, Expm1, Sinh, Tanh};
        let all = self.all_below(nodes);
        all.into_iter().any(|id| match *self.node(id) {
            Node::Unary(op, a) => {
                matches!(op, Exp | Expm1 | Exp2 | Sinh | Cosh | Tanh) && self.facts(a).varies
            }
            Node::Binary(BinaryOp::Pow, _, b) => self.facts(b).varies,
            _ => false,
        })
    }

    /// Do the first coefficients of their series tell of all that the values do, wherever that is? They do of waves, of
    /// states and of time, and of sums and products of a few of them. Quotients and high powers have narrow peaks, whose
    /// coefficients elsewhere are small: of these they may not.
    pub fn is_told_by_series(&self, nodes: &[NodeId]) -> bool {
        // The factors of the products that make up a value, none if it is told otherwise.
        let mut known: FxHashMap<NodeId, Option<u32>> = FxHashMap::default();
        for id in self.all_below(nodes) {
            let factors = match *self.node(id) {
                _ if !self.facts(id).varies => Some(0),
                Node::Time | Node::State(_) => Some(1),
                Node::Sign(_) => Some(0),
                Node::Unary(UnaryOp::Neg | UnaryOp::Sin | UnaryOp::Cos, a) => known[&a],
                Node::Binary(BinaryOp::Add | BinaryOp::Sub, a, b) => {
                    known[&a].zip(known[&b]).map(|(a, b)| a.max(b))
                }
                Node::Binary(BinaryOp::Mul, a, b) => {
                    let factors = known[&a].zip(known[&b]).map(|(a, b)| a + b);
                    factors.filter(|&factors| factors <= MOST_FACTORS)
                }
                Node::Binary(BinaryOp::Div, a, b) if !self.facts(b).varies => known[&a],
                Node::Select { plus, minus, .. } => {
                    known[&plus].zip(known[&minus]).map(|(a, b)| a.max(b))
                }
                _ => None,
            };
            known.insert(id, factors);
        }
        nodes.iter().all(|id| known[id].is_some())
    }
}

#[cfg(test)]
mod tests {
    use crate::graph::Graph;
    use crate::op::{BinaryOp, UnaryOp};

    #[test]
    fn coefficients_tell_of_waves_and_of_products_of_a_few() {
        let mut g = Graph::new();
        let (t, x, p) = (g.time(), g.state(0), g.parameter(0));
        let angle = g.mul(p, t);
        let wave = g.unary(UnaryOp::Sin, angle);
        let exit = g.sub(wave, x);
        let share = g.div(exit, p);
        let square = g.mul(wave, wave);
        let fourth = g.mul(square, square);
        assert!(g.is_told_by_series(&[exit, share, fourth]));
        let fifth = g.mul(fourth, wave);
        let quotient = g.div(p, share);
        let growth = g.unary(UnaryOp::Exp, x);
        let root = g.unary(UnaryOp::Sqrt, t);
        let power = g.binary(BinaryOp::Pow, x, p);
        for peaked in [fifth, quotient, growth, root, power] {
            assert!(!g.is_told_by_series(&[exit, peaked]));
        }
        // Of a number, whatever it is made of, nothing has to be told.
        let number = g.unary(UnaryOp::Exp, p);
        let scaled = g.mul(number, exit);
        assert!(g.is_told_by_series(&[scaled]));
    }

    #[test]
    fn exponential_functions_hide_what_comes() {
        let mut g = Graph::new();
        let (x, p) = (g.state(0), g.parameter(0));
        let (pulse, constant) = (g.unary(UnaryOp::Exp, x), g.unary(UnaryOp::Exp, p));
        assert!(g.hides_changes(&[pulse]) && !g.hides_changes(&[constant]));
        let (root, wave) = (g.unary(UnaryOp::Sqrt, x), g.unary(UnaryOp::Sin, x));
        assert!(g.is_analytic(&[wave, pulse]) && !g.is_analytic(&[root]));
    }
}
