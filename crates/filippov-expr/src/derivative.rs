//! Derivatives: partial, gradient and along a field.
//!
//! Signs are data, their derivative is 0; a select differentiates its branches and stays a select, so the
//! branch not taken has no influence on a derivative either. All passes are loops over node numbers.

use rustc_hash::FxHashMap;

use crate::graph::Graph;
use crate::linear::LinearForm;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};

/// The variable with respect to which a derivative is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Wrt {
    /// The time t.
    Time,
    /// The state variable x_i.
    State(u32),
    /// The parameter p_i.
    Parameter(u32),
}

/// Derivatives with respect to time and all states.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Gradient {
    /// Derivative with respect to t; the constant 0 if there is none.
    pub time: NodeId,
    /// Index and derivative for each state whose derivative is not identically 0, in increasing order.
    pub states: Vec<(u32, NodeId)>,
}

/// Derivatives computed before.
#[derive(Debug, Clone, Default)]
pub(crate) struct DerivativeCache {
    partials: FxHashMap<Wrt, FxHashMap<NodeId, NodeId>>,
    gradients: FxHashMap<NodeId, Gradient>,
    /// The last field differentiated along: Lie derivatives of many functions follow one field.
    field: Vec<NodeId>,
    along_field: FxHashMap<NodeId, NodeId>,
}

impl Graph {
    /// The partial derivative of a value; remembered.
    pub fn partial(&mut self, of: NodeId, wrt: Wrt) -> NodeId {
        let mut known = self.derivatives.partials.remove(&wrt).unwrap_or_default();
        let result = self.forward(of, &mut known, |graph, leaf| {
            let is_variable = match (leaf, wrt) {
                (Node::Time, Wrt::Time) => true,
                (Node::State(i), Wrt::State(j)) | (Node::Parameter(i), Wrt::Parameter(j)) => i == j,
                _ => false,
            };
            graph.constant(if is_variable { 1.0 } else { 0.0 })
        });
        self.derivatives.partials.insert(wrt, known);
        result
    }

    /// The derivative of a value along a field: `d/dt + sum_i field_i d/dx_i`, the Lie derivative.
    ///
    /// Forward mode: the cost is linear in the size of the expression. States beyond the end of `field` are
    /// taken as constant in time. Applied repeatedly it gives the second, third, ... Lie derivative.
    pub fn directional(&mut self, of: NodeId, field: &[NodeId]) -> NodeId {
        let mut known = std::mem::take(&mut self.derivatives.along_field);
        if self.derivatives.field != field {
            known.clear();
            self.derivatives.field = field.to_vec();
        }
        let result = self.forward(of, &mut known, |graph, leaf| match leaf {
            Node::Time => graph.constant(1.0),
            Node::State(i) => match field.get(i as usize) {
                Some(&rate) => rate,
                None => graph.constant(0.0),
            },
            _ => graph.constant(0.0),
        });
        self.derivatives.along_field = known;
        result
    }

    /// The derivatives of a value with respect to t and every state it contains; remembered.
    ///
    /// Reverse mode, at a cost that is a small multiple of evaluation, whatever the number of states.
    /// The sweep stops at each select, whose own gradient is the select of its branches' gradients: an
    /// adjoint that is 0 in the branch not taken would still meet that branch's infinite derivatives.
    pub fn gradient(&mut self, of: NodeId) -> Gradient {
        let selects: Vec<NodeId> = self
            .reachable_by([of], |id| self.varying_operands(id))
            .into_iter()
            .filter(|&id| matches!(self.node(id), Node::Select { .. }))
            .collect();
        for id in selects {
            if let Node::Select {
                surface,
                plus,
                minus,
            } = *self.node(id)
            {
                if !self.derivatives.gradients.contains_key(&id) {
                    let (above, below) = (self.reverse(plus), self.reverse(minus));
                    let gradient = self.select_gradient(surface, &above, &below);
                    self.derivatives.gradients.insert(id, gradient);
                }
            }
        }
        self.reverse(of)
    }

