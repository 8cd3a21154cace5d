//! A text as a whole: imports, numbers and functions with a name, and the model.

use std::collections::BTreeMap;
use std::rc::Rc;

use filippov::SavedSystem;
use filippov_expr::Names;
use ruff_python_ast::visitor::{walk_expr, walk_stmt, Visitor};
use ruff_python_ast::{Decorator, Expr, Stmt, StmtFunctionDef};
use ruff_text_size::Ranged;

use crate::calls::Arguments;
use crate::model::{traced, SystemText};
use crate::reader::Reader;
use crate::statements::{what_it_is, Flow};
use crate::tracer::Tracer;
use crate::unreadable::{refuse, Refused, Unreadable};
use crate::values::{Body, Scope, Value};

/// The function that is the model where there are several.
const MODEL: &str = "rhs";

/// A system that was read from a text.
#[derive(Clone, Debug)]
pub struct TextModel {
    /// The name of the system in the text, or of the function.
    pub name: String,
    /// Whether the text makes a system of the function, by `@fl.system` or `fl.System(...)`.
    pub is_system: bool,
    /// The system.
    pub system: SavedSystem,
    /// The numbers with the name `y0` in the text, if it has any.
    pub y0: Option<Vec<f64>>,
    /// The numbers with the name `t_span` in the text, if it has any.
    pub t_span: Option<Vec<f64>>,
}

/// Reads a text.
///
/// # Errors
/// If it has something that is not read: what, and where.
pub fn read(source: &str) -> Result<TextModel, Unreadable> {
    let parsed = ruff_python_parser::parse_module(source).map_err(|error| {
        let refused = Refused {
            error: error.error.to_string(),
            at: error.location.start(),
        };
        refused.placed(source)
    })?;
    let found = read_module(parsed.suite());
    found.map_err(|refused| refused.placed(source))
}

fn read_module(body: &[Stmt]) -> Result<TextModel, Refused> {
    let mut imported = BTreeMap::new();
    for (name, library) in [("numpy", "numpy"), ("np", "numpy"), ("math", "math")] {
        imported.insert(name.to_owned(), library.to_owned());
    }
    note_imports(body, &mut imported);
    let scope = Rc::new(Scope::default());
    // Outside of functions nothing depends on the state.
    let mut tracer = Tracer::new(Names::default(), Vec::new(), None);
    let mut reader = Reader::new(&mut tracer, &imported, Rc::clone(&scope));
    reader.is_outside = true;
    // As in an imported module: nothing under `if __name__ == "__main__"` is run.
    scope.set("__name__", Value::Text("model".into()));
    let mut functions: Vec<String> = Vec::new();
    let mut places = BTreeMap::new();
    for statement in body {
        match statement {
            Stmt::Import(_) | Stmt::ImportFrom(_) => {}
            Stmt::FunctionDef(def) => {
                let (name, value) = read_function(&mut reader, def)?;
                if let Value::Function(_) = &value {
                    functions.push(name.clone());
                }
                scope.set(&name, value);
            }
            Stmt::Assign(_) | Stmt::AnnAssign(_) => {
                reader.run(std::slice::from_ref(statement))?;
                if let Some(name) = assigned(statement) {
                    places.insert(name.clone(), statement.range());
                    if let Some(Value::Function(_)) = scope.get(&name) {
                        functions.push(name);
                    }
                }
            }
            Stmt::AugAssign(_) | Stmt::For(_) | Stmt::If(_) | Stmt::Pass(_) => {
                match reader.run(std::slice::from_ref(statement))? {
                    Flow::Next => {}
                    _ => return refuse(statement, what_it_is(statement)),
                }
            }
            Stmt::Expr(text) if text.value.is_string_literal_expr() => {}
            other => {
                let error =
                    "outside of the function imports, numbers and functions with a name are read";
                return refuse(other, error);
            }
        }
    }
    scope.names.borrow().values().for_each(Value::fix);
    let numbers = |name: &str| numbers(scope.get(name).as_ref());
    let (y0, t_span) = (numbers("y0"), numbers("t_span"));
    let (name, system, is_system) = chosen(&scope, &functions)?;
    let function = &system.function;
    let (n, states) = match (system.n, system.states.len()) {
        (Some(n), 0) => (n, Vec::new()),
        (None, 0) => {
            let arguments = function.arguments();
            let state = arguments.get(1).map_or("x", String::as_str);
            let own = match &function.body {
                Body::Statements(body) => unpacked(body, state),
                Body::Expression(_) => None,
            };
            match (own, &y0) {
                (Some(own), _) if own.iter().all(String::is_empty) => (own.len(), Vec::new()),
                (Some(own), _) => (own.len(), own),
                (None, Some(y0)) => (y0.len(), Vec::new()),
                (None, None) => (count_states(&function.body, state), Vec::new()),
            }
        }
        (n, count) if n.is_none_or(|n| n == count) => (count, system.states.clone()),
        _ => {
            return refuse(
                &system.place,
                "n is not the number of the names of the states",
            )
        }
    };
    if let Some(place) = places.get("y0") {
        let given = y0.as_ref().map(Vec::len);
        if given != Some(n) {
            let found = given.map_or("no list of numbers".to_owned(), |given| given.to_string());
            return refuse(
                place,
                format!("y0 needs {n} numbers, one for each state; there are {found}"),
            );
        }
    }
    if let Some(place) = places.get("t_span") {
        if !matches!(t_span.as_deref(), Some([from, to]) if from != to) {
            return refuse(place, "t_span needs two different times");
        }
    }
    Ok(TextModel {
        name,
        is_system,
        system: traced(&system, &imported, n, states)?,
        y0,
        t_span,
    })
}

