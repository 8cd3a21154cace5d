//! A traced system in which named discrete states and parameters are states that rest.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use filippov_expr::{Backend, ExprError, Graph, Names, NodeId, Program};
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use super::change::Row;
use super::forms::{Form, MapAt};
use super::series::{ChangeSeries, Changes};
use crate::error::{Error, FieldError};
use crate::record::Gradient;
use crate::system::{
    sides_of, Act, Action, ActionMap, Actions, Definition, Law, Laws, PiecewiseSystem, Place,
    Rules, TracedMap, TracedSystem, Trigger,
};
use crate::tolerances::{AT_SIDE, ROUNDING};

/// By what is differentiated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// A component of the initial state, or behind these a named discrete state at the start.
    State(usize),
    /// The initial time.
    Start,
    /// A parameter, by its place among those that the extended system has as states.
    Parameter(usize),
}

/// A system with its named discrete states and some of its parameters as further states behind those that it has, for all values
/// of them.
pub struct Extension {
    system: TracedSystem,
    rules: Rules,
    /// The system itself, and its laws.
    own: TracedSystem,
    laws: Arc<Laws>,
    /// How many states and named discrete states the system has itself.
    n: usize,
    n_named: usize,
    parameters: Vec<usize>,
    /// What each node of the system has become.
    made: Vec<NodeId>,
    series: Arc<SeriesCache>,
    /// Second derivatives of switching functions, and of what clocks read.
    forms: Arc<Mutex<FxHashMap<NodeId, Arc<Form>>>>,
}

/// The series of changes, by the surfaces slid on and the order.
type SeriesCache = Mutex<FxHashMap<(Surfaces, usize, Changes), Option<Arc<ChangeSeries>>>>;
type Surfaces = SmallVec<[usize; 2]>;

impl Extension {
    /// The extension of a system by these parameters.
    ///
    /// # Errors
    /// If an expression cannot be compiled.
    pub fn new(own: &TracedSystem, rules: &Rules, parameters: &[usize]) -> Result<Self, Error> {
        let definition = Definition::of(own, rules);
        let (system, made) = definition.extended(parameters, Backend::Native)?;
        let n_named = named_of(rules);
        Ok(Extension {
            n: system.n_states() - parameters.len(),
            n_named,
            laws: Arc::new(Laws::all_read(own.graph(), rules.laws.clone())?),
            own: own.clone(),
            system,
            rules: rules.clone(),
            parameters: parameters.to_vec(),
            made,
            series: Arc::default(),
            forms: Arc::default(),
        })
    }

    /// What the system has beside its field.
    pub fn rules(&self) -> &Rules {
        &self.rules
    }

    /// With the values of all parameters of the system, and the actions of a run; `None` if the map of one is not traced.
    ///
    /// # Errors
    /// If an expression cannot be compiled.
    pub fn at<'a>(
        &self,
        values: &[f64],
        actions: &'a Actions,
    ) -> Result<Option<Extended<'a>>, Error> {
        let mut maps = Vec::with_capacity(actions.list.len());
        let mut clocks = Vec::with_capacity(actions.list.len());
        for action in &actions.list {
            let is_timed = !matches!(action.trigger, Trigger::Surface { .. } | Trigger::Jump);
            let law = action.map.law().filter(|_| is_timed);
            clocks.push(match law {
                Some(law) => self.clock_of(law)?,
                None => None,
            });
            if !action.map.moves_state() {
                maps.push(None);
                continue;
            }
            let Some(traced) = action.map.expressions() else {
                return Ok(None);
            };
            maps.push(Some(ExtendedMap::new(traced, &self.parameters, self.n)?));
        }
        let triggers = actions.list.iter().map(|action| action.trigger.clone());
        Ok(Some(Extended {
            values: self.parameters.iter().map(|&i| values[i]).collect(),
            places: self.parameters.clone(),
            system: self.system.with_parameters(values.to_vec()),
            laws: Arc::clone(&self.laws),
            own: self.own.with_parameters(values.to_vec()),
            n: self.n,
            n_named: self.n_named,
            maps,
            triggers: triggers.collect(),
            recorded: actions.list.iter().map(|a| a.kind.is_some()).collect(),
            clocks,
            series: Arc::clone(&self.series),
            forms: Arc::clone(&self.forms),
        }))
    }

    /// What a law reads.
    fn clock_of(&self, law: usize) -> Result<Option<ClockArgument>, Error> {
        let Some(&argument) = self.rules.laws[law].nodes().first() else {
            return Ok(None);
        };
        let mut graph = self.system.graph().clone();
        let node = self.made[argument.index()];
        let gradient = graph.gradient(node);
        let zero = graph.constant(0.0);
        let by_state = |state: u32| {
            let found = gradient.states.iter().find(|entry| entry.0 == state);
            found.map_or(zero, |entry| entry.1)
        };
        let mut outputs = vec![gradient.time];
        let resting = self.n - self.n_named..self.n + self.parameters.len();
        outputs.extend(resting.map(|state| by_state(state as u32)));
        let slopes = Program::compile(&graph, &outputs, Backend::Interpreter)?;
        let value = Program::compile(&graph, &[node], Backend::Interpreter)?;
        Ok(Some(ClockArgument {
            node,
            slopes,
            value,
        }))
    }
}

