//! Everything that one run needs, taken from Python objects once; the run itself needs no Python.

use std::sync::Arc;

use filippov::action::{Action, ActionMap, Actions, Trigger};
use filippov::derivative::{Extension, Growth};
use filippov::section::Section;
use filippov::{
    replay_decision, DecisionOutcome, DecisionPoint, Error, FieldError, Kind, LawAction, Laws,
    Options, Piece, Problem, Reached, Setting, Solution, TracedMap, UserEvent, UserFunction,
};
use pyo3::prelude::*;

use crate::callbacks::{CalledEvent, CalledMap, CompiledEvent, TracedEvent};
use crate::derivatives::{run_with_derivatives, Failure, RunDerivatives, Wanted};
use crate::exponents::run_with_growth;
use crate::run::Run;
use crate::saved::read_trigger;
use crate::systems::{core_of, n_visible_of, raised, CoreSystem, TracedSystem};

/// The function of an event (a handle of the traced system, or a callable), its direction, how many zeros end the
/// run, and its name.
pub type EventRow = (Py<PyAny>, f64, u64, String);

type SharedFunction = Box<dyn UserFunction + Send + Sync>;

/// One run: a copy of the system with its parameters, the state to start from, events and actions.
pub struct PreparedRun {
    core: CoreSystem,
    compiled: Option<Arc<filippov::TracedSystem>>,
    y0: Vec<f64>,
    events: Vec<(SharedFunction, f64, u64)>,
    given: Vec<(SharedMap, Trigger, String)>,
    laws: Vec<LawAction>,
    law_names: Vec<String>,
    /// All laws, for what is asked for that the run does not follow.
    all_laws: Option<Arc<Laws>>,
    discrete: Vec<f64>,
    n_visible: usize,
    is_native: bool,
}

impl PreparedRun {
    pub fn new(
        system: &Bound<'_, PyAny>,
        t0: f64,
        y0: Vec<f64>,
        p: Vec<f64>,
        events: &[EventRow],
        actions: &[ActionRow],
    ) -> PyResult<Self> {
        let py = system.py();
        let traced = system.cast::<TracedSystem>().ok();
        let (mut laws, mut discrete, mut compiled) = (Vec::new(), Vec::new(), None);
        let n_named = traced.map_or(0, |traced| traced.get().laws.n_named());
        let given = read_actions(py, actions, &p, n_named)?;
        let core = match traced {
            Some(traced) => {
                let own = Arc::new(traced.get().with(&p));
                discrete = traced.get().laws.start(&own, t0, &y0).map_err(raised)?;
                laws = traced.get().laws.actions(y0.len(), own.parameters());
                compiled = Some(Arc::clone(&own));
                own as CoreSystem
            }
            None => core_of(system, &p, t0, &y0)?.0,
        };
        let mut functions = Vec::with_capacity(events.len());
        for (g, direction, terminal, _name) in events {
            let traced = g.bind(py).cast::<TracedEvent>().ok();
            let function: SharedFunction = match (traced, &compiled) {
                (Some(event), Some(own)) => Box::new(CompiledEvent {
                    expression: Arc::clone(&event.get().expression),
                    system: Arc::clone(own),
                }),
                _ => Box::new(CalledEvent(g.clone_ref(py))),
            };
            functions.push((function, *direction, *terminal));
        }
        Ok(PreparedRun {
            n_visible: n_visible_of(system, &*core),
            law_names: traced.map_or_else(Vec::new, |t| t.get().law_names()),
            all_laws: traced.map(|t| Arc::clone(&t.get().laws)),
            is_native: traced.is_some_and(|t| t.get().system.is_native()),
            core,
            compiled,
            y0,
            events: functions,
            given,
            laws,
            discrete,
        })
    }

    /// The same from where another run ended, which left its discrete states so.
    pub fn going_on(mut self, t0: f64, before: &[f64]) -> PyResult<Self> {
        if let (Some(laws), Some(system)) = (&self.all_laws, &self.compiled) {
            let found = laws.go_on(system, (t0, &self.y0), before);
            self.discrete = found.map_err(raised)?;
        }
        Ok(self)
    }

