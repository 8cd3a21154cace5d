//! Expressions with signs between -1 and 1: the multilinear interpolant of the fields around a surface.
//!
//! A field f(s) is given at the signs s_j = +-1. Sliding needs it in between, at multipliers in [-1, 1],
//! where it is the *canopy*, the only function that is affine in each sign and agrees with f at +-1:
//!
//! ```text
//! f(s) = sum over k in {-1, 1}^m of prod_j (1 + k_j s_j)/2 f(k)
//! ```
//!
//! An expression as it was traced need not be that function: `select` takes one branch, `exp(s_j*x)` and
//! `(x + s_j)*(y + s_j)` bend in between. [`Graph::blended`] makes it so, without forming the 2^m terms:
//!
//! - sums, and products of factors without a common sign, of interpolants are interpolants already;
//! - everything else is written out over the signs E that stand in its way,
//!   (1 + s_j)/2 (value at s_j = 1) + (1 - s_j)/2 (value at s_j = -1) for j in E: the sign of a select, the
//!   signs that two factors share, all signs inside of a function or a divisor.
//!
//! With more than 3 signs in the way it gives up. Friction of every kind passes: `s*F(|v|)` has
//! one sign, whatever F is. The derivatives by all signs follow in one reverse sweep per value, so a field
//! of n components that contain few signs each costs O(n), whatever the number of surfaces.
//!
//! Reference: Jeffrey, *Dynamics at a switching intersection* (2014); Guglielmi, Hairer (2022), section 2.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::sign_gradient::Sweep;

/// Signs over which one operation is written out, in 2^3 terms at most.
pub const MOST_SIGNS: usize = 3;

/// How some values depend on signs; see [`Graph::sign_dependence`].
#[derive(Debug, Clone, Default)]
pub struct SignDependence {
    /// The values, to be evaluated at any s_j in [-1, 1] for the blended surfaces.
    pub values: Vec<NodeId>,
    /// The surfaces that could be blended, in increasing order.
    pub surfaces: Vec<u32>,
    /// For each value the surfaces it depends on, increasing, with the derivatives by their signs. A derivative
    /// by s_j does not contain s_j.
    pub derivatives: Vec<Vec<(u32, NodeId)>>,
    /// Pairs j < k whose signs are multiplied somewhere: the mixed second derivative is not 0.
    pub couplings: Vec<(u32, u32)>,
}

impl SignDependence {
    /// Are the values affine in the signs of these surfaces together?
    ///
    /// # Example
    /// ```
    /// use filippov_expr::Graph;
    /// let mut g = Graph::new();
    /// let (a, b) = (g.state(0), g.state(1));
    /// let (sign_a, sign_b) = (g.sign(a), g.sign(b));
    /// let (sum, product) = (g.add(sign_a, sign_b), g.mul(sign_a, sign_b));
    /// assert!(g.sign_dependence(&[sum], &[0, 1]).is_affine_in(&[0, 1]));
    /// let both = g.sign_dependence(&[sum, product], &[0, 1]);
    /// assert!(!both.is_affine_in(&[0, 1]) && both.is_affine_in(&[1]));
    /// assert_eq!(both.groups(&[0, 1]), [vec![0, 1]]);
    /// ```
    pub fn is_affine_in(&self, surfaces: &[u32]) -> bool {
        let among: FxHashSet<u32> = surfaces.iter().copied().collect();
        let coupled = |&(j, k): &(u32, u32)| among.contains(&j) && among.contains(&k);
        surfaces
            .iter()
            .all(|j| self.surfaces.binary_search(j).is_ok())
            && !self.couplings.iter().any(coupled)
    }

