//! The expressions so far, and the answers to comparisons on the present path.
//!
//! What is done here to a graph is what `python/filippov/trace/` does, in the same order, so that the graphs are the same:
//! this file is `branching.py`, the others are `laws.rs`, `tables.rs` and `questions.rs`.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;
use std::rc::Rc;

use filippov_expr::{
    legs_of_arc, roots, BinaryOp, Graph, Names, NodeId, PartSign, Pieces, Regions, Switching,
    UnaryOp,
};
use ruff_text_size::{Ranged, TextRange};

use crate::constants_of_motion::Constants;
use crate::laws::Laws;
use crate::parts::{condition_of, equality_of, has_known_signs_alone, parts_of, sign_of};
use crate::unreadable::{refuse, Refused};
use crate::values::{Answer, Condition};

/// Most combinations of answers that are followed.
const MOST_PATHS: usize = 256;
/// Combinations of inner signs looked at for each comparison; for each one after several that have more.
const MOST_COMBINATIONS: usize = 1024;
const MOST_AFTER_MANY: usize = 32;
const MANY: usize = 3;
/// An expression that jumps is taken apart into that many parts at most.
const MOST_JUMPING_PARTS: usize = 128;

/// What was asked about an expression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    Comparison { is_strict: bool },
    Sign,
    Quantiser,
    Hysteresis,
}

/// A question, and where in the text it was asked first.
#[derive(Clone, Copy, Debug)]
pub struct Question {
    pub node: NodeId,
    pub kind: Kind,
    pub place: TextRange,
}

/// A root as a function of its argument.
#[derive(Clone, Copy, Debug)]
pub enum Root {
    Square,
    Power(NodeId),
    Cube,
}

/// Traces one system, or one map.
pub struct Tracer {
    pub graph: Graph,
    /// Names of the states and of the parameters, those of laws behind them.
    pub names: Names,
    /// The values of the parameters.
    pub values: Vec<f64>,
    pub laws: Laws,
    pub questions: Vec<Question>,
    /// Expressions of which it was not found out whether they are zero in some region.
    pub unresolved: Vec<NodeId>,
    /// Whether the expressions hold for these values of the parameters only.
    pub is_pinned: bool,
    /// Whether an answer was put together from those in pieces.
    pub has_pieces: bool,
    /// What was compared while the constants of motion are not known, and whether that mattered.
    pub asked: Vec<NodeId>,
    pub is_doubtful: bool,
    /// Products of comparisons: truth values in NumPy.
    pub truths: BTreeSet<NodeId>,
    /// The part of the text that is read now.
    pub place: TextRange,
    constants: Option<Constants>,
    pieces: BTreeMap<(NodeId, bool), Option<Pieces>>,
    signs: BTreeMap<NodeId, f64>,
    continued: Vec<(NodeId, NodeId)>,
    roots: Vec<(NodeId, NodeId, Root)>,
    /// The decisions of the present path, and which of them were made the other way round already.
    path: Vec<(u32, f64)>,
    flipped: Vec<bool>,
    /// The answers given on it.
    answers: BTreeMap<u32, f64>,
}

impl Tracer {
    /// A tracer for a function of these states and parameters. The first trace does not know the constants of motion.
    pub fn new(names: Names, values: Vec<f64>, constants: Option<Constants>) -> Self {
        Tracer {
            graph: Graph::new(),
            laws: Laws::new(values.len()),
            names,
            values,
            questions: Vec::new(),
            unresolved: Vec::new(),
            is_pinned: false,
            has_pieces: false,
            asked: Vec::new(),
            is_doubtful: false,
            truths: BTreeSet::new(),
            place: TextRange::default(),
            constants,
            pieces: BTreeMap::new(),
            signs: BTreeMap::new(),
            continued: Vec::new(),
            roots: Vec::new(),
            path: Vec::new(),
            flipped: Vec::new(),
            answers: BTreeMap::new(),
        }
    }

