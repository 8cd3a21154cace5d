//! Functions of NumPy and of `math`.

use std::f64::consts::PI;
use std::rc::Rc;

use filippov_expr::{BinaryOp, UnaryOp};
use ruff_python_ast::{CmpOp, ExprCall, Operator, UnaryOp as Sign};
use ruff_text_size::Ranged;

use crate::arrays::{array_of, as_array, floats, items_of};
use crate::calls::{transposed, Arguments, MOST_ENTRIES};
use crate::expressions::number;
use crate::laws::Laws;
use crate::reader::Reader;
use crate::tables::{count, lookup, Table};
use crate::unreadable::{refuse, Refused};
use crate::values::{Array, Value};

impl Reader<'_> {
    /// The value of a function of a library.
    pub fn numpy(
        &mut self,
        call: &ExprCall,
        function: &str,
        arguments: Arguments,
    ) -> Result<Value, Refused> {
        let (library, name) = function.rsplit_once('.').unwrap_or(("", function));
        if !matches!(library, "numpy" | "math" | "numpy.linalg" | "scipy.special") {
            let (of, method) = (library.rsplit('.').next().unwrap_or(""), name);
            return match (of, method, &arguments.given[..]) {
                ("maximum", "reduce", [values]) => self.reduced(call, "max", values),
                ("minimum", "reduce", [values]) => self.reduced(call, "min", values),
                ("add", "reduce", [values]) => self.reduced(call, "sum", values),
                _ => refuse(call, format!("{function} is not read here")),
            };
        }
        if library == "numpy" {
            if let Some(value) = self.array_function(call, name, &arguments)? {
                return Ok(value);
            }
        }
        if let Some(keyword) = arguments.named.keys().next() {
            return refuse(
                call,
                format!("the keyword {keyword} of {function} is not read here"),
            );
        }
        match &arguments.given[..] {
            [value] if library == "numpy.linalg" && name == "norm" => {
                let squares = self.by_element(value, &mut |reader, item| {
                    reader.function_of_one(call, "numpy.square", item)
                })?;
                let sum = self.reduced(call, "sum", &squares)?;
                self.function_of_one(call, "numpy.sqrt", &sum)
            }
            _ if library == "numpy.linalg" => refuse(call, format!("{function} is not read here")),
            [value] => {
                self.refuse_hidden(call, value, unary_operation(name).is_some())?;
                self.by_element(value, &mut |reader, item| {
                    reader.function_of_one(call, function, item)
                })
            }
            [a, b]
                if library == "numpy" || ["hypot", "pow", "atan2", "copysign"].contains(&name) =>
            {
                let is_arithmetic = operator_of(name).is_some();
                self.refuse_hidden(call, a, is_arithmetic)?;
                self.refuse_hidden(call, b, is_arithmetic)?;
                self.by_elements(call, a, b, &mut |reader, a, b| {
                    reader.function_of_two(call, function, a, b)
                })
            }
            _ => self.unknown(call, function, arguments.given.len()),
        }
    }

    fn unknown(&self, call: &ExprCall, function: &str, count: usize) -> Result<Value, Refused> {
        refuse(
            call,
            format!("{function} with {count} arguments is not read here"),
        )
    }

    /// NumPy looks at the values in an array that is made of traced ones, and asks every comparison of them.
    fn refuse_hidden(
        &self,
        call: &ExprCall,
        value: &Value,
        has_method: bool,
    ) -> Result<(), Refused> {
        let Value::Array(array) = value else {
            return Ok(());
        };
        let is_method = has_method && {
            let items = array.items.borrow();
            items.iter().all(|item| matches!(item, Value::Node(_)))
        };
        match array.is_traced || array.is_of_numbers() || is_method {
            true => Ok(()),
            false => refuse(
                call,
                "a function of an array that is made of traced values: write np.stack([...])",
            ),
        }
    }

    // ---------------------------------------------------------------- of arrays

    /// A function that makes an array, or looks at one as a whole; `None` if it goes to the elements.
    fn array_function(
        &mut self,
        call: &ExprCall,
        name: &str,
        arguments: &Arguments,
    ) -> Result<Option<Value>, Refused> {
        let given = &arguments.given[..];
        let named = |name: &str| arguments.named.get(name);
        let is_typed = arguments.named.keys().all(|key| key == "dtype");
        let is_plain = arguments.named.is_empty();
        let made = |shape: Vec<usize>, value: Value| {
            let n: usize = shape.iter().product();
            let array = Array::new(shape, vec![value; n], true);
            array.is_fixed.set(false);
            Value::Array(array)
        };
        Ok(Some(match (name, given) {
            ("array" | "asarray", [list, ..]) if is_typed || named("dtype").is_some() => {
                let array = array_of(call, list)?;
                let is_whole = |item: &Value| matches!(item, Value::Number { is_whole: true, .. });
                let is_whole = array.items.borrow().iter().any(is_whole);
                if !is_plain || given.len() > 1 || is_whole && given.len() > 1 {
                    // With a type, whole numbers become floats.
                    for item in array.items.borrow_mut().iter_mut() {
                        if let Value::Number { is_whole, .. } = item {
                            *is_whole = false;
                        }
                    }
                }
                array.is_fixed.set(name == "asarray");
                Value::Array(array)
            }
            ("copy", [value]) if is_plain => {
                let of = as_array(call, value)?;
                let items = of.items.borrow().clone();
                let array = Array::new(of.shape.clone(), items, of.is_traced);
                array.is_fixed.set(false);
                Value::Array(array)
            }
            ("tolist", [value]) => Value::list(items_of(call, value)?),
            ("stack" | "hstack" | "concatenate", [list]) if is_plain => {
                let parts = items_of(call, list)?;
                let is_traced = parts.iter().any(Value::is_traced);
                let array = match parts.iter().all(Value::is_scalar) || name == "stack" {
                    true => array_of(call, list)?,
                    false => {
                        let mut items = Vec::new();
                        for part in &parts {
                            match part {
                                scalar if scalar.is_scalar() => items.push(scalar.clone()),
                                part => items.extend(items_of(call, part)?),
                            }
                        }
                        array_of(call, &Value::list(items))?
                    }
                };
                let items = array.items.borrow().clone();
                Value::Array(Array::new(array.shape.clone(), items, is_traced))
            }
            ("zeros" | "empty", [shape]) if is_typed => {
                let value = if name == "zeros" {
                    Value::float(0.0)
                } else {
                    Value::Nothing
                };
                made(self.shape(call, shape)?, value)
            }
            ("ones", [shape]) if is_typed => made(self.shape(call, shape)?, Value::float(1.0)),
            ("full", [shape, value]) if is_typed => made(self.shape(call, shape)?, value.clone()),
            ("zeros_like" | "empty_like" | "ones_like", [value]) if is_typed => {
                let filled = match name {
                    "zeros_like" => Value::float(0.0),
                    "ones_like" => Value::float(1.0),
                    _ => Value::Nothing,
                };
                made(as_array(call, value)?.shape.clone(), filled)
            }
            ("full_like", [like, value]) if is_typed => {
                made(as_array(call, like)?.shape.clone(), value.clone())
            }
            ("linspace", [start, stop, rest @ ..]) if rest.len() < 2 => {
                let n = match rest.first().or(named("num")) {
                    None => 50.0,
                    Some(n) => self.number(call, n)?,
                };
                let (start, stop) = (self.number(call, start)?, self.number(call, stop)?);
                let n = self.count(call, n)?;
                let step = (stop - start) / (n as f64 - 1.0);
                let value = |k: usize| match k + 1 == n && n > 1 {
                    true => stop,
                    false if n == 1 => start,
                    false => k as f64 * step + start,
                };
                floats((0..n).map(value).collect())
            }
            ("arange", bounds) if is_plain && (1..=2).contains(&bounds.len()) => {
                let bounds: Vec<f64> = bounds
                    .iter()
                    .map(|bound| self.number(call, bound))
                    .collect::<Result<_, _>>()?;
                let (start, stop) = match bounds[..] {
                    [stop] => (0.0, stop),
                    _ => (bounds[0], bounds[1]),
                };
                if start.fract() != 0.0 || stop.fract() != 0.0 {
                    return refuse(
                        call,
                        "np.arange is read with whole numbers: write np.linspace",
                    );
                }
                let n = self.count(call, (stop - start).max(0.0))?;
                let items = (0..n).map(|k| Value::whole(start + k as f64)).collect();
                Value::Array(Array::new(vec![n], items, false))
            }
            ("eye" | "identity", [n]) if is_typed => {
                let n = self.shape(call, &Value::list(vec![n.clone(), n.clone()]))?[0];
                let entry = |k: usize| Value::float(f64::from(u8::from(k / n == k % n)));
                Value::Array(Array::new(
                    vec![n, n],
                    (0..n * n).map(entry).collect(),
                    false,
                ))
            }
            ("diag", [values, rest @ ..]) if rest.len() < 2 => {
                let offset = match rest.first().or(named("k")) {
                    None => 0.0,
                    Some(k) => self.number(call, k)?,
                };
                let items = items_of(call, values)?;
                let n = items.len() + offset.abs() as usize;
                let mut found = vec![Value::float(0.0); n * n];
                for (k, item) in items.into_iter().enumerate() {
                    let (row, column) = (k as f64 - offset.min(0.0), k as f64 + offset.max(0.0));
                    found[row as usize * n + column as usize] = item;
                }
                Value::Array(Array::new(vec![n, n], found, false))
            }
            ("dot" | "matmul", [a, b]) if is_plain => match a.is_scalar() || b.is_scalar() {
                true => self.operation(call, Operator::Mult, a, b)?,
                false => self.matrix_product(call, a, b)?,
            },
            ("transpose", [value]) if is_plain => transposed(&as_array(call, value)?),
            ("diff", [value]) if is_plain && matches!(value, Value::Array(_)) => {
                let items = items_of(call, value)?;
                let mut found = Vec::new();
                for pair in items.windows(2) {
                    found.push(self.operation(call, Operator::Sub, &pair[1], &pair[0])?);
                }
                Value::Array(Array::new(vec![found.len()], found, value.is_traced()))
            }
            ("sum" | "prod" | "mean" | "max" | "min" | "amax" | "amin", [value]) if is_plain => {
                self.reduced(call, name.trim_start_matches('a'), value)?
            }
            ("where", [condition, plus, minus]) if is_plain => {
                self.where_each(call, condition, plus, minus)?
            }
            ("clip", [value, rest @ ..]) if rest.len() <= 2 => {
                let bound = |index: usize, names: [&str; 2]| {
                    let by_name = names.iter().find_map(|name| named(name));
                    let bound = rest.get(index).or(by_name).cloned();
                    bound.filter(|bound| !matches!(bound, Value::Nothing))
                };
                let mut found = value.clone();
                for (bound, function) in [
                    (bound(0, ["a_min", "min"]), "numpy.maximum"),
                    (bound(1, ["a_max", "max"]), "numpy.minimum"),
                ] {
                    if let Some(bound) = bound {
                        self.refuse_hidden(call, &found, false)?;
                        found = self.by_elements(call, &found, &bound, &mut |reader, a, b| {
                            reader.function_of_two(call, function, a, b)
                        })?;
                    }
                }
                found
            }
            ("select", [conditions, choices, rest @ ..]) if rest.len() < 2 => {
                let default = rest.first().or(named("default")).cloned();
                let mut found = default.unwrap_or_else(|| Value::whole(0.0));
                let (conditions, choices) = (items_of(call, conditions)?, items_of(call, choices)?);
                if conditions.len() != choices.len() {
                    return refuse(call, "np.select needs as many values as conditions");
                }
                // Where no traced value is handed over as such, NumPy asks every comparison.
                for (condition, choice) in conditions.iter().zip(&choices).rev() {
                    found = self.where_each(call, condition, choice, &found)?;
                }
                found
            }
            ("interp", [value, places, values, rest @ ..]) if rest.len() <= 3 => {
                let more = ["left", "right", "period"];
                let more = [0, 1, 2].map(|k| rest.get(k).or(named(more[k])).cloned());
                self.interpolated(call, value, [places, values], more)?
            }
            ("digitize", [value, bins, rest @ ..]) if rest.len() < 2 => {
                let right = rest.first().or(named("right"));
                let is_right = matches!(right, Some(Value::Truth(true)));
                let bins = self.numbers(call, bins)?;
                if bins.windows(2).any(|pair| pair[1] < pair[0]) {
                    return refuse(call, "np.digitize is read with bins that increase");
                }
                self.sorted_place(call, &bins, value, is_right)?
            }
            ("searchsorted", [bins, value, rest @ ..]) if rest.len() < 2 => {
                let side = rest.first().or(named("side"));
                let is_right = matches!(side, Some(Value::Text(side)) if &**side == "right");
                let bins = self.numbers(call, bins)?;
                self.sorted_place(call, &bins, value, !is_right)?
            }
            ("round" | "around", [value]) if is_plain => {
                let one = Value::float(1.0);
                self.by_element(value, &mut |reader, item| {
                    let scaled = reader.operation(call, Operator::Mult, item, &one)?;
                    let whole = reader.function_of_one(call, "numpy.rint", &scaled)?;
                    reader.operation(call, Operator::Div, &whole, &one)
                })?
            }
            ("logical_and" | "logical_or" | "logical_xor", [a, b]) if is_plain => {
                let operator = match name {
                    "logical_and" => Operator::BitAnd,
                    "logical_or" => Operator::BitOr,
                    _ => Operator::BitXor,
                };
                self.operation(call, operator, a, b)?
            }
            ("logical_not", [value]) if is_plain => {
                self.by_element(value, &mut |reader, item| reader.opposite(call, item))?
            }
            _ => return Ok(None),
        }))
    }

    fn number(&self, part: &impl Ranged, value: &Value) -> Result<f64, Refused> {
        match value.number() {
            Some(value) => Ok(value),
            None => refuse(part, "a number is needed, not what depends on the state"),
        }
    }

    fn numbers(&self, part: &impl Ranged, value: &Value) -> Result<Vec<f64>, Refused> {
        let items = items_of(part, value)?;
        items.iter().map(|item| self.number(part, item)).collect()
    }

    fn count(&self, part: &impl Ranged, n: f64) -> Result<usize, Refused> {
        match n.fract() == 0.0 && (0.0..=MOST_ENTRIES as f64).contains(&n) {
            true => Ok(n as usize),
            false => refuse(
                part,
                "an array has a whole number of entries, and not too many",
            ),
        }
    }

    fn shape(&self, part: &impl Ranged, value: &Value) -> Result<Vec<usize>, Refused> {
        let numbers = match value {
            Value::List(_) => self.numbers(part, value)?,
            single => vec![self.number(part, single)?],
        };
        self.count(part, numbers.iter().product())?;
        match numbers.len() {
            1 | 2 => numbers.into_iter().map(|n| self.count(part, n)).collect(),
            _ => refuse(part, "arrays have one or two axes"),
        }
    }

    /// A sum, a product, a mean, the largest or the smallest of an array.
    fn reduced(&mut self, call: &ExprCall, name: &str, value: &Value) -> Result<Value, Refused> {
        if value.is_scalar() {
            return Ok(value.clone());
        }
        let hidden = matches!(value, Value::List(_)) && !as_array(call, value)?.is_of_numbers();
        let is_extreme = matches!(name, "max" | "min");
        if hidden && is_extreme {
            return refuse(
                call,
                format!("np.{name} of a list asks every comparison: write np.{name}imum(a, b)"),
            );
        }
        self.refuse_hidden(call, value, !is_extreme)?;
        let array = as_array(call, value)?;
        let items = array.items.borrow().clone();
        if array.is_of_numbers() && !is_extreme && items.len() > 8 {
            return refuse(
                call,
                "a sum of many numbers: write its value, whose last digit is that of NumPy",
            );
        }
        let Some((first, others)) = items.split_first() else {
            return refuse(call, format!("np.{name} of nothing"));
        };
        let mut total = match (name, first) {
            // NumPy counts comparisons in a sum.
            ("sum" | "mean", Value::Condition(_) | Value::Truth(_)) => {
                Value::Node(self.node(call, first)?)
            }
            _ => first.clone(),
        };
        for item in others {
            total = match name {
                "prod" => self.operation(call, Operator::Mult, &total, item)?,
                "max" => self.function_of_two(call, "numpy.maximum", &total, item)?,
                "min" => self.function_of_two(call, "numpy.minimum", &total, item)?,
                _ => self.operation(call, Operator::Add, &total, item)?,
            };
        }
        match name {
            "mean" => self.operation(
                call,
                Operator::Div,
                &total,
                &Value::whole(items.len() as f64),
            ),
            _ => Ok(total),
        }
    }

    fn where_each(
        &mut self,
        call: &ExprCall,
        condition: &Value,
        plus: &Value,
        minus: &Value,
    ) -> Result<Value, Refused> {
        if let Value::Array(array) = condition {
            let items = array.items.borrow();
            let is_open = items.iter().any(|item| !matches!(item, Value::Truth(_)));
            if is_open && !array.is_traced {
                return refuse(call, "np.where of an array that is made of comparisons asks each of them: write np.stack([...])");
            }
        }
        let is_list = |value: &Value| matches!(value, Value::Array(_) | Value::List(_));
        if !is_list(plus) && !is_list(minus) {
            return self.by_element(condition, &mut |reader, condition| {
                reader.chosen(call, condition, plus, minus)
            });
        }
        let pairs = self.by_elements(call, plus, minus, &mut |_, a, b| {
            Ok(Value::tuple(vec![a.clone(), b.clone()]))
        })?;
        let chosen =
            self.by_elements(call, condition, &pairs, &mut |reader, condition, pair| {
                let pair = items_of(call, pair)?;
                reader.chosen(call, condition, &pair[0], &pair[1])
            })?;
        let Value::Array(array) = &chosen else {
            return Ok(chosen);
        };
        let items = array.items.borrow().clone();
        Ok(Value::Array(Array::new(array.shape.clone(), items, true)))
    }

    /// One value where a condition holds, the other one elsewhere.
    pub fn chosen(
        &mut self,
        call: &impl Ranged,
        condition: &Value,
        plus: &Value,
        minus: &Value,
    ) -> Result<Value, Refused> {
        let condition = match condition {
            Value::Truth(holds) => return Ok(if *holds { plus.clone() } else { minus.clone() }),
            Value::Condition(condition) => Rc::clone(condition),
            _ => return refuse(call, "the first argument is a comparison"),
        };
        let is_truth = |value: &Value| matches!(value, Value::Truth(_) | Value::Condition(_));
        if is_truth(plus) && is_truth(minus) {
            return refuse(
                call,
                "a choice between comparisons is not read here: write & and |",
            );
        }
        if !plus.is_scalar() || !minus.is_scalar() {
            return refuse(call, "a choice between numbers is read");
        }
        let (plus, minus) = (self.node(call, plus)?, self.node(call, minus)?);
        Ok(Value::Node(self.tracer.choose(&condition, plus, minus)))
    }

    // ---------------------------------------------------------------- of tables

    fn interpolated(
        &mut self,
        call: &ExprCall,
        value: &Value,
        [places, values]: [&Value; 2],
        [left, right, period]: [Option<Value>; 3],
    ) -> Result<Value, Refused> {
        if period.is_some_and(|period| !matches!(period, Value::Nothing)) {
            return refuse(
                call,
                "the period of np.interp is not read here: write t % period",
            );
        }
        let (places, values) = (self.numbers(call, places)?, self.numbers(call, values)?);
        let is_table = places.len() == values.len()
            && !places.is_empty()
            && places.windows(2).all(|pair| pair[0] <= pair[1]);
        if !is_table {
            return refuse(
                call,
                "np.interp needs places that increase, and as many values",
            );
        }
        let end = |given: Option<Value>, default: f64| match given {
            None | Some(Value::Nothing) => Ok(default),
            Some(given) => self.number(call, &given),
        };
        let left = end(left, values[0])?;
        let right = end(right, values[values.len() - 1])?;
        let table = Table::linear(&places, &values, left, right);
        self.by_element(value, &mut |reader, item| {
            if item.number().is_some() {
                return refuse(call, "np.interp of a number: write its value");
            }
            let node = reader.node(call, item)?;
            reader.tracer.place = call.range();
            Ok(Value::Node(table.at(reader.tracer, node)?))
        })
    }

    fn sorted_place(
        &mut self,
        call: &ExprCall,
        knots: &[f64],
        value: &Value,
        strictly: bool,
    ) -> Result<Value, Refused> {
        if knots.is_empty() || knots.windows(2).any(|pair| pair[1] < pair[0]) {
            return refuse(call, "a table needs places that increase");
        }
        let mut distinct = knots.to_vec();
        distinct.dedup();
        let mut passed = vec![0.0];
        for knot in &distinct {
            let count = knots.iter().filter(|other| *other == knot).count();
            passed.push(passed[passed.len() - 1] + count as f64);
        }
        self.by_element(value, &mut |reader, item| {
            if item.number().is_some() {
                return refuse(call, "the place of a number: write its value");
            }
            let node = reader.node(call, item)?;
            reader.tracer.place = call.range();
            let found = count(reader.tracer, node, &distinct, strictly)?;
            let found = match distinct.len() == knots.len() {
                true => found,
                false => lookup(reader.tracer, found, &passed)?,
            };
            Ok(Value::Node(found))
        })
    }

    // ------------------------------------------------------------- of elements

    /// A function of one number.
    pub fn function_of_one(
        &mut self,
        call: &ExprCall,
        function: &str,
        a: &Value,
    ) -> Result<Value, Refused> {
        let name = function.rsplit('.').next().unwrap_or(function);
        if let Some((value, is_whole)) = number(a) {
            let same_type = |value: f64| Ok(Value::Number { value, is_whole });
            let of_math = !function.starts_with("numpy.");
            return match name {
                "abs" | "absolute" => same_type(value.abs()),
                "fabs" => Ok(Value::float(value.abs())),
                "sqrt" if value >= 0.0 => Ok(Value::float(value.sqrt())),
                "sign" if value != 0.0 => Ok(Value::float(value.signum())),
                "square" => self.operation(call, Operator::Mult, a, a),
                "negative" => self.signed(call, Sign::USub, a),
                "floor" => Ok(Value::Number { value: value.floor(), is_whole: of_math }),
                "ceil" => Ok(Value::Number { value: value.ceil(), is_whole: of_math }),
                "trunc" | "fix" => Ok(Value::Number { value: value.trunc(), is_whole: of_math }),
                "rint" => Ok(Value::float(value.round_ties_even())),
                "deg2rad" => Ok(Value::float(value * (PI / 180.0))),
                "radians" if of_math => Ok(Value::float(value * (PI / 180.0))),
                _ if unary_operation(name).is_some() => refuse(
                    call,
                    format!("{function} of a number: write its value, whose last digit is that of a platform"),
                ),
                _ => self.unknown(call, function, 1),
            };
        }
        if matches!(a, Value::Truth(_)) {
            return refuse(
                call,
                format!("{function} of True or False is not read here"),
            );
        }
        let node = self.node(call, a)?;
        self.tracer.place = call.range();
        let found = match name {
            "abs" | "fabs" | "absolute" => self.tracer.absolute(node)?,
            "sign" if function == "numpy.sign" => self.tracer.sign(node)?,
            "square" => self.tracer.binary(BinaryOp::Mul, node, node),
            "positive" => node,
            "reciprocal" => {
                let one = self.tracer.graph.constant(1.0);
                self.tracer.binary(BinaryOp::Div, one, node)
            }
            "deg2rad" | "radians" => self.scaled(node, PI / 180.0),
            "rad2deg" | "degrees" => self.scaled(node, 180.0 / PI),
            "floor" => Laws::floor(self.tracer, node)?,
            "ceil" => Laws::ceil(self.tracer, node)?,
            "trunc" | "fix" => Laws::trunc(self.tracer, node)?,
            "rint" => Laws::rint(self.tracer, node)?,
            "expit" => {
                // As a tangent it overflows nowhere.
                let half = Value::float(0.5);
                let argument = self.operation(call, Operator::Mult, &half, a)?;
                let tangent = self.function_of_one(call, "numpy.tanh", &argument)?;
                let scaled = self.operation(call, Operator::Mult, &half, &tangent)?;
                return self.operation(call, Operator::Add, &half, &scaled);
            }
            _ => match unary_operation(name) {
                Some(op @ (UnaryOp::Asin | UnaryOp::Acos | UnaryOp::Atan)) => {
                    self.tracer.arc(op, node)?
                }
                Some(op) => self.tracer.function(op, node),
                None => return self.unknown(call, function, 1),
            },
        };
        Ok(Value::Node(found))
    }

    fn scaled(&mut self, a: filippov_expr::NodeId, factor: f64) -> filippov_expr::NodeId {
        let factor = self.tracer.graph.constant(factor);
        self.tracer.binary(BinaryOp::Mul, a, factor)
    }

    /// A function of two arguments.
    pub fn function_of_two(
        &mut self,
        call: &ExprCall,
        function: &str,
        a: &Value,
        b: &Value,
    ) -> Result<Value, Refused> {
        let name = function.rsplit('.').next().unwrap_or(function);
        if let Some(operator) = operator_of(name) {
            return self.operation(call, operator, a, b);
        }
        let is_of_numbers = number(a).is_some() && number(b).is_some();
        match name {
            "maximum" | "fmax" | "minimum" | "fmin" => {
                let is_largest = matches!(name, "maximum" | "fmax");
                if let (Some((x, first)), Some((y, second))) = (number(a), number(b)) {
                    return Ok(Value::Number {
                        value: if is_largest { x.max(y) } else { x.min(y) },
                        is_whole: first && second,
                    });
                }
                let (a, b) = (self.node(call, a)?, self.node(call, b)?);
                self.tracer.place = call.range();
                Ok(Value::Node(self.tracer.extreme(a, b, is_largest)?))
            }
            "greater" => self.compared(call, CmpOp::Gt, a, b),
            "greater_equal" => self.compared(call, CmpOp::GtE, a, b),
            "less" => self.compared(call, CmpOp::Lt, a, b),
            "less_equal" => self.compared(call, CmpOp::LtE, a, b),
            "hypot" | "arctan2" | "atan2" if is_of_numbers => {
                refuse(call, format!("{function} of numbers: write its value"))
            }
            "hypot" => {
                let (a, b) = self.pair(call, a, b)?;
                Ok(Value::Node(self.tracer.binary(BinaryOp::Hypot, a, b)))
            }
            "arctan2" | "atan2" => self.angle(call, a, b),
            "heaviside" if number(a).is_none() => {
                let zero = Value::whole(0.0);
                let is_positive = self.compared(call, CmpOp::Gt, a, &zero)?;
                let is_negative = self.compared(call, CmpOp::Lt, a, &zero)?;
                let below = self.chosen(call, &is_negative, &Value::float(0.0), b)?;
                self.chosen(call, &is_positive, &Value::float(1.0), &below)
            }
            "copysign" if number(b).is_none() => {
                let is_positive = self.compared(call, CmpOp::GtE, b, &Value::whole(0.0))?;
                let (plus, minus) = (Value::float(1.0), Value::float(-1.0));
                let sign = self.chosen(call, &is_positive, &plus, &minus)?;
                let size = self.function_of_one(call, "abs", a)?;
                self.operation(call, Operator::Mult, &size, &sign)
            }
            "fmod" if !is_of_numbers => {
                let quotient = self.operation(call, Operator::Div, a, b)?;
                let whole = self.function_of_one(call, "numpy.trunc", &quotient)?;
                let product = self.operation(call, Operator::Mult, b, &whole)?;
                self.operation(call, Operator::Sub, a, &product)
            }
            _ => self.unknown(call, function, 2),
        }
    }

    /// The nodes of two values, of which one is traced: that one is asked first.
    fn pair(
        &mut self,
        call: &ExprCall,
        a: &Value,
        b: &Value,
    ) -> Result<(filippov_expr::NodeId, filippov_expr::NodeId), Refused> {
        if number(a).is_some() {
            let b = self.node(call, b)?;
            return Ok((self.node(call, a)?, b));
        }
        let a = self.node(call, a)?;
        Ok((a, self.node(call, b)?))
    }

    /// The angle of a point, which jumps across y = 0 where x < 0: there each side of y = 0 has a formula of its own.
    fn angle(&mut self, call: &ExprCall, y: &Value, x: &Value) -> Result<Value, Refused> {
        let is_right = self.compared(call, CmpOp::GtE, x, &Value::whole(0.0))?;
        let angle = |reader: &mut Self, y: &Value, x: &Value| {
            let (y, x) = reader.pair(call, y, x)?;
            Ok(Value::Node(reader.tracer.binary(BinaryOp::Atan2, y, x)))
        };
        if let Value::Truth(true) = is_right {
            return angle(self, y, x);
        }
        let half_turn = Value::float(0.5 * PI);
        let is_above = self.compared(call, CmpOp::GtE, y, &Value::whole(0.0))?;
        let turned = angle(self, x, y)?;
        let above = self.operation(call, Operator::Sub, &half_turn, &turned)?;
        let opposite = self.signed(call, Sign::USub, y)?;
        let turned = angle(self, x, &opposite)?;
        let below = self.operation(call, Operator::Sub, &turned, &half_turn)?;
        let left = self.chosen(call, &is_above, &above, &below)?;
        let right = angle(self, y, x)?;
        self.chosen(call, &is_right, &right, &left)
    }
}

