//! Regions of traced expressions, for the checks of the tracing stage.

use std::sync::{Mutex, MutexGuard, PoisonError};

use filippov_expr::{Discrete, Edge, Names, NodeId, PartSign, Pieces, Switching};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::builder::Builder;

/// Signs that are fixed, by surface.
type Signs = Vec<(u32, f64)>;

/// The regions of the expressions of a builder, in a copy of its graph.
#[pyclass(frozen, module = "filippov._core")]
pub struct Regions {
    regions: Mutex<filippov_expr::Regions>,
}

impl Regions {
    fn lock(&self) -> MutexGuard<'_, filippov_expr::Regions> {
        self.regions.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Kinds of discrete states by their names.
pub fn by_name(discrete: &[String]) -> PyResult<Vec<Discrete>> {
    let kinds = discrete.iter().map(|name| match name.as_str() {
        "whole" => Ok(Discrete::Whole),
        "side" => Ok(Discrete::Side),
        "real" => Ok(Discrete::Real),
        _ => Err(PyValueError::new_err(format!("no discrete state {name:?}"))),
    });
    kinds.collect()
}

/// Pieces as nested tuples: `(surface, plus, minus)`, and at the ends the expression with its sign, "held" or `None`.
pub fn as_tuples<'py>(py: Python<'py>, pieces: &Pieces) -> PyResult<Bound<'py, PyAny>> {
    Ok(match pieces {
        Pieces::Part(node, PartSign::Known(sign)) => (node.0, *sign).into_pyobject(py)?.into_any(),
        Pieces::Part(node, PartSign::Held) => (node.0, "held").into_pyobject(py)?.into_any(),
        Pieces::Part(node, PartSign::Open) => (node.0, py.None()).into_pyobject(py)?.into_any(),
        Pieces::Sides(surface, sides) => {
            let [plus, minus] = [as_tuples(py, &sides[0])?, as_tuples(py, &sides[1])?];
            (*surface, plus, minus).into_pyobject(py)?.into_any()
        }
    })
}

/// Signs as the expression crate takes them.
fn by_surface(regions: &filippov_expr::Regions, signs: &Signs) -> PyResult<Vec<Option<f64>>> {
    let mut all = vec![None; regions.graph().n_surfaces()];
    for &(surface, sign) in signs {
        *all.get_mut(surface as usize).ok_or_else(|| {
            PyValueError::new_err(format!("no surface {surface} in this graph"))
        })? = Some(sign);
    }
    Ok(all)
}

#[pymethods]
impl Regions {
    #[new]
    fn new(
        py: Python<'_>,
        builder: Py<Builder>,
        parameters: Vec<f64>,
        discrete: Vec<String>,
    ) -> PyResult<Self> {
        let graph = builder.borrow(py).graph().clone();
        let regions = filippov_expr::Regions::new(graph, parameters, by_name(&discrete)?);
        Ok(Regions {
            regions: Mutex::new(regions),
        })
    }

    #[getter]
    fn used_parameters(&self) -> bool {
        self.lock().used_parameters()
    }

    #[getter]
    fn is_at_border(&self) -> bool {
        self.lock().is_at_border()
    }

    fn question(&self, node: u32) -> PyResult<(u32, i64, f64, bool)> {
        let mut regions = self.lock();
        let node = Builder::node(regions.graph(), node)?;
        let (rest, switching) = regions.question(node);
        let has_signs = regions.graph().has_signs(rest);
        Ok(match switching {
            Switching::Constant(sign) => (rest.0, -1, sign, has_signs),
            Switching::Surface { index, orientation } => {
                (rest.0, i64::from(index), orientation, has_signs)
            }
        })
    }

    fn matters(&self, roots: Vec<u32>, signs: Signs, surface: u32) -> PyResult<bool> {
        let mut regions = self.lock();
        let roots = roots
            .into_iter()
            .map(|root| Builder::node(regions.graph(), root))
            .collect::<PyResult<Vec<_>>>()?;
        let signs = by_surface(&regions, &signs)?;
        Ok(regions.matters(&roots, &signs, surface))
    }

    fn reads(&self, roots: Vec<u32>, signs: Signs, state: u32) -> PyResult<bool> {
        let mut regions = self.lock();
        let roots = roots
            .into_iter()
            .map(|root| Builder::node(regions.graph(), root))
            .collect::<PyResult<Vec<_>>>()?;
        let signs = by_surface(&regions, &signs)?;
        Ok(regions.reads(&roots, &signs, state))
    }

    fn jumps_at(&self, node: u32) -> PyResult<Option<u32>> {
        let mut regions = self.lock();
        let node = Builder::node(regions.graph(), node)?;
        Ok(regions.jumps_at(node))
    }

    fn edge(&self, node: u32) -> PyResult<Option<(bool, u32)>> {
        let mut regions = self.lock();
        let node = Builder::node(regions.graph(), node)?;
        Ok(regions.edge(node).map(|edge| match edge {
            Edge::Singular(id) => (true, id.0),
            Edge::Domain(id) => (false, id.0),
        }))
    }

    /// The switching function of a surface with these signs inside of it.
    fn function(&self, surface: u32, signs: Signs) -> PyResult<u32> {
        let mut regions = self.lock();
        let signs = by_surface(&regions, &signs)?;
        if surface as usize >= signs.len() {
            return Err(PyValueError::new_err(format!(
                "no surface {surface} in this graph"
            )));
        }
        Ok(regions.function(surface, &signs).0)
    }

    fn conditions(&self, signs: Signs) -> PyResult<Vec<(u32, f64)>> {
        let mut regions = self.lock();
        let signs = by_surface(&regions, &signs)?;
        let found = regions.conditions(&signs);
        Ok(found.into_iter().map(|(id, side)| (id.0, side)).collect())
    }

    #[pyo3(signature = (node, states=None, parameters=None))]
    fn text(
        &self,
        node: u32,
        states: Option<Vec<String>>,
        parameters: Option<Vec<String>>,
    ) -> PyResult<String> {
        let regions = self.lock();
        let names = Names {
            states: states.unwrap_or_default(),
            parameters: parameters.unwrap_or_default(),
        };
        let node: NodeId = Builder::node(regions.graph(), node)?;
        Ok(regions.graph().text(node, &names))
    }
}
