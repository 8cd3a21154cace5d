//! The map of an action, given by a traced expression graph.

use std::sync::OnceLock;

use filippov_expr::{Backend, NodeId, Program};

use super::{PiecewiseSystem, Place, Setting, TracedSystem};
use crate::error::FieldError;
use crate::system::{dot, ActionMap};
use crate::tolerances::MOMENT;

/// A map x -> x+ given by expressions in (t, x, p): those of the field of a [`TracedSystem`]. Switching functions in
/// them are evaluated at the state before. If there are more expressions than states, the others are those of the
/// named discrete states, which count as states here: (x, q) -> (x+, q+).
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

    /// The states, with the named discrete states behind them if the map changes these.
    fn with_named(&self, x: &[f64], q: &[f64]) -> Vec<f64> {
        let n_named = self.expressions.n_states().saturating_sub(x.len());
        x.iter().chain(q.iter().take(n_named)).copied().collect()
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

/// The sides of its surfaces on which a state is.
pub(crate) fn sides_of(
    expressions: &TracedSystem,
    at: (f64, &[f64]),
    q: &[f64],
) -> Result<Vec<f64>, FieldError> {
    sides_where(expressions, at, q, |_| ())
}

/// The same where something else sets some of them.
#[inline(always)]
pub(crate) fn sides_where(
    expressions: &TracedSystem,
    (t, x): (f64, &[f64]),
    q: &[f64],
    set: impl Fn(&mut [f64]),
) -> Result<Vec<f64>, FieldError> {
    let d = expressions.n_surfaces();
    let mut signs = vec![1.0; d];
    let mut h = vec![0.0; d];
    // Switching functions may contain signs of others.
    for _ in 0..d {
        expressions.surfaces(&Setting::new(&signs, q).at(t, x), &mut h)?;
        let sides = h.iter().map(|&h| if h < 0.0 { -1.0 } else { 1.0 });
        signs = sides.collect();
        set(&mut signs);
    }
    Ok(signs)
}

impl ActionMap for TracedMap {
    fn expressions(&self) -> Option<&TracedSystem> {
        Some(&self.expressions)
    }

    fn apply(&self, t: f64, x: &mut [f64], _: &[f64], q: &mut [f64]) -> Result<(), FieldError> {
        let before = self.with_named(x, q);
        let mut after = before.clone();
        let signs = sides_of(&self.expressions, (t, &before), &[])?;
        let place = Place::new(t, &before, &signs);
        self.expressions.field(&place, &mut after)?;
        let (states, named) = after.split_at(x.len());
        x.copy_from_slice(states);
        q.iter_mut().zip(named).for_each(|(q, new)| *q = *new);
        Ok(())
    }

    fn impulse(
        &self,
        t: f64,
        x: &[f64],
        along: &[f64],
        _: &[f64],
        q: &[f64],
        impulse: &mut [f64],
    ) -> Result<(), FieldError> {
        let Some(program) = self.derivative() else {
            impulse.fill(f64::NAN);
            return Ok(());
        };
        let before = self.with_named(x, q);
        let (mut direction, mut change) = (vec![0.0; before.len()], before.clone());
        direction[..x.len()].copy_from_slice(along);
        let norm = dot(along, along).sqrt().max(f64::MIN_POSITIVE);
        let way = MOMENT * MOMENT * (1.0 + dot(x, x).sqrt()) / norm;
        let beside = before.iter().zip(&direction).map(|(x, d)| x + way * d);
        let beside: Vec<f64> = beside.collect();
        let signs = sides_of(&self.expressions, (t, &beside), &[])?;
        let place = Place::new(t, &before, &signs);
        self.expressions
            .eval(program, &place, &direction, &mut change);
        impulse.copy_from_slice(&change[..x.len()]);
        Ok(())
    }
}
