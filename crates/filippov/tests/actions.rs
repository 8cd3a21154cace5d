//! Actions: impacts, contact, clocks, and their order in one instant.
#![allow(clippy::unwrap_used)]

use filippov::action::{Action, ActionMap, Actions, Clock, Trigger};
use filippov::{ClosureSystem, Kind, Options, PiecewiseSystem, Problem, Side, Solution, Stop};

fn options() -> Options {
    Options {
        rtol: 1e-10,
        atol: vec![1e-10],
        ..Options::default()
    }
}

fn at_surface(index: usize, direction: i8, map: &dyn ActionMap) -> Action<'_> {
    Action {
        trigger: Trigger::Surface {
            index,
            direction,
            side: 1,
        },
        map,
        name: format!("reset{index}"),
        kind: Some(Kind::Reset),
    }
}

fn ticking(period: f64, phase: f64, map: &dyn ActionMap) -> Action<'_> {
    Action {
        trigger: Trigger::Clock {
            clock: Clock { period, phase },
            at_start: true,
        },
        map,
        name: "clock".into(),
        kind: Some(Kind::Clock),
    }
}

fn run(system: &dyn PiecewiseSystem, t_end: f64, y0: &[f64], list: Vec<Action>) -> Solution {
    let actions = Actions {
        list,
        discrete: Vec::new(),
    };
    let problem = Problem::new(system, (0.0, t_end), y0);
    problem
        .options(&options())
        .actions(&actions)
        .solve()
        .unwrap()
}

/// The height of the ball over a table at `amplitude sin(frequency t)`.
fn ball(amplitude: f64, frequency: f64) -> impl PiecewiseSystem {
    ClosureSystem::new(
        2,
        1,
        |_, x, _, dx| (dx[0], dx[1]) = (x[1], -9.8),
        move |t, x, h| h[0] = x[0] - amplitude * (frequency * t).sin(),
    )
    .with_smooth_surfaces(&[0])
}

#[test]
fn a_bouncing_ball_comes_to_rest_at_the_limit_of_its_impacts() {
    let bounce = |_: f64, x: &mut [f64], _: &mut [f64]| x[1] *= -0.9;
    let solution = run(
        &ball(0.0, 0.0),
        40.0,
        &[10.0, 0.0],
        vec![at_surface(0, -1, &bounce)],
    );
    assert!(matches!(solution.stop, Stop::End), "{:?}", solution.stop);
    let fall = (2.0 * 10.0 / 9.8_f64).sqrt();
    let switches: Vec<_> = solution.switches.iter().collect();
    let (rest, impacts) = switches.split_last().unwrap();
    assert_eq!(rest.kind, Kind::Accumulation);
    assert!((rest.t - 19.0 * fall).abs() < 1e-9, "{}", rest.t);
    let mut expected = fall;
    for (k, impact) in impacts.iter().enumerate() {
        assert_eq!(impact.kind, Kind::Reset);
        assert!((impact.t - expected).abs() < 1e-9, "{k}: {}", impact.t);
        expected += 2.0 * fall * 0.9_f64.powi(k as i32 + 1);
    }
    assert!(impacts.len() > 100);
    assert_eq!(solution.mode.entries(), [0]);
    assert!(solution.last_state().iter().all(|v| v.abs() < 1e-12));
}

#[test]
fn a_ball_that_loses_all_speed_stays_at_once() {
    let stick = |_: f64, x: &mut [f64], _: &mut [f64]| x[1] = 0.0;
    let solution = run(
        &ball(0.0, 0.0),
        3.0,
        &[1.0, 0.0],
        vec![at_surface(0, -1, &stick)],
    );
    assert_eq!(solution.switches.len(), 1);
    assert_eq!(solution.switches.at(0).mode_after.entries(), [0]);
    assert_eq!(solution.last_state(), [0.0, 0.0]);
}

