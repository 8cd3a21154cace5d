//! The decision table of one surface: a row per textbook case and per border between cases.

use filippov_expr::{Backend, Graph, Names, NodeId};

use super::{decide, Arrival, Kind};
use crate::{Mode, TracedSystem};

/// Normal component a + b y + c y^2 / 2 with y' = 1: its derivatives along the motion are a, b, c.
type Component = [f64; 3];

fn component(g: &mut Graph, [a, b, c]: Component, y: NodeId) -> NodeId {
    let (a, b, c) = (g.constant(a), g.constant(b), g.constant(0.5 * c));
    let square = g.mul(y, y);
    let (linear, quadratic) = (g.mul(b, y), g.mul(c, square));
    let sum = g.add(a, linear);
    g.add(sum, quadratic)
}

/// x' = f-+ on the sides of x = 0, y' = 1.
fn system(minus: Component, plus: Component) -> TracedSystem {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let surface = g.declare_surface(x);
    let (f_minus, f_plus) = (component(&mut g, minus, y), component(&mut g, plus, y));
    let dx = g.select(surface, 1.0, f_plus, f_minus);
    let dy = g.constant(1.0);
    TracedSystem::new(
        g,
        vec![dx, dy],
        vec![],
        Names::default(),
        Backend::Interpreter,
    )
    .unwrap()
}

const FROM_MINUS: Arrival = Arrival::Region(-1);
const FROM_PLUS: Arrival = Arrival::Region(1);

#[test]
fn the_table_of_one_surface() {
    // (case, f-, f+, arrival, entry after, candidates)
    let rows: &[(&str, Component, Component, Arrival, i8, &[i8])] = &[
        (
            "I cross up",
            [1.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            FROM_MINUS,
            1,
            &[1],
        ),
        (
            "I cross down",
            [-1.0, 0.0, 0.0],
            [-2.0, 0.0, 0.0],
            FROM_PLUS,
            -1,
            &[-1],
        ),
        (
            "I slide",
            [1.0, 0.0, 0.0],
            [-2.0, 0.0, 0.0],
            FROM_MINUS,
            0,
            &[0],
        ),
        (
            "I slide",
            [1.0, 0.0, 0.0],
            [-2.0, 0.0, 0.0],
            FROM_PLUS,
            0,
            &[0],
        ),
        (
            "I repulsive",
            [-1.0, 0.0, 0.0],
            [3.0, 0.0, 0.0],
            Arrival::Start,
            1,
            &[-1, 1],
        ),
        (
            "I repulsive",
            [-3.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            Arrival::Start,
            -1,
            &[-1, 1],
        ),
        (
            "II exit",
            [0.0, -1.0, 0.0],
            [-1.0, 0.0, 0.0],
            Arrival::ExitMinus,
            -1,
            &[-1],
        ),
        (
            "II touch",
            [0.0, 0.0, 1.0],
            [-1.0, 0.0, 0.0],
            Arrival::ExitMinus,
            0,
            &[0],
        ),
        (
            "II exit of third order",
            [0.0, 0.0, -1.0],
            [-1.0, 0.0, 0.0],
            Arrival::ExitMinus,
            -1,
            &[-1],
        ),
        (
            "II graze",
            [0.0, -1.0, 0.0],
            [-1.0, 0.0, 0.0],
            FROM_MINUS,
            -1,
            &[-1],
        ),
        (
            "II graze beside repulsion",
            [0.0, -1.0, 0.0],
            [1.0, 0.0, 0.0],
            FROM_MINUS,
            -1,
            &[-1, 1],
        ),
        (
            "II inflection, cross",
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0],
            FROM_MINUS,
            1,
            &[1],
        ),
        (
            "II inflection, slide",
            [0.0, 0.0, 1.0],
            [-1.0, 0.0, 0.0],
            FROM_MINUS,
            0,
            &[0],
        ),
        (
            "II from +, cross",
            [0.0, -1.0, 0.0],
            [-1.0, 0.0, 0.0],
            FROM_PLUS,
            -1,
            &[-1],
        ),
        (
            "II from +, slide",
            [0.0, 1.0, 0.0],
            [-1.0, 0.0, 0.0],
            FROM_PLUS,
            0,
            &[0],
        ),
        (
            "III exit",
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            Arrival::ExitPlus,
            1,
            &[1],
        ),
        (
            "III touch",
            [1.0, 0.0, 0.0],
            [0.0, 0.0, -1.0],
            Arrival::ExitPlus,
            0,
            &[0],
        ),
        (
            "III graze",
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            FROM_PLUS,
            1,
            &[1],
        ),
        (
            "III from -, cross",
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            FROM_MINUS,
            1,
            &[1],
        ),
        (
            "III from -, slide",
            [1.0, 0.0, 0.0],
            [0.0, -1.0, 0.0],
            FROM_MINUS,
            0,
            &[0],
        ),
        (
            "IV both turn in",
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            FROM_MINUS,
            0,
            &[0],
        ),
        (
            "IV both turn up",
            [0.0, 1.0, 0.0],
            [0.0, 2.0, 0.0],
            FROM_MINUS,
            1,
            &[1],
        ),
        (
            "IV both turn out",
            [0.0, -1.0, 0.0],
            [0.0, 1.0, 0.0],
            FROM_MINUS,
            -1,
            &[-1, 1],
        ),
        (
            "IV both turn out",
            [0.0, -1.0, 0.0],
            [0.0, 1.0, 0.0],
            FROM_PLUS,
            1,
            &[-1, 1],
        ),
        (
            "neither leaves, same field",
            [0.0; 3],
            [0.0; 3],
            FROM_MINUS,
            -1,
            &[-1],
        ),
    ];
    for (case, minus, plus, arrival, entry, candidates) in rows {
        let system = system(*minus, *plus);
        let decision = decide(&system, 0, *arrival, 0.0, &[0.0, 0.0], &[1.0]).unwrap();
        assert_eq!(decision.entry, *entry, "{case}, {arrival:?}");
        assert_eq!(decision.candidates, *candidates, "{case}, {arrival:?}");
    }
}

#[test]
fn the_table_does_not_depend_on_the_sign_of_h() {
    let values: [Component; 6] = [
        [1.0, 0.0, 0.0],
        [-2.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -3.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ];
    for minus in values {
        for plus in values {
            for side in [-1, 1] {
                let here = system(minus, plus);
                let there = system(plus.map(|v| -v), minus.map(|v| -v));
                let at = |s: &TracedSystem, side: i8| {
                    decide(s, 0, Arrival::Region(side), 0.0, &[0.0, 0.0], &[1.0]).unwrap()
                };
                assert_eq!(
                    at(&here, side).entry,
                    -at(&there, -side).entry,
                    "{minus:?} {plus:?}"
                );
            }
        }
    }
}

#[test]
fn kinds_follow_the_codimension() {
    let mode = |entries: &[i8]| Mode::new(entries.to_vec());
    let kind = |a: &[i8], b: &[i8]| Kind::between(&mode(a), &mode(b));
    assert_eq!(kind(&[-1], &[1]), Kind::Crossing);
    assert_eq!(kind(&[-1], &[0]), Kind::EnterSliding);
    assert_eq!(kind(&[0], &[1]), Kind::ExitSliding);
    assert_eq!(kind(&[0, -1], &[0, 1]), Kind::Crossing);
    assert_eq!(kind(&[0, -1], &[1, 0]), Kind::SwitchSliding);
    assert_eq!(kind(&[1, -1], &[1, -1]), Kind::Grazing);
}
