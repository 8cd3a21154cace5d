//! The equations of an itinerary: a relay in closed form, and what does not fit it.

use filippov::action::Actions;
use filippov::derivative::Extension;
use filippov::motion::Guard;
use filippov::{
    equations, Equations, ItineraryLeg, LegEnd, LegError, Mode, Options, Rules, TracedSystem,
    Unknowns,
};
use filippov_expr::{Backend, Graph, Names};

/// x' = v, v' = -a sign(x): from x = 0 with v = w it comes back after 2 w / a with v = -w.
fn relay(a: f64) -> TracedSystem {
    let mut graph = Graph::new();
    let (x, v, a_node) = (graph.state(0), graph.state(1), graph.parameter(0));
    let sign = graph.sign(x);
    let pull = graph.mul(a_node, sign);
    let field = vec![v, graph.neg(pull)];
    let names = Names {
        states: Vec::new(),
        parameters: vec!["a".into()],
    };
    TracedSystem::new(graph, field, vec![a], names, Backend::Interpreter)
        .expect("the graph is complete")
}

fn leg(side: i8) -> ItineraryLeg {
    ItineraryLeg {
        mode: Mode::new(vec![side]),
        q: Vec::new(),
        end: LegEnd::Guard(Guard::Surface(0)),
        acts: Vec::new(),
    }
}

fn found(legs: &[ItineraryLeg], starts: &[f64], durations: &[f64]) -> Result<Equations, LegError> {
    let (system, none) = (relay(2.0), Actions::none());
    let extension =
        Extension::new(&system, &Rules::default(), &[0]).expect("the graph has derivatives");
    let extended = extension.at(system.parameters(), &none);
    let extended = extended.expect("it compiles").expect("no map is called");
    let at = Unknowns {
        starts,
        durations,
        t0: 0.0,
        is_free_in_time: false,
        places: 4,
    };
    let of = (&system, &extended, &none);
    equations(of, &Options::default(), legs, at, &mut |_| false)
}

#[test]
fn the_legs_of_a_relay_close() {
    let found = found(&[leg(1), leg(-1)], &[0.0, 3.0, 0.0, -3.0], &[3.0, 3.0]);
    let found = found.expect("the legs can be followed");
    assert!(found.residual.iter().all(|entry| entry.abs() < 1e-12));
    // Behind the switch. The period is 4 w / a: a start that is slower by d comes back 2 d earlier, and is at x = 6 d then, slower
    // by 5 d. Areas are kept, and every orbit is closed.
    let exact = [-3.0, -6.0, 8.0 / 3.0, 5.0];
    for (entry, exact) in found.monodromy.iter().zip(exact) {
        assert!((entry - exact).abs() < 1e-12, "{:?}", found.monodromy);
    }
    // Of the state behind the first leg, by its start, the durations and a: x + v T - a T^2 / 2 and v - a T.
    let width = 6 + 1;
    let row = |r: usize| &found.jacobian[r * width..][..width];
    let all = [
        [1.0, 3.0, -1.0, 0.0, -3.0, 0.0, -4.5],
        [0.0, 1.0, 0.0, -1.0, -2.0, 0.0, -3.0],
        [1.0, 3.0, 0.0, 0.0, -3.0, 0.0, -4.5],
    ];
    for (r, exact) in all.iter().enumerate() {
        for (entry, exact) in row(r).iter().zip(exact) {
            assert!((entry - exact).abs() < 1e-11, "row {r}: {:?}", row(r));
        }
    }
    // Each side of a leg knows the rates of the guard: -w before the end, and w behind it.
    let [before, behind] = found.passages[0]
        .sides
        .as_ref()
        .expect("they are asked for");
    assert!((before.1[0] + 3.0).abs() < 1e-12 && (behind.1[0] - 3.0).abs() < 1e-12);
}

#[test]
fn what_does_not_fit_is_refused() {
    let fits = ([leg(1), leg(-1)], [0.0, 3.0, 0.0, -3.0], [3.0, 3.0]);
    let mut other = leg(1);
    other.mode = Mode::new(vec![1, 1]);
    let mut acting = leg(1);
    acting.acts = vec![0];
    let mut sliding = leg(1);
    sliding.end = LegEnd::Guard(Guard::Force(0));
    let refused = [
        found(&[], &[], &[]),
        found(&fits.0, &fits.1, &fits.2[..1]),
        found(&fits.0, &fits.1[..3], &fits.2),
        found(&[other, leg(-1)], &fits.1, &fits.2),
        found(&[acting, leg(-1)], &fits.1, &fits.2),
    ];
    for found in refused {
        assert!(matches!(found, Err(LegError::Argument(_))), "{found:?}");
    }
    let found = found(&[sliding, leg(-1)], &fits.1, &fits.2);
    assert!(matches!(found, Err(LegError::NoGuard)));
}
