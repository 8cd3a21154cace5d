//! Between which numbers an expression stays, whatever time, states, parameters and signs are.

use rustc_hash::FxHashMap;

use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};

/// The numbers between two ends, each of which may be infinite.
#[derive(Clone, Copy)]
struct Range {
    lo: f64,
    hi: f64,
}

const ALL: Range = Range {
    lo: f64::NEG_INFINITY,
    hi: f64::INFINITY,
};

impl Graph {
    /// The ends of an interval that an expression does not leave where it is defined; infinite where none is known.
    ///
    /// ```
    /// use filippov_expr::{Graph, UnaryOp};
    ///
    /// let mut g = Graph::new();
    /// let (x, four) = (g.state(0), g.constant(4.0));
    /// let size = g.abs(x);
    /// let root = g.unary(UnaryOp::Sqrt, size);
    /// let scaled = g.mul(four, root);
    /// assert_eq!(g.range(scaled), (0.0, f64::INFINITY));
    /// let wave = g.unary(UnaryOp::Cos, x);
    /// assert_eq!(g.range(wave), (-1.0, 1.0));
    /// ```
    pub fn range(&self, id: NodeId) -> (f64, f64) {
        let mut known: FxHashMap<NodeId, Range> = FxHashMap::default();
        for id in self.all_below(&[id]) {
            let mut range = self.range_of(id, &known);
            if self.facts(id).nonnegative {
                range.lo = range.lo.max(0.0);
            }
            known.insert(id, range);
        }
        let Range { lo, hi } = known[&id];
        (lo, hi)
    }

    fn range_of(&self, id: NodeId, known: &FxHashMap<NodeId, Range>) -> Range {
        match *self.node(id) {
            Node::Constant(value) if !value.is_nan() => Range {
                lo: value,
                hi: value,
            },
            Node::Sign(_) => Range { lo: -1.0, hi: 1.0 },
            Node::Unary(op, a) => unary(op, known[&a]),
            Node::Binary(op, a, b) => binary(op, known[&a], known[&b], a == b),
            Node::Select { plus, minus, .. } => Range {
                lo: known[&plus].lo.min(known[&minus].lo),
                hi: known[&plus].hi.max(known[&minus].hi),
            },
            _ => ALL,
        }
    }
}

fn unary(op: UnaryOp, a: Range) -> Range {
    use UnaryOp::{
        Acos, Acosh, Asin, Asinh, Atan, Cbrt, Cos, Erf, Exp, Exp2, Expm1, Log, Log10, Log1p, Log2,
        Neg, NotNegative, Sin, Sinh, Sqrt, Tanh,
    };
    let within = |lo: f64, hi: f64| Range {
        lo: a.lo.max(lo),
        hi: a.hi.min(hi),
    };
    let domain = match op {
        Neg => {
            return Range {
                lo: -a.hi,
                hi: -a.lo,
            }
        }
        Sin | Cos => return Range { lo: -1.0, hi: 1.0 },
        NotNegative => {
            return Range {
                lo: a.lo.max(0.0),
                hi: a.hi.max(0.0),
            }
        }
        Sqrt | Log | Log2 | Log10 => within(0.0, f64::INFINITY),
        Log1p => within(-1.0, f64::INFINITY),
        Asin | Acos => within(-1.0, 1.0),
        Acosh => within(1.0, f64::INFINITY),
        Cbrt | Exp | Exp2 | Expm1 | Atan | Sinh | Tanh | Asinh | Erf => a,
        _ => return ALL,
    };
    // All of these are monotone; where they are infinite or not defined, nothing is known.
    let (p, q) = (op.apply(domain.lo), op.apply(domain.hi));
    if p.is_nan() || q.is_nan() {
        return ALL;
    }
    Range {
        lo: p.min(q),
        hi: p.max(q),
    }
}

fn binary(op: BinaryOp, a: Range, b: Range, is_square: bool) -> Range {
    let of = |values: [f64; 4]| match values.iter().any(|v| v.is_nan()) {
        true => ALL,
        false => Range {
            lo: values.iter().copied().fold(f64::INFINITY, f64::min),
            hi: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        },
    };
    match op {
        BinaryOp::Add => of([a.lo + b.lo, a.lo + b.lo, a.hi + b.hi, a.hi + b.hi]),
        BinaryOp::Sub => of([a.lo - b.hi, a.lo - b.hi, a.hi - b.lo, a.hi - b.lo]),
        BinaryOp::Mul => {
            // An end at 0 times one at infinity is 0: no value is infinite.
            let times = |x: f64, y: f64| if x == 0.0 || y == 0.0 { 0.0 } else { x * y };
            let range = of([
                times(a.lo, b.lo),
                times(a.lo, b.hi),
                times(a.hi, b.lo),
                times(a.hi, b.hi),
            ]);
            match is_square {
                true => Range {
                    lo: range.lo.max(0.0),
                    ..range
                },
                false => range,
            }
        }
        BinaryOp::Div if b.lo > 0.0 || b.hi < 0.0 => {
            let over = |x: f64, y: f64| if x == 0.0 { 0.0 } else { x / y };
            of([
                over(a.lo, b.lo),
                over(a.lo, b.hi),
                over(a.hi, b.lo),
                over(a.hi, b.hi),
            ])
        }
        BinaryOp::Pow if a.lo >= 0.0 && b.lo == b.hi && b.lo > 0.0 => {
            let (lo, hi) = (a.lo.powf(b.lo), a.hi.powf(b.lo));
            of([lo, lo, hi, hi])
        }
        BinaryOp::Hypot => Range {
            lo: 0.0,
            hi: f64::INFINITY,
        },
        BinaryOp::Atan2 => Range {
            lo: -std::f64::consts::PI,
            hi: std::f64::consts::PI,
        },
        _ => ALL,
    }
}
