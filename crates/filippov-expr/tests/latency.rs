//! Compile time and evaluation time; run with `cargo test --release --test latency -- --ignored --nocapture`.
#![cfg(feature = "native")]
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::time::Instant;

use filippov_expr::{Backend, Graph, NodeId, Program};

/// v' = sin(w t) - y - F sign(v)
fn dry(g: &mut Graph) -> Vec<NodeId> {
    let (t, y, v) = (g.time(), g.state(0), g.state(1));
    let (force, omega) = (g.parameter(0), g.parameter(1));
    let phase = g.mul(omega, t);
    let drive = g.unary(filippov_expr::UnaryOp::Sin, phase);
    let net = g.sub(drive, y);
    let sign = g.sign(v);
    let friction = g.mul(force, sign);
    let rate = g.sub(net, friction);
    vec![v, rate]
}

/// Masses on a belt coupled by linear and cubic springs, each with velocity-dependent friction.
fn chain(g: &mut Graph, n: u32) -> Vec<NodeId> {
    let (belt, stiffness, cubic, force, decay) = (
        g.constant(0.2),
        g.parameter(0),
        g.parameter(1),
        g.parameter(2),
        g.constant(0.3),
    );
    let x: Vec<NodeId> = (0..n).map(|i| g.state(i)).collect();
    let v: Vec<NodeId> = (0..n).map(|i| g.state(n + i)).collect();
    let zero = g.constant(0.0);
    let three = g.constant(3.0);
    let one = g.constant(1.0);
    let spring: Vec<NodeId> = (0..=n as usize)
        .map(|i| {
            let left = if i == 0 { zero } else { x[i - 1] };
            let right = if i == n as usize { zero } else { x[i] };
            let stretch = g.sub(right, left);
            let linear = g.mul(stiffness, stretch);
            let cube = g.pow(stretch, three);
            let hard = g.mul(cubic, cube);
            g.add(linear, hard)
        })
        .collect();
    let mut field = v.clone();
    for i in 0..n as usize {
        let slip = g.sub(v[i], belt);
        let sign = g.sign(slip);
        let speed = g.abs(slip);
        let scaled = g.mul(decay, speed);
        let divisor = g.add(one, scaled);
        let ratio = g.div(force, divisor);
        let friction = g.mul(ratio, sign);
        let net = g.sub(spring[i + 1], spring[i]);
        field.push(g.sub(net, friction));
    }
    field
}

fn report(name: &str, build: impl Fn(&mut Graph) -> Vec<NodeId>) {
    let mut g = Graph::new();
    let field = build(&mut g);
    let n = field.len();
    let graph_time = (0..10)
        .map(|_| {
            let start = Instant::now();
            let mut g = Graph::new();
            build(&mut g);
            start.elapsed()
        })
        .min()
        .unwrap();
    let (x, s, p) = (vec![0.1; n], vec![1.0; n], [0.4, 0.5, 0.3]);
    let mut out = vec![0.0; n];
    for backend in [Backend::Native, Backend::Interpreter] {
        let compile_time = (0..10)
            .map(|_| {
                let start = Instant::now();
                Program::compile(&g, &field, backend).unwrap();
                start.elapsed()
            })
            .min()
            .unwrap();
        let program = Program::compile(&g, &field, backend).unwrap();
        let calls = 2_000_000 / n;
        let mut x = x.clone();
        let per_call = (0..5)
            .map(|_| {
                let start = Instant::now();
                for _ in 0..calls {
                    program.eval(0.1, &x, &s, &p, &[], &mut out);
                    x[0] += 1e-9 * out[0];
                }
                start.elapsed() / calls as u32
            })
            .min()
            .unwrap();
        println!("{name} {backend:?}: graph {} nodes {graph_time:?}, compile {compile_time:?}, call {per_call:?}", g.len());
    }
    let start = Instant::now();
    let rates: Vec<NodeId> = (0..g.n_surfaces() as u32)
        .map(|j| {
            let h = g.surface(j);
            let first = g.directional(h, &field);
            g.directional(first, &field)
        })
        .collect();
    println!(
        "{name}: second Lie derivatives {:?} ({} nodes)",
        start.elapsed(),
        g.len()
    );
    let start = Instant::now();
    let gradients: usize = field.iter().map(|&f| g.gradient(f).states.len()).sum();
    println!(
        "{name}: Jacobian {:?} ({gradients} entries, {} nodes)",
        start.elapsed(),
        g.len()
    );
    let start = Instant::now();
    let program = Program::compile(&g, &rates, Backend::Auto).unwrap();
    println!(
        "{name}: compile second Lie derivatives {:?}, native {}",
        start.elapsed(),
        program.is_native()
    );
}

#[test]
#[ignore = "prints times for a person to read: a timed assertion would fail on a busy machine"]
fn latency() {
    let start = Instant::now();
    let mut g = Graph::new();
    let x = g.state(0);
    Program::compile(&g, &[x], Backend::Auto).unwrap();
    println!("first compile with self-test {:?}", start.elapsed());
    let start = Instant::now();
    Program::compile(&g, &[x], Backend::Auto).unwrap();
    println!("trivial compile {:?}", start.elapsed());
    let program = Program::compile(&g, &[x], Backend::Auto).unwrap();
    let mut out = [0.0];
    let mut x = [1.0];
    let start = Instant::now();
    for _ in 0..10_000_000 {
        program.eval(0.0, &x, &[], &[], &[], &mut out);
        x[0] = out[0];
    }
    println!("trivial call {:?}", start.elapsed() / 10_000_000);
    report("dry", dry);
    for n in [10, 100, 300, 1000, 4000] {
        report(&format!("chain {n}"), |g| chain(g, n));
    }
}
