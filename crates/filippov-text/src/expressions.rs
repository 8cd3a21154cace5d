//! Expressions.

use std::rc::Rc;

use filippov_expr::{BinaryOp, NodeId, UnaryOp};
use ruff_python_ast::{BoolOp, CmpOp, Expr, Number, Operator, UnaryOp as Sign};
use ruff_text_size::Ranged;

use crate::statements::Reader;
use crate::unreadable::{refuse, Refused};
use crate::values::Value;

/// The largest whole number that is kept to the last digit.
const LARGEST_WHOLE: f64 = 9_007_199_254_740_992.0;

impl Reader<'_> {
    /// The value of an expression.
    pub fn value(&mut self, expression: &Expr) -> Result<Value, Refused> {
        match expression {
            Expr::NumberLiteral(literal) => match &literal.value {
                Number::Float(value) => Ok(Value::float(*value)),
                Number::Int(value) => {
                    let value = value.as_i64().map(|value| value as f64);
                    let value = value.filter(|value| *value <= LARGEST_WHOLE);
                    match value {
                        Some(value) => Ok(Value::Number {
                            value,
                            is_whole: true,
                        }),
                        None => refuse(literal, "a whole number this large is not read here"),
                    }
                }
                Number::Complex { .. } => refuse(literal, "a complex number"),
            },
            Expr::BooleanLiteral(literal) => Ok(Value::Truth(literal.value)),
            Expr::Name(_) | Expr::Attribute(_) => self.named(expression),
            Expr::Tuple(tuple) => self.list(&tuple.elts),
            Expr::List(list) => self.list(&list.elts),
            Expr::Subscript(part) => self.entry(&part.value, &part.slice),
            Expr::BinOp(operation) => {
                let left = self.value(&operation.left)?;
                let right = self.value(&operation.right)?;
                self.operation(operation, operation.op, &left, &right)
            }
            Expr::UnaryOp(operation) => self.signed(operation.op, &operation.operand),
            Expr::Compare(_) => self.comparison(expression),
            Expr::BoolOp(operation) => {
                let (last, others) = match operation.values.split_last() {
                    Some(split) => split,
                    None => return refuse(operation, "this expression is not read here"),
                };
                for operand in others {
                    let value = self.value(operand)?;
                    let needs_the_next =
                        self.truth(operand, &value)? == (operation.op == BoolOp::And);
                    if !needs_the_next {
                        return Ok(value);
                    }
                }
                self.value(last)
            }
            Expr::If(choice) => match self.holds(&choice.test)? {
                true => self.value(&choice.body),
                false => self.value(&choice.orelse),
            },
            Expr::Call(call) => self.call(call),
            other => refuse(other, what_it_is(other)),
        }
    }

    /// Does a condition hold on this path?
    pub fn holds(&mut self, test: &Expr) -> Result<bool, Refused> {
        let value = self.value(test)?;
        self.truth(test, &value)
    }

    pub fn truth(&mut self, part: &impl Ranged, value: &Value) -> Result<bool, Refused> {
        match value {
            Value::Truth(holds) => Ok(*holds),
            Value::Number { value, .. } => Ok(*value != 0.0),
            Value::Condition(condition) => Ok(self.tracer.decide(condition)),
            _ => refuse(part, "a comparison is needed: write `v > 0`"),
        }
    }

    fn list(&mut self, items: &[Expr]) -> Result<Value, Refused> {
        let values = items.iter().map(|item| self.value(item));
        Ok(Value::List(values.collect::<Result<_, _>>()?))
    }

    /// A name of the function, of the text around it, or of a library.
    fn named(&mut self, expression: &Expr) -> Result<Value, Refused> {
        if let Expr::Name(name) = expression {
            let name = name.id.as_str();
            let found = self
                .names
                .get(name)
                .or_else(|| self.module.values.get(name));
            if let Some(value) = found {
                return Ok(value.clone());
            }
        }
        match self.name_in_numpy_or_math(expression).as_deref() {
            Some("numpy.pi" | "math.pi") => Ok(Value::float(std::f64::consts::PI)),
            Some("numpy.e" | "math.e") => Ok(Value::float(std::f64::consts::E)),
            Some(name) => refuse(expression, format!("{name} is not read here")),
            None => match expression {
                Expr::Name(name) => {
                    refuse(expression, format!("the name {} is not known", name.id))
                }
                _ => refuse(expression, "an attribute that is not read here"),
            },
        }
    }

    /// What a dotted name means, if a library has it: `np.sin` is `numpy.sin`.
    pub fn name_in_numpy_or_math(&self, expression: &Expr) -> Option<String> {
        match expression {
            Expr::Name(name) => {
                let name = name.id.as_str();
                let is_own = self.names.contains_key(name) || self.module.values.contains_key(name);
                let meaning = self.module.imported.get(name).filter(|_| !is_own);
                meaning.cloned()
            }
            Expr::Attribute(part) => {
                let of = self.name_in_numpy_or_math(&part.value)?;
                Some(format!("{of}.{}", part.attr))
            }
            _ => None,
        }
    }

    fn entry(&mut self, list: &Expr, index: &Expr) -> Result<Value, Refused> {
        let Value::List(values) = self.value(list)? else {
            return refuse(list, "a number has no entries");
        };
        let place = match self.value(index)? {
            Value::Number {
                value,
                is_whole: true,
            } => value,
            _ => return refuse(index, "an index is a whole number"),
        };
        let count = values.len() as f64;
        let place = if place < 0.0 { place + count } else { place };
        match values.get(place as usize).filter(|_| place >= 0.0) {
            Some(value) => Ok(value.clone()),
            None => refuse(
                index,
                format!("there are {} entries, from index 0", values.len()),
            ),
        }
    }

    /// An operation on two values.
    pub fn operation(
        &mut self,
        part: &impl Ranged,
        operator: Operator,
        left: &Value,
        right: &Value,
    ) -> Result<Value, Refused> {
        let op = match operator {
            Operator::Add => BinaryOp::Add,
            Operator::Sub => BinaryOp::Sub,
            Operator::Mult => BinaryOp::Mul,
            Operator::Div => BinaryOp::Div,
            Operator::Pow => BinaryOp::Pow,
            Operator::BitAnd | Operator::BitOr => {
                return self.logic(part, operator == Operator::BitAnd, left, right)
            }
            Operator::FloorDiv | Operator::Mod => {
                return refuse(
                    part,
                    "a floor or a remainder is not read here: it jumps at every whole number",
                )
            }
            Operator::MatMult => return refuse(part, "a product of matrices is not read here"),
            _ => return refuse(part, "this operator is not read here"),
        };
        if let (Some(left), Some(right)) = (number(left), number(right)) {
            return arithmetic(part, op, left, right);
        }
        let (a, b) = self.operands(part, left, right)?;
        Ok(Value::Node(self.tracer.binary(part, op, a, b)?))
    }

    /// The nodes of two values: Python asks the traced one of the two first.
    fn operands(
        &mut self,
        part: &impl Ranged,
        left: &Value,
        right: &Value,
    ) -> Result<(NodeId, NodeId), Refused> {
        if number(left).is_some() {
            let b = self.tracer.node(part, right)?;
            return Ok((self.tracer.node(part, left)?, b));
        }
        let a = self.tracer.node(part, left)?;
        Ok((a, self.tracer.node(part, right)?))
    }

    /// Both conditions, or one of them at least.
    pub fn logic(
        &mut self,
        part: &impl Ranged,
        is_and: bool,
        left: &Value,
        right: &Value,
    ) -> Result<Value, Refused> {
        Ok(match (left, right) {
            (Value::Condition(a), Value::Condition(b)) => {
                let joined = if is_and { a.and(b) } else { a.or(b) };
                Value::Condition(Rc::new(joined))
            }
            (Value::Truth(holds), other) | (other, Value::Truth(holds))
                if matches!(other, Value::Truth(_) | Value::Condition(_)) =>
            {
                if *holds == is_and {
                    other.clone()
                } else {
                    Value::Truth(!is_and)
                }
            }
            _ => return refuse(part, "two comparisons are needed"),
        })
    }

    fn signed(&mut self, sign: Sign, operand: &Expr) -> Result<Value, Refused> {
        let value = self.value(operand)?;
        match (sign, &value) {
            (Sign::Not, _) => Ok(Value::Truth(!self.truth(operand, &value)?)),
            (Sign::Invert, Value::Condition(condition)) => {
                Ok(Value::Condition(Rc::new(condition.negated())))
            }
            (Sign::Invert, _) => refuse(operand, "a comparison is needed"),
            (Sign::UAdd, Value::Number { .. } | Value::Node(_)) => Ok(value),
            // Of whole numbers, there is one zero only.
            (Sign::USub, Value::Number { value, is_whole }) => Ok(Value::Number {
                value: if *is_whole { 0.0 - value } else { -value },
                is_whole: *is_whole,
            }),
            (_, Value::Truth(_)) => refuse(operand, "a sign before True or False"),
            _ => {
                let node = self.tracer.node(operand, &value)?;
                match sign {
                    Sign::UAdd => Ok(Value::Node(node)),
                    _ => Ok(Value::Node(self.tracer.unary(
                        operand,
                        UnaryOp::Neg,
                        node,
                    )?)),
                }
            }
        }
    }

    fn comparison(&mut self, expression: &Expr) -> Result<Value, Refused> {
        let Expr::Compare(chain) = expression else {
            return refuse(expression, "a comparison is needed");
        };
        let mut left = self.value(&chain.left)?;
        let mut found = Value::Truth(true);
        for (index, (op, operand)) in chain.ops.iter().zip(&*chain.comparators).enumerate() {
            if index > 0 && !self.truth(expression, &found)? {
                return Ok(found);
            }
            let right = self.value(operand)?;
            found = self.compared(operand, *op, &left, &right)?;
            left = right;
        }
        Ok(found)
    }

    /// The comparison of two values.
    pub fn compared(
        &mut self,
        part: &impl Ranged,
        op: CmpOp,
        left: &Value,
        right: &Value,
    ) -> Result<Value, Refused> {
        let (is_greater, is_strict) = match op {
            CmpOp::Gt => (true, true),
            CmpOp::GtE => (true, false),
            CmpOp::Lt => (false, true),
            CmpOp::LtE => (false, false),
            CmpOp::Eq | CmpOp::NotEq => {
                return refuse(
                    part,
                    "`==` holds in instants only: write `>`, `>=`, `<` or `<=`",
                )
            }
            _ => return refuse(part, "this comparison is not read here"),
        };
        let (first, second) = if is_greater {
            (left, right)
        } else {
            (right, left)
        };
        if let (Some((a, _)), Some((b, _))) = (number(first), number(second)) {
            return Ok(Value::Truth(if is_strict { a > b } else { a >= b }));
        }
        let (a, b) = self.operands(part, first, second)?;
        let difference = self.tracer.binary(part, BinaryOp::Sub, a, b)?;
        self.tracer.compare(part, difference, is_strict)
    }
}

