//! Derivatives of random expressions against extrapolated central differences, and against closed forms.
#![allow(clippy::unwrap_used)]

mod support;

use filippov_expr::{Backend, BinaryOp, Graph, NodeId, Program, UnaryOp, Wrt};
use proptest::prelude::*;
use support::{build, points, recipes, ridders, values, Point, N_STATES};

/// Whether a derivative agrees with differences. Points where these have no 6 digits (next to a pole, a root's
/// branch point, overflow) prove nothing and pass. The factor 100 covers that Ridders' estimate is the
/// smallest of many, thus optimistic; a wrong formula is off by O(1) of the derivative.
fn agrees(derivative: f64, f: impl Fn(f64) -> f64) -> Result<(), TestCaseError> {
    let (difference, error) = ridders(f);
    let scale = 1e-3 + difference.abs();
    if !difference.is_finite() || !derivative.is_finite() || error > 1e-6 * scale || scale > 1e8 {
        return Ok(());
    }
    let distance = (derivative - difference).abs();
    prop_assert!(
        distance <= 100.0 * error + 1e-6 * scale,
        "derivative {derivative}, differences {difference} +- {error}"
    );
    Ok(())
}

proptest! {
    #![proptest_config(support::config(600))]

    #[test]
    fn partial_agrees_with_differences(recipe in recipes(14), at in points()) {
        let (mut g, nodes) = build(&recipe);
        let value = *nodes.last().unwrap();
        for (i, wrt) in [Wrt::State(0), Wrt::State(1), Wrt::State(2)].into_iter().enumerate() {
            let derivative = g.partial(value, wrt);
            let found = values(&g, &[derivative], &at)[0];
            agrees(found, |step| {
                let mut moved = at.clone();
                moved.x[i] += step;
                values(&g, &[value], &moved)[0]
            })?;
        }
        let by_time = g.partial(value, Wrt::Time);
        let found = values(&g, &[by_time], &at)[0];
        agrees(found, |step| values(&g, &[value], &Point { t: at.t + step, ..at.clone() })[0])?;
        let by_parameter = g.partial(value, Wrt::Parameter(1));
        let found = values(&g, &[by_parameter], &at)[0];
        agrees(found, |step| {
            let mut moved = at.clone();
            moved.p[1] += step;
            values(&g, &[value], &moved)[0]
        })?;
    }

    #[test]
    fn gradient_agrees_with_partials(recipe in recipes(30), at in points()) {
        let (mut g, nodes) = build(&recipe);
        let value = *nodes.last().unwrap();
        let gradient = g.gradient(value);
        prop_assert!(gradient.states.windows(2).all(|pair| pair[0].0 < pair[1].0));
        let mut reverse = vec![gradient.time];
        let zero = g.constant(0.0);
        for i in 0..N_STATES as u32 {
            reverse.push(gradient.states.iter().find(|entry| entry.0 == i).map_or(zero, |entry| entry.1));
        }
        let mut forward = vec![g.partial(value, Wrt::Time)];
        forward.extend((0..N_STATES as u32).map(|i| g.partial(value, Wrt::State(i))));
        let (reverse, forward) = (values(&g, &reverse, &at), values(&g, &forward, &at));
        for (a, b) in reverse.into_iter().zip(forward) {
            // Terms may cancel: the two orders of summation then differ by more than a few ulp of the result.
            let close = (a - b).abs() <= 1e-6 * (1.0 + a.abs().max(b.abs()));
            prop_assert!(close || !a.is_finite() || !b.is_finite() || a.abs() > 1e8, "{a} {b}");
        }
    }

    /// L_f^k h is the derivative of L_f^(k-1) h along the straight line in the direction (1, f).
    #[test]
    fn lie_derivatives_agree_with_differences(recipe in recipes(12), at in points()) {
        let (mut g, nodes) = build(&recipe);
        let field: Vec<NodeId> = nodes.iter().rev().take(N_STATES).copied().collect();
        let direction = values(&g, &field, &at);
        prop_assume!(direction.iter().all(|rate| rate.abs() < 1e3));
        let mut lower = nodes[nodes.len() / 2 + 3];
        for _ in 0..3 {
            let higher = g.directional(lower, &field);
            let found = values(&g, &[higher], &at)[0];
            agrees(found, |step| values(&g, &[lower], &at.moved(&direction, step))[0])?;
            lower = higher;
        }
    }
}

