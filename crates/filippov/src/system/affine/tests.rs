//! Parts of chains with friction against the fields themselves, and what they cost.

use crate::sparse::Pattern;
use crate::{AffineSigns, ClosureSystem, PiecewiseSystem, Place, SingularSliding, TracedSystem};
use filippov_expr::{Backend, Graph, Names, NodeId, UnaryOp};

/// d masses on springs, each with Stribeck friction on the ground (`ground`) or between neighbours:
/// x_i' = v_i, v_i' = forces. The surfaces are v_i = 0 or v_i - v_{i+1} = 0.
fn chain(d: u32, ground: bool) -> TracedSystem {
    let mut g = Graph::new();
    let zero = g.constant(0.0);
    let v: Vec<NodeId> = (0..d).map(|i| g.state(d + i)).collect();
    let friction: Vec<NodeId> = (0..d)
        .map(|i| {
            let i = i as usize;
            let slip = match (ground, v.get(i + 1)) {
                (true, _) | (_, None) => v[i],
                (false, Some(&next)) => g.sub(v[i], next),
            };
            let (speed, sign) = (g.abs(slip), g.sign(slip));
            let slower = g.neg(speed);
            let decay = g.unary(UnaryOp::Exp, slower);
            let (a, b) = (g.constant(0.3), g.constant(0.2));
            let b = g.mul(b, decay);
            let mu = g.add(a, b);
            g.mul(mu, sign)
        })
        .collect();
    let mut field = v.clone();
    for i in 0..d {
        let x = g.state(i);
        let left = if i > 0 { g.state(i - 1) } else { zero };
        let right = if i + 1 < d { g.state(i + 1) } else { zero };
        let two = g.constant(2.0);
        let (ends, own) = (g.add(left, right), g.mul(two, x));
        let mut force = g.sub(ends, own);
        let i = i as usize;
        force = g.sub(force, friction[i]);
        if !ground && i > 0 {
            force = g.add(force, friction[i - 1]);
        }
        field.push(force);
    }
    TracedSystem::new(g, field, Vec::new(), Names::default(), Backend::Interpreter)
        .expect("compiles")
}

fn state(d: usize) -> Vec<f64> {
    let positions = (0..d).map(|i| 0.1 * (i as f64).sin());
    positions.chain((0..d).map(|_| 0.0)).collect()
}

#[test]
fn sliding_on_all_surfaces_keeps_them_at_linear_cost() {
    for (ground, pattern) in [
        (true, Pattern::Diagonal),
        (false, Pattern::Banded { bandwidth: 1 }),
    ] {
        let cost = |d: usize| {
            let system = chain(d as u32, ground);
            let affine = system.affine_signs().expect("traced");
            let surfaces: Vec<usize> = (0..d).collect();
            let mut parts = affine.affine_parts(&surfaces).expect("affine");
            let (x, mut dx) = (state(d), vec![0.0; 2 * d]);
            let evaluations = parts
                .evaluate(affine, &Place::new(0.0, &x, &vec![0.25; d]))
                .expect("traced");
            assert_eq!(evaluations, 1);
            parts.slide(&mut dx).expect("independent");
            assert!(dx[d..].iter().all(|rate| rate.abs() < 1e-14));
            assert_eq!(parts.pattern(), pattern);
            // The field at the multipliers, evaluated there, is the one that was combined.
            let lambda = parts.multipliers().to_vec();
            parts
                .evaluate(affine, &Place::new(0.0, &x, &lambda))
                .expect("traced");
            assert!(parts
                .field
                .iter()
                .zip(&dx)
                .all(|(a, b)| (a - b).abs() < 1e-14));
            parts.n_operations() as f64 / d as f64
        };
        assert!(
            cost(1000) < 1.1 * cost(100),
            "not linear: {} and {}",
            cost(100),
            cost(1000)
        );
    }
}

#[test]
fn parts_agree_with_the_fields_of_all_signs_for_any_set() {
    let d = 4;
    let system = chain(d as u32, false);
    let affine = system.affine_signs().expect("traced");
    let x: Vec<f64> = (0..2 * d).map(|i| 0.3 * (i as f64 + 0.5).cos()).collect();
    for surfaces in [vec![0], vec![1, 2], vec![0, 1, 2, 3]] {
        let mut parts = affine.affine_parts(&surfaces).expect("affine");
        for pattern in 0..1_usize << d {
            let signs: Vec<f64> = (0..d)
                .map(|j| if pattern >> j & 1 == 1 { 1.0 } else { -1.0 })
                .collect();
            let mut elsewhere = signs.clone();
            for &j in &surfaces {
                elsewhere[j] = 0.125;
            }
            parts
                .evaluate(affine, &Place::new(0.0, &x, &elsewhere))
                .expect("traced");
            let at: Vec<f64> = surfaces.iter().map(|&j| signs[j]).collect();
            let (mut found, mut expected) = (vec![0.0; 2 * d], vec![0.0; 2 * d]);
            parts.combine(&at, &mut found);
            system
                .field(&Place::new(0.0, &x, &signs), &mut expected)
                .expect("traced");
            assert!(found
                .iter()
                .zip(&expected)
                .all(|(a, b)| (a - b).abs() < 1e-14));
        }
    }
}

