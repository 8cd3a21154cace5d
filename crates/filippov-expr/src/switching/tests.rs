#![allow(clippy::unwrap_used)]

use super::*;
use crate::print::Names;

const PLUS: Switching = Switching::Surface {
    index: 0,
    orientation: 1.0,
};
const MINUS: Switching = Switching::Surface {
    index: 0,
    orientation: -1.0,
};

fn text(g: &Graph, id: NodeId) -> String {
    let states = ["x", "v", "w"].map(String::from).to_vec();
    g.text(
        id,
        &Names {
            states,
            parameters: vec!["mu".into()],
        },
    )
}

fn surfaces(g: &Graph) -> Vec<String> {
    (0..g.n_surfaces() as u32)
        .map(|j| text(g, g.surface(j)))
        .collect()
}

/// A graph with t, x, v, w and the parameter mu.
fn variables() -> (Graph, NodeId, NodeId, NodeId, NodeId, NodeId) {
    let mut g = Graph::new();
    let (t, x, v, w, mu) = (g.time(), g.state(0), g.state(1), g.state(2), g.parameter(0));
    (g, t, x, v, w, mu)
}

fn times(g: &mut Graph, c: f64, a: NodeId) -> NodeId {
    let c = g.constant(c);
    g.mul(c, a)
}

fn over(g: &mut Graph, a: NodeId, c: f64) -> NodeId {
    let c = g.constant(c);
    g.div(a, c)
}

fn plus(g: &mut Graph, a: NodeId, c: f64) -> NodeId {
    let c = g.constant(c);
    g.add(a, c)
}

#[test]
fn factors_are_stripped() {
    let (mut g, _, _, v, ..) = variables();
    let twice = times(&mut g, 2.0, v);
    let third = over(&mut g, v, 3.0);
    let minus_fifth = over(&mut g, v, -5.0);
    let minus = g.neg(v);
    let minus_four = times(&mut g, -4.0, v);
    let nested = over(&mut g, minus_four, 7.0);
    let nothing_added = plus(&mut g, v, 0.0);
    for (id, expected) in [
        (twice, PLUS),
        (v, PLUS),
        (third, PLUS),
        (minus_fifth, MINUS),
        (minus, MINUS),
        (minus_four, MINUS),
        (nested, MINUS),
        (nothing_added, PLUS),
    ] {
        assert_eq!(g.switch(id), expected, "{}", text(&g, id));
    }
    assert_eq!(surfaces(&g), ["v"]);
}

#[test]
fn differences_are_shared() {
    let (mut g, _, x, v, ..) = variables();
    let forth = g.sub(v, x);
    let back = g.sub(x, v);
    let (a, b) = (times(&mut g, 0.1, v), times(&mut g, 0.1, x));
    let scaled = g.sub(a, b);
    let (a, b) = (over(&mut g, x, 3.0), over(&mut g, v, 3.0));
    let quotients = g.sub(a, b);
    let shifted = plus(&mut g, v, 2.5);
    let detour = g.sub(shifted, x);
    let detour = plus(&mut g, detour, -2.5);
    for (id, expected) in [
        (forth, PLUS),
        (back, MINUS),
        (scaled, PLUS),
        (quotients, MINUS),
        (detour, PLUS),
    ] {
        assert_eq!(g.switch(id), expected, "{}", text(&g, id));
    }
    assert_eq!(surfaces(&g), ["v - x"]);
}

#[test]
fn thresholds_are_shared_but_not_confused() {
    let (mut g, _, _, v, ..) = variables();
    let belt = g.constant(0.2);
    let slip = g.sub(belt, v);
    assert_eq!(g.switch(slip), MINUS);
    let doubled = times(&mut g, 2.0, v);
    let doubled = plus(&mut g, doubled, -0.4);
    assert_eq!(g.switch(doubled), PLUS);
    let other = plus(&mut g, v, -0.2 - 1e-14);
    assert_eq!(
        g.switch(other),
        Switching::Surface {
            index: 1,
            orientation: 1.0
        }
    );
    assert_eq!(surfaces(&g)[0], "v - 0.2");
}