    /// The surfaces in groups whose signs multiply one another, directly or through others: the values are
    /// a sum of functions of one group each, so a combination costs sum 2^|group| instead of 2^m.
    pub fn groups(&self, surfaces: &[u32]) -> Vec<Vec<u32>> {
        let mut neighbours: FxHashMap<u32, Vec<u32>> = FxHashMap::default();
        for &(j, k) in &self.couplings {
            neighbours.entry(j).or_default().push(k);
            neighbours.entry(k).or_default().push(j);
        }
        let mut left: FxHashSet<u32> = surfaces.iter().copied().collect();
        let mut groups = Vec::new();
        for &first in surfaces {
            if !left.remove(&first) {
                continue;
            }
            let mut group = vec![first];
            let mut seen = 0;
            while let Some(j) = group.get(seen) {
                seen += 1;
                let joined = neighbours.get(j).into_iter().flatten();
                group.extend(
                    joined
                        .copied()
                        .filter(|k| left.remove(k))
                        .collect::<Vec<_>>(),
                );
            }
            group.sort_unstable();
            groups.push(group);
        }
        groups
    }
}

impl Graph {
    /// The values as multilinear functions of the signs of some surfaces, to be evaluated at s_j in [-1, 1];
    /// the other signs stay data in {-1, 1}. `None` if signs are entangled, see the [module](crate::blend).
    ///
    /// At s_j = +-1 they agree with the originals to rounding, where both sides are finite.
    ///
    /// # Example
    /// ```
    /// use filippov_expr::{Graph, Names};
    /// let mut g = Graph::new();
    /// let (x, y) = (g.state(0), g.state(1));
    /// let larger = g.maximum(x, y);
    /// let blended = g.blended(&[larger], &[0]).map(|values| g.text(values[0], &Names::default()));
    /// assert_eq!(
    ///     blended.as_deref(),
    ///     Some("x[0]*(0.5*sign(x[0] - x[1]) + 0.5) + x[1]*(0.5 - 0.5*sign(x[0] - x[1]))")
    /// );
    /// ```
    pub fn blended(&mut self, nodes: &[NodeId], surfaces: &[u32]) -> Option<Vec<NodeId>> {
        let mut blender = Blender::new(self, surfaces);
        let values = blender.blend(nodes);
        blender.entangled.is_empty().then_some(values)
    }

    /// The derivative of the interpolant by one sign, (value at s = 1 - value at s = -1)/2; for any value, blended
    /// or not.
    pub fn sign_derivative(&mut self, node: NodeId, surface: u32) -> NodeId {
        let [above, below] = [1.0, -1.0].map(|sign| self.at_sign(node, surface, sign));
        let difference = self.sub(above, below);
        let half = self.constant(0.5);
        self.mul(half, difference)
    }

    /// Are the values affine in the signs of these surfaces together?
    pub fn is_affine_in_signs(&mut self, nodes: &[NodeId], surfaces: &[u32]) -> bool {
        self.sign_dependence(nodes, surfaces).is_affine_in(surfaces)
    }

    /// How the values depend on the signs of these surfaces: blended in as many of them as possible, with
    /// all derivatives, and which signs multiply one another.
    pub fn sign_dependence(&mut self, nodes: &[NodeId], surfaces: &[u32]) -> SignDependence {
        let mut surfaces = surfaces.to_vec();
        surfaces.sort_unstable();
        surfaces.dedup();
        // Without the entangled signs nothing is in the way that was not: the second round succeeds.
        let values = loop {
            let mut blender = Blender::new(self, &surfaces);
            let values = blender.blend(nodes);
            let entangled = std::mem::take(&mut blender.entangled);
            if entangled.is_empty() {
                break values;
            }
            surfaces.retain(|j| !entangled.contains(j));
        };
        let mut sweep = Sweep::new(self, &surfaces);
        let derivatives: Vec<_> = values.iter().map(|&value| sweep.gradient(value)).collect();
        let couplings = sweep.couplings(&derivatives);
        SignDependence {
            values,
            surfaces,
            derivatives,
            couplings,
        }
    }

