//! The decision trees of two surfaces against the hidden dynamics, and against the decisions of the library, on 150,000
//! random sets of fields.
#![allow(clippy::unwrap_used)]

mod oracles;
mod random_fields;

use std::collections::BTreeMap;

use filippov::switching::{
    admissible, limit_of_hidden_dynamics, resolve, Bilinear, Continuation, ExitKind, HiddenOutcome,
    Incoming, NormalFields,
};
use oracles::{
    enter, leave_at_fold, leave_at_side, leave_where_unstable, Corners, Frame, Leaf, Refused,
};
use random_fields::{entry, exit_fold, exit_side, exit_stability, Exit, Random};

const ENTRIES: usize = 70_000;
const SIDES: usize = 16_000;
const FOLDS: usize = 4_000;
const STABILITY: usize = 10_000;

/// Decisions of the library: entries, exits of the three kinds, corners.
const DECISIONS: [usize; 5] = [100_000, 20_000, 15_000, 15_000, 20_000];

/// Every leaf of every tree but the one that cannot occur (`E.B/none/left`).
const LEAVES: [&str; 31] = [
    "E.A/none/classical",
    "E.A/none/left",
    "E.A/none/top",
    "E.A/root/trap",
    "E.A/root/turn",
    "E.B/amb/classical",
    "E.B/amb/top",
    "E.B/none/classical",
    "E.B/none/top",
    "E.B/root/barrier",
    "E.B/root/closed-left",
    "E.B/root/closed-top",
    "E.B/root/trap",
    "Xa/down",
    "Xa/sliding",
    "Xa/up",
    "Xb/a1",
    "Xb/a2",
    "Xb/b1",
    "Xb/b2",
    "Xb/b3",
    "Xb/c1",
    "Xb/c2",
    "Xc8/down",
    "Xc8/spiral",
    "Xc8/two",
    "Xc8/up",
    "Xc9/down",
    "Xc9/escape",
    "Xc9/two",
    "Xc9/up",
];

/// How often each leaf occurred, and how often the hidden dynamics took another one of its candidates.
#[derive(Default)]
struct Tally {
    leaves: BTreeMap<&'static str, [usize; 2]>,
}

impl Tally {
    /// The hidden dynamics in fields after the event, from a state that belongs to them.
    fn note(&mut self, leaf: &Leaf, fields: &NormalFields, start: [f64; 2], kappa: [f64; 2]) {
        let outcome = limit_of_hidden_dynamics(fields, &start, &kappa);
        let found = continuation(&outcome);
        let counts = self.leaves.entry(leaf.name).or_default();
        counts[0] += 1;
        if found != leaf.chosen {
            let is_candidate = found.is_some_and(|found| leaf.candidates.contains(&found));
            assert!(
                is_candidate && !leaf.is_unique(),
                "{outcome:?} against {leaf:?}, {fields:?} from {start:?}, kappa {kappa:?}"
            );
            counts[1] += 1;
        }
    }
}

/// The decision of the library, from the fields at the event alone: where the outcome is the same for all scalings it is
/// this one, else it is one of the outcomes, and lists them all.
fn selection_agrees(leaf: &Leaf, fields: &NormalFields, incoming: &Incoming, kappa: [f64; 2]) {
    let found = resolve(fields, incoming, &kappa).unwrap();
    let told = || format!("{found:?} against {leaf:?}, {fields:?}, {incoming:?}, kappa {kappa:?}");
    assert!(leaf.candidates.contains(&found.chosen), "{}", told());
    assert!(!found.degenerate || found.margin < 1e-8, "{}", told());
    assert!(
        leaf.candidates
            .iter()
            .all(|one| found.candidates.contains(one)),
        "{}",
        told()
    );
    match incoming {
        // All that attract are candidates, also those that no scaling leads to.
        Incoming::Face { .. } => assert!(leaf.is_unique() || !found.unique, "{}", told()),
        _ => assert_eq!(found.candidates.len(), leaf.candidates.len(), "{}", told()),
    }
}

