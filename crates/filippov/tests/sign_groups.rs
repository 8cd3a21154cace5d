//! Intersections of many surfaces of which only some have signs that multiply one another: everything works from the
//! groups, and agrees with the fields of all 2^m sign patterns.
#![allow(clippy::unwrap_used)]

mod oracles;
mod random_fields;

use filippov::motion::{IntersectionField, MeetingFields, Motion, SmoothField};
use filippov::switching::{
    is_stable, limit_of_hidden_dynamics, resolve, roots_in_cube, stability_margins, HiddenOutcome,
    Incoming, Matrix, NormalFields, SignGroup, Undecided,
};
use filippov::{PiecewiseSystem, Place, Setting, TracedSystem, Units};
use filippov_expr::{Backend, Graph, Names, NodeId};
use random_fields::Random;

/// d masses on springs with friction; masses 4 and 5 carry a sign product in their friction law.
fn chain(d: u32) -> TracedSystem {
    let mut g = Graph::new();
    let mut field: Vec<NodeId> = (0..d).map(|i| g.state(d + i)).collect();
    let signs: Vec<NodeId> = (0..d)
        .map(|i| {
            let v = g.state(d + i);
            g.sign(v)
        })
        .collect();
    let (friction, share) = (g.constant(0.5), g.constant(0.2));
    let product = g.mul(signs[4], signs[5]);
    let product = g.mul(share, product);
    for i in 0..d {
        let (here, next) = (g.state(i), g.state((i + 1) % d));
        let pull = g.sub(next, here);
        let hold = g.mul(friction, signs[i as usize]);
        let mut force = g.sub(pull, hold);
        if i == 4 || i == 5 {
            force = g.sub(force, product);
        }
        field.push(force);
    }
    TracedSystem::new(g, field, Vec::new(), Names::default(), Backend::Auto).unwrap()
}

#[test]
fn sliding_on_all_masses_of_a_chain_costs_the_sum_over_the_groups() {
    for d in [12_usize, 40] {
        let system = chain(d as u32);
        let set: Vec<usize> = (0..d).collect();
        let groups = (&system as &dyn PiecewiseSystem).sign_groups(&set);
        assert_eq!(groups.len(), d - 1);
        assert!(groups.contains(&vec![4, 5]));
        let mut field =
            IntersectionField::new(&system, &set, Setting::of_signs(&vec![1.0; d]), &[]);
        let x: Vec<f64> = (0..d).map(|i| 0.1 * (i as f64).sin()).collect();
        let mut state: Vec<f64> = x.iter().copied().chain(vec![0.0; d]).collect();
        let mut dx = vec![0.0; 2 * d];
        field.eval(0.0, &mut state, &mut dx).unwrap();
        // 4 fields of the pair, one more for each other mass.
        assert_eq!(field.n_evaluations(), d as u64 + 2);
        assert!(dx.iter().all(|v| v.abs() < 1e-15));
        let lambda = field.multipliers();
        let pull = |i: usize| x[(i + 1) % d] - x[i];
        for i in 0..d {
            let together = if i == 4 || i == 5 {
                0.2 * lambda[4] * lambda[5]
            } else {
                0.0
            };
            assert!((pull(i) - 0.5 * lambda[i] - together).abs() < 1e-14);
        }
    }
}

/// Signs of surfaces outside of the intersection are data: they join no groups.
#[test]
fn only_groups_of_the_sliding_surfaces_count() {
    let system = chain(12);
    let set = [0, 3, 4, 7];
    assert_eq!(
        (&system as &dyn PiecewiseSystem).sign_groups(&set),
        [vec![0], vec![3], vec![4], vec![7]]
    );
    let mut fields = MeetingFields::new(&system, &set);
    let mut state = vec![0.0; 24];
    state[5 + 12] = 0.3;
    let signs = vec![1.0; 12];
    let place = Place::new(0.0, &state, &signs);
    assert_eq!(fields.evaluate(&system, &place, Units::ONES).unwrap(), 5);
}

