//! The decision at one surface, one row of `switching_rows` per textbook case (`docs/theory/switching.md`, section 3.1).
//!
//! On h = x0 the fields are f- = a(t) and f+ = b(t) with Taylor coefficients a = [A1, B1, C1, ...] and
//! b = [A2, B2, C2, ...], so that the derivatives of h along them are these numbers.
#![allow(clippy::unwrap_used)]

mod switching_rows;

use filippov::switching::{decide, Arrival, Decision};
use filippov::{ClosureSystem, PiecewiseSystem, Place, TracedSystem};
use filippov_expr::{Backend, Graph, Names, NodeId};

use switching_rows::{rows, Row, FIRST_ORDER, RESTING, TANGENCIES};
use Arrival::{ExitMinus, ExitPlus, Region, Start, TwoFold};

fn polynomial(derivatives: &[f64], t: f64) -> f64 {
    let mut term = 1.0;
    let mut sum = 0.0;
    for (k, derivative) in derivatives.iter().enumerate() {
        sum += derivative * term;
        term *= t / (k + 1) as f64;
    }
    sum
}

fn polynomial_node(g: &mut Graph, derivatives: &[f64]) -> NodeId {
    let t = g.time();
    let mut term = g.constant(1.0);
    let mut sum = g.constant(0.0);
    for (k, &derivative) in derivatives.iter().enumerate() {
        let factor = g.constant(derivative);
        let part = g.mul(factor, term);
        sum = g.add(sum, part);
        let step = g.constant(1.0 / (k + 1) as f64);
        let scaled = g.mul(t, step);
        term = g.mul(term, scaled);
    }
    sum
}

fn traced(minus: &[f64], plus: &[f64]) -> TracedSystem {
    let mut g = Graph::new();
    let x = g.state(0);
    let s = g.sign(x);
    let (a, b) = (
        polynomial_node(&mut g, minus),
        polynomial_node(&mut g, plus),
    );
    let half = g.constant(0.5);
    let (sum, difference) = (g.add(a, b), g.sub(b, a));
    let (mean, jump) = (g.mul(half, sum), g.mul(half, difference));
    let signed = g.mul(s, jump);
    let rate = g.add(mean, signed);
    TracedSystem::new(g, vec![rate], vec![], Names::default(), Backend::Auto).unwrap()
}

fn with_closures<T>(minus: &[f64], plus: &[f64], use_it: impl Fn(&dyn PiecewiseSystem) -> T) -> T {
    let system = ClosureSystem::new(
        1,
        1,
        |t, _x, s, dx| dx[0] = polynomial(if s[0] > 0.0 { plus } else { minus }, t),
        |_t, x, h| h[0] = x[0],
    );
    use_it(&system)
}

fn decide_at_origin(system: &dyn PiecewiseSystem, arrival: Arrival) -> Decision {
    decide(system, 0, arrival, &Place::new(0.0, &[0.0], &[1.0])).unwrap()
}

fn check((label, minus, plus, arrival, entry, candidates): &Row, system: &dyn PiecewiseSystem) {
    let decision = decide_at_origin(system, *arrival);
    assert_eq!(
        decision.entry, *entry,
        "{label}: {decision:?} for f- {minus:?}, f+ {plus:?}"
    );
    assert_eq!(
        decision.candidates[..],
        **candidates,
        "{label}: {decision:?}"
    );
}

/// The same case seen from the other side: h -> -h, fields and regions exchanged.
fn mirrored(row: &Row) -> (Vec<f64>, Vec<f64>, Arrival, i8, Vec<i8>) {
    let (_, minus, plus, arrival, entry, candidates) = row;
    let turned = |values: &[f64]| values.iter().map(|v| -v).collect();
    let arrival = match arrival {
        Region(side) => Region(-side),
        ExitMinus => ExitPlus,
        ExitPlus => ExitMinus,
        Start => Start,
        TwoFold => TwoFold,
        Arrival::Flat(side, [minus, plus]) => Arrival::Flat(-side, [*plus, *minus]),
    };
    (
        turned(plus),
        turned(minus),
        arrival,
        -entry,
        candidates.iter().rev().map(|k| -k).collect(),
    )
}

#[test]
fn traced_systems_decide_every_row() {
    for row in rows() {
        check(row, &traced(row.1, row.2));
    }
}

#[test]
fn mirror_images_are_decided_alike() {
    for row in rows() {
        let (minus, plus, arrival, entry, candidates) = mirrored(row);
        let decision = decide_at_origin(&traced(&minus, &plus), arrival);
        assert_eq!(
            (decision.entry, decision.candidates.to_vec()),
            (entry, candidates),
            "mirror of {}",
            row.0
        );
    }
}

#[test]
fn scaled_fields_are_decided_alike() {
    for row in rows() {
        for scale in [1e-6, 1e6] {
            let scaled = |values: &[f64]| values.iter().map(|v| scale * v).collect::<Vec<_>>();
            let decision = decide_at_origin(&traced(&scaled(row.1), &scaled(row.2)), row.3);
            assert_eq!(
                (decision.entry, decision.candidates.as_slice()),
                (row.4, row.5),
                "{scale} x {}",
                row.0
            );
        }
    }
}

#[test]
fn closures_decide_up_to_second_derivatives() {
    // Their derivatives are differences: orders above 2 are beyond them.
    for row in FIRST_ORDER.iter().chain(TANGENCIES).chain(RESTING) {
        with_closures(row.1, row.2, |system| check(row, system));
    }
}

#[test]
fn leading_derivatives_are_those_of_the_row() {
    let decision = decide_at_origin(&traced(&[0.0, 0.0, 3.0], &[-2.0]), Region(-1));
    assert_eq!((decision.minus.order, decision.minus.value), (3, 3.0));
    assert_eq!((decision.plus.order, decision.plus.value), (1, -2.0));
    assert!((decision.minus.coefficient() - 0.5).abs() < 1e-15);
}

#[test]
fn small_but_genuine_values_are_no_tangency() {
    for value in [1e-6, 1e-9] {
        let decision = decide_at_origin(&traced(&[1.0], &[-value]), Region(-1));
        assert_eq!(decision.entry, 0, "f+ = -{value}");
        let decision = decide_at_origin(&traced(&[1.0], &[value]), Region(-1));
        assert_eq!(decision.entry, 1, "f+ = {value}");
    }
}

#[test]
fn derivatives_known_to_vanish_are_rounding_and_not_looked_at() {
    // Near a triple zero: what is left of the first two points back.
    let system = traced(&[-1e-16, -1e-15, 3.0], &[-1e-16, -1e-15, 2.0]);
    let decision = decide_at_origin(&system, Region(-1));
    assert_eq!((decision.entry, decision.minus.order), (-1, 1));
    let decision = decide_at_origin(&system, Arrival::Flat(-1, [2, 2]));
    assert_eq!(
        (decision.entry, decision.candidates.as_slice()),
        (1, &[1][..])
    );
    assert_eq!((decision.minus.order, decision.plus.order), (3, 3));
    // What is known of one side says nothing of the other.
    let system = traced(&[-1e-16, -1e-15, 3.0], &[-2.0]);
    assert_eq!(
        decide_at_origin(&system, Arrival::Flat(-1, [2, 0])).entry,
        0
    );
}

#[test]
fn a_field_that_agrees_with_its_neighbour_needs_no_decision() {
    let decision = decide_at_origin(&traced(&[0.0], &[0.0]), Region(-1));
    assert_eq!(decision.candidates.len(), 1);
    assert_eq!((decision.minus.order, decision.plus.order), (0, 0));
}
