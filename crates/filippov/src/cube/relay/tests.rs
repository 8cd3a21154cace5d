//! Relay problems: by hand, the cases of `tests/data`, random ones against all modes, chains.

use super::{Pivots, RelayError, RelayProblem, RelaySolution, Uniqueness};
use crate::cube::smallest_minor;
use crate::patience::Patience;
use crate::sparse::SparseRows;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn problem<'n>(nu: &'n [f64], n: &'n SparseRows) -> RelayProblem<'n> {
    RelayProblem {
        nu,
        n,
        noise: 1e-11,
    }
}

fn solve_relay(nu: &[f64], n: &SparseRows, before: &[i8]) -> Result<RelaySolution, RelayError> {
    super::solve_relay(&problem(nu, n), before)
}

fn solved(nu: &[f64], rows: &[Vec<f64>], before: &[i8]) -> RelaySolution {
    solve_relay(nu, &SparseRows::from_dense(rows), before).expect("solvable")
}

/// The solutions of (R) among all 3^m modes, and whether there may be more of them in between: a mode with singular N may
/// hold a continuum.
fn all_relay_modes(problem: &RelayProblem<'_>) -> (Vec<Vec<i8>>, bool) {
    let m = problem.nu.len();
    let known = &mut crate::cube::KnownUniqueness::default();
    let is_idle = problem.idle();
    let n = &problem.without(&is_idle);
    let acting = RelayProblem { n, ..*problem };
    let mut pivots = Pivots::new(acting, is_idle, Patience::endless(), known);
    let (mut found, mut has_singular) = (Vec::new(), false);
    for pattern in 0..3_usize.pow(m as u32) {
        let digit = |i: usize| (pattern / 3_usize.pow(i as u32) % 3) as i8 - 1;
        let modes: Vec<i8> = (0..m).map(digit).collect();
        match pivots.state(&modes) {
            Err(_) => has_singular = true,
            Ok(state) if !(0..m).any(|i| pivots.is_wrong(&state, i)) => found.push(modes),
            Ok(_) => {}
        }
    }
    (found, has_singular)
}

/// The largest violation of (R), relative to the rates.
fn violation(nu: &[f64], n: &SparseRows, found: &RelaySolution) -> f64 {
    (0..nu.len()).fold(0.0, |worst, i| {
        let v = nu[i] + n.dot(i, &found.signs);
        let size = nu[i].abs() + n.magnitude(i, &found.signs) + f64::MIN_POSITIVE;
        let s = found.signs[i];
        let of_mode = match found.modes[i] {
            0 => v.abs(),
            mode => (-f64::from(mode) * v).max(0.0) + size * (s - f64::from(mode)).abs(),
        };
        f64::max(worst, of_mode / size).max(s.abs() - 1.0)
    })
}

#[test]
fn one_surface_is_filippovs() {
    let n = [vec![-2.0]];
    for (nu, mode, sign, rate) in [
        (1.0, 0, 0.5, 0.0),
        (3.0, 1, 1.0, 1.0),
        (-5.0, -1, -1.0, -3.0),
    ] {
        for before in [-1, 0, 1] {
            let found = solved(&[nu], &n, &[before]);
            assert_eq!(
                (found.modes[0], found.signs[0], found.rates[0]),
                (mode, sign, rate)
            );
            assert_eq!(
                (found.uniqueness, found.degenerate.len()),
                (Uniqueness::Certain, 0)
            );
        }
    }
}

#[test]
fn both_vanishing_is_reported() {
    for before in [-1, 0, 1] {
        let found = solved(&[2.0], &[vec![-2.0]], &[before]);
        assert_eq!(
            (found.degenerate, found.signs, found.rates),
            (vec![0], vec![1.0], vec![0.0])
        );
    }
    let touching = solved(&[2.0, 0.3], &[vec![-2.0, 0.0], vec![0.0, -1.0]], &[0, 0]);
    assert_eq!(touching.degenerate, [0]);
}

