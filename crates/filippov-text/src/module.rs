//! A text as a whole: imports, numbers with a name, and the function.

use std::collections::BTreeMap;

use filippov::{Definition, SavedSystem};
use filippov_expr::Names;
use ruff_python_ast::{Expr, Stmt, StmtFunctionDef};

use crate::statements::Reader;
use crate::tracer::Tracer;
use crate::unreadable::{refuse, Refused, Unreadable};
use crate::values::Value;

/// A system that was read from a text.
#[derive(Clone, Debug)]
pub struct TextModel {
    /// The name of the function.
    pub name: String,
    /// The system.
    pub system: SavedSystem,
    /// The numbers with the name `y0` in the text, if it has any.
    pub y0: Option<Vec<f64>>,
    /// The numbers with the name `t_span` in the text, if it has any.
    pub t_span: Option<Vec<f64>>,
}

/// What stands outside of the function.
#[derive(Default)]
pub struct Module {
    /// What a name of a library, or of a function of one, means: `np` is `numpy`, `sin` may be `numpy.sin`.
    pub imported: BTreeMap<String, String>,
    pub values: BTreeMap<String, Value>,
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
    let mut module = Module::default();
    for library in ["numpy", "math"] {
        module.imported.insert(library.into(), library.into());
    }
    module.imported.insert("np".into(), "numpy".into());
    let mut function: Option<&StmtFunctionDef> = None;
    for statement in body {
        match statement {
            Stmt::Import(import) => {
                for alias in &import.names {
                    let local = alias.asname.as_ref().unwrap_or(&alias.name);
                    let name = alias.name.as_str();
                    module.imported.insert(local.to_string(), name.to_owned());
                }
            }
            Stmt::ImportFrom(import) => {
                let library = import.module.as_ref().map_or("", |name| name.as_str());
                for alias in &import.names {
                    let local = alias.asname.as_ref().unwrap_or(&alias.name);
                    let name = format!("{library}.{}", alias.name);
                    module.imported.insert(local.to_string(), name);
                }
            }
            Stmt::FunctionDef(def) if function.is_some() => {
                return refuse(
                    def,
                    "a second function: one function, def f(t, x, ...), is read",
                );
            }
            Stmt::FunctionDef(def) => function = Some(def),
            Stmt::Assign(assign) => {
                let mut tracer = Tracer::default();
                let mut reader = Reader::new(&mut tracer, &module);
                let value = reader.value(&assign.value)?;
                let is_plain = !has_node(&value);
                match (&assign.targets[..], is_plain) {
                    ([Expr::Name(name)], true) => {
                        module.values.insert(name.id.to_string(), value);
                    }
                    _ => return refuse(assign, "outside of the function `name = number` is read"),
                }
            }
            Stmt::Expr(text) if text.value.is_string_literal_expr() => {}
            other => {
                let error = "outside of the function imports and `name = number` are read";
                return refuse(other, error);
            }
        }
    }
    let Some(function) = function else {
        return Err(Refused {
            error: "a function, def f(t, x, ...), is needed".into(),
            at: Default::default(),
        });
    };
    read_function(function, &module)
}

fn has_node(value: &Value) -> bool {
    match value {
        Value::Number { .. } | Value::Truth(_) => false,
        Value::List(items) => items.iter().any(has_node),
        _ => true,
    }
}

fn numbers(value: Option<&Value>) -> Option<Vec<f64>> {
    let Some(Value::List(items)) = value else {
        return None;
    };
    let number = |item: &Value| match item {
        Value::Number { value, .. } => Some(*value),
        _ => None,
    };
    items.iter().map(number).collect()
}

