//! What every solution fulfils, for random closure systems: one to four states, one to three surfaces, moving and curved.
//!
//! `RANDOM_SYSTEMS` is how many times more cases to try than usual.
#![allow(clippy::unwrap_used)]

use filippov::{
    ClosureSystem, Mode, Options, PiecewiseSystem, Place, Problem, Side, Solution, Stop,
};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

const T_END: f64 = 3.0;
const RTOL: f64 = 1e-8;

/// x' = A x + c cos(w t) + B s + e s_0 s_m-1 sin(x_0) with h_j = n_j . x + q_j x_0^2 - d_j - v_j sin(2 t).
#[derive(Clone, Debug)]
struct Random {
    n: usize,
    m: usize,
    a: Vec<f64>,
    b: Vec<f64>,
    c: Vec<f64>,
    e: Vec<f64>,
    normals: Vec<f64>,
    /// q, d and v of each surface.
    shapes: Vec<[f64; 3]>,
    start: Vec<f64>,
}

fn systems() -> impl Strategy<Value = Random> {
    (1..=4_usize, 1..=3_usize).prop_flat_map(|(n, m)| {
        let numbers = |k: usize, size: f64| prop::collection::vec(-size..size, k);
        let shape = (0.0..1.0_f64, -0.5..0.5_f64, -0.5..0.5_f64);
        // Most surfaces are flat and at rest.
        let shapes = shape.prop_map(|(q, d, v)| {
            let q = if q > 0.7 { q - 0.7 } else { 0.0 };
            [q, d, if v > 0.2 { v } else { 0.0 }]
        });
        (
            numbers(n * n, 1.0),
            numbers(n * m, 1.5),
            numbers(n, 1.0),
            numbers(n, 0.5),
            numbers(n * m, 1.0),
            prop::collection::vec(shapes, m),
            numbers(n, 1.0),
        )
            .prop_map(move |(a, b, c, e, normals, shapes, start)| Random {
                n,
                m,
                a,
                b,
                c,
                e,
                normals,
                shapes,
                start,
            })
    })
}

fn h(random: &Random, j: usize, t: f64, x: &[f64]) -> f64 {
    let [q, d, v] = random.shapes[j];
    let normal = &random.normals[j * random.n..(j + 1) * random.n];
    let linear: f64 = normal.iter().zip(x).map(|(n, x)| n * x).sum();
    linear + q * x[0] * x[0] - d - v * (2.0 * t).sin()
}

/// The system with its surfaces in the order `order`, each with a factor.
fn system<'a>(
    random: &'a Random,
    order: &'a [usize],
    factors: &'a [f64],
) -> impl PiecewiseSystem + 'a {
    let Random { n, m, .. } = *random;
    ClosureSystem::new(
        n,
        m,
        move |t, x, s, dx| {
            let sign = |j: usize| {
                let place = order.iter().position(|&k| k == j).unwrap();
                s[place] * factors[place].signum()
            };
            let product = if m > 1 { sign(0) * sign(m - 1) } else { 0.0 };
            for (i, rate) in dx.iter_mut().enumerate() {
                let row = &random.a[i * n..(i + 1) * n];
                let linear: f64 = row.iter().zip(x).map(|(a, x)| a * x).sum();
                let jumps: f64 = (0..m).map(|j| random.b[i * m + j] * sign(j)).sum();
                *rate = linear + random.c[i] * t.cos() + jumps + random.e[i] * product * x[0].sin();
            }
        },
        move |t, x, out| {
            for (place, out) in out.iter_mut().enumerate() {
                *out = factors[place] * h(random, order[place], t, x);
            }
        },
    )
}

fn run(system: &dyn PiecewiseSystem, random: &Random) -> Solution {
    let options = Options {
        rtol: RTOL,
        atol: vec![RTOL],
        max_events: 300,
        max_steps: 20_000,
        ..Options::default()
    };
    Problem::new(system, (0.0, T_END), &random.start)
        .options(&options)
        .solve()
        .unwrap()
}

fn at(system: &dyn PiecewiseSystem, solution: &Solution, t: f64, side: Side) -> (Vec<f64>, Mode) {
    let mut y = vec![0.0; solution.n_states];
    let mode = solution.evaluate(system, t, side, &mut y).unwrap().unwrap();
    (y, mode.clone())
}

fn size(values: &[f64]) -> f64 {
    values.iter().fold(1.0, |most, v| v.abs().max(most))
}

/// Runs a property on random systems with a fixed seed.
fn for_systems(cases: u32, seed: u8, property: impl Fn(&Random) -> Result<(), TestCaseError>) {
    let factor = std::env::var("RANDOM_SYSTEMS").ok();
    let factor: u32 = factor.and_then(|text| text.parse().ok()).unwrap_or(1);
    let config = Config {
        cases: cases * factor,
        failure_persistence: None,
        max_shrink_iters: 200,
        ..Config::default()
    };
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]);
    TestRunner::new_with_rng(config, rng)
        .run(&systems(), |random| property(&random))
        .unwrap();
}

const ORDER: [usize; 3] = [0, 1, 2];
const ONES: [f64; 3] = [1.0; 3];

