//! What a value depends on: motion, signs, and the field of one sign pattern.

use rustc_hash::FxHashMap;

use crate::graph::Graph;
use crate::node::{Facts, Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};

impl Graph {
    /// Whether the value varies along a motion: it contains the time, a state, a sign or an input.
    /// `false` means constants and parameters only.
    pub fn depends_on_motion(&self, id: NodeId) -> bool {
        self.facts(id).varies
    }

    /// The number that a value is for these parameters, at every time and state; `None` if it is none.
    ///
    /// It is one without a motion in it, and where parameters switch off all that moves: `p x` where p = 0, and `x - p x`
    /// where p = 1.
    pub fn value_at(&self, root: NodeId, parameters: &[f64]) -> Option<f64> {
        // A value as a multiple of another one; of none if it is a number.
        let mut known: FxHashMap<NodeId, (f64, Option<NodeId>)> = FxHashMap::default();
        // One quotient for each divisor: others are multiples of it.
        let mut quotients: FxHashMap<NodeId, NodeId> = FxHashMap::default();
        for id in self.all_below(&[root]) {
            let at = |operand: NodeId| known[&operand];
            let value = match *self.node(id) {
                Node::Constant(value) => (value, None),
                Node::Parameter(k) => match parameters.get(k as usize) {
                    Some(&value) => (value, None),
                    None => (1.0, Some(id)),
                },
                Node::Unary(op, a) => match (op, at(a)) {
                    (_, (a, None)) => (op.apply(a), None),
                    (UnaryOp::Neg, (k, of)) => (-k, of),
                    _ => (1.0, Some(id)),
                },
                Node::Binary(op, a, b) => match (op, at(a), at(b)) {
                    (_, (a, None), (b, None)) => (op.apply(a, b), None),
                    (BinaryOp::Add | BinaryOp::Sub, (a, of), (b, same)) if of == same => {
                        (op.apply(a, b), of)
                    }
                    (BinaryOp::Mul, (a, None), (b, of)) | (BinaryOp::Mul, (b, of), (a, None)) => {
                        (a * b, of)
                    }
                    (BinaryOp::Div, (a, of), (b, None)) => (a / b, of),
                    (BinaryOp::Div, (a, None), _) => (a, Some(*quotients.entry(b).or_insert(id))),
                    (BinaryOp::Pow, _, (0.0, None)) => (1.0, None),
                    _ => (1.0, Some(id)),
                },
                _ => (1.0, Some(id)),
            };
            let is_number = value.0 == 0.0 || value.1.is_none();
            known.insert(id, (value.0, value.1.filter(|_| !is_number)));
        }
        let (value, of) = known[&root];
        of.is_none().then_some(value)
    }

    /// Whether one of the values contains the time.
    pub fn depends_on_time(&self, roots: &[NodeId]) -> bool {
        let below = self.all_below(roots);
        below.iter().any(|&id| matches!(self.node(id), Node::Time))
    }

    /// Whether the value contains a state variable.
    pub fn depends_on_state(&self, id: NodeId) -> bool {
        self.facts(id).has_state
    }

    /// Whether the value contains the sign of a surface.
    pub fn has_signs(&self, id: NodeId) -> bool {
        self.facts(id).has_sign
    }

    /// The indices of the parameters that the value contains.
    pub fn parameters_read(&self, id: NodeId) -> Vec<u32> {
        let below = self.all_below(&[id]);
        let parameters = below.into_iter().filter_map(|id| match *self.node(id) {
            Node::Parameter(index) => Some(index),
            _ => None,
        });
        parameters.collect()
    }

    /// The indices of the parameters that some values contain where signs are as given: of a select only the branch taken
    /// counts, as in [`sign_dependencies`](Self::sign_dependencies).
    pub fn parameters_read_at(&self, roots: &[NodeId], signs: &[f64]) -> Vec<u32> {
        let given = |surface: u32| signs.get(surface as usize).copied();
        let nodes = self.reachable_by(roots.iter().copied(), |id| self.followed(id, given));
        let parameters = nodes.into_iter().filter_map(|id| match *self.node(id) {
            Node::Parameter(index) => Some(index),
            _ => None,
        });
        parameters.collect()
    }