fn read_function(def: &StmtFunctionDef, module: &Module) -> Result<TextModel, Refused> {
    if def.is_async || !def.decorator_list.is_empty() {
        return refuse(def, "a function without decorators, and not async, is read");
    }
    let arguments = &def.parameters;
    if let Some(other) = arguments.vararg.as_deref().or(arguments.kwarg.as_deref()) {
        return refuse(other, "arguments are read one by one, not as * or **");
    }
    let all: Vec<_> = arguments
        .posonlyargs
        .iter()
        .chain(&arguments.args)
        .chain(&arguments.kwonlyargs)
        .collect();
    let [time, state, parameters @ ..] = &all[..] else {
        return refuse(&def.name, "the function needs two arguments, t and x");
    };
    let mut defaults = Vec::with_capacity(parameters.len());
    for parameter in parameters {
        let mut tracer = Tracer::default();
        let mut reader = Reader::new(&mut tracer, module);
        let name = &parameter.parameter.name;
        match &parameter.default {
            Some(default) => match reader.value(default)? {
                Value::Number { value, .. } => defaults.push(value),
                _ => return refuse(&**default, "the default of a parameter is a number"),
            },
            None => {
                let error = format!("{name} needs a value: write {name}=1.0");
                return refuse(&parameter.parameter, error);
            }
        }
    }
    let state_name = state.parameter.name.as_str();
    let states = states_of(&def.body, state_name);
    let n = states.len();
    let mut tracer = Tracer::default();
    let field = tracer.explore(&def.name, |tracer| {
        let time_node = tracer.graph.time();
        let nodes = (0..n as u32).map(|i| Value::Node(tracer.graph.state(i)));
        let state_value = Value::List(nodes.collect());
        let mut reader = Reader::new(tracer, module);
        for (index, parameter) in parameters.iter().enumerate() {
            let node = reader.tracer.graph.parameter(index as u32);
            let name = parameter.parameter.name.to_string();
            reader.names.insert(name, Value::Node(node));
        }
        let time_name = time.parameter.name.to_string();
        reader.names.insert(time_name, Value::Node(time_node));
        reader.names.insert(state_name.to_owned(), state_value);
        reader.field(def, n)
    })?;
    tracer.check_asked(&field)?;
    let is_named = !states.iter().all(String::is_empty);
    let parameter_names = parameters.iter().map(|p| p.parameter.name.to_string());
    let names = Names {
        states: if is_named { states } else { Vec::new() },
        parameters: parameter_names.collect(),
    };
    let definition = Definition {
        graph: tracer.graph,
        field,
        names,
        rules: Default::default(),
    };
    let system = SavedSystem {
        definition,
        defaults,
        ..SavedSystem::default()
    };
    if let Err(error) = system.check() {
        return refuse(&def.name, error.to_string());
    }
    Ok(TextModel {
        name: def.name.to_string(),
        system,
        y0: numbers(module.values.get("y0")),
        t_span: numbers(module.values.get("t_span")),
    })
}

/// The names of the states: those of the first unpacking of the state; else as many empty ones as are indexed.
fn states_of(body: &[Stmt], state: &str) -> Vec<String> {
    for statement in body {
        let Stmt::Assign(assign) = statement else {
            continue;
        };
        let is_state = matches!(&*assign.value, Expr::Name(name) if name.id.as_str() == state);
        let names = assign.targets.iter().find_map(|target| match target {
            Expr::Tuple(tuple) => Some(&tuple.elts[..]),
            Expr::List(list) => Some(&list.elts[..]),
            _ => None,
        });
        if let Some(names) = names.filter(|_| is_state) {
            let name = |target: &Expr| match target {
                Expr::Name(name) => name.id.to_string(),
                _ => String::new(),
            };
            let names: Vec<String> = names.iter().map(name).collect();
            // Names that are no use as such are dropped together, and the number stays.
            let mut sorted: Vec<&String> = names.iter().collect();
            sorted.sort_unstable();
            let is_usable = sorted.windows(2).all(|pair| pair[0] != pair[1]);
            return match is_usable && !names.iter().any(String::is_empty) {
                true => names,
                false => vec![String::new(); names.len()],
            };
        }
    }
    let mut most = 0;
    Indices {
        state,
        most: &mut most,
    }
    .look(body);
    vec![String::new(); most + 1]
}

/// Looks for the largest index of the state.
struct Indices<'a> {
    state: &'a str,
    most: &'a mut usize,
}

impl Indices<'_> {
    fn look(self, body: &[Stmt]) {
        use ruff_python_ast::visitor::Visitor;

        struct Walk<'a>(Indices<'a>);
        impl<'b> Visitor<'b> for Walk<'_> {
            fn visit_expr(&mut self, expression: &'b Expr) {
                if let Expr::Subscript(part) = expression {
                    let is_state = matches!(&*part.value, Expr::Name(name) if name.id.as_str() == self.0.state);
                    if let (true, Some(index)) = (is_state, literal_index(&part.slice)) {
                        *self.0.most = (*self.0.most).max(index);
                    }
                }
                ruff_python_ast::visitor::walk_expr(self, expression);
            }
        }
        Walk(self).visit_body(body);
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
