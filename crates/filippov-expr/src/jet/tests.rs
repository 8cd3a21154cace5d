//! Jets against closed forms, against repeated differentiation, and loops against unrolled programs.

use super::looped::Looped;
use super::plan::Plan;
use super::{JetProgram, Multipliers};
use crate::{Backend, BinaryOp, Graph, NodeId, Program, UnaryOp};

const ORDER: usize = 9;

/// The coefficients of `functions` along the motion of `field` by repeated differentiation.
fn by_differentiation(graph: &Graph, field: &[NodeId], function: NodeId, x: &[f64]) -> Vec<f64> {
    let mut graph = graph.clone();
    let mut derivatives = vec![function];
    for k in 0..5 {
        let next = graph.directional(derivatives[k], field);
        derivatives.push(next);
    }
    let program = Program::compile(&graph, &derivatives, Backend::Interpreter).unwrap();
    let mut out = vec![0.0; derivatives.len()];
    program.eval(0.3, x, &[-1.0], &[1.7], &[], &mut out);
    let mut factorial = 1.0;
    for (k, value) in out.iter_mut().enumerate() {
        factorial *= k.max(1) as f64;
        *value /= factorial;
    }
    out
}

fn check(make: impl Fn(&mut Graph, NodeId, NodeId) -> NodeId) {
    let mut g = Graph::new();
    let (t, x, y, p) = (g.time(), g.state(0), g.state(1), g.parameter(0));
    let product = g.mul(x, y);
    let turned = g.mul(t, p);
    let drive = g.unary(UnaryOp::Cos, turned);
    let first = g.sub(drive, product);
    let function = make(&mut g, x, y);
    let field = [first, function];
    let point = [0.45, 0.35];
    let expected = by_differentiation(&g, &field, function, &point);
    let plan = Plan::new(&mut g.clone(), &field, &[function], &Multipliers::default()).unwrap();
    let looped = Looped::new(plan, ORDER);
    let unrolled = JetProgram::compile(&g, &field, &[function], ORDER, Backend::Auto).unwrap();
    assert!(unrolled.is_unrolled());
    let (mut a, mut b) = ([0.0; 3 * (ORDER + 1)], [0.0; 3 * (ORDER + 1)]);
    looped.eval(0.3, &point, &[-1.0], &[1.7], &[], &mut a);
    unrolled.eval(0.3, &point, &[-1.0], &[1.7], &[], &mut b);
    for (k, (a, b)) in a.chunks(3).zip(b.chunks(3)).enumerate() {
        for (a, b) in a.iter().zip(b) {
            assert!(
                (a - b).abs() <= 1e-12 * (1.0 + a.abs()),
                "order {k}: {a} and {b}"
            );
        }
        if let Some(expected) = expected.get(k) {
            let scale = 1.0 + expected.abs();
            assert!(
                (a[2] - expected).abs() < 1e-11 * scale,
                "order {k}: {} for {expected}",
                a[2]
            );
        }
    }
}

#[test]
fn coefficients_of_every_function_are_its_derivatives() {
    for op in UnaryOp::ALL {
        check(|g, x, y| {
            let sum = g.add(x, y);
            // acosh lives beyond 1
            let a = if op == UnaryOp::Acosh {
                let one = g.constant(1.0);
                g.add(sum, one)
            } else {
                sum
            };
            g.unary(op, a)
        });
    }
}

#[test]
fn coefficients_of_every_operation_are_its_derivatives() {
    for op in BinaryOp::ALL {
        check(|g, x, y| g.binary(op, x, y));
    }
}

#[test]
fn coefficients_of_powers_are_their_derivatives() {
    for exponent in [-2.5, 0.5, 1.5, 3.0, 12.0] {
        check(|g, x, _| {
            let exponent = g.constant(exponent);
            g.pow(x, exponent)
        });
    }
    check(|g, x, _| {
        let exponent = g.parameter(0);
        g.pow(x, exponent)
    });
    check(|g, x, _| {
        let base = g.constant(1.3);
        g.pow(base, x)
    });
}

#[test]
fn signs_and_selections_stand_still() {
    check(|g, x, y| {
        let sign = g.sign(x);
        let term = g.mul(sign, y);
        let square = g.mul(y, y);
        let chosen = g.select(0, 1.0, square, term);
        g.add(chosen, term)
    });
}

#[test]
fn a_field_that_is_not_analytic_at_a_point_has_no_coefficients_there() {
    let mut g = Graph::new();
    let x = g.state(0);
    let exponent = g.constant(1.5);
    let field = g.pow(x, exponent);
    let jets = JetProgram::compile(&g, &[field], &[], 4, Backend::Auto).unwrap();
    let mut out = [0.0; 5];
    jets.eval(0.0, &[0.0], &[], &[], &[], &mut out);
    assert!(!out[4].is_finite());
}

