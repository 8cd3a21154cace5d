//! A traced system in which parameters are states that rest.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use filippov_expr::{Backend, ExprError, Names, NodeId, Program};
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use super::forms::{Form, MapAt};
use super::series::ChangeSeries;
use crate::error::{Error, FieldError};
use crate::record::Gradient;
use crate::system::{
    sides_of, Act, Action, ActionMap, Actions, Definition, PiecewiseSystem, Place, Rules,
    TracedMap, TracedSystem, Trigger,
};

/// By what is differentiated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// A component of the initial state.
    State(usize),
    /// The initial time.
    Start,
    /// A parameter, by its place among those that the extended system has as states.
    Parameter(usize),
}

/// A system with some of its parameters as further states behind those that it has, for all values of them.
pub struct Extension {
    system: TracedSystem,
    rules: Rules,
    /// How many states the system has itself.
    n: usize,
    parameters: Vec<usize>,
    /// What each node of the system has become.
    made: Vec<NodeId>,
    series: Arc<SeriesCache>,
    /// Second derivatives of switching functions.
    forms: Arc<Mutex<FxHashMap<usize, Arc<Form>>>>,
}

/// The series of changes, by the surfaces slid on and the order.
type SeriesCache = Mutex<FxHashMap<(Surfaces, usize, bool), Option<Arc<ChangeSeries>>>>;
type Surfaces = SmallVec<[usize; 2]>;

impl Extension {
    /// The extension of a system by these parameters.
    ///
    /// # Errors
    /// If an expression cannot be compiled.
    pub fn new(system: &TracedSystem, rules: &Rules, parameters: &[usize]) -> Result<Self, Error> {
        let n = system.n_states();
        let definition = Definition::of(system, rules);
        let (system, made) = definition.extended(&pairs(parameters, n), Backend::Native)?;
        Ok(Extension {
            system,
            rules: rules.clone(),
            n,
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
            system: self.system.with_parameters(values.to_vec()),
            n: self.n,
            maps,
            triggers: triggers.collect(),
            clocks,
            series: Arc::clone(&self.series),
            forms: Arc::clone(&self.forms),
        }))
    }

    /// The derivatives of what a law reads, by the time and by the parameters that have become states; then its value.
    fn clock_of(&self, law: usize) -> Result<Option<Program>, Error> {
        let Some(&argument) = self.rules.laws[law].nodes().first() else {
            return Ok(None);
        };
        let mut graph = self.system.graph().clone();
        let gradient = graph.gradient(self.made[argument.index()]);
        let zero = graph.constant(0.0);
        let by_state = |state: u32| {
            let found = gradient.states.iter().find(|entry| entry.0 == state);
            found.map_or(zero, |entry| entry.1)
        };
        let mut outputs = vec![gradient.time];
        let states = pairs(&self.parameters, self.n);
        outputs.extend(states.into_iter().map(|(_, state)| by_state(state)));
        outputs.push(self.made[argument.index()]);
        let program = Program::compile(&graph, &outputs, Backend::Interpreter)?;
        Ok(Some(program))
    }
}

/// An extended system with the values of a run, and the maps of its actions.
pub struct Extended<'a> {
    pub(super) system: TracedSystem,
    /// How many states the system has itself.
    pub(super) n: usize,
    /// The values of the parameters that have become states.
    pub(super) values: Vec<f64>,
    /// The map of each action; none where it leaves the states as they are.
    pub(super) maps: Vec<Option<ExtendedMap<'a>>>,
    triggers: Vec<Trigger>,
    /// For each action at the known times of a law the derivatives of what the law reads: by the time, then by the parameters.
    clocks: Vec<Option<Program>>,
    series: Arc<SeriesCache>,
    forms: Arc<Mutex<FxHashMap<usize, Arc<Form>>>>,
}

