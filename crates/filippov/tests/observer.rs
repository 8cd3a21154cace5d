//! What an observer of a run is handed, against what is known of the instants.

use filippov::action::{Action, Actions, Clock, Trigger};
use filippov::motion::Guard;
use filippov::{
    ClosureSystem, Gradient, InstantRecord, Integrator, Kind, Mode, ObservedStep, Observer,
    Options, PiecewiseSystem, Problem, Solution,
};

/// A copy of the record of an instant.
#[derive(Debug)]
struct Instant {
    t: [f64; 2],
    x: [Vec<f64>; 2],
    discrete: [Vec<f64>; 2],
    mode: [Mode; 2],
    field: [Vec<f64>; 2],
    guards: Vec<Guard>,
    gradient: Gradient,
    map: Option<Vec<f64>>,
}

#[derive(Default)]
struct Kept {
    instants: Vec<Instant>,
    times: Vec<f64>,
    middle: Vec<f64>,
}

impl Observer for Kept {
    fn step(&mut self, step: &ObservedStep) {
        assert!(step.t_start() < step.t_end);
        let mut x = step.x_end.to_vec();
        step.at(0.5 * (step.t_start() + step.t_end), &mut x);
        self.middle.push(x[0]);
        self.times.push(step.t_end);
    }

    fn instant(&mut self, instant: &InstantRecord) {
        self.instants.push(Instant {
            t: instant.t,
            x: instant.x.map(<[f64]>::to_vec),
            discrete: instant.discrete.map(<[f64]>::to_vec),
            mode: instant.mode.map(Mode::clone),
            field: instant.field.map(<[f64]>::to_vec),
            guards: instant.guards.to_vec(),
            gradient: instant.gradient.clone(),
            map: instant.map.map(<[f64]>::to_vec),
        });
    }
}

fn observe(problem: Problem) -> (Kept, Solution) {
    let mut kept = Kept::default();
    let integrator = Integrator::new(problem).expect("the arguments are in range");
    let solution = integrator.observed_by(&mut kept).solve();
    (kept, solution)
}

fn rate(instant: &Instant) -> f64 {
    let pairs = instant.gradient.state.iter().zip(&instant.field[0]);
    instant.gradient.time + pairs.map(|(g, f)| g * f).sum::<f64>()
}

/// The oscillator with dry friction on a moving belt.
fn friction() -> impl PiecewiseSystem {
    ClosureSystem::new(
        2,
        1,
        |t, x, s, dx| (dx[0], dx[1]) = (x[1], -x[0] + (t / 3.0).sin() - 0.4 * s[0]),
        |_t, x, h| h[0] = x[1],
    )
}

#[test]
fn instants_are_the_switches_with_the_fields_of_both_sides() {
    let (system, options) = (friction(), Options::default());
    let problem = Problem::new(&system, (0.0, 60.0), &[1.0, 2.0]).options(&options);
    let (kept, solution) = observe(problem);
    assert_eq!(kept.instants.len(), solution.switches.len());
    assert!(kept.instants.len() > 8);
    let mut kinds = Vec::new();
    for (instant, switch) in kept.instants.iter().zip(solution.switches.iter()) {
        assert_eq!(instant.t, [switch.t; 2]);
        assert_eq!(
            instant.mode,
            [switch.mode_before.clone(), switch.mode_after.clone()]
        );
        let pairs = instant.x[1].iter().zip(&switch.y_after);
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-15));
        assert!(instant.map.is_none());
        kinds.push(switch.kind);
        let (t, x) = (switch.t, &instant.x[1]);
        for (mode, field) in instant.mode.iter().zip(&instant.field) {
            let slip = f64::from(mode.entries()[0]);
            let acceleration = if slip == 0.0 {
                0.0
            } else {
                -x[0] + (t / 3.0).sin() - 0.4 * slip
            };
            assert!(
                (field[1] - acceleration).abs() < 1e-9,
                "{field:?} {acceleration}"
            );
            assert!((field[0] - x[1]).abs() < 1e-9);
        }
        // The guard falls to zero.
        assert!(rate(instant) < 0.0);
        let exact = match instant.guards[..] {
            // In the sense of the side that the motion comes from.
            [Guard::Surface(0)] => [0.0, 0.0, f64::from(instant.mode[0].entries()[0])],
            // The normal component -x + sin(t/3) -+ 0.4 of the side that is left to.
            [Guard::Multiplier { surface: 0, end }] => {
                let sense = -f64::from(end);
                [sense * (t / 3.0).cos() / 3.0, -sense, 0.0]
            }
            ref other => panic!("{other:?}"),
        };
        let (time, state) = (instant.gradient.time, &instant.gradient.state);
        for (found, exact) in [time, state[0], state[1]].into_iter().zip(exact) {
            assert!((found - exact).abs() < 1e-8, "{found} {exact}");
        }
    }
    assert!(kinds.contains(&Kind::EnterSliding) && kinds.contains(&Kind::ExitSliding));
    assert_eq!(kept.times.last(), Some(&60.0));
    assert_eq!(kept.times.len() as u64, solution.stats.n_steps);
}