#[test]
fn trees_and_hidden_dynamics_agree() {
    let mut random = Random::new(20_221);
    let mut tally = Tally::default();
    for _ in 0..ENTRIES {
        let (fields, mode) = entry(&mut random);
        let leaf = enter(&Corners::new(&fields), mode).unwrap();
        let start = entry_state(&fields, mode);
        tally.note(&leaf, &fields, start, [1.0, random.ratio(1.5)]);
    }
    let mut exits = |n: usize, make: Make, decide: Leave| {
        for _ in 0..n {
            let exit = make(&mut random);
            let leaf = decide(&Corners::new(&exit.at), exit.root).unwrap();
            tally.note(&leaf, &exit.after, exit.start, exit.kappa);
        }
    };
    exits(SIDES, exit_side, leave_at_side);
    exits(FOLDS, exit_fold, leave_at_fold);
    exits(STABILITY, exit_stability, leave_where_unstable);
    let hit: Vec<&str> = tally.leaves.keys().copied().collect();
    assert_eq!(hit, LEAVES);
    for (leaf, counts) in tally.leaves {
        assert!(counts[0] >= 50, "{leaf} was hit {} times only", counts[0]);
    }
}

#[test]
fn trees_and_selection_agree() {
    let mut random = Random::new(20_223);
    for _ in 0..DECISIONS[0] {
        let (fields, mode) = entry(&mut random);
        let leaf = enter(&Corners::new(&fields), mode).unwrap();
        selection_agrees(&leaf, &fields, &face(mode), [1.0, random.ratio(1.5)]);
    }
    let kinds: [(ExitKind, Make, Leave); 3] = [
        (ExitKind::Side, exit_side, leave_at_side),
        (ExitKind::Fold, exit_fold, leave_at_fold),
        (ExitKind::Stability, exit_stability, leave_where_unstable),
    ];
    for (n, (kind, make, decide)) in DECISIONS[1..].iter().zip(kinds) {
        for _ in 0..*n {
            let exit = make(&mut random);
            let leaf = decide(&Corners::new(&exit.at), exit.root).unwrap();
            let incoming = Incoming::Exit {
                kind,
                lambda: exit.root.to_vec(),
                drift: None,
            };
            selection_agrees(&leaf, &exit.at, &incoming, exit.kappa);
        }
    }
}

/// Both surfaces reached at once from a region: a single attracting continuation is where the hidden dynamics leads, for
/// every scaling.
#[test]
fn corners_and_selection_agree() {
    let mut random = Random::new(20_222);
    let mut single = 0;
    for _ in 0..DECISIONS[4] {
        let mut values = random.normals::<8>();
        (values[0], values[1]) = (values[0].abs(), values[1].abs());
        let frame = random.frame();
        let fields = frame.fields(&NormalFields::new(2, values.to_vec()).unwrap());
        let (region, kappa) = (frame.of([-1, -1]), [1.0, random.ratio(1.5)]);
        let incoming = Incoming::Corner {
            region: region.to_vec(),
        };
        let found = resolve(&fields, &incoming, &kappa).unwrap();
        let f = fields.in_region(&region);
        let speeds = [0, 1].map(|i| f[i].abs() * kappa[i]);
        let slowest = speeds[0].min(speeds[1]);
        let start = [0, 1].map(|i| f64::from(region[i]) * speeds[i] / slowest);
        let outcome = limit_of_hidden_dynamics(&fields, &start, &kappa);
        assert_eq!(
            Some(&found.chosen),
            continuation(&outcome).as_ref(),
            "{fields:?}"
        );
        assert_eq!(found.unique, admissible(&fields).len() == 1, "{fields:?}");
        single += usize::from(found.unique);
    }
    assert!(
        2 * single > DECISIONS[4] && single < DECISIONS[4],
        "{single}"
    );
}

fn face(mode: [i8; 2]) -> Incoming {
    Incoming::Face {
        mode: mode.to_vec(),
        multipliers: Vec::new(),
    }
}

type Make = fn(&mut Random) -> Exit;
type Leave = fn(&Corners, [f64; 2]) -> Result<Leaf, Refused>;

/// Both outcomes of an ambiguous entry occur, one for each extreme of the scaling.
#[test]
fn ambiguous_entries_depend_on_the_scaling() {
    let mut random = Random::new(4);
    let mut found = 0;
    while found < 100 {
        let (fields, mode) = entry(&mut random);
        let resolution = enter(&Corners::new(&fields), mode).unwrap();
        if resolution.is_unique() {
            continue;
        }
        found += 1;
        let start = entry_state(&fields, mode);
        let outcome = |ratio: f64| {
            // Larger on the surface slid on before.
            let kappa = if mode[0] == 0 {
                [ratio, 1.0]
            } else {
                [1.0, ratio]
            };
            continuation(&limit_of_hidden_dynamics(&fields, &start, &kappa)).unwrap()
        };
        assert_eq!(outcome(3e3), resolution.candidates[0], "{fields:?}");
        assert_eq!(outcome(1.0 / 3e3), resolution.candidates[1], "{fields:?}");
    }
}