    /// Whether the value contains a parameter with this index or a higher one.
    pub fn depends_on_parameters_from(&self, id: NodeId, first: u32) -> bool {
        self.parameters_read(id).iter().any(|&index| index >= first)
    }

    /// Whether the value is affine in (t, x) with coefficients made of constants and parameters.
    ///
    /// This is read off the structure: `x*y - x*y` simplifies to 0 and is affine, `(x + 1)**2 - x**2` is not.
    /// Nothing that contains a sign or an input is affine.
    pub fn is_affine(&self, id: NodeId) -> bool {
        self.facts(id).affine
    }

    /// As [`is_affine`](Self::is_affine) while no sign changes: signs count as constants, and of a select both branches
    /// are affine.
    pub fn is_affine_between_switches(&self, id: NodeId) -> bool {
        let mut known: FxHashMap<NodeId, Facts> = FxHashMap::default();
        for id in self.all_below(&[id]) {
            let node = self.node(id);
            let mut of = node.operands().map(|operand| known[&operand]);
            let a = of.next().unwrap_or_default();
            let b = of.next().unwrap_or_default();
            let mut facts = Facts::of(node, a, b);
            match node {
                Node::Sign(_) => (facts.varies, facts.affine) = (false, true),
                Node::Select { .. } => {
                    (facts.varies, facts.affine) = (a.varies || b.varies, a.affine && b.affine);
                }
                _ => {}
            }
            known.insert(id, facts);
        }
        known[&id].affine
    }

    /// Replaces parts of an expression: the first node of each pair by the second one.
    pub fn substituted(&mut self, root: NodeId, images: &[(NodeId, NodeId)]) -> NodeId {
        let mut image: FxHashMap<NodeId, NodeId> = images.iter().copied().collect();
        for id in self.all_below(&[root]) {
            let is_changed =
                |operand: &NodeId| image.get(operand).is_some_and(|new| new != operand);
            let operands: Vec<NodeId> = self.node(id).operands().collect();
            if image.contains_key(&id) || !operands.iter().any(is_changed) {
                continue;
            }
            let at = |operand: NodeId| image.get(&operand).copied().unwrap_or(operand);
            let new = self.with_operands(id, at);
            image.insert(id, new);
        }
        image.get(&root).copied().unwrap_or(root)
    }

    /// An expression of another graph, made again here, with the numbers that its parameters have here; `None` if it contains
    /// signs, or a parameter that is not known here.
    pub fn adopted(
        &mut self,
        from: &Graph,
        root: NodeId,
        parameters: &[Option<u32>],
    ) -> Option<NodeId> {
        if from.has_signs(root) {
            return None;
        }
        let mut image: FxHashMap<NodeId, NodeId> = FxHashMap::default();
        for id in from.all_below(&[root]) {
            let made = match *from.node(id) {
                Node::Constant(value) => self.constant(value),
                Node::Unary(op, a) => self.unary(op, image[&a]),
                Node::Binary(op, a, b) => self.binary(op, image[&a], image[&b]),
                Node::Parameter(k) => {
                    let own = parameters.get(k as usize).copied().flatten()?;
                    self.parameter(own)
                }
                leaf => self.insert(leaf),
            };
            image.insert(id, made);
        }
        image.get(&root).copied()
    }

    /// The values with some signs fixed: `Sign(j)` becomes the number, and a select on it the branch taken,
    /// where `signs[j]` is given. Signs beyond the end of `signs` stay free.
    pub fn at_signs(&mut self, roots: &[NodeId], signs: &[Option<f64>]) -> Vec<NodeId> {
        let fixed = |surface: u32| signs.get(surface as usize).copied().flatten();
        let nodes = self.reachable_by(roots.iter().copied(), |id| self.followed(id, fixed));
        let mut image: FxHashMap<NodeId, NodeId> = FxHashMap::default();
        for id in nodes {
            if !self.facts(id).has_sign {
                continue;
            }
            let at = |operand: NodeId| image.get(&operand).copied().unwrap_or(operand);
            let new = match *self.node(id) {
                Node::Sign(j) => match fixed(j) {
                    Some(sign) => self.constant(sign),
                    None => id,
                },
                Node::Select {
                    surface,
                    plus,
                    minus,
                } => match fixed(surface) {
                    Some(sign) => at(if sign > 0.0 { plus } else { minus }),
                    None => self.with_operands(id, at),
                },
                _ => self.with_operands(id, at),
            };
            image.insert(id, new);
        }
        roots
            .iter()
            .map(|root| image.get(root).copied().unwrap_or(*root))
            .collect()
    }