/// What a law reads whose times are known: its node, its derivatives by the time, then by the states that rest, and its value.
struct ClockArgument {
    node: NodeId,
    slopes: Program,
    value: Program,
}

/// An extended system with the values of a run, and the maps of its actions.
pub struct Extended<'a> {
    pub(super) system: TracedSystem,
    /// The system itself, and its laws.
    own: TracedSystem,
    laws: Arc<Laws>,
    /// How many states the system has itself, the named discrete states behind them.
    pub(super) n: usize,
    /// How many of these are named discrete states.
    pub(super) n_named: usize,
    /// The values of the parameters that have become states, and their places among all.
    pub(super) values: Vec<f64>,
    places: Vec<usize>,
    /// The map of each action; none where it leaves the states as they are.
    pub(super) maps: Vec<Option<ExtendedMap<'a>>>,
    triggers: Vec<Trigger>,
    /// Is each action recorded as a switch?
    recorded: Vec<bool>,
    /// What the law reads whose times an action has, if it has those of one.
    clocks: Vec<Option<ClockArgument>>,
    series: Arc<SeriesCache>,
    forms: Arc<Mutex<FxHashMap<NodeId, Arc<Form>>>>,
}

impl Extended<'_> {
    /// The action that a surface triggers and that moves the state, if there is one.
    pub(super) fn triggered_by(&self, surface: usize) -> Option<usize> {
        let is_own =
            |&action: &usize| self.surface_of(action) == Some(surface) && self.moves(action);
        (0..self.triggers.len()).find(is_own)
    }

    /// The surface that triggers an action, if one does.
    pub(super) fn surface_of(&self, action: usize) -> Option<usize> {
        match self.triggers.get(action) {
            Some(Trigger::Surface { index, .. }) => Some(*index),
            _ => None,
        }
    }

    /// Is an action done at a known time, that of a clock or a list?
    pub(super) fn is_timed(&self, action: usize) -> bool {
        matches!(
            self.triggers.get(action),
            Some(Trigger::Times(_) | Trigger::Clock { .. })
        )
    }

    /// The derivative of the time of an action at a known time, a row; none for other actions.
    pub(super) fn time_of_tick(&self, action: usize, place: &Place) -> Option<Row> {
        self.is_timed(action)
            .then(|| match self.clock(action, place) {
                Some((time, state)) => state.iter().map(|g| -g / time).collect(),
                None => Row::from_elem(0.0, self.n + self.values.len()),
            })
    }

    /// The derivatives of the times of the ticks of laws at a time.
    pub(super) fn ticks_at(&self, place: &Place) -> Vec<Row> {
        let is_there = |trigger: &Trigger| match trigger {
            Trigger::Clock { clock, at_start } => !at_start && clock.tick_at(place.t).is_some(),
            Trigger::Times(times) => times
                .iter()
                .any(|t| (t - place.t).abs() <= ROUNDING * (1.0 + t.abs())),
            _ => false,
        };
        let there = self.triggers.iter().enumerate();
        let there = there.filter(|(_, trigger)| is_there(trigger));
        there
            .filter_map(|(action, _)| self.time_of_tick(action, place))
            .collect()
    }

    /// The discrete states just before a time at which clocks tick, at an extended state, with the discrete states behind it.
    pub(super) fn discrete_before(
        &self,
        t: f64,
        (z, q): (&[f64], &[f64]),
    ) -> Result<Vec<f64>, FieldError> {
        self.discrete_at(t - AT_SIDE * (1.0 + t.abs()), (z, q))
    }

    /// The discrete states of a start at an extended state, the named ones as they are.
    fn discrete_at(&self, t: f64, (z, q): (&[f64], &[f64])) -> Result<Vec<f64>, FieldError> {
        let mut parameters = self.own.parameters().to_vec();
        let moved = self.places.iter().zip(&z[self.n..]);
        moved.for_each(|(&place, value)| parameters[place] = *value);
        let own = self.own.with_parameters(parameters);
        let mut found = self.laws.start(&own, t, &z[..self.n - self.n_named])?;
        found[..self.n_named].copy_from_slice(&q[..self.n_named]);
        Ok(found)
    }

    /// Does a law with thresholds start with another value, if this is moved by a little?
    pub(super) fn is_at_threshold(
        &self,
        kind: Column,
        t: f64,
        (z, q): (&[f64], &[f64]),
    ) -> Result<bool, FieldError> {
        if !self.laws.have_thresholds() {
            return Ok(false);
        }
        let beside = |side: f64| {
            let (mut t, mut z) = (t, z.to_vec());
            let entry = match kind {
                Column::State(i) => &mut z[i],
                Column::Parameter(p) => &mut z[self.n + p],
                Column::Start => &mut t,
            };
            *entry += side * AT_SIDE * (1.0 + entry.abs());
            self.discrete_at(t, (&z, q))
        };
        let (below, here, above) = (beside(-1.0)?, beside(0.0)?, beside(1.0)?);
        let mut all = (0..here.len()).filter(|&law| self.laws.has_thresholds(law));
        Ok(all.any(|law| below[law] != here[law] || above[law] != here[law]))
    }

    /// Is an action recorded as a switch?
    pub(super) fn is_recorded(&self, action: usize) -> bool {
        self.recorded.get(action).copied().unwrap_or(false)
    }

    /// Does an action move the state?
    pub(super) fn moves(&self, action: usize) -> bool {
        self.maps.get(action).is_some_and(Option::is_some)
    }

    /// The second derivative of a switching function.
    pub(super) fn form_of_surface(&self, j: usize) -> Result<Arc<Form>, ExprError> {
        let graph = self.system.graph();
        self.form_of(graph, graph.clone().surface(j as u32))
    }

    /// The second derivative of the rate of a switching function along the field.
    pub(super) fn form_of_rate(&self, j: usize) -> Result<Arc<Form>, ExprError> {
        let mut graph = self.system.graph().clone();
        let rate = self.rate_in(&mut graph, j);
        self.form_of(&graph, rate)
    }

    /// The rate of a switching function along the field, in a copy of the graph.
    pub(super) fn rate_in(&self, graph: &mut Graph, j: usize) -> NodeId {
        let surface = graph.surface(j as u32);
        let gradient = graph.gradient(surface);
        let mut rate = gradient.time;
        for (i, partial) in gradient.states {
            let term = graph.mul(partial, self.system.field_nodes()[i as usize]);
            rate = graph.add(rate, term);
        }
        rate
    }

    /// The second derivative of what the clock reads whose tick an action is, and its rate; `None` if the time does not move.
    pub(super) fn form_of_tick(
        &self,
        action: usize,
        place: &Place,
    ) -> Result<Option<(Arc<Form>, f64)>, ExprError> {
        let argument = self.clocks.get(action).and_then(Option::as_ref);
        match (argument, self.clock(action, place)) {
            (Some(argument), Some((rate, _))) => {
                let form = self.form_of(self.system.graph(), argument.node)?;
                Ok(Some((form, rate)))
            }
            _ => Ok(None),
        }
    }

    fn form_of(&self, graph: &Graph, node: NodeId) -> Result<Arc<Form>, ExprError> {
        let mut known = self.forms.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(form) = known.get(&node) {
            return Ok(Arc::clone(form));
        }
        let size = self.n + self.values.len();
        let form = Arc::new(Form::new(graph, &[node], size)?);
        known.insert(node, Arc::clone(&form));
        Ok(form)
    }

    /// The derivatives of the map of an action, up to second order.
    pub(super) fn second_of_map(&self, t: f64, act: &Act) -> Result<Option<MapAt<'_>>, FieldError> {
        let Some(map) = self.maps.get(act.index).and_then(Option::as_ref) else {
            return Ok(None);
        };
        map.second((t, &act.x), &self.values)
    }

    /// The series of these changes of the motions on these surfaces, if they have any.
    pub(super) fn series(
        &self,
        sliding: &[usize],
        order: usize,
        changes: Changes,
    ) -> Option<Arc<ChangeSeries>> {
        let mut known = self.series.lock().unwrap_or_else(PoisonError::into_inner);
        let own = (&self.system, self.n);
        let make = || ChangeSeries::new(own, sliding, order, &changes).map(Arc::new);
        let surfaces = SmallVec::from_slice(sliding);
        let made = known.entry((surfaces, order, changes.clone()));
        made.or_insert_with(make).clone()
    }

    /// The actions that may be impacts, with maps of the extended state: those of contacts.
    pub fn impacts(&self) -> Actions<'_> {
        let all = self.maps.iter().zip(&self.triggers);
        let impacts = all.filter_map(|(map, trigger)| {
            let map = &map.as_ref()?.extended;
            matches!(trigger, Trigger::Surface { .. }).then(|| Action {
                trigger: trigger.clone(),
                map,
                name: String::new(),
                kind: None,
            })
        });
        Actions {
            list: impacts.collect(),
            discrete: Vec::new(),
        }
    }

    /// How many rows a column has: one for each state, and behind these one for each named discrete state.
    pub fn n_rows(&self) -> usize {
        self.n
    }

    /// How many parameters have become states.
    pub fn n_parameters(&self) -> usize {
        self.values.len()
    }

    /// The value of what the clock reads whose tick an action is, with its derivatives; `None` if it ticks whatever the parameters.
    pub(super) fn clock_value(&self, index: usize, place: &Place) -> Option<(f64, Gradient)> {
        let program = &self.clocks.get(index)?.as_ref()?.value;
        let mut value = [0.0];
        self.system.eval(program, place, &[], &mut value);
        let (time, state) = self.clock(index, place)?;
        Some((value[0], Gradient { time, state }))
    }

    /// The derivatives of the clock whose tick an action is, by the time and by the extended state; `None` if it ticks whatever the
    /// parameters.
    fn clock(&self, index: usize, place: &Place) -> Option<(f64, Vec<f64>)> {
        let program = &self.clocks.get(index)?.as_ref()?.slopes;
        let mut out = vec![0.0; 1 + self.n_named + self.values.len()];
        self.system.eval(program, place, &[], &mut out);
        let state = [&vec![0.0; self.n - self.n_named], &out[1..]].concat();
        Some((out[0], state))
    }

    /// The columns at the start of a run with this velocity.
    pub(super) fn columns_at_start(&self, kinds: &[Column], field: &[f64]) -> Vec<Vec<f64>> {
        let column = |&kind: &Column| {
            let mut states = vec![0.0; self.n];
            match kind {
                Column::State(i) => states[i] = 1.0,
                Column::Start => (0..self.n).for_each(|r| states[r] = -field[r]),
                Column::Parameter(_) => {}
            }
            self.column(kind, &states)
        };
        kinds.iter().map(column).collect()
    }

    /// The derivative of the state by this, with the shares of the parameters behind it.
    pub(super) fn column(&self, kind: Column, states: &[f64]) -> Vec<f64> {
        let mut column = states.to_vec();
        column.resize(self.n + self.values.len(), 0.0);
        if let Column::Parameter(p) = kind {
            column[self.n + p] = 1.0;
        }
        column
    }

    /// The state, with the named discrete states, and the parameters behind it.
    pub(super) fn state(&self, x: &[f64]) -> Row {
        let mut z = Row::from_slice(x);
        z.extend_from_slice(&self.values);
        z
    }

    /// The state of the system with its named discrete states behind it, which are the first ones.
    pub(super) fn with_named(&self, x: &[f64], discrete: &[f64]) -> Row {
        let mut x = Row::from_slice(x);
        x.extend_from_slice(&discrete[..self.n_named]);
        x
    }

    /// Writes the state of the system and behind it its named discrete states.
    pub(super) fn write_with_named(
        &self,
        x: &mut [f64],
        discrete: &[f64],
        write: impl FnOnce(&mut [f64]),
    ) {
        let (own, named) = x.split_at_mut(self.n - self.n_named);
        write(own);
        named.copy_from_slice(&discrete[..self.n_named]);
    }
}