#[test]
fn repulsion_has_several_solutions() {
    let found = solved(&[0.1], &[vec![1.0]], &[-1]);
    assert_eq!(
        (found.modes, found.uniqueness),
        (vec![-1], Uniqueness::Unknown)
    );
    let (all, has_singular) =
        all_relay_modes(&problem(&[0.1], &SparseRows::from_dense(&[vec![1.0]])));
    assert_eq!((all.len(), has_singular), (3, false));
    let pushed = solved(&[3.0], &[vec![1.0]], &[-1]);
    assert_eq!(
        (pushed.modes, pushed.uniqueness),
        (vec![1], Uniqueness::Certain)
    );
}

#[test]
fn kinks_follow_the_rest() {
    // The second surface is a kink: its sign has no effect, here or elsewhere.
    let n = [vec![-1.0, 0.0], vec![-2.0, 1e-18]];
    let found = solved(&[0.5, 0.25], &n, &[0, 1]);
    assert_eq!((found.modes, found.signs), (vec![0, -1], vec![0.5, -1.0]));
    assert_eq!(found.uniqueness, Uniqueness::Certain);
    let still = solved(&[0.5, 1.0], &n, &[0, 1]);
    assert_eq!(
        (still.degenerate, still.uniqueness),
        (vec![1], Uniqueness::Unknown)
    );
}

#[test]
fn redundant_contacts_share_the_load() {
    // Three brakes on one axle: v = nu - s_0 - s_1 - s_2.
    let n = vec![vec![-1.0; 3]; 3];
    for before in [[0, 0, 0], [1, 1, 1], [-1, 0, 1], [1, 0, 0]] {
        let sticking = solved(&[1.5; 3], &n, &before);
        assert_eq!(sticking.modes, [0, 0, 0]);
        assert!(
            sticking.signs.iter().all(|s| (s - 0.5).abs() < 1e-9),
            "{:?}",
            sticking.signs
        );
        let slipping = solved(&[3.5; 3], &n, &before);
        assert_eq!((slipping.modes, slipping.rates), (vec![1; 3], vec![0.5; 3]));
    }
    // As many of them as in a machine: too many to try all modes.
    let large = solved(&[25.0; 50], &vec![vec![-1.0; 50]; 50], &[1; 50]);
    // Rounding of the rates divided by the damping.
    assert!(large.signs.iter().all(|s| (s - 0.5).abs() < 1e-7));
    assert_eq!(large.uniqueness, Uniqueness::OfMotion);
}

#[test]
fn what_is_not_finite_or_not_friction_is_said() {
    let n = SparseRows::from_dense(&[vec![-1.0]]);
    assert_eq!(
        solve_relay(&[f64::NAN], &n, &[0]),
        Err(RelayError::NotFinite)
    );
    let singular = vec![vec![0.0, 1.0], vec![0.0, 0.0]];
    let found = solved(&[0.5, 0.0], &singular, &[0, 0]);
    assert_eq!(found.degenerate, [1]);
}

/// The numbers of an array that follows a key.
fn numbers(text: &str, key: &str) -> Vec<f64> {
    let start = text.find(&format!("\"{key}\":")).expect("the key") + key.len() + 3;
    let mut depth = 0;
    let array = text[start..].chars().take_while(|&c| {
        depth += i32::from(c == '[') - i32::from(c == ']');
        depth > 0 || c.is_whitespace()
    });
    let flat: String = array
        .map(|c| if "[]".contains(c) { ' ' } else { c })
        .collect();
    let entries = flat.split(',').map(|number| number.trim().parse());
    entries.collect::<Result<_, _>>().expect("numbers")
}

