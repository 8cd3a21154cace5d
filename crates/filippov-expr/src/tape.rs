//! The portable interpreter: a straight list of instructions over reused slots.

use std::cell::RefCell;

use rustc_hash::FxHashMap;

use crate::enclosure::{Enclosure, Motion};
use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::schedule::Schedule;

/// Programs with at most this many slots work on the stack.
const STACK_SLOTS: usize = 64;
/// The same for bounds of short programs: a slot of bounds takes four words to clear.
const FEW_SLOTS: usize = 8;

thread_local! {
    /// Slots of larger programs, kept between calls so that evaluation does not allocate.
    static SLOTS: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

/// The arguments of a program.
#[derive(Clone, Copy)]
pub(crate) struct Arguments<'a> {
    pub t: f64,
    pub x: &'a [f64],
    pub s: &'a [f64],
    pub p: &'a [f64],
    pub v: &'a [f64],
}

/// What the instructions work on: numbers, or bounds of them.
pub(crate) trait Number: Copy {
    /// A number that does not move.
    fn constant(value: f64) -> Self;
    /// A function of one operand.
    fn unary(self, op: UnaryOp) -> Self;
    /// A function of two operands.
    fn binary(self, op: BinaryOp, b: Self) -> Self;
    /// The product with itself.
    fn square(self) -> Self {
        self.binary(BinaryOp::Mul, self)
    }
}

impl Number for f64 {
    #[inline]
    fn constant(value: f64) -> Self {
        value
    }

    #[inline]
    fn unary(self, op: UnaryOp) -> Self {
        op.apply(self)
    }

    #[inline]
    fn binary(self, op: BinaryOp, b: Self) -> Self {
        op.apply(self, b)
    }
}

/// Where the instructions find the values of variables.
trait Variables<N> {
    fn time(&self) -> N;
    fn state(&self, index: usize) -> N;
    fn parameter(&self, index: usize) -> N;
    fn input(&self, index: usize) -> N;
    fn signs(&self) -> &[f64];
}

impl Variables<f64> for Arguments<'_> {
    #[inline]
    fn time(&self) -> f64 {
        self.t
    }

    #[inline]
    fn state(&self, index: usize) -> f64 {
        self.x[index]
    }

    #[inline]
    fn parameter(&self, index: usize) -> f64 {
        self.p[index]
    }

    #[inline]
    fn input(&self, index: usize) -> f64 {
        self.v[index]
    }

    #[inline]
    fn signs(&self) -> &[f64] {
        self.s
    }
}

/// A piece of motion, with signs and parameters.
struct Piece<'a> {
    motion: &'a dyn Motion,
    s: &'a [f64],
    p: &'a [f64],
}

impl Variables<Enclosure> for Piece<'_> {
    fn time(&self) -> Enclosure {
        Enclosure::time(self.motion.time())
    }

    fn state(&self, index: usize) -> Enclosure {
        self.motion.state(index)
    }

    fn parameter(&self, index: usize) -> Enclosure {
        Enclosure::constant(self.p[index])
    }

    fn input(&self, _: usize) -> Enclosure {
        Enclosure::UNKNOWN
    }

    fn signs(&self) -> &[f64] {
        self.s
    }
}

/// One step: compute a value into the slot `to`, or store a slot as an output.
#[derive(Debug, Clone, Copy)]
enum Instruction {
    Constant {
        value: f64,
        to: u32,
    },
    Time {
        to: u32,
    },
    State {
        index: u32,
        to: u32,
    },
    Parameter {
        index: u32,
        to: u32,
    },
    Sign {
        index: u32,
        to: u32,
    },
    Input {
        index: u32,
        to: u32,
    },
    Add {
        a: u32,
        b: u32,
        to: u32,
    },
    Sub {
        a: u32,
        b: u32,
        to: u32,
    },
    Mul {
        a: u32,
        b: u32,
        to: u32,
    },
    Div {
        a: u32,
        b: u32,
        to: u32,
    },
    Unary {
        op: UnaryOp,
        a: u32,
        to: u32,
    },
    Binary {
        op: BinaryOp,
        a: u32,
        b: u32,
        to: u32,
    },
    Select {
        sign: u32,
        plus: u32,
        minus: u32,
        to: u32,
    },
    Store {
        from: u32,
        output: u32,
    },
}

/// An interpreted program.
#[derive(Debug, Clone)]
pub(crate) struct Tape {
    instructions: Vec<Instruction>,
    n_slots: usize,
}

impl Tape {
    pub fn new(graph: &Graph, schedule: &Schedule) -> Self {
        let mut slots = Slots::new(schedule);
        let mut instructions = Vec::with_capacity(schedule.order.len() + schedule.stores.len());
        let mut stores = schedule.stores.iter().peekable();
        for (position, &id) in schedule.order.iter().enumerate() {
            let node = *graph.node(id);
            // Operands are released before the result gets its slot: it may take over one of theirs.
            let operands: Vec<u32> = node.operands().map(|operand| slots.slot(operand)).collect();
            for operand in node.operands() {
                slots.release(operand, position);
            }
            let to = slots.take(id);
            instructions.push(instruction(node, &operands, to));
            while let Some(&&(_, output)) = stores.peek().filter(|store| store.0 == position) {
                instructions.push(Instruction::Store { from: to, output });
                stores.next();
            }
            slots.release(id, position);
        }
        Tape {
            instructions,
            n_slots: slots.count as usize,
        }
    }

