//! The recurrences: coefficient k of a row from those of the rows that it is made of.

use super::plan::{Head, Plan, Row, Rule};
use crate::node::NodeId;
use crate::op::{BinaryOp, UnaryOp};

/// What coefficients are made of: numbers, or expressions.
pub(super) trait Arithmetic {
    type Value: Copy;

    fn constant(&mut self, value: f64) -> Self::Value;
    fn time(&mut self) -> Self::Value;
    fn state(&mut self, index: u32) -> Self::Value;
    /// A parameter, a sign or an input.
    fn still(&mut self, leaf: NodeId) -> Self::Value;
    fn unary(&mut self, op: UnaryOp, a: Self::Value) -> Self::Value;
    fn binary(&mut self, op: BinaryOp, a: Self::Value, b: Self::Value) -> Self::Value;
    fn select(&mut self, surface: u32, plus: Self::Value, minus: Self::Value) -> Self::Value;
    fn scaled(&mut self, a: Self::Value, factor: f64) -> Self::Value;
    /// Is the value known to vanish?
    fn is_zero(&self, a: Self::Value) -> bool;
}

/// The coefficients known so far: `row(r)[k]`.
pub(super) struct Table<V> {
    values: Vec<V>,
    stride: usize,
}

impl<V: Copy> Table<V> {
    /// Room for the coefficients up to `order`.
    pub fn new(n_rows: usize, order: usize, zero: V) -> Self {
        Table {
            values: vec![zero; n_rows * (order + 1)],
            stride: order + 1,
        }
    }

    /// Is it of this shape?
    pub fn holds(&self, n_rows: usize, order: usize) -> bool {
        self.stride == order + 1 && self.values.len() == n_rows * self.stride
    }

    pub fn at(&self, row: Row, k: usize) -> V {
        self.values[row * self.stride + k]
    }

    fn set(&mut self, row: Row, k: usize, value: V) {
        self.values[row * self.stride + k] = value;
    }
}

/// Fills the table order by order; states beyond the field stand still.
pub(super) fn fill<A: Arithmetic>(
    plan: &Plan,
    table: &mut Table<A::Value>,
    order: usize,
    ring: &mut A,
) {
    let rounds = &plan.rounds;
    for k in 0..=order {
        if k == 0 || rounds.solved.is_empty() {
            fill_rows(plan, table, k, ring, |_| true);
            continue;
        }
        let zero = ring.constant(0.0);
        rounds.solved.iter().for_each(|s| table.set(s.row, k, zero));
        fill_rows(plan, table, k, ring, |row| rounds.first[row]);
        for solved in &rounds.solved {
            let terms = solved.terms.iter();
            let terms = terms.map(|&(equation, entry)| (table.at(equation, k), table.at(entry, 0)));
            let value = solve(ring, terms);
            table.set(solved.row, k, value);
        }
        fill_rows(plan, table, k, ring, |row| rounds.second[row]);
    }
}

/// Minus the sum of products.
fn solve<A: Arithmetic>(
    ring: &mut A,
    terms: impl Iterator<Item = (A::Value, A::Value)>,
) -> A::Value {
    let mut sum = ring.constant(0.0);
    for (value, entry) in terms {
        if !ring.is_zero(value) {
            let term = ring.binary(BinaryOp::Mul, entry, value);
            sum = ring.binary(BinaryOp::Sub, sum, term);
        }
    }
    sum
}

/// Coefficient k of the rows that are wanted.
fn fill_rows<A: Arithmetic>(
    plan: &Plan,
    table: &mut Table<A::Value>,
    k: usize,
    ring: &mut A,
    is_wanted: impl Fn(Row) -> bool,
) {
    for (row, rule) in plan.rules.iter().enumerate() {
        if !is_wanted(row) {
            continue;
        }
        let value = match *rule {
            Rule::State(i) if k > 0 => match plan.field.get(i as usize) {
                Some(&rate) => {
                    let rate = table.at(rate, k - 1);
                    ring.scaled(rate, 1.0 / k as f64)
                }
                None => ring.constant(0.0),
            },
            rule => Coefficient {
                table,
                ring,
                row,
                k,
            }
            .of(rule),
        };
        table.set(row, k, value);
    }
}

