//! The map of an action, given by a traced expression graph.

use std::sync::OnceLock;

use filippov_expr::{Backend, NodeId, Program};

use super::{PiecewiseSystem, Place, TracedSystem};
use crate::error::FieldError;
use crate::system::ActionMap;

/// A map x -> x+ given by expressions in (t, x, p): those of the field of a [`TracedSystem`]. Switching functions in
/// them are evaluated at the state before.
pub struct TracedMap {
    expressions: TracedSystem,
    derivative: OnceLock<Option<Program>>,
}

impl TracedMap {
    /// The map whose values are the "field" of `expressions`.
    pub fn new(expressions: TracedSystem) -> Self {
        TracedMap {
            expressions,
            derivative: OnceLock::new(),
        }
    }

    /// The sides on which a state is.
    fn signs(&self, t: f64, x: &[f64]) -> Result<Vec<f64>, FieldError> {
        let d = self.expressions.n_surfaces();
        let mut signs = vec![1.0; d];
        let mut h = vec![0.0; d];
        // Switching functions may contain signs of others.
        for _ in 0..d {
            self.expressions
                .surfaces(&Place::new(t, x, &signs), &mut h)?;
            let sides = h.iter().map(|&h| if h < 0.0 { -1.0 } else { 1.0 });
            signs = sides.collect();
        }
        Ok(signs)
    }

    /// The derivative of x+ - x in a direction that is handed in.
    fn derivative(&self) -> Option<&Program> {
        let made = self.derivative.get_or_init(|| {
            let mut graph = self.expressions.graph().clone();
            let n = self.expressions.n_states();
            let along: Vec<NodeId> = (0..n).map(|i| graph.input(i as u32)).collect();
            // The time does not move: its part is taken off again.
            let still = vec![graph.constant(0.0); n];
            let mut outputs = Vec::with_capacity(n);
            for (&value, &a) in self.expressions.field_nodes().iter().zip(&along) {
                let total = graph.directional(value, &along);
                let by_time = graph.directional(value, &still);
                let by_state = graph.sub(total, by_time);
                outputs.push(graph.sub(by_state, a));
            }
            Program::compile(&graph, &outputs, Backend::Interpreter).ok()
        });
        made.as_ref()
    }
}

impl ActionMap for TracedMap {
    fn apply(&self, t: f64, x: &mut [f64], _: &[f64], _: &mut [f64]) -> Result<(), FieldError> {
        let signs = self.signs(t, x)?;
        let before = x.to_vec();
        self.expressions.field(&Place::new(t, &before, &signs), x)
    }

    fn impulse(
        &self,
        t: f64,
        x: &[f64],
        along: &[f64],
        _: &[f64],
        _: &[f64],
        impulse: &mut [f64],
    ) -> Result<(), FieldError> {
        let signs = self.signs(t, x)?;
        match self.derivative() {
            Some(program) => {
                self.expressions
                    .eval(program, &Place::new(t, x, &signs), along, impulse)
            }
            None => impulse.fill(f64::NAN),
        }
        Ok(())
    }
}