    /// Follows a function on every path; its results, merged.
    pub fn explore(
        &mut self,
        function: &impl Ranged,
        mut call: impl FnMut(&mut Self) -> Result<Vec<NodeId>, Refused>,
    ) -> Result<Vec<NodeId>, Refused> {
        let mut waiting: Vec<Vec<NodeId>> = Vec::new();
        let mut n_paths = 0;
        self.path.clear();
        self.flipped.clear();
        loop {
            self.answers.clear();
            let mut outcome = call(self)?;
            n_paths += 1;
            let n_open = self
                .flipped
                .iter()
                .filter(|&&is_flipped| !is_flipped)
                .count();
            if n_paths + n_open > MOST_PATHS {
                let error = format!(
                    "the `if`s take more than {MOST_PATHS} paths: write np.where, np.maximum or np.sign"
                );
                return refuse(function, error);
            }
            while self.flipped.last() == Some(&true) {
                self.flipped.pop();
                let (Some((surface, sign)), Some(first)) = (self.path.pop(), waiting.pop()) else {
                    return Ok(outcome);
                };
                let pairs = first.into_iter().zip(outcome);
                let merged = pairs.map(|(a, b)| self.graph.select(surface, -sign, a, b));
                outcome = merged.collect();
            }
            let (Some(last), Some(is_flipped)) = (self.path.last_mut(), self.flipped.last_mut())
            else {
                return Ok(outcome);
            };
            waiting.push(outcome);
            (last.1, *is_flipped) = (-last.1, true);
        }
    }

    /// The answer to a condition on the present path; a new one is answered by yes first.
    pub fn decide(&mut self, condition: &Condition) -> bool {
        match condition {
            &Condition::Comparison {
                surface,
                orientation,
            } => self.decide_side(surface, orientation),
            Condition::Both {
                first,
                second,
                is_opposite,
            } => (self.decide(first) && self.decide(second)) != *is_opposite,
            Condition::BySide {
                surface,
                plus,
                minus,
            } => match self.decide_side(*surface, 1.0) {
                true => self.decide_answer(plus),
                false => self.decide_answer(minus),
            },
        }
    }

    fn decide_answer(&mut self, answer: &Answer) -> bool {
        match answer {
            Answer::Known(holds) => *holds,
            Answer::Open(condition) => self.decide(condition),
        }
    }

    fn decide_side(&mut self, surface: u32, orientation: f64) -> bool {
        let depth = self.answers.len();
        let sign = match self.answers.get(&surface) {
            Some(&sign) => sign,
            None if depth < self.path.len() => self.path[depth].1,
            None => {
                self.path.push((surface, orientation));
                self.flipped.push(false);
                orientation
            }
        };
        self.answers.insert(surface, sign);
        orientation * sign > 0.0
    }

    /// One node where a condition holds, the other one elsewhere.
    pub fn choose(&mut self, condition: &Condition, plus: NodeId, minus: NodeId) -> NodeId {
        match condition {
            &Condition::Comparison {
                surface,
                orientation,
            } => self.graph.select(surface, orientation, plus, minus),
            Condition::Both {
                first,
                second,
                is_opposite,
            } => {
                let (plus, minus) = match is_opposite {
                    true => (minus, plus),
                    false => (plus, minus),
                };
                let inner = self.choose(second, plus, minus);
                self.choose(first, inner, minus)
            }
            Condition::BySide {
                surface,
                plus: above,
                minus: below,
            } => {
                let [above, below] = [above, below].map(|side| match side {
                    Answer::Known(true) => plus,
                    Answer::Known(false) => minus,
                    Answer::Open(condition) => self.choose(condition, plus, minus),
                });
                self.graph.select(*surface, 1.0, above, below)
            }
        }
    }

    // ------------------------------------------------------------ expressions

    pub fn refuse<T>(&self, error: impl Into<String>) -> Result<T, Refused> {
        refuse(&self.place, error)
    }

    /// An expression in print.
    pub fn text(&self, node: NodeId) -> String {
        self.graph.text(node, &self.names)
    }

    pub fn binary(&mut self, op: BinaryOp, a: NodeId, b: NodeId) -> NodeId {
        roots::apply_to_two(&mut self.graph, op, a, b)
    }

    pub fn unary(&mut self, op: UnaryOp, a: NodeId) -> NodeId {
        roots::apply(&mut self.graph, op, a)
    }

    /// A function of an expression as NumPy has it: with roots continued.
    pub fn function(&mut self, op: UnaryOp, a: NodeId) -> NodeId {
        match op {
            UnaryOp::Sqrt => self.root(a, Root::Square),
            UnaryOp::Cbrt => {
                let root = self.unary(op, a);
                self.note_root(root, a, Root::Cube);
                root
            }
            _ => self.unary(op, a),
        }
    }

