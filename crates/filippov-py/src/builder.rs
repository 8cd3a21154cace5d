//! The expression graph under construction.

use std::sync::{Mutex, MutexGuard, PoisonError};

use filippov_expr::{
    legs_of_arc, roots, BinaryOp, Graph, Names, NodeId, RateTerms, Regions, Switching, UnaryOp,
};
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::regions::{as_tuples, by_name};

/// The coefficient of the time, the states that an expression is linear in, and the other states in it.
type Terms = (f64, Vec<(u32, f64)>, Vec<u32>);

/// An expression graph under construction; nodes are handed out as integers.
#[pyclass(frozen, module = "filippov._core")]
pub struct Builder {
    graph: Mutex<Graph>,
}

impl Builder {
    pub fn graph(&self) -> MutexGuard<'_, Graph> {
        self.graph.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The node with this number, if the graph has it.
    pub fn node(graph: &Graph, id: u32) -> PyResult<NodeId> {
        let node = NodeId(id);
        if graph.contains(node) {
            Ok(node)
        } else {
            Err(PyValueError::new_err(format!("no node {id} in this graph")))
        }
    }
}

/// How many of the first rows of parameters leave none of these nodes a number, and of each of these pairs of numbers the first
/// one below the second.
pub fn n_rows_without_number(
    graph: &Graph,
    (nodes, rising): (&[NodeId], &[[NodeId; 2]]),
    table: &PyReadonlyArray2<'_, f64>,
) -> PyResult<usize> {
    let (count, width) = (table.shape()[0], table.shape()[1]);
    if width == 0 {
        return Ok(count);
    }
    let mut rows = table.as_slice()?.chunks(width);
    let is_other = |row: &[f64]| {
        let mut values = nodes.iter().map(|&node| graph.value_at(node, row));
        let mut pairs = rising
            .iter()
            .map(|pair| pair.map(|node| graph.value_at(node, row)));
        let falls = |pair: [Option<f64>; 2]| matches!(pair, [Some(low), Some(high)] if low >= high);
        values.any(|value| value.is_some()) || pairs.any(falls)
    };
    Ok(rows.position(is_other).unwrap_or(count))
}

#[pymethods]
impl Builder {
    #[new]
    fn new() -> Self {
        Builder {
            graph: Mutex::new(Graph::new()),
        }
    }

    /// A builder of its own with the same expressions.
    fn copy(&self) -> Self {
        Builder {
            graph: Mutex::new(self.graph().clone()),
        }
    }

    fn constant(&self, value: f64) -> u32 {
        self.graph().constant(value).0
    }

    fn time(&self) -> u32 {
        self.graph().time().0
    }

    fn state(&self, index: u32) -> u32 {
        self.graph().state(index).0
    }

    fn parameter(&self, index: u32) -> u32 {
        self.graph().parameter(index).0
    }

    fn unary(&self, op: &str, a: u32) -> PyResult<u32> {
        let op = UnaryOp::from_name(op).ok_or_else(|| unknown(op))?;
        let mut graph = self.graph();
        let a = Self::node(&graph, a)?;
        Ok(roots::apply(&mut graph, op, a).0)
    }

    fn binary(&self, op: &str, a: u32, b: u32) -> PyResult<u32> {
        let op = BinaryOp::from_name(op).ok_or_else(|| unknown(op))?;
        let mut graph = self.graph();
        let (a, b) = (Self::node(&graph, a)?, Self::node(&graph, b)?);
        Ok(roots::apply_to_two(&mut graph, op, a, b).0)
    }

    /// The legs of which an arc is the angle: see `legs_of_arc`.
    fn legs_of_arc(&self, op: &str, a: u32) -> PyResult<Option<(u32, u32)>> {
        let op = UnaryOp::from_name(op).ok_or_else(|| unknown(op))?;
        let mut graph = self.graph();
        let a = Self::node(&graph, a)?;
        Ok(legs_of_arc(&mut graph, op, a).map(|(y, x)| (y.0, x.0)))
    }

    /// An expression without the terms that cancel in it: see `Graph::without_cancelled`.
    fn without_cancelled(&self, a: u32) -> PyResult<u32> {
        let mut graph = self.graph();
        let a = Self::node(&graph, a)?;
        Ok(graph.without_cancelled(a).0)
    }

    fn sign(&self, a: u32) -> PyResult<u32> {
        let mut graph = self.graph();
        let a = Self::node(&graph, a)?;
        Ok(graph.sign(a).0)
    }

    fn abs(&self, a: u32) -> PyResult<u32> {
        let mut graph = self.graph();
        let a = Self::node(&graph, a)?;
        Ok(graph.abs(a).0)
    }

