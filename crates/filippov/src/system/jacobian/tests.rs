//! Exact derivatives against differences of the field.

use filippov_expr::{Backend, Graph, Names, NodeId, UnaryOp};

use super::super::{Linearisations, Place, Setting, TracedSystem};
use crate::motion::{IntersectionField, Motion, RegionField, SlidingField, SmoothField};

/// Three states, two surfaces: h_0 = x_0 - sin(x_1)/2 - t/10, h_1 = x_1 + x_2^2 - t/5. The signs multiply one another if
/// `entangled`.
fn system(entangled: bool) -> TracedSystem {
    let mut g = Graph::new();
    let t = g.time();
    let x: Vec<NodeId> = (0..3).map(|i| g.state(i)).collect();
    let number = |g: &mut Graph, value: f64| g.constant(value);
    let scaled = |g: &mut Graph, factor: f64, node: NodeId| {
        let factor = g.constant(factor);
        g.mul(factor, node)
    };
    let sine = g.unary(UnaryOp::Sin, x[1]);
    let (half_sine, drift) = (scaled(&mut g, 0.5, sine), scaled(&mut g, 0.1, t));
    let h0 = g.sub(x[0], half_sine);
    let h0 = g.sub(h0, drift);
    let (square, drift) = (g.mul(x[2], x[2]), scaled(&mut g, 0.2, t));
    let h1 = g.add(x[1], square);
    let h1 = g.sub(h1, drift);
    let (s0, s1) = (g.sign(h0), g.sign(h1));
    // x_0' = cos(x_2) t - 2 s_0 (1 + x_1^2) + 0.3 s_0 s_1, x_1' = x_0 x_2 - (3 + t) s_1, x_2' = x_0 + s_0 x_1 - x_2.
    let (cosine, bend) = (g.unary(UnaryOp::Cos, x[2]), g.mul(x[1], x[1]));
    let one = number(&mut g, 1.0);
    let size = g.add(one, bend);
    let twice = scaled(&mut g, -2.0, size);
    let (push, pull) = (g.mul(cosine, t), g.mul(twice, s0));
    let mut f0 = g.add(push, pull);
    if entangled {
        let both = g.mul(s0, s1);
        let both = scaled(&mut g, 0.3, both);
        f0 = g.add(f0, both);
    }
    let three = number(&mut g, 3.0);
    let (cross, strength) = (g.mul(x[0], x[2]), g.add(three, t));
    let friction = g.mul(strength, s1);
    let f1 = g.sub(cross, friction);
    let (lift, rest) = (g.mul(s0, x[1]), g.sub(x[0], x[2]));
    let f2 = g.add(rest, lift);
    TracedSystem::new(g, vec![f0, f1, f2], vec![], Names::default(), Backend::Auto)
        .expect("plain operations")
}

const POINT: (f64, [f64; 3]) = (0.7, [0.05, -0.04, 0.4]);

/// df/dx and df/dt by central differences.
fn by_differences(field: &mut dyn SmoothField) -> Vec<[f64; 4]> {
    let (t, x) = POINT;
    let d = 1e-6;
    let mut columns = Vec::new();
    for i in 0..4 {
        let mut at = |side: f64| {
            let (mut time, mut x) = (t, x.to_vec());
            match x.get_mut(i) {
                Some(x) => *x += side * d,
                None => time += side * d,
            }
            let mut rates = vec![0.0; 3];
            field.eval_unprojected(time, &mut x, &mut rates).unwrap();
            rates
        };
        let (above, below) = (at(1.0), at(-1.0));
        let pairs = above.iter().zip(&below);
        columns.push(pairs.map(|(a, b)| (a - b) / (2.0 * d)).collect::<Vec<_>>());
    }
    let row = |k: usize| std::array::from_fn(|i| columns[i][k]);
    (0..3).map(row).collect()
}

/// The same from the graph: the multipliers are eliminated.
fn from_graph(system: &TracedSystem, sliding: &[usize], signs: &[f64]) -> Vec<[f64; 4]> {
    let jacobian = system.motion_jacobian(sliding).expect("signs are blended");
    let mut out = jacobian.linearisation();
    let (t, x) = POINT;
    system.eval_jacobian(&jacobian, &Place::new(t, &x, signs), &mut out);
    let size = out.n_unknowns();
    // Rows [-F_x, -F_l | F_t] and [G_x, G_l | -G_t].
    let mut rows = vec![vec![0.0; size + 1]; size];
    for (i, row) in rows.iter_mut().enumerate() {
        row[size] = out.time()[i];
    }
    let matrix = out.shifted(0.0);
    for (i, row) in rows.iter_mut().enumerate() {
        matrix.row(i).for_each(|(j, value)| row[j] = value);
    }
    for k in (3..size).rev() {
        let pivot = rows[k].clone();
        for row in rows.iter_mut().take(k) {
            let factor = row[k] / pivot[k];
            row.iter_mut()
                .zip(&pivot)
                .for_each(|(a, b)| *a -= factor * b);
        }
    }
    let entry = |i: usize, j: usize| if j < 3 { -rows[i][j] } else { rows[i][size] };
    (0..3)
        .map(|i| std::array::from_fn(|j| entry(i, j)))
        .collect()
}

fn assert_close(exact: &[[f64; 4]], approximate: &[[f64; 4]]) {
    for (exact, approximate) in exact.iter().zip(approximate) {
        for (a, b) in exact.iter().zip(approximate) {
            assert!((a - b).abs() < 1e-7, "{exact:?} {approximate:?}");
        }
    }
}

#[test]
fn derivatives_in_a_region() {
    let system = system(true);
    for signs in [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0]] {
        let mut field = RegionField::new(&system, Setting::of_signs(&signs));
        assert_close(
            &from_graph(&system, &[], &signs),
            &by_differences(&mut field),
        );
    }
}

#[test]
fn derivatives_while_sliding_on_one_surface() {
    let system = system(true);
    for j in [0, 1] {
        let mut signs = [1.0, 1.0];
        let mut field = SlidingField::new(&system, j, Setting::of_signs(&signs));
        let (t, x) = POINT;
        field.normal_components_at(t, &x).unwrap();
        signs[j] = field.last().multiplier();
        // Not attractive here, which the derivatives do not know.
        assert!(signs[j].is_finite());
        assert_close(
            &from_graph(&system, &[j], &signs),
            &by_differences(&mut field),
        );
    }
}

#[test]
fn derivatives_while_sliding_on_an_intersection() {
    for entangled in [false, true] {
        let system = system(entangled);
        let mut field =
            IntersectionField::new(&system, &[0, 1], Setting::of_signs(&[1.0, 1.0]), &[]);
        let (t, x) = POINT;
        let mut rates = [0.0; 3];
        field
            .eval_unprojected(t, &mut x.to_vec(), &mut rates)
            .unwrap();
        let signs = field.multipliers().to_vec();
        assert!(signs.iter().all(|lambda| lambda.abs() < 1.0));
        let exact = from_graph(&system, &[0, 1], &signs);
        assert_close(&exact, &by_differences(&mut field));
    }
}