#[test]
fn a_long_chain_is_not_unrolled() {
    let mut g = Graph::new();
    let field: Vec<NodeId> = (0..200_u32)
        .map(|i| {
            let (a, b) = (g.state(i), g.state((i + 1) % 200));
            let product = g.mul(a, b);
            g.unary(UnaryOp::Sin, product)
        })
        .collect();
    let jets = JetProgram::compile(&g, &field, &[], 12, Backend::Auto).unwrap();
    assert!(!jets.is_unrolled());
    let x: Vec<f64> = (0..200).map(|i| 0.01 * f64::from(i)).collect();
    let mut out = vec![0.0; 13 * 200];
    jets.eval(0.0, &x, &[], &[], &[], &mut out);
    assert!(out.iter().all(|v| v.is_finite()));
    assert_eq!(out[200 + 7], (0.07_f64 * 0.08).sin());
}

/// Sliding on two surfaces whose signs multiply: the series stays on the surfaces, and the multipliers solve the
/// equations at every time.
#[test]
fn multipliers_keep_their_equations_at_zero() {
    let mut g = Graph::new();
    let (t, x, y, z) = (g.time(), g.state(0), g.state(1), g.state(2));
    let (first, second) = (g.sign(x), g.sign(y));
    let both = g.mul(first, second);
    let term = |g: &mut Graph, factor: f64, a: NodeId| {
        let factor = g.constant(factor);
        g.mul(factor, a)
    };
    // x' = sin t / 3 - s1 + s1 s2 / 4 + z / 8, y' = cos(z) / 3 - s2 + s1 / 5, z' = s1 - z s2
    let wave = g.unary(UnaryOp::Sin, t);
    let parts = [
        term(&mut g, 1.0 / 3.0, wave),
        term(&mut g, -1.0, first),
        term(&mut g, 0.25, both),
        term(&mut g, 0.125, z),
    ];
    let dx = parts.into_iter().reduce(|a, b| g.add(a, b)).unwrap();
    let cosine = g.unary(UnaryOp::Cos, z);
    let parts = [
        term(&mut g, 1.0 / 3.0, cosine),
        term(&mut g, -1.0, second),
        term(&mut g, 0.2, first),
    ];
    let dy = parts.into_iter().reduce(|a, b| g.add(a, b)).unwrap();
    let pull = g.mul(z, second);
    let dz = g.sub(first, pull);
    let inputs: Vec<NodeId> = (0..6).map(|i| g.input(i)).collect();
    let multipliers = Multipliers {
        unknowns: vec![(first, inputs[0]), (second, inputs[1])],
        equations: vec![dx, dy],
        inverse: vec![
            vec![(0, inputs[2]), (1, inputs[3])],
            vec![(0, inputs[4]), (1, inputs[5])],
        ],
    };
    let root = |t: f64, z: f64| {
        let mut l = [0.0_f64; 2];
        for _ in 0..60 {
            l[0] = t.sin() / 3.0 + 0.25 * l[0] * l[1] + z / 8.0;
            l[1] = z.cos() / 3.0 + l[0] / 5.0;
        }
        l
    };
    let (t0, z0) = (0.4, 0.7);
    let l = root(t0, z0);
    let (a, b, c, d) = (-1.0 + 0.25 * l[1], 0.25 * l[0], 0.2, -1.0);
    let det = a * d - b * c;
    let v = [l[0], l[1], d / det, -b / det, -c / det, a / det];
    let field = [dx, dy, dz];
    let plan = Plan::new(&mut g.clone(), &field, &[first, second], &multipliers).unwrap();
    let looped = Looped::new(plan, ORDER);
    let unrolled = JetProgram::with_multipliers(
        &g,
        &field,
        &[first, second],
        &multipliers,
        ORDER,
        Backend::Auto,
    )
    .unwrap();
    assert!(unrolled.is_unrolled());
    let (mut by_loops, mut rows) = ([0.0; 5 * (ORDER + 1)], [0.0; 5 * (ORDER + 1)]);
    looped.eval(t0, &[0.0, 0.0, z0], &[1.0, 1.0], &[], &v, &mut by_loops);
    unrolled.eval(t0, &[0.0, 0.0, z0], &[1.0, 1.0], &[], &v, &mut rows);
    for (a, b) in by_loops.iter().zip(&rows) {
        assert!((a - b).abs() <= 1e-13 * (1.0 + a.abs()), "{a} and {b}");
    }
    let sum = |place: usize, tau: f64| {
        let row = rows.chunks(5).rev();
        row.fold(0.0, |sum, row| sum * tau + row[place])
    };
    for tau in [0.02, 0.05] {
        let l = root(t0 + tau, sum(2, tau));
        assert!(sum(0, tau).abs() < 1e-15 && sum(1, tau).abs() < 1e-15);
        assert!((sum(3, tau) - l[0]).abs() < 1e-13, "{}", sum(3, tau) - l[0]);
        assert!((sum(4, tau) - l[1]).abs() < 1e-13, "{}", sum(4, tau) - l[1]);
    }
}
