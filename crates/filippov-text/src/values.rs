//! What names and expressions stand for.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;

use filippov_expr::NodeId;
use ruff_python_ast::{Expr, Parameters, Stmt};

use crate::model::{ResetText, SystemText};

/// A value.
#[derive(Clone, Debug)]
pub enum Value {
    /// A number of Python.
    Number { value: f64, is_whole: bool },
    /// True or False.
    Truth(bool),
    /// None.
    Nothing,
    /// A text.
    Text(Rc<str>),
    /// An expression of the time, the states and the parameters.
    Node(NodeId),
    /// A comparison of such.
    Condition(Rc<Condition>),
    /// A tuple or a list.
    List(Rc<List>),
    /// An array of NumPy.
    Array(Rc<Array>),
    /// A dict of numbers or texts.
    Dict(Rc<Vec<(Value, Value)>>),
    /// A function of the text.
    Function(Rc<Callable>),
    /// A relay, `fl.Hysteresis(...)`, or a sign with static friction, `fl.Stick(...)`.
    Law(Rc<OwnLaw>),
    /// A jump of the state, `fl.Reset(...)`.
    Reset(Rc<ResetText>),
    /// A system, `fl.System(...)`.
    System(Rc<SystemText>),
}

impl Value {
    /// A number that is no whole number by its type.
    pub fn float(value: f64) -> Self {
        Value::Number {
            value,
            is_whole: false,
        }
    }

    /// A whole number.
    pub fn whole(value: f64) -> Self {
        Value::Number {
            value,
            is_whole: true,
        }
    }

    /// A list, which may be changed.
    pub fn list(items: Vec<Value>) -> Self {
        Value::List(Rc::new(List {
            items: RefCell::new(items),
            is_tuple: false,
            is_fixed: Cell::new(false),
        }))
    }

    /// A tuple.
    pub fn tuple(items: Vec<Value>) -> Self {
        Value::List(Rc::new(List {
            items: RefCell::new(items),
            is_tuple: true,
            is_fixed: Cell::new(true),
        }))
    }

    /// The value of a number.
    pub fn number(&self) -> Option<f64> {
        match self {
            Value::Number { value, .. } => Some(*value),
            _ => None,
        }
    }

    /// Is it a number, traced or not, or a truth value?
    pub fn is_scalar(&self) -> bool {
        matches!(
            self,
            Value::Number { .. } | Value::Truth(_) | Value::Node(_) | Value::Condition(_)
        )
    }

    /// Is it a traced number or a comparison of such?
    pub fn is_traced(&self) -> bool {
        match self {
            Value::Node(_) | Value::Condition(_) => true,
            Value::Array(array) => array.is_traced,
            _ => false,
        }
    }

    /// From now on its lists and arrays cannot be changed.
    pub fn fix(&self) {
        match self {
            Value::List(list) => {
                list.is_fixed.set(true);
                list.items.borrow().iter().for_each(Value::fix);
            }
            Value::Array(array) => array.is_fixed.set(true),
            Value::Dict(pairs) => pairs.iter().for_each(|(_, value)| value.fix()),
            _ => {}
        }
    }
}

/// A tuple or a list.
#[derive(Debug)]
pub struct List {
    pub items: RefCell<Vec<Value>>,
    pub is_tuple: bool,
    /// Whether it cannot be changed: a tuple, or a list from outside of the function.
    pub is_fixed: Cell<bool>,
}

impl List {
    /// A copy of its items.
    pub fn items(&self) -> Vec<Value> {
        self.items.borrow().clone()
    }
}

/// An array with one or two axes, row by row.
#[derive(Debug)]
pub struct Array {
    pub shape: Vec<usize>,
    pub items: RefCell<Vec<Value>>,
    /// Whether functions of NumPy go to its elements: the state, and what is made of it. `np.array([v, w])` asks every comparison.
    pub is_traced: bool,
    /// Whether it cannot be changed: an array that is not made by the function, or one of which a part was taken.
    pub is_fixed: Cell<bool>,
}

impl Array {
    pub fn new(shape: Vec<usize>, items: Vec<Value>, is_traced: bool) -> Rc<Self> {
        Rc::new(Array {
            shape,
            items: RefCell::new(items),
            is_traced,
            is_fixed: Cell::new(true),
        })
    }

    /// Does it hold plain numbers alone?
    pub fn is_of_numbers(&self) -> bool {
        let items = self.items.borrow();
        items.iter().all(|item| item.number().is_some())
    }

    /// Its numbers, if it holds plain numbers alone.
    pub fn numbers(&self) -> Option<Vec<f64>> {
        self.items.borrow().iter().map(Value::number).collect()
    }
}