/// Every operation at a point inside its domain: differences to 1e-8.
#[test]
fn every_operation_has_its_derivative() {
    for op in UnaryOp::ALL {
        let a = if op == UnaryOp::Acosh { 1.7 } else { 0.43 };
        let mut g = Graph::new();
        let x = g.state(0);
        let value = g.unary(op, x);
        let derivative = g.partial(value, Wrt::State(0));
        let found = evaluate(&g, derivative, &[a]);
        let (expected, _) = ridders(|step| op.apply(a + step));
        assert!(
            (found - expected).abs() < 1e-8 * expected.abs(),
            "{op:?}: {found} {expected}"
        );
    }
    for op in BinaryOp::ALL {
        let (a, b) = (0.43, 1.3);
        let mut g = Graph::new();
        let (x, y) = (g.state(0), g.state(1));
        let value = g.binary(op, x, y);
        let gradient = g.gradient(value);
        let expected = [
            ridders(|step| op.apply(a + step, b)).0,
            ridders(|step| op.apply(a, b + step)).0,
        ];
        for (i, derivative) in gradient.states {
            let found = evaluate(&g, derivative, &[a, b]);
            let expected = expected[i as usize];
            assert!(
                (found - expected).abs() < 1e-8 * expected.abs(),
                "{op:?} {i}: {found} {expected}"
            );
        }
    }
}

/// h = sin(x0) along x0' = x1, x1' = -x0: third Lie derivative written out.
#[test]
fn third_lie_derivative_in_closed_form() {
    let mut g = Graph::new();
    let (x, v) = (g.state(0), g.state(1));
    let field = [v, g.neg(x)];
    let mut h = g.unary(UnaryOp::Sin, x);
    for _ in 0..3 {
        h = g.directional(h, &field);
    }
    let (a, b) = (0.3_f64, -0.8_f64);
    // h' = v cos x, h'' = -x cos x - v^2 sin x, h''' = -v cos x + x v sin x + 2 x v sin x - v^3 cos x
    let expected = -b * a.cos() + 3.0 * a * b * a.sin() - b.powi(3) * a.cos();
    assert!((evaluate(&g, h, &[a, b]) - expected).abs() < 1e-15);
}

#[test]
fn the_branch_not_taken_has_no_influence_on_derivatives() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let root = g.unary(UnaryOp::Sqrt, x);
    let j = g.declare_surface(x);
    let value = g.select(j, 1.0, root, y);
    let doubled = g.mul(value, y);
    let gradient = g.gradient(doubled);
    let outputs: Vec<NodeId> = gradient.states.iter().map(|entry| entry.1).collect();
    let program = Program::compile(&g, &outputs, Backend::Auto).unwrap();
    let mut out = [0.0; 2];
    program.eval(0.0, &[-1.0, 3.0], &[-1.0], &[], &[], &mut out);
    assert_eq!(out, [0.0, 6.0]);
}

#[test]
fn constant_exponents_bring_no_logarithm() {
    let mut g = Graph::new();
    let x = g.state(0);
    let c = g.constant(1.5);
    let value = g.pow(x, c);
    let derivative = g.partial(value, Wrt::State(0));
    assert_eq!(g.text(derivative, &Default::default()), "1.5*sqrt(x[0])");
    let c = g.constant(11.0);
    let value = g.pow(x, c);
    let derivative = g.partial(value, Wrt::State(0));
    assert!((evaluate(&g, derivative, &[-1.1]) - 11.0 * 1.1_f64.powi(10)).abs() < 1e-12);
}

/// Depth 10^5: no recursion anywhere, and cost that is linear.
#[test]
fn deep_graphs_do_not_overflow_the_stack() {
    let mut g = Graph::new();
    let x = g.state(0);
    let v = g.state(1);
    let mut deep = x;
    for _ in 0..50_000 {
        let sine = g.unary(UnaryOp::Sin, deep);
        deep = g.add(sine, v);
    }
    let size = g.len();
    let rate = g.directional(deep, &[v, x]);
    g.gradient(deep);
    g.partial(deep, Wrt::State(1));
    assert!(g.len() < 15 * size, "{} nodes from {size}", g.len());
    g.switch(deep);
    let sign = g.sign(deep);
    let product = g.mul(sign, rate);
    g.at_signs(&[product], &[Some(1.0)]);
    assert_eq!(g.sign_dependencies(&[product], &[1.0]), [true]);
    assert!(g.text(deep, &Default::default()).len() < 10_000);
    let copy = Graph::from_bytes(&g.to_bytes()).unwrap();
    assert_eq!(copy.len(), g.len());
    let program = Program::compile(&g, &[rate], Backend::Auto).unwrap();
    let mut out = [0.0];
    program.eval(0.0, &[0.1, 0.2], &[], &[], &[], &mut out);
    assert!(out[0].is_finite());
}

fn evaluate(g: &Graph, node: NodeId, x: &[f64]) -> f64 {
    let program = Program::compile(g, &[node], Backend::Auto).unwrap();
    let mut out = [0.0];
    program.eval(0.0, x, &[], &[], &[], &mut out);
    out[0]
}
