//! Calls: functions of the text, of Python, of the package, and methods of arrays and lists.

use std::collections::BTreeMap;
use std::rc::Rc;

use filippov_expr::NodeId;
use ruff_python_ast::{CmpOp, Expr, ExprAttribute, ExprCall, Operator, UnaryOp as Sign};
use ruff_text_size::Ranged;

use crate::arrays::{array_of, items_of};
use crate::laws::Laws;
use crate::reader::Reader;
use crate::unreadable::{refuse, Refused};
use crate::values::{Array, OwnLaw, Value};

/// Most entries of a list or an array that the text makes.
pub const MOST_ENTRIES: usize = 100_000;

/// The arguments of a call.
pub struct Arguments {
    pub given: Vec<Value>,
    pub named: BTreeMap<String, Value>,
}

impl Arguments {
    /// The arguments with these names, by place or by name; other names are refused.
    pub fn by_names<const N: usize>(
        mut self,
        part: &impl Ranged,
        function: &str,
        names: [&str; N],
    ) -> Result<[Option<Value>; N], Refused> {
        if self.given.len() > N {
            return refuse(
                part,
                format!("{function} is read with {N} arguments at most"),
            );
        }
        let mut given = self.given.into_iter();
        let found = names.map(|name| given.next().or_else(|| self.named.remove(name)));
        match self.named.keys().next() {
            Some(name) => refuse(
                part,
                format!("the keyword {name} of {function} is not read here"),
            ),
            None => Ok(found),
        }
    }
}

const BUILTINS: [&str; 17] = [
    "abs",
    "all",
    "any",
    "enumerate",
    "float",
    "int",
    "len",
    "list",
    "max",
    "min",
    "pow",
    "range",
    "reversed",
    "round",
    "sum",
    "tuple",
    "zip",
];