#[test]
fn a_ball_at_rest_on_a_table_lifts_off_where_the_table_falls_faster() {
    // The table A sin(w t) starts upwards: contact until A w^2 sin(w t) = g.
    let (amplitude, frequency) = (1.0, 4.0);
    let velocity = move |t: f64| amplitude * frequency * (frequency * t).cos();
    let bounce = move |t: f64, x: &mut [f64], _: &mut [f64]| {
        let v = velocity(t);
        x[1] = v - 0.5 * (x[1] - v);
    };
    let solution = run(
        &ball(amplitude, frequency),
        1.2,
        &[0.0, amplitude * frequency],
        vec![at_surface(0, -1, &bounce)],
    );
    assert_eq!(solution.segments.at(0).mode.entries(), [0]);
    let lift_off = (9.8_f64 / 16.0).asin() / frequency;
    assert!((solution.switches.at(0).t - lift_off).abs() < 1e-9);
    assert_eq!(solution.switches.at(0).kind, Kind::ExitSliding);
    // Free flight from there.
    let (x, v) = (amplitude * (frequency * lift_off).sin(), velocity(lift_off));
    let height = |t: f64| {
        let s = t - lift_off;
        x + v * s - 4.9 * s * s - amplitude * (frequency * t).sin()
    };
    let landing = solution.switches.at(1).t;
    assert_eq!(solution.switches.at(1).kind, Kind::Reset);
    assert!(height(landing).abs() < 1e-8, "{}", height(landing));
    assert!(landing > lift_off + 0.1);
}

#[test]
fn a_reset_that_does_not_change_the_direction_lets_the_motion_cross() {
    // A phase that is set back whenever x0 passes zero upwards.
    let rotation = ClosureSystem::new(
        3,
        1,
        |_, x, _, dx| (dx[0], dx[1], dx[2]) = (x[1], -x[0], 1.0),
        |_, x, h| h[0] = x[0],
    )
    .with_smooth_surfaces(&[0]);
    let set_back = |_: f64, x: &mut [f64], _: &mut [f64]| x[2] = 0.0;
    let solution = run(
        &rotation,
        30.0,
        &[-1.0, 0.0, 0.0],
        vec![at_surface(0, 1, &set_back)],
    );
    let resets: Vec<f64> = solution
        .switches
        .iter()
        .filter(|s| s.kind == Kind::Reset)
        .map(|s| s.t)
        .collect();
    assert_eq!(resets.len(), 5);
    for (k, t) in resets.iter().enumerate() {
        let expected = std::f64::consts::PI * (0.5 + 2.0 * k as f64);
        assert!((t - expected).abs() < 1e-9, "{t} {expected}");
    }
    // Between them the surface is crossed in the other direction.
    let n_crossings = solution
        .switches
        .iter()
        .filter(|s| s.kind == Kind::Crossing)
        .count();
    assert_eq!(n_crossings, 5);
}

#[test]
fn ticks_are_step_ends_and_the_state_jumps_there() {
    let decay = ClosureSystem::new(1, 0, |_, x, _, dx| dx[0] = -x[0], |_, _, _| {});
    let dose = |_: f64, x: &mut [f64], _: &mut [f64]| x[0] += 1.0;
    let solution = run(&decay, 1.0, &[0.0], vec![ticking(0.1, 0.0, &dose)]);
    assert_eq!(solution.switches.len(), 11);
    let r = (-0.1_f64).exp();
    let mut level = 0.0;
    for (k, switch) in solution.switches.iter().enumerate() {
        assert!((switch.t - 0.1 * k as f64).abs() < 1e-15);
        assert!((switch.y_before[0] - level).abs() < 1e-10);
        assert!((switch.y_after[0] - level - 1.0).abs() < 1e-10);
        let mut y = [0.0];
        solution
            .evaluate(&decay, switch.t, Side::Left, &mut y)
            .unwrap();
        assert!((y[0] - level).abs() < 1e-10, "{k}");
        solution
            .evaluate(&decay, switch.t, Side::Right, &mut y)
            .unwrap();
        assert!((y[0] - level - 1.0).abs() < 1e-10, "{k}");
        level = (level + 1.0) * r;
    }
    assert!((solution.last_state()[0] - solution.switches.at(10).y_after[0]).abs() < 1e-15);
}