#[test]
fn surfaces_whose_signs_multiply_are_not_taken_together() {
    let mut g = Graph::new();
    let x: Vec<NodeId> = (0..3).map(|i| g.state(i)).collect();
    let s: Vec<NodeId> = x.iter().map(|&x| g.sign(x)).collect();
    let product = g.mul(s[0], s[1]);
    let system = TracedSystem::new(
        g,
        vec![product, s[2], s[1]],
        Vec::new(),
        Names::default(),
        Backend::Auto,
    )
    .expect("compiles");
    let parts = |surfaces: &[usize]| system.affine_parts(surfaces);
    assert!(parts(&[0, 1]).is_none() && parts(&[0, 1, 2]).is_none());
    assert!(parts(&[0, 2]).is_some() && parts(&[1]).is_some());
}

#[test]
fn redundant_surfaces_are_named() {
    // Two brakes on one axle: only the sum of their multipliers matters.
    let system = ClosureSystem::new(
        2,
        3,
        |_t, _x, s, dx| {
            dx[0] = 0.1 - s[0] - s[2];
            dx[1] = 0.2 - s[1];
        },
        |_t, x, h| h.copy_from_slice(&[x[0], x[1], 1.7 * x[0].sinh()]),
    )
    .with_affine_signs();
    let affine = system.affine_signs().expect("declared");
    let mut parts = affine.affine_parts(&[0, 1, 2]).expect("declared");
    assert_eq!(
        parts
            .evaluate(affine, &Place::new(0.0, &[0.0; 2], &[0.5, 0.0, -0.5]))
            .expect("pure"),
        4
    );
    let nu = parts.nu();
    assert!(
        (nu[0] - 0.1).abs() < 1e-9 && (nu[1] - 0.2).abs() < 1e-9 && (nu[2] - 0.17).abs() < 1e-9
    );
    let found = parts.slide(&mut [0.0; 2]);
    assert_eq!(
        found,
        Err(SingularSliding {
            surfaces: vec![0, 2]
        })
    );
}

/// Three belts that pull at one another: the velocity in each of the 27 modes is the one that holds the surfaces slid on, with
/// the signs of the others.
#[test]
fn the_velocity_in_a_mode_holds_its_surfaces() {
    let n = [[-1.0, 0.2, 0.1], [0.3, -1.5, 0.2], [0.0, 0.4, -0.8]];
    let system = ClosureSystem::new(
        3,
        3,
        move |_t, x, s, dx| {
            for i in 0..3 {
                let pull: f64 = (0..3).map(|j| n[i][j] * s[j]).sum();
                dx[i] = 0.3 + 0.1 * i as f64 - x[i] + pull;
            }
        },
        |_t, x, h| h.copy_from_slice(x),
    )
    .with_affine_signs();
    let affine = system.affine_signs().expect("declared");
    let mut parts = affine.affine_parts(&[0, 1, 2]).expect("declared");
    let place = Place::new(0.0, &[0.0; 3], &[1.0, -1.0, 1.0]);
    parts.evaluate(affine, &place).expect("pure");
    for pattern in 0..27_usize {
        let entry = |j: usize| (pattern / 3_usize.pow(j as u32) % 3) as i8 - 1;
        let velocity = parts
            .velocity_in(&[0, 1, 2].map(entry))
            .expect("determined");
        let mut signs = [0.0; 3];
        // The multipliers follow from the velocities that are zero, by sweeps: each row is dominated by its own.
        for _ in 0..200 {
            for i in 0..3 {
                let others: f64 = (0..3).filter(|&j| j != i).map(|j| n[i][j] * signs[j]).sum();
                signs[i] = match entry(i) {
                    0 => -(0.3 + 0.1 * i as f64 + others) / n[i][i],
                    side => f64::from(side),
                };
            }
        }
        let mut expected = [0.0; 3];
        system
            .field(&Place::new(0.0, &[0.0; 3], &signs), &mut expected)
            .expect("pure");
        for (v, e) in velocity.iter().zip(expected) {
            assert!((v - e).abs() < 1e-9, "mode {pattern}: {velocity:?}");
        }
    }
}
