//! What a traced system is made of, apart from values of its parameters: checked as a whole, before anything is
//! compiled.

use filippov_expr::container::{Container, Tag, Writer};
use filippov_expr::regularized::Ramp;
use filippov_expr::{Backend, Graph, Lengths, Names, Node, NodeId};

use super::compiled::Follower;
use super::laws::{n_named, Reader};
use super::readers::readers;
use super::{Law, Laws, PiecewiseSystem, Step, TracedSystem};
use crate::error::Error;

/// The content of a container that holds one definition.
const CONTENT: Tag = Tag(*b"EXPR");

/// The expressions of a traced system, and what it has beside them.
///
/// # Example
///
/// ```
/// use filippov::Definition;
/// use filippov_expr::{Backend, Graph, Names};
///
/// let mut graph = Graph::new();
/// let v = graph.state(0);
/// let sign = graph.sign(v);
/// let field = vec![graph.neg(sign)];
/// let names = Names { states: vec!["v".into()], parameters: Vec::new() };
/// let friction = Definition { graph, field, names, rules: Default::default() };
/// let copy = Definition::from_bytes(&friction.to_bytes())?;
/// let (system, _laws) = copy.build(Backend::Auto)?;
/// assert_eq!(filippov::PiecewiseSystem::surface_name(&system, 0), "v");
/// # Ok::<(), filippov::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Definition {
    /// The expressions; its surfaces are those of the system.
    pub graph: Graph,
    /// The nodes of the field, one per state.
    pub field: Vec<NodeId>,
    /// Names of all states, or of none; names of all parameters, those of the discrete states behind them.
    pub names: Names,
    /// What the system has beside its field.
    pub rules: Rules,
}

/// What a traced system has beside its field and its surfaces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rules {
    /// Surfaces that trigger actions: monitored in every mode.
    pub watched: Vec<usize>,
    /// The laws of the discrete states, in their order.
    pub laws: Vec<Law>,
    /// The last so many surfaces are those of laws: monitored in every mode too, and not shown.
    pub n_hidden: usize,
    /// Surfaces with static friction above kinetic, and the ratios of the two.
    pub sticking: Vec<(usize, NodeId)>,
    /// The laws that functions beside the field read, as events do; a run follows them as those of the field. They belong to
    /// runs, and are not saved.
    pub beside: Vec<usize>,
}

impl Definition {
    /// The definition of a system that was built with these rules.
    pub fn of(system: &TracedSystem, rules: &Rules) -> Self {
        Definition {
            graph: system.graph().clone(),
            field: system.field_nodes().to_vec(),
            names: system.names().clone(),
            rules: rules.clone(),
        }
    }

    /// How many parameters there are, without the discrete states.
    pub fn n_parameters(&self) -> usize {
        let n_laws = self.rules.laws.len();
        self.names.parameters.len().saturating_sub(n_laws)
    }

    /// The system in which a function of `kappa[j] * h_j / eps` replaces every sign. The width `eps` becomes its last parameter.
    /// It has no laws and no watched surfaces: the caller refuses systems that have any. `None` if a function contains too many
    /// signs to be written out.
    pub fn regularized(&self, eps: &str, kappa: &[f64], ramp: Ramp) -> Option<Self> {
        let mut names = self.names.clone();
        let index = names.parameters.len() as u32;
        names.parameters.push(eps.to_owned());
        let (graph, field) = self.graph.regularized(&self.field, index, kappa, ramp)?;
        Some(Definition {
            graph,
            field,
            names,
            rules: Rules::default(),
        })
    }

    /// How many surfaces a user sees. Those of laws come after them, and before these those that no motion crosses.
    pub fn n_visible(&self) -> usize {
        let n_moving = self.graph.n_surfaces() - self.rules.n_hidden;
        let is_seen = |&j: &usize| {
            let function = self.graph.surface(j as u32);
            self.graph.depends_on_motion(function) || self.rules.watched.contains(&j)
        };
        (0..n_moving).rev().find(is_seen).map_or(0, |last| last + 1)
    }

    /// How many discrete states are named; the map of an action changes them with the states.
    pub fn n_named(&self) -> usize {
        n_named(&self.rules.laws)
    }