    fn maximum(&self, a: u32, b: u32) -> PyResult<u32> {
        let mut graph = self.graph();
        let (a, b) = (Self::node(&graph, a)?, Self::node(&graph, b)?);
        Ok(graph.maximum(a, b).0)
    }

    fn minimum(&self, a: u32, b: u32) -> PyResult<u32> {
        let mut graph = self.graph();
        let (a, b) = (Self::node(&graph, a)?, Self::node(&graph, b)?);
        Ok(graph.minimum(a, b).0)
    }

    fn declare_surface(&self, a: u32) -> PyResult<u32> {
        let mut graph = self.graph();
        let a = Self::node(&graph, a)?;
        Ok(graph.declare_surface(a))
    }

    fn declare_not_negative(&self, a: u32) -> PyResult<()> {
        let mut graph = self.graph();
        let a = Self::node(&graph, a)?;
        graph.declare_not_negative(a);
        Ok(())
    }

    /// Whether an expression may bend, jump or end: see `Graph::has_kinks`.
    fn has_kinks(&self, a: u32) -> PyResult<bool> {
        let graph = self.graph();
        let a = Self::node(&graph, a)?;
        Ok(graph.has_kinks(a))
    }

    /// The ends of an interval that an expression does not leave.
    fn range(&self, a: u32) -> PyResult<(f64, f64)> {
        let graph = self.graph();
        Ok(graph.range(Self::node(&graph, a)?))
    }

    fn switch(&self, a: u32) -> PyResult<(i64, f64)> {
        let mut graph = self.graph();
        let a = Self::node(&graph, a)?;
        Ok(match graph.switch(a) {
            Switching::Constant(sign) => (-1, sign),
            Switching::Surface { index, orientation } => (i64::from(index), orientation),
        })
    }

    /// Lets an expression switch where another one does.
    fn switch_as(&self, a: u32, other: u32) -> PyResult<()> {
        let mut graph = self.graph();
        let (a, other) = (Self::node(&graph, a)?, Self::node(&graph, other)?);
        graph.switch_as(a, other);
        Ok(())
    }

    fn select(&self, surface: u32, orientation: f64, plus: u32, minus: u32) -> PyResult<u32> {
        let mut graph = self.graph();
        if surface as usize >= graph.n_surfaces() {
            return Err(PyValueError::new_err(format!(
                "no surface {surface} in this graph"
            )));
        }
        let (plus, minus) = (Self::node(&graph, plus)?, Self::node(&graph, minus)?);
        Ok(graph.select(surface, orientation, plus, minus).0)
    }

    fn as_constant(&self, a: u32) -> PyResult<Option<f64>> {
        let graph = self.graph();
        Ok(graph.as_constant(Self::node(&graph, a)?))
    }

    fn depends_on_motion(&self, a: u32) -> PyResult<bool> {
        let graph = self.graph();
        Ok(graph.depends_on_motion(Self::node(&graph, a)?))
    }

    fn value_at(&self, a: u32, parameters: Vec<f64>) -> PyResult<Option<f64>> {
        let graph = self.graph();
        Ok(graph.value_at(Self::node(&graph, a)?, &parameters))
    }

