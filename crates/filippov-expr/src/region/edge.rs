//! Edges of domains: functions that end, or have a pole or a vertical tangent, where signs inside of an expression change.
//!
//! The expression of one region is evaluated beyond its border too. `sqrt(abs(x))` is the root of x or of -x, and ends at x = 0.

use crate::linear::LinearForm;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::region::{Possible, Regions};

/// That many combinations of signs are looked at.
const MOST_COMBINATIONS: usize = 64;

/// An argument that is nowhere in a region nearer than this to an end of the domain does not reach it behind the border.
const CLEAR_OF_END: f64 = 1e-6;

/// A function in an expression that ends or is singular at the border of a region.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edge {
    /// This root, power, logarithm or arc function may not exist beyond a border.
    Domain(NodeId),
    /// This quotient or cube root is singular on a border.
    Singular(NodeId),
}

impl Regions {
    /// The first function of an expression that ends or is singular at a border of its regions, singular ones first.
    pub fn edge(&mut self, node: NodeId) -> Option<Edge> {
        if !self.graph.facts(node).has_sign {
            return None;
        }
        let nodes = self.graph.all_below(&[node]);
        let singular = nodes.iter().find(|&&id| self.is_singular(node, id));
        if let Some(&id) = singular {
            return Some(Edge::Singular(id));
        }
        let ends = nodes.into_iter().find(|&id| self.may_end(id));
        ends.map(Edge::Domain)
    }

    /// Whether a quotient or a cube root inside of an expression is singular on one of its surfaces.
    fn is_singular(&mut self, node: NodeId, id: NodeId) -> bool {
        let a = match *self.graph.node(id) {
            Node::Unary(UnaryOp::Cbrt, a) | Node::Binary(BinaryOp::Div, _, a) => a,
            _ => return false,
        };
        if !self.graph.depends_on_motion(a) {
            return false;
        }
        let n = self.graph.n_surfaces();
        let depends = self.graph.sign_dependencies(&[node], &[]);
        let surfaces = (0..n).filter(|&k| depends[k]);
        let functions: Vec<NodeId> = surfaces.map(|k| self.graph.surface(k as u32)).collect();
        let mut pending = vec![(a, vec![None; n])];
        let mut n_visited = 0;
        while let Some((value, signs)) = pending.pop() {
            n_visited += 1;
            let own = LinearForm::of(&self.graph, value).key();
            let at = self.graph.at_signs(&functions, &signs);
            let is_same = |function: &NodeId| {
                let other = LinearForm::of(&self.graph, *function).key();
                matches!((&own, &other), (Some((own, _)), Some((other, _))) if own.matches(other))
            };
            if at.iter().any(is_same) {
                return true;
            }
            let depends = self.graph.sign_dependencies(&[value], &[]);
            let next = depends.iter().position(|&depends| depends);
            let (Some(k), true) = (next, n_visited <= MOST_COMBINATIONS) else {
                continue;
            };
            for sign in [1.0, -1.0] {
                let mut signs = signs.clone();
                signs[k] = Some(sign);
                if self.possible(&signs, None) == Possible::Yes {
                    pending.push((self.graph.at_signs(&[value], &signs)[0], signs));
                }
            }
        }
        false
    }

    /// Whether a function with a bounded domain has an argument with signs that may leave it.
    fn may_end(&mut self, id: NodeId) -> bool {
        use UnaryOp::*;
        // The ends of the domain, and on which side of them it is.
        let (a, ends): (_, &[(f64, f64)]) = match *self.graph.node(id) {
            Node::Unary(Sqrt | Log | Log2 | Log10, a) => (a, &[(0.0, 1.0)]),
            Node::Unary(Log1p, a) => (a, &[(-1.0, 1.0)]),
            Node::Unary(Acosh, a) => (a, &[(1.0, 1.0)]),
            Node::Unary(Asin | Acos | Atanh, a) => (a, &[(-1.0, 1.0), (1.0, -1.0)]),
            Node::Binary(BinaryOp::Pow, a, b) => match self.graph.as_constant(b) {
                Some(b) if b.fract() == 0.0 => return false,
                _ => (a, &[(0.0, 1.0)]),
            },
            _ => return false,
        };
        if !self.graph.facts(a).has_sign {
            return false;
        }
        let Some(values) = self.expressions(a) else {
            return true;
        };
        values.into_iter().any(|(value, signs)| {
            let is_safe = !self.graph.depends_on_motion(value)
                || ends == [(0.0, 1.0)] && self.graph.facts(value).nonnegative;
            let mut reaches = |&(end, side): &(f64, f64)| {
                let border = self.graph.constant(end + side * CLEAR_OF_END);
                let inside = self.graph.sub(value, border);
                self.possible(&signs, Some((inside, -side))) == Possible::Yes
            };
            !is_safe && ends.iter().any(&mut reaches)
        })
    }

    /// What an expression is in its regions, with their signs; none if there are too many.
    fn expressions(&mut self, node: NodeId) -> Option<Vec<(NodeId, Vec<Option<f64>>)>> {
        let mut found = Vec::new();
        let mut pending = vec![(node, vec![None; self.graph.n_surfaces()])];
        while let Some((value, signs)) = pending.pop() {
            let depends = self.graph.sign_dependencies(&[value], &[]);
            let Some(k) = depends.iter().position(|&depends| depends) else {
                found.push((value, signs));
                continue;
            };
            if found.len() + pending.len() > MOST_COMBINATIONS {
                return None;
            }
            for sign in [1.0, -1.0] {
                let mut signs = signs.clone();
                signs[k] = Some(sign);
                if self.possible(&signs, None) == Possible::Yes {
                    pending.push((self.graph.at_signs(&[value], &signs)[0], signs));
                }
            }
        }
        Some(found)
    }
}