impl Extended<'_> {
    /// The action that a surface triggers and that moves the state, if there is one.
    pub(super) fn triggered_by(&self, surface: usize) -> Option<usize> {
        let is_own = |(action, trigger): (usize, &Trigger)| {
            matches!(trigger, Trigger::Surface { index, .. } if *index == surface)
                && self.moves(action)
        };
        let mut all = self.triggers.iter().enumerate();
        all.find_map(|(action, trigger)| is_own((action, trigger)).then_some(action))
    }

    /// Does an action move the state?
    pub(super) fn moves(&self, action: usize) -> bool {
        self.maps.get(action).is_some_and(Option::is_some)
    }

    /// The second derivative of a switching function.
    pub(super) fn form_of_surface(&self, j: usize) -> Result<Arc<Form>, ExprError> {
        let mut known = self.forms.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(form) = known.get(&j) {
            return Ok(Arc::clone(form));
        }
        let graph = self.system.graph();
        let size = self.n + self.values.len();
        let form = Arc::new(Form::new(graph, &[graph.clone().surface(j as u32)], size)?);
        known.insert(j, Arc::clone(&form));
        Ok(form)
    }

    /// The derivatives of the map of an action, up to second order.
    pub(super) fn second_of_map(&self, t: f64, act: &Act) -> Result<Option<MapAt<'_>>, FieldError> {
        let Some(map) = self.maps.get(act.index).and_then(Option::as_ref) else {
            return Ok(None);
        };
        map.second((t, &act.x, &act.discrete), &self.values)
    }

    /// The series of the changes of the motions on these surfaces, or of pairs of changes, if they have any.
    pub(super) fn series(
        &self,
        sliding: &[usize],
        order: usize,
        of_pairs: bool,
    ) -> Option<Arc<ChangeSeries>> {
        let mut known = self.series.lock().unwrap_or_else(PoisonError::into_inner);
        let made = known.entry((SmallVec::from_slice(sliding), order, of_pairs));
        let make = || ChangeSeries::new(&self.system, sliding, order, of_pairs).map(Arc::new);
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

    /// How many parameters have become states.
    pub fn n_parameters(&self) -> usize {
        self.values.len()
    }

    /// The value of the clock whose tick an action is, with its derivatives by the time and by the extended state; `None` if it ticks
    /// whatever the parameters.
    pub(super) fn clock(&self, index: usize, place: &Place) -> Option<(f64, Gradient)> {
        let program = self.clocks.get(index)?.as_ref()?;
        let m = self.values.len();
        let mut out = vec![0.0; 2 + m];
        self.system.eval(program, place, &[], &mut out);
        let state = [&vec![0.0; self.n], &out[1..1 + m]].concat();
        let time = out[0];
        Some((out[1 + m], Gradient { time, state }))
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

    /// The state with the parameters behind it.
    pub(super) fn state(&self, x: &[f64]) -> Vec<f64> {
        [x, &self.values].concat()
    }
}

/// The system of a function with these parameters as states that rest, behind its own; its program is called a few times.
pub(super) fn extended_system(
    system: &TracedSystem,
    rules: &Rules,
    parameters: &[usize],
) -> Result<TracedSystem, Error> {
    let pairs = pairs(parameters, system.n_states());
    let definition = Definition::of(system, rules);
    let (extended, _) = definition.extended(&pairs, Backend::Interpreter)?;
    Ok(extended.with_parameters(system.parameters().to_vec()))
}

/// Parameters with the states that they become, behind n others.
fn pairs(parameters: &[usize], n: usize) -> Vec<(u32, u32)> {
    let states = (n as u32)..;
    let parameters = parameters.iter().map(|&index| index as u32);
    parameters.zip(states).collect()
}

impl Definition {
    /// Makes a system in which the second number of each pair is a state that rests, and replaces the parameter with the first number.
    /// Returns it with the new node for each old one. It has no laws: the caller hands in the discrete states.
    fn extended(
        &self,
        parameters: &[(u32, u32)],
        backend: Backend,
    ) -> Result<(TracedSystem, Vec<NodeId>), Error> {
        let (mut graph, made) = self.graph.with_states_for(parameters);
        let still = graph.constant(0.0);
        let mut field: Vec<NodeId> = self.field.iter().map(|id| made[id.index()]).collect();
        field.resize(field.len() + parameters.len(), still);
        let ratios = self.rules.sticking.iter();
        let ratios: Vec<_> = ratios.map(|&(j, id)| (j, made[id.index()])).collect();
        let names = Names {
            states: Vec::new(),
            parameters: self.names.parameters.clone(),
        };
        let values = vec![0.0; self.n_parameters()];
        let system = TracedSystem::new(graph, field, values, names, backend)?;
        let system = system.watching(&self.rules.watched).sticking(&ratios);
        Ok((system.with_discrete(self.rules.laws.len()), made))
    }
}

/// The derivative of the map of an action.
pub(super) struct ExtendedMap<'a> {
    expressions: &'a TracedSystem,
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
        let n_all = expressions.n_states();
        let pairs = pairs(parameters, n_all);
        let (mut graph, made) = expressions.graph().with_states_for(&pairs);
        let (mut entries, mut outputs, mut by_time) = (Vec::new(), Vec::new(), Vec::new());
        for (r, id) in expressions.field_nodes()[..n].iter().enumerate() {
            let gradient = graph.gradient(made[id.index()]);
            by_time.push(gradient.time);
            for (input, node) in gradient.states {
                let input = input as usize;
                // Named discrete states stand between the states and the parameters.
                if input < n || input >= n_all {
                    let behind = input.checked_sub(n_all).map(|p| n + p);
                    entries.push((r, behind.unwrap_or(input)));
                    outputs.push(node);
                }
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
        (t, x, q): (f64, &[f64], &[f64]),
        values: &[f64],
    ) -> Result<(Vec<Vec<f64>>, Vec<f64>), FieldError> {
        let expressions = self.expressions;
        let n_named = expressions.n_states() - self.n;
        let before: Vec<f64> = x.iter().chain(q.iter().take(n_named)).copied().collect();
        let signs = sides_of(expressions, (t, &before), &[])?;
        let z = [&before[..], values].concat();
        let mut out = vec![0.0; self.entries.len() + self.n];
        let place = Place::new(t, &z, &signs);
        expressions.eval(&self.derivative, &place, &[], &mut out);
        let by_time = out.split_off(self.entries.len());
        let mut rows = vec![vec![0.0; self.n + values.len()]; self.n];
        for (&(r, c), value) in self.entries.iter().zip(out) {
            rows[r][c] = value;
        }
        Ok((rows, by_time))
    }

    /// The first and second derivatives of the new state at a place; `None` if the map cannot be compiled.
    fn second(
        &self,
        (t, x, q): (f64, &[f64], &[f64]),
        values: &[f64],
    ) -> Result<Option<MapAt<'_>>, FieldError> {
        let Some(system) = self.extended.expressions() else {
            return Ok(None);
        };
        let size = self.expressions.n_states() + values.len();
        let form = self.form.get_or_init(|| {
            let nodes = &system.field_nodes()[..self.n];
            Form::new(system.graph(), nodes, size).ok()
        });
        let Some(form) = form else {
            return Ok(None);
        };
        let n_named = self.expressions.n_states() - self.n;
        let (rows, by_time) = self.derivative((t, x, q), values)?;
        Ok(Some(MapAt {
            rows,
            by_time,
            form,
            system,
            t,
            inputs: [x, &q[..n_named.min(q.len())], values].concat(),
            n: self.n,
        }))
    }
}
