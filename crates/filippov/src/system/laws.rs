//! Laws with memory: discrete states that follow an expression, with the actions that change them.
//!
//! | law | q is | changes where |
//! |---|---|---|
//! | clock | the floor of a g that is affine in t | g is a whole number: known times |
//! | level | the whole number nearest to g | \|g - q\| reaches 0.618 |
//! | held | a step function of a g that no motion changes | the state, or another discrete state, jumps |
//! | hysteresis | +1 above `high`, -1 below `low`, between them as it was | h reaches `high` at -1, `low` at +1 |
//! | piece | how many knots of a table are not above g | g reaches a knot: known times if g is affine in t |
//! | named | g at the start, then as it was set | an action of the user sets it |
//!
//! The step functions are the floor, the sign (-1, 0 or +1), the place among the knots of a table, and the entry of a
//! list. So a table is a polynomial whose coefficients are entries at its piece.
//!
//! The floor of a g that depends on the state is q - 1/2 + sign(g - q)/2, which is the same before and after a change
//! of q: its jumps are those of an ordinary surface g - q = 0, on which the motion may slide.

use std::sync::Arc;

use filippov_expr::{Backend, ExprError, Graph, Node, NodeId, Program, Wrt};
use smallvec::{smallvec, SmallVec};

use super::{PiecewiseSystem, Setting, TracedSystem};
use crate::error::FieldError;
use crate::switch::Kind;
use crate::system::{ActionMap, Clock, Trigger};
use crate::tolerances::{SAME_NUMBER, SAME_TICK};

/// What a discrete state follows; the expressions may contain discrete states of laws before it.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// The floor of an expression that is affine in t and contains no state.
    Clock {
        /// The expression g.
        argument: NodeId,
    },
    /// The whole number nearest to an expression.
    Level {
        /// The expression g.
        argument: NodeId,
        /// The surface g - q = 0.
        surface: usize,
        /// The sign by which the switching function of that surface differs from g - q.
        orientation: f64,
        /// The surface 0.618 - |g - q| = 0.
        guard: usize,
    },
    /// A step function of an expression of other discrete states, and of constants of motion.
    Held {
        /// The expression g.
        argument: NodeId,
        /// The function.
        step: Step,
    },
    /// The number of knots that are not above an expression.
    Piece {
        /// The expression g.
        argument: NodeId,
        /// In increasing order.
        knots: Arc<[f64]>,
        /// The surface that is positive between the knots around g; none if g is affine in t and contains no state.
        guard: Option<usize>,
    },
    /// A number that has a name of its own and that actions of the user set. These laws come before all others.
    Named {
        /// Its value at the start.
        initial: NodeId,
    },
    /// A relay with two thresholds.
    Hysteresis {
        /// The expression h.
        argument: NodeId,
        /// The thresholds.
        thresholds: [NodeId; 2],
        /// The value at a start between the thresholds.
        initial: f64,
        /// The surface q (h - middle) + half of the width = 0.
        guard: usize,
    },
}

/// What is constant between jumps.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// The floor.
    Floor,
    /// The sign, 0 at zero.
    Sign,
    /// The number of knots, in increasing order, that are not above.
    Place(Arc<[f64]>),
    /// A number of a list, NaN beyond its ends.
    Entry {
        /// Where the list begins: at this whole number.
        first: f64,
        /// The list.
        list: Arc<[f64]>,
    },
}

impl Step {
    /// The value at g.
    fn at(&self, g: f64) -> f64 {
        match self {
            Step::Floor => floor(g),
            Step::Sign => sign(g),
            Step::Place(knots) => passed(knots, g, 1.0),
            Step::Entry { first, list } => {
                let place = (g - first).round();
                if place >= 0.0 && place < list.len() as f64 {
                    list[place as usize]
                } else {
                    f64::NAN
                }
            }
        }
    }
}

impl Law {
    /// The nodes that the law refers to.
    pub(crate) fn nodes(&self) -> SmallVec<[NodeId; 3]> {
        match *self {
            Law::Clock { argument }
            | Law::Level { argument, .. }
            | Law::Held { argument, .. }
            | Law::Piece { argument, .. }
            | Law::Named { initial: argument } => smallvec![argument],
            Law::Hysteresis {
                argument,
                thresholds: [low, high],
                ..
            } => smallvec![argument, low, high],
        }
    }

    /// Does the discrete state depend on the past, beside the point?
    pub(crate) fn has_memory(&self) -> bool {
        matches!(self, Law::Hysteresis { .. } | Law::Named { .. })
    }

