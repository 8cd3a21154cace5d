//! The expressions so far, and the answers to comparisons on the present path.
//!
//! What is done here to a graph is what `python/filippov/trace/` does, in the same order, so that the graphs are the same.

use std::collections::BTreeMap;

use filippov_expr::{roots, BinaryOp, Graph, NodeId, Switching, UnaryOp};
use ruff_text_size::Ranged;

use crate::unreadable::{refuse, Refused};
use crate::values::{Condition, Value};

/// Most combinations of answers that are followed.
const MOST_PATHS: usize = 256;

/// Traces one function.
#[derive(Default)]
pub struct Tracer {
    pub graph: Graph,
    /// The decisions of the present path, and which of them were made the other way round already.
    path: Vec<(u32, f64)>,
    flipped: Vec<bool>,
    /// The answers given on it.
    answers: BTreeMap<u32, f64>,
    /// What was compared with zero, and where.
    asked: Vec<(NodeId, ruff_text_size::TextRange)>,
}

impl Tracer {
    /// Follows a function on every path; its results, merged.
    pub fn explore(
        &mut self,
        function: &impl Ranged,
        mut call: impl FnMut(&mut Self) -> Result<Vec<NodeId>, Refused>,
    ) -> Result<Vec<NodeId>, Refused> {
        let mut waiting: Vec<Vec<NodeId>> = Vec::new();
        let mut n_paths = 0;
        loop {
            self.answers.clear();
            let mut outcome = call(self)?;
            n_paths += 1;
            let n_open = self
                .flipped
                .iter()
                .filter(|&&is_flipped| !is_flipped)
                .count();
            if n_paths + n_open > MOST_PATHS {
                let error = format!(
                    "the `if`s take more than {MOST_PATHS} paths: write np.where, np.maximum or np.sign"
                );
                return refuse(function, error);
            }
            while self.flipped.last() == Some(&true) {
                self.flipped.pop();
                let (Some((surface, sign)), Some(first)) = (self.path.pop(), waiting.pop()) else {
                    return Ok(outcome);
                };
                let pairs = first.into_iter().zip(outcome);
                let merged = pairs.map(|(a, b)| self.graph.select(surface, -sign, a, b));
                outcome = merged.collect();
            }
            let (Some(last), Some(is_flipped)) = (self.path.last_mut(), self.flipped.last_mut())
            else {
                return Ok(outcome);
            };
            waiting.push(outcome);
            (last.1, *is_flipped) = (-last.1, true);
        }
    }

    /// Refuses comparisons of what no motion changes: they have no surfaces.
    pub fn check_asked(&self, field: &[NodeId]) -> Result<(), Refused> {
        for (node, range) in &self.asked {
            let terms = self.graph.rate_terms(*node);
            if terms.is_some_and(|terms| self.graph.is_constant_of_motion(&terms, field)) {
                let error =
                    "a comparison of what stays as it is along every motion is not read here";
                return refuse(range, error);
            }
        }
        Ok(())
    }

    /// The node of a number.
    pub fn node(&mut self, part: &impl Ranged, value: &Value) -> Result<NodeId, Refused> {
        match value {
            Value::Node(node) => Ok(*node),
            Value::Number { value, .. } => Ok(self.graph.constant(*value)),
            Value::Truth(holds) => Ok(self.graph.constant(f64::from(u8::from(*holds)))),
            Value::Condition(condition) => {
                let (one, zero) = (self.graph.constant(1.0), self.graph.constant(0.0));
                Ok(self.choose(condition, one, zero))
            }
            Value::List(_) => refuse(part, "a number is needed, this is a list or an array"),
        }
    }

    /// A function of an expression.
    pub fn unary(&mut self, part: &impl Ranged, op: UnaryOp, a: NodeId) -> Result<NodeId, Refused> {
        if op == UnaryOp::Sqrt && self.graph.has_signs(a) {
            return refuse(
                part,
                "a root of what contains a comparison is not read here",
            );
        }
        Ok(roots::apply(&mut self.graph, op, a))
    }

