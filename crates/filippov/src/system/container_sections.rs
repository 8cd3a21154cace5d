//! Definitions of traced systems as sections of a container.
//!
//! Four sections: the graph (that of `filippov-expr`); the nodes of the field; the names of states and parameters;
//! the rules: surfaces that trigger actions, hidden ones, ratios of friction, laws.

use std::sync::Arc;

use filippov_expr::container::{Container, Section, Tag, Writer};
use filippov_expr::{ExprError, Graph, Names, NodeId};

use super::{Definition, Law, Rules, Step};
use crate::error::Error;

const FIELD: Tag = Tag(*b"FELD");
const NAMES: Tag = Tag(*b"NAME");
const RULES: Tag = Tag(*b"RULE");

const CLOCK: u8 = 0;
const LEVEL: u8 = 1;
const FLOOR: u8 = 2;
const HYSTERESIS: u8 = 3;
const SIGN: u8 = 4;
const PIECE: u8 = 5;
const ENTRY: u8 = 6;
const PLACE: u8 = 7;
const NAMED: u8 = 8;

impl Definition {
    /// Writes the definition as the next sections of a container.
    pub(crate) fn write_sections(&self, writer: &mut Writer) {
        self.graph.write_section(writer);
        writer.section(FIELD);
        write_nodes(writer, &self.field);
        writer.section(NAMES);
        for names in [&self.names.states, &self.names.parameters] {
            writer.number(names.len());
            names.iter().for_each(|name| writer.text(name));
        }
        writer.section(RULES);
        self.rules.write(writer);
    }

    /// The definition that was written so, checked.
    ///
    /// # Errors
    /// Those of the container and of [`Definition::check`].
    pub(crate) fn read_sections(container: &mut Container) -> Result<Self, Error> {
        let (graph, made) = Graph::read_section(container)?;
        let mut section = container.section(FIELD)?;
        let field = read_nodes(&mut section, &made)?;
        section.finish()?;
        let mut section = container.section(NAMES)?;
        let names = Names {
            states: read_names(&mut section)?,
            parameters: read_names(&mut section)?,
        };
        section.finish()?;
        let mut section = container.section(RULES)?;
        let rules = Rules::read(&mut section, &made)?;
        section.finish()?;
        let definition = Definition {
            graph,
            field,
            names,
            rules,
        };
        definition.check()?;
        Ok(definition)
    }
}

impl Rules {
    fn write(&self, writer: &mut Writer) {
        writer.number(self.n_hidden);
        writer.number(self.watched.len());
        for &surface in &self.watched {
            writer.number(surface);
        }
        writer.number(self.sticking.len());
        for &(surface, ratio) in &self.sticking {
            writer.number(surface);
            writer.number(ratio.index());
        }
        writer.number(self.laws.len());
        for law in &self.laws {
            write_law(writer, law);
        }
    }

    fn read(section: &mut Section, made: &[NodeId]) -> Result<Self, ExprError> {
        let n_hidden = section.number()? as usize;
        let mut watched = Vec::new();
        for _ in 0..section.count(4)? {
            watched.push(section.number()? as usize);
        }
        let mut sticking = Vec::new();
        for _ in 0..section.count(8)? {
            sticking.push((section.number()? as usize, node(section, made)?));
        }
        let mut laws = Vec::new();
        for _ in 0..section.count(5)? {
            laws.push(read_law(section, made)?);
        }
        Ok(Rules {
            watched,
            laws,
            n_hidden,
            sticking,
            beside: Vec::new(),
        })
    }
}

fn write_law(writer: &mut Writer, law: &Law) {
    let kind = match law {
        Law::Clock { .. } => CLOCK,
        Law::Level { .. } => LEVEL,
        Law::Held { step, .. } => match step {
            Step::Floor => FLOOR,
            Step::Sign => SIGN,
            Step::Place(_) => PLACE,
            Step::Entry { .. } => ENTRY,
        },
        Law::Piece { .. } => PIECE,
        Law::Hysteresis { .. } => HYSTERESIS,
        Law::Named { .. } => NAMED,
    };
    writer.byte(kind);
    for node in law.nodes() {
        writer.number(node.index());
    }
    match law {
        Law::Clock { .. } | Law::Named { .. } => {}
        Law::Level {
            surface,
            orientation,
            guard,
            ..
        } => {
            writer.number(*surface);
            writer.float(*orientation);
            writer.number(*guard);
        }
        Law::Piece { knots, guard, .. } => {
            // No surface is numbered 0 here.
            writer.number(guard.map_or(0, |guard| guard + 1));
            write_floats(writer, knots);
        }
        Law::Held { step, .. } => match step {
            Step::Floor | Step::Sign => {}
            Step::Place(knots) => write_floats(writer, knots),
            Step::Entry { first, list } => {
                writer.float(*first);
                write_floats(writer, list);
            }
        },
        Law::Hysteresis { initial, guard, .. } => {
            writer.float(*initial);
            writer.number(*guard);
        }
    }
}

fn read_law(section: &mut Section, made: &[NodeId]) -> Result<Law, ExprError> {
    Ok(match section.byte()? {
        CLOCK => Law::Clock {
            argument: node(section, made)?,
        },
        LEVEL => Law::Level {
            argument: node(section, made)?,
            surface: section.number()? as usize,
            orientation: section.float()?,
            guard: section.number()? as usize,
        },
        PIECE => Law::Piece {
            argument: node(section, made)?,
            guard: (section.number()? as usize).checked_sub(1),
            knots: read_floats(section)?,
        },
        HYSTERESIS => Law::Hysteresis {
            argument: node(section, made)?,
            thresholds: [node(section, made)?, node(section, made)?],
            initial: section.float()?,
            guard: section.number()? as usize,
        },
        NAMED => Law::Named {
            initial: node(section, made)?,
        },
        kind => Law::Held {
            argument: node(section, made)?,
            step: read_step(section, kind)?,
        },
    })
}

fn read_step(section: &mut Section, kind: u8) -> Result<Step, ExprError> {
    Ok(match kind {
        FLOOR => Step::Floor,
        SIGN => Step::Sign,
        PLACE => Step::Place(read_floats(section)?),
        ENTRY => Step::Entry {
            first: section.float()?,
            list: read_floats(section)?,
        },
        _ => return section.damaged("a law of an unknown kind"),
    })
}

fn write_floats(writer: &mut Writer, values: &[f64]) {
    writer.number(values.len());
    values.iter().for_each(|&value| writer.float(value));
}

fn read_floats(section: &mut Section) -> Result<Arc<[f64]>, ExprError> {
    (0..section.count(8)?).map(|_| section.float()).collect()
}

fn write_nodes(writer: &mut Writer, nodes: &[NodeId]) {
    writer.number(nodes.len());
    nodes.iter().for_each(|node| writer.number(node.index()));
}

fn read_nodes(section: &mut Section, made: &[NodeId]) -> Result<Vec<NodeId>, ExprError> {
    (0..section.count(4)?)
        .map(|_| node(section, made))
        .collect()
}

fn read_names(section: &mut Section) -> Result<Vec<String>, ExprError> {
    (0..section.count(4)?).map(|_| section.text()).collect()
}

/// A node: what the written one has become.
fn node(section: &mut Section, made: &[NodeId]) -> Result<NodeId, ExprError> {
    let index = section.index(made.len(), "a node that does not exist")?;
    Ok(made[index])
}
