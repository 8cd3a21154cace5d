//! The node of the expression graph, and what is known about it from its operands alone.

use std::hash::{Hash, Hasher};

use crate::op::{BinaryOp, UnaryOp};

/// Number of a node in its [`Graph`](crate::Graph); operands have smaller numbers than what uses them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub u32);

impl NodeId {
    /// The number as an index.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// One node of the graph. Two nodes are equal if they are the same operation on the same operands;
/// constants are compared by their bits, so that `0.0` and `-0.0` differ and a NaN equals itself.
#[derive(Debug, Clone, Copy)]
pub enum Node {
    /// A number.
    Constant(f64),
    /// The time t.
    Time,
    /// The state variable x_i.
    State(u32),
    /// The parameter p_i.
    Parameter(u32),
    /// The data s_j in {-1, +1} that says on which side of surface j the field is taken.
    Sign(u32),
    /// Component i of an extra vector v handed in at evaluation.
    Input(u32),
    /// A function of one operand.
    Unary(UnaryOp, NodeId),
    /// A function of two operands.
    Binary(BinaryOp, NodeId, NodeId),
    /// `plus` where s_j > 0, else `minus`; the branch not taken has no influence, not even by a NaN.
    Select {
        /// The surface j whose sign decides.
        surface: u32,
        /// Value on the side h_j > 0.
        plus: NodeId,
        /// Value on the side h_j < 0.
        minus: NodeId,
    },
}

impl Node {
    /// The operands, in order.
    pub fn operands(&self) -> impl Iterator<Item = NodeId> {
        let (a, b) = match *self {
            Node::Unary(_, a) => (Some(a), None),
            Node::Binary(_, a, b) => (Some(a), Some(b)),
            Node::Select { plus, minus, .. } => (Some(plus), Some(minus)),
            _ => (None, None),
        };
        a.into_iter().chain(b)
    }

    /// The surface whose sign the node reads itself, not through an operand.
    pub fn surface(&self) -> Option<u32> {
        match *self {
            Node::Sign(surface) | Node::Select { surface, .. } => Some(surface),
            _ => None,
        }
    }

    /// Two numbers that identify the node: a tag with one that has up to 32 bits, and one that has more.
    #[inline]
    fn key(&self) -> (u64, u64) {
        let tagged = |tag: u8, small: u32| u64::from(tag) << 32 | u64::from(small);
        let leaf = |tag: u8, index: u32| (tagged(tag, 0), u64::from(index));
        match *self {
            Node::Constant(value) => (tagged(0, 0), value.to_bits()),
            Node::Time => leaf(1, 0),
            Node::State(i) => leaf(2, i),
            Node::Parameter(i) => leaf(3, i),
            Node::Sign(j) => leaf(4, j),
            Node::Input(i) => leaf(5, i),
            Node::Unary(op, a) => leaf(6 + op as u8, a.0),
            Node::Binary(op, a, b) => (tagged(64 + op as u8, b.0), u64::from(a.0)),
            Node::Select {
                surface,
                plus,
                minus,
            } => (
                tagged(128, surface),
                u64::from(plus.0) << 32 | u64::from(minus.0),
            ),
        }
    }
}

impl PartialEq for Node {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for Node {}

impl Hash for Node {
    #[inline]
    fn hash<H: Hasher>(&self, state: &mut H) {
        let (tagged, rest) = self.key();
        state.write_u64(tagged);
        state.write_u64(rest);
    }
}

/// Facts about a node that follow from those of its operands, kept beside it so that a query is O(1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Facts {
    /// Contains a state variable.
    pub has_state: bool,
    /// Contains the time, a state, a sign or an input: varies along a motion.
    pub varies: bool,
    /// Contains a sign or a select.
    pub has_sign: bool,
    /// Affine in (t, x) with coefficients of constants and parameters.
    pub affine: bool,
    /// At least 0 wherever it is defined, with isolated zeros at most. Where nothing varies: greater than 0,
    /// so the square of a parameter, which may be 0 throughout, is not meant.
    pub nonnegative: bool,
}

impl Facts {
    /// The facts of a node from the facts of its operands (`Default` for operands that do not exist).
    pub fn of(node: &Node, a: Facts, b: Facts) -> Facts {
        let mut facts = Facts {
            has_state: a.has_state || b.has_state,
            varies: a.varies || b.varies,
            has_sign: a.has_sign || b.has_sign,
            affine: false,
            nonnegative: false,
        };
        match *node {
            Node::Constant(value) => {
                facts.affine = true;
                facts.nonnegative = value > 0.0;
            }
            Node::Parameter(_) => facts.affine = true,
            Node::Time => (facts.varies, facts.affine) = (true, true),
            Node::State(_) => (facts.has_state, facts.varies, facts.affine) = (true, true, true),
            Node::Sign(_) => (facts.varies, facts.has_sign) = (true, true),
            Node::Input(_) => facts.varies = true,
            Node::Unary(op, _) => {
                facts.affine = !a.varies || (op == UnaryOp::Neg && a.affine);
                facts.nonnegative = match op {
                    UnaryOp::Exp | UnaryOp::Exp2 | UnaryOp::Cosh => true,
                    // As its argument is in the regions of its signs.
                    UnaryOp::NotNegative => a.varies,
                    UnaryOp::Sqrt | UnaryOp::Acos | UnaryOp::Acosh => a.varies || a.nonnegative,
                    UnaryOp::Cbrt
                    | UnaryOp::Expm1
                    | UnaryOp::Log1p
                    | UnaryOp::Sinh
                    | UnaryOp::Tanh
                    | UnaryOp::Asin
                    | UnaryOp::Atan
                    | UnaryOp::Asinh
                    | UnaryOp::Atanh
                    | UnaryOp::Erf => a.nonnegative,
                    _ => false,
                };
            }
            Node::Binary(op, left, right) => {
                let constant = !a.varies && !b.varies;
                facts.affine = constant
                    || match op {
                        BinaryOp::Add | BinaryOp::Sub => a.affine && b.affine,
                        BinaryOp::Mul => a.affine && b.affine && (!a.varies || !b.varies),
                        BinaryOp::Div => a.affine && !b.varies,
                        _ => false,
                    };
                facts.nonnegative = match op {
                    BinaryOp::Add | BinaryOp::Div => a.nonnegative && b.nonnegative,
                    BinaryOp::Mul => {
                        (left == right && a.varies) || (a.nonnegative && b.nonnegative)
                    }
                    BinaryOp::Pow => a.nonnegative,
                    BinaryOp::Hypot => !constant || a.nonnegative || b.nonnegative,
                    BinaryOp::Sub | BinaryOp::Atan2 => false,
                };
            }
            Node::Select { .. } => {
                facts.varies = true;
                facts.has_sign = true;
                facts.nonnegative = a.nonnegative && b.nonnegative;
            }
        }
        facts
    }
}
