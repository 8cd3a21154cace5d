//! The dry-friction oscillator as a traced expression, run many times: for profilers.
//!
//! `cargo run --release --example traced_oscillator -- 100 1e-6 DOPRI5 slip`: repetitions, tolerance, method
//! (Taylor unless given), and `slip` for the piece before the first switch alone, or `observed` for a run whose instants
//! are handed to an observer.

use filippov::{InstantRecord, Integrator, Method, Observer, Options, Problem, TracedSystem};
use filippov_expr::{Backend, Graph, Names, UnaryOp};

/// Counts instants.
struct Count(usize);

impl Observer for Count {
    fn instant(&mut self, _: &InstantRecord) {
        self.0 += 1;
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let repeats: u32 = arguments.next().map_or(Ok(1), |v| v.parse())?;
    let tolerance: f64 = arguments.next().map_or(Ok(1e-6), |v| v.parse())?;
    let method = match arguments.next().as_deref() {
        Some("DOPRI5") => Method::Dopri5,
        _ => Method::Taylor,
    };
    let kind = arguments.next();
    let slips_only = kind.as_deref() == Some("slip");
    let is_observed = kind.as_deref() == Some("observed");

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
        method,
        max_step: if slips_only { 1e-4 } else { f64::INFINITY },
        ..Options::default()
    };
    let t_end = if slips_only {
        1.0
    } else {
        60.0 * std::f64::consts::PI
    };
    let mut steps = 0;
    for _ in 0..repeats {
        let problem = Problem::new(&system, (0.0, t_end), &[1.0, 2.0]).options(&options);
        let mut count = Count(0);
        let solution = match is_observed {
            true => Integrator::new(problem)?.observed_by(&mut count).solve(),
            false => problem.solve()?,
        };
        assert_eq!(count.0 > 0, is_observed);
        steps += solution.stats.n_steps;
    }
    assert!(steps > 0);
    Ok(())
}