    /// Runs the program; the caller has checked the lengths.
    pub fn run(&self, arguments: Arguments<'_>, out: &mut [f64]) {
        if self.n_slots <= STACK_SLOTS {
            return self.interpret(&mut [0.0; STACK_SLOTS], &arguments, out);
        }
        let shared = SLOTS.try_with(|slots| {
            let Ok(mut slots) = slots.try_borrow_mut() else {
                return false;
            };
            if slots.len() < self.n_slots {
                slots.resize(self.n_slots, 0.0);
            }
            self.interpret(&mut slots, &arguments, out);
            true
        });
        if shared != Ok(true) {
            // The thread is ending and its storage is gone.
            self.interpret(&mut vec![0.0; self.n_slots], &arguments, out);
        }
    }

    /// Encloses the outputs along a piece of motion; the caller has checked the lengths.
    pub fn enclose(&self, motion: &dyn Motion, s: &[f64], p: &[f64], out: &mut [Enclosure]) {
        let piece = Piece { motion, s, p };
        if self.n_slots <= FEW_SLOTS {
            self.interpret(&mut [Enclosure::UNKNOWN; FEW_SLOTS], &piece, out);
        } else if self.n_slots <= STACK_SLOTS {
            self.interpret(&mut [Enclosure::UNKNOWN; STACK_SLOTS], &piece, out);
        } else {
            self.interpret(&mut vec![Enclosure::UNKNOWN; self.n_slots], &piece, out);
        }
    }

    fn interpret<N: Number>(&self, slots: &mut [N], variables: &impl Variables<N>, out: &mut [N]) {
        let signs = variables.signs();
        for &instruction in &self.instructions {
            let (to, value) = match instruction {
                Instruction::Constant { value, to } => (to, N::constant(value)),
                Instruction::Time { to } => (to, variables.time()),
                Instruction::State { index, to } => (to, variables.state(index as usize)),
                Instruction::Parameter { index, to } => (to, variables.parameter(index as usize)),
                Instruction::Sign { index, to } => (to, N::constant(signs[index as usize])),
                Instruction::Input { index, to } => (to, variables.input(index as usize)),
                Instruction::Add { a, b, to } => (
                    to,
                    slots[a as usize].binary(BinaryOp::Add, slots[b as usize]),
                ),
                Instruction::Sub { a, b, to } => (
                    to,
                    slots[a as usize].binary(BinaryOp::Sub, slots[b as usize]),
                ),
                Instruction::Mul { a, b, to } if a == b => (to, slots[a as usize].square()),
                Instruction::Mul { a, b, to } => (
                    to,
                    slots[a as usize].binary(BinaryOp::Mul, slots[b as usize]),
                ),
                Instruction::Div { a, b, to } => (
                    to,
                    slots[a as usize].binary(BinaryOp::Div, slots[b as usize]),
                ),
                Instruction::Unary { op, a, to } => (to, slots[a as usize].unary(op)),
                Instruction::Binary { op, a, b, to } => {
                    (to, slots[a as usize].binary(op, slots[b as usize]))
                }
                Instruction::Select {
                    sign,
                    plus,
                    minus,
                    to,
                } => (
                    to,
                    slots[if signs[sign as usize] > 0.0 {
                        plus
                    } else {
                        minus
                    } as usize],
                ),
                Instruction::Store { from, output } => {
                    out[output as usize] = slots[from as usize];
                    continue;
                }
            };
            slots[to as usize] = value;
        }
    }
}

fn instruction(node: Node, operands: &[u32], to: u32) -> Instruction {
    match (node, operands) {
        (Node::Constant(value), _) => Instruction::Constant { value, to },
        (Node::State(index), _) => Instruction::State { index, to },
        (Node::Parameter(index), _) => Instruction::Parameter { index, to },
        (Node::Sign(index), _) => Instruction::Sign { index, to },
        (Node::Input(index), _) => Instruction::Input { index, to },
        (Node::Unary(op, _), &[a]) => Instruction::Unary { op, a, to },
        (Node::Binary(op, ..), &[a, b]) => match op {
            BinaryOp::Add => Instruction::Add { a, b, to },
            BinaryOp::Sub => Instruction::Sub { a, b, to },
            BinaryOp::Mul => Instruction::Mul { a, b, to },
            BinaryOp::Div => Instruction::Div { a, b, to },
            _ => Instruction::Binary { op, a, b, to },
        },
        (Node::Select { surface, .. }, &[plus, minus]) => Instruction::Select {
            sign: surface,
            plus,
            minus,
            to,
        },
        _ => Instruction::Time { to },
    }
}

/// Which slot holds which value; a slot is free again after the last use of its value.
struct Slots {
    last_use: FxHashMap<NodeId, usize>,
    of_node: FxHashMap<NodeId, u32>,
    free: Vec<u32>,
    count: u32,
}

impl Slots {
    fn new(schedule: &Schedule) -> Self {
        Slots {
            last_use: schedule.last_use.clone(),
            of_node: FxHashMap::default(),
            free: Vec::new(),
            count: 0,
        }
    }

    fn slot(&self, id: NodeId) -> u32 {
        self.of_node.get(&id).copied().unwrap_or(0)
    }

    fn take(&mut self, id: NodeId) -> u32 {
        let slot = self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            self.count - 1
        });
        self.of_node.insert(id, slot);
        slot
    }

    fn release(&mut self, id: NodeId, position: usize) {
        if self.last_use.get(&id).is_none_or(|&last| last <= position) {
            if let Some(slot) = self.of_node.remove(&id) {
                self.free.push(slot);
            }
        }
    }
}
