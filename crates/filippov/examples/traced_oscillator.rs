//! The dry-friction oscillator as a traced expression, run many times: for profilers.
//!
//! `cargo run --release --example traced_oscillator -- 100 1e-6`

use filippov::{solve, Options, TracedSystem};
use filippov_expr::{Backend, Graph, Names, UnaryOp};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let repeats: u32 = arguments.next().map_or(Ok(1), |v| v.parse())?;
    let tolerance: f64 = arguments.next().map_or(Ok(1e-6), |v| v.parse())?;

    let mut g = Graph::new();
    let (t, y, v) = (g.time(), g.state(0), g.state(1));
    let (omega, force) = (g.constant(1.0 / 3.0), g.constant(0.4));
    let phase = g.mul(t, omega);
    let drive = g.unary(UnaryOp::Sin, phase);
    let sign = g.sign(v);
    let friction = g.mul(force, sign);
    let pull = g.sub(drive, y);
    let acceleration = g.sub(pull, friction);
    let system = TracedSystem::new(
        g,
        vec![v, acceleration],
        vec![],
        Names::default(),
        Backend::Auto,
    )?;

    let options = Options {
        rtol: tolerance,
        atol: vec![tolerance],
        dense_output: false,
        ..Options::default()
    };
    let t_end = 60.0 * std::f64::consts::PI;
    let mut steps = 0;
    for _ in 0..repeats {
        steps += solve(&system, (0.0, t_end), &[1.0, 2.0], &options, &[])?
            .stats
            .n_steps;
    }
    assert!(steps > 0);
    Ok(())
}
