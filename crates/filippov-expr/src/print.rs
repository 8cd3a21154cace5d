//! Expressions as text that reads like the Python they came from.

use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};

/// Text is cut off with `...` from about this length: a shared subexpression is printed at each place, and
/// their number can grow exponentially.
const LONGEST_TEXT: usize = 4000;

/// Names to print instead of `x[0]`, `p[0]`; the default is none.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Names {
    /// Of the states, by index.
    pub states: Vec<String>,
    /// Of the parameters, by index.
    pub parameters: Vec<String>,
}

/// How tightly an operation binds; an operand that binds less tightly than its place asks gets brackets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Anything,
    Sum,
    Product,
    /// The right operand of a product or quotient.
    Factor,
    /// The base of a power.
    Base,
}

/// What is still to be written.
enum Piece {
    Word(&'static str),
    Value(NodeId, Binding),
    /// The value with its leading minus left out; only where [`Graph::leads_with_minus`].
    Unsigned(NodeId, Binding),
}

impl Graph {
    /// The value as a formula, with as few brackets as it needs: `v - 0.2`, `-k*x[0] - F*sign(v)`.
    ///
    /// A sign is printed with its surface, a select as `where(h > 0, ..., ...)`, `a*a` as `a**2`. States and
    /// parameters without a name are `x[i]`, `p[i]`; components of the extra vector are `v[i]`. Very long
    /// texts are cut off with `...`.
    pub fn text(&self, id: NodeId, names: &Names) -> String {
        let mut text = String::new();
        let mut pending = vec![Piece::Value(id, Binding::Anything)];
        while let Some(piece) = pending.pop() {
            if text.len() > LONGEST_TEXT {
                text.push_str("...");
                break;
            }
            match piece {
                Piece::Word(word) => text.push_str(word),
                Piece::Value(id, place) => {
                    self.write(id, place, true, names, &mut text, &mut pending)
                }
                Piece::Unsigned(id, place) => {
                    self.write(id, place, false, names, &mut text, &mut pending)
                }
            }
        }
        text
    }

    /// Writes what can be written of a value at once and queues the rest (last piece first).
    fn write(
        &self,
        id: NodeId,
        place: Binding,
        signed: bool,
        names: &Names,
        text: &mut String,
        pending: &mut Vec<Piece>,
    ) {
        let node = *self.node(id);
        let start = pending.len();
        let bracketed = self.binding(&node, signed) < place;
        if bracketed {
            text.push('(');
        }
        match node {
            Node::Constant(value) => text.push_str(&number(if signed { value } else { -value })),
            Node::Time => text.push('t'),
            Node::State(i) => text.push_str(&variable(&names.states, "x", i)),
            Node::Parameter(i) => text.push_str(&variable(&names.parameters, "p", i)),
            Node::Input(i) => text.push_str(&variable(&[], "v", i)),
            Node::Sign(j) => match self.surfaces.functions.get(j as usize) {
                Some(&function) => call("sign", &[function], pending),
                None => text.push_str(&variable(&[], "s", j)),
            },
            Node::Unary(UnaryOp::Neg, a) => {
                if signed {
                    pending.push(Piece::Word("-"));
                }
                pending.push(Piece::Value(a, Binding::Product));
            }
            Node::Unary(UnaryOp::NotNegative, a) => pending.push(Piece::Value(a, Binding::Sum)),
            Node::Unary(op, a) => call(op.name(), &[a], pending),
            Node::Binary(op, a, b) => self.binary_pieces(op, a, b, signed, pending),
            Node::Select {
                surface,
                plus,
                minus,
            } => {
                pending.push(Piece::Word("where("));
                match self.surfaces.functions.get(surface as usize) {
                    Some(&function) => pending.push(Piece::Value(function, Binding::Sum)),
                    None => {
                        text.push_str("where(");
                        text.push_str(&variable(&[], "s", surface));
                        pending.pop();
                    }
                }
                pending.push(Piece::Word(" > 0, "));
                pending.push(Piece::Value(plus, Binding::Anything));
                pending.push(Piece::Word(", "));
                pending.push(Piece::Value(minus, Binding::Anything));
                pending.push(Piece::Word(")"));
            }
        }
        if bracketed {
            pending.push(Piece::Word(")"));
        }
        pending[start..].reverse();
    }

