//! Construction of nodes with simplification.
//!
//! What is done is exact in floating point for finite operands, except: `0 * x -> 0`, `0 / x -> 0`,
//! `x / x -> 1`, `x - x -> 0` (they drop NaN and infinities), `c1 * (c2 * x) -> (c1 c2) * x`,
//! `x * (1 / y) -> x / y` and small integer powers as products (an ulp or a few each). Sums are never
//! reordered. The signs s = +-1 are moved to the front of products, which is exact, so that `s * s` is seen.

use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};

/// Integer exponents up to this magnitude become products: by repeated squaring at most 4 of them, so
/// that the error stays at a few ulp, as NumPy's own for such powers.
const LARGEST_PRODUCT_POWER: f64 = 8.0;

/// In products of more signs than this they stay where they are: moving one past n others makes n nodes.
const MOST_MOVED_SIGNS: usize = 6;

/// A factor of a product is looked for that deep.
const DEEPEST_FACTOR: u32 = 3;

impl Graph {
    /// `op(a)`, simplified.
    pub fn unary(&mut self, op: UnaryOp, a: NodeId) -> NodeId {
        if let Some(value) = self.as_constant(a) {
            return self.constant(op.apply(value));
        }
        match op {
            UnaryOp::Neg => self.negative(a),
            UnaryOp::Sqrt => match *self.node(a) {
                // It has a kink, at a surface of its own.
                Node::Binary(BinaryOp::Mul, b, c) if b == c => self.abs(b),
                _ => self.insert(Node::Unary(op, a)),
            },
            _ => self.insert(Node::Unary(op, a)),
        }
    }

    /// `op(a, b)`, simplified.
    pub fn binary(&mut self, op: BinaryOp, a: NodeId, b: NodeId) -> NodeId {
        if let (Some(x), Some(y)) = (self.as_constant(a), self.as_constant(b)) {
            return self.constant(op.apply(x, y));
        }
        let is_nan = |graph: &Self, id| graph.as_constant(id).is_some_and(f64::is_nan);
        let is_arithmetic = matches!(
            op,
            BinaryOp::Add | BinaryOp::Sub | BinaryOp::Mul | BinaryOp::Div
        );
        if is_arithmetic && (is_nan(self, a) || is_nan(self, b)) {
            return self.constant(f64::NAN);
        }
        match op {
            BinaryOp::Add => self.sum(a, b),
            BinaryOp::Sub => self.difference(a, b),
            BinaryOp::Mul => self.product(a, b),
            BinaryOp::Div => self.quotient(a, b),
            BinaryOp::Pow => self.power(a, b),
            BinaryOp::Hypot => self.insert(Node::Binary(op, a.min(b), a.max(b))),
            BinaryOp::Atan2 => self.insert(Node::Binary(op, a, b)),
        }
    }

    /// `plus` where `orientation * s_surface > 0`, else `minus`.
    ///
    /// Equal branches collapse, a branch that asks for the same sign again is resolved, and branches that
    /// are opposite become `s * plus`, which shows that the value is affine in the sign.
    pub fn select(
        &mut self,
        surface: u32,
        orientation: f64,
        plus: NodeId,
        minus: NodeId,
    ) -> NodeId {
        let (plus, minus) = if orientation < 0.0 {
            (minus, plus)
        } else {
            (plus, minus)
        };
        let plus = self.resolved(surface, 1.0, plus);
        let minus = self.resolved(surface, -1.0, minus);
        if plus == minus {
            return plus;
        }
        let opposite = match (self.as_constant(plus), self.as_constant(minus)) {
            (Some(a), Some(b)) => a == -b && a != 0.0,
            (None, None) => self.are_opposite(plus, minus),
            _ => false,
        };
        if opposite {
            let sign = self.sign_of(surface);
            return self.mul(sign, plus);
        }
        self.insert(Node::Select {
            surface,
            plus,
            minus,
        })
    }

