//! Jets: the Taylor coefficients of a motion, and of functions along it.
//!
//! With x(t + tau) = x_0 + x_1 tau + x_2 tau^2 + .., the field gives one coefficient after the other,
//! x_{k+1} = f_k / (k + 1), because coefficient k of every operation follows from the coefficients up to k
//! of its operands (Griewank, Walther: *Evaluating Derivatives*, 2008, chapter 13; Jorba, Zou:
//! *A software package for the numerical integration of ODEs by means of high-order Taylor methods*, 2005).
//!
//! A small system is unrolled: its coefficients are expressions like all others, simplified and compiled.
//! A large one is computed by loops over the orders.

mod looped;
mod multipliers;
mod plan;
mod recurrence;
mod unrolled;

use rustc_hash::FxHashMap;

use crate::error::ExprError;
use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::program::{Backend, Program};

use looped::Looped;
pub use multipliers::Multipliers;
use plan::Plan;

/// Programs with more nodes than this are not unrolled: they would take longer to compile than they save.
const MOST_UNROLLED: usize = 6000;

impl Graph {
    /// Do the values have a Taylor series wherever they are finite? Roots, powers, logarithms and some inverse
    /// functions do not: they end, or bend sharply, at a finite value.
    pub fn is_analytic(&self, nodes: &[NodeId]) -> bool {
        use BinaryOp::{Atan2, Hypot, Pow};
        use UnaryOp::{Acos, Acosh, Asin, Atanh, Cbrt, Log, Log10, Log1p, Log2, Sqrt};
        let all = self.reachable_by(nodes.iter().copied(), |id| {
            self.node(id).operands().collect::<Vec<_>>()
        });
        !all.into_iter().any(|id| match *self.node(id) {
            Node::Unary(op, a) => {
                let is_edged = matches!(
                    op,
                    Sqrt | Cbrt | Log | Log1p | Log2 | Log10 | Asin | Acos | Acosh | Atanh
                );
                is_edged && self.facts(a).varies
            }
            Node::Binary(op, a, b) => {
                let is_edged = matches!(op, Pow | Atan2 | Hypot);
                is_edged && (self.facts(a).varies || self.facts(b).varies)
            }
            _ => false,
        })
    }
}

impl Graph {
    /// May the values change where no Taylor coefficient tells? Exponential functions, and what is made of them, come up
    /// from below rounding: far from a pulse exp(-t^2) all coefficients are as good as zero.
    pub fn hides_changes(&self, nodes: &[NodeId]) -> bool {
        use UnaryOp::{Cosh, Exp, Exp2, Expm1, Sinh, Tanh};
        let all = self.reachable_by(nodes.iter().copied(), |id| {
            self.node(id).operands().collect::<Vec<_>>()
        });
        all.into_iter().any(|id| match *self.node(id) {
            Node::Unary(op, a) => {
                matches!(op, Exp | Expm1 | Exp2 | Sinh | Cosh | Tanh) && self.facts(a).varies
            }
            Node::Binary(BinaryOp::Pow, _, b) => self.facts(b).varies,
            _ => false,
        })
    }
}

/// Factors of a product of which the first coefficients of a series tell.
const MOST_FACTORS: u32 = 4;