#[test]
fn all_frames_give_the_transformed_answer() {
    let mut random = Random::new(7);
    for _ in 0..3000 {
        let (fields, mode) = entry(&mut random);
        equivariant(&fields, |corners, frame| enter(corners, frame.of(mode)));
        let exit = exit_side(&mut random);
        equivariant(&exit.at, |c, frame| leave_at_side(c, frame.of(exit.root)));
        let exit = exit_fold(&mut random);
        equivariant(&exit.at, |c, frame| leave_at_fold(c, frame.of(exit.root)));
        let exit = exit_stability(&mut random);
        equivariant(&exit.at, |c, frame| {
            leave_where_unstable(c, frame.of(exit.root))
        });
    }
}

fn equivariant(fields: &NormalFields, decide: impl Fn(&Corners, Frame) -> Result<Leaf, Refused>) {
    let corners = Corners::new(fields);
    let here = decide(&corners, Frame::default()).unwrap();
    for frame in Frame::all() {
        let there = decide(&frame.corners(&corners), frame).unwrap();
        let seen = |c: &Continuation| match c.as_mode() {
            Some(mode) => Continuation::mode(&frame.of([mode.entries()[0], mode.entries()[1]])),
            None => Continuation::OutwardSpiral,
        };
        assert_eq!(
            there.chosen,
            here.chosen.as_ref().map(seen),
            "{fields:?} in {frame:?}"
        );
        assert_eq!(there.is_unique(), here.is_unique());
        assert_eq!(there.candidates.len(), here.candidates.len());
        assert!(here
            .candidates
            .iter()
            .all(|c| there.candidates.contains(&seen(c))));
    }
}

/// The rules for exits that need no normal frame, against those that do.
#[test]
fn exits_follow_the_rules_without_a_frame() {
    let mut random = Random::new(11);
    for _ in 0..20_000 {
        let exit = exit_side(&mut random);
        let jacobian = Bilinear::of_fields(&exit.at).jacobian(exit.root);
        let found = leave_at_side(&Corners::new(&exit.at), exit.root).unwrap();
        assert_eq!(found.chosen, Some(side_rule(jacobian, exit.root)));
        let exit = exit_fold(&mut random);
        let found = leave_at_fold(&Corners::new(&exit.at), exit.root).unwrap();
        assert_eq!(found.chosen, Some(fold_rule(&exit.at, exit.root)));
    }
}

/// Exit through lambda_i = e: k_j = 0 if G_jj < 0, else -e sign G_ji.
fn side_rule(jacobian: [[f64; 2]; 2], root: [f64; 2]) -> Continuation {
    let i = usize::from(root[1].abs() > root[0].abs());
    let (j, e) = (1 - i, root[i].signum() as i8);
    let mut k = [e, e];
    k[j] = match (jacobian[j][j] < 0.0, jacobian[j][i] > 0.0) {
        (true, _) => 0,
        (false, true) => -e,
        (false, false) => e,
    };
    Continuation::mode(&k)
}

/// The slow motion follows the curve with the negative diagonal entry, away from the other one.
fn fold_rule(fields: &NormalFields, root: [f64; 2]) -> Continuation {
    let bilinear = Bilinear::of_fields(fields);
    let [[g11, g12], [g21, g22]] = bilinear.jacobian(root);
    let [d1, d2] = [bilinear.rows()[0][3], bilinear.rows()[1][3]];
    let sign = |v: f64| if v > 0.0 { 1_i8 } else { -1 };
    let k = if g22 < 0.0 {
        let k1 = sign(g21 * (g12 * d2 - d1 * g22));
        [k1, -sign(g21 * g22) * k1]
    } else {
        let k2 = sign(g12 * (g21 * d1 - d2 * g11));
        [-sign(g11 * g12) * k2, k2]
    };
    let f = fields.in_region(&k);
    let returns = |i: usize| f64::from(k[i]) * f[i] < 0.0;
    if g22 < 0.0 && returns(1) {
        Continuation::mode(&[k[0], 0])
    } else if g11 < 0.0 && returns(0) {
        Continuation::mode(&[0, k[1]])
    } else {
        Continuation::mode(&k)
    }
}