#[test]
fn the_cases_of_the_collection() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/data/switching_cases.json"
    );
    let text = std::fs::read_to_string(path).expect("the collection");
    let mut count = 0;
    for case in text
        .split("\"situation\":")
        .skip(2)
        .filter(|case| case.trim_start().starts_with("\"relay\""))
    {
        let (nu, flat, expected) = (
            numbers(case, "nu"),
            numbers(case, "N"),
            numbers(case, "expected"),
        );
        let m = nu.len();
        let rows: Vec<Vec<f64>> = flat.chunks(m).map(<[f64]>::to_vec).collect();
        for before in [-1, 0, 1] {
            let found = solved(&nu, &rows, &vec![before; m]);
            let modes: Vec<f64> = found.modes.iter().map(|&mode| f64::from(mode)).collect();
            assert_eq!(modes, expected, "case {case}");
            let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
            assert!(
                close(&found.signs, &numbers(case, "s"))
                    && close(&found.rates, &numbers(case, "v"))
            );
            assert_eq!(found.uniqueness, Uniqueness::Certain);
        }
        count += 1;
    }
    assert_eq!(count, 12);
}

/// A problem with m surfaces, entries in [-1, 1] and the diagonal made larger.
fn problems() -> impl Strategy<Value = (Vec<f64>, Vec<Vec<f64>>, Vec<i8>)> {
    (1_usize..=8).prop_flat_map(|m| {
        let row = prop::collection::vec(-1.0..1.0, m);
        (
            prop::collection::vec(-2.0..2.0, m),
            prop::collection::vec(row, m),
            prop::collection::vec(-1_i8..=1, m),
            0.0..1.5,
        )
            .prop_map(|(nu, mut rows, before, own): (_, Vec<Vec<f64>>, _, f64)| {
                for (i, row) in rows.iter_mut().enumerate() {
                    row[i] = -row[i].abs() - own;
                }
                (nu, rows, before)
            })
    })
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 600, failure_persistence: None, rng_seed: RngSeed::Fixed(1), max_global_rejects: 100_000, ..ProptestConfig::default()
    })]

    #[test]
    fn p_matrices_have_the_one_solution_found((nu, rows, before) in problems()) {
        let negative: Vec<Vec<f64>> = rows.iter().map(|row| row.iter().map(|v| -v).collect()).collect();
        prop_assume!(smallest_minor(&negative) > 1e-3);
        let n = SparseRows::from_dense(&rows);
        let found = solve_relay(&nu, &n, &before).expect("a P-matrix");
        prop_assert_eq!(found.uniqueness, Uniqueness::Certain);
        prop_assert!(violation(&nu, &n, &found) < 1e-10);
        if found.degenerate.is_empty() {
            let (all, _) = all_relay_modes(&problem(&nu, &n));
            prop_assert_eq!(all, vec![found.modes.clone()]);
        }
        let again = solve_relay(&nu, &n, &found.modes).expect("a P-matrix");
        prop_assert_eq!((&again.modes, again.n_pivots), (&found.modes, 1));
    }

    #[test]
    fn whatever_is_found_solves_the_problem((nu, rows, before) in problems()) {
        let n = SparseRows::from_dense(&rows);
        if let Ok(found) = solve_relay(&nu, &n, &before) {
            prop_assert!(violation(&nu, &n, &found) < 1e-8);
        }
    }

    #[test]
    fn redundant_contacts_have_one_velocity(
        nu in prop::collection::vec(-2.0..2.0, 3),
        arms in prop::collection::vec(-1.0..1.0, 15),
        start in prop::collection::vec(-1_i8..=1, 5),
    ) {
        // N = -A A^T with 5 contacts on 3 bodies, nu in the range of A.
        let rows: Vec<&[f64]> = arms.chunks(3).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let dense: Vec<Vec<f64>> = rows
            .iter()
            .map(|a| rows.iter().map(|b| -dot(a, b)).collect())
            .collect();
        let rates: Vec<f64> = rows.iter().map(|a| dot(a, &nu)).collect();
        let n = SparseRows::from_dense(&dense);
        let one = solve_relay(&rates, &n, &start).expect("monotone");
        let other = solve_relay(&rates, &n, &[0; 5]).expect("monotone");
        prop_assert!(violation(&rates, &n, &one) < 1e-7);
        for (i, rate) in rates.iter().enumerate() {
            let v = |s: &[f64]| rate + n.dot(i, s);
            prop_assert!((v(&one.signs) - v(&other.signs)).abs() < 1e-7);
        }
    }
}