    /// Runs; `interrupt` is asked now and then with the time reached.
    pub fn run(
        &self,
        t_span: (f64, f64),
        options: &Options,
        interrupt: &mut dyn FnMut(Reached) -> bool,
    ) -> Result<Solution, Error> {
        let (events, actions) = (self.user_events(), self.actions());
        Problem::new(&*self.core, t_span, &self.y0)
            .options(options)
            .events(&events)
            .actions(&actions)
            .solve_interruptible(interrupt)
    }

    /// Runs, and follows the derivatives that are wanted, if any are.
    pub fn run_differentiated(
        &self,
        t_span: (f64, f64),
        options: &Options,
        wanted: Option<(&Arc<Extension>, &Wanted)>,
        interrupt: &mut dyn FnMut(Reached) -> bool,
    ) -> Result<(Solution, Option<RunDerivatives>), Failure> {
        let Some((extension, wanted)) = wanted else {
            return Ok((self.run(t_span, options, interrupt)?, None));
        };
        let Some(system) = &self.compiled else {
            return Err(Failure::CalledMap);
        };
        let (events, actions) = (self.user_events(), self.actions());
        let problem = self.problem(system, t_span, (options, &events, &actions));
        let (solution, derivatives) = run_with_derivatives(
            problem,
            (system, extension, &actions),
            options,
            t_span,
            wanted,
            interrupt,
        )?;
        Ok((solution, Some(derivatives)))
    }

    /// Runs, and follows the growth of small changes, kept at these times.
    pub fn run_with_growth(
        &self,
        t_span: (f64, f64),
        marks: &[f64],
        (options, extension): (&Options, &Arc<Extension>),
        interrupt: &mut dyn FnMut(Reached) -> bool,
    ) -> Result<(Solution, Growth), Failure> {
        let system = self.compiled.as_ref().ok_or(Failure::CalledMap)?;
        let actions = self.actions();
        let problem = Problem::new(&**system, t_span, &self.y0)
            .options(options)
            .actions(&actions);
        let of = (&**system, extension, &actions);
        run_with_growth(problem, of, options, marks, interrupt)
    }

    /// The run of this system, which is its own.
    pub fn problem<'p>(
        &'p self,
        system: &'p filippov::TracedSystem,
        t_span: (f64, f64),
        (options, events, actions): (&'p Options, &'p [UserEvent<'p>], &'p Actions<'p>),
    ) -> Problem<'p> {
        Problem::new(system, t_span, &self.y0)
            .options(options)
            .events(events)
            .actions(actions)
    }