/// What names mean that are imported, in the whole text.
fn note_imports(body: &[Stmt], imported: &mut BTreeMap<String, String>) {
    for statement in body {
        match statement {
            Stmt::Import(import) => {
                for alias in &import.names {
                    let name = alias.name.as_str();
                    match &alias.asname {
                        Some(local) => imported.insert(local.to_string(), name.to_owned()),
                        None => {
                            let first = name.split('.').next().unwrap_or(name);
                            imported.insert(first.to_owned(), first.to_owned())
                        }
                    };
                }
            }
            Stmt::ImportFrom(import) => {
                let library = import.module.as_ref().map_or("", |name| name.as_str());
                for alias in &import.names {
                    let local = alias.asname.as_ref().unwrap_or(&alias.name);
                    let name = format!("{library}.{}", alias.name);
                    imported.insert(local.to_string(), name);
                }
            }
            _ => {}
        }
    }
}

/// The name that an assignment binds, if it is a single one.
fn assigned(statement: &Stmt) -> Option<String> {
    let target = match statement {
        Stmt::Assign(assign) => match &assign.targets[..] {
            [target] => target,
            _ => return None,
        },
        Stmt::AnnAssign(assign) => &*assign.target,
        _ => return None,
    };
    target.as_name_expr().map(|name| name.id.to_string())
}

/// A function, or the system that a decorator makes of it.
fn read_function(reader: &mut Reader, def: &StmtFunctionDef) -> Result<(String, Value), Refused> {
    let function = Rc::new(reader.callable(def)?);
    let name = def.name.to_string();
    match &def.decorator_list[..] {
        [] => Ok((name, Value::Function(function))),
        [decorator] => {
            let arguments = decorator_arguments(reader, decorator)?;
            let system = reader.decorated(&def.name, function, arguments)?;
            Ok((name, Value::System(Rc::new(system))))
        }
        _ => refuse(def, "one decorator, @fl.system, is read"),
    }
}

fn decorator_arguments(reader: &mut Reader, decorator: &Decorator) -> Result<Arguments, Refused> {
    let (function, keywords) = match &decorator.expression {
        Expr::Call(call) => (&*call.func, &call.arguments.keywords[..]),
        function => (function, &[][..]),
    };
    if reader.name_in_library(function).as_deref() != Some("filippov.system") {
        return refuse(
            decorator,
            "a decorator other than @fl.system is not read here",
        );
    }
    let mut named = BTreeMap::new();
    for keyword in keywords {
        if let Some(name) = &keyword.arg {
            named.insert(name.to_string(), reader.value(&keyword.value)?);
        }
    }
    Ok(Arguments {
        given: Vec::new(),
        named,
    })
}

/// The model of the text: its only system, or the function with the name `rhs`, or its last function. And whether it is a system.
fn chosen(scope: &Scope, functions: &[String]) -> Result<(String, Rc<SystemText>, bool), Refused> {
    let names = scope.names.borrow();
    let system = |(name, value): (&String, &Value)| match value {
        Value::System(system) => Some((name.clone(), Rc::clone(system))),
        _ => None,
    };
    let mut systems: Vec<_> = names.iter().filter_map(system).collect();
    systems.sort_by_key(|(_, system)| system.place.start());
    match &systems[..] {
        [(name, system)] => return Ok((name.clone(), Rc::clone(system), true)),
        [] => {}
        [.., (_, last)] => return refuse(&last.place, "the text has several systems"),
    }
    let is_model = |name: &&String| matches!(scope.get(name), Some(Value::Function(function)) if function.arguments().len() >= 2);
    let named = functions.iter().find(|name| *name == MODEL);
    match named
        .or_else(|| functions.iter().rev().find(is_model))
        .or(functions.last())
    {
        Some(name) => match scope.get(name) {
            Some(Value::Function(function)) => {
                Ok((name.clone(), Rc::new(SystemText::of(function)), false))
            }
            _ => refuse(
                &ruff_text_size::TextRange::default(),
                "a function is needed",
            ),
        },
        None => Err(Refused {
            error: "a function, def f(t, x, ...), is needed".into(),
            at: Default::default(),
        }),
    }
}

