//! Graphs as bytes, and back with every byte checked.
//!
//! Layout, little endian: 8 bytes of magic with the version; number of nodes (u32) and each node as a tag
//! byte with its operands; number of surfaces (u32) and their nodes; number of known switches (u32), each
//! node, surface and orientation (0: +1, 1: -1); number of known absolute values (u32) and their nodes.

use rustc_hash::FxHashSet;

use crate::error::ExprError;
use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};

const MAGIC: [u8; 8] = *b"FILEXPR\x02";

const TAG_CONSTANT: u8 = 0;
const TAG_TIME: u8 = 1;
const TAG_STATE: u8 = 2;
const TAG_PARAMETER: u8 = 3;
const TAG_SIGN: u8 = 4;
const TAG_INPUT: u8 = 5;
const TAG_SELECT: u8 = 6;
const TAG_UNARY: u8 = 32;
const TAG_BINARY: u8 = 128;

impl Graph {
    /// The graph as bytes: nodes, surfaces and what is known about switching. Equal graphs give equal bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        let number = |bytes: &mut Vec<u8>, value: u32| bytes.extend(value.to_le_bytes());
        number(&mut bytes, self.nodes.len() as u32);
        for node in &self.nodes {
            let (tag, numbers): (u8, [Option<u32>; 3]) = match *node {
                Node::Constant(value) => {
                    bytes.push(TAG_CONSTANT);
                    bytes.extend(value.to_bits().to_le_bytes());
                    continue;
                }
                Node::Time => (TAG_TIME, [None; 3]),
                Node::State(i) => (TAG_STATE, [Some(i), None, None]),
                Node::Parameter(i) => (TAG_PARAMETER, [Some(i), None, None]),
                Node::Sign(j) => (TAG_SIGN, [Some(j), None, None]),
                Node::Input(i) => (TAG_INPUT, [Some(i), None, None]),
                Node::Unary(op, a) => (TAG_UNARY + op as u8, [Some(a.0), None, None]),
                Node::Binary(op, a, b) => (TAG_BINARY + op as u8, [Some(a.0), Some(b.0), None]),
                Node::Select {
                    surface,
                    plus,
                    minus,
                } => (TAG_SELECT, [Some(surface), Some(plus.0), Some(minus.0)]),
            };
            bytes.push(tag);
            for value in numbers.into_iter().flatten() {
                number(&mut bytes, value);
            }
        }
        number(&mut bytes, self.surfaces.functions.len() as u32);
        for function in &self.surfaces.functions {
            number(&mut bytes, function.0);
        }
        let mut switches: Vec<_> = self.surfaces.switches.iter().collect();
        switches.sort_unstable_by_key(|entry| entry.0);
        number(&mut bytes, switches.len() as u32);
        for (id, &(surface, orientation)) in switches {
            number(&mut bytes, id.0);
            number(&mut bytes, surface);
            bytes.push(u8::from(orientation < 0.0));
        }
        let absolute: Vec<_> = self.absolute_values().collect();
        number(&mut bytes, absolute.len() as u32);
        for id in absolute {
            number(&mut bytes, id.0);
        }
        bytes
    }

    /// The graph that [`Graph::to_bytes`] wrote.
    ///
    /// # Errors
    /// [`ExprError::UnknownFormat`] or [`ExprError::Damaged`] for anything else: operands that do not come
    /// before their node, unknown operations, equal nodes, surfaces that do not exist, missing or excess bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Graph, ExprError> {
        if bytes.len() < MAGIC.len() || bytes[..MAGIC.len()] != MAGIC {
            return Err(ExprError::UnknownFormat);
        }
        let mut reader = Reader {
            bytes,
            offset: MAGIC.len(),
        };
        let n_nodes = reader.number()?;
        let nodes = (0..n_nodes)
            .map(|k| reader.node(k))
            .collect::<Result<Vec<_>, _>>()?;

        let mut graph = Graph::new();
        for _ in 0..reader.number()? {
            let function = reader.operand(n_nodes)?;
            graph.surfaces.functions.push(function);
        }
        for _ in 0..reader.number()? {
            let id = reader.operand(n_nodes)?;
            let surface = reader.number()?;
            if surface as usize >= graph.n_surfaces() {
                return reader.damaged("a switch on a surface that does not exist");
            }
            let orientation = if reader.byte()? == 0 { 1.0 } else { -1.0 };
            graph.surfaces.switches.insert(id, (surface, orientation));
        }
        let mut absolute = FxHashSet::default();
        for _ in 0..reader.number()? {
            absolute.insert(reader.operand(n_nodes)?.index());
        }
        if reader.offset != bytes.len() {
            return reader.damaged("more bytes than expected");
        }
        for (k, node) in nodes.into_iter().enumerate() {
            if graph.insert_known(node, absolute.contains(&k)).index() != k {
                return reader.damaged("a node occurs twice");
            }
        }
        for index in 0..graph.n_surfaces() as u32 {
            graph.register_surface(index);
        }
        Ok(graph)
    }
}

/// Reads numbers and nodes, never beyond the end.
struct Reader<'a> {
    bytes: &'a [u8],
    offset: usize,
}

impl Reader<'_> {
    fn damaged<T>(&self, detail: &'static str) -> Result<T, ExprError> {
        Err(ExprError::Damaged {
            offset: self.offset,
            detail,
        })
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], ExprError> {
        let end = self.offset + N;
        match self
            .bytes
            .get(self.offset..end)
            .and_then(|part| part.try_into().ok())
        {
            Some(part) => {
                self.offset = end;
                Ok(part)
            }
            None => self.damaged("ends too early"),
        }
    }

    fn byte(&mut self) -> Result<u8, ExprError> {
        Ok(self.take::<1>()?[0])
    }

    fn number(&mut self) -> Result<u32, ExprError> {
        self.take().map(u32::from_le_bytes)
    }

    fn operand(&mut self, limit: u32) -> Result<NodeId, ExprError> {
        let id = self.number()?;
        if id < limit {
            Ok(NodeId(id))
        } else {
            self.damaged("an operand that does not come before its use")
        }
    }

    /// Node number `k`, whose operands are below `k`.
    fn node(&mut self, k: u32) -> Result<Node, ExprError> {
        Ok(match self.byte()? {
            TAG_CONSTANT => {
                let value = f64::from_bits(u64::from_le_bytes(self.take()?));
                Node::Constant(if value.is_nan() { f64::NAN } else { value })
            }
            TAG_TIME => Node::Time,
            TAG_STATE => Node::State(self.number()?),
            TAG_PARAMETER => Node::Parameter(self.number()?),
            TAG_SIGN => Node::Sign(self.number()?),
            TAG_INPUT => Node::Input(self.number()?),
            TAG_SELECT => Node::Select {
                surface: self.number()?,
                plus: self.operand(k)?,
                minus: self.operand(k)?,
            },
            tag => {
                let unary = tag
                    .checked_sub(TAG_UNARY)
                    .and_then(|n| UnaryOp::ALL.get(usize::from(n)));
                let binary = tag
                    .checked_sub(TAG_BINARY)
                    .and_then(|n| BinaryOp::ALL.get(usize::from(n)));
                match (unary, binary) {
                    (Some(&op), _) => Node::Unary(op, self.operand(k)?),
                    (_, Some(&op)) => Node::Binary(op, self.operand(k)?, self.operand(k)?),
                    _ => return self.damaged("an unknown operation"),
                }
            }
        })
    }
}

#[cfg(test)]
mod tests;
