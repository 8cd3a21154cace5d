//! Laws with memory as they come from Python, and as bytes.

use filippov::Law;
use filippov_expr::{Graph, NodeId};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::builder::Builder;
use crate::systems::{read_block, read_number, write_block, write_number};

/// The kind of law, its nodes, and its numbers.
pub type LawRow = (String, Vec<u32>, Vec<f64>);

/// What a traced system has beside its field.
pub struct Extra {
    /// Surfaces that trigger actions.
    pub watched: Vec<usize>,
    /// The laws of its discrete states.
    pub laws: Vec<LawRow>,
    /// The last so many surfaces are those of laws, and not shown.
    pub n_hidden: usize,
    /// Surfaces with static friction above kinetic, and the nodes of the ratios.
    pub sticking: Vec<(usize, u32)>,
}

impl Extra {
    pub fn write(&self, bytes: &mut Vec<u8>) {
        write_number(bytes, self.n_hidden);
        write_number(bytes, self.watched.len());
        for &surface in &self.watched {
            write_number(bytes, surface);
        }
        write_number(bytes, self.sticking.len());
        for &(surface, ratio) in &self.sticking {
            write_number(bytes, surface);
            write_number(bytes, ratio as usize);
        }
        write_number(bytes, self.laws.len());
        for (kind, nodes, numbers) in &self.laws {
            write_block(bytes, kind.as_bytes());
            write_number(bytes, nodes.len());
            nodes
                .iter()
                .for_each(|&node| write_number(bytes, node as usize));
            let numbers: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
            write_block(bytes, &numbers);
        }
    }

    pub fn read(rest: &mut &[u8]) -> Option<Self> {
        let n_hidden = read_number(rest)? as usize;
        let mut watched = Vec::new();
        for _ in 0..read_number(rest)? {
            watched.push(read_number(rest)? as usize);
        }
        let mut sticking = Vec::new();
        for _ in 0..read_number(rest)? {
            let surface = read_number(rest)? as usize;
            sticking.push((surface, read_number(rest)?));
        }
        let mut laws = Vec::new();
        for _ in 0..read_number(rest)? {
            let kind = String::from_utf8(read_block(rest)?.to_vec()).ok()?;
            let mut nodes = Vec::new();
            for _ in 0..read_number(rest)? {
                nodes.push(read_number(rest)?);
            }
            let (numbers, _) = read_block(rest)?.as_chunks::<8>();
            let numbers = numbers.iter().map(|&bytes| f64::from_le_bytes(bytes));
            laws.push((kind, nodes, numbers.collect()));
        }
        Some(Extra {
            watched,
            laws,
            n_hidden,
            sticking,
        })
    }
}

/// The ratios of static to kinetic friction, by surface.
pub fn read_ratios(graph: &Graph, rows: &[(usize, u32)]) -> PyResult<Vec<(usize, NodeId)>> {
    let read = |&(surface, node): &(usize, u32)| {
        if surface >= graph.n_surfaces() {
            return Err(PyValueError::new_err(format!("no surface {surface}")));
        }
        Ok((surface, Builder::node(graph, node)?))
    };
    rows.iter().map(read).collect()
}

/// The law that a row describes.
pub fn read_law(graph: &Graph, (kind, nodes, numbers): &LawRow) -> PyResult<Law> {
    let found: PyResult<Vec<NodeId>> = nodes.iter().map(|&id| Builder::node(graph, id)).collect();
    Ok(match (kind.as_str(), &found?[..], &numbers[..]) {
        ("clock", &[argument], _) => Law::Clock { argument },
        ("held", &[argument], _) => Law::Held { argument },
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
