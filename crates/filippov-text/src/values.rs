//! What names and expressions stand for.

use std::rc::Rc;

use filippov_expr::NodeId;

/// A value.
#[derive(Clone, Debug)]
pub enum Value {
    /// A number of Python.
    Number { value: f64, is_whole: bool },
    /// True or False.
    Truth(bool),
    /// An expression of the time, the states and the parameters.
    Node(NodeId),
    /// A comparison of such.
    Condition(Rc<Condition>),
    /// A tuple, a list or an array.
    List(Vec<Value>),
}

impl Value {
    /// A number that is no whole number by its type.
    pub fn float(value: f64) -> Self {
        Value::Number {
            value,
            is_whole: false,
        }
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
}