#[test]
fn a_run_is_the_same_whether_it_is_observed_or_not() {
    let system = friction();
    let problem = Problem::new(&system, (0.0, 60.0), &[1.0, 2.0]);
    let (_, observed) = observe(problem);
    let alone = problem.solve().expect("the arguments are in range");
    assert_eq!(observed.y, alone.y);
    assert_eq!(observed.switches.len(), alone.switches.len());
}

/// A ball above a table.
fn ball() -> impl PiecewiseSystem {
    ClosureSystem::new(
        2,
        1,
        |_, x, _, dx| (dx[0], dx[1]) = (x[1], -9.81),
        |_, x, h| h[0] = x[0],
    )
    .with_smooth_surfaces(&[0])
}

/// The ball loses half of its speed.
fn bounce(_t: f64, x: &mut [f64], _q: &mut [f64]) {
    x[1] *= -0.5;
}

fn impact() -> Action<'static> {
    Action {
        trigger: Trigger::Surface {
            index: 0,
            direction: -1,
            side: 1,
        },
        map: &bounce,
        name: "impact".into(),
        kind: Some(Kind::Reset),
    }
}

#[test]
fn maps_are_handed_with_their_derivatives() {
    let ball = ball();
    let kick = |_t: f64, x: &mut [f64], q: &mut [f64]| {
        x[1] += x[0] * x[0];
        q[0] += 1.0;
    };
    let clock = Clock {
        period: 0.2,
        phase: 0.2,
    };
    let actions = Actions {
        list: vec![
            impact(),
            Action {
                trigger: Trigger::Clock {
                    clock,
                    at_start: false,
                },
                map: &kick,
                name: "kick".into(),
                kind: Some(Kind::Clock),
            },
        ],
        discrete: vec![0.0],
    };
    let problem = Problem::new(&ball, (0.0, 0.55), &[1.0, 0.0]).actions(&actions);
    let (kept, _) = observe(problem);
    let [first, second, impact] = &kept.instants[..] else {
        panic!("{:?}", kept.instants);
    };
    for (instant, count) in [(first, 1.0), (second, 2.0)] {
        assert!(instant.guards.is_empty());
        assert_eq!(instant.gradient.time, 1.0);
        assert_eq!(instant.discrete, [vec![count - 1.0], vec![count]]);
        let map = instant.map.as_ref().expect("the clock acts");
        let exact = [1.0, 0.0, 2.0 * instant.x[0][0], 1.0];
        assert!(
            map.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-9),
            "{map:?}"
        );
    }
    assert_eq!(impact.guards, [Guard::Surface(0)]);
    let map = impact.map.as_ref().expect("the impact acts");
    assert!(map
        .iter()
        .zip([1.0, 0.0, 0.0, -0.5])
        .all(|(a, b)| (a - b).abs() < 1e-12));
    assert_eq!(impact.x[1][1], -0.5 * impact.x[0][1]);
}

#[test]
fn the_limit_of_infinitely_many_impacts_has_a_later_time() {
    let ball = ball();
    let actions = Actions {
        list: vec![impact()],
        discrete: Vec::new(),
    };
    let (kept, _) = observe(Problem::new(&ball, (0.0, 5.0), &[1.0, 0.0]).actions(&actions));
    let rest = kept.instants.last().expect("it comes to rest");
    assert!(rest.t[0] < rest.t[1]);
    assert!((rest.t[1] - 3.0 * (2.0_f64 / 9.81).sqrt()).abs() < 1e-5);
    assert_eq!(rest.mode[1].entries(), [0]);
    assert!(rest.field[1].iter().all(|v| v.abs() < 1e-9));
}

/// Two surfaces: entries to and exits from their intersection.
#[test]
fn guards_of_an_intersection_have_gradients() {
    let system = ClosureSystem::new(
        3,
        2,
        |t, x, s, dx| {
            dx[0] = 0.5 * t - s[0] + 0.1 * x[2];
            dx[1] = 0.3 - s[1];
            dx[2] = 1.0 + s[0];
        },
        |_t, x, h| (h[0], h[1]) = (x[0], x[1]),
    );
    let (kept, solution) = observe(Problem::new(&system, (0.0, 6.0), &[0.2, 0.3, 0.0]));
    let exit = kept
        .instants
        .iter()
        .find(|instant| matches!(instant.guards.first(), Some(Guard::Multiplier { .. })))
        .expect("the multiplier of the first surface reaches 1");
    assert_eq!(exit.mode[0].entries(), [0, 0], "{:?}", solution.switches);
    // 1 - lambda_0 = 1 - 0.5 t - 0.1 x_2, up to a factor.
    let g = &exit.gradient;
    assert!((g.state[2] / g.time - 0.2).abs() < 1e-6, "{g:?}");
    assert!(g.state[0].abs().max(g.state[1].abs()) < 1e-6 * g.time.abs());
    assert!(rate(exit) < 0.0);
}
