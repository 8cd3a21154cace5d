//! The systems as Python objects.

use std::sync::{Arc, Mutex, PoisonError};

use filippov::field::{SlidingField, SmoothField};
use filippov::{FieldError, PiecewiseSystem};
use filippov_expr::{Backend, Graph, Names, NodeId};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::builder::Builder;
use crate::callbacks::{EventExpression, Opaque, Signed, Surfaces};

type Array<'py> = PyReadonlyArray1<'py, f64>;
type Output<'py> = Bound<'py, PyArray1<f64>>;

/// Hands an exception of a user's function back.
pub fn raised(error: FieldError) -> PyErr {
    match error.0.downcast::<PyErr>() {
        Ok(error) => *error,
        Err(_) => PyRuntimeError::new_err("a function of the system failed"),
    }
}

/// A system of the core that can be run by threads.
pub type CoreSystem = Arc<dyn PiecewiseSystem + Send + Sync>;

/// The system of the core behind a Python object, with these parameter values.
pub fn core_of(system: &Bound<'_, PyAny>, p: &Array<'_>) -> PyResult<CoreSystem> {
    if let Ok(traced) = system.cast::<TracedSystem>() {
        return Ok(Arc::new(traced.get().with(p)?));
    }
    if let Ok(opaque) = system.cast::<OpaqueSystem>() {
        return Ok(Arc::clone(&opaque.get().system) as _);
    }
    if let Ok(signed) = system.cast::<SignedSystem>() {
        return Ok(Arc::clone(&signed.get().system) as _);
    }
    Err(PyTypeError::new_err(
        "system: a TracedSystem, OpaqueSystem or SignedSystem is needed",
    ))
}

fn field_of<'py>(
    py: Python<'py>,
    system: &dyn PiecewiseSystem,
    t: f64,
    x: &Array<'py>,
    signs: &Array<'py>,
) -> PyResult<Output<'py>> {
    let (x, signs) = checked(system, x, signs)?;
    let mut dx = vec![0.0; system.n_states()];
    system.field(t, x, signs, &mut dx).map_err(raised)?;
    Ok(PyArray1::from_vec(py, dx))
}

/// The sliding field on one surface, and the normal components of both sides.
fn sliding_field_of<'py>(
    py: Python<'py>,
    system: &dyn PiecewiseSystem,
    t: f64,
    x: &Array<'py>,
    signs: &Array<'py>,
    surface: usize,
) -> PyResult<(Output<'py>, f64, f64)> {
    let (x, signs) = checked(system, x, signs)?;
    if surface >= signs.len() {
        return Err(PyValueError::new_err(format!("no surface {surface}")));
    }
    let mut field = SlidingField::new(system, surface, signs);
    let mut dx = vec![0.0; x.len()];
    field.eval(t, &mut x.to_vec(), &mut dx).map_err(raised)?;
    let a = field.last();
    Ok((PyArray1::from_vec(py, dx), a.minus, a.plus))
}

fn surface_values_of<'py>(
    py: Python<'py>,
    system: &dyn PiecewiseSystem,
    t: f64,
    x: &Array<'py>,
    signs: &Array<'py>,
) -> PyResult<Output<'py>> {
    let (x, signs) = checked(system, x, signs)?;
    let mut h = vec![0.0; system.n_surfaces()];
    system.surfaces(t, x, signs, &mut h).map_err(raised)?;
    Ok(PyArray1::from_vec(py, h))
}

fn checked<'a>(
    system: &dyn PiecewiseSystem,
    x: &'a Array<'_>,
    signs: &'a Array<'_>,
) -> PyResult<(&'a [f64], &'a [f64])> {
    let (x, signs) = (x.as_slice()?, signs.as_slice()?);
    if x.len() != system.n_states() {
        let text = format!(
            "x has length {}, but the system has {} states",
            x.len(),
            system.n_states()
        );
        return Err(PyValueError::new_err(text));
    }
    if signs.len() != system.n_surfaces() {
        let text = format!(
            "signs has length {}, but the system has {} surfaces",
            signs.len(),
            system.n_surfaces()
        );
        return Err(PyValueError::new_err(text));
    }
    Ok((x, signs))
}

/// A system given by a traced expression graph.
#[pyclass(frozen, module = "filippov._core")]
pub struct TracedSystem {
    pub system: filippov::TracedSystem,
    /// Surfaces that trigger actions.
    watched: Vec<usize>,
    /// Kept for events, which are traced after the system into the same graph.
    builder: Option<Py<Builder>>,
    /// Compiled events with their nodes; the index is the handle.
    events: Mutex<Vec<(u32, Arc<EventExpression>)>>,
}

