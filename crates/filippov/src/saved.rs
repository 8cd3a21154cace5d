//! Traced systems as they are kept and sent: with the values of their parameters, and with their actions.
//!
//! The container has the sections of the definition; the values; the actions; then the sections of the definition of
//! each map, in the order of the actions.

use std::sync::Arc;

use filippov_expr::container::{Container, Section, Tag, Writer};
use filippov_expr::{Backend, ExprError};
use rustc_hash::FxHashSet;

use crate::error::{Error, FieldError};
use crate::event::UserEvent;
use crate::integrate::Problem;
use crate::options::Options;
use crate::record::Solution;
use crate::switch::Kind;
use crate::system::{
    check_index, inconsistent, Definition, LawAction, Laws, TracedMap, TracedSystem,
};
use crate::system::{Action, Actions, Clock, Trigger};

const CONTENT: Tag = Tag(*b"SYST");
const VALUES: Tag = Tag(*b"VALU");
const ACTIONS: Tag = Tag(*b"ACTN");

const AT_SURFACE: u8 = 0;
const AT_TIMES: u8 = 1;
const AT_TICKS: u8 = 2;
const AT_JUMPS: u8 = 3;

/// Everything that a traced system is.
///
/// # Example
///
/// A ball that loses a part of its speed at every impact, through bytes.
///
/// ```
/// use filippov::action::Trigger;
/// use filippov::{Definition, Options, Rules, SavedAction, SavedSystem};
/// use filippov_expr::{Backend, Graph, Names};
///
/// let names = Names { states: vec!["y".into(), "v".into()], parameters: vec!["e".into()] };
/// let mut graph = Graph::new();
/// let (y, v, gravity) = (graph.state(0), graph.state(1), graph.constant(-9.81));
/// let surface = graph.declare_surface(y) as usize;
/// let rules = Rules { watched: vec![surface], ..Rules::default() };
/// let fall = Definition { graph, field: vec![v, gravity], names: names.clone(), rules };
///
/// let mut graph = Graph::new();
/// let (y, v, e) = (graph.state(0), graph.state(1), graph.parameter(0));
/// let speed = graph.mul(e, v);
/// let field = vec![y, graph.neg(speed)];
/// let bounce = Definition { graph, field, names, rules: Rules::default() };
///
/// let ball = SavedSystem {
///     definition: fall,
///     defaults: vec![0.5],
///     valid_for: None,
///     actions: vec![SavedAction {
///         trigger: Trigger::Surface { index: surface, direction: -1, side: 1 },
///         map: Some(bounce),
///         name: "impact".into(),
///     }],
/// };
/// let copy = SavedSystem::from_bytes(&ball.to_bytes())?;
/// let ball = copy.build(Backend::Auto)?;
/// let solution = ball.solve((0.0, 5.0), &[1.0, 0.0], &[0.5], &Options::default(), &[])?;
/// let rest = solution.switches.last().expect("the impacts accumulate");
/// assert!((rest.t - 3.0 * (2.0_f64 / 9.81).sqrt()).abs() < 1e-6);
/// # Ok::<(), filippov::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct SavedSystem {
    /// Expressions, names, laws.
    pub definition: Definition,
    /// Values of the parameters where no others are given.
    pub defaults: Vec<f64>,
    /// The values for which alone the expressions hold; none if they hold for all.
    pub valid_for: Option<Vec<f64>>,
    /// What changes the state in instants, in the order in which it is done.
    pub actions: Vec<SavedAction>,
}

/// An action of a saved system.
#[derive(Clone, Debug)]
pub struct SavedAction {
    /// When.
    pub trigger: Trigger,
    /// The map, as the field of a definition with the same parameters; none for a function of the caller.
    pub map: Option<Definition>,
    /// The name in tables and messages.
    pub name: String,
}

