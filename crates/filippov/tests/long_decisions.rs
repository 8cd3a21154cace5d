//! Long decisions end at the limit of time, and where the caller wants it, whatever takes so long.
//!
//! Two clocks: one that every look at it advances, for what computes, and one that every call of the field advances, for
//! what evaluates.
#![allow(clippy::unwrap_used)]

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::Arc;
use std::time::Duration;

use filippov::action::{Action, Actions, Trigger};
use filippov::{
    Clock, ClosureSystem, Kind, ManualClock, Options, PiecewiseSystem, Problem, Solution, Stop,
};

/// Numbers between -1 and 1 without any relation to one another.
fn number(k: usize) -> f64 {
    2.0 * (2.0_f64.sqrt() * (k * k + 3 * k + 1) as f64).fract() - 1.0
}

fn options(clock: &Arc<ManualClock>) -> Options {
    Options {
        max_wall_time: Some(0.1),
        clock: Clock::Manual(Arc::clone(clock)),
        keep_decisions: 10,
        ..Options::default()
    }
}

/// A run from the origin, where all surfaces meet, that every look at the clock brings nearer to its limit of 100 looks.
fn ends_after_100_looks(system: &dyn PiecewiseSystem) {
    let clock = Arc::new(ManualClock::new(Duration::from_millis(1)));
    let y0 = vec![0.0; system.n_states()];
    let solution = Problem::new(system, (0.0, 1.0), &y0)
        .options(&options(&clock))
        .solve()
        .unwrap();
    assert!(
        matches!(solution.stop, Stop::MaxWallTime),
        "{:?}",
        solution.stop
    );
    assert_eq!(solution.t, [0.0]);
    assert!(solution.decisions.is_empty() && solution.warnings.is_empty());
    // The look at the start, and those up to the limit: none comes after it.
    assert_eq!(clock.elapsed(), Duration::from_millis(102));
}

/// Surfaces x_i = 0 in all of whose signs the field is a product, with components between -1 and 1.
fn coupled(m: usize) -> impl PiecewiseSystem {
    ClosureSystem::new(
        m,
        m,
        move |_, _, s, dx| {
            let bits = s.iter().enumerate();
            let pattern = bits.fold(0, |p, (i, &s)| p | usize::from(s > 0.0) << i);
            for (j, v) in dx.iter_mut().enumerate() {
                *v = number(pattern * s.len() + j);
            }
        },
        |_, x, h| h.copy_from_slice(x),
    )
}

/// A chain of surfaces x_i = 0, each coupled to its neighbours more strongly than to itself.
fn chain(m: usize) -> impl PiecewiseSystem {
    ClosureSystem::new(
        m,
        m,
        |_, _, s, dx| {
            for i in 0..s.len() {
                let mut rate = number(3 * i) - s[i];
                if i > 0 {
                    rate += 4.0 * number(3 * i + 1) * s[i - 1];
                }
                if i + 1 < s.len() {
                    rate += 4.0 * number(3 * i + 2) * s[i + 1];
                }
                dx[i] = rate;
            }
        },
        |_, x, h| h.copy_from_slice(x),
    )
    .with_affine_signs()
}

#[test]
fn a_search_for_all_modes_of_six_surfaces() {
    ends_after_100_looks(&coupled(6));
}

#[test]
fn a_relay_problem_of_many_surfaces() {
    ends_after_100_looks(&chain(120));
}

#[test]
fn the_caller_interrupts_a_decision() {
    let (mut asked, options) = (0, Options::default());
    let mut interrupt = |reached: filippov::Reached| {
        assert_eq!(reached.t, 0.0);
        asked += 1;
        asked == 30
    };
    let y0 = [0.0; 6];
    let system = coupled(6);
    let run = Problem::new(&system, (0.0, 1.0), &y0)
        .options(&options)
        .solve_interruptible(&mut interrupt);
    assert!(matches!(run.unwrap().stop, Stop::Interrupted));
    assert_eq!(asked, 30);
}

/// How many evaluations the decision at the start of a run takes, and how many at most it takes beyond a limit of time, of
/// ten limits spread over it. All surfaces vanish there; those of `actions` are heights of bodies, of which the first half
/// of the states are positions.
fn evaluations(
    m: usize,
    field: impl Fn(f64, &[f64], &[f64], &mut [f64]) + Sync,
    actions: &Actions,
) -> [usize; 2] {
    let free = evaluations_within(None, m, &field, actions);
    let beyond = (0..10).map(|tenth| {
        let limit = 1 + tenth * free / 10;
        evaluations_within(Some(limit), m, &field, actions).saturating_sub(limit)
    });
    [free, beyond.max().unwrap()]
}