impl Graph {
    /// Do the first coefficients of their series tell of all that the values do, wherever that is? They do of waves, of
    /// states and of time, and of sums and products of a few of them. Quotients and high powers have narrow peaks, whose
    /// coefficients elsewhere are small: of these they may not.
    pub fn is_told_by_series(&self, nodes: &[NodeId]) -> bool {
        let all = self.reachable_by(nodes.iter().copied(), |id| {
            self.node(id).operands().collect::<Vec<_>>()
        });
        // The factors of the products that make up a value, none if it is told otherwise.
        let mut known: FxHashMap<NodeId, Option<u32>> = FxHashMap::default();
        for id in all {
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

/// Taylor coefficients of the motion of a field, and of other functions along it.
///
/// # Example
/// ```
/// use filippov_expr::{Backend, Graph, JetProgram};
/// let mut g = Graph::new();
/// let (x, v) = (g.state(0), g.state(1));
/// let pull = g.neg(x);
/// let energy = g.mul(x, v);
/// let jets = JetProgram::compile(&g, &[v, pull], &[energy], 3, Backend::Auto)?;
/// let mut out = [0.0; 4 * 3];
/// jets.eval(0.0, &[1.0, 0.0], &[], &[], &[], &mut out);
/// // orders 0 to 3, each with x, v and x v: cos, -sin, and -sin cos
/// assert_eq!(out[..6], [1.0, 0.0, 0.0, 0.0, -1.0, -1.0]);
/// assert_eq!(out[6..9], [-0.5, 0.0, 0.0]);
/// assert!((out[11] - 2.0 / 3.0).abs() < 1e-15);
/// # Ok::<(), filippov_expr::ExprError>(())
/// ```
#[derive(Debug)]
pub struct JetProgram {
    code: Code,
    order: usize,
    width: usize,
    cost: usize,
    operations: usize,
}

#[derive(Debug)]
enum Code {
    Unrolled(Program),
    Looped(Box<Looped>),
}

impl JetProgram {
    /// Prepares the coefficients up to `order` of the states with rates `field`, and of `functions` along
    /// their motion.
    ///
    /// # Errors
    /// [`ExprError::UnknownNode`], [`ExprError::IndexTooLarge`]; with [`Backend::Native`] also
    /// [`ExprError::NativeUnavailable`].
    pub fn compile(
        graph: &Graph,
        field: &[NodeId],
        functions: &[NodeId],
        order: usize,
        backend: Backend,
    ) -> Result<JetProgram, ExprError> {
        let multipliers = Multipliers::default();
        JetProgram::with_multipliers(graph, field, functions, &multipliers, order, backend)
    }

    /// The same where some signs are multipliers, which keep functions at zero.
    ///
    /// # Errors
    /// As for [`compile`](Self::compile).
    pub fn with_multipliers(
        graph: &Graph,
        field: &[NodeId],
        functions: &[NodeId],
        multipliers: &Multipliers,
        order: usize,
        backend: Backend,
    ) -> Result<JetProgram, ExprError> {
        let mut graph = graph.clone();
        let plan = Plan::new(&mut graph, field, functions, multipliers)?;
        let width = field.len() + functions.len();
        let single = operations(&graph, field);
        let (code, size) = if plan.unrolled_size(order) <= MOST_UNROLLED {
            let outputs = unrolled::unroll(&plan, &mut graph, order);
            let size = operations(&graph, &outputs);
            let program = Program::compile(&graph, &outputs, backend)?;
            (Code::Unrolled(program), size)
        } else {
            let size = plan.unrolled_size(order);
            (Code::Looped(Box::new(Looped::new(plan, order))), size)
        };
        Ok(JetProgram {
            code,
            order,
            width,
            cost: size.div_ceil(single.max(1)).max(1),
            operations: size,
        })
    }

    /// The highest order.
    pub fn order(&self) -> usize {
        self.order
    }

    /// How many states and functions there are: as many entries as `out` has for every order.
    pub fn width(&self) -> usize {
        self.width
    }

    /// How many evaluations of the field take as many operations.
    pub fn cost(&self) -> usize {
        self.cost
    }

    /// How many operations an evaluation takes.
    pub fn operations(&self) -> usize {
        self.operations
    }

    /// Is the program unrolled?
    pub fn is_unrolled(&self) -> bool {
        matches!(self.code, Code::Unrolled(_))
    }

    /// Evaluates at time `t`, states `x`, signs `s`, parameters `p`, inputs `v`; writes (order + 1) rows, each with the
    /// coefficients of the states and then those of the functions. A coefficient that does not exist is not
    /// finite, and those of higher order are not finite either.
    pub fn eval(&self, t: f64, x: &[f64], s: &[f64], p: &[f64], v: &[f64], out: &mut [f64]) {
        match &self.code {
            Code::Unrolled(program) => program.eval(t, x, s, p, v, out),
            Code::Looped(looped) => looped.eval(t, x, s, p, v, out),
        }
    }
}

/// Operations that it takes to compute the values, each once.
fn operations(graph: &Graph, values: &[NodeId]) -> usize {
    let nodes = graph.reachable_by(values.iter().copied(), |id| {
        graph.node(id).operands().collect::<Vec<_>>()
    });
    let is_operation = |id: &NodeId| graph.node(*id).operands().next().is_some();
    nodes.iter().filter(|id| is_operation(id)).count()
}

#[cfg(test)]
mod tests;