fn numbers(value: Option<&Value>) -> Option<Vec<f64>> {
    let items = match value? {
        Value::List(list) => list.items(),
        Value::Array(array) => array.items.borrow().clone(),
        _ => return None,
    };
    items.iter().map(Value::number).collect()
}

/// The names of the states in the first unpacking of the state: empty ones if they are no use as such.
fn unpacked(body: &[Stmt], state: &str) -> Option<Vec<String>> {
    for statement in body {
        let mut binding = Binding {
            name: state,
            is_found: false,
        };
        binding.visit_stmt(statement);
        let Stmt::Assign(assign) = statement else {
            match binding.is_found {
                true => return None,
                false => continue,
            }
        };
        let is_state = matches!(&*assign.value, Expr::Name(name) if name.id.as_str() == state);
        let names = assign.targets.iter().find_map(|target| match target {
            Expr::Tuple(tuple) => Some(&tuple.elts[..]),
            Expr::List(list) => Some(&list.elts[..]),
            _ => None,
        });
        let has_rest = |names: &&[Expr]| names.iter().any(Expr::is_starred_expr);
        if let Some(names) = names.filter(|names| is_state && !has_rest(names)) {
            let name = |target: &Expr| match target {
                Expr::Name(name) => name.id.to_string(),
                _ => String::new(),
            };
            let names: Vec<String> = names.iter().map(name).collect();
            let mut sorted: Vec<&String> = names.iter().collect();
            sorted.sort_unstable();
            let is_usable = sorted.windows(2).all(|pair| pair[0] != pair[1]);
            return Some(match is_usable && !names.iter().any(String::is_empty) {
                true => names,
                false => vec![String::new(); names.len()],
            });
        }
        // From here on the name stands for something else than the state.
        if binding.is_found {
            return None;
        }
    }
    None
}

/// Looks for an assignment to a name.
struct Binding<'a> {
    name: &'a str,
    is_found: bool,
}

impl<'b> Visitor<'b> for Binding<'_> {
    fn visit_expr(&mut self, expression: &'b Expr) {
        if let Expr::Name(name) = expression {
            self.is_found |= !name.ctx.is_load() && name.id.as_str() == self.name;
        }
        walk_expr(self, expression);
    }
}

/// Counts the states of a function that does not unpack them: as many as are returned in the first list or tuple, and as many as
/// are indexed if there is none.
fn count_states(body: &Body, state: &str) -> usize {
    let mut counting = Counting {
        state,
        largest: 0,
        returned: None,
    };
    match body {
        Body::Statements(body) => counting.visit_body(body),
        Body::Expression(body) => {
            counting.returned = entries(body);
            counting.visit_expr(body);
        }
    }
    counting.returned.unwrap_or(counting.largest + 1)
}

struct Counting<'a> {
    state: &'a str,
    largest: usize,
    returned: Option<usize>,
}

impl<'b> Visitor<'b> for Counting<'_> {
    fn visit_stmt(&mut self, statement: &'b Stmt) {
        if let (Stmt::Return(found), None) = (statement, self.returned) {
            self.returned = found.value.as_deref().and_then(entries);
        }
        walk_stmt(self, statement);
    }

    fn visit_expr(&mut self, expression: &'b Expr) {
        if let Expr::Subscript(part) = expression {
            let is_state =
                matches!(&*part.value, Expr::Name(name) if name.id.as_str() == self.state);
            if let (true, Some(index)) = (is_state, literal_index(&part.slice)) {
                self.largest = self.largest.max(index);
            }
        }
        walk_expr(self, expression);
    }
}

/// The number of entries of a tuple, a list, or an array of one.
fn entries(value: &Expr) -> Option<usize> {
    let count = |items: &[Expr]| {
        let has_rest = items.iter().any(Expr::is_starred_expr);
        (!has_rest).then_some(items.len())
    };
    match value {
        Expr::Tuple(tuple) => count(&tuple.elts),
        Expr::List(list) => count(&list.elts),
        Expr::Call(call) => call.arguments.args.first().and_then(|first| match first {
            Expr::Tuple(_) | Expr::List(_) => entries(first),
            _ => None,
        }),
        _ => None,
    }
}

fn literal_index(slice: &Expr) -> Option<usize> {
    match slice {
        Expr::NumberLiteral(literal) => match &literal.value {
            ruff_python_ast::Number::Int(value) => value.as_usize(),
            _ => None,
        },
        _ => None,
    }
}
