//! The systems whose functions are Python callables, as Python objects.

use std::sync::Arc;

use filippov::{PiecewiseSystem, SignStructure};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::callbacks::{Opaque, Signed, Surfaces};
use crate::systems::{field_of, sliding_field_of, surface_values_of, Array, Output};

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
                field_of(py, (&*self.system, &[]), t, &x, &signs)
            }

            fn surface_values<'py>(&self, py: Python<'py>, t: f64, x: Array<'py>, signs: Array<'py>, p: Array<'py>) -> PyResult<Output<'py>> {
                let _ = p;
                surface_values_of(py, (&*self.system, &[]), t, &x, &signs)
            }

            #[allow(clippy::too_many_arguments)]
            fn sliding_field<'py>(&self, py: Python<'py>, t: f64, x: Array<'py>, signs: Array<'py>, p: Array<'py>, surface: usize) -> PyResult<(Output<'py>, f64, f64)> {
                let _ = p;
                sliding_field_of(py, (&*self.system, &[]), t, &x, &signs, surface)
            }

            fn active(&self, signs: Array<'_>) -> PyResult<Vec<bool>> {
                Ok(vec![true; signs.as_slice()?.len()])
            }

            fn switches_at(&self, surface: usize) -> bool {
                self.system.switches_at(surface)
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
