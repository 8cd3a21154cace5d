//! Systems and jumps of the state, and what they are when they are traced.

use std::collections::BTreeMap;
use std::rc::Rc;

use filippov::action::{Clock, Trigger};
use filippov::{Definition, Rules, SavedAction, SavedSystem};
use filippov_expr::{Names, NodeId, Switching};
use ruff_python_ast::ExprCall;
use ruff_text_size::{Ranged, TextRange};

use crate::arrays::items_of;
use crate::calls::Arguments;
use crate::constants_of_motion::Constants;
use crate::laws::Laws;
use crate::questions::{check_questions, is_exact_at_an_instant};
use crate::reader::Reader;
use crate::tracer::Tracer;
use crate::unreadable::{refuse, Refused};
use crate::values::{Array, Callable, Value};

/// `fl.System(fun, ...)`.
#[derive(Clone, Debug)]
pub struct SystemText {
    pub function: Rc<Callable>,
    pub n: Option<usize>,
    pub states: Vec<String>,
    /// Names and values, where they are given beside the function.
    pub parameters: Option<Vec<(String, f64)>>,
    pub args: Vec<Value>,
    pub resets: Vec<Rc<ResetText>>,
    pub place: TextRange,
}

impl SystemText {
    /// The system of a function alone.
    pub fn of(function: Rc<Callable>) -> Self {
        SystemText {
            place: function.range,
            function,
            n: None,
            states: Vec::new(),
            parameters: None,
            args: Vec::new(),
            resets: Vec::new(),
        }
    }
}

/// `fl.Reset(h, map, ...)`.
#[derive(Debug)]
pub struct ResetText {
    pub when: When,
    pub map: Rc<Callable>,
    pub name: String,
    pub place: TextRange,
}

/// When a jump of the state happens.
#[derive(Debug)]
pub enum When {
    /// Where a function reaches zero.
    Surface {
        function: Rc<Callable>,
        direction: i8,
    },
    /// At known times.
    Known(Trigger),
}

