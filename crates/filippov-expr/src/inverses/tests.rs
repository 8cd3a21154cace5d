use crate::{BinaryOp, Graph, Names, NodeId, Regions, Switching, UnaryOp};

/// The surface of an expression, and its orientation.
fn surface(g: &mut Graph, id: NodeId) -> (String, f64) {
    match g.switch(id) {
        Switching::Surface { index, orientation } => {
            let function = g.surface(index);
            (g.text(function, &Names::default()), orientation)
        }
        Switching::Constant(sign) => (String::new(), sign),
    }
}

fn root(g: &mut Graph, op: UnaryOp, a: NodeId) -> NodeId {
    g.unary(op, a)
}

#[test]
fn a_root_beside_a_number_switches_as_its_square() {
    let mut g = Graph::new();
    let (x, two, minus) = (g.state(0), g.constant(2.0), g.constant(-2.0));
    let size = g.abs(x);
    let sqrt = root(&mut g, UnaryOp::Sqrt, size);
    let above = g.sub(sqrt, two);
    assert_eq!(surface(&mut g, above), ("abs(x[0]) - 4".into(), 1.0));
    let below = g.sub(two, sqrt);
    assert_eq!(surface(&mut g, below).1, -1.0);
    // It is never below -2.
    let always = g.sub(sqrt, minus);
    assert_eq!(surface(&mut g, always), (String::new(), 1.0));
}

#[test]
fn a_cube_root_beside_anything_switches_as_a_cube() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let cbrt = root(&mut g, UnaryOp::Cbrt, x);
    let beside = g.sub(cbrt, y);
    let (text, orientation) = surface(&mut g, beside);
    assert_eq!(orientation, 1.0, "{text}");
    let Switching::Surface { index, .. } = g.switch(beside) else {
        panic!("it has a surface")
    };
    assert!(g.is_analytic(&[g.surface(index)]));
    // Two cube roots switch where their arguments are equal.
    let other = root(&mut g, UnaryOp::Cbrt, y);
    let difference = g.sub(cbrt, other);
    assert_eq!(surface(&mut g, difference).0, "x[0] - x[1]");
}

#[test]
fn odd_roots_beside_anything_switch_as_odd_powers() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let (sign, size) = (g.sign(x), g.abs(x));
    let sqrt = root(&mut g, UnaryOp::Sqrt, size);
    let odd = g.mul(sign, sqrt);
    let sum = g.add(y, odd);
    assert_eq!(surface(&mut g, sum).0, "x[0] + sign(x[1])*x[1]**2");
    // A function times its own root is one power; times another root it is left.
    let (two, beside) = (g.constant(-2.0), g.abs(y));
    let (own, other) = (root(&mut g, UnaryOp::Sqrt, beside), g.mul(y, sqrt));
    let twice = g.mul(two, y);
    let product = g.mul(twice, own);
    let sum = g.sub(x, product);
    assert_eq!(surface(&mut g, sum).0, "x[0] + 2*sign(x[1])*abs(x[1])**1.5");
    let sum = g.add(x, other);
    assert_eq!(surface(&mut g, sum).0, "x[0] + x[1]*sqrt(abs(x[0]))");
}

#[test]
fn sums_of_odd_powers_of_one_value_switch_with_it() {
    let mut g = Graph::new();
    let (x, power, minus) = (g.state(0), g.constant(0.7), g.constant(-1.0));
    let (sign, size) = (g.sign(x), g.abs(x));
    let steep = g.pow(size, power);
    let steep = g.mul(sign, steep);
    let own = g.mul(x, size);
    for sum in [g.add(x, steep), g.add(own, steep)] {
        assert_eq!(surface(&mut g, sum), ("x[0]".into(), 1.0));
        let opposite = g.mul(minus, sum);
        assert_eq!(surface(&mut g, opposite), ("x[0]".into(), -1.0));
    }
    // A difference of them has other zeros too, and so has one from a number.
    for other in [g.sub(x, steep), g.add(steep, power)] {
        assert_ne!(surface(&mut g, other).0, "x[0]");
    }
}