    /// The derivatives of an expression in the time and in the states, if they are numbers.
    pub fn constant_gradient(&self, of: NodeId) -> Option<(f64, Vec<(u32, f64)>)> {
        let (mut time, mut states) = (0.0, Vec::new());
        for (atom, coefficient) in LinearForm::of(self, of).terms {
            match *self.node(atom) {
                Node::Time => time = coefficient,
                Node::State(index) => states.push((index, coefficient)),
                Node::Sign(_) => {}
                _ if self.facts(atom).varies => return None,
                _ => {}
            }
        }
        states.sort_unstable_by_key(|(index, _)| *index);
        Some((time, states))
    }

    /// The derivative of `of`, given the derivatives of the leaves, by forward mode. `known` maps nodes to
    /// their derivatives and grows.
    fn forward(
        &mut self,
        of: NodeId,
        known: &mut FxHashMap<NodeId, NodeId>,
        leaf: impl Fn(&mut Graph, Node) -> NodeId,
    ) -> NodeId {
        let nodes = self.reachable_by([of], |id| {
            let operands = if known.contains_key(&id) {
                None
            } else {
                Some(self.node(id).operands())
            };
            operands.into_iter().flatten()
        });
        let zero = self.constant(0.0);
        for id in nodes {
            if known.contains_key(&id) {
                continue;
            }
            let node = *self.node(id);
            let rate = match node {
                Node::Unary(op, a) => {
                    let da = known[&a];
                    if da == zero {
                        zero
                    } else {
                        self.chain_unary(op, a, id, da)
                    }
                }
                Node::Binary(op, a, b) => {
                    let (da, db) = (known[&a], known[&b]);
                    if da == zero && db == zero {
                        zero
                    } else {
                        self.chain_binary(op, (a, b), id, (da, db))
                    }
                }
                Node::Select {
                    surface,
                    plus,
                    minus,
                } => self.select(surface, 1.0, known[&plus], known[&minus]),
                _ => leaf(self, node),
            };
            known.insert(id, rate);
        }
        known[&of]
    }

    /// Reverse mode from `of` down to the variables; the gradients of all selects below are known.
    fn reverse(&mut self, of: NodeId) -> Gradient {
        if let Some(gradient) = self.derivatives.gradients.get(&of) {
            return gradient.clone();
        }
        let is_boundary = |id: NodeId| matches!(self.node(id), Node::Select { .. });
        let nodes = self.reachable_by([of], |id| {
            let operands = if is_boundary(id) {
                None
            } else {
                Some(self.varying_operands(id))
            };
            operands.into_iter().flatten()
        });
        let one = self.constant(1.0);
        let mut time = self.constant(0.0);
        let mut states: FxHashMap<u32, NodeId> = FxHashMap::default();
        let mut adjoints = FxHashMap::from_iter([(of, one)]);
        for id in nodes.into_iter().rev() {
            let Some(&adjoint) = adjoints.get(&id) else {
                continue;
            };
            match *self.node(id) {
                Node::Time => time = self.add(time, adjoint),
                Node::State(i) => self.accumulate(&mut states, i, adjoint),
                Node::Select { .. } => {
                    let Some(inner) = self.derivatives.gradients.get(&id).cloned() else {
                        continue;
                    };
                    let change = self.mul(adjoint, inner.time);
                    time = self.add(time, change);
                    for (i, derivative) in inner.states {
                        let change = self.mul(adjoint, derivative);
                        self.accumulate(&mut states, i, change);
                    }
                }
                Node::Unary(op, a) if self.facts(a).varies => {
                    let change = self.chain_unary(op, a, id, adjoint);
                    self.accumulate(&mut adjoints, a, change);
                }
                Node::Binary(op, a, b) => {
                    let zero = self.constant(0.0);
                    if self.facts(a).varies {
                        let change = self.chain_binary(op, (a, b), id, (adjoint, zero));
                        self.accumulate(&mut adjoints, a, change);
                    }
                    if self.facts(b).varies {
                        let change = self.chain_binary(op, (a, b), id, (zero, adjoint));
                        self.accumulate(&mut adjoints, b, change);
                    }
                }
                _ => {}
            }
        }
        let gradient = self.collect_gradient(time, states);
        self.derivatives.gradients.insert(of, gradient.clone());
        gradient
    }

