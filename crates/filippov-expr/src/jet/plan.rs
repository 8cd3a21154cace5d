//! The plan of a jet: one row of coefficients per value, and the rule that fills each.
//!
//! Functions bring rows of their own: the tangent of `a` needs those of 1 + tan(a)^2, the sine that of the
//! cosine. Such rows are shared.

use rustc_hash::FxHashMap;

use super::multipliers::{Multipliers, Rounds};
use crate::error::ExprError;
use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::schedule::{Lengths, Schedule};

/// A row of coefficients.
pub(super) type Row = usize;

/// What the lowest coefficient of a function is.
#[derive(Debug, Clone, Copy)]
pub(super) enum Head {
    Unary(UnaryOp, Row),
    Binary(BinaryOp, Row, Row),
}

/// How a row is filled.
#[derive(Debug, Clone, Copy)]
pub(super) enum Rule {
    /// A number.
    Constant(f64),
    /// The time.
    Time,
    /// State i: its rate is a row of the field.
    State(u32),
    /// A value that does not move: a parameter or a sign.
    Still(NodeId),
    /// A sign that is solved for, and where it starts.
    Multiplier(NodeId),
    Neg(Row),
    Add(Row, Row),
    Sub(Row, Row),
    Mul(Row, Row),
    Div(Row, Row),
    /// A value plus a number.
    Shift(Row, f64),
    /// A value times a number; its lowest coefficient is that of a function.
    Scale(Row, f64, Head),
    Select {
        surface: u32,
        plus: Row,
        minus: Row,
    },
    /// c with c' = factor w a'.
    Chain {
        of: Row,
        weight: Row,
        factor: f64,
        head: Head,
    },
    /// c with w c' = factor a'.
    InverseChain {
        of: Row,
        weight: Row,
        factor: f64,
        head: Head,
    },
    /// c with a c' = r c a', a power with a constant exponent.
    Power {
        of: Row,
        exponent: f64,
        head: Head,
    },
    /// The same, the exponent a value that does not move.
    PowerOf {
        of: Row,
        exponent: Row,
        head: Head,
    },
    /// c with w c' = b a' - a b', the angle of the point (b, a) at distance sqrt(w).
    Angle {
        y: Row,
        x: Row,
        weight: Row,
    },
}

impl Rule {
    /// The rows that a coefficient is made of, at the same order.
    pub fn operands(&self) -> impl Iterator<Item = Row> {
        let (a, b, c) = match *self {
            Rule::Constant(_)
            | Rule::Time
            | Rule::State(_)
            | Rule::Still(_)
            | Rule::Multiplier(_) => (None, None, None),
            Rule::Neg(a) | Rule::Shift(a, _) | Rule::Scale(a, ..) | Rule::Power { of: a, .. } => {
                (Some(a), None, None)
            }
            Rule::Add(a, b) | Rule::Sub(a, b) | Rule::Mul(a, b) | Rule::Div(a, b) => {
                (Some(a), Some(b), None)
            }
            Rule::Select { plus, minus, .. } => (Some(plus), Some(minus), None),
            Rule::Chain { of, weight, .. } | Rule::InverseChain { of, weight, .. } => {
                (Some(of), Some(weight), None)
            }
            Rule::PowerOf { of, exponent, .. } => (Some(of), Some(exponent), None),
            Rule::Angle { y, x, weight } => (Some(y), Some(x), Some(weight)),
        };
        [a, b, c].into_iter().flatten()
    }
}

/// All rows in the order in which a coefficient of each can be computed.
#[derive(Debug)]
pub(super) struct Plan {
    pub rules: Vec<Rule>,
    /// The rate of every state.
    pub field: Vec<Row>,
    pub functions: Vec<Row>,
    pub lengths: Lengths,
    pub rounds: Rounds,
    /// The leaves that do not move, as they are evaluated.
    pub still: FxHashMap<NodeId, Node>,
    rows: FxHashMap<NodeId, Row>,
    made: FxHashMap<(UnaryOp, Row), Row>,
}

impl Plan {
    pub fn new(
        graph: &mut Graph,
        field: &[NodeId],
        functions: &[NodeId],
        multipliers: &Multipliers,
    ) -> Result<Self, ExprError> {
        let mut outputs: Vec<NodeId> = field.iter().chain(functions).copied().collect();
        outputs.extend(multipliers.nodes());
        let schedule = Schedule::new(graph, &outputs)?;
        let mut plan = Plan {
            rules: Vec::with_capacity(schedule.order.len()),
            field: Vec::new(),
            functions: Vec::new(),
            lengths: schedule.lengths,
            rounds: Rounds::default(),
            still: FxHashMap::default(),
            rows: FxHashMap::default(),
            made: FxHashMap::default(),
        };
        plan.lengths.states = plan.lengths.states.max(field.len());
        for &id in &schedule.order {
            let node = *graph.node(id);
            let row = match multipliers.start(id) {
                Some(start) => plan.push(Rule::Multiplier(start)),
                None => plan.row_of(id, node),
            };
            plan.rows.insert(id, row);
        }
        plan.field = field.iter().map(|id| plan.rows[id]).collect();
        plan.functions = functions.iter().map(|id| plan.rows[id]).collect();
        plan.rounds = Rounds::new(&plan, multipliers.solved(&plan.rows));
        Ok(plan)
    }