/// The operator behind the name of a function.
fn operator_of(name: &str) -> Option<Operator> {
    Some(match name {
        "add" => Operator::Add,
        "subtract" => Operator::Sub,
        "multiply" => Operator::Mult,
        "divide" | "true_divide" => Operator::Div,
        "power" | "float_power" | "pow" => Operator::Pow,
        "floor_divide" => Operator::FloorDiv,
        "remainder" | "mod" => Operator::Mod,
        _ => return None,
    })
}

/// The operation behind the name of a function of one number.
fn unary_operation(name: &str) -> Option<UnaryOp> {
    Some(match name {
        "negative" => UnaryOp::Neg,
        "cbrt" => UnaryOp::Cbrt,
        "sqrt" => UnaryOp::Sqrt,
        "exp" => UnaryOp::Exp,
        "expm1" => UnaryOp::Expm1,
        "exp2" => UnaryOp::Exp2,
        "log" => UnaryOp::Log,
        "log1p" => UnaryOp::Log1p,
        "log2" => UnaryOp::Log2,
        "log10" => UnaryOp::Log10,
        "sin" => UnaryOp::Sin,
        "cos" => UnaryOp::Cos,
        "tan" => UnaryOp::Tan,
        "arcsin" | "asin" => UnaryOp::Asin,
        "arccos" | "acos" => UnaryOp::Acos,
        "arctan" | "atan" => UnaryOp::Atan,
        "sinh" => UnaryOp::Sinh,
        "cosh" => UnaryOp::Cosh,
        "tanh" => UnaryOp::Tanh,
        "arcsinh" | "asinh" => UnaryOp::Asinh,
        "arccosh" | "acosh" => UnaryOp::Acosh,
        "arctanh" | "atanh" => UnaryOp::Atanh,
        _ => return None,
    })
}
