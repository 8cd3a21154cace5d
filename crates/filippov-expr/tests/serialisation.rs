//! Graphs survive the way through bytes, and no bytes make the reader or what follows panic.
#![allow(clippy::unwrap_used)]

mod support;

use filippov_expr::container::{resealed, sections_of};
use filippov_expr::{
    Backend, BinaryOp, ExprError, Graph, Names, Node, NodeId, Program, Switching, UnaryOp, Wrt,
};
use proptest::prelude::*;
use support::{build, recipes};

/// Uses everything that a graph offers.
fn exercise(mut g: Graph) {
    let Some(last) = g.len().checked_sub(1) else {
        return;
    };
    let last = NodeId(last as u32);
    let text = g.text(last, &Names::default());
    assert!(text.len() < 10_000);
    if let Ok(program) = Program::compile(&g, &[last], Backend::Auto) {
        let lengths = program.lengths();
        if lengths
            .states
            .max(lengths.signs)
            .max(lengths.parameters)
            .max(lengths.inputs)
            < 1000
        {
            let zeros = vec![0.5; 1000];
            program.eval(0.0, &zeros, &zeros, &zeros, &zeros, &mut [0.0]);
        }
    }
    g.gradient(last);
    g.partial(last, Wrt::State(0));
    g.directional(last, &[last]);
    g.at_signs(&[last], &[Some(1.0), None, Some(-1.0)]);
    g.sign_dependencies(&[last], &[1.0]);
    g.switch(last);
    g.abs(last);
    for j in 0..g.n_surfaces() as u32 {
        g.text(g.surface(j), &Names::default());
    }
}

proptest! {
    #![proptest_config(support::config(400))]

    #[test]
    fn round_trip(recipe in recipes(60)) {
        let (mut g, nodes) = build(&recipe);
        let bytes = g.to_bytes();
        let mut copy = Graph::from_bytes(&bytes).unwrap();
        prop_assert_eq!(copy.to_bytes(), bytes);
        prop_assert_eq!(copy.n_surfaces(), g.n_surfaces());
        for k in 0..g.len() as u32 {
            prop_assert_eq!(copy.node(NodeId(k)), g.node(NodeId(k)));
        }
        // What is built and recognised afterwards is the same, too.
        for &node in &nodes {
            prop_assert_eq!(copy.switch(node), g.switch(node));
            prop_assert_eq!(copy.abs(node), g.abs(node));
            prop_assert_eq!(copy.partial(node, Wrt::State(0)), g.partial(node, Wrt::State(0)));
            prop_assert_eq!(copy.is_affine(node), g.is_affine(node));
        }
    }

    #[test]
    fn garbage_does_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(Graph::from_bytes(&bytes).is_err());
        let mut with_header = Graph::new().to_bytes();
        let header = with_header.len() - 4 * 5;
        with_header.splice(header..header + 16, bytes);
        let place = sections_of(&with_header)[0].start + 4;
        let length = (with_header.len() - place - 12) as u64;
        with_header[place..place + 8].copy_from_slice(&length.to_le_bytes());
        if let Ok(graph) = Graph::from_bytes(&resealed(&with_header).unwrap()) {
            exercise(graph);
        }
    }

    #[test]
    fn damaged_graphs_do_not_panic(
        recipe in recipes(30),
        changes in prop::collection::vec((any::<u16>(), any::<u8>()), 1..4),
        cut in any::<u16>(),
    ) {
        let mut bytes = build(&recipe).0.to_bytes();
        let cut = usize::from(cut) % bytes.len();
        prop_assert!(Graph::from_bytes(&bytes[..cut]).is_err());
        for (place, value) in changes {
            let place = usize::from(place) % bytes.len();
            bytes[place] = value % 8;
        }
        if let Ok(graph) = Graph::from_bytes(&resealed(&bytes).unwrap()) {
            exercise(graph);
        }
    }
}

#[test]
fn surfaces_are_remembered() {
    let mut g = Graph::new();
    let v = g.state(1);
    let belt = g.constant(0.2);
    let slip = g.sub(belt, v);
    g.sign(slip);
    let mut copy = Graph::from_bytes(&g.to_bytes()).unwrap();
    let other = copy.sub(v, belt);
    assert_eq!(
        copy.switch(other),
        Switching::Surface {
            index: 0,
            orientation: 1.0
        }
    );
    assert_eq!(copy.n_surfaces(), 1);
}

#[test]
fn other_versions_are_refused() {
    let mut bytes = Graph::new().to_bytes();
    bytes[8] += 1;
    assert_eq!(
        Graph::from_bytes(&bytes).unwrap_err(),
        ExprError::OtherVersion { found: 2 }
    );
    assert_eq!(
        Graph::from_bytes(b"FILEXPR\x02").unwrap_err(),
        ExprError::UnknownFormat
    );
    assert_eq!(
        Graph::from_bytes(b"").unwrap_err(),
        ExprError::UnknownFormat
    );
}

#[test]
fn excess_bytes_and_repeated_nodes_are_refused() {
    let mut g = Graph::new();
    g.time();
    let mut bytes = g.to_bytes();
    bytes.push(0);
    assert!(matches!(
        Graph::from_bytes(&bytes),
        Err(ExprError::WrongLength { .. })
    ));
    // One node more, the time again.
    let mut twice = g.to_bytes();
    let place = sections_of(&twice)[0].clone();
    twice[place.start + 4] += 1;
    twice[place.start + 12] = 2;
    twice.insert(place.start + 16, 1);
    assert!(matches!(
        Graph::from_bytes(&resealed(&twice).unwrap()),
        Err(ExprError::Damaged {
            detail: "a node occurs twice",
            ..
        })
    ));
    assert_eq!(*g.node(NodeId(0)), Node::Time);
}

/// Whether a node is an absolute value is known or not when it is made, and stays so.
#[test]
fn what_was_known_of_absolute_values_is_kept() {
    let mut g = Graph::new();
    let t = g.time();
    let sign = g.sign(t);
    let angle = g.unary(UnaryOp::Atan, sign);
    let size = g.mul(sign, angle);
    let power = g.binary(BinaryOp::Pow, size, sign);
    g.switch(angle);
    let mut copy = Graph::from_bytes(&g.to_bytes()).unwrap();
    assert_eq!(copy.to_bytes(), g.to_bytes());
    assert_eq!(copy.switch(power), g.switch(power));
}