    /// The surface at which the discrete state changes.
    pub(crate) fn guard(&self) -> Option<usize> {
        match *self {
            Law::Level { guard, .. } | Law::Hysteresis { guard, .. } => Some(guard),
            Law::Piece { guard, .. } => guard,
            Law::Clock { .. } | Law::Held { .. } | Law::Named { .. } => None,
        }
    }

    /// The expressions that the law evaluates: the argument, and two more.
    fn expressions(&self, graph: &mut Graph) -> [NodeId; 3] {
        match *self {
            Law::Clock { argument }
            | Law::Piece {
                argument,
                guard: None,
                ..
            } => [argument, graph.partial(argument, Wrt::Time), argument],
            Law::Level { argument, .. }
            | Law::Piece { argument, .. }
            | Law::Held { argument, .. }
            | Law::Named { initial: argument } => [argument; 3],
            Law::Hysteresis {
                argument,
                thresholds: [low, high],
                ..
            } => [argument, low, high],
        }
    }
}

/// Who reads the discrete state of a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reader {
    /// The field, or a switching function.
    System,
    /// At most functions beside the field. A law with a memory is followed for these in any case.
    Beside,
    /// Nobody. The discrete state is a function of the point, so that a run need not change it.
    Nobody,
}

/// The laws of a system, one per discrete state.
#[derive(Debug)]
pub struct Laws {
    laws: Vec<Law>,
    program: Option<Program>,
    /// The parameter that the argument of a law is, if it is one.
    reads: Vec<Option<usize>>,
    /// So many of the first are named.
    n_named: usize,
    /// Who reads the discrete states.
    readers: Vec<Reader>,
}

/// What triggers a change of a discrete state, what it does, and how it is recorded.
pub struct LawAction {
    /// When.
    pub trigger: Trigger,
    /// What.
    pub map: LawMap,
    /// The index of the discrete state.
    pub index: usize,
    /// The kind of switch; none where only the way changes in which the same field is written, or where the field does not
    /// read the discrete state.
    pub kind: Option<Kind>,
}

/// The change of one discrete state, and of those that are made of it.
pub struct LawMap {
    laws: Arc<Laws>,
    parameters: Vec<f64>,
    index: usize,
    /// What a law of the time alone follows.
    ticking: Ticking,
}

impl Laws {
    /// The laws of the discrete states of a graph, in their order, and who reads these.
    ///
    /// # Errors
    /// If an expression cannot be compiled.
    pub(super) fn new(
        graph: &Graph,
        laws: Vec<Law>,
        readers: Vec<Reader>,
    ) -> Result<Self, ExprError> {
        let mut graph = graph.clone();
        let expressions = laws.iter().flat_map(|law| law.expressions(&mut graph));
        let expressions: Vec<NodeId> = expressions.collect();
        let program = if laws.is_empty() {
            None
        } else {
            Some(Program::compile(
                &graph,
                &expressions,
                Backend::Interpreter,
            )?)
        };
        let reads = laws.iter().map(|law| match *graph.node(law.nodes()[0]) {
            Node::Parameter(index) => Some(index as usize),
            _ => None,
        });
        Ok(Laws {
            reads: reads.collect(),
            n_named: n_named(&laws),
            laws,
            program,
            readers,
        })
    }

    /// The laws of the discrete states of a graph, in their order, all of which something reads.
    ///
    /// # Errors
    /// If an expression cannot be compiled.
    pub fn all_read(graph: &Graph, laws: Vec<Law>) -> Result<Self, ExprError> {
        let readers = vec![Reader::System; laws.len()];
        Laws::new(graph, laws, readers)
    }

    /// The laws.
    pub fn list(&self) -> &[Law] {
        &self.laws
    }

    /// How many discrete states are named: the first ones.
    pub fn n_named(&self) -> usize {
        self.n_named
    }

    /// The indices of the laws that a run does not follow, since nobody reads their discrete states.
    pub fn idle(&self) -> Vec<usize> {
        let indices = 0..self.laws.len();
        indices.filter(|&index| self.is_idle(index)).collect()
    }

    fn is_idle(&self, index: usize) -> bool {
        self.readers[index] == Reader::Nobody
    }

    fn eval(
        &self,
        t: f64,
        x: &[f64],
        signs: &[f64],
        parameters: &[f64],
        q: &[f64],
    ) -> SmallVec<[f64; 16]> {
        let mut out = SmallVec::from_elem(0.0, 3 * self.laws.len());
        if let Some(program) = &self.program {
            let mut all: SmallVec<[f64; 16]> = SmallVec::from_slice(parameters);
            all.extend_from_slice(q);
            program.eval(t, x, signs, &all, &[], &mut out);
        }
        out
    }

