//! What every solution fulfils, for random planar relays with a curved switching function.
#![allow(clippy::unwrap_used)]

use filippov::{
    ClosureSystem, Mode, Options, PiecewiseSystem, Place, Problem, Side, Solution, Stop,
};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

const T_END: f64 = 6.0;

/// x' = A x + c cos t + (b0 + b1 sin x0) s with h = scale (x0 + k x1 + q x1^2 - d).
#[derive(Clone, Debug)]
struct Relay {
    a: [f64; 4],
    b: [f64; 4],
    c: [f64; 2],
    surface: [f64; 3],
    start: [f64; 2],
}

fn relays() -> impl Strategy<Value = Relay> {
    let v = || -1.0..1.0_f64;
    (
        [v(), v(), v(), v()],
        [v(), v(), v(), v()],
        [v(), v()],
        [v(), -0.3..0.3_f64, v()],
        [v(), v()],
    )
        .prop_map(|(a, b, c, surface, start)| Relay {
            a,
            b,
            c,
            surface,
            start,
        })
}

fn h(relay: &Relay, x: &[f64]) -> f64 {
    let [k, q, d] = relay.surface;
    x[0] + k * x[1] + q * x[1] * x[1] - d
}

fn system(relay: &Relay, scale: f64) -> impl PiecewiseSystem + '_ {
    let side = scale.signum();
    ClosureSystem::new(
        2,
        1,
        move |t, x, s, dx| {
            for (i, dx) in dx.iter_mut().enumerate() {
                let row = &relay.a[2 * i..2 * i + 2];
                let jump = 2.0 * relay.b[i] + relay.b[2 + i] * x[0].sin();
                *dx = row[0] * x[0] + row[1] * x[1] + relay.c[i] * t.cos() + jump * s[0] * side;
            }
        },
        move |_t, x, out| out[0] = scale * h(relay, x),
    )
}

fn run(system: &dyn PiecewiseSystem, relay: &Relay) -> Solution {
    let options = Options {
        rtol: 1e-8,
        atol: vec![1e-8],
        max_events: 1000,
        ..Options::default()
    };
    Problem::new(system, (0.0, T_END), &relay.start)
        .options(&options)
        .solve()
        .unwrap()
}

fn at(system: &dyn PiecewiseSystem, solution: &Solution, t: f64, side: Side) -> ([f64; 2], Mode) {
    let mut y = [0.0; 2];
    let mode = solution
        .evaluate(system, t, side, &mut y)
        .unwrap()
        .unwrap()
        .clone();
    (y, mode)
}

/// Runs a property on random relays with a fixed seed.
fn for_relays(cases: u32, property: impl Fn(&Relay) -> Result<(), TestCaseError>) {
    let config = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]);
    TestRunner::new_with_rng(config, rng)
        .run(&relays(), |relay| property(&relay))
        .unwrap();
}

#[test]
fn segments_tile_the_interval_and_the_state_is_continuous() {
    for_relays(300, |relay| {
        let system = system(relay, 1.0);
        let solution = run(&system, relay);
        prop_assert!(
            matches!(solution.stop, Stop::End | Stop::MaxEvents),
            "{:?}",
            solution.stop
        );
        prop_assert_eq!(solution.segments.at(0).t_start, 0.0);
        prop_assert_eq!(solution.segments.last().unwrap().t_end, solution.t_last);
        let segments: Vec<_> = solution.segments.iter().collect();
        for pair in segments.windows(2) {
            prop_assert_eq!(pair[0].t_end, pair[1].t_start);
            prop_assert!(pair[0].t_end >= pair[0].t_start);
        }
        for switch in solution.switches.iter() {
            prop_assert_eq!(&switch.y_before, &switch.y_after);
            let (left, _) = at(&system, &solution, switch.t, Side::Left);
            let (right, _) = at(&system, &solution, switch.t, Side::Right);
            for i in 0..2 {
                // Rounding of a polynomial and of the projection onto the surface.
                prop_assert!((left[i] - right[i]).abs() < 1e-12 * (1.0 + left[i].abs()));
            }
        }
        Ok(())
    });
}

