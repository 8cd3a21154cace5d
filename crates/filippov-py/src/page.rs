//! The engine of the interactive page, for hosts that have Python.

use filippov::action::Actions;
use filippov::PiecewiseSystem;
use filippov_web::{answer, pack, unpack, Description, Model, Parameter, Ready, Refusal, Source};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::prepared_run::{ActionRow, PreparedRun};

/// A model of the page: a system with its names, its default values and what the page shows first.
#[pyclass(frozen, module = "filippov._core")]
pub struct PageModel(Model);

#[pymethods]
impl PageModel {
    /// The model in the bytes of a saved system, with the section of a page or without one.
    #[new]
    fn new(data: &[u8]) -> PyResult<Self> {
        Model::from_bytes(data).map(PageModel).map_err(refused)
    }

    /// A model whose system and actions `make(params, t0, y0)` returns for every run; for functions that are called.
    #[staticmethod]
    #[pyo3(signature = (make, states, params, surfaces, page, actions=Vec::new(), discrete=Vec::new()))]
    fn of_calls(
        make: Py<PyAny>,
        states: Vec<String>,
        params: &Bound<'_, PyDict>,
        surfaces: Vec<String>,
        page: &str,
        actions: Vec<String>,
        discrete: Vec<String>,
    ) -> PyResult<Self> {
        let mut description = Description {
            states,
            surfaces,
            actions,
            discrete,
            ..Description::default()
        };
        description.set_page(page).map_err(refused)?;
        for (name, value) in params {
            description.params.push(Parameter {
                name: name.extract()?,
                value: value.extract()?,
            });
        }
        let model = Model::new(description, Box::new(Calls { make }));
        model.map(PageModel).map_err(refused)
    }

    /// The reply to a request.
    fn answer<'py>(&self, py: Python<'py>, request: &[u8]) -> Bound<'py, PyBytes> {
        let reply = py.detach(|| answer(&self.0, request));
        PyBytes::new(py, &reply)
    }
}

/// The reply of a model to a request.
#[pyfunction]
pub fn answer_page<'py>(py: Python<'py>, model: &PageModel, request: &[u8]) -> Bound<'py, PyBytes> {
    model.answer(py, request)
}

/// The bytes of a saved system with the section of a page.
#[pyfunction]
pub fn pack_page<'py>(py: Python<'py>, system: &[u8], page: &str) -> PyResult<Bound<'py, PyBytes>> {
    let bytes = pack(system, page).map_err(refused)?;
    Ok(PyBytes::new(py, &bytes))
}

/// The text of the section of the page in the bytes of a model; none in those of a system alone.
#[pyfunction]
pub fn page_of(data: &[u8]) -> PyResult<Option<String>> {
    let (_, page) = unpack(data).map_err(crate::systems::refused)?;
    Ok(page)
}

/// Systems that a function of Python makes.
struct Calls {
    make: Py<PyAny>,
}

impl Source for Calls {
    fn ready(&self, params: &[f64], t: f64, x: &[f64]) -> Result<Box<dyn Ready + '_>, Refusal> {
        let prepared = Python::attach(|py| {
            let arguments = (params.to_vec(), t, x.to_vec());
            let made = self.make.bind(py).call1(arguments)?;
            let (system, actions): (Bound<'_, PyAny>, Vec<ActionRow>) = made.extract()?;
            PreparedRun::new(&system, t, x.to_vec(), params.to_vec(), &[], &actions)
        });
        match prepared {
            Ok(prepared) => Ok(Box::new(prepared)),
            Err(error) => Err(Refusal::model(error.to_string())),
        }
    }
}

impl Ready for PreparedRun {
    fn system(&self) -> &dyn PiecewiseSystem {
        &**self.core()
    }

    fn actions(&self) -> Actions<'_> {
        PreparedRun::actions(self)
    }
}

fn refused(refusal: Refusal) -> PyErr {
    PyValueError::new_err(refusal.text)
}