impl SavedSystem {
    /// The system as a container. Equal systems give equal bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        self.written().finish()
    }

    /// As [`SavedSystem::to_bytes`], with one more section that holds a text.
    pub fn to_bytes_with(&self, tag: Tag, text: &str) -> Vec<u8> {
        let mut writer = self.written();
        writer.section(tag);
        writer.text(text);
        writer.finish()
    }

    fn written(&self) -> Writer {
        let mut writer = Writer::new(CONTENT);
        self.definition.write_sections(&mut writer);
        writer.section(VALUES);
        writer.floats(&self.defaults);
        writer.byte(u8::from(self.valid_for.is_some()));
        writer.floats(self.valid_for.as_deref().unwrap_or_default());
        writer.section(ACTIONS);
        writer.number(self.actions.len());
        for action in &self.actions {
            write_trigger(&mut writer, &action.trigger);
            writer.byte(u8::from(action.map.is_some()));
            writer.text(&action.name);
        }
        for map in self.actions.iter().filter_map(|action| action.map.as_ref()) {
            map.write_sections(&mut writer);
        }
        writer
    }

    /// The system that [`SavedSystem::to_bytes`] wrote: nothing is compiled yet, everything is checked.
    ///
    /// # Errors
    /// [`Error::Expression`] for other bytes and damaged ones, and those of [`SavedSystem::check`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let mut container = Container::open(bytes, CONTENT)?;
        let system = Self::read(&mut container)?;
        container.finish()?;
        Ok(system)
    }

    /// What [`SavedSystem::to_bytes_with`] wrote, and the text of its further section; no text if there is no such section.
    ///
    /// # Errors
    /// As [`SavedSystem::from_bytes`].
    pub fn from_bytes_with(bytes: &[u8], tag: Tag) -> Result<(Self, Option<String>), Error> {
        let mut container = Container::open(bytes, CONTENT)?;
        let system = Self::read(&mut container)?;
        let mut text = None;
        if let Some(mut section) = container.optional(tag) {
            text = Some(section.text()?);
            section.finish()?;
        }
        container.finish()?;
        Ok((system, text))
    }

    fn read(container: &mut Container) -> Result<Self, Error> {
        let definition = Definition::read_sections(container)?;
        let mut section = container.section(VALUES)?;
        let defaults = section.floats()?;
        let is_pinned = flag(&mut section)?;
        let valid_for = section.floats()?;
        if !is_pinned && !valid_for.is_empty() {
            section.damaged("values for a system that holds for all")?;
        }
        section.finish()?;
        let mut section = container.section(ACTIONS)?;
        let mut rows = Vec::new();
        for _ in 0..section.count(10)? {
            let trigger = read_trigger(&mut section)?;
            let has_map = flag(&mut section)?;
            rows.push((trigger, has_map, section.text()?));
        }
        section.finish()?;
        let mut actions = Vec::with_capacity(rows.len());
        for (trigger, has_map, name) in rows {
            let map = match has_map {
                true => Some(Definition::read_sections(container)?),
                false => None,
            };
            actions.push(SavedAction { trigger, map, name });
        }
        let system = SavedSystem {
            definition,
            defaults,
            valid_for: is_pinned.then_some(valid_for),
            actions,
        };
        system.check()?;
        Ok(system)
    }

    /// Checks the values, and that actions and their maps fit the system.
    ///
    /// # Errors
    /// Those of [`Definition::check`], [`Error::Inconsistent`], [`Error::NoSuchIndex`] for a surface that does not
    /// exist, [`Error::OutOfRange`] for values, periods, times and directions.
    pub fn check(&self) -> Result<(), Error> {
        let definition = &self.definition;
        definition.check()?;
        check_distinct(&definition.names.states)?;
        let n_parameters = definition.n_parameters();
        check_distinct(&definition.names.parameters[..n_parameters])?;
        for values in std::iter::once(&self.defaults).chain(&self.valid_for) {
            if values.len() != n_parameters {
                return inconsistent("the number of values is not that of the parameters");
            }
            values
                .iter()
                .try_for_each(|&value| check_finite("params", value))?;
        }
        for action in &self.actions {
            self.check_trigger(&action.trigger)?;
            let Some(map) = &action.map else { continue };
            map.check()?;
            if map.field.len() != definition.field.len() + definition.n_named() {
                return inconsistent("a map of another number of states");
            }
            let own = &map.names.parameters[..map.n_parameters()];
            if *own != definition.names.parameters[..n_parameters] {
                return inconsistent("a map of other parameters");
            }
        }
        Ok(())
    }

    /// Compiles everything.
    ///
    /// # Errors
    /// Those of [`SavedSystem::check`], [`Error::MissingMap`] for an action whose map is a function of the caller, or
    /// if an expression cannot be compiled.
    pub fn build(self, backend: Backend) -> Result<RunnableSystem, Error> {
        self.check()?;
        let mut maps = Vec::with_capacity(self.actions.len());
        for SavedAction { trigger, map, name } in self.actions {
            let Some(map) = map else {
                return Err(Error::MissingMap { name });
            };
            maps.push((trigger, map.build(backend)?.0, name));
        }
        let n_parameters = self.definition.n_parameters();
        let law_names = self.definition.names.parameters[n_parameters..].to_vec();
        let n_visible = self.definition.n_visible();
        let (system, laws) = self.definition.build(backend)?;
        Ok(RunnableSystem {
            system: system.with_parameters(self.defaults),
            laws: Arc::new(laws),
            law_names,
            maps,
            n_visible,
        })
    }

    fn check_trigger(&self, trigger: &Trigger) -> Result<(), Error> {
        match trigger {
            Trigger::Surface {
                index,
                direction,
                side,
            } => {
                check_index("surface", *index, self.definition.graph.n_surfaces())?;
                if side.abs() != 1 {
                    return Err(Error::OutOfRange {
                        name: "side",
                        value: f64::from(*side),
                        requirement: "must be -1 or +1",
                    });
                }
                if !(-1..=1).contains(direction) {
                    return Err(Error::OutOfRange {
                        name: "direction",
                        value: f64::from(*direction),
                        requirement: "must be -1, 0 or +1",
                    });
                }
                if !self.definition.rules.watched.contains(index) {
                    return inconsistent("an action at a surface that is not watched");
                }
                Ok(())
            }
            Trigger::Times(times) => {
                times
                    .iter()
                    .try_for_each(|&time| check_finite("times", time))?;
                match times.windows(2).find(|pair| pair[0] >= pair[1]) {
                    None => Ok(()),
                    Some(pair) => Err(Error::OutOfRange {
                        name: "times",
                        value: pair[1],
                        requirement: "must be above the time before",
                    }),
                }
            }
            Trigger::Clock { clock, .. } => clock.check("period", "phase"),
            Trigger::Jump => Ok(()),
        }
    }
}

