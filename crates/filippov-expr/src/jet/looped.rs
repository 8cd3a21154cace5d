//! Jets by loops over the orders.

use std::cell::RefCell;

use super::plan::Plan;
use super::recurrence::{fill, Arithmetic, Table};
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};

thread_local! {
    /// The table of the last evaluation, kept so that the next one does not allocate.
    static TABLE: RefCell<Option<Table<f64>>> = const { RefCell::new(None) };
}

/// A plan that is carried out with numbers.
#[derive(Debug)]
pub(super) struct Looped {
    plan: Plan,
    order: usize,
}

impl Looped {
    pub fn new(plan: Plan, order: usize) -> Self {
        Looped { plan, order }
    }

    pub fn eval(&self, t: f64, x: &[f64], s: &[f64], p: &[f64], v: &[f64], out: &mut [f64]) {
        let Looped { plan, order } = self;
        let needed = plan.lengths;
        let is_short = x.len() < needed.states
            || s.len() < needed.signs
            || p.len() < needed.parameters
            || v.len() < needed.inputs;
        if is_short {
            out.fill(f64::NAN);
            return;
        }
        let known = TABLE
            .try_with(|table| table.borrow_mut().take())
            .ok()
            .flatten();
        let fits = |table: &Table<f64>| table.holds(plan.rules.len(), *order);
        let mut table = known
            .filter(fits)
            .unwrap_or_else(|| Table::new(plan.rules.len(), *order, 0.0));
        let mut numbers = Numbers {
            plan,
            t,
            x,
            s,
            p,
            v,
        };
        fill(plan, &mut table, *order, &mut numbers);
        let rows = out.chunks_exact_mut(plan.field.len() + plan.functions.len());
        for (k, row) in rows.take(order + 1).enumerate() {
            let (states, functions) = row.split_at_mut(plan.field.len());
            for (i, (value, &rate)) in states.iter_mut().zip(&plan.field).enumerate() {
                *value = match k {
                    0 => x[i],
                    _ => table.at(rate, k - 1) / k as f64,
                };
            }
            for (value, &function) in functions.iter_mut().zip(&plan.functions) {
                *value = table.at(function, k);
            }
        }
        // A thread that is ending has no place to keep it.
        let _ = TABLE.try_with(|kept| *kept.borrow_mut() = Some(table));
    }
}

struct Numbers<'a> {
    plan: &'a Plan,
    t: f64,
    x: &'a [f64],
    s: &'a [f64],
    p: &'a [f64],
    v: &'a [f64],
}

impl Arithmetic for Numbers<'_> {
    type Value = f64;

    #[inline]
    fn constant(&mut self, value: f64) -> f64 {
        value
    }

    fn time(&mut self) -> f64 {
        self.t
    }

    fn state(&mut self, index: u32) -> f64 {
        self.x[index as usize]
    }

    fn still(&mut self, leaf: NodeId) -> f64 {
        match self.plan.still.get(&leaf) {
            Some(&Node::Parameter(i)) => self.p[i as usize],
            Some(&Node::Sign(j)) => self.s[j as usize],
            Some(&Node::Input(i)) => self.v[i as usize],
            _ => f64::NAN,
        }
    }

    #[inline]
    fn unary(&mut self, op: UnaryOp, a: f64) -> f64 {
        op.apply(a)
    }

    #[inline]
    fn binary(&mut self, op: BinaryOp, a: f64, b: f64) -> f64 {
        op.apply(a, b)
    }

    fn select(&mut self, surface: u32, plus: f64, minus: f64) -> f64 {
        if self.s[surface as usize] > 0.0 {
            plus
        } else {
            minus
        }
    }

    #[inline]
    fn scaled(&mut self, a: f64, factor: f64) -> f64 {
        factor * a
    }

    #[inline]
    fn is_zero(&self, _: f64) -> bool {
        false
    }
}
