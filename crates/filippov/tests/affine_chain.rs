//! A chain of masses with friction from event to event, as an integrator would use the affine parts: the mode by
//! the relay problem, the field by one linear system, without ever forming the fields of all signs.
#![allow(clippy::unwrap_used)]

use filippov::switching::{solve_relay, RelayProblem, Uniqueness};
use filippov::{PiecewiseSystem, Place, TracedSystem};
use filippov_expr::{Backend, Graph, Names, NodeId};

const STIFFNESS: f64 = 5.0;
const FRICTION: f64 = 0.4;

/// d masses of 1 on springs: x_i' = v_i, v_i' = 5 (x_{i-1} - 2 x_i + x_{i+1}) - 0.4 sign(v_i).
fn chain(d: u32) -> TracedSystem {
    let mut g = Graph::new();
    let mut field: Vec<NodeId> = (0..d).map(|i| g.state(d + i)).collect();
    let (stiffness, friction) = (g.constant(STIFFNESS), g.constant(FRICTION));
    for i in 0..d {
        let x = g.state(i);
        let v = g.state(d + i);
        let mut stretch = g.add(x, x);
        stretch = g.neg(stretch);
        for j in [i.wrapping_sub(1), i + 1] {
            if j < d {
                let neighbour = g.state(j);
                stretch = g.add(stretch, neighbour);
            }
        }
        let sign = g.sign(v);
        let (pull, hold) = (g.mul(stiffness, stretch), g.mul(friction, sign));
        field.push(g.sub(pull, hold));
    }
    TracedSystem::new(g, field, Vec::new(), Names::default(), Backend::Auto).unwrap()
}

/// The modes of all masses at rest with these positions, and the accelerations that follow.
fn released(system: &dyn PiecewiseSystem, x: &[f64]) -> (Vec<i8>, Vec<f64>) {
    let d = system.n_surfaces();
    let affine = system.affine_signs().unwrap();
    let surfaces: Vec<usize> = (0..d).collect();
    let state: Vec<f64> = x.iter().copied().chain(vec![0.0; d]).collect();
    let mut parts = affine.affine_parts(&surfaces).unwrap();
    parts
        .evaluate(affine, &Place::new(0.0, &state, &vec![0.0; d]))
        .unwrap();
    let problem = RelayProblem {
        nu: &parts.nu(),
        n: parts.normal(),
        noise: system.lie_tolerance(1),
    };
    let found = solve_relay(&problem, &vec![0; d]).unwrap();
    assert_eq!(found.uniqueness, Uniqueness::Certain);
    let mut field = vec![0.0; 2 * d];
    parts.combine(&found.signs, &mut field);
    (found.modes, field[d..].to_vec())
}

#[test]
fn masses_stick_exactly_where_the_springs_pull_less_than_friction() {
    for d in [1_usize, 10, 1000] {
        let system = chain(d as u32);
        let x: Vec<f64> = (0..d).map(|i| 0.3 * (2.1 * i as f64 + 0.4).sin()).collect();
        let (modes, accelerations) = released(&system, &x);
        for i in 0..d {
            let left = if i > 0 { x[i - 1] } else { 0.0 };
            let right = if i + 1 < d { x[i + 1] } else { 0.0 };
            let pull = STIFFNESS * (left - 2.0 * x[i] + right);
            let sticks = pull.abs() < FRICTION;
            assert_eq!(modes[i] == 0, sticks, "mass {i} of {d}, pulled with {pull}");
            let expected = if sticks {
                0.0
            } else {
                pull - FRICTION * pull.signum()
            };
            assert!((accelerations[i] - expected).abs() < 1e-13);
        }
    }
}

#[test]
fn while_some_masses_stick_the_rest_moves_as_with_their_signs() {
    let d = 10;
    let system = chain(d as u32);
    let affine = system.affine_signs().unwrap();
    let stuck = [2, 3, 7];
    let state: Vec<f64> = (0..2 * d)
        .map(|i: usize| match i.checked_sub(d) {
            Some(mass) if stuck.contains(&mass) => 0.0,
            _ => 0.02 * (1.3 * i as f64 + 1.0).sin(),
        })
        .collect();
    let signs: Vec<f64> = state[d..]
        .iter()
        .map(|v| if *v < 0.0 { -1.0 } else { 1.0 })
        .collect();
    let mut parts = affine.affine_parts(&stuck).unwrap();
    let mut sliding = vec![0.0; 2 * d];
    parts
        .evaluate(affine, &Place::new(0.0, &state, &signs))
        .unwrap();
    parts.slide(&mut sliding).unwrap();
    let mut region = vec![0.0; 2 * d];
    system
        .field(&Place::new(0.0, &state, &signs), &mut region)
        .unwrap();
    for mass in 0..d {
        match stuck.iter().position(|&j| j == mass) {
            Some(row) => {
                let without = region[d + mass] + FRICTION * signs[mass];
                assert!(sliding[d + mass].abs() < 1e-14);
                assert!((parts.multipliers()[row] - without / FRICTION).abs() < 1e-13);
            }
            None => assert_eq!(sliding[d + mass], region[d + mass]),
        }
    }
}