    /// What a branch is, given that s_surface = `sign` in it (looking at its outermost operation only).
    fn resolved(&mut self, surface: u32, sign: f64, branch: NodeId) -> NodeId {
        match *self.node(branch) {
            Node::Select {
                surface: inner,
                plus,
                minus,
            } if inner == surface => {
                if sign > 0.0 {
                    plus
                } else {
                    minus
                }
            }
            Node::Sign(inner) if inner == surface => self.constant(sign),
            Node::Binary(BinaryOp::Mul, left, right) if *self.node(left) == Node::Sign(surface) => {
                if sign > 0.0 {
                    right
                } else {
                    self.neg(right)
                }
            }
            _ => branch,
        }
    }

    /// Whether one is the negative of the other, seen from the outermost operation only, without new nodes.
    fn are_opposite(&self, a: NodeId, b: NodeId) -> bool {
        match (*self.node(a), *self.node(b)) {
            (Node::Unary(UnaryOp::Neg, inner), _) if inner == b => true,
            (_, Node::Unary(UnaryOp::Neg, inner)) if inner == a => true,
            (Node::Binary(BinaryOp::Sub, p, q), Node::Binary(BinaryOp::Sub, r, s)) => {
                p == s && q == r
            }
            (Node::Binary(BinaryOp::Mul, c, p), Node::Binary(BinaryOp::Mul, d, q)) if p == q => {
                matches!((self.as_constant(c), self.as_constant(d)), (Some(c), Some(d)) if c == -d)
            }
            _ => false,
        }
    }

    fn negative(&mut self, a: NodeId) -> NodeId {
        match *self.node(a) {
            Node::Constant(value) => self.constant(-value),
            Node::Unary(UnaryOp::Neg, inner) => inner,
            Node::Binary(BinaryOp::Sub, left, right) => self.sub(right, left),
            Node::Binary(op @ (BinaryOp::Mul | BinaryOp::Div), left, right) => {
                match self.as_constant(left) {
                    Some(c) => {
                        let factor = self.constant(-c);
                        self.binary(op, factor, right)
                    }
                    None => self.insert(Node::Unary(UnaryOp::Neg, a)),
                }
            }
            _ => self.insert(Node::Unary(UnaryOp::Neg, a)),
        }
    }

    fn sum(&mut self, a: NodeId, b: NodeId) -> NodeId {
        // A constant stands last (x + 1), everything else in order of creation.
        let constant_first = self.as_constant(a).is_some();
        let (a, b) = if constant_first || (a > b && self.as_constant(b).is_none()) {
            (b, a)
        } else {
            (a, b)
        };
        if let Some(c) = self.as_constant(b) {
            if c == 0.0 {
                return a;
            }
            if c < 0.0 {
                let magnitude = self.constant(-c);
                return self.insert(Node::Binary(BinaryOp::Sub, a, magnitude));
            }
            if let Node::Unary(UnaryOp::Neg, inner) = *self.node(a) {
                return self.insert(Node::Binary(BinaryOp::Sub, b, inner));
            }
            return self.insert(Node::Binary(BinaryOp::Add, a, b));
        }
        if a == b {
            let two = self.constant(2.0);
            return self.product(two, a);
        }
        match (*self.node(a), *self.node(b)) {
            (_, Node::Unary(UnaryOp::Neg, inner)) => self.difference(a, inner),
            (Node::Unary(UnaryOp::Neg, inner), _) => self.difference(b, inner),
            _ => self.insert(Node::Binary(BinaryOp::Add, a, b)),
        }
    }

    fn difference(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if a == b {
            return self.constant(0.0);
        }
        match (self.as_constant(a), self.as_constant(b)) {
            (_, Some(0.0)) => return a,
            (Some(0.0), _) => return self.negative(b),
            (_, Some(c)) if c < 0.0 => {
                let magnitude = self.constant(-c);
                return self.sum(a, magnitude);
            }
            _ => {}
        }
        if let Node::Unary(UnaryOp::Neg, inner) = *self.node(b) {
            return self.sum(a, inner);
        }
        self.insert(Node::Binary(BinaryOp::Sub, a, b))
    }