/// A number of Python, and whether it is a whole one by its type.
pub fn number(value: &Value) -> Option<(f64, bool)> {
    match value {
        Value::Number { value, is_whole } => Some((*value, *is_whole)),
        _ => None,
    }
}

/// Arithmetic of Python on two numbers.
fn arithmetic(
    part: &impl Ranged,
    op: BinaryOp,
    (a, is_whole_a): (f64, bool),
    (b, is_whole_b): (f64, bool),
) -> Result<Value, Refused> {
    let is_whole = is_whole_a && is_whole_b;
    let value = match op {
        BinaryOp::Add => a + b,
        BinaryOp::Sub => a - b,
        BinaryOp::Mul => a * b,
        BinaryOp::Div if b == 0.0 => return refuse(part, "a division by zero"),
        BinaryOp::Div => return Ok(Value::float(a / b)),
        // Products of whole numbers are exact; the last digit of other powers is that of a platform.
        BinaryOp::Pow if is_whole && (0.0..64.0).contains(&b) => a.powi(b as i32),
        _ => {
            return refuse(
                part,
                "a power of two numbers is read for whole ones only: write its value",
            )
        }
    };
    if is_whole && value.abs() > LARGEST_WHOLE {
        return refuse(part, "a whole number this large is not read here");
    }
    Ok(Value::Number { value, is_whole })
}

fn what_it_is(expression: &Expr) -> &'static str {
    match expression {
        Expr::Lambda(_) => "a lambda is not read here: write a def",
        Expr::ListComp(_) | Expr::SetComp(_) | Expr::DictComp(_) | Expr::Generator(_) => {
            "a comprehension is not read here: write its terms out"
        }
        Expr::Slice(_) => "a slice is not read here: name the entries",
        Expr::StringLiteral(_) | Expr::FString(_) | Expr::BytesLiteral(_) => "a text is no number",
        Expr::NoneLiteral(_) => "None is no number",
        Expr::Starred(_) => "a star before an argument is not read here",
        Expr::Dict(_) | Expr::Set(_) => "a dict or a set is not read here",
        Expr::Named(_) => "`:=` is not read here",
        _ => "this expression is not read here",
    }
}