impl Reader<'_> {
    /// What `fl.Reset(...)` says.
    pub fn reset(&mut self, call: &ExprCall, arguments: Arguments) -> Result<ResetText, Refused> {
        let names = ["h", "map", "direction", "name", "times", "period", "phase"];
        let [h, map, direction, name, times, period, phase] =
            arguments.by_names(call, "Reset", names)?;
        let Some(Value::Function(map)) = map else {
            return refuse(call, "a reset is read with a map, a function of t and x");
        };
        let direction = match &direction {
            None => 0,
            Some(Value::Text(text)) if &**text == "both" => 0,
            Some(Value::Text(text)) if &**text == "up" => 1,
            Some(Value::Text(text)) if &**text == "down" => -1,
            Some(Value::Number { value, .. }) if *value == 0.0 => 0,
            Some(Value::Number { value, .. }) => value.signum() as i8,
            _ => return refuse(call, "direction: \"up\", \"down\" or \"both\" is needed"),
        };
        let when = match (h, times, period) {
            (Some(Value::Function(function)), None, None) => When::Surface {
                function,
                direction,
            },
            (None, Some(times), None) => {
                let items = items_of(call, &times)?;
                let times: Option<Vec<f64>> = items.iter().map(Value::number).collect();
                match times.filter(|times| times.windows(2).all(|pair| pair[0] < pair[1])) {
                    Some(times) => When::Known(Trigger::Times(times)),
                    None => return refuse(call, "times: numbers that increase are needed"),
                }
            }
            (None, None, Some(Value::Number { value: period, .. })) if period > 0.0 => {
                let phase = match phase {
                    None => 0.0,
                    Some(Value::Number { value, .. }) => value,
                    _ => return refuse(call, "phase: a number is needed"),
                };
                When::Known(Trigger::Clock {
                    clock: Clock { period, phase },
                    at_start: true,
                })
            }
            _ => return refuse(call, "a reset is read with one of h, times and period"),
        };
        let name = match name {
            Some(Value::Text(name)) => name.to_string(),
            Some(_) => return refuse(call, "name: a text is needed"),
            None if map.name == "<lambda>" => "reset".into(),
            None => map.name.clone(),
        };
        Ok(ResetText {
            when,
            map,
            name,
            place: call.range(),
        })
    }

    /// What `fl.System(...)` says.
    pub fn system(&mut self, call: &ExprCall, arguments: Arguments) -> Result<SystemText, Refused> {
        let names = ["fun", "n", "params", "states", "surfaces", "args", "resets"];
        let [function, n, params, states, surfaces, args, resets] =
            arguments.by_names(call, "System", names)?;
        let Some(Value::Function(function)) = function else {
            return refuse(call, "a system is read with a function of the text");
        };
        if surfaces.is_some() {
            return refuse(call, "surfaces that are declared are not read here");
        }
        self.described(call, function, [n, params, states, args, resets])
    }

    /// The system of a function under `@fl.system(...)`.
    pub fn decorated(
        &mut self,
        part: &impl Ranged,
        function: Rc<Callable>,
        arguments: Arguments,
    ) -> Result<SystemText, Refused> {
        let names = ["n", "params", "states", "resets"];
        let [n, params, states, resets] = arguments.by_names(part, "system", names)?;
        self.described(part, function, [n, params, states, None, resets])
    }

    fn described(
        &mut self,
        part: &impl Ranged,
        function: Rc<Callable>,
        [n, params, states, args, resets]: [Option<Value>; 5],
    ) -> Result<SystemText, Refused> {
        let text = |value: &Value| match value {
            Value::Text(text) => Ok(text.to_string()),
            _ => refuse(part, "a name is a text"),
        };
        let n = match n {
            None | Some(Value::Nothing) => None,
            Some(Value::Number {
                value,
                is_whole: true,
            }) if value >= 1.0 => Some(value as usize),
            _ => return refuse(part, "n: a whole number is needed"),
        };
        let parameters = match params {
            None | Some(Value::Nothing) => None,
            Some(Value::Dict(pairs)) => {
                let mut found = Vec::new();
                for (key, value) in pairs.iter().rev() {
                    match value.number() {
                        Some(value) => found.push((text(key)?, value)),
                        None => return refuse(part, "params: a dict of numbers is needed"),
                    }
                }
                Some(found)
            }
            _ => return refuse(part, "params: a dict of numbers is needed"),
        };
        let states = match states {
            None | Some(Value::Nothing) => Vec::new(),
            Some(states) => {
                let items = items_of(part, &states)?;
                items.iter().map(text).collect::<Result<Vec<_>, _>>()?
            }
        };
        let args = match args {
            None => Vec::new(),
            Some(args @ (Value::List(_) | Value::Array(_))) => items_of(part, &args)?,
            Some(single) => vec![single],
        };
        let resets = match resets {
            None | Some(Value::Nothing) => Vec::new(),
            Some(Value::Reset(reset)) => vec![reset],
            Some(several) => {
                let items = items_of(part, &several)?.into_iter();
                let reset = |value| match value {
                    Value::Reset(reset) => Ok(reset),
                    _ => refuse(part, "resets: fl.Reset(h, map) is needed"),
                };
                items.map(reset).collect::<Result<Vec<_>, _>>()?
            }
        };
        Ok(SystemText {
            place: part.range(),
            function,
            n,
            states,
            parameters,
            args,
            resets,
        })
    }
}

/// What a trace is made with.
struct Setting<'a> {
    imported: &'a BTreeMap<String, String>,
    names: Names,
    n: usize,
    values: Vec<f64>,
    args: &'a [Value],
}

