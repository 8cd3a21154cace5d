#![allow(clippy::unwrap_used)]

use super::*;

fn programs(g: &Graph, outputs: &[NodeId]) -> Vec<Program> {
    [Backend::Auto, Backend::Interpreter]
        .map(|backend| Program::compile(g, outputs, backend).unwrap())
        .into()
}

#[test]
fn arguments_are_read_from_their_places() {
    let mut g = Graph::new();
    let outputs = [
        g.time(),
        g.state(1),
        g.sign_of(0),
        g.parameter(2),
        g.input(1),
        g.constant(7.0),
    ];
    for program in programs(&g, &outputs) {
        let mut out = [0.0; 7];
        out[6] = 5.0;
        program.eval(
            1.0,
            &[0.0, 2.0],
            &[-1.0],
            &[0.0, 0.0, 3.0],
            &[0.0, 4.0],
            &mut out,
        );
        assert_eq!(out, [1.0, 2.0, -1.0, 3.0, 4.0, 7.0, 5.0]);
        assert_eq!(
            program.lengths(),
            Lengths {
                states: 2,
                signs: 1,
                parameters: 3,
                inputs: 2
            }
        );
        assert_eq!(program.n_outputs(), 6);
    }
}

#[test]
fn an_output_may_occur_twice() {
    let mut g = Graph::new();
    let x = g.state(0);
    let minus = g.neg(x);
    for program in programs(&g, &[minus, x, minus, x]) {
        let mut out = [0.0; 4];
        program.eval(0.0, &[2.0], &[], &[], &[], &mut out);
        assert_eq!(out, [-2.0, 2.0, -2.0, 2.0]);
    }
}

/// Of each argument one entry too few, in turn: the output is NaN, and with debug assertions a panic.
#[test]
fn short_arguments_give_nan() {
    let mut g = Graph::new();
    let outputs = [g.state(1), g.sign_of(1), g.parameter(1), g.input(1)];
    for program in programs(&g, &outputs) {
        for short in 0..5 {
            let length = |argument: usize| if argument == short { 1 } else { 2 };
            let eval = || {
                let mut out = [0.0; 4];
                let n_out = if short == 4 { 3 } else { 4 };
                let ones = [1.0; 2];
                let [x, s, p, v] = [0, 1, 2, 3].map(|argument| &ones[..length(argument)]);
                program.eval(0.0, x, s, p, v, &mut out[..n_out]);
                out
            };
            let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(eval));
            assert_eq!(result.is_err(), cfg!(debug_assertions));
            if let Ok(out) = result {
                assert!(out[..3].iter().all(|value| value.is_nan()));
            }
        }
    }
}

#[test]
fn the_branch_not_taken_does_not_leak() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let log = g.unary(crate::UnaryOp::Log, x);
    let choice = g.select(0, 1.0, log, y);
    for program in programs(&g, &[choice]) {
        let mut out = [0.0];
        program.eval(0.0, &[-1.0, 4.0], &[-1.0], &[], &[], &mut out);
        assert_eq!(out, [4.0]);
    }
}
