use crate::{Graph, Node, UnaryOp};

#[test]
fn operands_come_first() {
    let mut g = Graph::new();
    assert!(g.is_empty());
    let (x, y) = (g.state(0), g.state(1));
    let sum = g.add(y, x);
    let sine = g.unary(UnaryOp::Sin, sum);
    let abs = g.abs(sine);
    assert!(g.contains(abs) && abs.index() < g.len());
    for k in 0..g.len() as u32 {
        assert!(g
            .node(crate::NodeId(k))
            .operands()
            .all(|operand| operand.0 < k));
    }
    assert_eq!(*g.node(sine), Node::Unary(UnaryOp::Sin, sum));
}

#[test]
fn all_nan_are_one_node() {
    let mut g = Graph::new();
    assert_eq!(g.constant(f64::NAN), g.constant(-f64::NAN));
}
