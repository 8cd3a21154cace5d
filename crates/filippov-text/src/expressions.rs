//! Expressions.

use std::rc::Rc;

use filippov_expr::{BinaryOp, NodeId, UnaryOp};
use ruff_python_ast::{BoolOp, CmpOp, Comprehension, Expr, Number, Operator, UnaryOp as Sign};
use ruff_text_size::Ranged;

use crate::arrays::items_of;
use crate::calls::MOST_ENTRIES;
use crate::laws::Laws;
use crate::reader::Reader;
use crate::unreadable::{refuse, Refused};
use crate::values::{Scope, Value};

/// The largest whole number that is kept to the last digit.
const LARGEST_WHOLE: f64 = 9_007_199_254_740_992.0;
/// The largest power of a number that is multiplied out.
const LARGEST_POWER: f64 = 64.0;

/// What is done with each value of a comprehension.
pub type OfEach<'f, 'a> = dyn FnMut(&mut Reader<'a>, Value) -> Result<(), Refused> + 'f;

impl<'a> Reader<'a> {
    /// The value of an expression.
    pub fn value(&mut self, expression: &Expr) -> Result<Value, Refused> {
        match expression {
            Expr::NumberLiteral(literal) => match &literal.value {
                Number::Float(value) => Ok(Value::float(*value)),
                Number::Int(value) => {
                    let value = value.as_i64().map(|value| value as f64);
                    match value.filter(|value| *value <= LARGEST_WHOLE) {
                        Some(value) => Ok(Value::whole(value)),
                        None => refuse(literal, "a whole number this large is not read here"),
                    }
                }
                Number::Complex { .. } => refuse(literal, "a complex number"),
            },
            Expr::BooleanLiteral(literal) => Ok(Value::Truth(literal.value)),
            Expr::NoneLiteral(_) => Ok(Value::Nothing),
            Expr::StringLiteral(literal) => Ok(Value::Text(literal.value.to_str().into())),
            Expr::Name(_) | Expr::Attribute(_) => self.named(expression),
            Expr::Tuple(tuple) => Ok(Value::tuple(self.listed(&tuple.elts)?)),
            Expr::List(list) => Ok(Value::list(self.listed(&list.elts)?)),
            Expr::ListComp(list) => self.collected(&list.elt, &list.generators),
            Expr::Generator(list) => self.collected(&list.elt, &list.generators),
            Expr::Dict(dict) => {
                let mut pairs = Vec::new();
                for item in &dict.items {
                    let Some(key) = &item.key else {
                        return refuse(dict, "** in a dict is not read here");
                    };
                    pairs.push((self.value(key)?, self.value(&item.value)?));
                }
                // Of equal keys the last one counts.
                pairs.reverse();
                Ok(Value::Dict(Rc::new(pairs)))
            }
            Expr::Lambda(lambda) => Ok(Value::Function(Rc::new(self.lambda(lambda)?))),
            Expr::Subscript(part) => self.entry(&part.value, &part.slice),
            Expr::BinOp(operation) => {
                let left = self.value(&operation.left)?;
                let right = self.value(&operation.right)?;
                self.operation(operation, operation.op, &left, &right)
            }
            Expr::UnaryOp(operation) => {
                let value = self.value(&operation.operand)?;
                self.signed(&*operation.operand, operation.op, &value)
            }
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

    /// The values of a list, with those behind a star.
    pub fn listed(&mut self, items: &[Expr]) -> Result<Vec<Value>, Refused> {
        let mut values = Vec::with_capacity(items.len());
        for item in items {
            match item {
                Expr::Starred(star) => self.for_each(&star.value, &mut |_, value| {
                    values.push(value);
                    Ok(())
                })?,
                item => values.push(self.value(item)?),
            }
        }
        Ok(values)
    }

    fn collected(
        &mut self,
        element: &Expr,
        generators: &[Comprehension],
    ) -> Result<Value, Refused> {
        let mut values = Vec::new();
        self.comprehend(element, generators, &mut |_, value| {
            values.push(value);
            Ok(())
        })?;
        Ok(Value::list(values))
    }

    /// Hands over the items of a list, an array or a generator, each as soon as it is there.
    pub fn for_each(&mut self, values: &Expr, each: &mut OfEach<'_, 'a>) -> Result<(), Refused> {
        if let Expr::Generator(list) = values {
            return self.comprehend(&list.elt, &list.generators, each);
        }
        let found = self.value(values)?;
        let items = items_of(values, &found)?;
        items.into_iter().try_for_each(|item| each(self, item))
    }

    fn comprehend(
        &mut self,
        element: &Expr,
        generators: &[Comprehension],
        each: &mut OfEach<'_, 'a>,
    ) -> Result<(), Refused> {
        let Some((first, others)) = generators.split_first() else {
            let value = self.value(element)?;
            return each(self, value);
        };
        let values = self.value(&first.iter)?;
        let around = Rc::clone(&self.scope);
        self.scope = Scope::inside(&around);
        let mut done = Ok(());
        for item in items_of(&first.iter, &values)? {
            done = self.turn_of(first, &item, element, others, each);
            if done.is_err() {
                break;
            }
        }
        self.scope = around;
        done
    }

    fn turn_of(
        &mut self,
        generator: &Comprehension,
        item: &Value,
        element: &Expr,
        others: &[Comprehension],
        each: &mut OfEach<'_, 'a>,
    ) -> Result<(), Refused> {
        self.take_turn(&generator.target)?;
        self.bind(&generator.target, item)?;
        for test in &generator.ifs {
            if !self.holds(test)? {
                return Ok(());
            }
        }
        self.comprehend(element, others, each)
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
            Value::Node(node) => match self.tracer.known_sign(*node) {
                Some(sign) => Ok(sign != 0.0),
                None => refuse(part, "a comparison is needed: write `v > 0`"),
            },
            _ => refuse(part, "a comparison is needed: write `v > 0`"),
        }
    }

    /// A name of the function, of the text around it, or of a library.
    fn named(&mut self, expression: &Expr) -> Result<Value, Refused> {
        if let Expr::Name(name) = expression {
            if let Some(value) = self.scope.get(name.id.as_str()) {
                return Ok(value);
            }
        }
        match self.name_in_library(expression).as_deref() {
            Some("numpy.pi" | "math.pi") => Ok(Value::float(std::f64::consts::PI)),
            Some("numpy.e" | "math.e") => Ok(Value::float(std::f64::consts::E)),
            Some("math.tau") => Ok(Value::float(std::f64::consts::TAU)),
            Some(name) => refuse(expression, format!("{name} is not read here")),
            None => match expression {
                Expr::Name(name) => {
                    refuse(expression, format!("the name {} is not known", name.id))
                }
                Expr::Attribute(part) => self.attribute(part),
                _ => refuse(expression, "an attribute that is not read here"),
            },
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
        if operator == Operator::MatMult {
            return self.matrix_product(part, left, right);
        }
        let is_array = |value: &Value| matches!(value, Value::Array(_));
        if is_array(left) || is_array(right) {
            return self.by_elements(part, left, right, &mut |reader, a, b| {
                reader.operation(part, operator, a, b)
            });
        }
        match (operator, left, right) {
            (Operator::Add, Value::List(a), Value::List(b)) if a.is_tuple == b.is_tuple => {
                let joined = [a.items(), b.items()].concat();
                return Ok(match a.is_tuple {
                    true => Value::tuple(joined),
                    false => Value::list(joined),
                });
            }
            (Operator::Mult, Value::List(list), times)
            | (Operator::Mult, times, Value::List(list)) => {
                let Value::Number {
                    value,
                    is_whole: true,
                } = *times
                else {
                    return refuse(
                        part,
                        "a list is repeated, not multiplied: write np.array([...])",
                    );
                };
                let items = list.items();
                if value * items.len() as f64 > MOST_ENTRIES as f64 {
                    return refuse(part, "a list this long is not read here");
                }
                let repeated = vec![items; value.max(0.0) as usize].concat();
                return Ok(match list.is_tuple {
                    true => Value::tuple(repeated),
                    false => Value::list(repeated),
                });
            }
            _ => {}
        }
        let op = match operator {
            Operator::Add => BinaryOp::Add,
            Operator::Sub => BinaryOp::Sub,
            Operator::Mult => BinaryOp::Mul,
            Operator::Div => BinaryOp::Div,
            Operator::Pow => BinaryOp::Pow,
            Operator::BitAnd | Operator::BitOr | Operator::BitXor => {
                return self.logic(part, operator, left, right)
            }
            Operator::FloorDiv => return self.whole_quotient(part, left, right),
            Operator::Mod => return self.remainder(part, left, right),
            _ => return refuse(part, "this operator is not read here"),
        };
        if let (Some(left), Some(right)) = (number(left), number(right)) {
            return arithmetic(part, op, left, right);
        }
        let are_truths = self.is_truth(left) && self.is_truth(right);
        if op == BinaryOp::Add && are_truths {
            let error = "`+` of two comparisons is a logical or in NumPy: write `|`, or 1.0 * (v > 0) for a number";
            return refuse(part, error);
        }
        let (a, b) = self.operands(part, left, right)?;
        self.tracer.place = part.range();
        let found = self.tracer.operation(op, a, b);
        if op == BinaryOp::Mul && are_truths {
            self.tracer.truths.insert(found);
        }
        Ok(Value::Node(found))
    }

    /// Is it a comparison in NumPy: one, or a product of such?
    fn is_truth(&self, value: &Value) -> bool {
        match value {
            Value::Condition(_) | Value::Truth(_) => true,
            Value::Node(node) => self.tracer.truths.contains(node),
            _ => false,
        }
    }

    /// `a // b`.
    pub fn whole_quotient(
        &mut self,
        part: &impl Ranged,
        left: &Value,
        right: &Value,
    ) -> Result<Value, Refused> {
        if number(right).is_some_and(|(value, _)| value == 0.0) {
            return refuse(part, "a remainder, or a whole quotient, by 0");
        }
        let quotient = self.operation(part, Operator::Div, left, right)?;
        let floor = self.floor(part, &quotient)?;
        let is_whole = |value: &Value| number(value).is_some_and(|(_, is_whole)| is_whole);
        Ok(match (floor, is_whole(left) && is_whole(right)) {
            (Value::Number { value, .. }, is_whole) => Value::Number { value, is_whole },
            (other, _) => other,
        })
    }

    /// `a % b`.
    pub fn remainder(
        &mut self,
        part: &impl Ranged,
        left: &Value,
        right: &Value,
    ) -> Result<Value, Refused> {
        if let (Some((a, true)), Some((b, true))) = (number(left), number(right)) {
            if b != 0.0 {
                return Ok(Value::whole(a - b * (a / b).floor()));
            }
        }
        if number(left).is_some() && number(right).is_some() {
            return refuse(part, "a remainder of two numbers: write its value");
        }
        let whole = self.whole_quotient(part, left, right)?;
        let product = self.operation(part, Operator::Mult, right, &whole)?;
        self.operation(part, Operator::Sub, left, &product)
    }

    /// The largest whole number that is not above a value.
    pub fn floor(&mut self, part: &impl Ranged, value: &Value) -> Result<Value, Refused> {
        if let Some((value, _)) = number(value) {
            return Ok(Value::float(value.floor()));
        }
        let node = self.node(part, value)?;
        self.tracer.place = part.range();
        Ok(Value::Node(Laws::floor(self.tracer, node)?))
    }

    /// The nodes of two values: Python asks the traced one of the two first.
    fn operands(
        &mut self,
        part: &impl Ranged,
        left: &Value,
        right: &Value,
    ) -> Result<(NodeId, NodeId), Refused> {
        if number(left).is_some() {
            let b = self.node(part, right)?;
            return Ok((self.node(part, left)?, b));
        }
        let a = self.node(part, left)?;
        Ok((a, self.node(part, right)?))
    }

    /// Both conditions, one of them at least, or exactly one of them.
    pub fn logic(
        &mut self,
        part: &impl Ranged,
        operator: Operator,
        left: &Value,
        right: &Value,
    ) -> Result<Value, Refused> {
        Ok(match (left, right) {
            (Value::Condition(a), Value::Condition(b)) => {
                let joined = match operator {
                    Operator::BitAnd => a.and(b),
                    Operator::BitOr => a.or(b),
                    _ => a.exactly_one(b),
                };
                Value::Condition(Rc::new(joined))
            }
            (Value::Truth(holds), other) | (other, Value::Truth(holds))
                if matches!(other, Value::Truth(_) | Value::Condition(_)) =>
            {
                let opposite = |value: &Value| match value {
                    Value::Condition(condition) => Value::Condition(Rc::new(condition.negated())),
                    Value::Truth(holds) => Value::Truth(!holds),
                    other => other.clone(),
                };
                match (operator, holds) {
                    (Operator::BitXor, true) => opposite(other),
                    (Operator::BitAnd, true) | (Operator::BitOr | Operator::BitXor, false) => {
                        other.clone()
                    }
                    (Operator::BitAnd, false) => Value::Truth(false),
                    _ => Value::Truth(true),
                }
            }
            _ => return refuse(part, "two comparisons are needed"),
        })
    }

    /// A value with a sign in front, or its opposite.
    pub fn signed(
        &mut self,
        part: &impl Ranged,
        sign: Sign,
        value: &Value,
    ) -> Result<Value, Refused> {
        match (sign, value) {
            (Sign::Not, _) => Ok(Value::Truth(!self.truth(part, value)?)),
            (_, Value::Array(_)) => {
                self.by_element(value, &mut |reader, item| reader.signed(part, sign, item))
            }
            (Sign::Invert, Value::Condition(condition)) => {
                Ok(Value::Condition(Rc::new(condition.negated())))
            }
            (Sign::Invert, _) => refuse(part, "a comparison is needed"),
            (Sign::UAdd, Value::Number { .. } | Value::Node(_)) => Ok(value.clone()),
            // Of whole numbers, there is one zero only.
            (Sign::USub, &Value::Number { value, is_whole }) => Ok(Value::Number {
                value: if is_whole { 0.0 - value } else { -value },
                is_whole,
            }),
            (_, Value::Truth(_)) => refuse(part, "a sign before True or False"),
            _ => {
                let node = self.node(part, value)?;
                Ok(Value::Node(match sign {
                    Sign::UAdd => node,
                    _ => self.tracer.unary(UnaryOp::Neg, node),
                }))
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
        let is_array = |value: &Value| matches!(value, Value::Array(_));
        if is_array(left) || is_array(right) {
            for side in [left, right] {
                if let Value::Array(array) = side {
                    if !array.is_traced && !array.is_of_numbers() {
                        return refuse(part, "a comparison of an array that is made of traced values is not read here: write np.stack([...])");
                    }
                }
            }
            return self.by_elements(part, left, right, &mut |reader, a, b| {
                reader.compared(part, op, a, b)
            });
        }
        if let (CmpOp::Is | CmpOp::IsNot, Value::Nothing) = (op, right) {
            return Ok(Value::Truth(
                matches!(left, Value::Nothing) == (op == CmpOp::Is),
            ));
        }
        let (is_greater, is_strict) = match op {
            CmpOp::Gt => (true, true),
            CmpOp::GtE => (true, false),
            CmpOp::Lt => (false, true),
            CmpOp::LtE => (false, false),
            CmpOp::Eq | CmpOp::NotEq => {
                let equal = self.equal(part, left, right)?;
                return match op {
                    CmpOp::Eq => Ok(equal),
                    _ => match equal {
                        Value::Truth(holds) => Ok(Value::Truth(!holds)),
                        other => self.signed(part, Sign::Invert, &other),
                    },
                };
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
        let difference = self.tracer.binary(BinaryOp::Sub, a, b);
        self.tracer.place = part.range();
        Ok(self.tracer.compare(difference, is_strict)?.value())
    }

    fn equal(&mut self, part: &impl Ranged, left: &Value, right: &Value) -> Result<Value, Refused> {
        match (left, right) {
            (Value::Text(a), Value::Text(b)) => return Ok(Value::Truth(a == b)),
            (Value::Number { value: a, .. }, Value::Number { value: b, .. }) => {
                return Ok(Value::Truth(a == b))
            }
            (Value::Node(_), Value::Node(_) | Value::Number { .. }) => {
                let (a, b) = self.operands(part, left, right)?;
                let difference = self.tracer.binary(BinaryOp::Sub, a, b);
                self.tracer.place = part.range();
                if let Some(answer) = self.tracer.equal(difference)? {
                    return Ok(answer.value());
                }
            }
            _ => {}
        }
        refuse(
            part,
            "`==` holds in instants only: write `>`, `>=`, `<` or `<=`",
        )
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
        // A good platform rounds these in the same way; the last digit of other powers differs among platforms.
        _ => match power(a, b) {
            Some(power) => power,
            None => {
                let error = "a power of two numbers is read with a whole exponent: write its value";
                return refuse(part, error);
            }
        },
    };
    if is_whole && value.abs() > LARGEST_WHOLE {
        return refuse(part, "a whole number this large is not read here");
    }
    Ok(Value::Number { value, is_whole })
}

/// A power with a whole exponent, rounded once: the products are kept to twice the digits.
fn power(a: f64, b: f64) -> Option<f64> {
    if b.fract() != 0.0 || !(0.0..=LARGEST_POWER).contains(&b) {
        return None;
    }
    let (mut high, mut low) = (1.0, 0.0);
    for _ in 0..b as u32 {
        let product = high * a;
        let rest = f64::mul_add(high, a, -product) + low * a;
        high = product + rest;
        low = rest - (high - product);
    }
    high.is_finite().then_some(high)
}

fn what_it_is(expression: &Expr) -> &'static str {
    match expression {
        Expr::SetComp(_) | Expr::DictComp(_) => {
            "a comprehension of a dict or a set is not read here"
        }
        Expr::Slice(_) => "a slice stands behind an array or a list",
        Expr::FString(_) | Expr::BytesLiteral(_) => "a text is no number",
        Expr::Starred(_) => "a star is not read here",
        Expr::Set(_) => "a set is not read here",
        Expr::Named(_) => "`:=` is not read here",
        _ => "this expression is not read here",
    }
}