    fn select_gradient(&mut self, surface: u32, above: &Gradient, below: &Gradient) -> Gradient {
        let time = self.select(surface, 1.0, above.time, below.time);
        let zero = self.constant(0.0);
        let mut pairs: FxHashMap<u32, (NodeId, NodeId)> = FxHashMap::default();
        for &(i, derivative) in &above.states {
            pairs.entry(i).or_insert((zero, zero)).0 = derivative;
        }
        for &(i, derivative) in &below.states {
            pairs.entry(i).or_insert((zero, zero)).1 = derivative;
        }
        let mut sorted: Vec<_> = pairs.into_iter().collect();
        sorted.sort_unstable();
        let states = sorted
            .into_iter()
            .map(|(i, (plus, minus))| (i, self.select(surface, 1.0, plus, minus)))
            .collect();
        self.collect_gradient(time, states)
    }

    fn collect_gradient(&self, time: NodeId, states: FxHashMap<u32, NodeId>) -> Gradient {
        let mut states: Vec<_> = states
            .into_iter()
            .filter(|&(_, d)| self.as_constant(d) != Some(0.0))
            .collect();
        states.sort_unstable();
        Gradient { time, states }
    }

    fn accumulate<K: std::hash::Hash + Eq>(
        &mut self,
        sums: &mut FxHashMap<K, NodeId>,
        key: K,
        change: NodeId,
    ) {
        match sums.get_mut(&key) {
            Some(sum) => *sum = self.add(*sum, change),
            None => {
                sums.insert(key, change);
            }
        }
    }

    fn varying_operands(&self, id: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        self.node(id)
            .operands()
            .filter(|&operand| self.facts(operand).varies)
    }

    /// `d op(a) * da`, where `value` is the node of op(a). As the chain rule is linear in `da`, the same
    /// serves both modes: `da` is the derivative of the operand, or the adjoint of the value.
    fn chain_unary(&mut self, op: UnaryOp, a: NodeId, value: NodeId, da: NodeId) -> NodeId {
        use UnaryOp::*;
        match op {
            Neg => self.neg(da),
            NotNegative => da,
            Sqrt => {
                let twice = self.scaled_by(2.0, value);
                self.div(da, twice)
            }
            Cbrt => {
                let square = self.mul(value, value);
                let divisor = self.scaled_by(3.0, square);
                self.div(da, divisor)
            }
            Exp => self.mul(value, da),
            Expm1 => {
                let exp = self.unary(Exp, a);
                self.mul(exp, da)
            }
            Exp2 => {
                let factor = self.scaled_by(std::f64::consts::LN_2, value);
                self.mul(factor, da)
            }
            Log => self.div(da, a),
            Log1p => {
                let divisor = self.plus(a, 1.0);
                self.div(da, divisor)
            }
            Log2 => {
                let divisor = self.scaled_by(std::f64::consts::LN_2, a);
                self.div(da, divisor)
            }
            Log10 => {
                let divisor = self.scaled_by(std::f64::consts::LN_10, a);
                self.div(da, divisor)
            }
            Sin => {
                let cos = self.unary(Cos, a);
                self.mul(cos, da)
            }
            Cos => {
                let sin = self.unary(Sin, a);
                let product = self.mul(sin, da);
                self.neg(product)
            }
            Tan => {
                let square = self.mul(value, value);
                let factor = self.plus(square, 1.0);
                self.mul(factor, da)
            }
            Asin => {
                let root = self.root_one_minus_square(a);
                self.div(da, root)
            }
            Acos => {
                let root = self.root_one_minus_square(a);
                let quotient = self.div(da, root);
                self.neg(quotient)
            }
            Atan => {
                let square = self.mul(a, a);
                let divisor = self.plus(square, 1.0);
                self.div(da, divisor)
            }
            Sinh => {
                let cosh = self.unary(Cosh, a);
                self.mul(cosh, da)
            }
            Cosh => {
                let sinh = self.unary(Sinh, a);
                self.mul(sinh, da)
            }
            Tanh => {
                // 1/cosh^2, since 1 - tanh^2 has no digits left for large operands
                let cosh = self.unary(Cosh, a);
                let square = self.mul(cosh, cosh);
                self.div(da, square)
            }
            Asinh => {
                let one = self.constant(1.0);
                let root = self.binary(BinaryOp::Hypot, a, one);
                self.div(da, root)
            }
            Acosh => {
                let (below, above) = (self.plus(a, -1.0), self.plus(a, 1.0));
                let product = self.mul(below, above);
                let root = self.unary(Sqrt, product);
                self.div(da, root)
            }
            Atanh => {
                let product = self.one_minus_square(a);
                self.div(da, product)
            }
            Erf => {
                let square = self.mul(a, a);
                let opposite = self.neg(square);
                let bell = self.unary(Exp, opposite);
                let factor = self.constant(std::f64::consts::FRAC_2_SQRT_PI);
                let slope = self.mul(factor, bell);
                self.mul(slope, da)
            }
        }
    }