    fn binary_pieces(
        &self,
        op: BinaryOp,
        a: NodeId,
        b: NodeId,
        signed: bool,
        pending: &mut Vec<Piece>,
    ) {
        let first = |binding| {
            if signed {
                Piece::Value(a, binding)
            } else {
                Piece::Unsigned(a, binding)
            }
        };
        match op {
            BinaryOp::Add if self.leads_with_minus(b) => {
                pending.extend([
                    first(Binding::Sum),
                    Piece::Word(" - "),
                    Piece::Unsigned(b, Binding::Product),
                ]);
            }
            BinaryOp::Add => pending.extend([
                first(Binding::Sum),
                Piece::Word(" + "),
                Piece::Value(b, Binding::Sum),
            ]),
            BinaryOp::Sub if self.leads_with_minus(b) => {
                pending.extend([
                    first(Binding::Sum),
                    Piece::Word(" + "),
                    Piece::Unsigned(b, Binding::Product),
                ]);
            }
            BinaryOp::Sub => {
                pending.extend([
                    first(Binding::Sum),
                    Piece::Word(" - "),
                    Piece::Value(b, Binding::Product),
                ]);
            }
            BinaryOp::Mul if a == b => {
                pending.extend([Piece::Value(a, Binding::Base), Piece::Word("**2")])
            }
            BinaryOp::Mul if self.is_absolute(a, b) => call("abs", &[b], pending),
            BinaryOp::Mul if self.as_constant(a).map(f64::abs) == Some(1.0) => {
                pending.extend([
                    first(Binding::Product),
                    Piece::Word("*"),
                    Piece::Value(b, Binding::Factor),
                ]);
            }
            BinaryOp::Mul => {
                // a*(b*c) needs no brackets; a*(b/c) keeps them, as (a*b)/c would be another value
                let is_product = matches!(*self.node(b), Node::Binary(BinaryOp::Mul, ..))
                    && !self.leads_with_minus(b);
                let place = if is_product {
                    Binding::Product
                } else {
                    Binding::Factor
                };
                pending.extend([
                    first(Binding::Product),
                    Piece::Word("*"),
                    Piece::Value(b, place),
                ]);
            }
            BinaryOp::Div => {
                pending.extend([
                    first(Binding::Product),
                    Piece::Word("/"),
                    Piece::Value(b, Binding::Factor),
                ]);
            }
            BinaryOp::Pow => {
                pending.extend([
                    Piece::Value(a, Binding::Base),
                    Piece::Word("**"),
                    Piece::Value(b, Binding::Base),
                ]);
            }
            BinaryOp::Atan2 | BinaryOp::Hypot => call(op.name(), &[a, b], pending),
        }
    }

    fn binding(&self, node: &Node, signed: bool) -> Binding {
        match *node {
            // `-a` stands like a product: `-a*b`, `2*(-a)`, `(-a)**2`
            Node::Constant(value) if signed && value.is_sign_negative() && !value.is_nan() => {
                Binding::Product
            }
            Node::Unary(UnaryOp::Neg, _) => Binding::Product,
            Node::Unary(UnaryOp::NotNegative, a) => self.binding(self.node(a), signed),
            Node::Binary(BinaryOp::Add | BinaryOp::Sub, ..) => Binding::Sum,
            Node::Binary(BinaryOp::Mul, a, b) if a == b => Binding::Factor,
            Node::Binary(BinaryOp::Mul, a, b) if self.is_absolute(a, b) => Binding::Base,
            Node::Binary(BinaryOp::Mul | BinaryOp::Div, ..) => Binding::Product,
            Node::Binary(BinaryOp::Pow, ..) => Binding::Factor,
            _ => Binding::Base,
        }
    }

    /// Whether the text begins with a minus that belongs to the whole product.
    fn leads_with_minus(&self, id: NodeId) -> bool {
        let mut current = id;
        loop {
            match *self.node(current) {
                Node::Constant(value) => return value.is_sign_negative() && !value.is_nan(),
                Node::Unary(UnaryOp::Neg, _) => return true,
                Node::Binary(BinaryOp::Mul, a, b) if a != b && !self.is_absolute(a, b) => {
                    current = a
                }
                Node::Binary(BinaryOp::Div, a, _) => current = a,
                _ => return false,
            }
        }
    }

    /// Whether `a * b` is `s_j * b` with the sign of b itself.
    fn is_absolute(&self, a: NodeId, b: NodeId) -> bool {
        match *self.node(a) {
            Node::Sign(j) => self.surfaces.switch_of(b) == Some((j, 1.0)),
            _ => false,
        }
    }
}

fn call(name: &'static str, operands: &[NodeId], pending: &mut Vec<Piece>) {
    pending.extend([Piece::Word(name), Piece::Word("(")]);
    for (k, &operand) in operands.iter().enumerate() {
        if k > 0 {
            pending.push(Piece::Word(", "));
        }
        pending.push(Piece::Value(operand, Binding::Anything));
    }
    pending.push(Piece::Word(")"));
}

fn variable(names: &[String], letter: &str, index: u32) -> String {
    match names.get(index as usize) {
        Some(name) => name.clone(),
        None => format!("{letter}[{index}]"),
    }
}

/// The shortest text that reads back as the same number.
fn number(value: f64) -> String {
    let text = format!("{value:?}");
    match text.strip_suffix(".0") {
        Some(integer) => integer.to_string(),
        None => text.to_ascii_lowercase(),
    }
}

#[cfg(test)]
mod tests;