    fn n_rows_without_number(
        &self,
        nodes: Vec<u32>,
        rising: Vec<[u32; 2]>,
        table: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<usize> {
        let graph = self.graph();
        let nodes = nodes.into_iter().map(|id| Self::node(&graph, id));
        let nodes = nodes.collect::<PyResult<Vec<_>>>()?;
        let pair = |[low, high]: [u32; 2]| {
            PyResult::Ok([Self::node(&graph, low)?, Self::node(&graph, high)?])
        };
        let rising = rising.into_iter().map(pair).collect::<PyResult<Vec<_>>>()?;
        n_rows_without_number(&graph, (&nodes, &rising), &table)
    }

    fn depends_on_state(&self, a: u32) -> PyResult<bool> {
        let graph = self.graph();
        Ok(graph.depends_on_state(Self::node(&graph, a)?))
    }

    /// What the rate of an expression is made of: see `Graph::rate_terms`.
    fn rate_terms(&self, a: u32) -> PyResult<Option<Terms>> {
        let graph = self.graph();
        let terms = graph.rate_terms(Self::node(&graph, a)?);
        Ok(terms.map(|terms| (terms.of_time, terms.linear, terms.others)))
    }

    /// Whether an expression with these terms is constant along the motions of a field.
    fn is_constant_of_motion(&self, terms: Terms, field: Vec<u32>) -> PyResult<bool> {
        let graph = self.graph();
        let nodes = field.into_iter().map(|id| Self::node(&graph, id));
        let field = nodes.collect::<PyResult<Vec<_>>>()?;
        let (of_time, linear, others) = terms;
        let terms = RateTerms {
            of_time,
            linear,
            others,
        };
        Ok(graph.is_constant_of_motion(&terms, &field))
    }

    /// The indices of the parameters in an expression.
    fn parameters_read(&self, a: u32) -> PyResult<Vec<u32>> {
        let graph = self.graph();
        Ok(graph.parameters_read(Self::node(&graph, a)?))
    }

    fn has_signs(&self, a: u32) -> PyResult<bool> {
        let graph = self.graph();
        Ok(graph.has_signs(Self::node(&graph, a)?))
    }

    /// Replaces parts of an expression: the first node of each pair by the second one.
    fn substituted(&self, a: u32, images: Vec<(u32, u32)>) -> PyResult<u32> {
        let mut graph = self.graph();
        let a = Self::node(&graph, a)?;
        let pair = |(from, to)| Ok((Self::node(&graph, from)?, Self::node(&graph, to)?));
        let images = images.into_iter().map(pair).collect::<PyResult<Vec<_>>>()?;
        Ok(graph.substituted(a, &images).0)
    }

    /// An expression of another builder, made again here, with the numbers that its parameters have here; none if it contains
    /// signs, or a parameter without a number.
    fn adopted(
        &self,
        other: &Builder,
        a: u32,
        parameters: Vec<Option<u32>>,
    ) -> PyResult<Option<u32>> {
        let from = other.graph().clone();
        let a = Self::node(&from, a)?;
        let made = self.graph().adopted(&from, a, &parameters);
        Ok(made.map(|id| id.0))
    }

    /// Those of some expressions that others are made of.
    fn occurring(&self, nodes: Vec<u32>, within: Vec<u32>) -> PyResult<Vec<u32>> {
        let graph = self.graph();
        let within = within.into_iter().map(|id| Self::node(&graph, id));
        let below: Vec<u32> = graph
            .all_below(&within.collect::<PyResult<Vec<_>>>()?)
            .into_iter()
            .map(|id| id.0)
            .collect();
        let mut nodes = nodes;
        nodes.retain(|id| below.binary_search(id).is_ok());
        Ok(nodes)
    }

    /// Whether an expression changes only where signs or discrete states inside of it do.
    fn is_stepwise(&self, a: u32) -> PyResult<bool> {
        let graph = self.graph();
        Ok(graph.is_stepwise(Self::node(&graph, a)?))
    }

    fn is_affine(&self, a: u32) -> PyResult<bool> {
        let graph = self.graph();
        Ok(graph.is_affine(Self::node(&graph, a)?))
    }

    /// Renumbers the surfaces: those that no motion crosses come last, but for those in `kept`. Returns the new numbers.
    fn put_standing_surfaces_last(&self, kept: Vec<u32>) -> Vec<u32> {
        self.graph().put_standing_surfaces_last(&kept)
    }

    /// The switching functions, in the order of the surfaces.
    fn surface_functions(&self) -> Vec<u32> {
        let graph = self.graph();
        (0..graph.n_surfaces())
            .map(|j| graph.surface(j as u32).0)
            .collect()
    }

    fn n_surfaces(&self) -> usize {
        self.graph().n_surfaces()
    }

    /// The pieces of an expression, none if they were not found out; whether they are those of these parameters only, and whether
    /// those as near to these as one likes have others.
    fn pieces<'py>(
        &self,
        py: Python<'py>,
        a: u32,
        parameters: Vec<f64>,
        discrete: Vec<String>,
        most: usize,
        in_full: bool,
    ) -> PyResult<(Option<Bound<'py, PyAny>>, bool, bool)> {
        let discrete = by_name(&discrete)?;
        let mut graph = self.graph();
        let a = Self::node(&graph, a)?;
        let mut regions = Regions::new(std::mem::take(&mut *graph), parameters, discrete);
        let pieces = regions.pieces(a, most, in_full);
        let (used_parameters, is_at_border) = (regions.used_parameters(), regions.is_at_border());
        *graph = regions.into_graph();
        let tuples = pieces.map(|pieces| as_tuples(py, &pieces)).transpose()?;
        Ok((tuples, used_parameters, is_at_border))
    }

    #[pyo3(signature = (a, states=None, parameters=None))]
    fn text(
        &self,
        a: u32,
        states: Option<Vec<String>>,
        parameters: Option<Vec<String>>,
    ) -> PyResult<String> {
        let graph = self.graph();
        let names = Names {
            states: states.unwrap_or_default(),
            parameters: parameters.unwrap_or_default(),
        };
        Ok(graph.text(Self::node(&graph, a)?, &names))
    }
}

fn unknown(op: &str) -> PyErr {
    PyValueError::new_err(format!("unknown operation {op:?}"))
}
