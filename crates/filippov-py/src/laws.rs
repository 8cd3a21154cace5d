//! Laws with memory as they come from Python.

use filippov::Law;
use filippov_expr::{Graph, NodeId};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::builder::Builder;

/// The kind of law, its nodes, and its numbers.
pub type LawRow = (String, Vec<u32>, Vec<f64>);

/// The law that a row describes.
pub fn read_law(graph: &Graph, (kind, nodes, numbers): &LawRow) -> PyResult<Law> {
    let found: PyResult<Vec<NodeId>> = nodes.iter().map(|&id| Builder::node(graph, id)).collect();
    Ok(match (kind.as_str(), &found?[..], &numbers[..]) {
        ("clock", &[argument], _) => Law::Clock { argument },
        ("held", &[argument], _) => Law::Held { argument },
        ("sign", &[argument], _) => Law::Sign { argument },
        ("level", &[argument], &[surface, orientation, guard]) => Law::Level {
            argument,
            surface: surface as usize,
            orientation,
            guard: guard as usize,
        },
        ("hysteresis", &[argument, low, high], &[initial, guard]) => Law::Hysteresis {
            argument,
            thresholds: [low, high],
            initial,
            guard: guard as usize,
        },
        _ => return Err(PyValueError::new_err(format!("unknown law {kind:?}"))),
    })
}