fn evaluations_within(
    limit: Option<usize>,
    m: usize,
    field: &(impl Fn(f64, &[f64], &[f64], &mut [f64]) + Sync),
    actions: &Actions,
) -> usize {
    let bodies: Vec<usize> = (0..actions.list.len()).collect();
    let n = m + bodies.len();
    let clock = Arc::new(ManualClock::new(Duration::ZERO));
    let count = AtomicUsize::new(0);
    let counted = |t: f64, x: &[f64], s: &[f64], dx: &mut [f64]| {
        count.fetch_add(1, Ordering::Relaxed);
        clock.advance(Duration::from_millis(1));
        field(t, x, s, dx);
    };
    let system = ClosureSystem::new(n, m, counted, |_, x, h| {
        h.copy_from_slice(&x[..h.len()]);
    });
    let system = system.with_smooth_surfaces(&bodies);
    let options = Options {
        max_wall_time: limit.map(|limit| 1e-3 * (limit as f64 - 0.5)),
        // A motion that follows makes no step.
        max_steps: 0,
        ..options(&clock)
    };
    let y0 = vec![0.0; n];
    let run = Problem::new(&system, (0.0, 1.0), &y0)
        .options(&options)
        .actions(actions)
        .solve();
    let Solution { stop, t, .. } = run.unwrap();
    assert_eq!(t, [0.0]);
    assert_eq!(
        matches!(stop, Stop::MaxWallTime),
        limit.is_some(),
        "{stop:?}"
    );
    count.load(Ordering::Relaxed)
}

/// A bound of the evaluations between two looks: the test of one mode, with derivatives by differences, and the fields of all
/// sixteen sides for each of some rules. Observed with an earlier version, and kept.
const BETWEEN_LOOKS: usize = 8 * 20 + 7 * 16;

#[test]
fn modes_of_three_surfaces_where_all_rates_vanish() {
    // All rates vanish at the start, and the signs of all surfaces multiply one another.
    let field = |t: f64, _: &[f64], s: &[f64], dx: &mut [f64]| {
        let product: f64 = s.iter().product();
        for (i, v) in dx.iter_mut().enumerate() {
            *v = t * (0.3 - s[i]) * (2.0 + product);
        }
    };
    let [free, beyond] = evaluations(3, field, &Actions::none());
    assert!(free > 550 && beyond <= BETWEEN_LOOKS, "{free}, {beyond}");
}

#[test]
fn modes_of_four_surfaces_where_all_rates_vanish() {
    let field = |t: f64, _: &[f64], s: &[f64], dx: &mut [f64]| {
        let product: f64 = s.iter().product();
        for (i, v) in dx.iter_mut().enumerate() {
            *v = t * (product * number(i) + s[(i + 1) % s.len()]);
        }
    };
    let [free, beyond] = evaluations(4, field, &Actions::none());
    assert!(free > 550 && beyond <= BETWEEN_LOOKS, "{free}, {beyond}");
}

#[test]
fn bodies_in_contact() {
    // Each body falls, and what holds one of them draws all others down twice as much: no mode is admissible.
    let impact = |struck: usize| {
        move |_: f64, x: &mut [f64], _: &mut [f64]| {
            let push = -1.5 * x[6 + struck];
            for (i, v) in x[6..].iter_mut().enumerate() {
                *v += if i == struck { push } else { -2.0 * push };
            }
        }
    };
    let maps: Vec<_> = (0..6).map(impact).collect();
    let impacts = maps.iter().enumerate().map(|(index, map)| Action {
        trigger: Trigger::Surface {
            index,
            direction: -1,
            side: 1,
        },
        map,
        name: "impact".into(),
        kind: Some(Kind::Reset),
    });
    let actions = Actions {
        list: impacts.collect(),
        discrete: Vec::new(),
    };
    let field = |_: f64, x: &[f64], _: &[f64], dx: &mut [f64]| {
        dx[..6].copy_from_slice(&x[6..]);
        dx[6..].fill(-1.0);
    };
    let [free, beyond] = evaluations(6, field, &actions);
    assert!(free > 2500 && beyond <= free / 10, "{free}, {beyond}");
}
