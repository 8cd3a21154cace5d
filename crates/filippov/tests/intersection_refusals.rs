//! What `resolve` says where there is no certain answer: an error or a mark, never a mode in silence.
#![allow(clippy::unwrap_used)]

mod oracles;
mod random_fields;

use filippov::switching::{
    admissible, limit_of_hidden_dynamics, resolve, Admissible, Continuation, ExitKind,
    HiddenOutcome, Incoming, Lap, NormalFields, Undecided,
};
use oracles::{enter, Corners};
use random_fields::{entry, rotation, Random};

fn face(mode: &[i8]) -> Incoming {
    Incoming::Face {
        mode: mode.to_vec(),
        multipliers: Vec::new(),
    }
}

/// Sliding on the second of three surfaces reaches the other two, in the plane, and no motion of the hidden dynamics
/// ends early.
#[test]
fn a_decision_on_three_surfaces_in_the_plane() {
    let normals = [(1.18, 0.57), (0.88, 0.82), (-0.92, 0.17)];
    // By the signs of the surfaces, those of the last one alternate.
    let values = [
        (4.0, 4.0),
        (8.0, 4.0),
        (2.0, -4.0),
        (2.0, 4.0),
        (2.0, 6.0),
        (-2.0, -2.0),
        (-4.0, -2.0),
        (-4.0, -2.0),
    ];
    let mut components = vec![0.0; 24];
    for (k, (vx, vy)) in values.into_iter().enumerate() {
        // The first surface is the lowest bit of a pattern.
        let pattern = (k >> 2) | (k & 2) | ((k & 1) << 2);
        for (i, (nx, ny)) in normals.into_iter().enumerate() {
            components[3 * pattern + i] = nx * vx + ny * vy;
        }
    }
    let fields = NormalFields::new(3, components).unwrap();
    let found = resolve(&fields, &face(&[1, 0, -1]), &[1.0; 3]).unwrap();
    assert_eq!(found.mode().unwrap().entries(), [0, 1, 1]);
}

#[test]
fn shapes_and_values_are_checked() {
    assert_eq!(
        NormalFields::new(2, vec![1.0; 7]),
        Err(Undecided::Shape { m: 2, found: 7 })
    );
    let mut values = vec![1.0; 8];
    values[3] = f64::NAN;
    assert_eq!(NormalFields::new(2, values), Err(Undecided::NotFinite));
    let fields = NormalFields::new(2, vec![1.0; 8]).unwrap();
    for kappa in [vec![1.0], vec![1.0, 0.0], vec![1.0, f64::NAN]] {
        let refused = resolve(&fields, &Incoming::Start, &kappa);
        assert_eq!(refused, Err(Undecided::Scaling { m: 2 }));
    }
    let corner = |region: &[i8]| Incoming::Corner {
        region: region.to_vec(),
    };
    for incoming in [corner(&[-1]), corner(&[-1, 0]), face(&[0, -1, -1])] {
        let refused = resolve(&fields, &incoming, &[1.0, 1.0]);
        assert_eq!(refused, Err(Undecided::IncomingShape { m: 2 }));
    }
    for (surface, mode) in [[0, 0], [-1, 1]].into_iter().enumerate() {
        let refused = resolve(&fields, &face(&mode), &[1.0, 1.0]);
        assert_eq!(refused, Err(Undecided::NotArriving { surface }));
    }
}

#[test]
fn proportional_components_are_refused() {
    let f = vec![1.0, 2.0, -1.0, -2.0, 0.5, 1.0, -0.5, -1.0];
    let fields = NormalFields::new(2, f).unwrap();
    for incoming in [face(&[0, -1]), Incoming::Start] {
        assert_eq!(
            resolve(&fields, &incoming, &[1.0, 1.0]),
            Err(Undecided::Proportional)
        );
    }
    // Not where they have no zero: both surfaces are crossed at once.
    let fields = NormalFields::new(2, vec![1.0; 8]).unwrap();
    let corner = Incoming::Corner {
        region: vec![-1, -1],
    };
    let found = resolve(&fields, &corner, &[1.0, 1.0]).unwrap();
    assert_eq!(
        (found.chosen, found.unique),
        (Continuation::mode(&[1, 1]), true)
    );
}

/// f_1^{-+} of an entry decides between sliding and a region; nearly zero, both are named.
#[test]
fn doubtful_signs_are_marked() {
    let at = |f1: f64| {
        let f = vec![1.0, 1.0, -1.0, 1.0, f1, 1.0, -1.0, 1.0];
        resolve(
            &NormalFields::new(2, f).unwrap(),
            &face(&[0, -1]),
            &[1.0, 1.0],
        )
        .unwrap()
    };
    for f1 in [1e-10, -1e-10, 0.0] {
        let found = at(f1);
        assert!(
            found.degenerate && !found.unique && found.margin <= 1e-10,
            "{found:?}"
        );
        assert!(found.candidates.contains(&Continuation::mode(&[0, 1])));
        assert!(found.candidates.contains(&Continuation::mode(&[-1, 1])));
    }
    for f1 in [1e-6, -1e-6] {
        assert!(!at(f1).degenerate && at(f1).unique);
    }
}

