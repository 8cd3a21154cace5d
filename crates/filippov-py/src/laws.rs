//! Laws with memory as they come from Python.

use filippov::{Law, Step};
use filippov_expr::{Graph, NodeId};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::builder::Builder;

/// The kind of law, its nodes, and its numbers.
pub type LawRow = (String, Vec<u32>, Vec<f64>);

/// The law that a row describes.
pub fn read_law(graph: &Graph, (kind, nodes, numbers): &LawRow) -> PyResult<Law> {
    let found: PyResult<Vec<NodeId>> = nodes.iter().map(|&id| Builder::node(graph, id)).collect();
    let held = |argument, step| Law::Held { argument, step };
    Ok(match (kind.as_str(), &found?[..], &numbers[..]) {
        ("clock", &[argument], _) => Law::Clock { argument },
        ("named", &[initial], _) => Law::Named { initial },
        ("held", &[argument], _) => held(argument, Step::Floor),
        ("sign", &[argument], _) => held(argument, Step::Sign),
        ("place", &[argument], knots) => held(argument, Step::Place(knots.into())),
        ("entry", &[argument], &[first, ref list @ ..]) => {
            let list = list.into();
            held(argument, Step::Entry { first, list })
        }
        ("level", &[argument], &[surface, orientation, guard]) => Law::Level {
            argument,
            surface: surface as usize,
            orientation,
            guard: guard as usize,
        },

        ("piece", &[argument], &[guard, ref knots @ ..]) => Law::Piece {
            argument,
            guard: (guard >= 0.0).then_some(guard as usize),
            knots: knots.into(),
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
