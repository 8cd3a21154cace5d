use crate::{BinaryOp, Graph, Names, Node, NodeId, UnaryOp};

fn text(g: &Graph, id: NodeId) -> String {
    g.text(id, &Names::default())
}

#[test]
fn neutral_elements_disappear() {
    let mut g = Graph::new();
    let (x, y, zero, one, minus_one) = (
        g.state(0),
        g.state(1),
        g.constant(0.0),
        g.constant(1.0),
        g.constant(-1.0),
    );
    let minus_x = g.neg(x);
    assert_eq!(g.add(x, zero), x);
    assert_eq!(g.add(zero, x), x);
    assert_eq!(g.sub(x, zero), x);
    assert_eq!(g.sub(zero, x), minus_x);
    assert_eq!(g.mul(x, one), x);
    assert_eq!(g.mul(minus_one, x), minus_x);
    assert_eq!(g.mul(x, zero), zero);
    assert_eq!(g.div(zero, x), zero);
    assert_eq!(g.div(x, one), x);
    assert_eq!(g.div(x, minus_one), minus_x);
    assert_eq!(g.div(x, x), one);
    assert_eq!(g.sub(x, x), zero);
    assert_eq!(g.pow(x, zero), one);
    assert_eq!(g.pow(x, one), x);
    assert_eq!(g.pow(one, x), one);
    assert_eq!(g.neg(minus_x), x);
    let minus_y = g.neg(y);
    let (product, difference) = (g.mul(x, y), g.sub(x, y));
    assert_eq!(g.mul(minus_x, minus_y), product);
    assert_eq!(g.add(x, minus_y), difference);
    assert_eq!(g.sub(minus_y, minus_x), difference);
    assert_eq!(g.add(minus_y, x), difference);
}

#[test]
fn constants_fold() {
    let mut g = Graph::new();
    let (a, b) = (g.constant(2.0), g.constant(3.0));
    let power = g.pow(a, b);
    assert_eq!(g.as_constant(power), Some(8.0));
    let log = g.unary(UnaryOp::Log, a);
    assert_eq!(g.as_constant(log), Some(2.0_f64.ln()));
    let x = g.state(0);
    let scaled = g.mul(a, x);
    let scaled = g.mul(scaled, b);
    assert_eq!(text(&g, scaled), "6*x[0]");
    let nan = g.constant(f64::NAN);
    let sum = g.add(x, nan);
    assert_eq!(sum, nan);
}

#[test]
fn equal_expressions_are_one_node() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    assert_eq!(g.add(x, y), g.add(y, x));
    assert_eq!(g.mul(x, y), g.mul(y, x));
    assert_eq!(
        g.binary(BinaryOp::Hypot, x, y),
        g.binary(BinaryOp::Hypot, y, x)
    );
    assert_ne!(g.sub(x, y), g.sub(y, x));
    let (zero, minus_zero) = (g.constant(0.0), g.constant(-0.0));
    assert_ne!(zero, minus_zero);
    let (difference, twice) = (g.sub(x, y), g.constant(2.0));
    let back = g.sub(y, x);
    assert_eq!(g.neg(difference), back);
    assert_eq!(g.add(x, x), g.mul(twice, x));
}

#[test]
fn sums_keep_their_order() {
    let mut g = Graph::new();
    let (x, one, big) = (g.state(0), g.constant(1.0), g.constant(1e16));
    let sum = g.add(x, big);
    let sum = g.add(sum, one);
    assert_eq!(text(&g, sum), "x[0] + 1e16 + 1");
    let sum = g.sub(sum, big);
    assert_eq!(text(&g, sum), "x[0] + 1e16 + 1 - 1e16");
}

#[test]
fn powers() {
    let mut g = Graph::new();
    let x = g.state(0);
    let mut power = |exponent: f64| {
        let exponent = g.constant(exponent);
        let id = g.pow(x, exponent);
        text(&g, id)
    };
    assert_eq!(power(2.0), "x[0]**2");
    assert_eq!(power(0.5), "sqrt(x[0])");
    assert_eq!(power(-0.5), "1/sqrt(x[0])");
    assert_eq!(power(-1.0), "1/x[0]");
    assert_eq!(power(-2.0), "1/x[0]**2");
    assert_eq!(power(1.5), "x[0]**1.5");
    assert_eq!(power(9.0), "x[0]**9");
    assert_eq!(power(f64::INFINITY), "x[0]**inf");
}

#[test]
fn signs_cancel() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let (s, one) = (g.sign(x), g.constant(1.0));
    assert_eq!(g.mul(s, s), one);
    let abs = g.abs(x);
    assert_eq!(g.mul(s, abs), x);
    assert_eq!(g.mul(abs, s), x);
    assert_eq!(g.mul(abs, abs), g.mul(x, x));
    assert_eq!(g.div(x, abs), s);
    assert_eq!(g.div(abs, x), s);
    assert_eq!(g.div(one, s), s);
    let r = g.sign(y);
    let (a, b) = (g.mul(r, abs), g.mul(s, r));
    assert_eq!(g.mul(a, b), x);
    let scaled = g.constant(3.0);
    let scaled = g.mul(scaled, y);
    let product = g.mul(s, scaled);
    assert_eq!(g.mul(product, s), scaled);
}

#[test]
fn selects_collapse() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let j = g.declare_surface(x);
    let s = g.sign_of(j);
    assert_eq!(g.select(j, 1.0, y, y), y);
    let choice = g.select(j, 1.0, x, y);
    assert_eq!(g.select(j, -1.0, y, x), choice);
    assert_eq!(g.select(j, 1.0, choice, y), choice);
    assert_eq!(g.select(j, 1.0, y, choice), y);
    let (one, minus_one) = (g.constant(1.0), g.constant(-1.0));
    assert_eq!(g.select(j, 1.0, one, minus_one), s);
    let minus_s = g.neg(s);
    assert_eq!(g.select(j, 1.0, minus_one, one), minus_s);
    let (minus_y, signed) = (g.neg(y), g.mul(s, y));
    assert_eq!(g.select(j, 1.0, y, minus_y), signed);
    let (a, b) = (g.sub(x, y), g.sub(y, x));
    let signed = g.mul(s, a);
    assert_eq!(g.select(j, 1.0, a, b), signed);
    let signed = g.mul(s, y);
    assert_eq!(g.select(j, 1.0, signed, x), g.select(j, 1.0, y, x));
}

/// Moving signs past each other would make k nodes for the k-th factor.
#[test]
fn products_of_many_absolute_values_stay_small() {
    let mut g = Graph::new();
    let mut product = g.constant(1.0);
    for i in 0..1000 {
        let x = g.state(i);
        let abs = g.abs(x);
        product = g.mul(product, abs);
    }
    assert!(g.len() < 10_000, "{}", g.len());
    assert!(matches!(g.node(product), Node::Binary(BinaryOp::Mul, ..)));
}

#[test]
fn no_constant_is_negated() {
    let mut g = Graph::new();
    let x = g.state(0);
    let (zero, square) = (g.constant(0.0), g.mul(x, x));
    let opposite = g.neg(square);
    let ratio = g.div(square, opposite);
    assert_eq!(g.as_constant(ratio), Some(-1.0));
    let one = g.constant(1.0);
    let difference = g.sub(zero, one);
    assert_eq!(g.as_constant(difference), Some(-1.0));
}