/// The factor is rounded in both terms, differently for each factor.
#[test]
fn rounded_factors_are_recognised() {
    let (mut g, _, x, v, ..) = variables();
    let threshold = plus(&mut g, v, -0.2);
    assert_eq!(g.switch(threshold), PLUS);
    let difference = times(&mut g, 0.7, x);
    let difference = g.sub(v, difference);
    let on_difference = g.switch(difference);
    for k in 1..2000 {
        let c = -0.013 * f64::from(k);
        let scaled = times(&mut g, c, v);
        let shifted = plus(&mut g, scaled, -0.2 * c);
        assert_eq!(g.switch(shifted), MINUS, "factor {c}");
        let other = times(&mut g, 0.7 * c, x);
        let scaled_difference = g.sub(other, scaled);
        assert_eq!(g.switch(scaled_difference), on_difference, "factor {c}");
    }
    assert_eq!(g.n_surfaces(), 2);
}

#[test]
fn new_surfaces_are_spelled_readably() {
    for (make, expected) in [
        (
            (|g, t, _, v| g.sub(t, v)) as fn(&mut Graph, NodeId, NodeId, NodeId) -> NodeId,
            "v - t",
        ),
        (
            |g, _, x, v| {
                let sum = g.add(x, v);
                g.neg(sum)
            },
            "x + v",
        ),
        (
            |g, _, x, v| {
                let (a, b) = (times(g, -1.0, x), times(g, -2.0, v));
                let sum = g.add(a, b);
                plus(g, sum, 1.0)
            },
            "x + 2*v - 1",
        ),
        (
            |g, _, x, v| {
                let (a, b) = (times(g, 3.0, x), times(g, 3.0, v));
                let sum = g.sub(b, a);
                plus(g, sum, -3.0)
            },
            "v - x - 1",
        ),
        (
            |g, _, x, v| {
                let product = g.mul(x, v);
                let c = g.constant(1.0);
                g.sub(c, product)
            },
            "x*v - 1",
        ),
    ] {
        let (mut g, t, x, v, ..) = variables();
        let id = make(&mut g, t, x, v);
        let Switching::Surface {
            index: 0,
            orientation,
        } = g.switch(id)
        else {
            panic!("{expected}")
        };
        assert_eq!(surfaces(&g), [expected]);
        // whatever the spelling, it recognises itself
        assert_eq!(g.switch(g.surface(0)), PLUS);
        let back = g.neg(id);
        assert_eq!(
            g.switch(back),
            Switching::Surface {
                index: 0,
                orientation: -orientation
            }
        );
        assert_eq!(g.n_surfaces(), 1);
    }
}

#[test]
fn parameters_are_not_stripped() {
    let (mut g, _, x, v, _, mu) = variables();
    let ratio = g.div(v, mu);
    assert_eq!(g.switch(ratio), PLUS);
    assert_eq!(
        g.switch(v),
        Switching::Surface {
            index: 1,
            orientation: 1.0
        }
    );
    let product = g.mul(mu, x);
    assert_eq!(
        g.switch(product),
        Switching::Surface {
            index: 2,
            orientation: 1.0
        }
    );
    let square = g.mul(mu, mu);
    assert_eq!(
        g.switch(square),
        Switching::Surface {
            index: 3,
            orientation: 1.0
        }
    );
}

#[test]
fn constants_have_no_surface() {
    let (mut g, _, x, v, ..) = variables();
    for (value, sign) in [
        (3.0, 1.0),
        (-2.0, -1.0),
        (0.0, 0.0),
        (f64::NAN, 0.0),
        (f64::NEG_INFINITY, -1.0),
    ] {
        let c = g.constant(value);
        assert_eq!(g.switch(c), Switching::Constant(sign));
    }
    let sum = g.add(x, v);
    let sum = g.sub(sum, v);
    let nothing = g.sub(sum, x);
    assert_eq!(g.switch(nothing), Switching::Constant(0.0));
    let seven = plus(&mut g, nothing, -7.0);
    assert_eq!(g.switch(seven), Switching::Constant(-1.0));
    assert_eq!(g.n_surfaces(), 0);
}