    /// An operation on two expressions: a power may be a root.
    pub fn operation(&mut self, op: BinaryOp, a: NodeId, b: NodeId) -> NodeId {
        let power = match op {
            BinaryOp::Pow => self.graph.as_constant(b),
            _ => None,
        };
        match power {
            Some(power) if power > 0.0 && power.fract() != 0.0 => self.root(a, Root::Power(b)),
            _ => self.binary(op, a, b),
        }
    }

    /// The sign of an expression.
    pub fn sign(&mut self, node: NodeId) -> Result<NodeId, Refused> {
        let node = self.graph.without_cancelled(node);
        if let Some(known) = self.sign_everywhere(node)? {
            return Ok(self.graph.constant(known));
        }
        if self.is_constant_of_motion(node) {
            return Laws::sign(self, node);
        }
        if Laws::is_held(self, node) {
            let whole = Laws::whole(self, node)?;
            return Ok(self.sign_of_whole_number(whole));
        }
        if let Some(pieces) = self.pieces(node, false)? {
            self.has_pieces = true;
            return sign_of(self, &pieces);
        }
        if self.is_stepwise(node) {
            return Ok(self.sign_of_whole_number(node));
        }
        let node = self.as_surface(node);
        self.ask(node, Kind::Sign);
        Ok(self.graph.sign(node))
    }

    /// The sign of what may be zero for a while, where its sign is 0.
    fn sign_of_whole_number(&mut self, node: NodeId) -> NodeId {
        let sides = [-1.0, 1.0].map(|side| {
            let beside = Laws::beside(self, node, side);
            self.graph.sign(beside)
        });
        let both = self.binary(BinaryOp::Add, sides[0], sides[1]);
        let half = self.graph.constant(0.5);
        self.binary(BinaryOp::Mul, half, both)
    }

    /// The absolute value of an expression.
    pub fn absolute(&mut self, node: NodeId) -> Result<NodeId, Refused> {
        let node = self.graph.without_cancelled(node);
        if let Some(known) = self.sign_everywhere(node)? {
            return Ok(if known >= 0.0 {
                node
            } else {
                self.unary(UnaryOp::Neg, node)
            });
        }
        if self.is_constant_of_motion(node) {
            let sign = Laws::sign(self, node)?;
            return Ok(self.binary(BinaryOp::Mul, sign, node));
        }
        if self.pieces(node, false)?.is_none() && !self.is_stepwise(node) {
            self.switch_as_surface(node, node);
            return Ok(self.graph.abs(node));
        }
        let opposite = self.unary(UnaryOp::Neg, node);
        self.choose_by(node, node, opposite)
    }

    /// The larger or the smaller one of two expressions.
    pub fn extreme(
        &mut self,
        first: NodeId,
        second: NodeId,
        is_largest: bool,
    ) -> Result<NodeId, Refused> {
        let whole = self.binary(BinaryOp::Sub, first, second);
        let difference = self.graph.without_cancelled(whole);
        if let Some(known) = self.sign_everywhere(difference)? {
            return Ok(if (known >= 0.0) == is_largest {
                first
            } else {
                second
            });
        }
        let is_plain = self.pieces(difference, false)?.is_none() && !self.is_stepwise(difference);
        if is_plain && !self.is_constant_of_motion(difference) {
            self.switch_as_surface(whole, difference);
            return Ok(match is_largest {
                true => self.graph.maximum(first, second),
                false => self.graph.minimum(first, second),
            });
        }
        match is_largest {
            true => self.choose_by(difference, first, second),
            false => self.choose_by(difference, second, first),
        }
    }

    /// One node where an expression is not negative, another one elsewhere.
    pub fn choose_by(
        &mut self,
        node: NodeId,
        plus: NodeId,
        minus: NodeId,
    ) -> Result<NodeId, Refused> {
        Ok(match self.compare(node, false)? {
            Answer::Known(true) => plus,
            Answer::Known(false) => minus,
            Answer::Open(condition) => self.choose(&condition, plus, minus),
        })
    }