#[test]
fn two_roots_switch_where_their_arguments_are_equal() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let (u, v) = (g.abs(x), g.abs(y));
    let roots = [u, v].map(|a| root(&mut g, UnaryOp::Sqrt, a));
    let three = g.constant(3.0);
    let larger = g.mul(three, roots[1]);
    let difference = g.sub(roots[0], larger);
    assert_eq!(surface(&mut g, difference).0, "abs(x[0]) - 9*abs(x[1])");
}

#[test]
fn a_logarithm_of_a_kink_switches_as_the_kink() {
    let mut g = Graph::new();
    let (x, one) = (g.state(0), g.constant(1.0));
    let size = g.abs(x);
    let log = root(&mut g, UnaryOp::Log, size);
    let above = g.sub(log, one);
    let threshold = std::f64::consts::E;
    assert_eq!(surface(&mut g, above).0, format!("abs(x[0]) - {threshold}"));
    // One without a kink ends where its argument does, and is left.
    let plain = root(&mut g, UnaryOp::Log, x);
    let above = g.sub(plain, one);
    assert_eq!(surface(&mut g, above).0, "log(x[0]) - 1");
}

#[test]
fn roots_that_may_end_and_powers_beside_powers_are_left() {
    let mut g = Graph::new();
    let (x, y, two) = (g.state(0), g.state(1), g.constant(2.0));
    let plain = root(&mut g, UnaryOp::Sqrt, x);
    let beside = g.sub(plain, two);
    assert_eq!(surface(&mut g, beside).0, "sqrt(x[0]) - 2");
    // The inverse of one would be the power of the other, for ever.
    let exponent = g.constant(4.5);
    let size = g.abs(x);
    let power = g.binary(BinaryOp::Pow, size, exponent);
    let e = g.unary(UnaryOp::Exp, y);
    let beside = g.sub(e, power);
    assert_eq!(surface(&mut g, beside).1, 1.0);
}

#[test]
fn a_root_of_a_cube_root_beside_what_varies_switches_without_roots() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let cube = root(&mut g, UnaryOp::Cbrt, x);
    let size = g.abs(cube);
    let sqrt = root(&mut g, UnaryOp::Sqrt, size);
    let beside = g.sub(sqrt, y);
    let (text, _) = surface(&mut g, beside);
    assert!(!text.contains("sqrt") && !text.contains("cbrt"), "{text}");
    // A root that no cube root is in needs no surface at y = 0.
    let plain = g.abs(x);
    let sqrt = root(&mut g, UnaryOp::Sqrt, plain);
    let beside = g.sub(sqrt, y);
    assert!(surface(&mut g, beside).0.contains("sqrt"));
    // What is nowhere negative needs none either.
    let size = g.abs(y);
    let beside = g.sub(sqrt, size);
    assert_eq!(surface(&mut g, beside).0, "abs(x[0]) - x[1]**2");
}

#[test]
fn a_difference_that_vanishes_where_its_surface_does_is_no_jump() {
    let mut g = Graph::new();
    let (x, one) = (g.state(0), g.constant(1.0));
    let size = g.abs(x);
    let inside = g.add(size, one);
    let (log, two) = (root(&mut g, UnaryOp::Log, inside), g.constant(2.0));
    let beside = g.sub(log, two);
    let bent = g.abs(beside);
    assert_eq!(Regions::new(g, vec![], vec![]).jumps_at(bent), None);
}

#[test]
fn ranges() {
    let mut g = Graph::new();
    let x = g.state(0);
    let (size, square) = (g.abs(x), g.mul(x, x));
    let (third, opposite) = (g.constant(3.0), g.neg(square));
    let bell = g.unary(UnaryOp::Exp, opposite);
    let wave = g.unary(UnaryOp::Sin, x);
    let scaled = g.mul(third, wave);
    assert_eq!(g.range(size), (0.0, f64::INFINITY));
    assert_eq!(g.range(bell), (0.0, 1.0));
    assert_eq!(g.range(scaled), (-3.0, 3.0));
    assert_eq!(g.range(x), (f64::NEG_INFINITY, f64::INFINITY));
}