    /// Does a discrete state start with another value on the two sides of a threshold, which is no surface of the system and no known
    /// time? The floor of a state is the same on both sides of a change of its level.
    pub(crate) fn has_thresholds(&self, law: usize) -> bool {
        match self.laws[law] {
            Law::Hysteresis { .. } | Law::Held { .. } => true,
            Law::Piece { guard, .. } => guard.is_some(),
            Law::Clock { .. } | Law::Level { .. } | Law::Named { .. } => false,
        }
    }

    /// Does any discrete state start so?
    pub(crate) fn have_thresholds(&self) -> bool {
        (0..self.laws.len()).any(|law| self.has_thresholds(law))
    }

    /// The discrete states at a start at (t, x).
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn start(&self, system: &TracedSystem, t: f64, x: &[f64]) -> Result<Vec<f64>, FieldError> {
        self.go_on(system, (t, x), &[])
    }

    /// The discrete states at a start at (t, x) where another motion ends: those with a memory are as it left them. One that is not
    /// known, or NaN, is as at any start.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn go_on(
        &self,
        system: &TracedSystem,
        at: (f64, &[f64]),
        before: &[f64],
    ) -> Result<Vec<f64>, FieldError> {
        let mut q = vec![0.0; self.laws.len()];
        let all: Vec<usize> = (0..q.len()).collect();
        self.settle(system, at, &all, before, &mut q)?;
        Ok(q)
    }

    /// Does one of the discrete states depend on the past, beside the point?
    pub fn have_memory(&self) -> bool {
        self.laws.iter().any(Law::has_memory)
    }

    /// Brings the discrete states that a run does not follow up to date with a point of it.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn follow_idle(
        &self,
        system: &TracedSystem,
        (t, x): (f64, &[f64]),
        q: &mut [f64],
    ) -> Result<(), FieldError> {
        self.settle(system, (t, x), &self.idle(), &[], q)
    }

    /// Sets some discrete states to what they are at a start at (t, x), with what is remembered of them.
    fn settle(
        &self,
        system: &TracedSystem,
        (t, x): (f64, &[f64]),
        indices: &[usize],
        remembered: &[f64],
        q: &mut [f64],
    ) -> Result<(), FieldError> {
        if indices.is_empty() {
            return Ok(());
        }
        let mut signs = vec![1.0; system.n_surfaces()];
        let mut h = signs.clone();
        // Expressions may contain discrete states and signs of others.
        for _ in 0..=q.len() + signs.len() {
            let before = (q.to_vec(), signs.clone());
            for &index in indices {
                let out = self.eval(t, x, &signs, system.parameters(), q);
                let values = [out[3 * index], out[3 * index + 1], out[3 * index + 2]];
                let memory = remembered.get(index).copied().filter(|q| !q.is_nan());
                q[index] = match &self.laws[index] {
                    Law::Clock { .. } => self.ticking(index, x.len(), system.parameters()).start(t),
                    Law::Level { .. } => values[0].round(),
                    Law::Piece {
                        knots, guard: None, ..
                    } => passed(knots, values[0], values[1]),
                    Law::Piece { knots, .. } => passed(knots, values[0], 1.0),
                    Law::Held { step, .. } => step.at(values[0]),
                    Law::Named { .. } => memory.unwrap_or(values[0]),
                    Law::Hysteresis { initial, .. } => relay(values, memory.unwrap_or(*initial)),
                };
            }
            system.surfaces(&Setting::new(&signs, q).at(t, x), &mut h)?;
            let sides = h.iter().map(|&h| if h < 0.0 { -1.0 } else { 1.0 });
            signs = sides.collect();
            if before.0 == q && before.1 == signs {
                break;
            }
        }
        Ok(())
    }

    /// The actions that change the discrete states in a run with these parameters.
    pub fn actions(self: &Arc<Self>, n_states: usize, parameters: &[f64]) -> Vec<LawAction> {
        let mut actions = Vec::new();
        // What reads one discrete state of a law alone is brought up to date with that.
        let follows_law = |index: usize| {
            let read = self.reads[index].and_then(|p| p.checked_sub(parameters.len()));
            read.is_some_and(|read| read >= self.n_named)
        };
        let follows_jumps =
            |(index, law): (usize, &Law)| matches!(law, Law::Held { .. }) && !follows_law(index);
        let followed = || (0..self.laws.len()).filter(|&index| !self.is_idle(index));
        let first_held = followed().find(|&index| follows_jumps((index, &self.laws[index])));
        for index in followed() {
            let law = &self.laws[index];
            let mut ticking = Ticking::default();
            let (trigger, kind) = match *law {
                Law::Named { .. } => continue,
                // One action brings all of them up to date.
                Law::Held { .. } => match Some(index) == first_held {
                    true => (Trigger::Jump, None),
                    false => continue,
                },
                Law::Piece {
                    guard: Some(guard), ..
                } => (falling(guard), None),
                Law::Piece { ref knots, .. } => {
                    ticking = self.ticking(index, n_states, parameters);
                    (Trigger::Times(ticking.times(knots)), None)
                }
                Law::Clock { .. } => {
                    ticking = self.ticking(index, n_states, parameters);
                    let Some(clock) = ticking.clock() else {
                        continue;
                    };
                    let trigger = Trigger::Clock {
                        clock,
                        at_start: false,
                    };
                    (trigger, Some(Kind::Clock))
                }
                Law::Level { guard, .. } => (falling(guard), None),
                Law::Hysteresis { guard, .. } => (falling(guard), Some(Kind::Reset)),
            };
            let kind = kind.filter(|_| self.readers[index] == Reader::System);
            actions.push(LawAction {
                trigger,
                map: LawMap {
                    laws: Arc::clone(self),
                    parameters: parameters.to_vec(),
                    index,
                    ticking,
                },
                index,
                kind,
            });
        }
        actions
    }

    /// The affine function of a clock.
    fn ticking(&self, index: usize, n_states: usize, parameters: &[f64]) -> Ticking {
        let n_signs = self.program.as_ref().map_or(0, |p| p.lengths().signs);
        let (zeros, signs, q) = (
            vec![0.0; n_states],
            vec![1.0; n_signs],
            vec![0.0; self.laws.len()],
        );
        let at_zero = self.eval(0.0, &zeros, &signs, parameters, &q);
        Ticking {
            offset: at_zero[3 * index],
            rate: at_zero[3 * index + 1],
        }
    }
}

