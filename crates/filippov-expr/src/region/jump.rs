//! Jumps: does an expression that contains signs change suddenly where one of them does?

use rustc_hash::FxHashMap;

use crate::inverses;
use crate::linear::LinearForm;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::region::Regions;

/// That many combinations of other signs are looked at before a jump is taken for granted.
const MOST_COMBINATIONS: usize = 64;

impl Regions {
    /// A surface at which an expression jumps, or is not seen to be continuous; none if it is continuous at all of them.
    ///
    /// It is continuous at h_k = 0 if the difference of its values on the two sides vanishes there, as that of `maximum(a, b)`
    /// on a - b = 0 does, or if all its operands are continuous.
    pub fn jumps_at(&mut self, node: NodeId) -> Option<u32> {
        self.all_jumps(node, &[]).first().copied()
    }

    /// Whether some of the values jump at a surface where some signs are fixed, or are not seen to be continuous there:
    /// themselves, or the functions of other surfaces on which they depend there.
    ///
    /// If not, the sign of the surface makes no difference where its function is zero.
    pub fn jump_across(&mut self, roots: &[NodeId], signs: &[Option<f64>], surface: u32) -> bool {
        self.values_read(roots, signs, Some(surface))
            .into_iter()
            .any(|value| self.all_jumps(value, signs).contains(&surface))
    }

    /// The surfaces at which an expression jumps where some signs are fixed, or is not seen to be continuous, in increasing
    /// order. The expression has these signs already.
    fn all_jumps(&mut self, node: NodeId, signs: &[Option<f64>]) -> Vec<u32> {
        let mut known: FxHashMap<NodeId, Vec<u32>> = FxHashMap::default();
        for id in self.graph.all_below(&[node]) {
            if !self.graph.facts(id).has_sign {
                continue;
            }
            let node = self.graph.node(id);
            let mut candidates: Vec<u32> = node.surface().into_iter().collect();
            for operand in node.operands() {
                candidates.extend(known.get(&operand).into_iter().flatten());
            }
            candidates.sort_unstable();
            candidates.dedup();
            candidates.retain(|&k| self.jumps_on(id, signs, k));
            known.insert(id, candidates);
        }
        known.remove(&node).unwrap_or_default()
    }

    /// Whether the two sides of a surface differ on it, as far as it is seen.
    fn jumps_on(&mut self, node: NodeId, signs: &[Option<f64>], surface: u32) -> bool {
        let difference = self.difference(node, surface);
        let mut signs = signs.to_vec();
        signs.resize(self.graph.n_surfaces(), None);
        let mut pending = vec![(difference, signs)];
        let mut n_visited = 0;
        while let Some((value, signs)) = pending.pop() {
            let function = self.graph.surface(surface);
            let function = self.graph.at_signs(&[function], &signs)[0];
            if self.vanishes_with(value, function) {
                continue;
            }
            let depends = self.graph.sign_dependencies(&[value, function], &[]);
            let next = depends.iter().position(|&depends| depends);
            n_visited += 1;
            let (Some(k), true) = (next, n_visited <= MOST_COMBINATIONS) else {
                return true;
            };
            for sign in [1.0, -1.0] {
                let mut signs = signs.clone();
                signs[k] = Some(sign);
                if self.is_possible(&signs, Some((function, 0.0))) {
                    pending.push((self.graph.at_signs(&[value], &signs)[0], signs));
                }
            }
        }
        false
    }

    /// Whether a value is seen to be zero where the function of a surface is.
    pub(crate) fn is_zero_on(&mut self, value: NodeId, surface: u32) -> bool {
        let function = self.graph.surface(surface);
        self.vanishes_with(value, function)
    }

    /// Whether two values are seen to be the same where the function of a surface is zero.
    pub(crate) fn is_same_on(&mut self, one: NodeId, other: NodeId, surface: u32) -> bool {
        let difference = self.graph.sub(one, other);
        self.is_zero_on(difference, surface)
    }

    /// Whether a value is zero wherever a function is.
    pub(super) fn vanishes_with(&mut self, value: NodeId, function: NodeId) -> bool {
        let form = LinearForm::of(&self.graph, value);
        if form.is_zero() {
            return true;
        }
        let of_function = LinearForm::of(&self.graph, function).key();
        if let (Some((own, _)), Some((other, _))) = (form.key(), &of_function) {
            if own.matches(other) {
                return true;
            }
        }
        // The surface of log(x) is x - 1.
        if let Some((rootless, _)) = inverses::within_domain(&mut self.graph, &form) {
            if self.vanishes_with(rootless, function) {
                return true;
            }
        }
        if form.constant != 0.0 {
            return false;
        }
        let terms = form.terms;
        terms.into_iter().all(|(atom, _)| {
            use UnaryOp::*;
            match *self.graph.node(atom) {
                Node::Unary(
                    Sqrt | Cbrt | Expm1 | Log1p | Sin | Tan | Sinh | Tanh | Asin | Atan | Asinh
                    | Atanh | Erf,
                    a,
                ) => self.vanishes_with(a, function),
                Node::Binary(BinaryOp::Mul, a, b) => {
                    self.vanishes_with(a, function) || self.vanishes_with(b, function)
                }
                Node::Binary(BinaryOp::Div, a, _) => self.vanishes_with(a, function),
                Node::Binary(BinaryOp::Pow, a, b) => {
                    self.graph.as_constant(b).is_some_and(|b| b > 0.0)
                        && self.vanishes_with(a, function)
                }
                _ => false,
            }
        })
    }
}
