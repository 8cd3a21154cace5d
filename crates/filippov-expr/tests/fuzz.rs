//! Many random graphs: native code, interpreter, and what comes back from bytes give the same bits. Run by `make fuzz`;
//! `EXPR_TEST_FACTOR` is how many times more to try.
#![cfg(feature = "native")]
#![allow(clippy::unwrap_used)]

mod support;

use filippov_expr::{Backend, Graph, NodeId, Program};
use proptest::prelude::*;
use support::{build, points, recipes, Point};

fn values(graph: &Graph, nodes: &[NodeId], backend: Backend, point: &Point) -> Vec<u64> {
    let program = Program::compile(graph, nodes, backend).unwrap();
    let mut out = vec![0.0; nodes.len()];
    let signs = point.signs(graph.n_surfaces().max(1));
    program.eval(point.t, &point.x, &signs, &point.p, &[0.25], &mut out);
    // The payload of a NaN depends on the order of operands, which compilers may choose.
    let bits = |v: f64| if v.is_nan() { f64::NAN } else { v }.to_bits();
    out.into_iter().map(bits).collect()
}

proptest! {
    #![proptest_config(support::config(20_000))]

    #[test]
    #[ignore = "minutes; make fuzz runs it"]
    fn native_code_interpreter_and_bytes_agree(recipe in recipes(60), point in points()) {
        let (mut graph, nodes) = build(&recipe);
        let last = *nodes.last().unwrap();
        // Derivatives are graphs too, and the largest.
        let mut outputs = nodes.clone();
        let gradient = graph.gradient(last);
        outputs.push(gradient.time);
        outputs.extend(gradient.states.iter().map(|state| state.1));
        let native = values(&graph, &outputs, Backend::Native, &point);
        let interpreted = values(&graph, &outputs, Backend::Interpreter, &point);
        prop_assert_eq!(&native, &interpreted);
        let copy = Graph::from_bytes(&graph.to_bytes()).unwrap();
        prop_assert_eq!(&values(&copy, &outputs, Backend::Native, &point), &native);
    }
}
