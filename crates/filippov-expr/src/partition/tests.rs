use crate::{BinaryOp, Graph, NodeId, UnaryOp};

/// where(s0 > 0, s1*x, where(s2 > 0, sin(x), y)), three declared surfaces.
fn nested() -> (Graph, NodeId) {
    let mut g = Graph::new();
    let (x, y, t) = (g.state(0), g.state(1), g.time());
    for function in [x, y, t] {
        g.declare_surface(function);
    }
    let sign = g.sign_of(1);
    let above = g.mul(sign, x);
    let sine = g.unary(UnaryOp::Sin, x);
    let below = g.select(2, 1.0, sine, y);
    let value = g.select(0, 1.0, above, below);
    (g, value)
}

#[test]
fn dependencies_follow_the_branch_taken() {
    let (g, value) = nested();
    assert_eq!(
        g.sign_dependencies(&[value], &[1.0, 1.0, 1.0]),
        [true, true, false]
    );
    assert_eq!(
        g.sign_dependencies(&[value], &[-1.0, 1.0, 1.0]),
        [true, false, true]
    );
    assert_eq!(g.sign_dependencies(&[value], &[]), [true, true, true]);
    assert_eq!(
        g.sign_dependencies(&[], &[1.0, 1.0, 1.0]),
        [false, false, false]
    );
}

#[test]
fn fixing_signs_folds_selects() {
    let (mut g, value) = nested();
    let before = g.len();
    assert_eq!(g.at_signs(&[value], &[]), [value]);
    assert_eq!(g.len(), before);
    let (x, y) = (g.state(0), g.state(1));
    let minus_x = g.neg(x);
    assert_eq!(
        g.at_signs(&[value, y], &[Some(1.0), Some(-1.0), None]),
        [minus_x, y]
    );
    assert_eq!(g.at_signs(&[value], &[Some(-1.0), None, Some(-1.0)]), [y]);
    let inner = g.at_signs(&[value], &[Some(-1.0)])[0];
    assert_eq!(
        g.sign_dependencies(&[inner], &[1.0; 3]),
        [false, false, true]
    );
}

#[test]
fn affine_expressions() {
    let mut g = Graph::new();
    let (t, x, y, p, v) = (g.time(), g.state(0), g.state(1), g.parameter(0), g.input(0));
    let px = g.mul(p, x);
    let sum = g.add(px, t);
    let ratio = g.div(sum, p);
    let sine = g.unary(UnaryOp::Sin, p);
    let weighted = g.mul(sine, ratio);
    let xy = g.mul(x, y);
    let inverse = g.div(p, x);
    let sign = g.sign(x);
    let signed = g.mul(sign, y);
    let hypot = g.binary(BinaryOp::Hypot, x, y);
    for affine in [t, x, p, px, sum, ratio, sine, weighted] {
        assert!(g.is_affine(affine));
    }
    for other in [xy, inverse, sign, signed, hypot, v] {
        assert!(!g.is_affine(other));
    }
}

#[test]
fn motion() {
    let mut g = Graph::new();
    let (t, x, p, v) = (g.time(), g.state(0), g.parameter(0), g.input(0));
    let sine = g.unary(UnaryOp::Sin, p);
    let sign = g.sign(p);
    let mixed = g.add(sine, x);
    for (id, varies) in [
        (t, true),
        (x, true),
        (p, false),
        (v, true),
        (sine, false),
        (sign, true),
        (mixed, true),
    ] {
        assert_eq!(g.depends_on_motion(id), varies);
    }
}

#[test]
fn between_switches_a_sign_is_a_constant() {
    let mut g = Graph::new();
    let (t, x, y, p) = (g.time(), g.state(0), g.state(1), g.parameter(0));
    let sign = g.sign(x);
    let force = g.mul(sign, y);
    let pull = g.mul(p, t);
    let sum = g.add(force, pull);
    let larger = g.maximum(y, pull);
    let wave = g.unary(UnaryOp::Sin, t);
    let bent = g.mul(larger, wave);
    let product = g.mul(y, t);
    let power = g.mul(sign, product);
    for (node, is_affine) in [
        (sum, true),
        (larger, true),
        (force, true),
        (bent, false),
        (power, false),
    ] {
        assert_eq!(g.is_affine_between_switches(node), is_affine);
        assert!(!g.is_affine(node));
    }
}

#[test]
fn parameters_switch_off_what_moves() {
    let mut g = Graph::new();
    let (x, p, q, one) = (g.state(0), g.parameter(0), g.parameter(1), g.constant(1.0));
    let (px, qx, square) = (g.mul(p, x), g.mul(q, x), g.mul(x, x));
    let divisor = g.add(one, square);
    let (quotient, inverse) = (g.div(p, divisor), g.div(one, divisor));
    let power = g.pow(x, p);
    let wave = g.unary(UnaryOp::Sin, px);
    let (difference, of_one, of_quotients) =
        (g.sub(px, qx), g.sub(x, px), g.sub(quotient, inverse));
    for (value, parameters, exact) in [
        (px, [0.0, 1.0], Some(0.0)),
        (px, [2.0, 1.0], None),
        (quotient, [0.0, 1.0], Some(0.0)),
        (wave, [0.0, 1.0], Some(0.0)),
        (power, [0.0, 1.0], Some(1.0)),
        (difference, [0.5, 0.5], Some(0.0)),
        (difference, [0.5, 0.25], None),
        (of_one, [1.0, 0.0], Some(0.0)),
        (of_quotients, [1.0, 0.0], Some(0.0)),
        (of_quotients, [2.0, 0.0], None),
        (p, [3.0, 0.0], Some(3.0)),
        (x, [3.0, 0.0], None),
    ] {
        assert_eq!(g.value_at(value, &parameters), exact);
    }
}
