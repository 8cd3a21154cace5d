//! Formulas at an intersection: roots, their continuation past a fold, laps.
#![allow(clippy::unwrap_used)]

mod oracles;
mod random_fields;

use filippov::switching::{
    is_scaling_stable, is_stable_for, multiplier_rates, newton, resolve, roots_in_cube,
    stable_roots, Bilinear, ExitKind, Incoming, Lap, NormalFields,
};
use random_fields::{exit_fold, exit_side, rotation, Around, Random};

/// Residual and det G = sqrt(Delta), relative to the size of the fields, which is about 1.
#[test]
fn roots_solve_the_equations() {
    let mut random = Random::new(1);
    let mut n_roots = 0;
    for _ in 0..50_000 {
        let fields = random.fields(2);
        let bilinear = Bilinear::of_fields(&fields);
        let Some(root) = bilinear.root().filter(|root| root.in_square()) else {
            continue;
        };
        n_roots += 1;
        let size = fields.size();
        let g = bilinear.value(root.point);
        let residual = g[0].abs().max(g[1].abs()) / size;
        assert!(residual < 1e-14, "residual {residual} for {fields:?}");
        let [[g11, g12], [g21, g22]] = bilinear.jacobian(root.point);
        let det = g11 * g22 - g12 * g21;
        let defect = (det * det - bilinear.discriminant()) / size.powi(4);
        assert!(
            det > 0.0 && defect.abs() < 1e-12,
            "det {det}, defect {defect}"
        );
    }
    assert!(n_roots > 5000, "{n_roots} roots");
}

/// Equations without one of the quadratic terms, or linear, need no case of their own.
#[test]
fn roots_of_special_equations() {
    let around = |d: [f64; 2], b: [f64; 2], c: [f64; 2]| Around {
        centre: [0.25, -0.5],
        a: [0.0; 2],
        b,
        c,
        d,
    };
    let cases = [
        around([0.0, 0.0], [-1.0, 0.5], [0.25, -2.0]),
        around([1.0, 0.0], [-1.0, 0.0], [0.0, -2.0]),
        around([0.5, 0.5], [-1.0, 1.0], [-1.0, -1.0]),
        around([0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]),
    ];
    for case in cases {
        let root = Bilinear::of_fields(&case.fields()).root().unwrap();
        let off = (root.point[0] - 0.25)
            .abs()
            .max((root.point[1] + 0.5).abs());
        assert!(off < 1e-15, "off by {off} for {case:?}");
    }
}

/// The continued root is continuous at the fold, like the root of the distance before it, constant
/// to first order in it beyond.
#[test]
fn the_root_is_continued_past_a_fold() {
    let mut random = Random::new(2);
    for _ in 0..1000 {
        let exit = exit_fold(&mut random);
        let drift: Vec<f64> = (0..8)
            .map(|i| exit.after.values()[i] - exit.at.values()[i])
            .collect();
        let moved = |times: f64| {
            let shifted = exit.at.shifted(&[times * drift[0], times * drift[1]]);
            let point = Bilinear::of_fields(&shifted).extended_root().unwrap();
            (point[0] - exit.root[0]).hypot(point[1] - exit.root[1])
        };
        assert!(Bilinear::of_fields(&exit.after).root().is_none());
        let (before, later, beyond) = (moved(-1e-4), moved(-1e-2), moved(1e-2));
        assert!(
            (later / before / 10.0 - 1.0).abs() < 0.3,
            "{later} against {before}"
        );
        assert!(
            beyond < 0.1 * later,
            "{beyond} beyond the fold, {later} before it"
        );
    }
}

/// Branch and prune finds the root in closed form, and besides it the saddle only.
#[test]
fn all_roots_in_the_square() {
    let mut random = Random::new(3);
    let mut counts = [0; 3];
    for _ in 0..3000 {
        let fields = random.fields(2);
        let found = roots_in_cube(&fields);
        assert!(found.complete, "{fields:?}");
        counts[found.points.len()] += 1;
        let (positive, negative): (Vec<_>, Vec<_>) = found
            .points
            .iter()
            .partition(|p| fields.jacobian(p).determinant() > 0.0);
        assert!(negative.len() <= 1);
        let closed = Bilinear::of_fields(&fields)
            .root()
            .filter(|root| root.in_square());
        match (closed, positive.as_slice()) {
            (None, []) => {}
            (Some(root), [point]) => {
                let off = (root.point[0] - point[0]).hypot(root.point[1] - point[1]);
                assert!(off < 1e-10, "off by {off} for {fields:?}");
            }
            (closed, found) => {
                panic!("{found:?} in the square, {closed:?} in closed form: {fields:?}")
            }
        }
    }
    assert!(counts.iter().all(|&n| n > 50), "{counts:?}");
}