impl TracedSystem {
    fn build(
        graph: Graph,
        field: Vec<NodeId>,
        names: Names,
        watched: Vec<usize>,
        builder: Option<Py<Builder>>,
    ) -> PyResult<Self> {
        let zeros = vec![0.0; names.parameters.len()];
        let system = filippov::TracedSystem::new(graph, field, zeros, names, Backend::Auto)
            .map_err(|e| PyValueError::new_err(e.to_string()))?;
        Ok(TracedSystem {
            system: system.watching(&watched),
            watched,
            builder,
            events: Mutex::default(),
        })
    }

    /// The event with this handle.
    pub fn event_expression(&self, handle: usize) -> Option<Arc<EventExpression>> {
        self.events
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .get(handle)
            .map(|(_, program)| Arc::clone(program))
    }

    pub fn with(&self, p: &Array<'_>) -> PyResult<filippov::TracedSystem> {
        Ok(self.system.with_parameters(p.as_slice()?.to_vec()))
    }
}

#[pymethods]
impl TracedSystem {
    #[new]
    #[pyo3(signature = (builder, field, n_states, parameters, states=None, watched=Vec::new()))]
    fn new(
        py: Python<'_>,
        builder: Py<Builder>,
        field: Vec<u32>,
        n_states: usize,
        parameters: Vec<String>,
        states: Option<Vec<String>>,
        watched: Vec<usize>,
    ) -> PyResult<Self> {
        if field.len() != n_states {
            let text = format!("{} expressions for {n_states} states", field.len());
            return Err(PyValueError::new_err(text));
        }
        let graph = builder.borrow(py).graph().clone();
        let field = field
            .into_iter()
            .map(|id| Builder::node(&graph, id))
            .collect::<PyResult<Vec<_>>>()?;
        let names = Names {
            states: states.unwrap_or_default(),
            parameters,
        };
        Self::build(graph, field, names, watched, Some(builder))
    }

    #[getter]
    fn n_states(&self) -> usize {
        self.system.n_states()
    }

    #[getter]
    fn n_surfaces(&self) -> usize {
        self.system.n_surfaces()
    }

    fn surfaces(&self) -> Vec<String> {
        (0..self.system.n_surfaces())
            .map(|j| self.system.surface_name(j))
            .collect()
    }

    fn field<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        x: Array<'py>,
        signs: Array<'py>,
        p: Array<'py>,
    ) -> PyResult<Output<'py>> {
        field_of(py, &self.with(&p)?, t, &x, &signs)
    }

    fn surface_values<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        x: Array<'py>,
        signs: Array<'py>,
        p: Array<'py>,
    ) -> PyResult<Output<'py>> {
        surface_values_of(py, &self.with(&p)?, t, &x, &signs)
    }

    #[allow(clippy::too_many_arguments)]
    fn sliding_field<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        x: Array<'py>,
        signs: Array<'py>,
        p: Array<'py>,
        surface: usize,
    ) -> PyResult<(Output<'py>, f64, f64)> {
        sliding_field_of(py, &self.with(&p)?, t, &x, &signs, surface)
    }

    fn active(&self, signs: Array<'_>) -> PyResult<Vec<bool>> {
        let mut active = vec![true; self.system.n_surfaces()];
        if signs.as_slice()?.len() != active.len() {
            return Err(PyValueError::new_err(
                "signs: one entry per surface is needed",
            ));
        }
        self.system.active(signs.as_slice()?, &[], &mut active);
        Ok(active)
    }

    fn is_native(&self) -> bool {
        self.system.is_native()
    }

    /// Compiles a node of the builder as an event, once; returns the handle for `solve`.
    fn event(&self, py: Python<'_>, node: u32) -> PyResult<usize> {
        let builder = self
            .builder
            .as_ref()
            .ok_or_else(|| {
                PyValueError::new_err("events cannot be traced for a system that was unpickled")
            })?
            .borrow(py);
        let graph = builder.graph();
        let mut events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = events.iter().position(|(compiled, _)| *compiled == node) {
            return Ok(known);
        }
        let event = EventExpression::compile(&graph, Builder::node(&graph, node)?)
            .map_err(|e| PyValueError::new_err(e.to_string()))?;
        events.push((node, Arc::new(event)));
        Ok(events.len() - 1)
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let mut bytes = Vec::new();
        let names = self.system.names();
        write_number(&mut bytes, self.system.field_nodes().len());
        for node in self.system.field_nodes() {
            write_number(&mut bytes, node.index());
        }
        write_number(&mut bytes, self.watched.len());
        for &surface in &self.watched {
            write_number(&mut bytes, surface);
        }
        for list in [&names.states, &names.parameters] {
            write_number(&mut bytes, list.len());
            for name in list {
                write_block(&mut bytes, name.as_bytes());
            }
        }
        write_block(&mut bytes, &self.system.graph().to_bytes());
        PyBytes::new(py, &bytes)
    }

    #[staticmethod]
    fn from_bytes(data: &[u8]) -> PyResult<Self> {
        let damaged = || PyValueError::new_err("these bytes are not a traced system");
        let mut rest = data;
        let count = read_number(&mut rest).ok_or_else(damaged)? as usize;
        let mut field = Vec::new();
        for _ in 0..count {
            field.push(read_number(&mut rest).ok_or_else(damaged)?);
        }
        let count = read_number(&mut rest).ok_or_else(damaged)? as usize;
        let mut watched = Vec::new();
        for _ in 0..count {
            watched.push(read_number(&mut rest).ok_or_else(damaged)? as usize);
        }
        let mut lists = [Vec::new(), Vec::new()];
        for list in &mut lists {
            for _ in 0..read_number(&mut rest).ok_or_else(damaged)? {
                let block = read_block(&mut rest).ok_or_else(damaged)?;
                list.push(String::from_utf8(block.to_vec()).map_err(|_| damaged())?);
            }
        }
        let graph = Graph::from_bytes(read_block(&mut rest).ok_or_else(damaged)?)
            .map_err(|e| PyValueError::new_err(e.to_string()))?;
        let field = field
            .into_iter()
            .map(|id| Builder::node(&graph, id))
            .collect::<PyResult<Vec<_>>>()?;
        let [states, parameters] = lists;
        let names = Names { states, parameters };
        Self::build(graph, field, names, watched, None)
    }
}