/// One coefficient that is being computed.
struct Coefficient<'a, A: Arithmetic> {
    table: &'a Table<A::Value>,
    ring: &'a mut A,
    row: Row,
    k: usize,
}

impl<A: Arithmetic> Coefficient<'_, A> {
    fn of(&mut self, rule: Rule) -> A::Value {
        let k = self.k;
        match rule {
            Rule::Constant(value) if k == 0 => self.ring.constant(value),
            Rule::Time if k == 0 => self.ring.time(),
            Rule::State(i) => self.ring.state(i),
            Rule::Still(leaf) | Rule::Multiplier(leaf) if k == 0 => self.ring.still(leaf),
            Rule::Constant(_) | Rule::Still(_) | Rule::Multiplier(_) => self.ring.constant(0.0),
            Rule::Time => self.ring.constant(if k == 1 { 1.0 } else { 0.0 }),
            Rule::Neg(a) => self.ring.unary(UnaryOp::Neg, self.table.at(a, k)),
            Rule::Add(a, b) => self.add(self.table.at(a, k), self.table.at(b, k)),
            Rule::Sub(a, b) => self.sub(self.table.at(a, k), self.table.at(b, k)),
            Rule::Mul(a, b) => self.product(a, b),
            Rule::Div(a, b) => self.quotient(a, b),
            Rule::Shift(a, shift) if k == 0 => {
                let shift = self.ring.constant(shift);
                self.add(self.table.at(a, 0), shift)
            }
            Rule::Shift(a, _) => self.table.at(a, k),
            Rule::Select {
                surface,
                plus,
                minus,
            } => {
                let (plus, minus) = (self.table.at(plus, k), self.table.at(minus, k));
                self.ring.select(surface, plus, minus)
            }
            Rule::Scale(_, _, head)
            | Rule::Chain { head, .. }
            | Rule::InverseChain { head, .. }
            | Rule::Power { head, .. }
            | Rule::PowerOf { head, .. }
                if k == 0 =>
            {
                self.head(head)
            }
            Rule::Angle { y, x, .. } if k == 0 => self.head(Head::Binary(BinaryOp::Atan2, y, x)),
            Rule::Scale(a, factor, _) => self.ring.scaled(self.table.at(a, k), factor),
            Rule::Chain {
                of, weight, factor, ..
            } => {
                let sum = self.weighted(1..k + 1, of, weight);
                self.ring.scaled(sum, factor / k as f64)
            }
            Rule::InverseChain {
                of, weight, factor, ..
            } => {
                // k w_0 c_k = factor k a_k - sum j c_j w_{k-j}
                let sum = self.weighted(1..k, self.row, weight);
                let known = self.ring.scaled(sum, 1.0 / k as f64);
                let driven = self.ring.scaled(self.table.at(of, k), factor);
                let rest = self.sub(driven, known);
                self.over(rest, weight)
            }
            Rule::Power { of, exponent, .. } => self.power(of, exponent),
            Rule::PowerOf { of, exponent, .. } => self.power_of(of, exponent),
            Rule::Angle { y, x, weight } => self.angle(y, x, weight),
        }
    }

    fn head(&mut self, head: Head) -> A::Value {
        match head {
            Head::Unary(op, a) => self.ring.unary(op, self.table.at(a, 0)),
            Head::Binary(op, a, b) => {
                let (a, b) = (self.table.at(a, 0), self.table.at(b, 0));
                self.ring.binary(op, a, b)
            }
        }
    }

    fn add(&mut self, a: A::Value, b: A::Value) -> A::Value {
        match (self.ring.is_zero(a), self.ring.is_zero(b)) {
            (true, _) => b,
            (_, true) => a,
            _ => self.ring.binary(BinaryOp::Add, a, b),
        }
    }

    fn sub(&mut self, a: A::Value, b: A::Value) -> A::Value {
        match (self.ring.is_zero(a), self.ring.is_zero(b)) {
            (_, true) => a,
            (true, _) => self.ring.unary(UnaryOp::Neg, b),
            _ => self.ring.binary(BinaryOp::Sub, a, b),
        }
    }

    fn mul(&mut self, a: A::Value, b: A::Value) -> A::Value {
        if self.ring.is_zero(a) || self.ring.is_zero(b) {
            return self.ring.constant(0.0);
        }
        self.ring.binary(BinaryOp::Mul, a, b)
    }

    /// `a` divided by the lowest coefficient of a row.
    fn over(&mut self, a: A::Value, row: Row) -> A::Value {
        if self.ring.is_zero(a) {
            return a;
        }
        self.ring.binary(BinaryOp::Div, a, self.table.at(row, 0))
    }

    /// sum a_j b_{k-j}
    fn product(&mut self, a: Row, b: Row) -> A::Value {
        let mut sum = self.ring.constant(0.0);
        if a == b {
            // Every pair comes twice.
            for j in 0..self.k.div_ceil(2) {
                let term = self.mul(self.table.at(a, j), self.table.at(a, self.k - j));
                sum = self.add(sum, term);
            }
            sum = self.ring.scaled(sum, 2.0);
            if self.k.is_multiple_of(2) {
                let middle = self.table.at(a, self.k / 2);
                let term = self.mul(middle, middle);
                sum = self.add(sum, term);
            }
            return sum;
        }
        // The coefficients of order k come last: the rest is the same whatever they are.
        let ends: &[usize] = if self.k == 0 { &[0] } else { &[0, self.k] };
        for j in (1..self.k).chain(ends.iter().copied()) {
            let term = self.mul(self.table.at(a, j), self.table.at(b, self.k - j));
            sum = self.add(sum, term);
        }
        sum
    }

    /// b_0 c_k = a_k - sum_{j>0} b_j c_{k-j}
    fn quotient(&mut self, a: Row, b: Row) -> A::Value {
        let mut rest = self.table.at(a, self.k);
        for j in 1..=self.k {
            let term = self.mul(self.table.at(b, j), self.table.at(self.row, self.k - j));
            rest = self.sub(rest, term);
        }
        self.over(rest, b)
    }

    /// sum of j a_j w_{k-j} over a range of j
    fn weighted(&mut self, range: std::ops::Range<usize>, a: Row, weight: Row) -> A::Value {
        let mut sum = self.ring.constant(0.0);
        for j in range {
            let a = self.ring.scaled(self.table.at(a, j), j as f64);
            let term = self.mul(a, self.table.at(weight, self.k - j));
            sum = self.add(sum, term);
        }
        sum
    }

    /// k a_0 c_k = sum_{j>0} (r j - (k - j)) a_j c_{k-j}
    fn power(&mut self, a: Row, exponent: f64) -> A::Value {
        let mut sum = self.ring.constant(0.0);
        for j in 1..=self.k {
            let factor = exponent * j as f64 - (self.k - j) as f64;
            if factor != 0.0 {
                let term = self.mul(self.table.at(a, j), self.table.at(self.row, self.k - j));
                let term = self.ring.scaled(term, factor / self.k as f64);
                sum = self.add(sum, term);
            }
        }
        self.over(sum, a)
    }

    fn power_of(&mut self, a: Row, exponent: Row) -> A::Value {
        let exponent = self.table.at(exponent, 0);
        let mut sum = self.ring.constant(0.0);
        for j in 1..=self.k {
            let term = self.mul(self.table.at(a, j), self.table.at(self.row, self.k - j));
            if self.ring.is_zero(term) {
                continue;
            }
            let rising = self.ring.scaled(exponent, j as f64);
            let falling = self.ring.constant((self.k - j) as f64);
            let factor = self.sub(rising, falling);
            let term = self.mul(factor, term);
            sum = self.add(sum, term);
        }
        let sum = self.ring.scaled(sum, 1.0 / self.k as f64);
        self.over(sum, a)
    }

    /// k w_0 c_k = sum j (a_j b_{k-j} - b_j a_{k-j}) - sum_{j<k} j c_j w_{k-j}
    fn angle(&mut self, y: Row, x: Row, weight: Row) -> A::Value {
        let rising = self.weighted(1..self.k + 1, y, x);
        let falling = self.weighted(1..self.k + 1, x, y);
        let known = self.weighted(1..self.k, self.row, weight);
        let turning = self.sub(rising, falling);
        let rest = self.sub(turning, known);
        let rest = self.ring.scaled(rest, 1.0 / self.k as f64);
        self.over(rest, weight)
    }
}
