//! The regularised system of a piecewise-smooth one: smooth functions replace its signs.

use rustc_hash::FxHashMap;

use crate::graph::Graph;
use crate::linear::LinearForm;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::region::Regions;
use crate::switching::Switching;

/// The function that takes the place of a sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ramp {
    /// `tanh(u)`.
    Tanh,
    /// `clip(u, -1, 1)`.
    Linear,
}

impl Graph {
    /// A new graph with these values in which the sign of every surface j is a function of `kappa[j] * h_j / eps`. In between
    /// the values are those of the multilinear interpolant, however they were written (see [`Graph::blended`]); `None` if they
    /// have none that can be written out. A kink, as |h_j|, is smooth by itself, and what contains it is a function of that.
    ///
    /// `eps` is the parameter with this index. Only a linear ramp leaves surfaces, where it bends.
    ///
    /// # Example
    /// ```
    /// use filippov_expr::{regularized::Ramp, Graph, Names};
    /// let mut g = Graph::new();
    /// let v = g.state(0);
    /// let sign = g.sign(v);
    /// let (smooth, values) = g.regularized(&[sign], 0, &[2.0], Ramp::Tanh).expect("one sign is in no other one's way");
    /// assert_eq!(smooth.text(values[0], &Names::default()), "tanh(2*x[0]/p[0])");
    /// assert_eq!(smooth.n_surfaces(), 0);
    /// ```
    pub fn regularized(
        &self,
        roots: &[NodeId],
        eps: u32,
        kappa: &[f64],
        ramp: Ramp,
    ) -> Option<(Graph, Vec<NodeId>)> {
        let all: Vec<u32> = (0..self.n_surfaces() as u32).collect();
        let mut own = self.clone();
        let functions = all.iter().map(|&j| own.surface(j));
        let values: Vec<NodeId> = roots.iter().copied().chain(functions).collect();
        let values = own.with_smooth_kinks(&values);
        let values = own.blended(&values, &all)?;
        let (roots, functions) = values.split_at(roots.len());
        let mut graph = Graph::new();
        let eps = graph.parameter(eps);
        let mut image: FxHashMap<NodeId, NodeId> = FxHashMap::default();
        let mut signs: FxHashMap<u32, NodeId> = FxHashMap::default();
        // A switching function may have a larger number than the sign that it decides.
        let mut pending = roots.to_vec();
        while let Some(&id) = pending.last() {
            let node = *own.node(id);
            let surface = match node {
                Node::Input(j) => Some(j),
                _ => node.surface(),
            };
            let function = surface.map(|j| functions[j as usize]);
            let missing: Vec<NodeId> = node
                .operands()
                .chain(function)
                .filter(|operand| !image.contains_key(operand))
                .collect();
            if !missing.is_empty() {
                pending.extend(missing);
                continue;
            }
            pending.pop();
            let sign = surface.map(|j| {
                *signs.entry(j).or_insert_with(|| {
                    let factor = graph.constant(kappa[j as usize]);
                    let scaled = graph.mul(factor, image[&functions[j as usize]]);
                    let u = graph.div(scaled, eps);
                    graph.ramp(u, ramp)
                })
            });
            let new = match (node, sign) {
                (_, Some(sign)) => sign,
                (Node::Unary(op, a), _) => graph.unary(op, image[&a]),
                (Node::Binary(op, a, b), _) => graph.binary(op, image[&a], image[&b]),
                _ => graph.insert(node),
            };
            image.insert(id, new);
        }
        let values = roots.iter().map(|root| image[root]).collect();
        Some((graph, values))
    }

    /// The values in which input j takes the place of the sign of surface j at its kinks: in products of the sign with what
    /// vanishes at h_j = 0, and in choices between two values that are the same there.
    fn with_smooth_kinks(&mut self, roots: &[NodeId]) -> Vec<NodeId> {
        let mut regions = Regions::new(self.clone(), Vec::new(), Vec::new());
        let mut image: FxHashMap<NodeId, NodeId> = FxHashMap::default();
        for id in self.all_below(roots) {
            let of = |operand: NodeId| image.get(&operand).copied().unwrap_or(operand);
            let node = *self.node(id);
            let new = match (node, self.signed_product(&node)) {
                (_, Some((j, factor, other))) if regions.is_zero_on(other, j) => {
                    let (sign, factor) = (self.input(j), self.constant(factor));
                    let scaled = self.mul(factor, sign);
                    self.mul(scaled, of(other))
                }
                (
                    Node::Select {
                        surface,
                        plus,
                        minus,
                    },
                    _,
                ) if regions.is_same_on(plus, minus, surface) => {
                    let sign = self.input(surface);
                    self.weighted(sign, of(plus), of(minus))
                }
                _ => self.with_operands(id, of),
            };
            image.insert(id, new);
        }
        roots.iter().map(|root| image[root]).collect()
    }

    /// The surface, the factor of its sign, and the other operand, of a product with a multiple of a sign.
    fn signed_product(&self, node: &Node) -> Option<(u32, f64, NodeId)> {
        let Node::Binary(BinaryOp::Mul, a, b) = *node else {
            return None;
        };
        [(a, b), (b, a)].into_iter().find_map(|(a, b)| {
            let form = LinearForm::of(self, a);
            match form.terms[..] {
                [(atom, factor)] if form.constant == 0.0 => match *self.node(atom) {
                    Node::Sign(j) => Some((j, factor, b)),
                    _ => None,
                },
                _ => None,
            }
        })
    }

    fn ramp(&mut self, u: NodeId, ramp: Ramp) -> NodeId {
        match ramp {
            Ramp::Tanh => self.unary(UnaryOp::Tanh, u),
            Ramp::Linear => {
                let (one, minus_one) = (self.constant(1.0), self.constant(-1.0));
                let above = self.maximum(u, minus_one);
                // Not the minimum of that and 1: this would be a surface made of another one.
                let beyond = self.sub(u, one);
                match self.switch(beyond) {
                    Switching::Constant(sign) if sign > 0.0 => one,
                    Switching::Constant(_) => above,
                    Switching::Surface { index, orientation } => {
                        self.select(index, orientation, one, above)
                    }
                }
            }
        }
    }

    /// `minus` at the sign -1, `plus` at +1, and on the straight line between them.
    pub fn between(&mut self, sign: NodeId, plus: NodeId, minus: NodeId) -> NodeId {
        let half = self.constant(0.5);
        let sum = self.add(plus, minus);
        let mean = self.mul(half, sum);
        let difference = self.sub(plus, minus);
        let radius = self.mul(half, difference);
        let change = self.mul(sign, radius);
        self.add(mean, change)
    }
}