    /// The condition that an expression is positive, or not negative.
    pub fn compare(&mut self, node: NodeId, is_strict: bool) -> Result<Answer, Refused> {
        let mut node = self.graph.without_cancelled(node);
        let known = match self.sign_everywhere(node)? {
            Some(known) => known,
            None => {
                if self.is_constant_of_motion(node) {
                    node = Laws::sign(self, node)?;
                }
                let side = if is_strict { -1.0 } else { 1.0 };
                if Laws::is_held(self, node) {
                    let whole = Laws::whole(self, node)?;
                    node = Laws::beside(self, whole, side);
                }
                if let Some(pieces) = self.pieces(node, false)? {
                    self.has_pieces = true;
                    return condition_of(self, &pieces, is_strict);
                }
                if self.is_stepwise(node) {
                    node = Laws::beside(self, node, side);
                }
                node = self.as_surface(node);
                self.ask(node, Kind::Comparison { is_strict });
                match self.graph.switch(node) {
                    Switching::Surface { index, orientation } => {
                        let comparison = Condition::Comparison {
                            surface: index,
                            orientation,
                        };
                        return Ok(Answer::Open(Rc::new(comparison)));
                    }
                    Switching::Constant(sign) => sign,
                }
            }
        };
        Ok(Answer::Known(known > 0.0 || !is_strict && known == 0.0))
    }

    /// The sign of an expression if it is the same at all points but single ones.
    fn sign_everywhere(&mut self, node: NodeId) -> Result<Option<f64>, Refused> {
        let mut known = match self.values.is_empty() {
            true => None,
            false => self.known_sign(node),
        };
        if known.is_none() && !self.laws.is_empty() && self.graph.has_signs(node) {
            self.pieces(node, false)?;
            known = self.signs.get(&node).copied();
            self.has_pieces |= known.is_some();
        }
        Ok(known)
    }

    /// The condition that an expression is zero; `None` if that is so at single points only.
    pub fn equal(&mut self, node: NodeId) -> Result<Option<Answer>, Refused> {
        let mut node = self.graph.without_cancelled(node);
        if let Some(known) = self.known_sign(node) {
            return Ok(Some(Answer::Known(known == 0.0)));
        }
        if self.is_constant_of_motion(node) {
            node = Laws::sign(self, node)?;
        }
        if Laws::is_held(self, node) {
            return Ok(Some(self.is_held_at_zero(node)?));
        }
        let pieces = self.pieces(node, true)?;
        self.has_pieces = true;
        let answer = match &pieces {
            Some(pieces) => equality_of(self, pieces)?,
            None => None,
        };
        if answer.is_none() && self.constants.is_none() {
            self.is_doubtful = true;
            return Ok(Some(self.compare(node, true)?));
        }
        Ok(answer)
    }

    /// The condition that an expression of discrete states is zero.
    pub fn is_held_at_zero(&mut self, node: NodeId) -> Result<Answer, Refused> {
        let is_positive = self.compare(node, true)?;
        let opposite = self.unary(UnaryOp::Neg, node);
        let is_negative = self.compare(opposite, true)?;
        Ok(is_positive.negated().and(&is_negative.negated()))
    }

    /// Does an expression contain signs and change only where they or discrete states in it do?
    pub fn is_stepwise(&self, node: NodeId) -> bool {
        self.graph.has_signs(node) && self.graph.is_stepwise(node)
    }

    pub fn is_constant_of_motion(&mut self, node: NodeId) -> bool {
        match &self.constants {
            Some(constants) => constants.have(&self.graph, node),
            None => {
                self.asked.push(node);
                false
            }
        }
    }

    /// An expression in pieces; `None` if it is nowhere seen to be identically zero.
    pub fn pieces(&mut self, node: NodeId, in_full: bool) -> Result<Option<Pieces>, Refused> {
        if let Some(known) = self.pieces.get(&(node, in_full)) {
            return Ok(known.clone());
        }
        if !self.graph.has_signs(node) {
            if Laws::stands_still_in_pieces(self, node) {
                return self.refuse(
                    "a comparison, a floor or a root of a table that stands still in some of its pieces is not read here",
                );
            }
            self.pieces.insert((node, in_full), None);
            return Ok(None);
        }
        let most = match self.unresolved.len() < MANY {
            true => MOST_COMBINATIONS,
            false => MOST_AFTER_MANY,
        };
        let (mut pieces, for_these_values) = self.in_regions(|regions| {
            let pieces = regions.pieces(node, most, in_full);
            (pieces, regions.used_parameters())
        });
        self.is_pinned |= for_these_values;
        if pieces.is_none() && !self.graph.is_stepwise(node) && !self.unresolved.contains(&node) {
            self.unresolved.push(node);
        }
        // An expression of one sign, zeros at single points aside, is left to its surface.
        let is_whole = match &pieces {
            None => true,
            Some(Pieces::Part(_, sign)) => {
                let is_zero = *sign == PartSign::Known(0.0);
                if let (PartSign::Known(sign), false, false) = (*sign, in_full, is_zero) {
                    self.signs.insert(node, sign);
                }
                !in_full && !is_zero
            }
            Some(_) => false,
        };
        if is_whole {
            pieces = match in_full {
                true => None,
                false => self.parts_apart(node)?,
            };
        }
        self.pieces.insert((node, in_full), pieces.clone());
        Ok(pieces)
    }