    /// An operation on two expressions.
    pub fn binary(
        &mut self,
        part: &impl Ranged,
        op: BinaryOp,
        a: NodeId,
        b: NodeId,
    ) -> Result<NodeId, Refused> {
        if op == BinaryOp::Pow {
            let exponent = self.graph.as_constant(b);
            let is_root = exponent.is_some_and(|power| power > 0.0 && power.fract() != 0.0);
            if is_root && self.graph.has_signs(a) {
                return refuse(
                    part,
                    "a root of what contains a comparison is not read here",
                );
            }
        }
        Ok(roots::apply_to_two(&mut self.graph, op, a, b))
    }

    /// The sign of an expression.
    pub fn sign(&mut self, part: &impl Ranged, a: NodeId) -> Result<NodeId, Refused> {
        self.ask(part, a)?;
        Ok(self.graph.sign(a))
    }

    /// The absolute value of an expression.
    pub fn absolute(&mut self, part: &impl Ranged, a: NodeId) -> Result<NodeId, Refused> {
        self.ask(part, a)?;
        Ok(self.graph.abs(a))
    }

    /// The larger or the smaller one of two expressions.
    pub fn extreme(
        &mut self,
        part: &impl Ranged,
        a: NodeId,
        b: NodeId,
        is_largest: bool,
    ) -> Result<NodeId, Refused> {
        let difference = self.binary(part, BinaryOp::Sub, a, b)?;
        self.ask(part, difference)?;
        Ok(match is_largest {
            true => self.graph.maximum(a, b),
            false => self.graph.minimum(a, b),
        })
    }

    /// The condition that an expression is positive, or not negative.
    pub fn compare(
        &mut self,
        part: &impl Ranged,
        a: NodeId,
        is_strict: bool,
    ) -> Result<Value, Refused> {
        self.ask(part, a)?;
        Ok(match self.graph.switch(a) {
            Switching::Constant(sign) => Value::Truth(sign > 0.0 || !is_strict && sign == 0.0),
            Switching::Surface { index, orientation } => {
                let comparison = Condition::Comparison {
                    surface: index,
                    orientation,
                };
                Value::Condition(comparison.into())
            }
        })
    }

    /// One node where a condition holds, the other one elsewhere.
    pub fn choose(&mut self, condition: &Condition, plus: NodeId, minus: NodeId) -> NodeId {
        match condition {
            &Condition::Comparison {
                surface,
                orientation,
            } => self.graph.select(surface, orientation, plus, minus),
            Condition::Both {
                first,
                second,
                is_opposite,
            } => {
                let (plus, minus) = match is_opposite {
                    true => (minus, plus),
                    false => (plus, minus),
                };
                let inner = self.choose(second, plus, minus);
                self.choose(first, inner, minus)
            }
        }
    }

    /// The answer to a condition on the present path; a new one is answered by yes first.
    pub fn decide(&mut self, condition: &Condition) -> bool {
        match condition {
            &Condition::Comparison {
                surface,
                orientation,
            } => {
                let depth = self.answers.len();
                let sign = match self.answers.get(&surface) {
                    Some(&sign) => sign,
                    None if depth < self.path.len() => self.path[depth].1,
                    None => {
                        self.path.push((surface, orientation));
                        self.flipped.push(false);
                        orientation
                    }
                };
                self.answers.insert(surface, sign);
                orientation * sign > 0.0
            }
            Condition::Both {
                first,
                second,
                is_opposite,
            } => (self.decide(first) && self.decide(second)) != *is_opposite,
        }
    }

    /// What is compared with zero must change along motions, and contain no comparison.
    fn ask(&mut self, part: &impl Ranged, a: NodeId) -> Result<(), Refused> {
        if !self.graph.depends_on_motion(a) {
            return refuse(
                part,
                "a comparison of parameters and numbers alone is not read here: it is decided once, by the values given",
            );
        }
        if self.graph.has_signs(a) {
            return refuse(
                part,
                "a comparison of what contains a comparison itself is not read here",
            );
        }
        self.asked.push((a, part.range()));
        Ok(())
    }
}