    /// About how many operations all coefficients up to `order` take one by one.
    pub fn unrolled_size(&self, order: usize) -> usize {
        let convolution = order * order;
        let size = |rule: &Rule| match *rule {
            Rule::Mul(a, b) | Rule::Div(a, b) if self.is_still(a) || self.is_still(b) => order,
            Rule::Mul(..) | Rule::Div(..) => convolution,
            Rule::Chain { of, .. } if self.is_linear(of) => 2 * order,
            Rule::Chain { .. } | Rule::InverseChain { .. } => convolution,
            Rule::Power { .. } | Rule::PowerOf { .. } => convolution,
            Rule::Angle { .. } => 3 * convolution,
            Rule::Constant(_) | Rule::Still(_) | Rule::Time => 1,
            _ => order,
        };
        let products = self.rounds.solved.iter().map(|s| 2 * order * s.terms.len());
        self.rules.iter().map(size).sum::<usize>() + products.sum::<usize>()
    }

    fn is_still(&self, row: Row) -> bool {
        matches!(self.rules[row], Rule::Constant(_) | Rule::Still(_))
    }

    /// Is the row at most of first order in time?
    fn is_linear(&self, row: Row) -> bool {
        match self.rules[row] {
            Rule::Constant(_) | Rule::Still(_) | Rule::Time => true,
            Rule::Neg(a) | Rule::Shift(a, _) => self.is_linear(a),
            Rule::Add(a, b) | Rule::Sub(a, b) => self.is_linear(a) && self.is_linear(b),
            Rule::Mul(a, b) => {
                self.is_still(a) && self.is_linear(b) || self.is_still(b) && self.is_linear(a)
            }
            Rule::Div(a, b) => self.is_still(b) && self.is_linear(a),
            _ => false,
        }
    }

    fn push(&mut self, rule: Rule) -> Row {
        self.rules.push(rule);
        self.rules.len() - 1
    }

    fn row_of(&mut self, id: NodeId, node: Node) -> Row {
        match node {
            Node::Constant(value) => self.push(Rule::Constant(value)),
            Node::Time => self.push(Rule::Time),
            Node::State(i) => self.push(Rule::State(i)),
            Node::Parameter(_) | Node::Sign(_) | Node::Input(_) => {
                self.still.insert(id, node);
                self.push(Rule::Still(id))
            }
            Node::Select {
                surface,
                plus,
                minus,
            } => {
                let (plus, minus) = (self.rows[&plus], self.rows[&minus]);
                self.push(Rule::Select {
                    surface,
                    plus,
                    minus,
                })
            }
            Node::Unary(op, a) => {
                let a = self.rows[&a];
                self.function(op, a)
            }
            Node::Binary(op, a, b) => {
                let (a, b) = (self.rows[&a], self.rows[&b]);
                self.operation(op, a, b)
            }
        }
    }

    fn operation(&mut self, op: BinaryOp, a: Row, b: Row) -> Row {
        match op {
            BinaryOp::Add => self.push(Rule::Add(a, b)),
            BinaryOp::Sub => self.push(Rule::Sub(a, b)),
            BinaryOp::Mul => self.push(Rule::Mul(a, b)),
            BinaryOp::Div => self.push(Rule::Div(a, b)),
            BinaryOp::Pow => self.power(a, b),
            BinaryOp::Atan2 => {
                let weight = self.squared_distance(a, b);
                self.push(Rule::Angle { y: a, x: b, weight })
            }
            BinaryOp::Hypot => {
                let of = self.squared_distance(a, b);
                self.push(Rule::Power {
                    of,
                    exponent: 0.5,
                    head: Head::Binary(op, a, b),
                })
            }
        }
    }

    fn squared_distance(&mut self, a: Row, b: Row) -> Row {
        let (first, second) = (self.push(Rule::Mul(a, a)), self.push(Rule::Mul(b, b)));
        self.push(Rule::Add(first, second))
    }

    fn power(&mut self, a: Row, b: Row) -> Row {
        let head = Head::Binary(BinaryOp::Pow, a, b);
        match self.rules[b] {
            Rule::Constant(exponent) => self.push(Rule::Power {
                of: a,
                exponent,
                head,
            }),
            Rule::Still(_) => self.push(Rule::PowerOf {
                of: a,
                exponent: b,
                head,
            }),
            // a^b = e^(b log a)
            _ => {
                let log = self.function(UnaryOp::Log, a);
                let of = self.push(Rule::Mul(b, log));
                let weight = self.rules.len();
                self.push(Rule::Chain {
                    of,
                    weight,
                    factor: 1.0,
                    head,
                })
            }
        }
    }