#[test]
fn what_is_not_negative_has_no_surface() {
    let (mut g, _, x, v, w, _) = variables();
    let exp = g.unary(UnaryOp::Exp, x);
    let square = g.mul(v, v);
    let sum = g.add(exp, square);
    let radius = g.binary(BinaryOp::Hypot, x, v);
    let below = times(&mut g, -3.0, sum);
    let below = plus(&mut g, below, -1.0);
    for (id, sign) in [
        (exp, 1.0),
        (square, 1.0),
        (sum, 1.0),
        (radius, 1.0),
        (below, -1.0),
    ] {
        assert_eq!(g.switch(id), Switching::Constant(sign), "{}", text(&g, id));
    }
    assert_eq!(g.n_surfaces(), 0);
    let damped = g.mul(exp, w);
    assert_eq!(g.switch(damped), PLUS);
    assert_eq!(surfaces(&g), ["w"]);
}

#[test]
fn absolute_values_switch_where_their_argument_does() {
    let (mut g, _, _, v, ..) = variables();
    let slip = plus(&mut g, v, -0.2);
    let back = g.neg(slip);
    for argument in [slip, back] {
        let abs = g.abs(argument);
        assert_eq!(g.abs(abs), abs);
        assert_eq!(g.switch(abs), Switching::Constant(1.0));
        let scaled = times(&mut g, -2.0, abs);
        assert_eq!(g.switch(scaled), Switching::Constant(-1.0));
        let divisor = plus(&mut g, abs, 1.0);
        assert_eq!(g.switch(divisor), Switching::Constant(1.0));
        let below = plus(&mut g, abs, -1.0);
        g.switch(below);
    }
    assert_eq!(surfaces(&g), ["v - 0.2", "abs(v - 0.2) - 1"]);
    let (sign, doubled) = (g.sign(slip), times(&mut g, 2.0, back));
    let product = g.mul(sign, doubled);
    assert_eq!(g.switch(product), Switching::Constant(-1.0));
}

#[test]
fn functions_of_odd_sign_are_dropped() {
    let (mut g, _, x, v, ..) = variables();
    let three = g.constant(3.0);
    let cube = g.pow(v, three);
    let tanh = g.unary(UnaryOp::Tanh, v);
    let scaled = times(&mut g, -3.0, tanh);
    let root = g.unary(UnaryOp::Cbrt, scaled);
    let one = g.constant(1.0);
    let inverse = g.div(one, v);
    let weight = g.mul(x, x);
    let weighted = g.div(v, weight);
    for (id, expected) in [
        (cube, PLUS),
        (tanh, PLUS),
        (root, MINUS),
        (inverse, PLUS),
        (weighted, PLUS),
    ] {
        assert_eq!(g.switch(id), expected, "{}", text(&g, id));
    }
    let abs = g.abs(v);
    let quadratic = g.mul(abs, v);
    assert_eq!(g.switch(quadratic), PLUS);
    assert_eq!(surfaces(&g), ["v"]);
}

#[test]
fn signs_switch_where_they_come_from() {
    let (mut g, _, x, v, ..) = variables();
    let sign = g.sign(v);
    assert_eq!(g.switch(sign), PLUS);
    assert_eq!(g.sign(sign), sign);
    let half = times(&mut g, -0.5, sign);
    assert_eq!(g.switch(half), MINUS);
    let step = plus(&mut g, half, 0.5);
    assert_eq!(g.switch(step), MINUS);
    let high = plus(&mut g, half, 1.0);
    assert_eq!(g.switch(high), Switching::Constant(1.0));
    let (a, b) = (g.constant(-2.0), g.constant(5.0));
    let choice = g.select(0, 1.0, a, b);
    assert_eq!(g.switch(choice), MINUS);
    // the sign of a product with a sign is a product of signs, not a surface that jumps
    let product = g.mul(sign, x);
    let sign_of_product = g.sign(product);
    assert_eq!(text(&g, sign_of_product), "sign(v)*sign(x)");
    let (of_product, of_x) = (g.abs(product), g.abs(x));
    assert_eq!(of_product, of_x);
    assert_eq!(surfaces(&g), ["v", "x"]);
}