#[test]
fn actions_at_one_instant_are_done_in_their_order() {
    let still = ClosureSystem::new(1, 0, |_, _, _, dx| dx[0] = 0.0, |_, _, _| {});
    let double = |_: f64, x: &mut [f64], _: &mut [f64]| x[0] *= 2.0;
    let add = |_: f64, x: &mut [f64], _: &mut [f64]| x[0] += 1.0;
    let end = |list: Vec<Action>| run(&still, 0.35, &[1.0], list).last_state()[0];
    // Both tick at 0, and at 0.3, where the times differ by a rounding.
    let (a, b) = (ticking(0.1, 0.1, &double), ticking(0.3, 0.3, &add));
    assert_eq!(end(vec![a, b]), 25.0);
    let (a, b) = (ticking(0.1, 0.1, &double), ticking(0.3, 0.3, &add));
    assert_eq!(end(vec![b, a]), 34.0);
}

#[test]
fn an_impulse_runs_through_a_chain_of_balls() {
    // Three equal balls on a line, elastic: the first stops, the last flies on.
    let chain = ClosureSystem::new(
        6,
        2,
        |_, x, _, dx| {
            dx[..3].copy_from_slice(&x[3..]);
            dx[3..].fill(0.0);
        },
        |_, x, h| {
            h[0] = x[1] - x[0];
            h[1] = x[2] - x[1];
        },
    )
    .with_smooth_surfaces(&[0, 1]);
    let first = |_: f64, x: &mut [f64], _: &mut [f64]| x.swap(3, 4);
    let second = |_: f64, x: &mut [f64], _: &mut [f64]| x.swap(4, 5);
    let y0 = [-1.0, 0.0, 0.0, 1.0, 0.0, 0.0];
    let list = vec![at_surface(0, -1, &first), at_surface(1, -1, &second)];
    let solution = run(&chain, 2.0, &y0, list);
    assert!(matches!(solution.stop, Stop::End), "{:?}", solution.stop);
    let end = solution.last_state();
    for (value, expected) in end.iter().zip([0.0, 0.0, 1.0, 0.0, 0.0, 1.0]) {
        assert!((value - expected).abs() < 1e-12, "{end:?}");
    }
}

#[test]
fn actions_that_trigger_each_other_for_ever_are_named() {
    let rising = ClosureSystem::new(
        1,
        2,
        |_, _, _, dx| dx[0] = 1.0,
        |_, x, h| {
            h[0] = x[0] - 1.0;
            h[1] = x[0] + 1.0;
        },
    )
    .with_smooth_surfaces(&[0, 1]);
    let down = |_: f64, x: &mut [f64], _: &mut [f64]| x[0] = -2.0;
    let up = |_: f64, x: &mut [f64], _: &mut [f64]| x[0] = 2.0;
    let list = vec![at_surface(0, 1, &down), at_surface(1, -1, &up)];
    let solution = run(&rising, 5.0, &[0.0], list);
    assert!(
        matches!(solution.stop, Stop::ActionsDoNotEnd { .. }),
        "{:?}",
        solution.stop
    );
    assert!((solution.t_last - 1.0).abs() < 1e-12);
}

#[test]
fn a_body_in_contact_sticks_by_friction_until_it_is_pulled_too_hard() {
    // A block falls on a table (no rebound) and is pulled sideways by t; friction coefficient 0.5, force of the
    // table 9.8 by contact: it slides from t = 4.9 on.
    let block = ClosureSystem::new(
        4,
        2,
        |t, x, s, dx| {
            // x, y, x', y'; friction acts with a fixed normal force of 9.8 here.
            dx.copy_from_slice(&[x[2], x[3], t - 4.9 * s[1], -9.8]);
        },
        |_, x, h| (h[0], h[1]) = (x[1], x[2]),
    )
    .with_smooth_surfaces(&[0]);
    let plastic = |_: f64, x: &mut [f64], _: &mut [f64]| x[3] = 0.0;
    let list = vec![at_surface(0, -1, &plastic)];
    let solution = run(&block, 6.0, &[0.0, 1.0, 0.0, 0.0], list);
    assert!(matches!(solution.stop, Stop::End), "{:?}", solution.stop);
    let slip = solution.switches.last().unwrap();
    assert!((slip.t - 4.9).abs() < 1e-9, "{}", slip.t);
    assert_eq!(slip.mode_before.entries(), [0, 0]);
    assert_eq!(slip.mode_after.entries(), [0, 1]);
    let expected = 0.5 * 1.1 * 1.1;
    assert!((solution.last_state()[2] - expected).abs() < 1e-9);
}