    /// The value with one sign fixed.
    fn at_sign(&mut self, node: NodeId, surface: u32, sign: f64) -> NodeId {
        let mut signs = vec![None; surface as usize + 1];
        signs[surface as usize] = Some(sign);
        self.at_signs(&[node], &signs)[0]
    }

    /// The operands of a node that contain a sign.
    pub(crate) fn signed_operands(&self, id: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        let operands = self.node(id).operands();
        operands.filter(|&operand| self.facts(operand).has_sign)
    }
}

/// Membership of surfaces, and the pass that blends their signs.
struct Blender<'g> {
    graph: &'g mut Graph,
    is_blended: Vec<bool>,
    image: FxHashMap<NodeId, NodeId>,
    /// Signs of operations with too many of them.
    entangled: FxHashSet<u32>,
}

/// Which surfaces are meant, by their indices.
pub(crate) fn mask(surfaces: &[u32]) -> Vec<bool> {
    let length = surfaces.iter().map(|&j| j as usize + 1).max().unwrap_or(0);
    let mut mask = vec![false; length];
    for &j in surfaces {
        mask[j as usize] = true;
    }
    mask
}

impl<'g> Blender<'g> {
    fn new(graph: &'g mut Graph, surfaces: &[u32]) -> Self {
        Blender {
            graph,
            is_blended: mask(surfaces),
            image: FxHashMap::default(),
            entangled: FxHashSet::default(),
        }
    }

    fn blend(&mut self, roots: &[NodeId]) -> Vec<NodeId> {
        let graph = &self.graph;
        let signed = roots.iter().copied().filter(|&id| graph.facts(id).has_sign);
        let nodes = graph.reachable_by(signed, |id| graph.signed_operands(id).collect::<Vec<_>>());
        for id in nodes {
            let node = *self.graph.node(id);
            let in_the_way = self.in_the_way(&node);
            let value = if in_the_way.len() > MOST_SIGNS {
                self.entangled.extend(in_the_way);
                id
            } else {
                self.written_out(&node, &in_the_way, &mut Vec::new())
            };
            self.image.insert(id, value);
        }
        roots.iter().map(|&root| self.image_of(root)).collect()
    }

    fn image_of(&self, id: NodeId) -> NodeId {
        self.image.get(&id).copied().unwrap_or(id)
    }

    fn contains(&self, surface: u32) -> bool {
        self.is_blended.get(surface as usize) == Some(&true)
    }

    /// The signs over which an operation has to be written out for its value to be multilinear.
    fn in_the_way(&self, node: &Node) -> Vec<u32> {
        match *node {
            Node::Unary(UnaryOp::Neg, _) => Vec::new(),
            Node::Unary(_, a) => self.signs_of(a),
            Node::Binary(BinaryOp::Add | BinaryOp::Sub, ..) => Vec::new(),
            Node::Binary(BinaryOp::Mul, a, b) => self.common_signs(a, b),
            Node::Binary(BinaryOp::Div, _, b) => self.signs_of(b),
            Node::Binary(_, a, b) => {
                let mut signs = self.signs_of(a);
                signs.extend(self.signs_of(b));
                signs.sort_unstable();
                signs.dedup();
                signs
            }
            Node::Select { surface, .. } if self.contains(surface) => vec![surface],
            _ => Vec::new(),
        }
    }

    fn common_signs(&self, a: NodeId, b: NodeId) -> Vec<u32> {
        if !self.graph.facts(a).has_sign || !self.graph.facts(b).has_sign {
            return Vec::new();
        }
        let others = self.signs_of(b);
        let mut signs = self.signs_of(a);
        signs.retain(|j| others.binary_search(j).is_ok());
        signs
    }

    /// The blended signs that the image of a node contains, increasing.
    fn signs_of(&self, id: NodeId) -> Vec<u32> {
        self.signs_in(self.image_of(id))
    }