/// A random sum over groups, and the same with all patterns.
fn random_sum(random: &mut Random, sizes: &[usize]) -> [NormalFields; 2] {
    let m: usize = sizes.iter().sum();
    let mut first = 0;
    let groups = sizes.iter().map(|&size| {
        let members: Vec<usize> = (first..first + size).collect();
        first += size;
        let mut values: Vec<f64> = (0..m << size).map(|_| random.normal()).collect();
        for pattern in 0..1 << size {
            for &i in &members {
                // More often attracting than not.
                let side = if pattern >> (i - members[0]) & 1 == 1 {
                    1.0
                } else {
                    -1.0
                };
                values[pattern * m + i] -= 2.0 * side;
            }
        }
        SignGroup::new(&members, &values)
    });
    let fields = NormalFields::of_groups(m, groups.collect()).unwrap();
    let all = fields.values().into_owned();
    [fields, NormalFields::new(m, all).unwrap()]
}

fn assert_near(a: &[f64], b: &[f64], within: f64) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert!((a - b).abs() <= within, "{a} is not {b}");
    }
}

#[test]
fn sums_over_groups_have_the_values_roots_and_limits_of_all_patterns() {
    let mut random = Random::new(5);
    let (mut slides, mut n_roots) = (0, 0);
    for case in 0..120 {
        let sizes: &[usize] = [&[2, 1, 1][..], &[1, 3], &[2, 2], &[1, 1, 1], &[3, 1, 1]][case % 5];
        let [grouped, all] = random_sum(&mut random, sizes);
        let m = grouped.m();
        let lambda: Vec<f64> = (0..m).map(|_| random.between(-1.0, 1.0)).collect();
        assert_near(
            &grouped.interpolate(&lambda),
            &all.interpolate(&lambda),
            1e-13,
        );
        let entries =
            |matrix: &Matrix| -> Vec<f64> { (0..m * m).map(|k| matrix[(k / m, k % m)]).collect() };
        let jacobians = [&grouped, &all].map(|fields| entries(&fields.jacobian(&lambda)));
        assert_near(&jacobians[0], &jacobians[1], 1e-13);
        for j in 0..m {
            assert!((grouped.row_size(j) - all.row_size(j)).abs() < 1e-13);
        }
        assert_eq!(grouped.is_affine(), sizes.iter().all(|&size| size == 1));
        let mut mode = vec![0_i8; m];
        (mode[0], mode[m - 1]) = (1, -1);
        let faces = [&grouped, &all].map(|fields| fields.restrict(&mode));
        assert_near(&faces[0].values(), &faces[1].values(), 1e-13);
        let sort = |fields: &NormalFields| {
            let found = roots_in_cube(fields);
            assert!(found.complete);
            let mut points = found.points;
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            points
        };
        let roots = [sort(&grouped), sort(&all)];
        assert_eq!(roots[0].len(), roots[1].len());
        n_roots += roots[0].len();
        for (a, b) in roots[0].iter().zip(&roots[1]) {
            assert_near(a, b, 1e-9);
        }
        let kappa = vec![1.0; m];
        let limits =
            [&grouped, &all].map(|fields| limit_of_hidden_dynamics(fields, &vec![0.0; m], &kappa));
        match &limits {
            [HiddenOutcome::Sliding {
                mode,
                multipliers,
                oscillates,
            }, HiddenOutcome::Sliding {
                mode: other,
                multipliers: others,
                oscillates: also,
            }] => {
                assert_eq!((mode, oscillates), (other, also));
                assert_near(multipliers, others, 1e-9);
                slides += usize::from(mode.codimension() == m);
            }
            [one, other] => assert_eq!(one, other),
        }
    }
    assert!(slides >= 20 && n_roots >= 40, "{slides} {n_roots}");
}