    fn product(&mut self, a: NodeId, b: NodeId) -> NodeId {
        let (a, b) = if self.as_constant(b).is_some() {
            (b, a)
        } else {
            (a, b)
        };
        if let Some(c) = self.as_constant(a) {
            return self.scaled(c, b);
        }
        let (negative, a, b) = self.without_negatives(a, b);
        if negative {
            let product = self.product(a, b);
            return self.negative(product);
        }
        if self.have_few_signs(a, b) {
            let moved = self
                .product_with_sign(a, b)
                .or_else(|| self.product_with_sign(b, a));
            if let Some(moved) = moved {
                return moved;
            }
        }
        let (a, b) = (a.min(b), a.max(b));
        for (factor, quotient) in [(a, b), (b, a)] {
            if let Node::Binary(BinaryOp::Div, one, divisor) = *self.node(quotient) {
                if self.as_constant(one) == Some(1.0) {
                    return self.quotient(factor, divisor);
                }
            }
        }
        self.insert(Node::Binary(BinaryOp::Mul, a, b))
    }

    /// `c * a` for a number c.
    fn scaled(&mut self, c: f64, a: NodeId) -> NodeId {
        if let Some(value) = self.as_constant(a) {
            return self.constant(c * value);
        }
        if c == 0.0 {
            return self.constant(0.0);
        }
        if c == 1.0 {
            return a;
        }
        if c == -1.0 {
            return self.negative(a);
        }
        match *self.node(a) {
            Node::Unary(UnaryOp::Neg, inner) => return self.scaled(-c, inner),
            Node::Binary(BinaryOp::Mul, left, right) => {
                if let Some(inner) = self.as_constant(left) {
                    if (c * inner).is_normal() {
                        return self.scaled(c * inner, right);
                    }
                }
            }
            _ => {}
        }
        let factor = self.constant(c);
        self.insert(Node::Binary(BinaryOp::Mul, factor, a))
    }

    /// Takes the minus signs off two factors: whether the product is negated, and the bare factors.
    fn without_negatives(&self, a: NodeId, b: NodeId) -> (bool, NodeId, NodeId) {
        let bare = |id| match *self.node(id) {
            Node::Unary(UnaryOp::Neg, inner) => (true, inner),
            _ => (false, id),
        };
        let ((minus_a, a), (minus_b, b)) = (bare(a), bare(b));
        (minus_a != minus_b, a, b)
    }

    /// `a * b` where a is a sign or a product with a sign or a number in front: that factor moves to the
    /// outside, in the order number, signs by surface, rest. `None` if there is nothing to move.
    fn product_with_sign(&mut self, a: NodeId, b: NodeId) -> Option<NodeId> {
        if let Node::Sign(j) = *self.node(a) {
            return match *self.node(b) {
                Node::Sign(k) if k == j => Some(self.constant(1.0)),
                Node::Sign(_) => {
                    let (first, second) = if self.surface_before(a, b) {
                        (a, b)
                    } else {
                        (b, a)
                    };
                    Some(self.insert(Node::Binary(BinaryOp::Mul, first, second)))
                }
                Node::Binary(BinaryOp::Mul, left, right) => match *self.node(left) {
                    Node::Sign(k) if k == j => Some(right),
                    Node::Sign(k) if k < j => {
                        let inner = self.product(a, right);
                        Some(self.product(left, inner))
                    }
                    Node::Constant(c) => {
                        let inner = self.product(a, right);
                        Some(self.scaled(c, inner))
                    }
                    _ => Some(self.insert(Node::Binary(BinaryOp::Mul, a, b))),
                },
                Node::Constant(c) => Some(self.scaled(c, a)),
                _ => Some(self.insert(Node::Binary(BinaryOp::Mul, a, b))),
            };
        }
        let Node::Binary(BinaryOp::Mul, left, right) = *self.node(a) else {
            return None;
        };
        match *self.node(left) {
            Node::Sign(_) => {
                let inner = self.product(right, b);
                Some(self.product(left, inner))
            }
            _ => None,
        }
    }

    /// Whether the signs in front of two factors are few enough to move them.
    fn have_few_signs(&self, a: NodeId, b: NodeId) -> bool {
        let mut count = 0;
        for factor in [a, b] {
            let mut rest = factor;
            while let Node::Binary(BinaryOp::Mul, left, right) = *self.node(rest) {
                count += usize::from(matches!(*self.node(left), Node::Sign(_)));
                if count > MOST_MOVED_SIGNS || !matches!(*self.node(left), Node::Sign(_)) {
                    break;
                }
                rest = right;
            }
        }
        count <= MOST_MOVED_SIGNS
    }

