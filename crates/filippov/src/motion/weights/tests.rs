use super::minimum_norm::by_quadratic_program;
use super::*;

const RULES: [SlidingRule; 4] = [
    SlidingRule::Canopy,
    SlidingRule::Moments,
    SlidingRule::DieciLopez,
    SlidingRule::MinimumNorm,
];

/// Numbers in (0, 1) by splitmix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let (a, b) = (self.next(), self.next());
        (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }

    /// Fields that all point towards the intersection.
    fn attracting(&mut self, m: usize) -> NormalFields {
        let mut values = Vec::new();
        for pattern in 0..1 << m {
            values.extend((0..m).map(|j| -sign_of(pattern, j) * self.normal().abs()));
        }
        NormalFields::new(m, values).unwrap()
    }

    /// Fields affine in the signs, f^k = a + B k, with a stable root in the cube and all 2^m corners.
    fn affine(&mut self, m: usize) -> (NormalFields, Vec<f64>) {
        let root: Vec<f64> = (0..m).map(|_| 1.6 * self.next() - 0.8).collect();
        let mut b = vec![0.0; m * m];
        for (index, entry) in b.iter_mut().enumerate() {
            let diagonal = index % (m + 1) == 0;
            *entry = if diagonal {
                -1.0 - self.next()
            } else {
                0.4 * self.normal() / m as f64
            };
        }
        let mut values = Vec::new();
        for pattern in 0..1 << m {
            for j in 0..m {
                let terms = (0..m).map(|i| b[j * m + i] * (sign_of(pattern, i) - root[i]));
                values.push(terms.sum());
            }
        }
        (NormalFields::new(m, values).unwrap(), root)
    }
}