    /// The row of a function of a row, with those that it needs.
    fn function(&mut self, op: UnaryOp, a: Row) -> Row {
        if op == UnaryOp::Neg {
            return self.push(Rule::Neg(a));
        }
        if op == UnaryOp::NotNegative {
            return a;
        }
        if let Some(&known) = self.made.get(&(op, a)) {
            return known;
        }
        let head = Head::Unary(op, a);
        let row = match op {
            UnaryOp::Sqrt | UnaryOp::Cbrt => self.push(Rule::Power {
                of: a,
                exponent: if op == UnaryOp::Sqrt { 0.5 } else { 1.0 / 3.0 },
                head,
            }),
            UnaryOp::Exp => self.chain(a, self.rules.len(), 1.0, head),
            UnaryOp::Exp2 => self.chain(a, self.rules.len(), std::f64::consts::LN_2, head),
            UnaryOp::Expm1 => {
                let weight = self.function(UnaryOp::Exp, a);
                self.chain(a, weight, 1.0, head)
            }
            UnaryOp::Sin | UnaryOp::Cos => {
                return self.pair((op, UnaryOp::Sin, UnaryOp::Cos), -1.0, a)
            }
            UnaryOp::Sinh | UnaryOp::Cosh => {
                return self.pair((op, UnaryOp::Sinh, UnaryOp::Cosh), 1.0, a)
            }
            UnaryOp::Tan => self.tangent(a, 1.0, head),
            UnaryOp::Tanh => self.tangent(a, -1.0, head),
            UnaryOp::Log => self.inverse_chain(a, a, 1.0, head),
            UnaryOp::Log1p => {
                let weight = self.push(Rule::Shift(a, 1.0));
                self.inverse_chain(a, weight, 1.0, head)
            }
            UnaryOp::Log2 | UnaryOp::Log10 => {
                let log = self.function(UnaryOp::Log, a);
                let base = if op == UnaryOp::Log2 {
                    std::f64::consts::LOG2_E
                } else {
                    std::f64::consts::LOG10_E
                };
                self.push(Rule::Scale(log, base, head))
            }
            UnaryOp::Asin | UnaryOp::Acos => {
                let weight = self.root_of_square(a, -1.0, 1.0);
                let factor = if op == UnaryOp::Asin { 1.0 } else { -1.0 };
                self.inverse_chain(a, weight, factor, head)
            }
            UnaryOp::Asinh | UnaryOp::Acosh => {
                let shift = if op == UnaryOp::Asinh { 1.0 } else { -1.0 };
                let weight = self.root_of_square(a, 1.0, shift);
                self.inverse_chain(a, weight, 1.0, head)
            }
            UnaryOp::Atan => {
                let weight = self.shifted_square(a, 1.0, 1.0);
                self.inverse_chain(a, weight, 1.0, head)
            }
            UnaryOp::Atanh => {
                let weight = self.shifted_square(a, -1.0, 1.0);
                self.inverse_chain(a, weight, 1.0, head)
            }
            UnaryOp::Erf => {
                let square = self.push(Rule::Mul(a, a));
                let opposite = self.push(Rule::Neg(square));
                let bell = self.function(UnaryOp::Exp, opposite);
                self.chain(a, bell, std::f64::consts::FRAC_2_SQRT_PI, head)
            }
            UnaryOp::Neg | UnaryOp::NotNegative => a,
        };
        self.made.insert((op, a), row);
        row
    }

    fn chain(&mut self, of: Row, weight: Row, factor: f64, head: Head) -> Row {
        self.push(Rule::Chain {
            of,
            weight,
            factor,
            head,
        })
    }

    fn inverse_chain(&mut self, of: Row, weight: Row, factor: f64, head: Head) -> Row {
        self.push(Rule::InverseChain {
            of,
            weight,
            factor,
            head,
        })
    }

    /// Two functions with `first`' = `second` a' and `second`' = `factor` `first` a'; returns the wanted one.
    fn pair(
        &mut self,
        (wanted, first, second): (UnaryOp, UnaryOp, UnaryOp),
        factor: f64,
        a: Row,
    ) -> Row {
        let row = self.rules.len();
        self.chain(a, row + 1, 1.0, Head::Unary(first, a));
        self.chain(a, row, factor, Head::Unary(second, a));
        self.made.insert((first, a), row);
        self.made.insert((second, a), row + 1);
        self.made[&(wanted, a)]
    }

    /// A function c with c' = (1 + `factor` c^2) a'.
    fn tangent(&mut self, a: Row, factor: f64, head: Head) -> Row {
        let row = self.rules.len();
        let weight = if factor > 0.0 { row + 2 } else { row + 3 };
        self.chain(a, weight, 1.0, head);
        self.shifted_square(row, factor, 1.0);
        row
    }

    /// `factor` a^2 + `shift` for a factor of 1 or -1.
    fn shifted_square(&mut self, a: Row, factor: f64, shift: f64) -> Row {
        let square = self.push(Rule::Mul(a, a));
        let signed = if factor > 0.0 {
            square
        } else {
            self.push(Rule::Neg(square))
        };
        self.push(Rule::Shift(signed, shift))
    }

    fn root_of_square(&mut self, a: Row, factor: f64, shift: f64) -> Row {
        let square = self.shifted_square(a, factor, shift);
        self.function(UnaryOp::Sqrt, square)
    }
}
