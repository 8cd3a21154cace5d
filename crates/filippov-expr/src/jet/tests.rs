//! Jets against closed forms, against repeated differentiation, and loops against unrolled programs.

use super::looped::Looped;
use super::plan::Plan;
use super::JetProgram;
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
    let plan = Plan::new(&g, &field, &[function]).unwrap();
    let looped = Looped::new(plan, ORDER);
    let unrolled = JetProgram::compile(&g, &field, &[function], ORDER, Backend::Auto).unwrap();
    assert!(unrolled.is_unrolled());
    let (mut a, mut b) = ([0.0; 3 * (ORDER + 1)], [0.0; 3 * (ORDER + 1)]);
    looped.eval(0.3, &point, &[-1.0], &[1.7], &mut a);
    unrolled.eval(0.3, &point, &[-1.0], &[1.7], &mut b);
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
    jets.eval(0.0, &[0.0], &[], &[], &mut out);
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
    jets.eval(0.0, &x, &[], &[], &mut out);
    assert!(out.iter().all(|v| v.is_finite()));
    assert_eq!(out[200 + 7], (0.07_f64 * 0.08).sin());
}