    /// The definition as a container. Equal definitions give equal bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut writer = Writer::new(CONTENT);
        self.write_sections(&mut writer);
        writer.finish()
    }

    /// The definition that [`Definition::to_bytes`] wrote.
    ///
    /// # Errors
    /// [`Error::Expression`] for other bytes and damaged ones, and those of [`Definition::check`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let mut container = Container::open(bytes, CONTENT)?;
        let definition = Definition::read_sections(&mut container)?;
        container.finish()?;
        Ok(definition)
    }

    /// Checks that everything that is referred to is there.
    ///
    /// # Errors
    /// [`Error::NoSuchIndex`] for a node, variable, surface or discrete state that does not exist,
    /// [`Error::Inconsistent`] for other contradictions, [`Error::OutOfRange`] for numbers that a law cannot have.
    pub fn check(&self) -> Result<(), Error> {
        let n_states = self.field.len();
        if n_states == 0 {
            return inconsistent("a system needs a state");
        }
        if !self.names.states.is_empty() && self.names.states.len() != n_states {
            return inconsistent("the number of names is not that of the states");
        }
        let rules = &self.rules;
        let n_surfaces = self.graph.n_surfaces();
        if rules.laws.len() > self.names.parameters.len() || rules.n_hidden > n_surfaces {
            return inconsistent("more laws than there are names or surfaces");
        }
        let Lengths {
            states,
            signs,
            parameters,
            inputs,
        } = self.graph.lengths()?;
        check_length("state", states, n_states)?;
        check_length("surface", signs, n_surfaces)?;
        check_length("parameter", parameters, self.names.parameters.len())?;
        check_length("input of the field", inputs, 0)?;
        self.check_nodes(&self.field)?;
        for &surface in &rules.watched {
            check_index("surface", surface, n_surfaces)?;
        }
        let mut sticks = vec![false; n_surfaces];
        for &(surface, ratio) in &rules.sticking {
            check_index("surface", surface, n_surfaces)?;
            self.check_nodes(&[ratio])?;
            if std::mem::replace(&mut sticks[surface], true) {
                return inconsistent("two ratios of static to kinetic friction on one surface");
            }
        }
        for &law in &rules.beside {
            check_index("law", law, rules.laws.len())?;
        }
        (0..rules.laws.len()).try_for_each(|index| self.check_law(index))
    }

    /// Compiles the system, whose parameters are zero, and its laws.
    ///
    /// # Errors
    /// Those of [`Definition::check`], or if an expression cannot be compiled.
    pub fn build(self, backend: Backend) -> Result<(TracedSystem, Laws), Error> {
        self.check()?;
        let zeros = vec![0.0; self.n_parameters()];
        let readers = self.readers();
        let Rules {
            mut watched,
            laws,
            n_hidden,
            sticking,
            beside: _,
        } = self.rules;
        let n_laws = laws.len();
        let followers = followers(&self.graph, &laws, zeros.len());
        let idle = laws.iter().zip(&readers).filter_map(|(law, reader)| {
            let guard = law.guard();
            guard.filter(|_| *reader == Reader::Nobody)
        });
        let idle: Vec<usize> = idle.collect();
        let laws = Laws::new(&self.graph, laws, readers)?;
        let system = TracedSystem::new(self.graph, self.field, zeros, self.names, backend)?;
        let n_surfaces = system.n_surfaces();
        let hidden = n_surfaces - n_hidden..n_surfaces;
        watched.extend(hidden.filter(|surface| !idle.contains(surface)));
        let system = system
            .watching_with_followers(&watched, followers)
            .sticking(&sticking);
        Ok((system.with_discrete(n_laws), laws))
    }

    /// Who reads the discrete state of each law.
    fn readers(&self) -> Vec<Reader> {
        let rules = &self.rules;
        let n_moving = self.graph.n_surfaces() - rules.n_hidden;
        let surfaces = (0..n_moving).map(|j| self.graph.surface(j as u32));
        let ratios = rules.sticking.iter().map(|&(_, ratio)| ratio);
        let field = self.field.iter().copied();
        readers(
            &self.graph,
            field.chain(surfaces).chain(ratios).collect(),
            &rules.laws,
            &rules.beside,
            self.n_parameters(),
        )
    }

    fn check_nodes(&self, nodes: &[NodeId]) -> Result<(), Error> {
        let count = self.graph.len();
        let check = |node: &NodeId| check_index("node", node.index(), count);
        nodes.iter().try_for_each(check)
    }

    /// A law reads the discrete states of those before it only, and is of the kind that it says.
    fn check_law(&self, index: usize) -> Result<(), Error> {
        let graph = &self.graph;
        let law = &self.rules.laws[index];
        self.check_nodes(&law.nodes())?;
        let own = (self.n_parameters() + index) as u32;
        let reads_later = |&node: &NodeId| graph.depends_on_parameters_from(node, own);
        if law.nodes().iter().any(reads_later) {
            return inconsistent("a law that reads its own discrete state, or that of a later one");
        }
        match *law {
            Law::Clock { argument }
            | Law::Piece {
                argument,
                guard: None,
                ..
            } => {
                let reads = graph.depends_on_parameters_from(argument, self.n_parameters() as u32);
                if reads || graph.depends_on_state(argument) || !graph.is_affine(argument) {
                    return inconsistent("a clock whose argument is not affine in t alone");
                }
            }
            Law::Named { initial } => {
                let is_number =
                    matches!(graph.node(initial), Node::Parameter(_) | Node::Constant(_));
                if !is_number || index >= self.n_named() {
                    return inconsistent(
                        "a named discrete state that does not begin as a parameter, or behind a law",
                    );
                }
            }
            Law::Held { argument, .. } => {
                let terms = graph.rate_terms(argument);
                if !terms.is_some_and(|terms| graph.is_constant_of_motion(&terms, &self.field)) {
                    return inconsistent("a held number whose argument changes along a motion");
                }
            }
            Law::Piece {
                guard: Some(guard), ..
            } => {
                check_index("surface", guard, graph.n_surfaces())?;
            }
            Law::Level {
                surface,
                orientation,
                guard,
                ..
            } => {
                check_index("surface", surface, graph.n_surfaces())?;
                check_index("surface", guard, graph.n_surfaces())?;
                check_sign("orientation", orientation)?;
            }
            Law::Hysteresis { initial, guard, .. } => {
                check_index("surface", guard, graph.n_surfaces())?;
                check_sign("initial", initial)?;
            }
        }
        if let Law::Piece { knots, .. }
        | Law::Held {
            step: Step::Place(knots),
            ..
        } = law
        {
            let is_finite = knots.iter().all(|knot| knot.is_finite());
            if !is_finite || knots.windows(2).any(|pair| pair[0] >= pair[1]) {
                return inconsistent("a table whose knots do not increase");
            }
        }
        Ok(())
    }
}