fn write_number(bytes: &mut Vec<u8>, number: usize) {
    bytes.extend((number as u32).to_le_bytes());
}

fn write_block(bytes: &mut Vec<u8>, block: &[u8]) {
    write_number(bytes, block.len());
    bytes.extend(block);
}

fn read_number(rest: &mut &[u8]) -> Option<u32> {
    let (head, tail) = rest.split_first_chunk::<4>()?;
    *rest = tail;
    Some(u32::from_le_bytes(*head))
}

fn read_block<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let length = read_number(rest)? as usize;
    let (head, tail) = rest.split_at_checked(length)?;
    *rest = tail;
    Some(head)
}

/// The Python methods that both kinds of callable system share.
macro_rules! callable_system {
    ($(#[$doc:meta])* $name:ident, $core:ident) => {
        $(#[$doc])*
        #[pyclass(frozen, module = "filippov._core")]
        pub struct $name {
            pub system: Arc<$core>,
        }

        #[pymethods]
        impl $name {
            #[new]
            #[pyo3(signature = (fun, surfaces, n_states, names, n_switching=None))]
            fn new(fun: Py<PyAny>, surfaces: Vec<Py<PyAny>>, n_states: usize, names: Vec<String>, n_switching: Option<usize>) -> PyResult<Self> {
                if names.len() != surfaces.len() {
                    return Err(PyValueError::new_err("names: one per surface is needed"));
                }
                let n_switching = n_switching.unwrap_or(surfaces.len());
                let surfaces = Surfaces { functions: surfaces, names, n_switching };
                Ok($name { system: Arc::new($core { fun, surfaces, n_states }) })
            }

            #[getter]
            fn n_states(&self) -> usize {
                self.system.n_states
            }

            #[getter]
            fn n_surfaces(&self) -> usize {
                self.system.n_surfaces()
            }

            fn surfaces(&self) -> Vec<String> {
                self.system.surfaces.names.clone()
            }

            fn field<'py>(&self, py: Python<'py>, t: f64, x: Array<'py>, signs: Array<'py>, p: Array<'py>) -> PyResult<Output<'py>> {
                let _ = p;
                field_of(py, &*self.system, t, &x, &signs)
            }

            fn surface_values<'py>(&self, py: Python<'py>, t: f64, x: Array<'py>, signs: Array<'py>, p: Array<'py>) -> PyResult<Output<'py>> {
                let _ = p;
                surface_values_of(py, &*self.system, t, &x, &signs)
            }

            #[allow(clippy::too_many_arguments)]
            fn sliding_field<'py>(&self, py: Python<'py>, t: f64, x: Array<'py>, signs: Array<'py>, p: Array<'py>, surface: usize) -> PyResult<(Output<'py>, f64, f64)> {
                let _ = p;
                sliding_field_of(py, &*self.system, t, &x, &signs, surface)
            }

            fn active(&self, signs: Array<'_>) -> PyResult<Vec<bool>> {
                Ok(vec![true; signs.as_slice()?.len()])
            }

            fn is_native(&self) -> bool {
                false
            }
        }
    };
}

callable_system! {
    /// A black box f(t, x) with declared switching functions.
    OpaqueSystem, Opaque
}
callable_system! {
    /// A callable f(t, x, s) with the sign vector as data.
    SignedSystem, Signed
}