/// A component that vanishes without deciding anything does not make the decision doubtful.
#[test]
fn zeros_that_do_not_decide_are_no_doubt() {
    let f = vec![1.0, 1.0, -1.0, 1.0, 0.5, 1.0, -1.0, 0.0];
    let fields = NormalFields::new(2, f).unwrap();
    let found = resolve(&fields, &face(&[0, -1]), &[1.0, 1.0]).unwrap();
    assert!(!found.degenerate && found.unique, "{found:?}");
}

/// Surfaces that do not know of each other: g_j depends on lambda_j only, so that the entry is a
/// tie between left and right turning. Each surface is decided by itself.
#[test]
fn surfaces_without_coupling_are_no_obstacle() {
    let mut random = Random::new(16);
    for _ in 0..300 {
        let x = random.between(-0.9, 0.9);
        let [minus, plus] = random.normals::<2>();
        let minus = minus.abs();
        let f = |p: usize| {
            [
                x - [-1.0, 1.0][p & 1],
                if p & 2 == 0 { minus } else { plus },
            ]
        };
        let values = (0..4).flat_map(f);
        let fields = NormalFields::new(2, values.collect()).unwrap();
        let found = resolve(&fields, &face(&[0, -1]), &[1.0, 1.0]).unwrap();
        let expected = if plus > 0.0 { [0, 1] } else { [0, 0] };
        assert_eq!(found.chosen, Continuation::mode(&expected), "{fields:?}");
        assert!(found.unique && !found.degenerate, "{found:?}");
        assert!((found.multipliers[0] - x).abs() < 1e-14);
    }
}

/// The scaling decides the ambiguous leaves, and both candidates are reported.
#[test]
fn the_scaling_decides_what_is_ambiguous() {
    let mut random = Random::new(12);
    let mut found = 0;
    while found < 50 {
        let (fields, mode) = entry(&mut random);
        let at = |kappa: [f64; 2]| resolve(&fields, &face(&mode), &kappa).unwrap();
        let leaf = enter(&Corners::new(&fields), mode).unwrap();
        if leaf.is_unique() {
            continue;
        }
        found += 1;
        let (first, second) = (at([3e3, 1.0]), at([1.0, 3e3]));
        assert_ne!(first.chosen, second.chosen, "{fields:?}");
        for resolution in [first, second] {
            assert!(
                !resolution.unique && !resolution.degenerate,
                "{resolution:?} of {fields:?}"
            );
            let lists = |one: &Continuation| resolution.candidates.contains(one);
            assert!(
                leaf.candidates.iter().all(lists),
                "{resolution:?}, {leaf:?}"
            );
            assert_eq!(resolution.candidates.len(), admissible(&fields).len());
            let mode = resolution.mode().unwrap();
            assert_eq!(resolution.multipliers.len(), mode.codimension());
        }
    }
}

/// Without a past: one admissible mode is taken, of several the one that the hidden dynamics finds
/// from 0.
#[test]
fn starts_on_an_intersection() {
    let mut random = Random::new(13);
    let mut counts = [0; 2];
    for n in 0..2000 {
        let fields = if n % 4 == 0 {
            rotation(&mut random)
        } else {
            random.fields(2)
        };
        let options = admissible(&fields);
        let found = resolve(&fields, &Incoming::Start, &[1.0, 1.0]).unwrap();
        let chosen = found.chosen.clone();
        counts[usize::from(options.len() > 1)] += 1;
        match options.as_slice() {
            [] => panic!("no continuation of {fields:?}"),
            [only] => assert!(found.unique && chosen == only.continuation),
            several => assert!(!found.unique && found.candidates.len() >= several.len()),
        }
    }
    assert!(counts.iter().all(|&n| n > 500), "{counts:?}");
}

/// Rotating fields have the outward spiral as a continuation if and only if gamma > 1.
#[test]
fn outward_spirals_are_admissible() {
    let mut random = Random::new(17);
    let mut counts = [0; 2];
    for _ in 0..1000 {
        let fields = rotation(&mut random);
        let gamma = Lap::around(&fields, [-1, -1]).unwrap().gamma;
        let spirals = |a: &Admissible| a.continuation == Continuation::OutwardSpiral;
        let found = admissible(&fields).iter().any(spirals);
        assert_eq!(found, gamma > 1.0, "{fields:?}");
        counts[usize::from(found)] += 1;
    }
    assert!(counts.iter().all(|&n| n > 300), "{counts:?}");
}