    /// The parts of an expression that jumps with a sign in it, or has a constant of motion as one: each switches where it
    /// does.
    fn parts_apart(&mut self, node: NodeId) -> Result<Option<Pieces>, Refused> {
        let (parts, for_these_values) = self.in_regions(|regions| {
            let parts = regions.pieces(node, MOST_JUMPING_PARTS, true);
            (parts, regions.used_parameters())
        });
        let Some(parts) = parts.filter(|_| !for_these_values) else {
            return Ok(None);
        };
        let open = parts_of(&parts).into_iter();
        let mut open = open.filter(|(_, sign)| *sign == PartSign::Open);
        let stays = open.any(|(part, _)| self.is_constant_of_motion(part));
        let is_apart = stays || !Laws::reads_any(self, node) && self.jumps(node);
        Ok(is_apart.then_some(parts))
    }

    /// Asks for regions in the graph itself, which receives new nodes.
    fn in_regions<T>(&mut self, ask: impl FnOnce(&mut Regions) -> T) -> T {
        let graph = std::mem::take(&mut self.graph);
        let mut regions = Regions::new(graph, self.values.clone(), self.laws.discrete());
        let answer = ask(&mut regions);
        self.graph = regions.into_graph();
        answer
    }

    /// Regions in a copy of the graph.
    pub fn regions(&self) -> Regions {
        Regions::new(
            self.graph.clone(),
            self.values.clone(),
            self.laws.discrete(),
        )
    }

    /// Does an expression jump where a sign inside of it changes, or is it not seen to be continuous?
    pub fn jumps(&self, node: NodeId) -> bool {
        self.regions().jumps_at(node).is_some()
    }

    // ------------------------------------------------------------------ roots

    fn note_root(&mut self, root: NodeId, argument: NodeId, of: Root) {
        match self.roots.iter_mut().find(|known| known.0 == root) {
            Some(known) => (known.1, known.2) = (argument, of),
            None => self.roots.push((root, argument, of)),
        }
    }

    fn root_of(&mut self, argument: NodeId, of: Root) -> NodeId {
        match of {
            Root::Square => self.unary(UnaryOp::Sqrt, argument),
            Root::Power(power) => self.binary(BinaryOp::Pow, argument, power),
            Root::Cube => self.unary(UnaryOp::Cbrt, argument),
        }
    }

    /// A root, continued beyond the regions of the signs in its argument where needed.
    fn root(&mut self, argument: NodeId, of: Root) -> NodeId {
        let root = self.root_of(argument, of);
        self.note_root(root, argument, of);
        // A refusal of its pieces is that of a table: it has no signs.
        let Ok(Some(pieces)) = self.pieces(argument, true) else {
            return root;
        };
        if !has_known_signs_alone(&pieces) {
            return root;
        }
        let positive = parts_of(&pieces).into_iter();
        let mut parts: Vec<NodeId> = positive
            .filter(|(_, sign)| *sign == PartSign::Known(1.0))
            .map(|(part, _)| part)
            .collect();
        parts.push(argument);
        parts
            .into_iter()
            .for_each(|inner| self.let_continue(inner, of));
        let continued = self.continued.iter().find(|known| known.0 == root);
        match (continued, self.jumps(argument)) {
            (Some(&(_, continued)), true) => continued,
            _ => root,
        }
    }

    /// Lets a root be zero in switching functions where its argument is negative.
    fn let_continue(&mut self, argument: NodeId, of: Root) {
        let inside = self.unary(UnaryOp::NotNegative, argument);
        let continued = self.root_of(inside, of);
        let root = self.root_of(argument, of);
        match self.continued.iter_mut().find(|known| known.0 == root) {
            Some(known) => known.1 = continued,
            None => self.continued.push((root, continued)),
        }
    }