#[test]
fn signs_agree_with_the_mode_and_sliding_stays_on_the_surface() {
    let slid = std::cell::Cell::new(0);
    for_relays(300, |relay| {
        let system = system(relay, 1.0);
        let solution = run(&system, relay);
        for segment in solution
            .segments
            .iter()
            .filter(|s| s.t_end - s.t_start > 1e-5)
        {
            for i in 0..10 {
                let t = segment.t_start
                    + (segment.t_end - segment.t_start) * (f64::from(i) + 0.5) / 10.0;
                let (y, mode) = at(&system, &solution, t, Side::Right);
                prop_assert_eq!(&mode, &segment.mode);
                let value = h(relay, &y);
                match mode.entries()[0] {
                    0 => {
                        slid.set(slid.get() + 1);
                        prop_assert!(value.abs() < 1e-13 * (1.0 + y[0].abs() + y[1].powi(2)));
                        let (_, lam) = solution.multipliers(&system, t, Side::Right).unwrap()[0];
                        prop_assert!(lam.abs() <= 1.0, "lambda = {}", lam);
                    }
                    sign => {
                        prop_assert!(value * f64::from(sign) > 0.0, "h = {} in {}", value, mode)
                    }
                }
            }
        }
        Ok(())
    });
    let slid = slid.get();
    assert!(
        slid > 200,
        "only {slid} points in sliding: the property says little"
    );
}

#[test]
fn the_slope_is_the_field_of_the_mode() {
    for_relays(200, |relay| {
        let system = system(relay, 1.0);
        let solution = run(&system, relay);
        for segment in solution
            .segments
            .iter()
            .filter(|s| s.t_end - s.t_start > 0.01)
        {
            let (t, d) = (0.5 * (segment.t_start + segment.t_end), 1e-4);
            let (y, mode) = at(&system, &solution, t, Side::Right);
            let (after, _) = at(&system, &solution, t + d, Side::Right);
            let (before, _) = at(&system, &solution, t - d, Side::Right);
            let multipliers = solution.multipliers(&system, t, Side::Right).unwrap();
            let lam = match multipliers.first() {
                Some((_, lam)) => *lam,
                None => f64::from(mode.entries()[0]),
            };
            let (mut plus, mut minus) = ([0.0; 2], [0.0; 2]);
            system.field(&Place::new(t, &y, &[1.0]), &mut plus).unwrap();
            system
                .field(&Place::new(t, &y, &[-1.0]), &mut minus)
                .unwrap();
            for i in 0..2 {
                let field = 0.5 * (1.0 + lam) * plus[i] + 0.5 * (1.0 - lam) * minus[i];
                let slope = (after[i] - before[i]) / (2.0 * d);
                // Error of the solution over d, 1e-8 / 1e-4 at worst.
                prop_assert!(
                    (slope - field).abs() < 1e-4 * (1.0 + field.abs()),
                    "{} {}",
                    slope,
                    field
                );
            }
        }
        Ok(())
    });
}

#[test]
fn scaling_and_turning_the_switching_function_changes_nothing() {
    for_relays(200, |relay| {
        let plain_system = system(relay, 1.0);
        let plain = run(&plain_system, relay);
        if plain.switches.len() > 50 {
            return Ok(()); // chatter around a repelling start: its times amplify rounding
        }
        for scale in [1e-3, 50.0, -1.0, -2.0] {
            let other_system = system(relay, scale);
            let other = run(&other_system, relay);
            prop_assert_eq!(plain.switches.len(), other.switches.len());
            for (a, b) in plain.switches.iter().zip(other.switches.iter()) {
                prop_assert_eq!(a.kind, b.kind);
                let turned = if scale > 0.0 { 1 } else { -1 };
                prop_assert_eq!(
                    a.mode_after.entries()[0],
                    turned * b.mode_after.entries()[0]
                );
                prop_assert!((a.t - b.t).abs() < 1e-7, "{} {}", a.t, b.t); // ten times the tolerance
            }
        }
        Ok(())
    });
}

#[test]
fn repeated_runs_agree_to_the_bit() {
    for_relays(100, |relay| {
        let system = system(relay, 1.0);
        let (a, b) = (run(&system, relay), run(&system, relay));
        prop_assert_eq!(a.t, b.t);
        prop_assert_eq!(a.y, b.y);
        prop_assert_eq!(a.switches, b.switches);
        Ok(())
    });
}

#[test]
fn output_times_change_nothing() {
    for_relays(100, |relay| {
        let system = system(relay, 1.0);
        let plain = run(&system, relay);
        let options = Options {
            rtol: 1e-8,
            atol: vec![1e-8],
            max_events: 1000,
            t_eval: Some(vec![0.1, 1.0, 2.5]),
            dense_output: false,
            ..Options::default()
        };
        let sampled = Problem::new(&system, (0.0, T_END), &relay.start)
            .options(&options)
            .solve()
            .unwrap();
        prop_assert_eq!(&plain.switches, &sampled.switches);
        for (i, &t) in sampled.t.iter().enumerate() {
            let (y, _) = at(&system, &plain, t, Side::Right);
            prop_assert_eq!(&y[..], &sampled.y[2 * i..2 * i + 2]);
        }
        Ok(())
    });
}