/// The function offset + rate t, whose floor is wanted.
#[derive(Clone, Copy, Default)]
struct Ticking {
    offset: f64,
    rate: f64,
}

impl Ticking {
    /// It is a whole number at the ticks of this clock.
    fn clock(self) -> Option<Clock> {
        (self.rate != 0.0).then(|| Clock {
            period: 1.0 / self.rate.abs(),
            phase: -self.offset / self.rate,
        })
    }

    /// When it is at the knots, in increasing order.
    fn times(self, knots: &[f64]) -> Vec<f64> {
        let time = |knot: &f64| (knot - self.offset) / self.rate;
        match self.rate {
            0.0 => Vec::new(),
            rate if rate > 0.0 => knots.iter().map(time).collect(),
            _ => knots.iter().rev().map(time).collect(),
        }
    }

    /// Its floor just after t.
    fn start(self, t: f64) -> f64 {
        match self.clock() {
            None => floor(self.offset),
            Some(clock) if self.rate > 0.0 => clock.last_up_to(t),
            Some(clock) => -clock.last_up_to(t) - 1.0,
        }
    }
}

/// How many of the laws are named.
pub(crate) fn n_named(laws: &[Law]) -> usize {
    let is_named = |law: &&Law| matches!(law, Law::Named { .. });
    laws.iter().filter(is_named).count()
}

/// How far a number may be off by rounding.
fn rounding_of(value: f64) -> f64 {
    SAME_NUMBER + SAME_TICK * value.abs()
}

/// How many knots are not above g, which moves in the direction of `rate`; one within rounding of g has been passed.
fn passed(knots: &[f64], g: f64, rate: f64) -> f64 {
    let beside = rounding_of(g) * if rate < 0.0 { -1.0 } else { 1.0 };
    knots.partition_point(|&knot| knot <= g + beside) as f64
}

/// The same, looked for at the knot behind `before` first.
fn passed_from(knots: &[f64], before: f64, g: f64, rate: f64) -> f64 {
    let next = before + if rate < 0.0 { -1.0 } else { 1.0 };
    let beside = rounding_of(g) * if rate < 0.0 { -1.0 } else { 1.0 };
    let is_passed = |place: usize| knots.get(place).is_some_and(|&knot| knot <= g + beside);
    let is_next =
        next >= 0.0 && !is_passed(next as usize) && (next == 0.0 || is_passed(next as usize - 1));
    match is_next {
        true => next,
        false => passed(knots, g, rate),
    }
}