/// A saved system that was compiled.
pub struct RunnableSystem {
    system: TracedSystem,
    laws: Arc<Laws>,
    law_names: Vec<String>,
    maps: Vec<(Trigger, TracedSystem, String)>,
    n_visible: usize,
}

impl RunnableSystem {
    /// The system with the default values of its parameters.
    pub fn system(&self) -> &TracedSystem {
        &self.system
    }

    /// How many of its surfaces a user sees, the first ones ([`Definition::n_visible`]).
    pub fn n_visible(&self) -> usize {
        self.n_visible
    }

    /// The system with these values of its parameters, its maps, its laws, and its discrete states at a start at (t, x).
    ///
    /// # Errors
    /// [`Error::WrongLength`] if there are not as many values as parameters, or states.
    pub fn at(&self, parameters: &[f64], t: f64, x: &[f64]) -> Result<ReadySystem<'_>, Error> {
        let wrong = |name, found, expected| Error::WrongLength {
            name,
            found,
            expected,
        };
        let (n_states, n_parameters) = (
            self.system.field_nodes().len(),
            self.system.parameters().len(),
        );
        if x.len() != n_states {
            return Err(wrong("y0", x.len(), n_states));
        }
        if parameters.len() != n_parameters {
            return Err(Error::WrongCount {
                name: "parameters",
                found: parameters.len(),
                expected: n_parameters,
            });
        }
        let system = self.system.with_parameters(parameters.to_vec());
        let discrete =
            self.laws
                .start(&system, t, x)
                .map_err(|FieldError(_)| Error::Inconsistent {
                    detail: "an expression could not be evaluated",
                })?;
        let maps = self.maps.iter();
        let maps = maps.map(|(_, map, _)| TracedMap::new(map.with_parameters(parameters.to_vec())));
        Ok(ReadySystem {
            of: self,
            maps: maps.collect(),
            laws: self.laws.actions(n_states, parameters),
            system,
            discrete,
        })
    }

    /// Solves an initial value problem, with the actions and the laws.
    ///
    /// # Errors
    /// As [`Problem::solve`], and those of [`RunnableSystem::at`].
    pub fn solve(
        &self,
        t_span: (f64, f64),
        y0: &[f64],
        parameters: &[f64],
        options: &Options,
        events: &[UserEvent],
    ) -> Result<Solution, Error> {
        let ready = self.at(parameters, t_span.0, y0)?;
        let (system, actions) = (ready.system(), ready.actions());
        let problem = Problem::new(system, t_span, y0).options(options);
        problem.events(events).actions(&actions).solve()
    }
}

