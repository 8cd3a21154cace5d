//! Systems and events whose functions are Python callables.

use std::sync::Arc;

use filippov::action::ActionMap;
use filippov::{FieldError, PiecewiseSystem, Place, SignStructure, TracedSystem, UserFunction};
use filippov_expr::{
    Backend, Enclosure, EnclosureProgram, ExprError, Graph, Motion, NodeId, Program,
};
use numpy::PyArray1;
use pyo3::prelude::*;

use crate::conversion::{read_scalar, read_vector};

/// Python switching functions h_j(t, x).
pub struct Surfaces {
    pub functions: Vec<Py<PyAny>>,
    pub names: Vec<String>,
    /// The first so many switch the field; those behind them trigger actions.
    pub n_switching: usize,
}

impl Surfaces {
    fn value(&self, py: Python<'_>, j: usize, t: f64, x: &[f64]) -> PyResult<f64> {
        read_scalar(
            &self.functions[j]
                .bind(py)
                .call1((t, PyArray1::from_slice(py, x)))?,
        )
    }

    fn write(&self, t: f64, x: &[f64], h: &mut [f64]) -> Result<(), FieldError> {
        Python::attach(|py| {
            h.iter_mut()
                .enumerate()
                .try_for_each(|(j, h)| self.value(py, j, t, x).map(|v| *h = v))
        })
        .map_err(|e: PyErr| FieldError::new(e))
    }
}

/// A black box: f(t, x) looks at the signs of the switching functions itself, so that it exists in
/// each region only; beyond a surface it is NaN.
pub struct Opaque {
    pub fun: Py<PyAny>,
    pub surfaces: Surfaces,
    pub n_states: usize,
}

impl SignStructure for Opaque {
    fn switches_at(&self, j: usize) -> bool {
        j < self.surfaces.n_switching
    }
}

impl PiecewiseSystem for Opaque {
    fn n_states(&self) -> usize {
        self.n_states
    }

    fn n_surfaces(&self) -> usize {
        self.surfaces.functions.len()
    }

    fn field(&self, place: &Place<'_>, dx: &mut [f64]) -> Result<(), FieldError> {
        let &Place { t, x, signs, .. } = place;
        Python::attach(|py| {
            for (j, sign) in signs.iter().enumerate().take(self.surfaces.n_switching) {
                if self.surfaces.value(py, j, t, x)? * sign <= 0.0 {
                    dx.fill(f64::NAN);
                    return Ok(());
                }
            }
            let value = self.fun.bind(py).call1((t, PyArray1::from_slice(py, x)))?;
            read_vector(&value, dx, "fun")
        })
        .map_err(|e: PyErr| FieldError::new(e))
    }

    fn surfaces(&self, place: &Place<'_>, h: &mut [f64]) -> Result<(), FieldError> {
        self.surfaces.write(place.t, place.x, h)
    }

    fn surface_name(&self, j: usize) -> String {
        self.surfaces.names[j].clone()
    }
}

/// A callable f(t, x, s) that takes the sign vector as data.
pub struct Signed {
    pub fun: Py<PyAny>,
    pub surfaces: Surfaces,
    pub n_states: usize,
}

impl SignStructure for Signed {
    fn switches_at(&self, j: usize) -> bool {
        j < self.surfaces.n_switching
    }
}

impl PiecewiseSystem for Signed {
    fn n_states(&self) -> usize {
        self.n_states
    }

    fn n_surfaces(&self) -> usize {
        self.surfaces.functions.len()
    }

    fn field(&self, place: &Place<'_>, dx: &mut [f64]) -> Result<(), FieldError> {
        let &Place { t, x, signs, .. } = place;
        Python::attach(|py| {
            let arguments = (
                t,
                PyArray1::from_slice(py, x),
                PyArray1::from_slice(py, signs),
            );
            read_vector(&self.fun.bind(py).call1(arguments)?, dx, "fun")
        })
        .map_err(|e: PyErr| FieldError::new(e))
    }

    fn surfaces(&self, place: &Place<'_>, h: &mut [f64]) -> Result<(), FieldError> {
        self.surfaces.write(place.t, place.x, h)
    }

    fn surface_name(&self, j: usize) -> String {
        self.surfaces.names[j].clone()
    }
}

/// The map of an action, (t, x) -> x+, as a Python callable.
pub struct CalledMap(pub Py<PyAny>);

impl ActionMap for CalledMap {
    fn apply(&self, t: f64, x: &mut [f64], _: &[f64], _: &mut [f64]) -> Result<(), FieldError> {
        Python::attach(|py| {
            let value = self.0.bind(py).call1((t, PyArray1::from_slice(py, x)))?;
            read_vector(&value, x, "the map of a reset")
        })
        .map_err(|e: PyErr| FieldError::new(e))
    }
}

/// A user's event g(t, x) as a Python callable.
pub struct CalledEvent(pub Py<PyAny>);

impl UserFunction for CalledEvent {
    fn value(&self, t: f64, x: &[f64], _: &[f64]) -> Result<f64, FieldError> {
        Python::attach(|py| read_scalar(&self.0.bind(py).call1((t, PyArray1::from_slice(py, x)))?))
            .map_err(|e: PyErr| FieldError::new(e))
    }
}

/// The expression of a user's event, to be evaluated at points and enclosed along motions.
pub struct EventExpression {
    program: Program,
    enclosing: EnclosureProgram,
}

impl EventExpression {
    pub fn compile(graph: &Graph, node: NodeId) -> Result<Self, ExprError> {
        Ok(EventExpression {
            program: Program::compile(graph, &[node], Backend::Auto)?,
            enclosing: EnclosureProgram::compile(graph, &[node])?,
        })
    }
}

/// A user's event as a compiled expression. Expressions with signs, of the field or of their own, are not compiled
/// as events, so no signs are needed.
pub struct CompiledEvent {
    pub expression: Arc<EventExpression>,
    /// Knows the parameters.
    pub system: Arc<TracedSystem>,
}

impl UserFunction for CompiledEvent {
    fn value(&self, t: f64, x: &[f64], q: &[f64]) -> Result<f64, FieldError> {
        let mut out = [0.0];
        let program = &self.expression.program;
        self.system
            .with_values(q, |p| program.eval(t, x, &[], p, &[], &mut out));
        Ok(out[0])
    }

    fn has_bounds(&self) -> bool {
        true
    }

    fn enclose(&self, motion: &dyn Motion, q: &[f64]) -> Option<Enclosure> {
        let mut out = [Enclosure::UNKNOWN];
        let program = &self.expression.enclosing;
        self.system
            .with_values(q, |p| program.eval(motion, &[], p, &mut out));
        Some(out[0])
    }
}
