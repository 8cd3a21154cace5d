//! Calls: functions of NumPy, of `math`, and a few of Python.

use std::f64::consts::PI;
use std::rc::Rc;

use filippov_expr::{BinaryOp, NodeId, UnaryOp};
use ruff_python_ast::{CmpOp, Expr, ExprCall, Operator};

use crate::expressions::number;
use crate::statements::Reader;
use crate::unreadable::{refuse, Refused};
use crate::values::Value;

impl Reader<'_> {
    pub fn call(&mut self, call: &ExprCall) -> Result<Value, Refused> {
        let function = self.function_name(call)?;
        if let Some(keyword) = call.arguments.keywords.first() {
            return refuse(keyword, format!("a keyword of {function} is not read here"));
        }
        let given: Vec<Value> = call
            .arguments
            .args
            .iter()
            .map(|argument| self.value(argument))
            .collect::<Result<_, _>>()?;
        let (name, is_numpy) = match function.rsplit_once('.') {
            Some((library, name)) => (name, library == "numpy"),
            None => (&*function, false),
        };
        let is_builtin = !function.contains('.');
        match (name, &given[..]) {
            ("array" | "asarray" | "stack" | "hstack", [list @ Value::List(items)]) if is_numpy => {
                let is_number =
                    |item: &Value| matches!(item, Value::Number { .. } | Value::Node(_));
                match items.iter().all(is_number) {
                    true => Ok(list.clone()),
                    false => refuse(call, format!("{name} is read with numbers in one list")),
                }
            }
            ("where", [condition, plus, minus]) if is_numpy => {
                self.chosen(call, condition, plus, minus)
            }
            ("logical_and", [a, b]) if is_numpy => self.logic(call, true, a, b),
            ("logical_or", [a, b]) if is_numpy => self.logic(call, false, a, b),
            ("logical_not", [Value::Condition(a)]) if is_numpy => {
                Ok(Value::Condition(Rc::new(a.negated())))
            }
            ("max" | "min", [first, others @ ..]) if is_builtin && !others.is_empty() => {
                // As Python does it: by asking.
                let op = if name == "max" { CmpOp::Gt } else { CmpOp::Lt };
                let mut best = first.clone();
                for other in others {
                    let is_better = self.compared(call, op, other, &best)?;
                    if self.truth(call, &is_better)? {
                        best = other.clone();
                    }
                }
                Ok(best)
            }
            ("pow", [a, b]) if is_builtin || function == "math.pow" => {
                self.operation(call, Operator::Pow, a, b)
            }
            ("power" | "float_power", [a, b]) if is_numpy => {
                self.operation(call, Operator::Pow, a, b)
            }
            (_, [a]) => self.function_of_one(call, (&function, name), a),
            (_, [a, b]) if is_numpy || name == "hypot" => {
                self.function_of_two(call, (&function, name), a, b)
            }
            ("clip", _) if is_numpy => refuse(
                call,
                "np.clip is not read here: write np.where(v > b, b, np.where(v < a, a, v))",
            ),
            _ => self.unknown(call, &function),
        }
    }

    /// The full name of the function that is called.
    fn function_name(&mut self, call: &ExprCall) -> Result<String, Refused> {
        if let Some(name) = self.name_in_numpy_or_math(&call.func) {
            return Ok(name);
        }
        if let Expr::Name(name) = &*call.func {
            let is_own = self.names.contains_key(name.id.as_str());
            if ["abs", "max", "min", "pow"].contains(&name.id.as_str()) && !is_own {
                return Ok(name.id.to_string());
            }
            return refuse(call, format!("the function {} is not read here", name.id));
        }
        refuse(
            call,
            "a call of something that is no function of NumPy or math",
        )
    }

    fn unknown(&self, call: &ExprCall, function: &str) -> Result<Value, Refused> {
        let count = call.arguments.args.len();
        refuse(
            call,
            format!("{function} with {count} arguments is not read here"),
        )
    }

    /// A function of one argument.
    fn function_of_one(
        &mut self,
        call: &ExprCall,
        (function, name): (&str, &str),
        a: &Value,
    ) -> Result<Value, Refused> {
        if let Some((value, _)) = number(a) {
            return match name {
                "abs" | "fabs" | "absolute" => Ok(Value::float(value.abs())),
                "sqrt" if value >= 0.0 => Ok(Value::float(value.sqrt())),
                "sign" if value != 0.0 => Ok(Value::float(value.signum())),
                _ if unary_operation(name).is_some() => refuse(
                    call,
                    format!("{function} of a number: write its value, whose last digit is that of a platform"),
                ),
                _ => self.unknown(call, function),
            };
        }
        if matches!(a, Value::Condition(_) | Value::Truth(_)) {
            return refuse(call, format!("{function} of a comparison is not read here"));
        }
        let node = self.tracer.node(call, a)?;
        match name {
            "abs" | "fabs" | "absolute" => {
                return Ok(Value::Node(self.tracer.absolute(call, node)?))
            }
            "sign" if function == "numpy.sign" => {
                return Ok(Value::Node(self.tracer.sign(call, node)?))
            }
            "square" => return self.node_of(call, BinaryOp::Mul, node, node),
            "reciprocal" => {
                let one = self.tracer.graph.constant(1.0);
                return self.node_of(call, BinaryOp::Div, one, node);
            }
            "deg2rad" | "radians" => return self.scaled(call, node, PI / 180.0),
            "rad2deg" | "degrees" => return self.scaled(call, node, 180.0 / PI),
            _ => {}
        }
        match unary_operation(name) {
            Some(op) => Ok(Value::Node(self.tracer.unary(call, op, node)?)),
            None => self.unknown(call, function),
        }
    }

    fn scaled(&mut self, call: &ExprCall, a: NodeId, factor: f64) -> Result<Value, Refused> {
        let factor = self.tracer.graph.constant(factor);
        self.node_of(call, BinaryOp::Mul, a, factor)
    }

    fn node_of(
        &mut self,
        call: &ExprCall,
        op: BinaryOp,
        a: NodeId,
        b: NodeId,
    ) -> Result<Value, Refused> {
        Ok(Value::Node(self.tracer.binary(call, op, a, b)?))
    }

    /// A function of two arguments.
    fn function_of_two(
        &mut self,
        call: &ExprCall,
        (function, name): (&str, &str),
        a: &Value,
        b: &Value,
    ) -> Result<Value, Refused> {
        match name {
            "maximum" | "fmax" => self.extreme(call, a, b, true),
            "minimum" | "fmin" => self.extreme(call, a, b, false),
            "add" => self.operation(call, Operator::Add, a, b),
            "subtract" => self.operation(call, Operator::Sub, a, b),
            "multiply" => self.operation(call, Operator::Mult, a, b),
            "divide" | "true_divide" => self.operation(call, Operator::Div, a, b),
            "greater" => self.compared(call, CmpOp::Gt, a, b),
            "greater_equal" => self.compared(call, CmpOp::GtE, a, b),
            "less" => self.compared(call, CmpOp::Lt, a, b),
            "less_equal" => self.compared(call, CmpOp::LtE, a, b),
            "hypot" if number(a).is_none() || number(b).is_none() => {
                let (a, b) = (self.tracer.node(call, a)?, self.tracer.node(call, b)?);
                self.node_of(call, BinaryOp::Hypot, a, b)
            }
            "heaviside" if number(a).is_none() => {
                let zero = Value::float(0.0);
                let is_positive = self.compared(call, CmpOp::Gt, a, &zero)?;
                let is_negative = self.compared(call, CmpOp::Lt, a, &zero)?;
                let below = self.chosen(call, &is_negative, &zero, b)?;
                self.chosen(call, &is_positive, &Value::float(1.0), &below)
            }
            _ => self.unknown(call, function),
        }
    }

    /// The larger or the smaller one of two values.
    fn extreme(
        &mut self,
        call: &ExprCall,
        a: &Value,
        b: &Value,
        is_largest: bool,
    ) -> Result<Value, Refused> {
        if let (Some((x, _)), Some((y, _))) = (number(a), number(b)) {
            return Ok(Value::float(if is_largest { x.max(y) } else { x.min(y) }));
        }
        let (a, b) = (self.tracer.node(call, a)?, self.tracer.node(call, b)?);
        Ok(Value::Node(self.tracer.extreme(call, a, b, is_largest)?))
    }

    /// One value where a condition holds, the other one elsewhere.
    fn chosen(
        &mut self,
        call: &ExprCall,
        condition: &Value,
        plus: &Value,
        minus: &Value,
    ) -> Result<Value, Refused> {
        let condition = match condition {
            Value::Truth(holds) => return Ok(if *holds { plus.clone() } else { minus.clone() }),
            Value::Condition(condition) => Rc::clone(condition),
            _ => return refuse(call, "the first argument is a comparison"),
        };
        let is_number = |value: &Value| matches!(value, Value::Number { .. } | Value::Node(_));
        if !is_number(plus) || !is_number(minus) {
            return refuse(
                call,
                "a choice between numbers is read, not one between comparisons or lists",
            );
        }
        let (plus, minus) = (
            self.tracer.node(call, plus)?,
            self.tracer.node(call, minus)?,
        );
        Ok(Value::Node(self.tracer.choose(&condition, plus, minus)))
    }
}

/// The operation behind the name of a function of one number.
fn unary_operation(name: &str) -> Option<UnaryOp> {
    Some(match name {
        "negative" => UnaryOp::Neg,
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
