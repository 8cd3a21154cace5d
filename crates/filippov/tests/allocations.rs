//! What a run allocates: nothing per step, whatever the method and the motion.
#![allow(clippy::unwrap_used)]

use allocation_counter::measure;
use filippov::{Keep, Method, Options, PiecewiseSystem, Problem, TracedSystem};
use filippov_expr::{Backend, Graph, Names, NodeId, UnaryOp};

/// y'' = -y + sin(t / 3) - F sign(y') for each of `d` oscillators, each pulled by half the one before.
fn oscillators(d: u32, friction: f64) -> TracedSystem {
    let mut g = Graph::new();
    let (time, third) = (g.time(), g.constant(1.0 / 3.0));
    let phase = g.mul(time, third);
    let mut drive = g.unary(UnaryOp::Sin, phase);
    let (half, force) = (g.constant(0.5), g.constant(friction));
    let (mut rates, mut accelerations): (Vec<NodeId>, Vec<NodeId>) = (Vec::new(), Vec::new());
    for k in 0..d {
        let (y, v) = (g.state(k), g.state(d + k));
        let sign = g.sign(v);
        let held = g.mul(force, sign);
        let pull = g.sub(drive, y);
        rates.push(v);
        accelerations.push(g.sub(pull, held));
        drive = g.mul(half, y);
    }
    rates.extend(accelerations);
    TracedSystem::new(g, rates, vec![], Names::default(), Backend::Auto).unwrap()
}

/// How many allocations the steps of the second half of a run make; the run has about 1000 steps in each half.
fn per_half(system: &dyn PiecewiseSystem, y0: &[f64], method: Method) -> i64 {
    let count = |t_end: f64| {
        let options = Options {
            method,
            keep: Keep::Last,
            dense_output: false,
            max_step: 1e-4,
            first_step: Some(1e-4),
            ..Options::default()
        };
        let run = || {
            let solution = Problem::new(system, (0.0, t_end), y0)
                .options(&options)
                .solve()
                .unwrap();
            assert!(solution.stats.n_steps as f64 >= t_end * 9.9e3);
            assert_eq!(solution.stats.n_switches, 0);
        };
        run();
        measure(run).count_total as i64
    };
    // Programs are compiled, and caches filled, before anything is counted.
    count(0.6);
    count(0.2) - count(0.1)
}

#[test]
fn steps_allocate_nothing_in_a_region_and_while_sliding_on_one_surface() {
    let system = oscillators(1, 0.4);
    for method in [Method::Dopri5, Method::Taylor] {
        for y0 in [[1.0, 2.0], [0.1, 0.0]] {
            assert_eq!(per_half(&system, &y0, method), 0, "{method:?} from {y0:?}");
        }
    }
}

#[test]
fn steps_allocate_nothing_while_sliding_on_two_surfaces() {
    let system = oscillators(2, 0.4);
    for method in [Method::Dopri5, Method::Taylor] {
        let n = per_half(&system, &[0.1, 0.1, 0.0, 0.0], method);
        assert_eq!(n, 0, "{method:?}");
    }
}

#[test]
fn a_run_that_keeps_its_last_state_allocates_nothing_per_switch() {
    let system = oscillators(1, 0.4);
    for method in [Method::Dopri5, Method::Taylor] {
        let count = |periods: f64| {
            let options = Options {
                method,
                keep: Keep::Last,
                dense_output: false,
                ..Options::default()
            };
            let span = (0.0, periods * 6.0 * std::f64::consts::PI);
            let mut n_switches = 0;
            let total = measure(|| {
                let solution = Problem::new(&system, span, &[1.0, 2.0])
                    .options(&options)
                    .solve()
                    .unwrap();
                n_switches = solution.stats.n_switches;
            });
            (total.count_total as f64, total.bytes_max, n_switches as f64)
        };
        count(4000.0);
        // So long that the latest switches, which are kept to recognise accumulations, have been replaced.
        let (short, long) = (count(2000.0), count(4000.0));
        let per_switch = (long.0 - short.0) / (long.2 - short.2);
        assert!(per_switch < 0.01, "{method:?}: {per_switch} per switch");
        assert_eq!(long.1, short.1, "{method:?}: most bytes at a time");
    }
}