/// The piece that g has come to from `piece`: at an end of it the one beyond.
fn piece_beyond(knots: &[f64], piece: f64, g: f64) -> f64 {
    let below = (piece as usize).checked_sub(1).map(|k| knots[k]);
    let above = knots.get(piece as usize).copied();
    let distance = |end: Option<f64>| end.map_or(f64::INFINITY, |end| (g - end).abs());
    let rises = distance(above) <= distance(below);
    let next = if rises { piece + 1.0 } else { piece - 1.0 };
    // After a jump it may be anywhere.
    let located = passed(knots, g, if rises { 1.0 } else { -1.0 });
    if (located - piece).abs() > 1.0 {
        located
    } else {
        next
    }
}

/// The state of a relay at a start: what the thresholds say, between them `initial`.
fn relay([h, low, high]: [f64; 3], initial: f64) -> f64 {
    if h >= high {
        1.0
    } else if h <= low {
        -1.0
    } else {
        initial
    }
}

fn falling(index: usize) -> Trigger {
    Trigger::Surface {
        index,
        direction: -1,
        side: 1,
    }
}

/// -1, 0 or +1.
fn sign(value: f64) -> f64 {
    match value {
        0.0 => 0.0,
        _ => value.signum(),
    }
}

/// The floor; a value within rounding of a whole number is that number.
fn floor(value: f64) -> f64 {
    let nearest = value.round();
    if (value - nearest).abs() <= rounding_of(value) {
        nearest
    } else {
        value.floor()
    }
}

impl ActionMap for LawMap {
    fn law(&self) -> Option<usize> {
        Some(self.index)
    }

    fn moves_state(&self) -> bool {
        false
    }

    fn apply(&self, t: f64, x: &mut [f64], signs: &[f64], q: &mut [f64]) -> Result<(), FieldError> {
        let index = self.index;
        match &self.laws.laws[index] {
            Law::Clock { .. } => q[index] += self.ticking.rate.signum(),
            Law::Hysteresis { .. } => q[index] = -q[index],
            Law::Held { .. } | Law::Named { .. } => {}
            Law::Piece {
                knots, guard: None, ..
            } => {
                let Ticking { offset, rate } = self.ticking;
                q[index] = passed_from(knots, q[index], offset + rate * t, rate);
            }
            Law::Piece { knots, .. } => {
                let out = self.laws.eval(t, x, signs, &self.parameters, q);
                q[index] = piece_beyond(knots, q[index], out[3 * index]);
            }
            Law::Level { .. } => {
                let out = self.laws.eval(t, x, signs, &self.parameters, q);
                let distance = out[3 * index] - q[index];
                // After a jump it may be at 1/2 exactly, where rounding may not move it.
                let next = q[index] + distance.round();
                q[index] = if next == q[index] {
                    q[index] + distance.signum()
                } else {
                    next
                };
            }
        }
        self.bring_held_up_to_date(t, x, signs, q);
        Ok(())
    }

    fn follow(&self, t: f64, x: &[f64], signs: &[f64], q: &mut [f64]) {
        let index = self.index;
        let g = self.laws.eval(t, x, signs, &self.parameters, q)[3 * index];
        if g.is_nan() {
            return;
        }
        match &self.laws.laws[index] {
            Law::Level { .. } if (g - q[index]).abs() <= 0.5 => return,
            Law::Level { .. } => q[index] = g.round(),
            Law::Piece {
                knots,
                guard: Some(_),
                ..
            } => q[index] = passed(knots, g, 1.0),
            _ => return,
        }
        self.bring_held_up_to_date(t, x, signs, q);
    }
}

impl LawMap {
    /// Brings what stands still between jumps up to date with what it reads.
    fn bring_held_up_to_date(&self, t: f64, x: &[f64], signs: &[f64], q: &mut [f64]) {
        for (k, law) in self.laws.laws.iter().enumerate() {
            let Law::Held { step, .. } = law else {
                continue;
            };
            if self.laws.is_idle(k) {
                continue;
            }
            let discrete = self.laws.reads[k].and_then(|p| p.checked_sub(self.parameters.len()));
            let value = match discrete {
                Some(read) => q[read],
                None => self.laws.eval(t, x, signs, &self.parameters, q)[3 * k],
            };
            q[k] = step.at(value);
        }
    }
}
