//! Returns to sections, against closed forms.

use std::collections::VecDeque;
use std::f64::consts::PI;

use super::{Cycle, Place, Return, Returns, Section};
use crate::switch::Kind;
use crate::system::Clock;
use crate::{ClosureSystem, Options, PiecewiseSystem, Problem, Solution, Stop};

/// x'' = -x, a circle.
fn circle() -> impl PiecewiseSystem {
    ClosureSystem::new(
        2,
        0,
        |_, x, _, dx| (dx[0], dx[1]) = (x[1], -x[0]),
        |_, _, _| {},
    )
}

/// x' = 1.2 sin t - sign x: it leaves x = 0 upwards where 1.2 sin t = 1, comes back at `BACK`, and slides until it
/// leaves downwards half a turn later.
fn pushed() -> impl PiecewiseSystem {
    ClosureSystem::new(
        2,
        1,
        |t, _, s, dx| (dx[0], dx[1]) = (1.2 * t.sin() - s[0], 0.0),
        |_, x, h| h[0] = x[0],
    )
}

/// The zero of 1.2 (cos LEAVE - cos t) - (t - LEAVE) after LEAVE = asin(1 / 1.2).
fn back() -> f64 {
    let leave = (1.0_f64 / 1.2).asin();
    let mut t = 2.7;
    for _ in 0..50 {
        let value: f64 = 1.2 * (leave.cos() - f64::cos(t)) - (t - leave);
        t -= value / (1.2 * f64::sin(t) - 1.0);
    }
    t
}

fn run(system: &dyn PiecewiseSystem, y0: &[f64], section: &Section) -> (Solution, Returns) {
    let options = Options {
        rtol: 1e-11,
        atol: vec![1e-11],
        ..Options::default()
    };
    let span = (0.0, 1e3);
    let mut solution = Problem::new(system, span, y0)
        .options(&options)
        .solve_to_section(section, &mut |_| false)
        .expect("the arguments are in range");
    let returns = solution.returns.take().expect("there is a section");
    (solution, returns)
}

fn cycle(ends_run: bool) -> Option<Cycle> {
    Some(Cycle {
        rtol: 1e-7,
        atol: vec![1e-7; 2],
        moduli: vec![0.0; 2],
        longest: 8,
        ends_run,
    })
}

#[test]
fn zeros_of_a_function_in_one_direction() {
    let height = |_t: f64, x: &[f64]| x[0];
    for (direction, first) in [(1.0, 1.5 * PI), (-1.0, 0.5 * PI)] {
        let place = Place::Function {
            function: &height,
            direction,
        };
        let section = Section {
            place,
            transient: 1,
            most: 3,
            cycle: None,
            keeps_pieces: false,
        };
        let (solution, returns) = run(&circle(), &[1.0, 0.0], &section);
        assert!(matches!(solution.stop, Stop::Returned));
        assert_eq!(returns.count, 4);
        for (k, kept) in returns.kept.iter().enumerate() {
            let expected = first + 2.0 * PI * (k + 1) as f64;
            assert!((kept.t - expected).abs() < 1e-9, "{} {expected}", kept.t);
            assert!((kept.duration - 2.0 * PI).abs() < 1e-9);
        }
        assert!((solution.t_last - (first + 6.0 * PI)).abs() < 1e-9);
    }
}

#[test]
fn ticks_do_not_stop_the_motion() {
    let section = Section {
        place: Place::Ticks(Clock {
            period: 0.25 * PI,
            phase: 0.1,
        }),
        transient: 0,
        most: 40,
        cycle: cycle(true),
        keeps_pieces: false,
    };
    let (solution, returns) = run(&circle(), &[1.0, 0.0], &section);
    assert!(matches!(solution.stop, Stop::Periodic));
    assert_eq!(
        (returns.period, returns.kept.len(), returns.count),
        (8, 8, 28)
    );
    for (k, kept) in returns.kept.iter().enumerate() {
        let t = 0.1 + 0.25 * PI * (k + 20) as f64;
        assert_eq!(kept.t, t);
        assert!((kept.y[0] - t.cos()).abs() < 1e-9);
    }
}