    /// `d_1 op(a, b) * da + d_2 op(a, b) * db`, where `value` is the node of op(a, b).
    fn chain_binary(
        &mut self,
        op: BinaryOp,
        (a, b): (NodeId, NodeId),
        value: NodeId,
        (da, db): (NodeId, NodeId),
    ) -> NodeId {
        match op {
            BinaryOp::Add => self.add(da, db),
            BinaryOp::Sub => self.sub(da, db),
            BinaryOp::Mul => {
                let (left, right) = (self.mul(da, b), self.mul(a, db));
                self.add(left, right)
            }
            BinaryOp::Div => {
                // (da - value db) / b: one division and no square of b
                let change = self.mul(value, db);
                let numerator = self.sub(da, change);
                self.div(numerator, b)
            }
            BinaryOp::Pow => self.chain_power(a, b, value, da, db),
            BinaryOp::Atan2 => {
                let (left, right) = (self.mul(b, da), self.mul(a, db));
                let numerator = self.sub(left, right);
                let (p, q) = (self.mul(a, a), self.mul(b, b));
                let divisor = self.add(p, q);
                self.div(numerator, divisor)
            }
            BinaryOp::Hypot => {
                let (left, right) = (self.mul(a, da), self.mul(b, db));
                let numerator = self.add(left, right);
                self.div(numerator, value)
            }
        }
    }

    /// `b a^(b-1) da + log(a) a^b db`, each part only where it is needed: a constant exponent brings no
    /// logarithm (NaN for a < 0), a constant base no power of it.
    fn chain_power(
        &mut self,
        a: NodeId,
        b: NodeId,
        value: NodeId,
        da: NodeId,
        db: NodeId,
    ) -> NodeId {
        let zero = self.constant(0.0);
        let mut result = zero;
        if da != zero {
            let one = self.constant(1.0);
            let lower = self.sub(b, one);
            let power = self.pow(a, lower);
            let slope = self.mul(b, power);
            result = self.mul(slope, da);
        }
        if db != zero {
            let log = self.unary(UnaryOp::Log, a);
            let slope = self.mul(log, value);
            let change = self.mul(slope, db);
            result = self.add(result, change);
        }
        result
    }

    fn scaled_by(&mut self, factor: f64, a: NodeId) -> NodeId {
        let factor = self.constant(factor);
        self.mul(factor, a)
    }

    fn plus(&mut self, a: NodeId, number: f64) -> NodeId {
        let number = self.constant(number);
        self.add(a, number)
    }

    /// `(1 - a)(1 + a)`, which keeps its digits near |a| = 1.
    fn one_minus_square(&mut self, a: NodeId) -> NodeId {
        let one = self.constant(1.0);
        let (below, above) = (self.sub(one, a), self.plus(a, 1.0));
        self.mul(below, above)
    }

    fn root_one_minus_square(&mut self, a: NodeId) -> NodeId {
        let product = self.one_minus_square(a);
        self.unary(UnaryOp::Sqrt, product)
    }
}

#[cfg(test)]
mod tests;
