//! Blended values against the fields at all signs: equal there, and their multilinear interpolant between.

mod support;

use filippov_expr::{Backend, Graph, NodeId, Program};
use proptest::prelude::*;
use support::{build, config, points, recipes, Point};

/// Surfaces looked at together: 2^4 vertices.
const MOST: usize = 4;

fn evaluate(g: &Graph, nodes: &[NodeId], at: &Point, signs: &[f64]) -> Vec<f64> {
    let program = Program::compile(g, nodes, Backend::Interpreter).expect("nodes of this graph");
    let mut out = vec![0.0; nodes.len()];
    program.eval(at.t, &at.x, signs, &at.p, &[0.75], &mut out);
    out
}

/// The multilinear interpolant of a value at `signs`, and the largest value at a vertex.
fn interpolated(g: &Graph, node: NodeId, at: &Point, signs: &[f64], m: usize) -> (f64, f64) {
    let mut sum = 0.0;
    let mut size = 0.0_f64;
    for vertex in 0..1_usize << m {
        let mut corner = signs.to_vec();
        let mut weight = 1.0;
        for (j, corner) in corner.iter_mut().enumerate().take(m) {
            *corner = if vertex >> j & 1 == 1 { 1.0 } else { -1.0 };
            weight *= 0.5 * (1.0 + *corner * signs[j]);
        }
        let value = evaluate(g, &[node], at, &corner)[0];
        size = size.max(value.abs());
        sum += weight * value;
    }
    (sum, size)
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn blended_values_are_the_interpolant(
        recipe in recipes(30),
        at in points(),
        lambda in prop::collection::vec(-1.0..1.0, MOST),
    ) {
        let (mut g, nodes) = build(&recipe);
        let root = nodes[nodes.len() - 1];
        let m = g.n_surfaces().min(MOST);
        let surfaces: Vec<u32> = (0..m as u32).collect();
        let Some(blended) = g.blended(&[root], &surfaces) else { return Ok(()) };
        let vertex = at.signs(g.n_surfaces());
        let mut inside = vertex.clone();
        inside[..m].copy_from_slice(&lambda[..m]);
        for signs in [&vertex, &inside] {
            let (expected, size) = interpolated(&g, root, &at, signs, m);
            let found = evaluate(&g, &blended, &at, signs)[0];
            if size < 1e8 && expected.is_finite() {
                prop_assert!((found - expected).abs() <= 1e-7 * (1.0 + size), "{found} for {expected}: {}", g.text(root, &Default::default()));
            }
        }
    }

    #[test]
    fn derivatives_by_signs_are_half_the_jump(recipe in recipes(30), at in points()) {
        let (mut g, nodes) = build(&recipe);
        let root = nodes[nodes.len() - 1];
        let all: Vec<u32> = (0..g.n_surfaces() as u32).collect();
        let dependence = g.sign_dependence(&[root], &all);
        let signs = at.signs(g.n_surfaces());
        // Where the field of some signs does not exist there is no interpolant.
        let exists = all.len() <= 8 && interpolated(&g, root, &at, &signs, all.len()).0.is_finite();
        prop_assume!(exists);
        for &j in &dependence.surfaces {
            let [above, below] = [1.0, -1.0].map(|side| {
                let mut signs = signs.clone();
                signs[j as usize] = side;
                evaluate(&g, &[root], &at, &signs)[0]
            });
            let listed = dependence.derivatives[0].iter().find(|d| d.0 == j);
            let found = listed.map_or(0.0, |d| evaluate(&g, &[d.1], &at, &signs)[0]);
            let by_two = g.sign_derivative(root, j);
            let direct = evaluate(&g, &[by_two], &at, &signs)[0];
            let size = above.abs() + below.abs();
            let expected = 0.5 * (above - below);
            if size < 1e8 && found.is_finite() {
                prop_assert!((found - expected).abs() <= 1e-7 * (1.0 + size), "{found} for {expected}: {} by {j}", g.text(root, &Default::default()));
                prop_assert!((direct - expected).abs() <= 1e-7 * (1.0 + size));
            }
        }
    }

    #[test]
    fn affine_means_no_second_differences(recipe in recipes(30), at in points()) {
        let (mut g, nodes) = build(&recipe);
        let root = nodes[nodes.len() - 1];
        let d = g.n_surfaces() as u32;
        let all: Vec<u32> = (0..d).collect();
        let dependence = g.sign_dependence(&[root], &all);
        let signs = at.signs(d as usize);
        for (&j, &k) in dependence.surfaces.iter().zip(dependence.surfaces.iter().skip(1)) {
            if !dependence.is_affine_in(&[j, k]) {
                continue;
            }
            let mut corners = [0.0; 4];
            for (corner, value) in corners.iter_mut().enumerate() {
                let mut signs = signs.clone();
                signs[j as usize] = if corner & 1 == 1 { 1.0 } else { -1.0 };
                signs[k as usize] = if corner & 2 == 2 { 1.0 } else { -1.0 };
                *value = evaluate(&g, &[root], &at, &signs)[0];
            }
            let size = corners.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            let mixed = corners[0] - corners[1] - corners[2] + corners[3];
            if size < 1e8 && mixed.is_finite() {
                prop_assert!(mixed.abs() <= 1e-7 * (1.0 + size), "mixed difference {mixed}");
            }
        }
    }
}