/// For three surfaces: Newton's method from many points finds no root that branch and prune does not.
#[test]
fn all_roots_in_the_cube() {
    let mut random = Random::new(4);
    let mut counts = [0; 7];
    for _ in 0..300 {
        let fields = random.fields(3);
        let found = roots_in_cube(&fields);
        assert!(found.complete);
        counts[found.points.len()] += 1;
        for point in &found.points {
            let g = fields.interpolate(point);
            assert!(g.iter().all(|g| g.abs() < 1e-13 * fields.size()), "{g:?}");
        }
        for n in 0..216 {
            let start = [n % 6, n / 6 % 6, n / 36].map(|i| -1.0 + 0.4 * f64::from(i));
            let Some(root) = newton(&fields, &start).filter(|r| r.iter().all(|v| v.abs() < 1.0))
            else {
                continue;
            };
            let near = |p: &Vec<f64>| p.iter().zip(&root).all(|(a, b)| (a - b).abs() < 1e-7);
            assert!(
                found.points.iter().any(near),
                "{root:?} is not among {found:?}"
            );
        }
    }
    assert!(
        counts[0] > 20 && counts[1] > 20 && counts[2] > 10,
        "{counts:?}"
    );
}

/// lambda' = -G^-1 g' against a difference.
#[test]
fn the_predictor_of_a_root() {
    let mut random = Random::new(5);
    let mut n_roots = 0;
    while n_roots < 50 {
        let fields = random.fields(3);
        for root in stable_roots(&fields) {
            n_roots += 1;
            let drift = random.normals::<3>();
            let rates = multiplier_rates(&fields, &root, &drift).unwrap();
            let time = 1e-7;
            let later = fields.shifted(&drift.map(|d| time * d));
            let moved = newton(&later, &root).unwrap();
            for i in 0..3 {
                let error = (moved[i] - root[i]) / time - rates[i];
                // Second order in time, by the curvature of the root.
                assert!(
                    error.abs() < 1e-3 * (1.0 + rates[i].powi(2)),
                    "{error}, {rates:?}"
                );
            }
        }
    }
}

/// Stability by minors and by Routh, for random matrices and scalings: stable for a scaling that is
/// tried implies a chain of minors, with the one exception in about 700 that is known for three
/// surfaces.
#[test]
fn chains_of_minors_and_scalings() {
    let mut random = Random::new(6);
    let mut agree = [[0; 2]; 2];
    for _ in 0..3000 {
        let jacobian = random
            .fields(3)
            .jacobian(&random.normals::<3>().map(f64::tanh));
        let tried = (0..300).any(|_| {
            let kappa = [random.ratio(4.0), random.ratio(4.0), random.ratio(4.0)];
            is_stable_for(&jacobian, &kappa)
        });
        agree[usize::from(tried)][usize::from(is_scaling_stable(&jacobian))] += 1;
    }
    assert!(agree[1][1] > 300 && agree[0][0] > 1000, "{agree:?}");
    assert!(
        agree[1][0] <= agree[1][1] / 100,
        "stable without a chain: {agree:?}"
    );
    // A chain means that some scaling exists; 300 trials find it nearly always.
    assert!(
        agree[0][1] <= agree[1][1] / 20,
        "a chain without a stable scaling: {agree:?}"
    );
}