/// A compiled system with values of its parameters, and with its discrete states at a start.
pub struct ReadySystem<'a> {
    of: &'a RunnableSystem,
    system: TracedSystem,
    discrete: Vec<f64>,
    maps: Vec<TracedMap>,
    laws: Vec<LawAction>,
}

impl ReadySystem<'_> {
    /// The system.
    pub fn system(&self) -> &TracedSystem {
        &self.system
    }

    /// The discrete states at the start.
    pub fn discrete(&self) -> &[f64] {
        &self.discrete
    }

    /// What changes the state in instants: the actions, then the laws.
    pub fn actions(&self) -> Actions<'_> {
        let given = self.of.maps.iter().zip(&self.maps);
        let given = given.map(|((trigger, _, name), map)| Action {
            trigger: trigger.clone(),
            map,
            name: name.clone(),
            kind: Some(match trigger {
                Trigger::Surface { .. } | Trigger::Jump => Kind::Reset,
                Trigger::Times(_) | Trigger::Clock { .. } => Kind::Clock,
            }),
        });
        let laws = self.laws.iter().map(|law| Action {
            trigger: law.trigger.clone(),
            map: &law.map,
            name: self.of.law_names[law.index].clone(),
            kind: law.kind,
        });
        Actions {
            list: given.chain(laws).collect(),
            discrete: self.discrete.clone(),
        }
    }
}

fn write_trigger(writer: &mut Writer, trigger: &Trigger) {
    match trigger {
        Trigger::Surface {
            index,
            direction,
            side,
        } => {
            writer.byte(AT_SURFACE);
            writer.number(*index);
            writer.byte(*direction as u8);
            writer.byte(*side as u8);
        }
        Trigger::Times(times) => {
            writer.byte(AT_TIMES);
            writer.floats(times);
        }
        Trigger::Clock { clock, at_start } => {
            writer.byte(AT_TICKS);
            writer.float(clock.period);
            writer.float(clock.phase);
            writer.byte(u8::from(*at_start));
        }
        Trigger::Jump => writer.byte(AT_JUMPS),
    }
}

fn read_trigger(section: &mut Section) -> Result<Trigger, ExprError> {
    Ok(match section.byte()? {
        AT_SURFACE => Trigger::Surface {
            index: section.number()? as usize,
            direction: section.byte()? as i8,
            side: section.byte()? as i8,
        },
        AT_TIMES => Trigger::Times(section.floats()?),
        AT_TICKS => Trigger::Clock {
            clock: Clock {
                period: section.float()?,
                phase: section.float()?,
            },
            at_start: flag(section)?,
        },
        AT_JUMPS => Trigger::Jump,
        _ => return section.damaged("a trigger of an unknown kind"),
    })
}

fn flag(section: &mut Section) -> Result<bool, ExprError> {
    match section.byte()? {
        0 => Ok(false),
        1 => Ok(true),
        _ => section.damaged("neither yes (1) nor no (0)"),
    }
}

fn check_finite(name: &'static str, value: f64) -> Result<(), Error> {
    if value.is_finite() {
        return Ok(());
    }
    Err(Error::OutOfRange {
        name,
        value,
        requirement: "must be finite",
    })
}

fn check_distinct(names: &[String]) -> Result<(), Error> {
    let mut seen = FxHashSet::default();
    match names.iter().all(|name| seen.insert(name)) {
        true => Ok(()),
        false => inconsistent("two states or two parameters of one name"),
    }
}
