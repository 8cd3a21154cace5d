//! Native code and interpreter give the same bits, also where values are not finite.
#![cfg(feature = "native")]
#![allow(clippy::unwrap_used)]

mod support;

use filippov_expr::{Backend, ExprError, Graph, NodeId, Program, UnaryOp};
use proptest::prelude::*;
use support::{build, recipes};

fn numbers() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -3.0..3.0,
        1 => prop::sample::select(vec![0.0, -0.0, 1.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308, 5e-324]),
        1 => any::<f64>(),
    ]
}

proptest! {
    #![proptest_config(support::config(300))]

    #[test]
    fn backends_agree_to_the_bit(
        recipe in recipes(80),
        t in numbers(),
        x in prop::collection::vec(numbers(), 3),
        p in prop::collection::vec(numbers(), 2),
        v in numbers(),
        signs in prop::collection::vec(prop_oneof![Just(1.0), Just(-1.0), numbers()], 100),
    ) {
        let (g, nodes) = build(&recipe);
        let native = Program::compile(&g, &nodes, Backend::Native).unwrap();
        let interpreted = Program::compile(&g, &nodes, Backend::Interpreter).unwrap();
        let (mut a, mut b) = (vec![0.0; nodes.len()], vec![1.0; nodes.len()]);
        native.eval(t, &x, &signs, &p, &[v], &mut a);
        interpreted.eval(t, &x, &signs, &p, &[v], &mut b);
        for (k, (a, b)) in a.iter().zip(&b).enumerate() {
            // the payload of a NaN depends on the order of operands, which compilers may choose
            prop_assert!(a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()), "output {k}: {a} {b}");
        }
    }

    /// What signs and parameters alone make of the values is computed apart.
    #[test]
    fn settled_values_are_the_same_to_the_bit(
        recipe in recipes(60),
        x in prop::collection::vec(numbers(), 3),
        p in prop::collection::vec(numbers(), 2),
        signs in prop::collection::vec(prop_oneof![Just(1.0), Just(-1.0)], 100),
    ) {
        let (mut g, mut nodes) = build(&recipe);
        let mut sum = g.parameter(1);
        for k in 0..20_u32 {
            let (sign, weight) = (g.sign_of(k % 7), g.constant(0.1 * f64::from(k + 1)));
            let term = g.mul(sign, weight);
            sum = g.add(sum, term);
        }
        let moving = g.mul(sum, nodes[nodes.len() - 1]);
        nodes.extend([sum, moving]);
        let run = |g: &Graph, nodes: &[NodeId], p: &[f64]| {
            let mut out = vec![0.0; nodes.len()];
            let program = Program::compile(g, nodes, Backend::Interpreter).unwrap();
            program.eval(0.3, &x, &signs, p, &[0.7], &mut out);
            out
        };
        let settled = g.settled(&nodes).unwrap().unwrap();
        let mut known = p[..settled.n_parameters].to_vec();
        known.extend(run(&g, &settled.values, &p));
        let (a, b) = (run(&g, &nodes, &p), run(&settled.graph, &settled.outputs, &known));
        for (k, (a, b)) in a.iter().zip(&b).enumerate() {
            prop_assert!(a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()), "output {k}: {a} {b}");
        }
    }
}

#[test]
fn auto_is_native_on_this_platform() {
    let mut g = Graph::new();
    let x = g.state(0);
    assert!(Program::compile(&g, &[x], Backend::Auto)
        .unwrap()
        .is_native());
    assert!(!Program::compile(&g, &[x], Backend::Interpreter)
        .unwrap()
        .is_native());
}

/// 20 000 nodes take the fast register allocator, and more slots than the interpreter keeps on the stack.
#[test]
fn large_programs_agree() {
    let mut g = Graph::new();
    let mut nodes: Vec<NodeId> = (0..50).map(|i| g.state(i)).collect();
    for k in 0..20_000_usize {
        let (a, b) = (
            nodes[k * 7919 % nodes.len()],
            nodes[(k * 104_729 + 13) % nodes.len()],
        );
        let value = if k % 10 == 0 {
            g.unary(UnaryOp::Sin, a)
        } else if k % 2 == 0 {
            g.add(a, b)
        } else {
            g.sub(a, b)
        };
        nodes.push(value);
    }
    let outputs = &nodes[nodes.len() - 3000..];
    let native = Program::compile(&g, outputs, Backend::Native).unwrap();
    let interpreted = Program::compile(&g, outputs, Backend::Interpreter).unwrap();
    let x: Vec<f64> = (0..50).map(|i| 0.01 * f64::from(i)).collect();
    let (mut a, mut b) = (vec![0.0; 3000], vec![0.0; 3000]);
    native.eval(0.0, &x, &[], &[], &[], &mut a);
    interpreted.eval(0.0, &x, &[], &[], &[], &mut b);
    assert!(a.iter().zip(&b).all(|(a, b)| a.to_bits() == b.to_bits()));
}

/// A chain of 10^5 operations and its derivative, in a thread with a small stack.
#[test]
fn deep_programs_need_no_deep_stack() {
    let work = || {
        let mut g = Graph::new();
        let (x, half) = (g.state(0), g.constant(0.5));
        let mut deep = x;
        for _ in 0..50_000 {
            let product = g.mul(half, deep);
            deep = g.add(product, x);
        }
        let one = g.constant(1.0);
        let slope = g.directional(deep, &[one]);
        for backend in [Backend::Native, Backend::Interpreter] {
            let program = Program::compile(&g, &[deep, slope], backend).unwrap();
            let mut out = [0.0; 2];
            program.eval(0.0, &[3.0], &[], &[], &[], &mut out);
            assert_eq!(out, [6.0, 2.0]);
        }
    };
    let thread = std::thread::Builder::new().stack_size(512 << 10);
    thread.spawn(work).unwrap().join().unwrap();
}

#[test]
fn threads_share_a_program() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let hypot = g.binary(filippov_expr::BinaryOp::Hypot, x, y);
    let program = Program::compile(&g, &[hypot], Backend::Auto).unwrap();
    std::thread::scope(|scope| {
        for k in 1..5 {
            let program = &program;
            scope.spawn(move || {
                let k = f64::from(k);
                let mut out = [0.0];
                for _ in 0..1000 {
                    program.eval(0.0, &[3.0 * k, 4.0 * k], &[], &[], &[], &mut out);
                    assert_eq!(out, [5.0 * k]);
                }
            });
        }
    });
}

/// Compiled code is freed with its program: 20 000 programs would need some 100 MB otherwise, and on most
/// systems run out of memory maps (65 530).
#[test]
fn programs_free_their_memory() {
    let mut g = Graph::new();
    let x = g.state(0);
    let sine = g.unary(UnaryOp::Sin, x);
    for _ in 0..20_000 {
        assert!(Program::compile(&g, &[sine], Backend::Native)
            .unwrap()
            .is_native());
    }
}

#[test]
fn impossible_programs_are_errors() {
    let mut g = Graph::new();
    let far = g.state(u32::MAX);
    for backend in [Backend::Auto, Backend::Native, Backend::Interpreter] {
        assert!(matches!(
            Program::compile(&g, &[far], backend),
            Err(ExprError::IndexTooLarge { .. })
        ));
        assert!(matches!(
            Program::compile(&g, &[NodeId(7)], backend),
            Err(ExprError::UnknownNode { .. })
        ));
        let empty = Program::compile(&g, &[], backend).unwrap();
        empty.eval(0.0, &[], &[], &[], &[], &mut []);
    }
}