    /// An arc. That of a quotient or of a wave is a choice between two angles, each of which is smooth.
    pub fn arc(&mut self, op: UnaryOp, argument: NodeId) -> Result<NodeId, Refused> {
        let Some((y, x)) = legs_of_arc(&mut self.graph, op, argument) else {
            return Ok(self.unary(op, argument));
        };
        let opposite = match op {
            UnaryOp::Atan => self.unary(UnaryOp::Neg, y),
            _ => y,
        };
        let away = self.unary(UnaryOp::Neg, x);
        let behind = self.binary(BinaryOp::Atan2, opposite, away);
        let ahead = self.binary(BinaryOp::Atan2, y, x);
        let angle = self.choose_by(x, ahead, behind)?;
        if op != UnaryOp::Acos {
            return Ok(angle);
        }
        let right = self.graph.constant(0.5 * PI);
        Ok(self.binary(BinaryOp::Sub, right, angle))
    }

    /// A cube root as sign and size, the size continued in switching functions as a root.
    fn cube_root_by_sign(&mut self, argument: NodeId) -> Result<NodeId, Refused> {
        let third = Root::Power(self.graph.constant(1.0 / 3.0));
        let size = self.absolute(argument)?;
        let negated = self.unary(UnaryOp::Neg, argument);
        for inner in [size, argument, negated] {
            self.let_continue(inner, third);
        }
        let root = self.root_of(size, third);
        self.graph.declare_not_negative(root);
        let sign = self.sign(argument)?;
        Ok(self.binary(BinaryOp::Mul, sign, root))
    }

    /// A field whose cube roots switch with the sign of their argument: at zero they have no slope.
    pub fn with_ends_of_roots(&mut self, field: Vec<NodeId>) -> Result<Vec<NodeId>, Refused> {
        let below = self.graph.all_below(&field);
        let roots = self.roots.clone().into_iter();
        let mut images: Vec<(NodeId, NodeId)> = Vec::new();
        for (root, argument, of) in roots.filter(|(root, ..)| below.binary_search(root).is_ok()) {
            if !self.graph.depends_on_motion(argument) {
                continue;
            }
            let argument = self.graph.substituted(argument, &images);
            if let Root::Cube = of {
                images.push((root, self.cube_root_by_sign(argument)?));
            }
        }
        if images.is_empty() {
            return Ok(field);
        }
        let field = field.into_iter();
        Ok(field
            .map(|component| self.graph.substituted(component, &images))
            .collect())
    }

    /// An expression as a switching function: with its roots continued, also inside of others.
    pub fn as_surface(&mut self, node: NodeId) -> NodeId {
        let mut node = node;
        let images = self.continued.clone();
        for _ in 0..images.len() {
            let before = node;
            node = self.graph.substituted(node, &images);
            if node == before {
                break;
            }
        }
        node
    }

    /// Lets an expression switch where the same one does, written in another way, with its roots continued.
    fn switch_as_surface(&mut self, node: NodeId, same: NodeId) {
        let surface = self.as_surface(same);
        if surface != node {
            self.graph.switch_as(node, surface);
        }
    }

    // ------------------------------------------------- what parameters decide

    /// The sign of an expression of constants and parameters; `None` if it depends on the motion.
    pub fn known_sign(&mut self, node: NodeId) -> Option<f64> {
        let value = self.known_value(node)?;
        self.is_pinned |= self.graph.as_constant(node).is_none();
        Some(if value > 0.0 {
            1.0
        } else if value < 0.0 {
            -1.0
        } else {
            value
        })
    }

    /// The value of an expression of constants and parameters that is a whole number.
    pub fn known_integer(&mut self, node: NodeId) -> Option<i64> {
        let value = self.known_value(node)?;
        if value.fract() != 0.0 || !value.is_finite() {
            return None;
        }
        let bound = self.graph.constant(value);
        let difference = self.binary(BinaryOp::Sub, node, bound);
        self.known_sign(difference);
        Some(value as i64)
    }

    /// The value of an expression of constants and parameters; `None` if it changes in a run.
    pub fn known_value(&mut self, node: NodeId) -> Option<f64> {
        let constant = self.graph.as_constant(node);
        match constant.is_some() || Laws::is_held(self, node) {
            true => constant,
            false => self.graph.value_at(node, &self.values),
        }
    }

    /// Remembers a question.
    pub fn ask(&mut self, node: NodeId, kind: Kind) {
        let is_known = |known: &Question| known.node == node && known.kind == kind;
        if !self.questions.iter().any(is_known) {
            let place = self.place;
            self.questions.push(Question { node, kind, place });
        }
    }
}