impl Reader<'_> {
    pub fn call(&mut self, call: &ExprCall) -> Result<Value, Refused> {
        if let Some(function) = self.name_in_library(&call.func) {
            let arguments = self.arguments(call)?;
            return match function.strip_prefix("filippov.numpy.") {
                Some(name) => {
                    let visible = self.made_visible(call, arguments)?;
                    self.numpy(call, &format!("numpy.{name}"), visible)
                }
                None if function.starts_with("filippov.") => {
                    self.package(call, &function, arguments)
                }
                None => self.numpy(call, &function, arguments),
            };
        }
        match &*call.func {
            Expr::Name(name) => match self.scope.get(name.id.as_str()) {
                Some(value) => {
                    let arguments = self.arguments(call)?;
                    self.call_value(call, &value, arguments)
                }
                None if BUILTINS.contains(&name.id.as_str()) => {
                    self.builtin(call, name.id.as_str())
                }
                None => refuse(call, format!("the function {} is not read here", name.id)),
            },
            Expr::Attribute(part) => self.method(call, part),
            function => {
                let value = self.value(function)?;
                let arguments = self.arguments(call)?;
                self.call_value(call, &value, arguments)
            }
        }
    }

    fn arguments(&mut self, call: &ExprCall) -> Result<Arguments, Refused> {
        let given = self.listed(&call.arguments.args)?;
        let mut named = BTreeMap::new();
        for keyword in &call.arguments.keywords {
            let Some(name) = &keyword.arg else {
                return refuse(keyword, "** in a call is not read here");
            };
            named.insert(name.to_string(), self.value(&keyword.value)?);
        }
        Ok(Arguments { given, named })
    }

    /// The functions of `filippov.numpy` see what is inside of lists and arrays.
    fn made_visible(
        &mut self,
        part: &impl Ranged,
        mut arguments: Arguments,
    ) -> Result<Arguments, Refused> {
        for value in &mut arguments.given {
            if matches!(value, Value::List(_) | Value::Array(_)) {
                let array = array_of(part, value)?;
                let is_traced = !array.is_of_numbers();
                let items = array.items.borrow().clone();
                *value = Value::Array(Array::new(array.shape.clone(), items, is_traced));
            }
        }
        Ok(arguments)
    }

    pub fn call_value(
        &mut self,
        part: &ExprCall,
        function: &Value,
        arguments: Arguments,
    ) -> Result<Value, Refused> {
        match function {
            Value::Function(own) => self.call_own(part, own, arguments.given, arguments.named),
            Value::Law(law) => match &**law {
                OwnLaw::Hysteresis {
                    function,
                    low,
                    high,
                    initial,
                } => {
                    let value = self.call_value(part, function, arguments)?;
                    self.hysteresis(part, [&value, low, high, initial])
                }
                OwnLaw::Stick { function, ratio } => {
                    let given = Arguments {
                        given: arguments.given.clone(),
                        named: BTreeMap::new(),
                    };
                    let speed = self.call_value(part, function, arguments)?;
                    let ratio = match ratio {
                        Value::Function(_) => self.call_value(part, ratio, given)?,
                        number => number.clone(),
                    };
                    self.stick(part, &speed, &ratio)
                }
            },
            _ => refuse(part, "a call of something that is no function"),
        }
    }

    // --------------------------------------------------------------- of Python

    fn builtin(&mut self, call: &ExprCall, name: &str) -> Result<Value, Refused> {
        if let ("sum" | "any" | "all", [values]) = (name, &*call.arguments.args) {
            return match name {
                "sum" => {
                    let mut total = Value::whole(0.0);
                    self.for_each(values, &mut |reader, item| {
                        total = reader.operation(call, Operator::Add, &total, &item)?;
                        Ok(())
                    })?;
                    Ok(total)
                }
                _ => {
                    let is_any = name == "any";
                    let mut found = !is_any;
                    let listed = self.value(values)?;
                    for item in items_of(values, &listed)? {
                        found = self.truth(values, &item)?;
                        if found == is_any {
                            break;
                        }
                    }
                    Ok(Value::Truth(found))
                }
            };
        }
        let arguments = self.arguments(call)?;
        let is_strict_alone = arguments.named.keys().all(|name| name == "strict");
        if name == "zip" && is_strict_alone {
            let lists = arguments.given.iter().map(|list| items_of(call, list));
            let lists = lists.collect::<Result<Vec<_>, _>>()?;
            let count = lists.iter().map(Vec::len).min().unwrap_or(0);
            let row = |k: usize| Value::tuple(lists.iter().map(|list| list[k].clone()).collect());
            return Ok(Value::list((0..count).map(row).collect()));
        }
        let start = arguments.named.get("start").cloned();
        if arguments
            .named
            .keys()
            .any(|key| name != "enumerate" || key != "start")
        {
            return refuse(call, format!("a keyword of {name} is not read here"));
        }
        let whole = |value: &Value| match value {
            Value::Number {
                value,
                is_whole: true,
            } => Ok(*value as i64),
            _ => refuse(call, format!("{name} is read with whole numbers")),
        };
        match (name, &arguments.given[..]) {
            ("abs", [value]) => self.by_element(value, &mut |reader, item| {
                reader.function_of_one(call, "abs", item)
            }),
            ("pow", [a, b]) => self.operation(call, Operator::Pow, a, b),
            ("len", [value]) => Ok(Value::whole(items_of(call, value)?.len() as f64)),
            ("sum", [values, first]) => {
                let items = items_of(call, values)?.into_iter();
                let mut items = items;
                items.try_fold(first.clone(), |total, item| {
                    self.operation(call, Operator::Add, &total, &item)
                })
            }
            ("max" | "min", [values]) => {
                let items = items_of(call, values)?;
                self.best_of(call, name, &items)
            }
            ("max" | "min", items @ [_, _, ..]) => self.best_of(call, name, items),
            ("range", [stop]) => range_of(call, 0, whole(stop)?, 1),
            ("range", [start, stop]) => range_of(call, whole(start)?, whole(stop)?, 1),
            ("range", [start, stop, step]) => {
                range_of(call, whole(start)?, whole(stop)?, whole(step)?)
            }
            ("enumerate", [values, rest @ ..]) if rest.len() < 2 => {
                let first = match start.as_ref().or(rest.first()) {
                    Some(first) => whole(first)?,
                    None => 0,
                };
                let items = items_of(call, values)?.into_iter();
                let pairs = (first..).zip(items);
                let pair = |(k, item)| Value::tuple(vec![Value::whole(k as f64), item]);
                Ok(Value::list(pairs.map(pair).collect()))
            }
            ("reversed", [values]) => {
                let mut items = items_of(call, values)?;
                items.reverse();
                Ok(Value::list(items))
            }
            ("list", [values]) => Ok(Value::list(items_of(call, values)?)),
            ("tuple", [values]) => Ok(Value::tuple(items_of(call, values)?)),
            ("float", [Value::Number { value, .. }]) => Ok(Value::float(*value)),
            ("float", [value @ Value::Node(_)]) => Ok(value.clone()),
            ("int", [Value::Number { value, .. }]) => Ok(Value::whole(value.trunc())),
            ("int", [value @ Value::Node(_)]) => self.function_of_one(call, "numpy.trunc", value),
            ("round", [Value::Number { value, .. }]) => Ok(Value::whole(value.round_ties_even())),
            ("round", [value @ Value::Node(_)]) => self.function_of_one(call, "numpy.rint", value),
            _ => {
                let count = arguments.given.len();
                refuse(
                    call,
                    format!("{name} with {count} such arguments is not read here"),
                )
            }
        }
    }

    /// The largest or the smallest value, as Python finds it: by asking.
    fn best_of(&mut self, call: &ExprCall, name: &str, items: &[Value]) -> Result<Value, Refused> {
        let op = if name == "max" { CmpOp::Gt } else { CmpOp::Lt };
        let Some((first, others)) = items.split_first() else {
            return refuse(call, format!("{name} of nothing"));
        };
        let mut best = first.clone();
        for other in others {
            let is_better = self.compared(call, op, other, &best)?;
            if self.truth(call, &is_better)? {
                best = other.clone();
            }
        }
        Ok(best)
    }

    // ----------------------------------------------------------------- methods

    /// Runs `list.append(value)`; false if the call is another one.
    pub fn appends(&mut self, call: &ExprCall) -> Result<bool, Refused> {
        let (Expr::Attribute(part), [value]) = (&*call.func, &*call.arguments.args) else {
            return Ok(false);
        };
        if part.attr.as_str() != "append" || self.name_in_library(&call.func).is_some() {
            return Ok(false);
        }
        let Value::List(list) = self.value(&part.value)? else {
            return Ok(false);
        };
        if list.is_fixed.get() {
            return refuse(
                call,
                "only a list that is made in the function can be changed",
            );
        }
        let value = self.value(value)?;
        list.items.borrow_mut().push(value);
        Ok(true)
    }

    fn method(&mut self, call: &ExprCall, part: &ExprAttribute) -> Result<Value, Refused> {
        let owner = self.value(&part.value)?;
        let mut arguments = self.arguments(call)?;
        let name = part.attr.as_str();
        match (&owner, name, arguments.given.len()) {
            (
                Value::Array(_),
                "sum" | "prod" | "mean" | "max" | "min" | "dot" | "round" | "clip",
                _,
            )
            | (Value::Array(_), "copy" | "tolist", 0)
            | (Value::Node(_), "clip" | "round", _) => {
                arguments.given.insert(0, owner);
                self.numpy(call, &format!("numpy.{name}"), arguments)
            }
            (Value::Dict(pairs), "values", 0) => {
                let values = pairs.iter().rev().map(|(_, value)| value.clone());
                Ok(Value::list(values.collect()))
            }
            (Value::Dict(pairs), "keys", 0) => Ok(Value::list(
                pairs.iter().rev().map(|(key, _)| key.clone()).collect(),
            )),
            (Value::Dict(pairs), "items", 0) => {
                let pair =
                    |(key, value): &(Value, Value)| Value::tuple(vec![key.clone(), value.clone()]);
                Ok(Value::list(pairs.iter().rev().map(pair).collect()))
            }
            _ => refuse(call, format!("the method {name} is not read here")),
        }
    }

    /// `array.T` and `array.shape`.
    pub fn attribute(&mut self, part: &ExprAttribute) -> Result<Value, Refused> {
        let owner = self.value(&part.value)?;
        match (&owner, part.attr.as_str()) {
            (Value::Array(array), "T") => Ok(transposed(array)),
            (Value::Array(array), "shape") => {
                let shape = array.shape.iter().map(|&n| Value::whole(n as f64));
                Ok(Value::tuple(shape.collect()))
            }
            (Value::Array(array), "size") => {
                Ok(Value::whole(array.shape.iter().product::<usize>() as f64))
            }
            (_, name) => refuse(part, format!("the attribute {name} is not read here")),
        }
    }

    // ---------------------------------------------------------- of the package

    fn package(
        &mut self,
        call: &ExprCall,
        function: &str,
        arguments: Arguments,
    ) -> Result<Value, Refused> {
        let name = function.rsplit('.').next().unwrap_or(function);
        match name {
            "sawtooth" => {
                let [t, period] = self.needed(call, name, arguments, ["t", "period"])?;
                let phase = self.operation(call, Operator::Div, &t, &period)?;
                let whole = self.floor(call, &phase)?;
                self.operation(call, Operator::Sub, &phase, &whole)
            }
            "square" => {
                let [t, period, duty] = arguments.by_names(call, name, ["t", "period", "duty"])?;
                let (Some(t), Some(period)) = (t, period) else {
                    return refuse(call, "square needs t and a period");
                };
                let duty = duty.unwrap_or_else(|| Value::float(0.5));
                let phase = self.operation(call, Operator::Div, &t, &period)?;
                let first = self.floor(call, &phase)?;
                let shifted = self.operation(call, Operator::Sub, &phase, &duty)?;
                let second = self.floor(call, &shifted)?;
                let between = self.operation(call, Operator::Sub, &first, &second)?;
                let double = self.operation(call, Operator::Mult, &Value::float(2.0), &between)?;
                self.operation(call, Operator::Sub, &double, &Value::float(1.0))
            }
            "hysteresis" | "Hysteresis" => {
                let names = ["value", "low", "high", "initial"];
                let names = match name {
                    "Hysteresis" => ["h", "low", "high", "initial"],
                    _ => names,
                };
                let [value, low, high, initial] = arguments.by_names(call, name, names)?;
                let (Some(value), Some(low), Some(high)) = (value, low, high) else {
                    return refuse(call, format!("{name} needs a value, low and high"));
                };
                let initial = initial.unwrap_or_else(|| Value::whole(-1.0));
                if name == "hysteresis" {
                    return self.hysteresis(call, [&value, &low, &high, &initial]);
                }
                Ok(Value::Law(Rc::new(OwnLaw::Hysteresis {
                    function: value,
                    low,
                    high,
                    initial,
                })))
            }
            "stick" => {
                let [speed, ratio] = self.needed(call, name, arguments, ["v", "static"])?;
                self.stick(call, &speed, &ratio)
            }
            "Stick" => {
                let [function, ratio] = self.needed(call, name, arguments, ["v", "static"])?;
                Ok(Value::Law(Rc::new(OwnLaw::Stick { function, ratio })))
            }
            "Reset" => Ok(Value::Reset(Rc::new(self.reset(call, arguments)?))),
            "System" => Ok(Value::System(Rc::new(self.system(call, arguments)?))),
            _ => refuse(call, format!("{function} is not read here")),
        }
    }

    fn needed<const N: usize>(
        &mut self,
        call: &ExprCall,
        function: &str,
        arguments: Arguments,
        names: [&str; N],
    ) -> Result<[Value; N], Refused> {
        let found = arguments.by_names(call, function, names)?;
        if found.iter().any(Option::is_none) {
            return refuse(call, format!("{function} needs {}", names.join(", ")));
        }
        Ok(found.map(|value| value.unwrap_or(Value::Nothing)))
    }

    fn traced_node(
        &mut self,
        call: &ExprCall,
        value: &Value,
        what: &str,
    ) -> Result<NodeId, Refused> {
        match value {
            Value::Node(node) => Ok(*node),
            _ => refuse(call, format!("{what} of a number is not read here")),
        }
    }

    fn hysteresis(
        &mut self,
        call: &ExprCall,
        [value, low, high, initial]: [&Value; 4],
    ) -> Result<Value, Refused> {
        let Some(initial) = initial.number().filter(|side| side.abs() == 1.0) else {
            return refuse(call, "initial: -1 or 1 is needed");
        };
        if let (Some(low), Some(high)) = (low.number(), high.number()) {
            if low >= high {
                return refuse(call, "low must be below high");
            }
        }
        let node = self.traced_node(call, value, "a relay")?;
        let bounds = [self.node(call, low)?, self.node(call, high)?];
        self.tracer.place = call.range();
        Ok(Value::Node(Laws::hysteresis(
            self.tracer,
            node,
            bounds,
            initial,
        )))
    }

    fn stick(&mut self, call: &ExprCall, speed: &Value, ratio: &Value) -> Result<Value, Refused> {
        if ratio
            .number()
            .is_some_and(|ratio| !(1.0..f64::INFINITY).contains(&ratio))
        {
            return refuse(call, "static: a ratio of at least 1 is needed");
        }
        let node = self.traced_node(call, speed, "static friction")?;
        let ratio = self.node(call, ratio)?;
        self.tracer.place = call.range();
        Ok(Value::Node(Laws::stick(self.tracer, node, ratio)?))
    }

    /// The opposite of a comparison.
    pub fn opposite(&mut self, part: &impl Ranged, value: &Value) -> Result<Value, Refused> {
        match value {
            Value::Truth(holds) => Ok(Value::Truth(!holds)),
            other => self.signed(part, Sign::Invert, other),
        }
    }
}

fn range_of(part: &impl Ranged, start: i64, stop: i64, step: i64) -> Result<Value, Refused> {
    let mut items = Vec::new();
    let mut at = start;
    while step > 0 && at < stop || step < 0 && at > stop {
        items.push(Value::whole(at as f64));
        if items.len() > MOST_ENTRIES {
            return refuse(part, "a range this long is not read here");
        }
        at += step;
    }
    Ok(Value::list(items))
}

/// An array with its two axes exchanged.
pub fn transposed(array: &Rc<Array>) -> Value {
    let [rows, columns] = array.shape[..] else {
        return Value::Array(Rc::clone(array));
    };
    array.is_fixed.set(true);
    let items = array.items.borrow();
    let of_column = |column: usize| (0..rows).map(move |row| row * columns + column);
    let order = (0..columns).flat_map(of_column);
    let found = order.map(|k| items[k].clone()).collect();
    Value::Array(Array::new(vec![columns, rows], found, array.is_traced))
}