/// The error that parts of a system contradict each other.
pub(crate) fn inconsistent<T>(detail: &'static str) -> Result<T, Error> {
    Err(Error::Inconsistent { detail })
}

/// Refuses an index beyond a count.
pub(crate) fn check_index(what: &'static str, index: usize, count: usize) -> Result<(), Error> {
    if index < count {
        Ok(())
    } else {
        Err(Error::NoSuchIndex { what, index, count })
    }
}

/// Refuses expressions that read more variables than there are.
fn check_length(what: &'static str, needed: usize, count: usize) -> Result<(), Error> {
    needed
        .checked_sub(1)
        .map_or(Ok(()), |last| check_index(what, last, count))
}

fn check_sign(name: &'static str, value: f64) -> Result<(), Error> {
    if value.abs() == 1.0 {
        return Ok(());
    }
    Err(Error::OutOfRange {
        name,
        value,
        requirement: "must be +1 or -1",
    })
}

/// The laws that are followed only where something reads them: those of quantities that may end or jump, and what is made of
/// them. None if there are none of the first kind.
fn followers(graph: &Graph, laws: &[Law], n_parameters: usize) -> Vec<Follower> {
    let follower = |(index, law): (usize, &Law)| {
        let guard = law.guard().filter(|_| !law.has_memory());
        let argument = law.nodes()[0];
        let is_one =
            matches!(law, Law::Held { .. }) || guard.is_some() && graph.has_kinks(argument);
        is_one.then_some(Follower {
            parameter: (n_parameters + index) as u32,
            guard,
            argument,
        })
    };
    let found: Vec<Follower> = laws.iter().enumerate().filter_map(follower).collect();
    match found.iter().any(|follower| follower.guard.is_some()) {
        true => found,
        false => Vec::new(),
    }
}

#[cfg(test)]
mod tests;