/// The largest normal component of the combination, as a fraction of the fields.
fn residual(fields: &NormalFields, weights: &[f64]) -> f64 {
    let component = |j: usize| -> f64 {
        let terms = weights.iter().enumerate();
        terms.map(|(k, w)| w * fields.at(k)[j]).sum()
    };
    (0..fields.m())
        .map(component)
        .fold(0.0, |m: f64, v| m.max(v.abs()))
        / fields.size()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

#[test]
fn one_surface_is_filippovs_for_every_rule() {
    let fields = NormalFields::new(1, vec![3.0, -1.0]).unwrap();
    for rule in RULES {
        assert_eq!(weights(rule, &fields).unwrap(), [0.25, 0.75], "{rule:?}");
    }
    // The formula of Dieci and Lopez itself gives the same, as their Remark 4.3 says.
    assert!(distance(&dieci_lopez(&fields).unwrap(), &[0.25, 0.75]) < 1e-15);
}

#[test]
fn weights_are_a_convex_combination_that_is_tangent() {
    let mut random = Random(1);
    for _ in 0..2000 {
        let fields = random.attracting(2);
        for rule in RULES {
            let weights = weights(rule, &fields).unwrap();
            assert!(
                (weights.iter().sum::<f64>() - 1.0).abs() < 1e-13,
                "{rule:?}"
            );
            assert!(
                weights.iter().all(|w| *w >= -1e-15),
                "{rule:?}: {weights:?} {fields:?}"
            );
            if rule != SlidingRule::DieciLopez {
                assert!(residual(&fields, &weights) < 1e-12, "{rule:?}");
            }
        }
    }
}

#[test]
fn affine_fields_have_the_same_multipliers_whatever_the_rule() {
    let mut random = Random(2);
    for _ in 0..500 {
        let (fields, root) = random.affine(2);
        for rule in [
            SlidingRule::Canopy,
            SlidingRule::Moments,
            SlidingRule::MinimumNorm,
        ] {
            let weights = weights(rule, &fields).unwrap();
            // Tangency determines sum w_k k also where a weight of the moments is negative.
            assert!(
                distance(&multipliers_of(&weights, 2), &root) < 1e-12,
                "{rule:?}"
            );
        }
    }
    for m in 3..5 {
        for _ in 0..50 {
            let (fields, root) = random.affine(m);
            let weights = weights(SlidingRule::MinimumNorm, &fields).unwrap();
            assert!(distance(&multipliers_of(&weights, m), &root) < 1e-11, "{m}");
        }
    }
}

#[test]
fn the_rules_differ_for_other_fields() {
    let fields = NormalFields::new(2, vec![1.0, 1.0, -2.0, 1.0, 1.0, -3.0, -1.0, -1.0]).unwrap();
    let all: Vec<Vec<f64>> = RULES
        .iter()
        .map(|r| weights(*r, &fields).unwrap())
        .collect();
    for i in 0..4 {
        for j in 0..i {
            assert!(
                distance(&all[i], &all[j]) > 1e-3,
                "{:?} {:?}",
                RULES[i],
                RULES[j]
            );
        }
    }
}

#[test]
fn no_combination_has_a_smaller_norm() {
    let square = |w: &[f64]| -> f64 { w.iter().map(|w| w * w).sum() };
    let mut random = Random(3);
    for _ in 0..500 {
        let fields = random.attracting(2);
        let least = square(&weights(SlidingRule::MinimumNorm, &fields).unwrap());
        for rule in [SlidingRule::Canopy, SlidingRule::Moments] {
            assert!(least <= square(&weights(rule, &fields).unwrap()) + 1e-14);
        }
    }
}

#[test]
fn the_segment_and_the_quadratic_program_agree() {
    let mut random = Random(4);
    let mut n_clipped = 0;
    for _ in 0..2000 {
        let fields = random.attracting(2);
        let clipped = minimum_norm(&fields).unwrap();
        let solved = by_quadratic_program(&fields).unwrap();
        assert!(
            distance(&clipped, &solved) < 1e-11,
            "{clipped:?} {solved:?}"
        );
        n_clipped += usize::from(clipped.iter().any(|w| *w < 1e-15));
    }
    assert!(n_clipped > 100);
}

#[test]
fn the_quadratic_program_fulfils_its_conditions_for_three_and_four_surfaces() {
    let mut random = Random(5);
    for m in 3..5 {
        for _ in 0..200 {
            let fields = random.attracting(m);
            let weights = weights(SlidingRule::MinimumNorm, &fields).unwrap();
            assert!(residual(&fields, &weights) < 1e-12);
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(weights.iter().all(|w| *w >= 0.0));
        }
    }
}

#[test]
fn no_combination_is_named() {
    // All fields move up in the first surface.
    let values = vec![1.0, 1.0, 1.0, 1.0, 2.0, -1.0, 1.0, -1.0];
    let fields = NormalFields::new(2, values).unwrap();
    assert!(Segment::of(&fields).is_none_or(|segment| segment.length() < 0.0));
    let mut values = vec![1.0; 24];
    values[4] = -1.0;
    let fields = NormalFields::new(3, values).unwrap();
    let failed = weights(SlidingRule::MinimumNorm, &fields);
    assert_eq!(failed, Err(RuleFailure::NoTangentCombination));
    let failed = weights(SlidingRule::Moments, &fields);
    assert_eq!(failed, Err(RuleFailure::NotTwoSurfaces { m: 3 }));
}

/// Example 4.4 of Dieci and Lopez: all speeds are 1, and so A = sum w_k k_1 k_2 = 0. Example 6.2: weights 1/4.
#[test]
fn closed_forms_of_dieci_and_lopez() {
    let towards = |pattern: usize| (0..2).map(move |j| -sign_of(pattern, j));
    let fields = NormalFields::new(2, (0..4).flat_map(towards).collect()).unwrap();
    assert!(distance(&dieci_lopez(&fields).unwrap(), &[0.25; 4]) < 1e-15);

    // |y| = 1, 8, 27, 1: P = (216)^(1/3) = 6, 3, 2, 6 and mu = 6/7, 3/11, 2/29, 6/7.
    let values = vec![0.5, 0.5, -4.0, 4.0, 9.0, -18.0, -0.25, -0.75];
    let mu: [f64; 4] = [6.0 / 7.0, 3.0 / 11.0, 2.0 / 29.0, 6.0 / 7.0];
    let sum: f64 = mu.iter().sum();
    let fields = NormalFields::new(2, values).unwrap();
    assert!(distance(&dieci_lopez(&fields).unwrap(), &mu.map(|mu| mu / sum)) < 1e-15);

    // An exit field: one without normal component has all the weight.
    let values = vec![0.0, 0.0, -4.0, 4.0, 9.0, -18.0, -0.25, -0.75];
    let fields = NormalFields::new(2, values).unwrap();
    assert_eq!(dieci_lopez(&fields).unwrap(), [1.0, 0.0, 0.0, 0.0]);
}

#[test]
fn at_a_corner_of_the_square_all_rules_take_its_field() {
    // The field ++ is all but tangent to both surfaces; no combination of the three others is.
    let values = vec![1.0, 2.0, -1.0, 1.5, 2.0, -1.0, -1e-12, -1e-12];
    let fields = NormalFields::new(2, values).unwrap();
    for rule in [
        SlidingRule::Canopy,
        SlidingRule::Moments,
        SlidingRule::MinimumNorm,
    ] {
        let away = distance(&weights(rule, &fields).unwrap(), &[0.0, 0.0, 0.0, 1.0]);
        assert!(away < 1e-11, "{rule:?}: {away}");
    }
}

/// Where sliding on one surface begins to leave, the moments are those of that sliding.
#[test]
fn moments_reach_a_face_where_it_begins_to_leave() {
    // On the side lambda_2 = 1: f_1 = 1 and -2, f_2 = 0.5 and -1, so that g_2 = 0 where g_1 = 0.
    let values = vec![1.0, 1.0, -1.0, 1.0, 1.0, 0.5, -2.0, -1.0];
    let fields = NormalFields::new(2, values).unwrap();
    let found = moments(&fields).unwrap();
    assert!(distance(&found, &[0.0, 0.0, 2.0 / 3.0, 1.0 / 3.0]) < 1e-15);
    let leaving = neighbours(SlidingRule::Moments, &fields);
    let margin = leaving
        .iter()
        .find(|n| n.mode.entries() == [0, 1])
        .unwrap()
        .margin;
    assert!(margin.abs() < 1e-15);
    assert!(leaving.iter().filter(|n| n.margin < 0.1).count() == 1);
}

#[test]
fn neighbours_agree_with_the_admissible_modes() {
    let mut random = Random(6);
    let mut n_leaving = 0;
    for _ in 0..2000 {
        let values = (0..8).map(|_| random.normal()).collect();
        let fields = NormalFields::new(2, values).unwrap();
        let mut expected: Vec<Mode> = crate::switching::admissible(&fields)
            .iter()
            .filter_map(|found| found.continuation.as_mode().cloned())
            .filter(|mode| mode.codimension() < 2)
            .collect();
        let mut found: Vec<Mode> = neighbours(SlidingRule::MinimumNorm, &fields)
            .into_iter()
            .filter(|neighbour| neighbour.margin < 0.0)
            .map(|neighbour| neighbour.mode)
            .collect();
        expected.sort_by_key(Mode::to_string);
        found.sort_by_key(Mode::to_string);
        n_leaving += found.len();
        assert_eq!(found, expected);
    }
    assert!(n_leaving > 1000);
}

/// Not only where all fields point to the intersection: wherever no motion leaves it.
#[test]
fn moments_are_not_negative_where_nothing_leaves() {
    let mut random = Random(7);
    let mut n_attracting = 0;
    for _ in 0..20_000 {
        let values = (0..8).map(|_| random.normal()).collect();
        let fields = NormalFields::new(2, values).unwrap();
        let all = neighbours(SlidingRule::Moments, &fields);
        if all.iter().all(|neighbour| neighbour.margin > 1e-9) {
            n_attracting += 1;
            let weights = moments(&fields).unwrap();
            assert!(weights.iter().all(|w| *w > -1e-9), "{weights:?} {fields:?}");
        }
    }
    assert!(n_attracting > 1000);
}
