//! Random graphs and evaluation, shared by the property tests.
#![allow(dead_code, clippy::unwrap_used)]

use filippov_expr::{Backend, BinaryOp, Graph, NodeId, Program, UnaryOp};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// A number from the environment, 1 if it has none.
fn number(variable: &str) -> u32 {
    std::env::var(variable)
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(1)
}

/// That many cases, times `EXPR_TEST_FACTOR` of the environment. They are the same in every run, unless `EXPR_TEST_SEED`
/// is another. Failures become tests of their own, not files.
pub fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases: cases * number("EXPR_TEST_FACTOR"),
        rng_seed: RngSeed::Fixed(number("EXPR_TEST_SEED").into()),
        failure_persistence: None,
        max_global_rejects: u32::MAX,
        ..ProptestConfig::default()
    }
}

pub const N_STATES: usize = 3;

/// A point of evaluation.
#[derive(Debug, Clone)]
pub struct Point {
    pub t: f64,
    pub x: Vec<f64>,
    pub p: Vec<f64>,
    /// Signs of the surfaces, repeated as needed.
    pub signs: Vec<f64>,
}

impl Point {
    pub fn signs(&self, n: usize) -> Vec<f64> {
        (0..n).map(|j| self.signs[j % self.signs.len()]).collect()
    }

    /// The point moved along (1, direction) by `step`.
    pub fn moved(&self, direction: &[f64], step: f64) -> Point {
        let x = self
            .x
            .iter()
            .zip(direction)
            .map(|(x, d)| x + step * d)
            .collect();
        Point {
            t: self.t + step,
            x,
            ..self.clone()
        }
    }
}

pub fn points() -> impl Strategy<Value = Point> {
    let number = || -1.5..1.5;
    let sign = prop_oneof![Just(1.0), Just(-1.0)];
    (
        number(),
        prop::collection::vec(number(), N_STATES),
        prop::collection::vec(number(), 2),
        prop::collection::vec(sign, 5),
    )
        .prop_map(|(t, x, p, signs)| Point { t, x, p, signs })
}

/// Recipes of graphs: operation and two operands each.
pub fn recipes(length: usize) -> impl Strategy<Value = Vec<(u8, u8, u8)>> {
    prop::collection::vec(any::<(u8, u8, u8)>(), 1..length)
}

/// Carries out a recipe; the nodes in the order in which they were made.
pub fn build(recipe: &[(u8, u8, u8)]) -> (Graph, Vec<NodeId>) {
    let mut g = Graph::new();
    let mut nodes = vec![g.time(), g.parameter(0), g.parameter(1), g.input(0)];
    nodes.extend((0..N_STATES as u32).map(|i| g.state(i)));
    nodes.extend([0.5, -1.25, 2.0, 3.0, 0.0].map(|c| g.constant(c)));
    for &(op, a, b) in recipe {
        let (a, b) = (
            nodes[a as usize % nodes.len()],
            nodes[b as usize % nodes.len()],
        );
        let op = op as usize % 40;
        nodes.push(match op {
            0..=6 => g.binary(BinaryOp::ALL[op], a, b),
            7..=28 => g.unary(UnaryOp::ALL[op - 7], a),
            29 => g.sign(a),
            30 => g.abs(a),
            31 => g.maximum(a, b),
            32 => g.minimum(a, b),
            33 | 34 => g.add(a, b),
            35 | 36 => g.sub(a, b),
            _ => g.mul(a, b),
        });
    }
    (g, nodes)
}

/// Values of nodes at a point, by the interpreter.
pub fn values(g: &Graph, nodes: &[NodeId], at: &Point) -> Vec<f64> {
    let program = Program::compile(g, nodes, Backend::Interpreter).unwrap();
    let mut out = vec![0.0; nodes.len()];
    program.eval(
        at.t,
        &at.x,
        &at.signs(g.n_surfaces()),
        &at.p,
        &[0.75],
        &mut out,
    );
    out
}

/// The derivative at 0 of a function by central differences, extrapolated to step 0 (Ridders), and an
/// estimate of its error: the difference of neighbouring extrapolations where that is smallest.
pub fn ridders(f: impl Fn(f64) -> f64) -> (f64, f64) {
    const SHRINK: f64 = 1.4;
    const ROWS: usize = 12;
    let mut table = [[0.0; ROWS]; ROWS];
    let mut step = 1e-2;
    let (mut best, mut error) = (f64::NAN, f64::INFINITY);
    for i in 0..ROWS {
        table[i][0] = (f(step) - f(-step)) / (2.0 * step);
        step /= SHRINK;
        let mut factor = SHRINK * SHRINK;
        for j in 1..=i {
            table[i][j] = (table[i][j - 1] * factor - table[i - 1][j - 1]) / (factor - 1.0);
            factor *= SHRINK * SHRINK;
            let estimate = f64::max(
                (table[i][j] - table[i][j - 1]).abs(),
                (table[i][j] - table[i - 1][j - 1]).abs(),
            );
            if estimate <= error {
                (best, error) = (table[i][j], estimate);
            }
        }
    }
    (best, error)
}
