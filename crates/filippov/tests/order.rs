//! Convergence of order 5, within 0.3, for systems given by closures.
#![allow(clippy::unwrap_used)]

use filippov::{ClosureSystem, Kind, Options, PiecewiseSystem, Problem, Side, Solution};

const T_END: f64 = 5.0;
const START: [f64; 3] = [1.6, 0.5, 2.5];
const LEVELS: usize = 6;
/// The error depends on where an event lies in its step: step lengths within 10 % are averaged.
const JITTER: [f64; 8] = [0.9, 0.93, 0.96, 0.99, 1.01, 1.04, 1.07, 1.1];

/// A pendulum drives a relay on the surface z = 0.3 q + 0.2 m sin 2t, which acts back on it.
fn relay(gain: f64, motion: f64) -> impl PiecewiseSystem {
    ClosureSystem::new(
        3,
        1,
        move |_t, x, s, dx| {
            dx[0] = x[1];
            dx[1] = -4.0 * x[0].sin() + 0.5 * x[2];
            dx[2] = x[0] - gain * s[0];
        },
        move |t, x, h| h[0] = x[2] - 0.3 * x[1] - 0.2 * motion * (2.0 * t).sin(),
    )
}

fn kinds(solution: &Solution) -> Vec<Kind> {
    solution.switches.iter().map(|s| s.kind).collect()
}

fn exact(system: &dyn PiecewiseSystem) -> Solution {
    let options = Options {
        rtol: 1e-13,
        atol: vec![1e-14],
        ..Options::default()
    };
    Problem::new(system, (0.0, T_END), &START)
        .options(&options)
        .solve()
        .unwrap()
}

/// The tolerance is too loose to shorten the steps.
fn stepped(system: &dyn PiecewiseSystem, dt: f64) -> Solution {
    let options = Options {
        rtol: 0.1,
        atol: vec![0.1],
        first_step: Some(dt),
        max_step: dt,
        ..Options::default()
    };
    Problem::new(system, (0.0, T_END), &START)
        .options(&options)
        .solve()
        .unwrap()
}

fn state(system: &dyn PiecewiseSystem, solution: &Solution, t: f64) -> [f64; 3] {
    let mut y = [0.0; 3];
    assert!(solution
        .evaluate(system, t, Side::Right, &mut y)
        .unwrap()
        .is_some());
    y
}

/// Fitted slope of the logarithm of the root mean square error over that of the step length.
fn order(system: &dyn PiecewiseSystem, error: impl Fn(&Solution) -> f64) -> f64 {
    let expected = kinds(&exact(system));
    let points: Vec<(f64, f64)> = (0..LEVELS)
        .map(|level| {
            let dt = 0.04 * 0.25_f64.powf(level as f64 / (LEVELS - 1) as f64);
            let mean = JITTER
                .iter()
                .map(|jitter| {
                    let solution = stepped(system, dt * jitter);
                    assert_eq!(kinds(&solution), expected);
                    error(&solution).powi(2)
                })
                .sum::<f64>()
                / JITTER.len() as f64;
            assert!(mean.sqrt() > 1e-13, "rounding is measured at dt = {dt}");
            (dt.ln(), 0.5 * mean.ln())
        })
        .collect();
    let n = points.len() as f64;
    let (mx, my) = points
        .iter()
        .fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let covariance: f64 = points.iter().map(|(x, y)| (x - mx) * (y - my)).sum();
    let variance: f64 = points.iter().map(|(x, _)| (x - mx).powi(2)).sum();
    covariance / variance
}

fn assert_order_5(slope: f64, what: &str) {
    assert!((slope - 5.0).abs() < 0.3, "{what}: order {slope}");
}

#[test]
fn event_times_on_a_fixed_surface() {
    let system = relay(2.0, 0.0);
    let reference = exact(&system);
    let expected = [
        Kind::Crossing,
        Kind::EnterSliding,
        Kind::ExitSliding,
        Kind::EnterSliding,
    ];
    assert_eq!(kinds(&reference), expected);
    for (index, what) in [(1, "entry"), (2, "exit"), (3, "second entry")] {
        let t = reference.switches.at(index).t;
        assert_order_5(order(&system, |s| s.switches.at(index).t - t), what);
    }
}

#[test]
fn event_times_on_a_moving_surface() {
    let system = relay(3.0, 1.0);
    let reference = exact(&system);
    assert_eq!(
        kinds(&reference),
        [Kind::EnterSliding, Kind::ExitSliding, Kind::EnterSliding]
    );
    for (index, what) in [(0, "entry"), (1, "exit")] {
        let t = reference.switches.at(index).t;
        assert_order_5(order(&system, |s| s.switches.at(index).t - t), what);
    }
}

#[test]
fn states() {
    for (system, times) in [
        (relay(2.0, 0.0), [3.3, 4.1, 5.0]),
        (relay(3.0, 1.0), [3.5, 4.1, 5.0]),
    ] {
        let reference = exact(&system);
        for t in times {
            let y = state(&system, &reference, t);
            let distance = |s: &Solution| {
                let x = state(&system, s, t);
                x.iter()
                    .zip(&y)
                    .map(|(a, b)| (a - b).powi(2))
                    .sum::<f64>()
                    .sqrt()
            };
            assert_order_5(order(&system, distance), &format!("state at {t}"));
        }
    }
}
