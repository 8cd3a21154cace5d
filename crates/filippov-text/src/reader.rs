//! What reads a part of the text: names, and the tracer that receives the expressions.

use std::collections::BTreeMap;
use std::rc::Rc;

use filippov_expr::NodeId;
use ruff_python_ast::{Expr, ExprLambda, Parameters, StmtFunctionDef};
use ruff_text_size::Ranged;

use crate::statements::Flow;
use crate::tracer::Tracer;
use crate::unreadable::{refuse, Refused};
use crate::values::{Body, Callable, Scope, Value};

/// Calls within calls: a function that calls itself has no end here.
const MOST_CALLS: usize = 50;
/// Statements and turns of loops in one call of the model.
const MOST_TURNS: usize = 200_000;

/// Reads statements and expressions.
pub struct Reader<'a> {
    pub tracer: &'a mut Tracer,
    /// What a name of a library, or of a function of one, means: `np` is `numpy`, `sin` may be `numpy.sin`.
    pub imported: &'a BTreeMap<String, String>,
    pub scope: Rc<Scope>,
    /// Whether this is the text outside of all functions.
    pub is_outside: bool,
    n_calls: usize,
    n_turns: usize,
}

impl<'a> Reader<'a> {
    pub fn new(
        tracer: &'a mut Tracer,
        imported: &'a BTreeMap<String, String>,
        scope: Rc<Scope>,
    ) -> Self {
        Reader {
            tracer,
            imported,
            scope,
            is_outside: false,
            n_calls: 0,
            n_turns: 0,
        }
    }

    /// Counts a turn of a loop, or a statement.
    pub fn take_turn(&mut self, part: &impl Ranged) -> Result<(), Refused> {
        self.n_turns += 1;
        match self.n_turns > MOST_TURNS {
            true => refuse(part, "this takes too long to be read"),
            false => Ok(()),
        }
    }

    /// A function, with the values of its defaults.
    pub fn callable(&mut self, def: &StmtFunctionDef) -> Result<Callable, Refused> {
        if def.is_async {
            return refuse(def, "an async function is not read here");
        }
        Ok(Callable {
            name: def.name.to_string(),
            defaults: self.defaults(&def.parameters)?,
            parameters: (*def.parameters).clone(),
            body: Body::Statements(def.body.to_vec()),
            scope: Rc::clone(&self.scope),
            range: def.name.range(),
        })
    }

    /// A function without a name.
    pub fn lambda(&mut self, lambda: &ExprLambda) -> Result<Callable, Refused> {
        let parameters = lambda.parameters.as_deref().cloned().unwrap_or_default();
        Ok(Callable {
            name: "<lambda>".into(),
            defaults: self.defaults(&parameters)?,
            parameters,
            body: Body::Expression((*lambda.body).clone()),
            scope: Rc::clone(&self.scope),
            range: lambda.range(),
        })
    }

    fn defaults(&mut self, parameters: &Parameters) -> Result<BTreeMap<String, Value>, Refused> {
        let vararg = parameters.vararg.as_deref();
        if let Some(other) = vararg.or(parameters.kwarg.as_deref()) {
            return refuse(other, "arguments are read one by one, not as * or **");
        }
        let mut found = BTreeMap::new();
        let all = parameters.posonlyargs.iter().chain(&parameters.args);
        for parameter in all.chain(&parameters.kwonlyargs) {
            if let Some(default) = &parameter.default {
                let value = self.value(default)?;
                value.fix();
                found.insert(parameter.parameter.name.to_string(), value);
            }
        }
        Ok(found)
    }

    /// What a function of the text returns for these arguments.
    pub fn call_own(
        &mut self,
        part: &impl Ranged,
        function: &Callable,
        given: Vec<Value>,
        mut named: BTreeMap<String, Value>,
    ) -> Result<Value, Refused> {
        let names = function.arguments();
        let n_by_place = names.len() - function.parameters.kwonlyargs.len();
        if given.len() > n_by_place {
            let error = format!("{} takes {n_by_place} arguments", function.name);
            return refuse(part, error);
        }
        let scope = Scope::inside(&function.scope);
        let mut given = given.into_iter();
        for (index, name) in names.iter().enumerate() {
            let by_place = if index < n_by_place {
                given.next()
            } else {
                None
            };
            let by_name = named.remove(name);
            if by_place.is_some() && by_name.is_some() {
                return refuse(part, format!("{} gets {name} twice", function.name));
            }
            let default = function.defaults.get(name).cloned();
            match by_place.or(by_name).or(default) {
                Some(value) => scope.set(name, value),
                None => return refuse(part, format!("{} needs {name}", function.name)),
            }
        }
        if let Some(name) = named.keys().next() {
            return refuse(part, format!("{} has no argument {name}", function.name));
        }
        if self.n_calls >= MOST_CALLS {
            return refuse(part, "functions that call themselves are not read here");
        }
        self.n_calls += 1;
        let around = std::mem::replace(&mut self.scope, scope);
        let is_outside = std::mem::replace(&mut self.is_outside, false);
        let found = match &function.body {
            Body::Expression(body) => self.value(body),
            Body::Statements(body) => match self.run(body) {
                Ok(Flow::Return(value)) => Ok(value),
                Ok(_) => Ok(Value::Nothing),
                Err(refused) => Err(refused),
            },
        };
        self.scope = around;
        self.is_outside = is_outside;
        self.n_calls -= 1;
        found
    }

    /// The node of a number.
    pub fn node(&mut self, part: &impl Ranged, value: &Value) -> Result<NodeId, Refused> {
        match value {
            Value::Node(node) => Ok(*node),
            Value::Number { value, .. } => Ok(self.tracer.graph.constant(*value)),
            Value::Truth(holds) => Ok(self.tracer.graph.constant(f64::from(u8::from(*holds)))),
            Value::Condition(condition) => {
                let (one, zero) = (
                    self.tracer.graph.constant(1.0),
                    self.tracer.graph.constant(0.0),
                );
                Ok(self.tracer.choose(condition, one, zero))
            }
            Value::List(_) | Value::Array(_) => {
                refuse(part, "a number is needed, this is a list or an array")
            }
            Value::Nothing => refuse(part, "a number is needed, this is None"),
            _ => refuse(part, "a number is needed"),
        }
    }

    /// The nodes of what a function of n numbers returned.
    pub fn nodes(
        &mut self,
        part: &impl Ranged,
        value: &Value,
        n: usize,
    ) -> Result<Vec<NodeId>, Refused> {
        let values = match value {
            Value::List(list) => list.items(),
            Value::Array(array) if array.shape.len() == 1 => array.items.borrow().clone(),
            Value::Nothing => {
                return refuse(part, "the function returns nothing: is a `return` missing?")
            }
            single => vec![single.clone()],
        };
        if values.len() != n {
            let error = format!(
                "{} values are returned for {n} states: write the start above, y0 = [...]",
                values.len()
            );
            return refuse(part, error);
        }
        values.iter().map(|value| self.node(part, value)).collect()
    }

    /// What a dotted name means, if a library has it: `np.sin` is `numpy.sin`.
    pub fn name_in_library(&self, expression: &Expr) -> Option<String> {
        match expression {
            Expr::Name(name) => {
                let name = name.id.as_str();
                let is_own = self.scope.get(name).is_some();
                self.imported.get(name).filter(|_| !is_own).cloned()
            }
            Expr::Attribute(part) => {
                let of = self.name_in_library(&part.value)?;
                Some(format!("{of}.{}", part.attr))
            }
            _ => None,
        }
    }
}