/// A function of the text.
#[derive(Debug)]
pub struct Callable {
    pub name: String,
    pub parameters: Parameters,
    /// The values of the arguments that have defaults, by name.
    pub defaults: BTreeMap<String, Value>,
    pub body: Body,
    /// Where it is written: its names are known in it.
    pub scope: Rc<Scope>,
    /// Where it stands in the text.
    pub range: ruff_text_size::TextRange,
}

impl ruff_text_size::Ranged for Callable {
    fn range(&self) -> ruff_text_size::TextRange {
        self.range
    }
}

impl Callable {
    /// The names of its arguments, in order.
    pub fn arguments(&self) -> Vec<String> {
        let parameters = &self.parameters;
        let all = parameters.posonlyargs.iter().chain(&parameters.args);
        let all = all.chain(&parameters.kwonlyargs);
        all.map(|argument| argument.parameter.name.to_string())
            .collect()
    }
}

/// What a function does.
#[derive(Debug)]
pub enum Body {
    Statements(Vec<Stmt>),
    /// Of a lambda.
    Expression(Expr),
}

/// A law with memory that is written outside of the function.
#[derive(Debug)]
pub enum OwnLaw {
    Hysteresis {
        function: Value,
        low: Value,
        high: Value,
        initial: Value,
    },
    Stick {
        function: Value,
        ratio: Value,
    },
}

/// Names, and those around them.
#[derive(Debug, Default)]
pub struct Scope {
    pub names: RefCell<BTreeMap<String, Value>>,
    pub around: Option<Rc<Scope>>,
}

impl Scope {
    /// Names inside of others.
    pub fn inside(around: &Rc<Scope>) -> Rc<Scope> {
        Rc::new(Scope {
            names: RefCell::default(),
            around: Some(Rc::clone(around)),
        })
    }

    /// What a name stands for.
    pub fn get(&self, name: &str) -> Option<Value> {
        let own = self.names.borrow().get(name).cloned();
        own.or_else(|| self.around.as_ref()?.get(name))
    }

    pub fn set(&self, name: &str, value: Value) {
        self.names.borrow_mut().insert(name.to_owned(), value);
    }
}

/// A condition: the sign of a switching function, or several of them.
#[derive(Clone, Debug)]
pub enum Condition {
    /// `orientation * h > 0`.
    Comparison { surface: u32, orientation: f64 },
    /// Both hold; or, if it is the opposite, not both.
    Both {
        first: Rc<Condition>,
        second: Rc<Condition>,
        is_opposite: bool,
    },
    /// One answer where a switching function is positive, another one where it is negative.
    BySide {
        surface: u32,
        plus: Answer,
        minus: Answer,
    },
}

/// The answer to a comparison.
#[derive(Clone, Debug)]
pub enum Answer {
    Known(bool),
    Open(Rc<Condition>),
}

impl Answer {
    pub fn negated(&self) -> Answer {
        match self {
            Answer::Known(holds) => Answer::Known(!holds),
            Answer::Open(condition) => Answer::Open(Rc::new(condition.negated())),
        }
    }

    pub fn and(&self, other: &Answer) -> Answer {
        match (self, other) {
            (Answer::Known(false), _) | (_, Answer::Known(false)) => Answer::Known(false),
            (Answer::Known(true), answer) | (answer, Answer::Known(true)) => answer.clone(),
            (Answer::Open(a), Answer::Open(b)) => Answer::Open(Rc::new(a.and(b))),
        }
    }

    pub fn value(self) -> Value {
        match self {
            Answer::Known(holds) => Value::Truth(holds),
            Answer::Open(condition) => Value::Condition(condition),
        }
    }
}

impl Condition {
    /// The opposite.
    pub fn negated(&self) -> Condition {
        match self {
            &Condition::Comparison {
                surface,
                orientation,
            } => Condition::Comparison {
                surface,
                orientation: -orientation,
            },
            Condition::Both {
                first,
                second,
                is_opposite,
            } => Condition::Both {
                first: Rc::clone(first),
                second: Rc::clone(second),
                is_opposite: !is_opposite,
            },
            Condition::BySide {
                surface,
                plus,
                minus,
            } => Condition::BySide {
                surface: *surface,
                plus: plus.negated(),
                minus: minus.negated(),
            },
        }
    }

    /// This one and another one.
    pub fn and(self: &Rc<Self>, other: &Rc<Self>) -> Condition {
        Condition::Both {
            first: Rc::clone(self),
            second: Rc::clone(other),
            is_opposite: false,
        }
    }

    /// This one or another one.
    pub fn or(&self, other: &Self) -> Condition {
        Rc::new(self.negated())
            .and(&Rc::new(other.negated()))
            .negated()
    }

    /// Exactly one of the two.
    pub fn exactly_one(self: &Rc<Self>, other: &Rc<Self>) -> Condition {
        let first = self.and(&Rc::new(other.negated()));
        first.or(&Rc::new(self.negated()).and(other))
    }
}