/// Without structure the search would be exponential in 14 surfaces; with it only two are searched.
#[test]
fn all_roots_of_many_surfaces_are_those_of_the_group() {
    let m = 14;
    let mut random = Random::new(11);
    let mut groups = vec![SignGroup {
        members: [0, 1].as_slice().into(),
        // x y = 1/4 and x + y = 5/4: roots (1, 1/4) moved inwards.
        values: [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]
            .iter()
            .flat_map(|[x, y]: &[f64; 2]| {
                let mut row = vec![0.3 * x + 0.2 * y + 0.1 * x * y; m];
                (row[0], row[1]) = (x * y - 0.21, x + y - 1.0);
                row
            })
            .collect(),
    }];
    for i in 2..m {
        let column: Vec<f64> = (0..m)
            .map(|j| match j {
                0 | 1 => 0.0,
                _ if i == j => -4.0,
                _ => 0.2 * random.normal(),
            })
            .collect();
        let values = [-1.0, 1.0]
            .iter()
            .flat_map(|s| column.iter().map(move |c| s * c));
        groups.push(SignGroup::new(&[i], &values.collect::<Vec<f64>>()));
    }
    let fields = NormalFields::of_groups(m, groups).unwrap();
    let found = roots_in_cube(&fields);
    assert!(found.complete);
    let mut first: Vec<f64> = found.points.iter().map(|point| point[0]).collect();
    first.sort_by(f64::total_cmp);
    assert_near(&first, &[0.3, 0.7], 1e-12);
    for point in &found.points {
        assert_near(&fields.interpolate(point), &vec![0.0; m], 1e-12);
    }
}

#[test]
fn parts_that_do_not_know_of_each_other_are_decided_alone() {
    let mut random = Random::new(3);
    let pair = random.fields(2);
    // Surfaces 0 and 2 are the pair, surface 1 slides.
    let mut values = Vec::new();
    for pattern in 0..4 {
        let f = pair.at(pattern);
        values.extend([f[0], 0.0, f[1]]);
    }
    let groups = vec![
        SignGroup::new(&[0, 2], &values),
        SignGroup::new(&[1], &[0.0, 2.0, 0.0, 0.0, -1.0, 0.0]),
    ];
    let fields = NormalFields::of_groups(3, groups).unwrap();
    let kappa = [2.0, 1.0, 0.5];
    let whole = resolve(&fields, &Incoming::Start, &kappa).unwrap();
    let alone = resolve(&pair, &Incoming::Start, &[2.0, 0.5]).unwrap();
    let (whole_mode, alone_mode) = (whole.mode().unwrap(), alone.mode().unwrap());
    assert_eq!(whole_mode.entries()[1], 0);
    assert_eq!(
        [whole_mode.entries()[0], whole_mode.entries()[2]],
        [alone_mode.entries()[0], alone_mode.entries()[1]]
    );
    assert_eq!(whole.candidates.len(), alone.candidates.len());
}

/// Eigenvalues of large matrices are not computed, and signs of minors overflow: a companion matrix with known ones.
#[test]
fn stability_of_many_coupled_surfaces() {
    let n = 16;
    for (shift, expected) in [(-0.01, true), (0.01, false)] {
        // A ring: eigenvalues -1 + shift + exp(2 pi i k / n), the largest shift.
        let mut matrix = Matrix::zeros(n);
        for i in 0..n {
            matrix[(i, i)] = -1.0 + shift;
            matrix[(i, (i + 1) % n)] = 1.0;
        }
        assert_eq!(is_stable(&matrix), expected);
        assert_eq!(stability_margins(&matrix, true)[1] > 0.0, expected);
    }
}

#[test]
fn a_group_of_seven_is_refused_by_name() {
    let members: Vec<usize> = (0..7).collect();
    let values = vec![1.0; 7 << 7];
    let refused = NormalFields::of_groups(7, vec![SignGroup::new(&members, &values)]);
    assert!(matches!(refused, Err(Undecided::Shape { m: 7, .. })));
}