#[test]
fn segments_tile_the_interval_and_the_state_is_continuous() {
    let ends = std::cell::Cell::new(0);
    for_systems(300, 1, |random| {
        let system = system(random, &ORDER[..random.m], &ONES[..random.m]);
        let solution = run(&system, random);
        // A run that stops says at which surfaces or limit.
        let named = matches!(
            solution.stop,
            Stop::End
                | Stop::MaxEvents
                | Stop::MaxSteps
                | Stop::StepTooSmall
                | Stop::Intersection { .. }
                | Stop::NonUnique { .. }
                | Stop::InvisibleTwoFold { .. }
                | Stop::SlidesAcrossJump { .. }
                | Stop::NoProgress { .. }
        );
        prop_assert!(named, "{:?}", solution.stop);
        ends.set(ends.get() + u32::from(matches!(solution.stop, Stop::End)));
        if solution.segments.is_empty() {
            return Ok(());
        }
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
            for (left, right) in left.iter().zip(&right) {
                prop_assert!((left - right).abs() < 1e-11 * size(&switch.y_after));
            }
        }
        Ok(())
    });
    assert!(ends.get() > 270, "only {} runs reach their end", ends.get());
}

#[test]
fn signs_agree_with_the_mode_and_multipliers_lie_in_their_interval() {
    let slid = std::cell::Cell::new([0; 3]);
    for_systems(300, 2, |random| {
        let system = system(random, &ORDER[..random.m], &ONES[..random.m]);
        let solution = run(&system, random);
        for segment in solution
            .segments
            .iter()
            .filter(|s| s.t_end - s.t_start > 1e-4)
        {
            for share in [0.1, 0.35, 0.6, 0.85] {
                let t = segment.t_start + share * (segment.t_end - segment.t_start);
                let (y, mode) = at(&system, &solution, t, Side::Right);
                prop_assert_eq!(&mode, &segment.mode);
                for (j, &entry) in mode.entries().iter().enumerate() {
                    let value = h(random, j, t, &y);
                    let on_side = value * f64::from(entry) > -1e-7 * size(&y);
                    match entry {
                        0 => prop_assert!(value.abs() < 1e-12 * size(&y).powi(2), "h = {}", value),
                        _ => prop_assert!(on_side, "h = {} in {} at {}", value, mode, t),
                    }
                }
                for (_, multiplier) in solution.multipliers(&system, t, Side::Right).unwrap() {
                    prop_assert!(multiplier.abs() <= 1.0, "{} at {}", multiplier, t);
                }
                let mut counts = slid.get();
                if (1..=3).contains(&mode.codimension()) {
                    counts[mode.codimension() - 1] += 1;
                }
                slid.set(counts);
            }
        }
        Ok(())
    });
    let [one, two, _] = slid.get();
    assert!(
        one > 200 && two > 10,
        "{one} and {two} points in sliding: the property says little"
    );
}

#[test]
fn the_slope_in_a_region_is_its_field() {
    for_systems(200, 3, |random| {
        let system = system(random, &ORDER[..random.m], &ONES[..random.m]);
        let solution = run(&system, random);
        let regions = solution
            .segments
            .iter()
            .filter(|s| s.mode.codimension() == 0);
        for segment in regions.filter(|s| s.t_end - s.t_start > 0.01) {
            let (t, d) = (0.5 * (segment.t_start + segment.t_end), 1e-3);
            let (y, mode) = at(&system, &solution, t, Side::Right);
            let (after, _) = at(&system, &solution, t + d, Side::Right);
            let (before, _) = at(&system, &solution, t - d, Side::Right);
            let mut field = vec![0.0; random.n];
            system
                .field(&Place::new(t, &y, &mode.signs()), &mut field)
                .unwrap();
            for i in 0..random.n {
                let slope = (after[i] - before[i]) / (2.0 * d);
                // The error of the extension over d, and d^2/6 times a third derivative.
                let error = 1e2 * RTOL * size(&y) / d + 1e-5 * size(&field);
                prop_assert!((slope - field[i]).abs() < error, "{} {}", slope, field[i]);
            }
        }
        Ok(())
    });
}

#[test]
fn the_order_of_the_surfaces_and_their_factors_change_nothing() {
    for_systems(150, 4, |random| {
        let m = random.m;
        let plain_system = system(random, &ORDER[..m], &ONES[..m]);
        let plain = run(&plain_system, random);
        // Where it is not unique, or chatters, rounding decides.
        if !matches!(plain.stop, Stop::End)
            || !plain.warnings.is_empty()
            || plain.switches.len() > 30
        {
            return Ok(());
        }
        let order: Vec<usize> = (0..m).rev().collect();
        let factors = [-2.0, 30.0, -0.1];
        let other_system = system(random, &order, &factors[..m]);
        let other = run(&other_system, random);
        prop_assert!(matches!(other.stop, Stop::End), "{:?}", other.stop);
        prop_assert_eq!(plain.switches.len(), other.switches.len());
        for (a, b) in plain.switches.iter().zip(other.switches.iter()) {
            prop_assert_eq!(a.kind, b.kind);
            for (j, &entry) in a.mode_after.entries().iter().enumerate() {
                let place = m - 1 - j;
                let turned = if factors[place] > 0.0 { 1 } else { -1 };
                prop_assert_eq!(entry, turned * b.mode_after.entries()[place]);
            }
        }
        Ok(())
    });
}

#[test]
fn repeated_runs_agree_to_the_bit() {
    for_systems(100, 5, |random| {
        let system = system(random, &ORDER[..random.m], &ONES[..random.m]);
        let (a, b) = (run(&system, random), run(&system, random));
        prop_assert_eq!(a.t, b.t);
        prop_assert_eq!(a.y, b.y);
        prop_assert_eq!(a.switches, b.switches);
        Ok(())
    });
}