    fn surface_before(&self, a: NodeId, b: NodeId) -> bool {
        matches!((*self.node(a), *self.node(b)), (Node::Sign(j), Node::Sign(k)) if j < k)
    }

    fn quotient(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if a == b {
            return self.constant(1.0);
        }
        if let Some(c) = self.as_constant(b) {
            if c == 1.0 {
                return a;
            }
            if c == -1.0 {
                return self.negative(a);
            }
        }
        if self.as_constant(a) == Some(0.0) {
            return self.constant(0.0);
        }
        let (negative, a, b) = self.without_negatives(a, b);
        if negative {
            let quotient = self.quotient(a, b);
            return self.negative(quotient);
        }
        // A common factor cancels, as `0*x` is 0: the quotient is not NaN where the factor vanishes.
        if let Some(rest) = self.divided_by_factor(a, b, DEEPEST_FACTOR) {
            return rest;
        }
        // A sign is its own reciprocal: it leaves the quotient to the front.
        if !self.have_few_signs(a, b) {
            return self.insert(Node::Binary(BinaryOp::Div, a, b));
        }
        for (operand, is_divisor) in [(a, false), (b, true)] {
            let (sign, rest) = match *self.node(operand) {
                Node::Sign(_) => (operand, None),
                Node::Binary(BinaryOp::Mul, left, right)
                    if matches!(*self.node(left), Node::Sign(_)) =>
                {
                    (left, Some(right))
                }
                _ => continue,
            };
            let rest = rest.unwrap_or_else(|| self.constant(1.0));
            let inner = if is_divisor {
                self.binary(BinaryOp::Div, a, rest)
            } else {
                self.binary(BinaryOp::Div, rest, b)
            };
            return self.product(sign, inner);
        }
        self.insert(Node::Binary(BinaryOp::Div, a, b))
    }

    /// The product `a` without its factor `b`; none if it is not one, or further inside than `depth`.
    fn divided_by_factor(&mut self, a: NodeId, b: NodeId, depth: u32) -> Option<NodeId> {
        let Node::Binary(BinaryOp::Mul, left, right) = *self.node(a) else {
            return None;
        };
        if left == b {
            return Some(right);
        }
        if right == b {
            return Some(left);
        }
        let depth = depth.checked_sub(1)?;
        if let Some(rest) = self.divided_by_factor(right, b, depth) {
            return Some(self.mul(left, rest));
        }
        let rest = self.divided_by_factor(left, b, depth)?;
        Some(self.mul(rest, right))
    }

    fn power(&mut self, a: NodeId, b: NodeId) -> NodeId {
        if self.as_constant(a) == Some(1.0) {
            return a;
        }
        let Some(exponent) = self.as_constant(b) else {
            return self.insert(Node::Binary(BinaryOp::Pow, a, b));
        };
        if exponent.abs() == 0.5 {
            let root = self.unary(UnaryOp::Sqrt, a);
            return if exponent > 0.0 {
                root
            } else {
                self.reciprocal(root)
            };
        }
        if exponent.fract() != 0.0 || exponent.abs() > LARGEST_PRODUCT_POWER {
            return self.insert(Node::Binary(BinaryOp::Pow, a, b));
        }
        let product = self.product_power(a, exponent.abs() as u32);
        if exponent < 0.0 {
            self.reciprocal(product)
        } else {
            product
        }
    }

    fn reciprocal(&mut self, a: NodeId) -> NodeId {
        let one = self.constant(1.0);
        self.binary(BinaryOp::Div, one, a)
    }

    /// `a ** n` by repeated squaring.
    fn product_power(&mut self, a: NodeId, mut n: u32) -> NodeId {
        let mut result = self.constant(1.0);
        let mut square = a;
        while n > 0 {
            if n % 2 == 1 {
                result = self.product(result, square);
            }
            n /= 2;
            if n > 0 {
                square = self.binary(BinaryOp::Mul, square, square);
            }
        }
        result
    }
}

#[cfg(test)]
mod tests;
