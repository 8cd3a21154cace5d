#![allow(clippy::unwrap_used)]

use super::{CONTENT, NODES};
use crate::container::Writer;
use crate::{BinaryOp, ExprError, Graph, Node, NodeId};

/// What is wrong with a graph whose section is written so.
fn refused(write: impl Fn(&mut Writer)) -> &'static str {
    let mut writer = Writer::new(CONTENT);
    writer.section(NODES);
    write(&mut writer);
    match Graph::from_bytes(&writer.finish()) {
        Err(ExprError::Damaged { detail, .. }) => detail,
        other => panic!("{other:?}"),
    }
}

/// 28 of the header, 12 of the section, four counts, 4 of the checksum.
#[test]
fn an_empty_graph_is_60_bytes() {
    let bytes = Graph::new().to_bytes();
    assert_eq!(bytes.len(), 60);
    assert!(Graph::from_bytes(&bytes).unwrap().is_empty());
}

/// A count of four thousand million nodes must not be believed.
#[test]
fn large_counts_allocate_nothing() {
    assert_eq!(
        refused(|writer| writer.number(u32::MAX as usize)),
        "more entries than there are bytes for"
    );
}

#[test]
fn operands_come_before_their_use() {
    let negation = |writer: &mut Writer| {
        writer.number(1);
        writer.byte(32);
        writer.number(0);
        writer.raw(&[0; 12]);
    };
    assert_eq!(
        refused(negation),
        "an operand that does not come before its use"
    );
}

#[test]
fn large_indices_of_variables_are_refused() {
    let state = |writer: &mut Writer| {
        writer.number(1);
        writer.byte(2);
        writer.number(1 << 28);
        writer.raw(&[0; 12]);
    };
    assert_eq!(refused(state), "the index of a variable is too large");
}

#[test]
fn signs_come_after_the_function_of_their_surface() {
    let one_sign = |n_surfaces: usize| {
        move |writer: &mut Writer| {
            writer.number(1);
            writer.byte(4);
            writer.number(0);
            writer.number(n_surfaces);
            (0..n_surfaces).for_each(|_| writer.number(0));
            writer.raw(&[0; 8]);
        }
    };
    assert_eq!(
        refused(one_sign(0)),
        "the sign of a surface that does not exist"
    );
    assert_eq!(
        refused(one_sign(1)),
        "the sign of a surface before its function"
    );
}

#[test]
fn a_function_may_contain_the_sign_of_a_later_surface() {
    let mut graph = Graph::new();
    let gear = graph.parameter(0);
    let of_gear = graph.sign(gear);
    let x = graph.state(0);
    let difference = graph.binary(BinaryOp::Sub, x, of_gear);
    graph.sign(difference);
    assert_eq!(graph.put_standing_surfaces_last(&[]), [1, 0]);
    let bytes = graph.to_bytes();
    let read = Graph::from_bytes(&bytes).unwrap();
    assert_eq!(read.surface(0), difference);
    assert_eq!(read.to_bytes(), bytes);
}

#[test]
fn known_switches_and_absolute_values_fit_their_nodes() {
    // t and x[0], one surface in t; then what is known.
    let known = |switches: &[(usize, usize, u8)], absolute: &[usize]| {
        let (switches, absolute) = (switches.to_vec(), absolute.to_vec());
        move |writer: &mut Writer| {
            writer.number(2);
            writer.byte(1);
            writer.byte(2);
            [0, 1, 0].iter().for_each(|&value| writer.number(value));
            writer.number(switches.len());
            for &(id, surface, orientation) in &switches {
                writer.number(id);
                writer.number(surface);
                writer.byte(orientation);
            }
            writer.number(absolute.len());
            absolute.iter().for_each(|&id| writer.number(id));
        }
    };
    let cases = [
        (known(&[(2, 0, 0)], &[]), "a switch that is not a node"),
        (
            known(&[(0, 1, 0)], &[]),
            "a switch on a surface that does not exist",
        ),
        (
            known(&[(0, 0, 2)], &[]),
            "an orientation other than +1 and -1",
        ),
        (
            known(&[(1, 0, 0), (0, 0, 0)], &[]),
            "switches that are not in order",
        ),
        (known(&[], &[2]), "an absolute value that is not a node"),
        (
            known(&[], &[0]),
            "an absolute value that is no product with a sign",
        ),
    ];
    for (write, detail) in cases {
        assert_eq!(refused(write), detail);
    }
}

/// Simplification follows chains of negations and multiples, which it never makes itself: as deep as these are, a
/// graph that is not made again by construction would end in an overflow of the stack.
#[test]
fn chains_that_construction_never_makes_are_shortened() {
    const DEPTH: usize = 200_001;
    let mut writer = Writer::new(CONTENT);
    writer.section(NODES);
    writer.number(DEPTH + 1);
    writer.byte(1);
    for k in 0..DEPTH {
        writer.byte(32);
        writer.number(k);
    }
    writer.raw(&[0; 12]);
    let mut graph = Graph::from_bytes(&writer.finish()).unwrap();
    assert_eq!(graph.len(), 2);
    assert_eq!(graph.neg(NodeId(1)), NodeId(0));
    assert_eq!(*graph.node(NodeId(0)), Node::Time);
}

/// A chain of operations that stay as they are is as deep as it was written, and can be used.
#[test]
fn deep_graphs_can_be_used() {
    const DEPTH: usize = 200_000;
    let mut graph = Graph::new();
    let mut node = graph.state(0);
    for _ in 0..DEPTH {
        node = graph.unary(crate::UnaryOp::Atan, node);
    }
    graph.switch(node);
    let mut copy = Graph::from_bytes(&graph.to_bytes()).unwrap();
    assert_eq!(copy.len(), graph.len());
    assert_eq!(copy.switch(node), graph.switch(node));
    let rate = copy.partial(node, crate::Wrt::State(0));
    let program = crate::Program::compile(&copy, &[rate], crate::Backend::Auto).unwrap();
    let mut out = [0.0];
    program.eval(0.0, &[0.0], &[], &[], &[], &mut out);
    assert_eq!(out, [1.0]);
}
