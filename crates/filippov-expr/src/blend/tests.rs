//! What is blended, and what the derivatives look like.

use crate::{Graph, Names, NodeId};

fn text(g: &Graph, id: NodeId) -> String {
    g.text(id, &Names::default())
}

/// v and the Stribeck friction -(0.3 + 0.2 exp(-|v|)) sign(v).
fn stribeck(g: &mut Graph, v: NodeId) -> NodeId {
    let (speed, sign) = (g.abs(v), g.sign(v));
    let decay = g.neg(speed);
    let decay = g.unary(crate::UnaryOp::Exp, decay);
    let (a, b) = (g.constant(0.3), g.constant(0.2));
    let b = g.mul(b, decay);
    let mu = g.add(b, a);
    let force = g.mul(mu, sign);
    g.neg(force)
}

#[test]
fn a_force_of_one_sign_is_affine_whatever_its_law() {
    let mut g = Graph::new();
    let (u, v) = (g.state(0), g.state(1));
    let (on_u, on_v) = (stribeck(&mut g, u), stribeck(&mut g, v));
    let total = g.add(on_u, on_v);
    let dependence = g.sign_dependence(&[total], &[0, 1]);
    assert!(dependence.is_affine_in(&[0, 1]));
    assert_eq!(dependence.groups(&[0, 1]), [vec![0], vec![1]]);
    let by: Vec<u32> = dependence.derivatives[0].iter().map(|d| d.0).collect();
    assert_eq!(by, [0, 1]);
}

#[test]
fn signs_that_multiply_are_a_group() {
    let mut g = Graph::new();
    let s: Vec<NodeId> = (0..5)
        .map(|i| {
            let x = g.state(i);
            g.sign(x)
        })
        .collect();
    let (ab, bc) = (g.mul(s[0], s[1]), g.mul(s[1], s[4]));
    let sum = g.add(ab, bc);
    let rest = g.add(s[2], s[3]);
    let dependence = g.sign_dependence(&[sum, rest], &[0, 1, 2, 3, 4]);
    assert_eq!(dependence.couplings, [(0, 1), (1, 4)]);
    assert_eq!(
        dependence.groups(&[0, 1, 2, 3, 4]),
        [vec![0, 1, 4], vec![2], vec![3]]
    );
    assert!(dependence.is_affine_in(&[0, 2, 3, 4]) && !dependence.is_affine_in(&[1, 4]));
    assert!(!g.is_affine_in_signs(&[sum], &[0, 1]) && g.is_affine_in_signs(&[sum, rest], &[0, 2]));
}

#[test]
fn common_signs_of_factors_are_written_out() {
    let mut g = Graph::new();
    let (x, y, v) = (g.state(0), g.state(1), g.state(2));
    let s = g.sign(v);
    let (a, b) = (g.add(x, s), g.add(y, s));
    let product = g.mul(a, b);
    let derivative = g.sign_derivative(product, 0);
    assert_eq!(
        text(&g, derivative),
        "0.5*((x[0] + 1)*(x[1] + 1) - (x[0] - 1)*(x[1] - 1))"
    );
    let blended = g
        .blended(&[product], &[0])
        .map(|values| text(&g, values[0]));
    assert_eq!(
        blended.as_deref(),
        Some("(x[0] + 1)*(x[1] + 1)*(0.5*sign(x[2]) + 0.5) + (x[0] - 1)*(x[1] - 1)*(0.5 - 0.5*sign(x[2]))")
    );
}

#[test]
fn too_many_signs_in_one_function_are_entangled() {
    let mut g = Graph::new();
    let mut sum = g.state(9);
    for i in 0..6 {
        let x = g.state(i);
        let s = g.sign(x);
        sum = g.add(sum, s);
    }
    let bent = g.unary(crate::UnaryOp::Exp, sum);
    let last = g.state(6);
    let free = g.sign(last);
    let value = g.mul(bent, free);
    let all: Vec<u32> = (0..7).collect();
    assert_eq!(g.blended(&[value], &all), None);
    assert_eq!(g.sign_dependence(&[value], &all).surfaces, [6]);
    assert!(g.blended(&[value], &[2, 4, 5]).is_some());
}

#[test]
fn a_chain_of_a_thousand_contacts_is_blended_at_linear_cost() {
    let size = |d: u32| {
        let mut g = Graph::new();
        let forces: Vec<NodeId> = (0..d)
            .map(|i| {
                let v = g.state(i);
                stribeck(&mut g, v)
            })
            .collect();
        let field: Vec<NodeId> = forces
            .windows(2)
            .map(|pair| g.sub(pair[0], pair[1]))
            .collect();
        let all: Vec<u32> = (0..d).collect();
        let dependence = g.sign_dependence(&field, &all);
        assert!(dependence.is_affine_in(&all));
        assert!(dependence.derivatives.iter().all(|row| row.len() == 2));
        g.len()
    };
    let (small, large) = (size(100), size(1000));
    assert!(
        large < 11 * small,
        "{small} nodes for 100, {large} for 1000"
    );
}