/// Masses pushed with `nu`, friction between neighbours: rates couple as -(mu_j (2, -1, -1)).
fn chain(m: usize, load: f64, mixed: bool) -> (Vec<f64>, SparseRows) {
    let mut n = SparseRows::new(m);
    for i in 0..m {
        let columns = i.saturating_sub(1)..(i + 2).min(m);
        n.push_row(columns.map(|j| {
            (
                j,
                (1.0 + 0.1 * (j % 3) as f64) * if i == j { -2.0 } else { 1.0 },
            )
        }));
    }
    let push = |i: usize| {
        if mixed {
            (0.37 * i as f64).sin() + 0.3 * (1.9 * i as f64).cos()
        } else {
            1.0
        }
    };
    ((0..m).map(|i| load * push(i)).collect(), n)
}

#[test]
fn chains_are_solved_in_a_number_of_steps_that_does_not_grow() {
    for (load, mixed) in [(1e-4, true), (50.0, false), (3.0, true), (8.0, true)] {
        for before in [0, 1] {
            for m in [10, 100, 1000] {
                let (nu, n) = chain(m, load, mixed);
                let found = solve_relay(&nu, &n, &vec![before; m]).expect("friction");
                assert!(violation(&nu, &n, &found) < 1e-10);
                assert_eq!(found.uniqueness, Uniqueness::Certain);
                let sliding = found.modes.iter().filter(|&&mode| mode == 0).count();
                let expected = match (load, mixed) {
                    (1e-4, _) => m..=m,
                    (50.0, false) => 0..=0,
                    _ => 1..=m / 2,
                };
                assert!(expected.contains(&sliding), "{sliding} of {m} slide");
                assert!(found.n_pivots <= 16, "{} steps for {m}", found.n_pivots);
                assert!(
                    found.n_operations <= 100 * m,
                    "{} operations",
                    found.n_operations
                );
            }
        }
    }
}

#[test]
fn redundant_contacts_stick_though_one_of_them_be_at_its_limit() {
    // v_0 = v_1 and v_0 = 0 are reached at once: the least signs that hold would have |s_0| > 1.
    let n = vec![
        vec![-0.07497008918135284, 0.0, -0.20824086372106426, 0.0],
        vec![0.0, -0.5972311458188959, 0.45076785452004287, 0.0],
        vec![
            -0.07497008918135284,
            0.5972311458188959,
            -0.6590087182411071,
            0.0,
        ],
        vec![0.0, 0.0, 0.0, -1.032975138214604],
    ];
    let nu = [
        -0.2466256497092047,
        -0.0716068596042802,
        -0.1750187901049245,
        0.4143809623537302,
    ];
    let found = solved(&nu, &n, &[1, 1, 0, 0]);
    assert_eq!(found.modes, [0; 4]);
    assert!(found.signs[0] == -1.0 && found.degenerate.is_empty());
    assert_eq!(
        (found.uniqueness, found.loops),
        (Uniqueness::OfMotion, vec![vec![0, 1, 2]])
    );
}

#[test]
fn a_load_of_rounding_is_carried_by_redundant_contacts() {
    let n = vec![
        vec![-0.6, -0.5, 0.7],
        vec![-0.3, -0.5, 0.0],
        vec![0.3, 0.0, -0.7],
    ];
    for nu in [[0.0; 3], [1.1e-16, 0.0, 0.0], [0.0, -5.6e-17, 2.8e-17]] {
        let found = solved(&nu, &n, &[1, 1, 1]);
        assert_eq!((found.modes, found.degenerate), (vec![0; 3], vec![]));
    }
}