/// A lap by its formula against straight lines from surface to surface.
#[test]
fn laps_are_straight_lines() {
    let mut random = Random::new(7);
    for _ in 0..2000 {
        let fields = rotation(&mut random);
        let lap = Lap::around(&fields, [-1, -1]).unwrap();
        let from = usize::from(lap.regions[3][0] == lap.regions[0][0]);
        let mut alpha = [0.0; 2];
        // Enters (-,-) through the surface `from`, on the half axis where the other one is -1.
        alpha[1 - from] = -1.0;
        let mut farthest = 1.0_f64;
        for n in 0..4 {
            let f = fields.in_region(&lap.regions[n]);
            alpha = [0, 1].map(|j: usize| alpha[j] + lap.times[n] * f[j]);
            let next = lap.regions[(n + 1) % 4];
            let hit = usize::from(lap.regions[n][0] == next[0]);
            farthest = farthest.max(alpha[1 - hit].abs());
            assert!(
                alpha[hit].abs() < 1e-14 * farthest,
                "{alpha:?} is not on surface {hit}"
            );
        }
        assert!((alpha[1 - from] + lap.gamma).abs() < 1e-14 * farthest);
        // The closed formula for gamma.
        let ratio = |k: [i8; 2]| (fields.in_region(&k)[1] / fields.in_region(&k)[0]).abs();
        let product = ratio([-1, -1]) * ratio([1, 1]) / (ratio([1, -1]) * ratio([-1, 1]));
        let gamma = if lap.regions[1] == [1, -1] {
            product
        } else {
            1.0 / product
        };
        assert!((lap.gamma / gamma - 1.0).abs() < 1e-14);
    }
}

/// The same equation twice, with zeros in the square; and without: two surfaces that are both crossed.
#[test]
fn proportional_equations_are_undetermined() {
    let same = NormalFields::new(2, vec![1.0, 2.0, -1.0, -2.0, 0.5, 1.0, -0.5, -1.0]).unwrap();
    assert!(Bilinear::of_fields(&same).is_undetermined());
    let crossed = NormalFields::new(2, vec![1.0; 8]).unwrap();
    assert!(!Bilinear::of_fields(&crossed).is_undetermined());
    assert!(Lap::around(&crossed, [-1, -1]).is_none());
}

/// The margin of a root is positive where there is one in the square, and nowhere else.
#[test]
fn the_margin_of_a_root_has_its_sign() {
    let mut random = Random::new(8);
    let mut counts = [0; 2];
    for _ in 0..50_000 {
        let fields = random.fields(2);
        let bilinear = Bilinear::of_fields(&fields);
        let is_inside = bilinear.root().is_some_and(|root| root.in_square());
        assert_eq!(is_inside, bilinear.root_margin() > 0.0, "{fields:?}");
        counts[usize::from(is_inside)] += 1;
    }
    assert!(counts.iter().all(|&n| n > 2000), "{counts:?}");
}

/// Exits of three surfaces, the third of which only holds the motion, are those of the first two.
#[test]
fn exits_of_three_surfaces() {
    let mut random = Random::new(9);
    let mut counts = [0; 2];
    for n in 0..200 {
        let (exit, kind) = if n % 2 == 0 {
            (exit_side(&mut random), ExitKind::Side)
        } else {
            (exit_fold(&mut random), ExitKind::Fold)
        };
        let drift: Vec<f64> = (0..2)
            .map(|j| exit.after.at(0)[j] - exit.at.at(0)[j])
            .collect();
        // A shift of all values that parts the curves like the fields after the exit.
        let lambda = exit.root.to_vec();
        let g = Bilinear::of_fields(&exit.after).value(exit.root);
        let drift = if n % 2 == 0 { g.to_vec() } else { drift };
        let at = |kind| Incoming::Exit {
            kind,
            lambda: lambda.clone(),
            drift: Some(drift.clone()),
        };
        let two = resolve(&exit.at, &at(kind), &exit.kappa).unwrap();
        let values = (0..8).flat_map(|p| {
            let f = exit.at.at(p & 3);
            [f[0], f[1], if p & 4 == 0 { 1.0 } else { -1.0 }]
        });
        let three = NormalFields::new(3, values.collect()).unwrap();
        let incoming = Incoming::Exit {
            kind,
            lambda: [lambda.clone(), vec![0.0]].concat(),
            drift: Some([drift, vec![0.0]].concat()),
        };
        let kappa = [exit.kappa[0], exit.kappa[1], 1.0];
        let Ok(found) = resolve(&three, &incoming, &kappa) else {
            continue;
        };
        let entries = found.mode().unwrap().entries();
        assert_eq!(entries[2], 0);
        assert_eq!(
            &entries[..2],
            two.mode().unwrap().entries(),
            "{kind:?} {exit:?}",
            exit = exit.at
        );
        counts[n % 2] += 1;
    }
    assert!(counts[0] > 90 && counts[1] > 80, "{counts:?}");
}