/// How many discrete states of a system have names: the first ones.
fn named_of(rules: &Rules) -> usize {
    let is_named = |law: &&Law| matches!(law, Law::Named { .. });
    rules.laws.iter().filter(is_named).count()
}

/// The system of a function with named discrete states and these parameters as states that rest, behind its own; its program is
/// called a few times.
pub(super) fn extended_system(
    system: &TracedSystem,
    rules: &Rules,
    parameters: &[usize],
) -> Result<TracedSystem, Error> {
    let definition = Definition::of(system, rules);
    let (extended, _) = definition.extended(parameters, Backend::Interpreter)?;
    Ok(extended.with_parameters(system.parameters().to_vec()))
}

/// Inputs of a graph with the states that they become, behind n others.
fn pairs(inputs: impl IntoIterator<Item = usize>, n: usize) -> Vec<(u32, u32)> {
    let states = (n as u32)..;
    let inputs = inputs.into_iter().map(|index| index as u32);
    inputs.zip(states).collect()
}

impl Definition {
    /// Makes a system in which its named discrete states and these parameters are states that rest, in this order. Returns it with the
    /// new node for each old one. It has no laws: the caller hands in the discrete states.
    fn extended(
        &self,
        parameters: &[usize],
        backend: Backend,
    ) -> Result<(TracedSystem, Vec<NodeId>), Error> {
        // The graph has the discrete states behind the parameters.
        let (n, n_parameters) = (self.field.len(), self.n_parameters());
        let named = (0..named_of(&self.rules)).map(|k| n_parameters + k);
        let pairs = pairs(named.chain(parameters.iter().copied()), n);
        let (mut graph, made) = self.graph.with_states_for(&pairs);
        let still = graph.constant(0.0);
        let mut field: Vec<NodeId> = self.field.iter().map(|id| made[id.index()]).collect();
        field.resize(n + pairs.len(), still);
        let ratios = self.rules.sticking.iter();
        let ratios: Vec<_> = ratios.map(|&(j, id)| (j, made[id.index()])).collect();
        let names = Names {
            states: Vec::new(),
            parameters: self.names.parameters.clone(),
        };
        let values = vec![0.0; n_parameters];
        let system = TracedSystem::new(graph, field, values, names, backend)?;
        let system = system.with_parameters_as_states(pairs.len());
        let system = system.watching(&self.rules.watched).sticking(&ratios);
        Ok((system.with_discrete(self.rules.laws.len()), made))
    }
}

