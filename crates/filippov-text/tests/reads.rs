//! Texts that are read, and texts that are not.

#![allow(clippy::unwrap_used)]

use filippov::Options;
use filippov_expr::Backend;
use filippov_text::read;

const OSCILLATOR: &str = "\
import numpy as np

y0 = [1, 2]
t_span = (0, 60 * np.pi)


def oscillator(t, x, F=0.4, omega=1 / 3):
    \"\"\"An oscillator with dry friction.\"\"\"
    y, v = x
    if v > 0:
        friction = F
    else:
        friction = -F
    return v, -y + np.sin(omega * t) - friction
";

#[test]
fn a_text_is_a_system_that_runs() {
    let model = read(OSCILLATOR).unwrap();
    assert_eq!(model.name, "oscillator");
    assert_eq!(model.system.definition.names.states, ["y", "v"]);
    assert_eq!(model.system.definition.names.parameters, ["F", "omega"]);
    assert_eq!(model.system.defaults, [0.4, 1.0 / 3.0]);
    let (y0, span) = (model.y0.unwrap(), model.t_span.unwrap());
    let system = model.system.build(Backend::Interpreter).unwrap();
    let options = Options {
        rtol: 1e-9,
        ..Options::default()
    };
    let parameters = system.system().parameters().to_vec();
    let solution = system
        .solve((span[0], span[1]), &y0, &parameters, &options, &[])
        .unwrap();
    assert!(solution.stop.is_success());
    assert_eq!(solution.switches.len(), 42);
}

#[test]
fn every_combination_of_answers_is_followed_once() {
    let branches = |n: usize| {
        let mut text = String::from("def f(t, x):\n    s = 0\n");
        for k in 0..n {
            text += &format!("    if x[0] > {k}:\n        s = s + {k} + x[0]\n");
        }
        text + "    return -s\n"
    };
    assert_eq!(
        read(&branches(6))
            .unwrap()
            .system
            .definition
            .graph
            .n_surfaces(),
        6
    );
    let refused = read(&branches(12)).unwrap_err();
    assert!(refused.error.contains("256 paths"), "{refused}");
}

#[test]
fn what_is_not_read_has_a_place() {
    let place = |text: &str| {
        let refused = read(text).unwrap_err();
        (refused.line, refused.column)
    };
    assert_eq!(
        place("def f(t, x):\n    é = 1; return x[0] << 2\n"),
        (2, 19)
    );
    assert_eq!(place("def f(t, x):\n    with x:\n        pass\n"), (2, 5));
    assert_eq!(place("def f(t, x, *rest):\n    return x\n"), (1, 13));
    assert_eq!(place(""), (1, 1));
}

const WHOLE: &str = "\
import numpy as np
import filippov as fl

A = np.array([[0, 1], [-2, 0]])
LEVELS = [1.0, 2.0, 4.0]


def law(s, k=2.0):
    return k * np.sign(s) if s > 0 else -k


@fl.system(states=('y', 'v'), resets=fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.8 * x[1]]))
def rhs(t, x, a=0.4):
    q, *rest = [*x[:1], *(c * e for c, e in zip(LEVELS, x))]
    force = np.floor(3 * x[1]) + np.interp(t, [0, 1, 2], LEVELS) - fl.hysteresis(q, -a, a)
    return A @ x - np.array([0.0, 1.0]) * (force + law(x[1]) + sum(rest))
";

#[test]
fn a_text_may_have_helpers_arrays_laws_and_resets() {
    let model = read(WHOLE).unwrap();
    assert_eq!(model.name, "rhs");
    assert_eq!(model.system.definition.names.states, ["y", "v"]);
    assert_eq!(model.system.actions.len(), 1);
    assert!(model.system.definition.rules.laws.len() >= 3);
}

#[test]
fn any_text_is_read_or_refused() {
    for cut in (0..WHOLE.len()).filter(|&cut| WHOLE.is_char_boundary(cut)) {
        let _ = read(&WHOLE[..cut]);
        if let Ok(model) = read(&format!("{}[{}", &WHOLE[..cut], &WHOLE[cut..])) {
            assert!(model.system.check().is_ok());
        }
    }
    for cut in (0..OSCILLATOR.len()).filter(|&cut| OSCILLATOR.is_char_boundary(cut)) {
        let _ = read(&OSCILLATOR[..cut]);
        let changed = format!("{}({}", &OSCILLATOR[..cut], &OSCILLATOR[cut..]);
        if let Ok(model) = read(&changed) {
            assert!(model.system.check().is_ok());
        }
    }
}