    pub fn user_events(&self) -> Vec<UserEvent<'_>> {
        let events = self.events.iter();
        let events = events.map(|(function, direction, terminal)| UserEvent {
            function: &**function,
            direction: *direction,
            terminal: *terminal,
        });
        events.collect()
    }

    /// Runs from section to section; the events are those of the section.
    pub fn run_to_section(
        &self,
        t_span: (f64, f64),
        options: &Options,
        section: &Section,
        interrupt: &mut dyn FnMut(Reached) -> bool,
    ) -> Result<Solution, Error> {
        Problem::new(&*self.core, t_span, &self.y0)
            .options(options)
            .actions(&self.actions())
            .solve_to_section(section, interrupt)
    }

    /// Repeats the decision at a point of such a run.
    pub fn replay(
        &self,
        options: &Options,
        point: &DecisionPoint,
    ) -> Result<DecisionOutcome, FieldError> {
        replay_decision(&*self.core, &self.actions(), options, point)
    }

    /// Brings the discrete states of a piece that the run did not follow up to date with a point of it.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn follow_idle(&self, piece: &mut Piece, at: (f64, &[f64])) -> Result<(), FieldError> {
        match (&self.all_laws, &self.compiled) {
            (Some(laws), Some(system)) => laws.follow_idle(system, at, &mut piece.discrete),
            _ => Ok(()),
        }
    }

    /// The velocity of a motion that does not slide, if its field has a value.
    pub fn velocity_in_region(&self, piece: &Piece, (t, x): (f64, &[f64])) -> Option<Vec<f64>> {
        if piece.mode.codimension() > 0 {
            return None;
        }
        let (signs, mut velocity) = (piece.mode.signs(), vec![0.0; x.len()]);
        let place = Setting::new(&signs, &piece.discrete).at(t, x);
        let known = self.core.field(&place, &mut velocity);
        known.ok().map(|()| velocity)
    }

    /// The system with its parameters, if it is traced.
    pub fn traced(&self) -> Option<&Arc<filippov::TracedSystem>> {
        self.compiled.as_ref()
    }

    /// The core's system.
    pub fn core(&self) -> &CoreSystem {
        &self.core
    }

    /// Is its field native code?
    pub fn is_native(&self) -> bool {
        self.is_native
    }

    /// Was its field native code when it ran?
    pub fn set_native(&mut self, is_native: bool) {
        self.is_native = is_native;
    }

    /// Is it made of its system, its initial state and its parameters alone?
    pub fn is_plain(&self) -> bool {
        let has_no_actions = self.given.is_empty() && self.laws.is_empty();
        self.compiled.is_some() && has_no_actions && self.discrete.is_empty()
    }

    /// How many of its surfaces a user sees.
    pub fn n_visible(&self) -> usize {
        self.n_visible
    }

    /// What the user gives comes first: a sample at a tick sees the ramp before it drops.
    pub fn actions(&self) -> Actions<'_> {
        let given = self.given.iter().map(|(map, trigger, name)| Action {
            kind: Some(match trigger {
                Trigger::Surface { .. } => Kind::Reset,
                _ => Kind::Clock,
            }),
            trigger: trigger.clone(),
            map: &**map,
            name: name.clone(),
        });
        let laws = self.laws.iter().map(|law| Action {
            trigger: law.trigger.clone(),
            map: &law.map,
            name: self.law_names.get(law.index).cloned().unwrap_or_default(),
            kind: law.kind,
        });
        Actions {
            list: given.chain(laws).collect(),
            discrete: self.discrete.clone(),
        }
    }

    /// The result of the run as a Python object, which keeps of this what is asked for later: all actions where derivatives are,
    /// and else those that the forces of contacts follow from, since the times of a table are as many as its knots.
    pub fn result(mut self, solution: Solution, derivatives: Option<RunDerivatives>) -> Run {
        if derivatives.is_none() {
            let is_at_surface = |trigger: &Trigger| matches!(trigger, Trigger::Surface { .. });
            self.given.retain(|(_, trigger, _)| is_at_surface(trigger));
            self.laws.retain(|law| is_at_surface(&law.trigger));
        }
        if !derivatives
            .as_ref()
            .is_some_and(RunDerivatives::is_to_repeat)
        {
            self.events.clear();
        }
        Run::new(self, solution, derivatives)
    }
}

/// When, numbers that say so, the map (traced, or a callable), and the name of an action.
pub type ActionRow = (String, Vec<f64>, Py<PyAny>, String);

type SharedMap = Box<dyn ActionMap + Send + Sync>;

fn read_actions(
    py: Python<'_>,
    rows: &[ActionRow],
    p: &[f64],
    n_named: usize,
) -> PyResult<Vec<(SharedMap, Trigger, String)>> {
    let read = |(when, numbers, map, name): &ActionRow| {
        let trigger = read_trigger(when, numbers)?;
        let map: SharedMap = match map.bind(py).cast::<TracedSystem>() {
            Ok(traced) => Box::new(TracedMap::new(traced.get().with(p))),
            Err(_) => Box::new(CalledMap {
                map: map.clone_ref(py),
                n_named,
            }),
        };
        Ok((map, trigger, name.clone()))
    };
    rows.iter().map(read).collect()
}