/// The derivative of the map of an action.
pub(super) struct ExtendedMap<'a> {
    pub(super) expressions: &'a TracedSystem,
    /// The entries of its rows that may differ from zero: row and column.
    entries: Vec<(usize, usize)>,
    /// Their values, then the derivatives by the time.
    derivative: Program,
    /// The map of the extended state.
    extended: TracedMap,
    /// The second derivative of its first n components, once it was asked for.
    form: OnceLock<Option<Form>>,
    n: usize,
}

impl<'a> ExtendedMap<'a> {
    fn new(expressions: &'a TracedSystem, parameters: &[usize], n: usize) -> Result<Self, Error> {
        let pairs = pairs(parameters.iter().copied(), n);
        let (mut graph, made) = expressions.graph().with_states_for(&pairs);
        let (mut entries, mut outputs, mut by_time) = (Vec::new(), Vec::new(), Vec::new());
        for (r, id) in expressions.field_nodes().iter().enumerate() {
            let gradient = graph.gradient(made[id.index()]);
            by_time.push(gradient.time);
            for (input, node) in gradient.states {
                entries.push((r, input as usize));
                outputs.push(node);
            }
        }
        outputs.extend(by_time);
        let derivative = Program::compile(&graph, &outputs, Backend::Interpreter)?;
        let values = expressions.field_nodes().iter();
        let mut field: Vec<NodeId> = values.map(|id| made[id.index()]).collect();
        field.extend(pairs.iter().map(|pair| graph.state(pair.1)));
        let names = Names {
            states: Vec::new(),
            parameters: expressions.names().parameters.clone(),
        };
        let values = expressions.parameters().to_vec();
        let extended = TracedSystem::new(graph, field, values, names, Backend::Interpreter)?;
        Ok(ExtendedMap {
            expressions,
            entries,
            derivative,
            extended: TracedMap::new(extended),
            form: OnceLock::new(),
            n,
        })
    }