#[test]
fn declared_surfaces_keep_order_and_sign() {
    let (mut g, _, x, v, ..) = variables();
    let belt = g.constant(0.2);
    let slip = g.sub(belt, v);
    assert_eq!(
        (
            g.declare_surface(slip),
            g.declare_surface(x),
            g.declare_surface(slip)
        ),
        (0, 1, 0)
    );
    let other = g.sub(v, belt);
    assert_eq!(g.switch(other), MINUS);
    assert_eq!(g.switch(slip), PLUS);
    assert_eq!(surfaces(&g), ["0.2 - v", "x"]);
    assert_eq!(g.declare_surface(other), 2);
    assert_eq!(g.switch(other), MINUS);
    let abs = g.abs(other);
    assert_eq!(text(&g, abs), "abs(0.2 - v)");
}

#[test]
fn extrema_are_selects_on_the_difference() {
    let (mut g, _, x, v, ..) = variables();
    let (upper, lower) = (g.maximum(x, v), g.minimum(v, x));
    assert_eq!(text(&g, upper), "where(x - v > 0, x, v)");
    assert_eq!(text(&g, lower), "where(x - v > 0, v, x)");
    assert_eq!(g.n_surfaces(), 1);
    assert_eq!(g.maximum(x, x), x);
    let shifted = plus(&mut g, x, 1.0);
    assert_eq!(g.maximum(x, shifted), shifted);
    assert_eq!(g.minimum(x, shifted), x);
    let (two, three, nan) = (g.constant(2.0), g.constant(3.0), g.constant(f64::NAN));
    assert_eq!(g.minimum(two, three), two);
    assert_eq!(g.maximum(nan, three), nan);
    let zero = g.constant(0.0);
    let square = g.mul(v, v);
    assert_eq!(g.maximum(square, zero), square);
    assert_eq!(g.n_surfaces(), 1);
}

#[test]
fn quotient_by_nan_is_no_surface() {
    let (mut g, _, x, ..) = variables();
    let nan = g.constant(f64::NAN);
    let quotient = g.div(nan, x);
    assert_eq!(g.switch(quotient), Switching::Constant(0.0));
}

/// |t| hypot(t, t) is made of a sign and of a product whose own sign was never asked for.
#[test]
fn absolute_values_times_products_have_no_surface_of_their_own() {
    let mut g = Graph::new();
    let t = g.time();
    let size = g.abs(t);
    let length = g.binary(BinaryOp::Hypot, t, t);
    let product = g.mul(size, length);
    assert_eq!(g.switch(product), Switching::Constant(1.0));
    assert_eq!(g.n_surfaces(), 1);
}

#[test]
fn a_quotient_switches_at_its_poles_too() {
    let (mut g, _, x, v, w, mu) = variables();
    let ratio = g.div(x, v);
    assert_eq!(g.switch(ratio), PLUS);
    let tangent = g.unary(UnaryOp::Tan, w);
    let beyond = plus(&mut g, tangent, -1.0);
    g.switch(beyond);
    let one = g.constant(1.0);
    let size = g.abs(v);
    let reciprocal = g.div(one, size);
    let limited = plus(&mut g, reciprocal, -4.0);
    g.switch(limited);
    // Divisors that do not vanish along a motion.
    let square = g.mul(x, x);
    let positive = plus(&mut g, square, 1.0);
    for divisor in [positive, mu] {
        let quotient = g.div(w, divisor);
        let compared = plus(&mut g, quotient, -1.0);
        g.switch(compared);
    }
    let expected = [
        "x*v",
        "cos(w)*(sin(w) - cos(w))",
        "v",
        "4*abs(v) - 1",
        "w/(x**2 + 1) - 1",
        "w/mu - 1",
    ];
    assert_eq!(surfaces(&g), expected);
}
