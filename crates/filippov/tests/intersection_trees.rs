//! The decision trees of two surfaces against the hidden dynamics, on 10^5 random sets of fields.
#![allow(clippy::unwrap_used)]

mod random_fields;

use std::collections::BTreeMap;

use filippov::switching::codim2::{
    enter, leave_at_fold, leave_at_side, leave_where_unstable, Bilinear, Corners, Frame,
};
use filippov::switching::{
    limit_of_hidden_dynamics, Continuation, HiddenOutcome, NormalFields, Resolution, Undecided,
};
use random_fields::{entry, exit_fold, exit_side, exit_stability, Exit, Random};

const ENTRIES: usize = 70_000;
const SIDES: usize = 16_000;
const FOLDS: usize = 4_000;
const STABILITY: usize = 10_000;

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
    fn note(
        &mut self,
        resolution: &Resolution,
        fields: &NormalFields,
        start: [f64; 2],
        kappa: [f64; 2],
    ) {
        let outcome = limit_of_hidden_dynamics(fields, &start, &kappa);
        let found = continuation(&outcome);
        let counts = self.leaves.entry(resolution.leaf).or_default();
        counts[0] += 1;
        if found != resolution.chosen {
            let is_candidate = found.is_some_and(|found| resolution.candidates.contains(&found));
            assert!(
                is_candidate && !resolution.unique,
                "{outcome:?} against {resolution:?}, {fields:?} from {start:?}, kappa {kappa:?}"
            );
            counts[1] += 1;
        }
    }
}

#[test]
fn trees_and_hidden_dynamics_agree() {
    let mut random = Random::new(20_221);
    let mut tally = Tally::default();
    for _ in 0..ENTRIES {
        let (fields, mode) = entry(&mut random);
        let resolution = enter(&Corners::new(&fields).unwrap(), mode).unwrap();
        let start = entry_state(&fields, mode);
        tally.note(&resolution, &fields, start, [1.0, random.ratio(1.5)]);
    }
    let mut exits = |n: usize, make: fn(&mut Random) -> Exit, decide: Leave| {
        for _ in 0..n {
            let exit = make(&mut random);
            let resolution = decide(&Corners::new(&exit.at).unwrap(), exit.root).unwrap();
            tally.note(&resolution, &exit.after, exit.start, exit.kappa);
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

type Leave = fn(&Corners, [f64; 2]) -> Result<Resolution, Undecided>;

/// Both outcomes of an ambiguous entry occur, one for each extreme of the scaling.
#[test]
fn ambiguous_entries_depend_on_the_scaling() {
    let mut random = Random::new(4);
    let mut found = 0;
    while found < 100 {
        let (fields, mode) = entry(&mut random);
        let resolution = enter(&Corners::new(&fields).unwrap(), mode).unwrap();
        if resolution.unique {
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

fn equivariant(
    fields: &NormalFields,
    decide: impl Fn(&Corners, Frame) -> Result<Resolution, Undecided>,
) {
    let corners = Corners::new(fields).unwrap();
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
        assert_eq!(there.unique, here.unique);
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
        let found = leave_at_side(&Corners::new(&exit.at).unwrap(), exit.root).unwrap();
        assert_eq!(found.chosen, Some(side_rule(jacobian, exit.root)));
        let exit = exit_fold(&mut random);
        let found = leave_at_fold(&Corners::new(&exit.at).unwrap(), exit.root).unwrap();
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