fn entry_state(fields: &NormalFields, mode: [i8; 2]) -> [f64; 2] {
    let slid_on = usize::from(mode[0] != 0);
    let f = |side: i8| {
        let mut k = mode;
        k[slid_on] = side;
        fields.in_region(&k)[slid_on]
    };
    let mut start = mode.map(f64::from);
    start[slid_on] = (f(-1) + f(1)) / (f(-1) - f(1));
    start
}

fn continuation(outcome: &HiddenOutcome) -> Option<Continuation> {
    match outcome {
        HiddenOutcome::Region(mode) | HiddenOutcome::Sliding { mode, .. } => {
            Some(Continuation::Mode(mode.clone()))
        }
        HiddenOutcome::OutwardSpiral { .. } => Some(Continuation::OutwardSpiral),
        HiddenOutcome::AtRest | HiddenOutcome::Unknown => None,
    }
}

/// f_j^k = bias_j - k_j - k_i/4 with i the other surface: both attract unless the bias is large.
fn attracting(bias: [f64; 2]) -> NormalFields {
    let regions = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
    let f = |[p, q]: [f64; 2]| [bias[0] - p - 0.25 * q, bias[1] - q - 0.25 * p];
    NormalFields::new(2, regions.map(f).concat()).unwrap()
}

#[test]
fn frames_undo_themselves() {
    let v = [2.0, -3.0];
    let seen: Vec<[f64; 2]> = Frame::all().map(|frame| frame.of(v)).collect();
    assert!(
        (0..8).all(|i| (0..i).all(|j| seen[i] != seen[j])),
        "{seen:?}"
    );
    for frame in Frame::all() {
        assert_eq!(frame.back(frame.of(v)), v);
    }
}

/// g of the transformed fields at the transformed multipliers is the transformed g.
#[test]
fn fields_transform_as_vectors() {
    let values = vec![0.3, -1.0, 2.0, 0.7, -0.2, 1.5, 0.9, -0.4];
    let fields = NormalFields::new(2, values).unwrap();
    let lambda = [0.3, -0.8];
    let g = Bilinear::of_fields(&fields).value(lambda);
    for frame in Frame::all() {
        let seen = frame.fields(&fields);
        let found = Bilinear::of_fields(&seen).value(frame.of(lambda));
        let expected = frame.of(g);
        assert!(
            (0..2).all(|j| (found[j] - expected[j]).abs() < 1e-15),
            "{frame:?}"
        );
    }
}

#[test]
fn what_is_no_entry_is_refused() {
    let fields = attracting([0.2, 0.3]);
    assert_eq!(
        enter(&Corners::new(&fields), [0, -1]).unwrap().name,
        "E.A/root/trap"
    );
    // The second surface moves away: sliding does not reach it.
    let leaving = attracting([0.2, -1.5]);
    let refused = enter(&Corners::new(&leaving), [0, -1]).unwrap_err();
    assert_eq!(refused, Refused::NotArriving(1));
    // No sliding on the first surface.
    let crossing = attracting([1.5, 0.0]);
    let refused = enter(&Corners::new(&crossing), [0, -1]).unwrap_err();
    assert_eq!(refused, Refused::NotArriving(0));
    let refused = enter(&Corners::new(&crossing), [-1, 0]);
    assert!(refused.is_ok(), "{refused:?}");
}

#[test]
fn what_is_no_exit_is_refused() {
    let corners = Corners::new(&attracting([0.2, 0.3]));
    let inside = [0.2, 0.3];
    assert_eq!(leave_at_side(&corners, inside), Err(Refused::NotAnExit));
    assert_eq!(
        leave_where_unstable(&corners, inside),
        Err(Refused::NotAnExit)
    );
    // A double root with both diagonal entries positive was not stable before.
    let fields = NormalFields::new(2, vec![-3.0, -2.0, 0.0, 1.0, 0.0, -1.0, 3.0, 2.0]).unwrap();
    let corners = Corners::new(&fields);
    assert_eq!(leave_at_fold(&corners, [0.0, 0.0]), Err(Refused::NotAnExit));
}