#[test]
fn arrivals_at_a_surface_and_departures_from_it() {
    let place = |direction, kind| Section {
        place: Place::Surface {
            index: 0,
            direction,
            kind,
        },
        transient: 3,
        most: 2,
        cycle: None,
        keeps_pieces: false,
    };
    let (leave, back) = ((1.0_f64 / 1.2).asin(), back());
    let system = pushed();
    let start = [0.0, 0.0];
    let modes = |kept: &super::Return| -> Vec<i8> {
        kept.modes.iter().map(|mode| mode.entries()[0]).collect()
    };
    let (_, both) = run(&system, &start, &place(0, None));
    for (k, kept) in both.kept.iter().enumerate() {
        assert!((kept.t - back - PI * (k + 3) as f64).abs() < 1e-9);
        assert!((kept.duration - PI).abs() < 1e-9);
        assert!((kept.sliding - (PI + leave - back)).abs() < 1e-9);
        let side = if k == 0 { -1 } else { 1 };
        assert_eq!(modes(kept), [0, side]);
    }
    let (_, from_above) = run(&system, &start, &place(-1, None));
    assert!((from_above.kept[0].t - back - 6.0 * PI).abs() < 1e-9);
    assert_eq!(modes(&from_above.kept[0]), [0, -1, 0, 1]);
    let (_, upwards) = run(&system, &start, &place(1, Some(Kind::ExitSliding)));
    assert!((upwards.kept[1].t - leave - 8.0 * PI).abs() < 1e-9);
    assert_eq!(modes(&upwards.kept[1]), [1, 0, -1, 0]);
    let (_, crossings) = run(&system, &start, &place(0, Some(Kind::Crossing)));
    assert_eq!(crossings.count, 0);
}

#[test]
fn a_phase_counts_up_to_its_modulus() {
    let drift = ClosureSystem::new(
        2,
        0,
        |_, _, _, dx| (dx[0], dx[1]) = (0.0, 1.0),
        |_, _, _| {},
    );
    let mut test = cycle(true);
    let section = |cycle| Section {
        place: Place::Ticks(Clock {
            period: 0.5,
            phase: 0.0,
        }),
        transient: 0,
        most: 20,
        cycle,
        keeps_pieces: false,
    };
    let (_, returns) = run(&drift, &[0.0, 0.3], &section(test.clone()));
    assert_eq!(returns.period, 0);
    if let Some(test) = &mut test {
        test.moduli[1] = 1.5;
    }
    let (_, returns) = run(&drift, &[0.0, 0.3], &section(test));
    assert_eq!((returns.period, returns.kept.len()), (3, 3));
}

/// The period first found in the returns y(0), y(1), ..., and after how many of them.
fn first_period(y: impl Fn(i32) -> [f64; 2]) -> (usize, i32) {
    let test = cycle(true).expect("there is one");
    let mut latest = VecDeque::new();
    for k in 0..300_000 {
        latest.push_back(Return {
            t: f64::from(k),
            y: y(k).to_vec(),
            duration: 1.0,
            ..Return::default()
        });
        if latest.len() > 4 * test.longest {
            latest.pop_front();
        }
        if let Some(period) = test.period(&latest) {
            return (period, k);
        }
    }
    (0, 300_000)
}

#[test]
fn the_way_to_an_orbit_is_not_its_period() {
    for mu in [0.9, -0.5, -0.9, -0.99, -0.9999] {
        let (period, k) = first_period(|k| [1.0 + f64::powi(mu, k), 0.5]);
        assert_eq!(period, 1, "multiplier {mu}");
        let last = (f64::powi(mu, k) - f64::powi(mu, k - 1)).abs();
        assert!(
            last < 2.1e-7,
            "multiplier {mu}: the last two differ by {last}"
        );
    }
    // Around a point by a fifth of a turn each, and to an orbit of period 2 from alternating sides.
    let turn = 0.4 * PI;
    let around = |k: i32| {
        let (size, angle) = (0.999_f64.powi(k), turn * f64::from(k));
        [size * angle.cos(), size * angle.sin()]
    };
    assert_eq!(first_period(around).0, 1);
    let two = |k: i32| [f64::from(k % 2), (-0.99_f64).powi(k / 2)];
    assert_eq!(first_period(two).0, 2);
}

#[test]
fn an_orbit_of_a_higher_period_is_found_on_the_way_to_it() {
    for mu in [0.0, 0.5, -0.5, 0.99, -0.99] {
        for q in [2, 3, 4, 6, 8] {
            let y = |k: i32| {
                let spread = 0.3 + f64::powi(mu, k);
                [1.0 + spread * f64::from(k % q), 0.5]
            };
            assert_eq!(first_period(y).0, q as usize, "multiplier {mu}, period {q}");
        }
    }
}