/// Two surfaces around whose root the hidden dynamics oscillates, and a third one that is left at a steady pace.
#[test]
fn oscillations_on_a_face_are_seen() {
    let mut random = Random::new(18);
    let mut found = 0;
    while found < 10 {
        let (two, mode) = entry(&mut random);
        let state = |held: f64| [f64::from(mode[0]), f64::from(mode[1]), held];
        let start = [f64::from(mode[0]), f64::from(mode[1])];
        let HiddenOutcome::Sliding {
            oscillates: true, ..
        } = limit_of_hidden_dynamics(&two, &start, &[1.0, 1.0])
        else {
            continue;
        };
        found += 1;
        for side in [-1_i8, 1] {
            let leaving = 0.3 * f64::from(side);
            let values = (0..8).flat_map(|p| [two.at(p & 3)[0], two.at(p & 3)[1], leaving]);
            let three = NormalFields::new(3, values.collect()).unwrap();
            let outcome = limit_of_hidden_dynamics(&three, &state(0.0), &[1.0; 3]);
            let HiddenOutcome::Sliding {
                mode, oscillates, ..
            } = &outcome
            else {
                panic!("{outcome:?} of {three:?}");
            };
            assert_eq!(
                (mode.entries(), *oscillates),
                ([0, 0, side].as_slice(), true)
            );
        }
    }
}

#[test]
fn exits_of_three_surfaces_need_the_drift() {
    let values = (0..8).flat_map(|p| [0, 1, 2].map(|i| if p >> i & 1 == 1 { -1.0 } else { 1.0 }));
    let fields = NormalFields::new(3, values.collect()).unwrap();
    let exit = |drift| Incoming::Exit {
        kind: ExitKind::Side,
        lambda: vec![1.0, 0.0, 0.0],
        drift,
    };
    let kappa = [1.0; 3];
    assert_eq!(
        resolve(&fields, &exit(None), &kappa),
        Err(Undecided::NoDrift { m: 3 })
    );
    let rest = Some(vec![0.0; 3]);
    assert_eq!(
        resolve(&fields, &exit(rest), &kappa),
        Err(Undecided::NoDrift { m: 3 })
    );
}

/// Fields affine in the signs with -G a P-matrix have one mode only: no scaling is tried, and none
/// disagrees.
#[test]
fn friction_of_three_surfaces_is_unique() {
    let mut random = Random::new(14);
    for _ in 0..200 {
        let bias = random.normals::<3>();
        let coupling = [
            0.3 * random.normal(),
            0.3 * random.normal(),
            0.3 * random.normal(),
        ];
        let values = (0..8).flat_map(|p| {
            let s = [0, 1, 2].map(|i: usize| if p >> i & 1 == 1 { 1.0 } else { -1.0 });
            [0, 1, 2].map(|i: usize| {
                bias[i] - 2.0 * s[i] + coupling[i] * (s[(i + 1) % 3] - s[(i + 2) % 3])
            })
        });
        let fields = NormalFields::new(3, values.collect()).unwrap();
        assert!(fields.is_affine());
        let found = resolve(&fields, &Incoming::Start, &[1.0; 3]).unwrap();
        assert!(found.unique && admissible(&fields).len() == 1, "{found:?}");
        let other = resolve(&fields, &Incoming::Start, &[1.0, 10.0, 100.0]).unwrap();
        assert_eq!(found.chosen, other.chosen);
    }
}

/// Three surfaces, entered from sliding on two: every answer is consistent, and refusals are rare.
#[test]
fn entries_of_three_surfaces_are_consistent() {
    let mut random = Random::new(15);
    let (mut decided, mut refused, mut ambiguous, mut oscillating) = (0, 0, 0, 0);
    while decided + refused < 150 {
        let fields = random.fields(3);
        let found = match resolve(&fields, &face(&[0, 0, -1]), &[1.0; 3]) {
            Err(Undecided::NotArriving { .. }) => continue,
            Err(_) => {
                refused += 1;
                continue;
            }
            Ok(found) => found,
        };
        decided += 1;
        ambiguous += i32::from(!found.unique);
        oscillating += i32::from(found.oscillates);
        let mode = found.mode().unwrap();
        let options = admissible(&fields);
        assert!(
            found.oscillates
                || options
                    .iter()
                    .any(|a| a.continuation.as_mode() == Some(mode)),
            "{found:?} is not among {options:?}"
        );
        assert!(found.candidates.contains(&Continuation::Mode(mode.clone())));
        assert_eq!(found.multipliers.len(), mode.codimension());
    }
    assert!(refused <= 3, "{refused} refused");
    assert!(
        ambiguous > 5 && oscillating < 15,
        "{ambiguous} ambiguous, {oscillating} oscillating"
    );
}
