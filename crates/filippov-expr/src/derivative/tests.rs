#![allow(clippy::unwrap_used)]

use super::*;
use crate::print::Names;

#[test]
fn derivatives_are_readable() {
    let mut g = Graph::new();
    let names = Names {
        states: vec!["x".into(), "v".into()],
        parameters: vec!["w".into()],
    };
    let (t, x, v, w) = (g.time(), g.state(0), g.state(1), g.parameter(0));
    let phase = g.mul(w, t);
    let sine = g.unary(UnaryOp::Sin, phase);
    let rate = g.sub(sine, x);
    let derivative = g.directional(rate, &[v, rate]);
    assert_eq!(g.text(derivative, &names), "w*cos(t*w) - v");
    let gradient = g.gradient(rate);
    let minus_one = g.constant(-1.0);
    assert_eq!(gradient.states, [(0, minus_one)]);
    assert_eq!(g.text(gradient.time, &names), "w*cos(t*w)");
}

#[test]
fn states_without_a_rate_are_constant() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(5));
    let sum = g.add(x, y);
    let two = g.constant(2.0);
    assert_eq!(g.directional(sum, &[two]), two);
    // another field is not answered from the memory of the last
    let three = g.constant(3.0);
    assert_eq!(g.directional(sum, &[three]), three);
}

#[test]
fn signs_are_data() {
    let mut g = Graph::new();
    let x = g.state(0);
    let abs = g.abs(x);
    let sign = g.sign(x);
    assert_eq!(g.partial(abs, Wrt::State(0)), sign);
    assert_eq!(g.gradient(abs).states, [(0, sign)]);
    assert!(g.gradient(sign).states.is_empty());
}

/// The gradient of a sum of n states costs O(n), not O(n^2).
#[test]
fn gradients_of_long_sums_are_cheap() {
    let mut g = Graph::new();
    let mut sum = g.constant(0.0);
    for i in 0..10_000 {
        let x = g.state(i);
        let square = g.mul(x, x);
        sum = g.add(sum, square);
    }
    let size = g.len();
    assert_eq!(g.gradient(sum).states.len(), 10_000);
    assert!(g.len() < 2 * size);
}

#[test]
fn constant_gradients_are_the_gradients() {
    let mut g = Graph::new();
    let (t, x, y, w) = (g.time(), g.state(0), g.state(3), g.parameter(0));
    let sign = g.sign(x);
    let three = g.constant(3.0);
    let scaled = g.mul(three, y);
    let sum = g.add(scaled, t);
    let sum = g.add(sum, sign);
    let sum = g.sub(sum, w);
    let sum = g.sub(sum, x);
    let by_numbers = g.constant_gradient(sum).unwrap();
    let Gradient { time, states } = g.gradient(sum);
    let number = |id| g.as_constant(id).unwrap();
    let states: Vec<_> = states.iter().map(|&(i, id)| (i, number(id))).collect();
    assert_eq!(by_numbers, (number(time), states));
    // A parameter is no number, and neither is a state.
    for slope in [w, x] {
        let product = g.mul(slope, y);
        assert_eq!(g.constant_gradient(product), None);
    }
}