    /// The value with some parameters as numbers.
    pub(crate) fn at_parameters(
        &mut self,
        root: NodeId,
        number: impl Fn(usize) -> Option<f64>,
    ) -> NodeId {
        self.at_numbers(root, |node| match node {
            Node::Parameter(k) => number(k as usize),
            _ => None,
        })
    }

    /// The value with a state variable as a number.
    pub(crate) fn at_state(&mut self, root: NodeId, index: u32, number: f64) -> NodeId {
        self.at_numbers(root, |node| (node == Node::State(index)).then_some(number))
    }

    fn at_numbers(&mut self, root: NodeId, number: impl Fn(Node) -> Option<f64>) -> NodeId {
        let mut image: FxHashMap<NodeId, NodeId> = FxHashMap::default();
        for id in self.all_below(&[root]) {
            let moved = |operand: NodeId| image.get(&operand).copied().unwrap_or(operand);
            let new = match number(*self.node(id)) {
                Some(value) => self.constant(value),
                None if self.node(id).operands().any(|a| moved(a) != a) => {
                    self.with_operands(id, moved)
                }
                None => id,
            };
            image.insert(id, new);
        }
        image[&root]
    }

    /// The operation of a node on other operands.
    pub(crate) fn with_operands(&mut self, id: NodeId, at: impl Fn(NodeId) -> NodeId) -> NodeId {
        match *self.node(id) {
            Node::Unary(op, a) => {
                let a = at(a);
                self.unary(op, a)
            }
            Node::Binary(op, a, b) => {
                let (a, b) = (at(a), at(b));
                self.binary(op, a, b)
            }
            Node::Select {
                surface,
                plus,
                minus,
            } => {
                let (plus, minus) = (at(plus), at(minus));
                self.select(surface, 1.0, plus, minus)
            }
            _ => id,
        }
    }

    /// Which signs can change these values when the others are as given: one entry per surface.
    ///
    /// A select is followed only into the branch that its sign takes; it counts for its own sign. A sign
    /// beyond the end of `signs` is unknown: both branches are followed. No nodes are made.
    pub fn sign_dependencies(&self, roots: &[NodeId], signs: &[f64]) -> Vec<bool> {
        let mut depends = vec![false; self.n_surfaces()];
        let given = |surface: u32| signs.get(surface as usize).copied();
        let relevant = |id: NodeId| {
            let operands = self.followed(id, given);
            operands
                .into_iter()
                .filter(|&operand| self.facts(operand).has_sign)
                .collect::<Vec<_>>()
        };
        let signed = roots
            .iter()
            .copied()
            .filter(|&root| self.facts(root).has_sign);
        for id in self.reachable_by(signed, relevant) {
            let surface = self.node(id).surface();
            if let Some(entry) = surface.and_then(|j| depends.get_mut(j as usize)) {
                *entry = true;
            }
        }
        depends
    }

    /// The operands of a node, of a select with known sign only the one taken.
    fn followed(
        &self,
        id: NodeId,
        sign: impl Fn(u32) -> Option<f64>,
    ) -> impl IntoIterator<Item = NodeId> {
        let node = *self.node(id);
        let taken = match node {
            Node::Select {
                surface,
                plus,
                minus,
            } => sign(surface).map(|s| if s > 0.0 { plus } else { minus }),
            _ => None,
        };
        node.operands()
            .filter(move |&operand| taken.is_none_or(|taken| taken == operand))
    }
}

#[cfg(test)]
mod tests;