    /// The derivatives of the new state at a place: n rows by the states and the parameters, and by the time.
    pub fn derivative(
        &self,
        (t, x): (f64, &[f64]),
        values: &[f64],
    ) -> Result<(Vec<Vec<f64>>, Vec<f64>), FieldError> {
        let signs = sides_of(self.expressions, (t, x), &[])?;
        let mut out = self.slopes((t, &[x, values].concat()), &signs);
        let by_time = out.split_off(self.entries.len());
        let mut rows = vec![vec![0.0; self.n + values.len()]; self.n];
        for (&(r, c), value) in self.entries.iter().zip(out) {
            rows[r][c] = value;
        }
        Ok((rows, by_time))
    }

    /// The derivatives that may differ from zero, then those by the time.
    fn slopes(&self, (t, z): (f64, &[f64]), signs: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.entries.len() + self.n];
        let place = Place::new(t, z, signs);
        self.expressions
            .eval(&self.derivative, &place, &[], &mut out);
        out
    }

    /// The new state, and its derivatives, with these signs.
    pub fn with_signs(&self, (t, z): (f64, &[f64]), signs: &[f64]) -> Result<Vec<f64>, FieldError> {
        let mut out = vec![0.0; self.n];
        let place = Place::new(t, &z[..self.n], signs);
        self.expressions.field(&place, &mut out)?;
        out.extend(self.slopes((t, z), signs));
        Ok(out)
    }

    /// The first and second derivatives of the new state at a place; `None` if the map cannot be compiled.
    fn second(
        &self,
        (t, x): (f64, &[f64]),
        values: &[f64],
    ) -> Result<Option<MapAt<'_>>, FieldError> {
        let Some(system) = self.extended.expressions() else {
            return Ok(None);
        };
        let size = self.n + values.len();
        let form = self.form.get_or_init(|| {
            let nodes = &system.field_nodes()[..self.n];
            Form::new(system.graph(), nodes, size).ok()
        });
        let Some(form) = form else {
            return Ok(None);
        };
        let (rows, by_time) = self.derivative((t, x), values)?;
        Ok(Some(MapAt {
            rows,
            by_time,
            form,
            system,
            t,
            inputs: [x, values].concat(),
            n: self.n,
        }))
    }
}