    fn signs_in(&self, root: NodeId) -> Vec<u32> {
        if !self.graph.facts(root).has_sign {
            return Vec::new();
        }
        let operands = |id| self.graph.signed_operands(id).collect::<Vec<_>>();
        let nodes = self.graph.reachable_by([root], operands);
        let mut signs: Vec<u32> = nodes
            .into_iter()
            .filter_map(|id| self.graph.node(id).surface())
            .filter(|&j| self.contains(j))
            .collect();
        signs.sort_unstable();
        signs.dedup();
        signs
    }

    /// The operation on the images of its operands, written out over the signs `over`, after those in `fixed`.
    fn written_out(&mut self, node: &Node, over: &[u32], fixed: &mut Vec<(u32, f64)>) -> NodeId {
        let Some((&surface, rest)) = over.split_first() else {
            return self.applied(node, fixed);
        };
        let [above, below] = [1.0, -1.0].map(|sign| {
            fixed.push((surface, sign));
            let value = self.written_out(node, rest, fixed);
            fixed.pop();
            value
        });
        self.graph.mixed(surface, above, below)
    }

    /// The image of an operand with some signs fixed. If they are all it has, the operand itself is smaller, and
    /// free of the weights of sides that are infinite.
    fn at_signs_in(&mut self, operand: NodeId, signs: &[Option<f64>]) -> NodeId {
        let image = self.image_of(operand);
        if signs.is_empty() || !self.graph.facts(image).has_sign {
            return image;
        }
        let original = self.graph.at_signs(&[operand], signs)[0];
        if self.signs_in(original).is_empty() {
            return original;
        }
        self.graph.at_signs(&[image], signs)[0]
    }

    /// The operation on the images of its operands with some signs fixed.
    fn applied(&mut self, node: &Node, fixed: &[(u32, f64)]) -> NodeId {
        let mut signs = Vec::new();
        for &(j, sign) in fixed {
            signs.resize(signs.len().max(j as usize + 1), None);
            signs[j as usize] = Some(sign);
        }
        match *node {
            Node::Unary(op, a) => {
                let a = self.at_signs_in(a, &signs);
                self.graph.unary(op, a)
            }
            Node::Binary(op, a, b) => {
                let (a, b) = (self.at_signs_in(a, &signs), self.at_signs_in(b, &signs));
                self.graph.binary(op, a, b)
            }
            Node::Select {
                surface,
                plus,
                minus,
            } => match fixed.iter().find(|&&(j, _)| j == surface) {
                Some(&(_, sign)) => {
                    let taken = if sign > 0.0 { plus } else { minus };
                    self.at_signs_in(taken, &signs)
                }
                None => {
                    let (plus, minus) = (
                        self.at_signs_in(plus, &signs),
                        self.at_signs_in(minus, &signs),
                    );
                    self.graph.select(surface, 1.0, plus, minus)
                }
            },
            leaf => self.graph.insert(leaf),
        }
    }
}

impl Graph {
    /// The value that goes from `below` at s = -1 to `above` at s = 1; neither contains s.
    fn mixed(&mut self, surface: u32, above: NodeId, below: NodeId) -> NodeId {
        let simplified = self.select(surface, 1.0, above, below);
        match *self.node(simplified) {
            Node::Select { surface: j, .. } if j == surface => {}
            _ => return simplified,
        }
        let sign = self.sign_of(surface);
        self.weighted(sign, above, below)
    }

    /// `below` at the sign -1, `above` at +1, and on the straight line between them; exact at both ends.
    pub(crate) fn weighted(&mut self, sign: NodeId, above: NodeId, below: NodeId) -> NodeId {
        let half = self.constant(0.5);
        let half_sign = self.mul(half, sign);
        let (weight_above, weight_below) = (self.add(half_sign, half), self.sub(half, half_sign));
        let (above, below) = (self.mul(above, weight_above), self.mul(below, weight_below));
        self.add(above, below)
    }
}

#[cfg(test)]
mod tests;
