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
mod telling;
mod unrolled;

use crate::error::ExprError;
use crate::graph::Graph;
use crate::node::NodeId;
use crate::program::{Backend, Program};

use looped::Looped;
pub use multipliers::Multipliers;
use plan::Plan;

/// Programs with more nodes than this are not unrolled: they would take longer to compile than they save.
const MOST_UNROLLED: usize = 6000;

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

    /// The same where some leaves are multipliers, which keep functions at zero.
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
    let nodes = graph.all_below(values);
    let is_operation = |id: &NodeId| graph.node(*id).operands().next().is_some();
    nodes.iter().filter(|id| is_operation(id)).count()
}

#[cfg(test)]
mod tests;
