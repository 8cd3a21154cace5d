//! Roots of what is a number in some region: `sqrt(maximum(x, 0))` is the root of x, or 0.
//!
//! Its derivative by the rule for roots is 0/0 where x < 0. So the function is written as a choice, by the signs in its argument.

use crate::graph::Graph;
use crate::node::NodeId;
use crate::op::{BinaryOp, UnaryOp};

/// Signs in an argument, of which all combinations are looked at.
const MOST_SIGNS: usize = 3;

/// A function as it is traced: `op(a)`, with roots by regions.
///
/// # Examples
/// ```
/// use filippov_expr::{roots, Graph, Names, UnaryOp};
///
/// let mut g = Graph::new();
/// let (x, zero) = (g.state(0), g.constant(0.0));
/// let ramp = g.maximum(x, zero);
/// let root = roots::apply(&mut g, UnaryOp::Sqrt, ramp);
/// assert_eq!(g.text(root, &Names::default()), "where(x[0] > 0, sqrt(x[0]), 0)");
/// ```
pub fn apply(graph: &mut Graph, op: UnaryOp, a: NodeId) -> NodeId {
    // The continuation of a root is treated as the root.
    let is_root = matches!(op, UnaryOp::Sqrt | UnaryOp::Cbrt | UnaryOp::NotNegative);
    let choice = is_root.then(|| by_regions(graph, a, &|graph, a| graph.unary(op, a)));
    choice.flatten().unwrap_or_else(|| graph.unary(op, a))
}

/// A function of two values as it is traced: `op(a, b)`, with powers that are roots by regions.
pub fn apply_to_two(graph: &mut Graph, op: BinaryOp, a: NodeId, b: NodeId) -> NodeId {
    let is_root = |exponent: f64| exponent > 0.0 && exponent.fract() != 0.0;
    let is_root = op == BinaryOp::Pow && graph.as_constant(b).is_some_and(is_root);
    let choice = is_root.then(|| by_regions(graph, a, &|graph, a| graph.binary(op, a, b)));
    choice.flatten().unwrap_or_else(|| graph.binary(op, a, b))
}

/// A root of an argument that stands still for some signs in it, as a choice; `None` if there are no such signs, or many.
fn by_regions(
    graph: &mut Graph,
    argument: NodeId,
    root: &dyn Fn(&mut Graph, NodeId) -> NodeId,
) -> Option<NodeId> {
    if !graph.has_signs(argument) {
        return None;
    }
    let depends = graph.sign_dependencies(&[argument], &[]);
    let surfaces = (0..depends.len()).filter(|&j| depends[j]);
    let surfaces: Vec<usize> = surfaces.take(MOST_SIGNS + 1).collect();
    if surfaces.len() > MOST_SIGNS {
        return None;
    }
    let mut signs = vec![None; depends.len()];
    let mut stands_still = false;
    for pattern in 0..1_usize << surfaces.len() {
        for (bit, &j) in surfaces.iter().enumerate() {
            signs[j] = Some(if pattern >> bit & 1 == 1 { 1.0 } else { -1.0 });
        }
        let value = graph.at_signs(&[argument], &signs)[0];
        stands_still |= !graph.depends_on_motion(value);
    }
    if !stands_still {
        return None;
    }
    signs.fill(None);
    let first = surfaces[0];
    let sides = [1.0, -1.0].map(|sign| {
        signs[first] = Some(sign);
        let value = graph.at_signs(&[argument], &signs)[0];
        let choice = by_regions(graph, value, root);
        choice.unwrap_or_else(|| root(graph, value))
    });
    Some(graph.select(first as u32, 1.0, sides[0], sides[1]))
}
