//! Everything that can be done with a system, for any system that was accepted.

use filippov::{
    classify, BothSides, Inspection, Method, Options, PiecewiseSystem, Place, SavedSystem, Setting,
};
use filippov_expr::Backend;

/// Of so many systems one is compiled to native code: that takes much longer than all of the rest.
const ONE_NATIVE_IN: u64 = 16;

/// Larger systems are looked at in a few modes only.
const MOST_SURFACES: usize = 6;

/// Surfaces that near are taken for those of a point.
const REACH: f64 = 1e-9;

/// Builds a system and uses it; false if it is refused when it is built.
pub fn use_everything(system: SavedSystem, case: u64) -> bool {
    let backend = match case % ONE_NATIVE_IN {
        0 => Backend::Auto,
        _ => Backend::Interpreter,
    };
    let (n, parameters) = (system.definition.field.len(), system.defaults.clone());
    let Ok(runnable) = system.build(backend) else {
        return false;
    };
    for (t, scale) in [(0.0, 0.0), (0.3, 0.7)] {
        let x: Vec<f64> = (0..n).map(|i| scale * (1.0 - 0.6 * i as f64)).collect();
        let ready = runnable.at(&parameters, t, &x).unwrap();
        let (system, q) = (ready.system(), ready.discrete());
        evaluate(system, (t, &x), q);
    }
    let methods = [
        Method::Auto,
        Method::Dopri5,
        Method::Taylor,
        Method::Rodas5p,
        Method::Dop853,
    ];
    let options = Options {
        method: methods[case as usize / 7 % methods.len()],
        max_steps: 60,
        max_events: 30,
        max_wall_time: Some(0.2),
        ..Options::default()
    };
    let start: Vec<f64> = (0..n).map(|i| 0.9 / (1.0 + i as f64)).collect();
    if let Ok(solution) = runnable.solve((0.0, 2.0), &start, &parameters, &options, &[]) {
        let _ = format!("{:?}", solution.stop);
        let _ = solution.last_state();
    }
    true
}

fn evaluate(system: &dyn PiecewiseSystem, (t, x): (f64, &[f64]), q: &[f64]) {
    let (n, d) = (system.n_states(), system.n_surfaces());
    let mut out = vec![0.0; n];
    let (mut h, mut rates) = (vec![0.0; d], vec![0.0; d]);
    for side in [1.0, -1.0] {
        let signs = vec![side; d];
        let place = Setting::new(&signs, q).at(t, x);
        system.field(&place, &mut out).unwrap();
        system.surfaces(&place, &mut h).unwrap();
        let velocity = out.clone();
        system
            .surface_rates(&place, &velocity, &mut h, &mut rates)
            .unwrap();
        system.active(&signs, &[], &mut vec![false; d]);
        series(system, &[], &place);
        for j in 0..d.min(MOST_SURFACES) {
            at_surface(system, j, &place);
        }
    }
    for pair in [[0, 1], [1, 2]] {
        if pair[1] < d {
            series(system, &pair, &Setting::new(&vec![1.0; d], q).at(t, x));
            system.sign_groups(&pair);
        }
    }
    // The hidden dynamics of three and more surfaces takes a second.
    if h.iter().filter(|&&h| h.abs() < REACH).count() <= 2 {
        let _ = classify(
            system,
            t,
            x,
            Inspection {
                reach: REACH,
                q,
                ..Inspection::default()
            },
        );
    }
}

fn at_surface(system: &dyn PiecewiseSystem, j: usize, place: &Place<'_>) {
    let n = system.n_states();
    let mut gradient = vec![0.0; n];
    system.gradient(j, place, &mut gradient).unwrap();
    system.surface_size(j, place).unwrap();
    let mut sides = BothSides::new(n, system.n_surfaces());
    system.both_sides(j, place, &mut sides).unwrap();
    for word in [&[][..], &[1], &[-1, 1]] {
        system.lie_derivative(j, j, word, place).unwrap();
    }
    system.rate_gradient(j, place, &mut gradient).unwrap();
    let lie = system.lie_derivatives().expect("traced");
    lie.first_lie_derivatives(j, place);
    system.stick_ratio(j, place);
    system.switches_at(j);
    assert!(system.surface_name(j).len() < 10_000);
    series(system, &[j], place);
}

fn series(system: &dyn PiecewiseSystem, sliding: &[usize], place: &Place<'_>) {
    if let Some(jets) = system.motion_jets(sliding, 5) {
        let mut out = vec![0.0; jets.width() * (jets.order() + 1)];
        system.eval_jets(&jets, place, &mut out);
    }
    if let Some(jacobian) = system.motion_jacobian(sliding) {
        let mut out = jacobian.linearisation();
        system.eval_jacobian(&jacobian, place, &mut out);
    }
}
