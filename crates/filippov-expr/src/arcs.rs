//! Arcs that jump or bend, as angles of points: `arctan(tan(u))` jumps, `arcsin(sin(u))` bends sharply.
//!
//! The derivative of an arc has no value there. The angle of a point has one wherever the point is not the origin.

use crate::graph::Graph;
use crate::linear::LinearForm;
use crate::node::{Node, NodeId};
use crate::op::UnaryOp;
use crate::poles::as_quotient;

/// The legs (y, x) of which an arc is the angle where x > 0; `None` where it is left as it is.
///
/// - `arctan(n/d)`: of (n, d), and of (-n, -d) where d < 0. The divisor may vanish along a motion.
/// - `arcsin(sin(u))`: of (sin(u), |cos(u)|), likewise with sine and cosine exchanged, and with -sin(u).
/// - `arccos`: a right angle less the arcsine.
///
/// # Examples
/// ```
/// use filippov_expr::{legs_of_arc, Graph, Names, UnaryOp};
///
/// let mut g = Graph::new();
/// let t = g.time();
/// let tangent = g.unary(UnaryOp::Tan, t);
/// let (y, x) = legs_of_arc(&mut g, UnaryOp::Atan, tangent).unwrap();
/// assert_eq!(g.text(y, &Names::default()), "sin(t)");
/// assert_eq!(g.text(x, &Names::default()), "cos(t)");
/// assert_eq!(legs_of_arc(&mut g, UnaryOp::Asin, y), Some((y, x)));
/// assert_eq!(legs_of_arc(&mut g, UnaryOp::Asin, t), None);
/// ```
pub fn legs_of_arc(graph: &mut Graph, arc: UnaryOp, argument: NodeId) -> Option<(NodeId, NodeId)> {
    if arc == UnaryOp::Atan {
        return as_quotient(graph, argument);
    }
    let (wave, factor) = LinearForm::of(graph, argument).single_atom()?;
    let (other, angle) = match *graph.node(wave) {
        Node::Unary(UnaryOp::Sin, angle) => (UnaryOp::Cos, angle),
        Node::Unary(UnaryOp::Cos, angle) => (UnaryOp::Sin, angle),
        _ => return None,
    };
    let is_wave = factor.abs() == 1.0 && graph.facts(angle).varies;
    is_wave.then(|| (argument, graph.unary(other, angle)))
}