impl Setting<'_> {
    /// The nodes of a function of t, x and the parameters, on all of its paths; `n` numbers, or one.
    fn explored(
        &self,
        tracer: &mut Tracer,
        function: &Callable,
        n: usize,
        takes_all: bool,
    ) -> Result<Vec<NodeId>, Refused> {
        let taken = function.arguments();
        let is_taken = |name: &String| takes_all || taken.contains(name);
        tracer.explore(function, |tracer| {
            let time = tracer.graph.time();
            let states = (0..self.n as u32).map(|i| Value::Node(tracer.graph.state(i)));
            let states = Array::new(vec![self.n], states.collect(), true);
            let mut named = BTreeMap::new();
            for (index, name) in self.names.parameters.iter().enumerate() {
                let node = tracer.graph.parameter(index as u32);
                if is_taken(name) {
                    named.insert(name.clone(), Value::Node(node));
                }
            }
            let mut given = vec![Value::Node(time), Value::Array(states)];
            given.extend(self.args.iter().cloned());
            let mut reader = Reader::new(tracer, self.imported, Rc::clone(&function.scope));
            let value = reader.call_own(function, function, given, named)?;
            reader.nodes(function, &value, n)
        })
    }
}

/// The expressions of a system, its switching functions of resets, and its laws.
struct Recorded {
    field: Vec<NodeId>,
    watched: Vec<(u32, f64)>,
    rules: Rules,
}

/// Traces a system with `n` states.
pub fn traced(
    text: &SystemText,
    imported: &BTreeMap<String, String>,
    n: usize,
    states: Vec<String>,
) -> Result<SavedSystem, Refused> {
    let function = &*text.function;
    let (parameters, defaults) = parameters_of(text)?;
    let setting = Setting {
        imported,
        names: Names { states, parameters },
        n,
        values: defaults.clone(),
        args: &text.args,
    };
    let record = |tracer: &mut Tracer| {
        let field = setting.explored(tracer, function, n, true)?;
        let field = tracer.with_ends_of_roots(field)?;
        let mut watched = Vec::new();
        for reset in &text.resets {
            let When::Surface { function, .. } = &reset.when else {
                continue;
            };
            let found = setting.explored(tracer, function, 1, false)?;
            match tracer.graph.switch(found[0]) {
                Switching::Surface { index, orientation } => watched.push((index, orientation)),
                Switching::Constant(_) => {
                    return refuse(&reset.place, "h never changes its sign");
                }
            }
        }
        let kept: Vec<u32> = watched.iter().map(|(surface, _)| *surface).collect();
        let (order, mut rules) = Laws::complete(tracer, &kept)?;
        for (surface, _) in &mut watched {
            *surface = order[*surface as usize];
        }
        rules.watched = watched
            .iter()
            .map(|(surface, _)| *surface as usize)
            .collect();
        Ok(Recorded {
            field,
            watched,
            rules,
        })
    };
    let new = |constants| Tracer::new(setting.names.clone(), setting.values.clone(), constants);
    let (mut tracer, recorded) = with_constants_of_motion(&new, &record)?;
    let watched: Vec<u32> = recorded
        .watched
        .iter()
        .map(|(surface, _)| *surface)
        .collect();
    check_questions(
        &mut tracer,
        &recorded.field,
        &watched,
        recorded.rules.n_hidden,
    )?;
    let mut is_pinned = tracer.is_pinned;
    let mut surfaces = recorded.watched.iter();
    let mut actions = Vec::new();
    for reset in &text.resets {
        let trigger = match (&reset.when, surfaces.as_slice().first()) {
            (When::Known(trigger), _) => trigger.clone(),
            (When::Surface { direction, .. }, Some(&(index, orientation))) => {
                surfaces.next();
                Trigger::Surface {
                    index: index as usize,
                    direction: if orientation < 0.0 {
                        -direction
                    } else {
                        *direction
                    },
                    side: if orientation < 0.0 { -1 } else { 1 },
                }
            }
            _ => return refuse(&reset.place, "this reset is not read here"),
        };
        let (map, is_for_these_values) = traced_map(&setting, reset)?;
        is_pinned |= is_for_these_values;
        actions.push(SavedAction {
            trigger,
            map: Some(map),
            name: reset.name.clone(),
        });
    }
    let system = SavedSystem {
        definition: Definition {
            graph: tracer.graph,
            field: recorded.field,
            names: tracer.names,
            rules: recorded.rules,
        },
        valid_for: is_pinned.then(|| defaults.clone()),
        defaults,
        actions,
    };
    match system.check() {
        Ok(()) => Ok(system),
        Err(error) => refuse(function, error.to_string()),
    }
}

