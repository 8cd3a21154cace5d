//! Graphs as bytes, and back: nothing is believed, everything is built again.
//!
//! The section of a graph: number of nodes and each node as a tag byte with its operands; number of surfaces and their
//! nodes; number of known switches, each node, surface and orientation (0: +1, 1: -1); number of known absolute
//! values and their nodes.
//!
//! The nodes are made again by the construction that simplifies. For a graph that this crate has made that changes
//! nothing. Other bytes cannot give a graph that no construction would give, such as a chain of a hundred thousand
//! negations, on which simplification would recurse as deep.

use rustc_hash::FxHashSet;

use crate::container::{Container, Section, Tag, Writer};
use crate::error::ExprError;
use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::schedule::LARGEST_INDEX;

/// The content of a container that holds a graph and nothing else.
const CONTENT: Tag = Tag(*b"GRPH");

/// The section of a graph.
const NODES: Tag = Tag(*b"NODE");

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
    ///
    /// A graph with signs of surfaces that it does not have, or that were made before their function
    /// ([`Graph::sign_of`]), is not read again.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut writer = Writer::new(CONTENT);
        self.write_section(&mut writer);
        writer.finish()
    }

    /// The graph that [`Graph::to_bytes`] wrote.
    ///
    /// # Errors
    /// Those of [`Container::open`] for anything else, and [`ExprError::Damaged`] for operands that do not come before
    /// their node, unknown operations, equal nodes, surfaces that do not exist, signs before the function of their surface,
    /// missing or excess bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Graph, ExprError> {
        let mut container = Container::open(bytes, CONTENT)?;
        let (graph, _) = Graph::read_section(&mut container)?;
        container.finish()?;
        Ok(graph)
    }

    /// Writes the graph as a section of a container.
    pub fn write_section(&self, writer: &mut Writer) {
        writer.section(NODES);
        writer.number(self.nodes.len());
        for node in &self.nodes {
            write_node(writer, node);
        }
        writer.number(self.surfaces.functions.len());
        for function in &self.surfaces.functions {
            writer.number(function.index());
        }
        let mut switches: Vec<_> = self.surfaces.switches.iter().collect();
        switches.sort_unstable_by_key(|entry| entry.0);
        writer.number(switches.len());
        for (id, &(surface, orientation)) in switches {
            writer.number(id.index());
            writer.number(surface as usize);
            writer.byte(u8::from(orientation < 0.0));
        }
        let absolute: Vec<_> = self.absolute_values().collect();
        writer.number(absolute.len());
        for id in absolute {
            writer.number(id.index());
        }
    }

    /// The graph that [`Graph::write_section`] wrote as the next section of a container, and the node that each written one
    /// has become: what has been learned about switching since a node was made may simplify it further.
    ///
    /// # Errors
    /// [`ExprError::Damaged`], as [`Graph::from_bytes`].
    pub fn read_section(container: &mut Container) -> Result<(Graph, Vec<NodeId>), ExprError> {
        let mut section = container.section(NODES)?;
        let nodes = read_nodes(&mut section)?;
        let functions = read_surfaces(&mut section, &nodes)?;
        let switches = read_switches(&mut section, nodes.len(), functions.len())?;
        let absolute = read_absolute_values(&mut section, &nodes)?;
        section.finish()?;
        Ok(Graph::made_of(&nodes, &functions, &switches, &absolute))
    }

    /// Makes the graph again. The second number of each pair is the state that replaces the parameter with the first number. Returns the
    /// new graph, and for each old node the new one.
    pub fn with_states_for(&self, parameters: &[(u32, u32)]) -> (Graph, Vec<NodeId>) {
        let replaced = |node: &Node| match *node {
            Node::Parameter(index) => {
                let state = parameters.iter().find(|pair| pair.0 == index);
                state.map_or(*node, |pair| Node::State(pair.1))
            }
            other => other,
        };
        let nodes: Vec<Node> = self.nodes.iter().map(replaced).collect();
        let functions: Vec<usize> = self
            .surfaces
            .functions
            .iter()
            .map(|id| id.index())
            .collect();
        let switches = self.surfaces.switches.iter();
        let switches: Vec<_> = switches.map(|(id, side)| (id.index(), *side)).collect();
        let absolute = self.absolute_values().map(|id| id.index()).collect();
        Graph::made_of(&nodes, &functions, &switches, &absolute)
    }

    /// The graph of these nodes, with these nodes as surfaces, known switches and absolute values.
    fn made_of(
        nodes: &[Node],
        functions: &[usize],
        switches: &[KnownSwitch],
        absolute: &FxHashSet<usize>,
    ) -> (Graph, Vec<NodeId>) {
        let mut graph = Graph::new();
        let made = graph.build(nodes, absolute);
        let surfaces = functions.iter().map(|&function| made[function]);
        graph.surfaces_mut().functions = surfaces.collect();
        for &(id, side) in switches {
            graph.surfaces_mut().switches.insert(made[id], side);
        }
        for index in 0..graph.n_surfaces() as u32 {
            graph.register_surface(index);
        }
        (graph, made)
    }

    /// Makes nodes again, whose operands are numbers of nodes before them; their numbers here.
    fn build(&mut self, nodes: &[Node], absolute: &FxHashSet<usize>) -> Vec<NodeId> {
        let mut made: Vec<NodeId> = Vec::with_capacity(nodes.len());
        for (k, node) in nodes.iter().enumerate() {
            let known = self.len();
            let id = match *node {
                Node::Constant(value) => self.constant(value),
                Node::Unary(op, a) => self.unary(op, made[a.index()]),
                Node::Binary(op, a, b) => self.binary(op, made[a.index()], made[b.index()]),
                Node::Select {
                    surface,
                    plus,
                    minus,
                } => self.select(surface, 1.0, made[plus.index()], made[minus.index()]),
                Node::Time
                | Node::State(_)
                | Node::Parameter(_)
                | Node::Sign(_)
                | Node::Input(_) => self.insert(*node),
            };
            // What was simplified further is another node.
            if absolute.contains(&k)
                && id.index() >= known
                && is_product_with_sign(&self.nodes, self.node(id))
            {
                self.facts[id.index()].nonnegative = true;
            }
            made.push(id);
        }
        made
    }
}

