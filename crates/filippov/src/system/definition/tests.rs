#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use super::{Definition, Rules};
use crate::{Error, Law, Step};
use filippov_expr::{Backend, Graph, Names, NodeId};

/// x' = -sign(x) + p + q with a discrete state q; node 1 is the time.
fn relay() -> Definition {
    let mut graph = Graph::new();
    let (x, t) = (graph.state(0), graph.time());
    let (p, q) = (graph.parameter(0), graph.parameter(1));
    let sign = graph.sign(x);
    let inputs = graph.add(p, q);
    let field = vec![graph.sub(inputs, sign)];
    let names = Names {
        states: vec!["x".into()],
        parameters: vec!["p".into(), "floor(t)".into()],
    };
    let rules = Rules {
        watched: vec![0],
        laws: vec![Law::Clock { argument: t }],
        ..Rules::default()
    };
    Definition {
        graph,
        field,
        names,
        rules,
    }
}

fn text(change: impl FnOnce(&mut Definition)) -> String {
    let mut definition = relay();
    change(&mut definition);
    definition.check().unwrap_err().to_string()
}

#[test]
fn what_is_wrong_is_named() {
    relay().check().unwrap();
    let cases = [
        (
            text(|d| d.field.clear()),
            "the system is inconsistent: a system needs a state",
        ),
        (
            text(|d| d.field[0] = NodeId(99)),
            "node 99 does not exist: the system has 7",
        ),
        (
            text(|d| d.graph = d.graph.clone().tap(|g| g.state(3))),
            "state 3 does not exist: the system has 1",
        ),
        (
            text(|d| d.graph = d.graph.clone().tap(|g| g.sign_of(1))),
            "surface 1 does not exist: the system has 1",
        ),
        (
            text(|d| d.graph = d.graph.clone().tap(|g| g.input(0))),
            "input of the field 0 does not exist: the system has 0",
        ),
        (
            text(|d| d.names.parameters.truncate(1)),
            "parameter 1 does not exist: the system has 1",
        ),
        (
            text(|d| d.names.states.push("y".into())),
            "the system is inconsistent: the number of names is not that of the states",
        ),
        (
            text(|d| d.rules.watched.push(1)),
            "surface 1 does not exist: the system has 1",
        ),
        (
            text(|d| d.rules.n_hidden = 2),
            "the system is inconsistent: more laws than there are names or surfaces",
        ),
        (
            text(|d| d.rules.sticking = vec![(0, d.field[0]); 2]),
            "the system is inconsistent: two ratios of static to kinetic friction on one surface",
        ),
    ];
    for (found, expected) in cases {
        assert_eq!(found, expected);
    }
}

#[test]
fn laws_are_what_they_say() {
    let clock = text(|d| {
        d.rules.laws[0] = Law::Clock {
            argument: NodeId(0),
        }
    });
    assert!(clock.contains("not affine in t alone"), "{clock}");
    let held = text(|d| {
        d.rules.laws[0] = Law::Held {
            argument: NodeId(0),
            step: Step::Floor,
        }
    });
    assert!(held.contains("changes along a motion"), "{held}");
    let own = text(|d| {
        d.rules.laws[0] = Law::Held {
            argument: NodeId(3),
            step: Step::Floor,
        }
    });
    assert!(own.contains("reads its own discrete state"), "{own}");
    let hysteresis = |initial: f64, guard: usize| {
        text(|d| {
            d.rules.laws[0] = Law::Hysteresis {
                argument: NodeId(0),
                thresholds: [NodeId(1); 2],
                initial,
                guard,
            };
        })
    };
    assert_eq!(
        hysteresis(1.0, 5),
        "surface 5 does not exist: the system has 1"
    );
    assert_eq!(hysteresis(0.5, 0), "initial = 0.5: must be +1 or -1");
}

#[test]
fn laws_that_nothing_reads_are_not_followed() {
    let n_followed = |definition: Definition| {
        let (_, laws) = definition.build(Backend::Interpreter).unwrap();
        Arc::new(laws).actions(1, &[0.0]).len()
    };
    assert_eq!(n_followed(relay()), 1);
    let mut unread = relay();
    let p = unread.graph.parameter(0);
    unread.field = vec![p];
    assert_eq!(n_followed(unread.clone()), 0);
    // An event reads it: it is followed, and is no switch.
    unread.rules.beside = vec![0];
    let (_, laws) = unread.clone().build(Backend::Interpreter).unwrap();
    let actions = Arc::new(laws).actions(1, &[0.0]);
    assert!(matches!(&actions[..], [action] if action.kind.is_none()));
    unread.rules.beside = vec![1];
    assert!(unread.check().is_err());
}

#[test]
fn bytes_are_checked() {
    let bytes = relay().to_bytes();
    let copy = Definition::from_bytes(&bytes).unwrap();
    assert_eq!(copy.to_bytes(), bytes);
    assert_eq!(copy.names.parameters, ["p", "floor(t)"]);
    assert_eq!(copy.rules, relay().rules);
    let mut wrong = relay();
    wrong.rules.watched.push(7);
    assert!(matches!(
        Definition::from_bytes(&wrong.to_bytes()),
        Err(Error::NoSuchIndex { index: 7, .. })
    ));
    let graph = relay().graph.to_bytes();
    let refused = Definition::from_bytes(&graph).unwrap_err();
    assert_eq!(refused.to_string(), "holds GRPH, EXPR is needed");
}

trait Tap {
    fn tap<R>(self, change: impl FnOnce(&mut Self) -> R) -> Self;
}

impl Tap for Graph {
    fn tap<R>(mut self, change: impl FnOnce(&mut Self) -> R) -> Self {
        change(&mut self);
        self
    }
}