/// Traces, and once more if the sign of a constant of motion was asked for. The second field may have other constants than the
/// first: then none is made use of.
fn with_constants_of_motion(
    new: &impl Fn(Option<Constants>) -> Tracer,
    record: &impl Fn(&mut Tracer) -> Result<Recorded, Refused>,
) -> Result<(Tracer, Recorded), Refused> {
    let mut first = new(None);
    match record(&mut first) {
        Err(refused) if !first.is_doubtful => return Err(refused),
        Err(_) => {}
        Ok(recorded) => {
            let constants = Constants::of(&first.graph, &recorded.field);
            let is_asked = first
                .asked
                .iter()
                .any(|&node| constants.have(&first.graph, node));
            if !first.is_doubtful && !is_asked {
                return Ok((first, recorded));
            }
            let mut second = new(Some(constants));
            let recorded = record(&mut second)?;
            let constants = Constants::of(&second.graph, &recorded.field);
            if Laws::are_of_constants(&second, &constants) {
                return Ok((second, recorded));
            }
        }
    }
    let mut plain = new(Some(Constants::default()));
    let recorded = record(&mut plain)?;
    Ok((plain, recorded))
}

/// The map of a reset, and whether it holds for these values of the parameters only.
fn traced_map(setting: &Setting, reset: &ResetText) -> Result<(Definition, bool), Refused> {
    let constants = Some(Constants::default());
    let mut tracer = Tracer::new(setting.names.clone(), setting.values.clone(), constants);
    let map = &*reset.map;
    let field = setting.explored(&mut tracer, map, setting.n, false)?;
    let (_, rules) = Laws::complete(&mut tracer, &[])?;
    check_questions(&mut tracer, &field, &[], rules.n_hidden)?;
    if tracer.laws.remember() {
        return refuse(map, "a law with a memory in the map of a reset");
    }
    let (is_exact, is_for_these_values) = is_exact_at_an_instant(&tracer, &field);
    if !is_exact {
        let error = "a map that jumps (a sign, a comparison, a floor) is not read here: it needs the values of Python on the jump";
        return refuse(map, error);
    }
    let is_pinned = is_for_these_values || tracer.is_pinned;
    let definition = Definition {
        graph: tracer.graph,
        field,
        names: tracer.names,
        rules,
    };
    Ok((definition, is_pinned))
}

/// The names and the values of the parameters: those given, or the arguments that have a number as default.
fn parameters_of(text: &SystemText) -> Result<(Vec<String>, Vec<f64>), Refused> {
    let function = &*text.function;
    let arguments = function.arguments();
    if arguments.len() < 2 {
        return refuse(function, "the function needs two arguments, t and x");
    }
    let others = arguments.get(2 + text.args.len()..).unwrap_or_default();
    if let Some(given) = &text.parameters {
        if let Some((name, _)) = given.iter().find(|(name, _)| !others.contains(name)) {
            return refuse(
                &text.place,
                format!("{} has no parameter {name}", function.name),
            );
        }
        let others = others
            .iter()
            .filter(|name| !given.iter().any(|(known, _)| known == *name));
        for name in others {
            needs_value(function, name)?;
        }
        return Ok(given.iter().cloned().unzip());
    }
    let mut found = Vec::new();
    for name in others {
        needs_value(function, name)?;
        if let Some(Value::Number { value, .. }) = function.defaults.get(name) {
            found.push((name.clone(), *value));
        }
    }
    Ok(found.into_iter().unzip())
}

fn needs_value(function: &Callable, name: &str) -> Result<(), Refused> {
    if function.defaults.contains_key(name) {
        return Ok(());
    }
    let parameters = &function.parameters;
    let all = parameters.posonlyargs.iter().chain(&parameters.args);
    let mut all = all.chain(&parameters.kwonlyargs);
    let error = format!("{name} needs a value: write {name}=1.0");
    match all.find(|argument| argument.parameter.name.as_str() == name) {
        Some(argument) => refuse(&argument.parameter, error),
        None => refuse(function, error),
    }
}