/// Whether a node is a product with a sign in front, as absolute values are.
fn is_product_with_sign(nodes: &[Node], node: &Node) -> bool {
    match *node {
        Node::Binary(BinaryOp::Mul, left, _) => matches!(nodes[left.index()], Node::Sign(_)),
        _ => false,
    }
}

fn write_node(writer: &mut Writer, node: &Node) {
    let (tag, numbers): (u8, [Option<u32>; 3]) = match *node {
        Node::Constant(value) => {
            writer.byte(TAG_CONSTANT);
            writer.float(value);
            return;
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
    writer.byte(tag);
    for value in numbers.into_iter().flatten() {
        writer.number(value as usize);
    }
}

/// The nodes as they were written; no two are equal, and operands come first.
fn read_nodes(section: &mut Section) -> Result<Vec<Node>, ExprError> {
    let n_nodes = section.count(1)?;
    let mut nodes = Vec::with_capacity(n_nodes);
    let mut known = FxHashSet::default();
    for k in 0..n_nodes {
        let node = read_node(section, k)?;
        if !known.insert(node) {
            return section.damaged("a node occurs twice");
        }
        nodes.push(node);
    }
    Ok(nodes)
}

/// Node number `k`, whose operands are below `k`.
fn read_node(section: &mut Section, k: usize) -> Result<Node, ExprError> {
    const LATE: &str = "an operand that does not come before its use";
    let operand = |section: &mut Section| section.index(k, LATE).map(|id| NodeId(id as u32));
    let variable = |section: &mut Section| {
        let index = section.index(
            LARGEST_INDEX as usize + 1,
            "the index of a variable is too large",
        );
        index.map(|index| index as u32)
    };
    Ok(match section.byte()? {
        TAG_CONSTANT => {
            let value = section.float()?;
            Node::Constant(if value.is_nan() { f64::NAN } else { value })
        }
        TAG_TIME => Node::Time,
        TAG_STATE => Node::State(variable(section)?),
        TAG_PARAMETER => Node::Parameter(variable(section)?),
        TAG_SIGN => Node::Sign(variable(section)?),
        TAG_INPUT => Node::Input(variable(section)?),
        TAG_SELECT => Node::Select {
            surface: variable(section)?,
            plus: operand(section)?,
            minus: operand(section)?,
        },
        tag => {
            let unary = tag
                .checked_sub(TAG_UNARY)
                .and_then(|n| UnaryOp::ALL.get(usize::from(n)));
            let binary = tag
                .checked_sub(TAG_BINARY)
                .and_then(|n| BinaryOp::ALL.get(usize::from(n)));
            match (unary, binary) {
                (Some(&op), _) => Node::Unary(op, operand(section)?),
                (_, Some(&op)) => Node::Binary(op, operand(section)?, operand(section)?),
                _ => return section.damaged("an unknown operation"),
            }
        }
    })
}

/// The nodes of the switching functions. The sign of a surface comes after its function: no function contains its own sign,
/// directly or through others.
fn read_surfaces(section: &mut Section, nodes: &[Node]) -> Result<Vec<usize>, ExprError> {
    let n_surfaces = section.count(4)?;
    let mut functions = Vec::with_capacity(n_surfaces);
    for _ in 0..n_surfaces {
        functions.push(section.index(nodes.len(), "a surface whose function does not exist")?);
    }
    for (id, node) in nodes.iter().enumerate() {
        let function = node
            .surface()
            .map(|surface| functions.get(surface as usize));
        match function {
            Some(None) => return section.damaged("the sign of a surface that does not exist"),
            Some(Some(&function)) if function >= id => {
                return section.damaged("the sign of a surface before its function")
            }
            _ => {}
        }
    }
    Ok(functions)
}

/// A node whose sign is that of a surface, and the surface with its orientation.
type KnownSwitch = (usize, (u32, f64));

fn read_switches(
    section: &mut Section,
    n_nodes: usize,
    n_surfaces: usize,
) -> Result<Vec<KnownSwitch>, ExprError> {
    let mut switches: Vec<KnownSwitch> = Vec::new();
    for _ in 0..section.count(9)? {
        let id = section.index(n_nodes, "a switch that is not a node")?;
        if switches.last().is_some_and(|before| before.0 >= id) {
            return section.damaged("switches that are not in order");
        }
        let surface = section.index(n_surfaces, "a switch on a surface that does not exist")?;
        let orientation = match section.byte()? {
            0 => 1.0,
            1 => -1.0,
            _ => return section.damaged("an orientation other than +1 and -1"),
        };
        switches.push((id, (surface as u32, orientation)));
    }
    Ok(switches)
}

fn read_absolute_values(
    section: &mut Section,
    nodes: &[Node],
) -> Result<FxHashSet<usize>, ExprError> {
    let mut absolute = FxHashSet::default();
    let mut next = 0;
    for _ in 0..section.count(4)? {
        let id = section.index(nodes.len(), "an absolute value that is not a node")?;
        if id < next {
            return section.damaged("absolute values that are not in order");
        }
        if !is_product_with_sign(nodes, &nodes[id]) {
            return section.damaged("an absolute value that is no product with a sign");
        }
        next = id + 1;
        absolute.insert(id);
    }
    Ok(absolute)
}

#[cfg(test)]
mod tests;
