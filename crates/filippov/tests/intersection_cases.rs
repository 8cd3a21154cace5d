//! The 184 cases of `tests/data/switching_cases.json`: every leaf of every tree, with outcomes of an
//! independent implementation of the hidden dynamics for several scalings.
#![allow(clippy::unwrap_used)]

mod oracles;

use filippov::switching::{
    admissible, limit_of_hidden_dynamics, newton, resolve, Continuation, ExitKind, HiddenOutcome,
    Incoming, Lap, NormalFields, Resolution,
};
use oracles::{enter, leave_at_fold, leave_at_side, leave_where_unstable, Corners, Frame, Leaf};
use serde_json::Value;

#[test]
fn every_case_has_its_outcome() {
    let cases = cases();
    assert_eq!(cases.len(), 184);
    let failures: Vec<String> = cases.iter().filter_map(|case| check(case).err()).collect();
    assert!(
        failures.is_empty(),
        "{} failed:\n{}",
        failures.len(),
        failures.join("\n")
    );
}

/// Exchange of the surfaces and changes of sign transform the answer and nothing else.
#[test]
fn every_case_of_two_surfaces_has_the_same_outcome_in_all_frames() {
    let mut compared = 0;
    for case in cases() {
        let situation = case["situation"].as_str().unwrap();
        let fields = fields(&case["fields"]);
        if fields.m() != 2 || situation == "relay" || situation == "spiral-in" {
            continue;
        }
        let incoming = with_drift(incoming(&case));
        let here = resolve(&fields, &incoming, &[1.0, 1.0]).unwrap();
        for frame in Frame::all() {
            let seen = frame.fields(&fields);
            let there = resolve(&seen, &transformed(&incoming, frame), &[1.0, 1.0]).unwrap();
            let expected = seen_in(&here.chosen, frame);
            assert_eq!(there.chosen, expected, "{} in {frame:?}", case["id"]);
            assert_eq!(there.unique, here.unique, "{}", case["id"]);
            let expected: Vec<Continuation> =
                here.candidates.iter().map(|c| seen_in(c, frame)).collect();
            same_set("candidates", &there.candidates, &expected).unwrap();
            compared += 1;
        }
    }
    assert_eq!(compared, 8 * 144);
}

/// The direction in which the hidden dynamics starts where two solutions are equally good.
fn with_drift(incoming: Incoming) -> Incoming {
    match incoming {
        Incoming::Exit { kind, lambda, .. } => Incoming::Exit {
            kind,
            lambda,
            drift: Some(vec![0.3, -0.7]),
        },
        other => other,
    }
}

fn transformed(incoming: &Incoming, frame: Frame) -> Incoming {
    let signs = |v: &[i8]| frame.of([v[0], v[1]]).to_vec();
    let vector = |v: &[f64]| frame.of([v[0], v[1]]).to_vec();
    match incoming {
        Incoming::Corner { region } => Incoming::Corner {
            region: signs(region),
        },
        Incoming::Face { mode, .. } => Incoming::Face {
            mode: signs(mode),
            multipliers: Vec::new(),
        },
        Incoming::Exit {
            kind,
            lambda,
            drift,
        } => Incoming::Exit {
            kind: *kind,
            lambda: vector(lambda),
            drift: drift.as_deref().map(vector),
        },
        Incoming::Start => Incoming::Start,
    }
}

fn seen_in(continuation: &Continuation, frame: Frame) -> Continuation {
    match continuation.as_mode() {
        Some(mode) => Continuation::mode(&frame.of([mode.entries()[0], mode.entries()[1]])),
        None => Continuation::OutwardSpiral,
    }
}

fn cases() -> Vec<Value> {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/data/switching_cases.json"
    );
    let text = std::fs::read_to_string(path).unwrap();
    let whole: Value = serde_json::from_str(&text).unwrap();
    whole["cases"].as_array().unwrap().clone()
}

fn check(case: &Value) -> Result<(), String> {
    let id = case["id"].as_str().unwrap();
    let situation = case["situation"].as_str().unwrap();
    let verdict = match situation {
        "classical" | "codim1-exit" | "codim1-enter" | "corner-enter" | "codim2-enter-m3" => {
            decision_agrees(case).and_then(|()| references_agree(case))
        }
        "codim2-exit-a" | "codim2-exit-b" | "codim2-exit-c" => {
            exit_agrees(case).and_then(|()| references_agree(case))
        }
        "spiral-in" => lap_agrees(case),
        "relay" => relay_agrees(case),
        other => Err(format!("unknown situation {other}")),
    };
    let admissible = verdict.and_then(|()| admissible_agrees(case));
    admissible.map_err(|message| format!("{id}: {message}"))
}

/// Mode, uniqueness, candidates and multipliers; for entries into an intersection of two surfaces also the tree.
fn decision_agrees(case: &Value) -> Result<(), String> {
    let found = decided(case)?;
    let leaf = case["leaf"].as_str().unwrap();
    let expected = if leaf.starts_with("E.B/amb") {
        // The trees of the file stay; here the hidden dynamics at kappa = 1 decides.
        continuation(&case["reference"][0]["mode"]).unwrap()
    } else {
        multipliers_agree(&found, &case["lambda_out"])?;
        continuation(&case["expected"]).unwrap()
    };
    expect("mode", &found.chosen, &expected)?;
    expect("degenerate", &found.degenerate, &false)?;
    if leaf.starts_with("E.") {
        let mode = integers(&case["incoming"]);
        let corners = Corners::new(&fields(&case["fields"]));
        tree_agrees(&enter(&corners, [mode[0], mode[1]]).unwrap(), case)?;
    }
    if let ("codim1-enter" | "corner-enter", Some(attracting)) = (
        case["situation"].as_str().unwrap(),
        case["admissible"].as_array(),
    ) {
        // All that attract, also those that no scaling leads to.
        expect("unique", &found.unique, &(attracting.len() == 1))?;
        return same_candidates(&found.candidates, &case["admissible"]);
    }
    if case["situation"] == "codim2-enter-m3" {
        // The file lists what a few scalings lead to.
        let attracting = admissible(&fields(&case["fields"])).into_iter();
        let attracting: Vec<Continuation> = attracting.map(|one| one.continuation).collect();
        expect("unique", &found.unique, &(attracting.len() == 1))?;
        same_set("candidates", &found.candidates, &attracting)?;
        let listed = case["candidates"].as_array().unwrap().iter();
        let missing = listed
            .filter_map(continuation)
            .find(|one| !attracting.contains(one));
        return missing.map_or(Ok(()), |one| Err(format!("{one:?} is missing")));
    }
    expect("unique", &found.unique, &case["unique"].as_bool().unwrap())?;
    same_candidates(&found.candidates, &case["candidates"])
}

/// An exit, decided in its own fields; two-solution leaves by the candidates only.
fn exit_agrees(case: &Value) -> Result<(), String> {
    let found = decided(case)?;
    let leave = match case["situation"].as_str().unwrap() {
        "codim2-exit-a" => leave_at_side,
        "codim2-exit-b" => leave_at_fold,
        _ => leave_where_unstable,
    };
    let root = numbers(&case["root"]);
    let corners = Corners::new(&fields(&case["fields"]));
    tree_agrees(&leave(&corners, [root[0], root[1]]).unwrap(), case)?;
    expect("unique", &found.unique, &case["unique"].as_bool().unwrap())?;
    same_candidates(&found.candidates, &case["candidates"])?;
    expect("degenerate", &found.degenerate, &false)?;
    match continuation(&case["expected"]) {
        Some(expected) => {
            expect("mode", &found.chosen, &expected)?;
            multipliers_agree(&found, &case["lambda_out"])
        }
        None if found.candidates.contains(&found.chosen) => Ok(()),
        None => Err(format!("{:?} is no candidate", found.chosen)),
    }
}

fn tree_agrees(found: &Leaf, case: &Value) -> Result<(), String> {
    // A rotation by 180 degrees exchanges these two leaves of Figure 4.8.
    let mirrored = ["Xc8/up", "Xc8/down"];
    let leaf = case["leaf"].as_str().unwrap();
    if !(mirrored.contains(&leaf) && mirrored.contains(&found.name)) {
        expect("leaf", &found.name, &leaf)?;
    }
    expect(
        "tree unique",
        &found.is_unique(),
        &case["unique"].as_bool().unwrap(),
    )?;
    if let (Some(chosen), Some(expected)) = (&found.chosen, continuation(&case["expected"])) {
        expect("tree", chosen, &expected)?;
    }
    same_candidates(&found.candidates, &case["candidates"])
}

fn decided(case: &Value) -> Result<Resolution, String> {
    let fields = fields(&case["fields"]);
    let kappa = vec![1.0; fields.m()];
    resolve(&fields, &incoming(case), &kappa).map_err(|e| e.to_string())
}

fn incoming(case: &Value) -> Incoming {
    let mode = || integers(&case["incoming"]);
    let exit = |kind| Incoming::Exit {
        kind,
        lambda: numbers(&case["root"]),
        drift: None,
    };
    match case["situation"].as_str().unwrap() {
        "classical" | "corner-enter" => Incoming::Corner { region: mode() },
        "codim1-exit" => {
            let side = if case["leaf"] == "F4.2/minus" {
                -1.0
            } else {
                1.0
            };
            let fields = fields(&case["fields"]);
            // In the leaf "stay" it is seen in the fields which of them vanishes.
            let side = if fields.at(0)[0] == 0.0 { -1.0 } else { side };
            Incoming::Exit {
                kind: ExitKind::Side,
                lambda: vec![side],
                drift: Some(vec![case["rate"].as_f64().unwrap()]),
            }
        }
        "codim1-enter" | "codim2-enter-m3" => Incoming::Face {
            mode: mode(),
            multipliers: Vec::new(),
        },
        "codim2-exit-a" => exit(ExitKind::Side),
        "codim2-exit-b" => exit(ExitKind::Fold),
        "codim2-exit-c" => exit(ExitKind::Stability),
        other => panic!("{other} has no motion before"),
    }
}

/// The hidden dynamics per scaling.
fn references_agree(case: &Value) -> Result<(), String> {
    let Some(references) = case["reference"].as_array() else {
        return Ok(());
    };
    let after = &case["fields_after"];
    let fields = fields(if after.is_null() {
        &case["fields"]
    } else {
        after
    });
    let is_exit_c = case["situation"] == "codim2-exit-c";
    for (n, reference) in references.iter().enumerate() {
        let mut start = numbers(&case["start"]);
        if is_exit_c {
            // Two starts per scaling, beside the root.
            let angle: f64 = [0.7, 3.9][n % 2];
            start[0] += 1e-6 * angle.cos();
            start[1] += 1e-6 * angle.sin();
        }
        let outcome = limit_of_hidden_dynamics(&fields, &start, &numbers(&reference["kappa"]));
        let expected = continuation(&reference["mode"]);
        expect(&format!("reference {n}"), &of_outcome(&outcome), &expected)?;
        let kind = reference["kind"].as_str().unwrap();
        if let HiddenOutcome::Sliding {
            oscillates,
            multipliers,
            ..
        } = &outcome
        {
            expect(&format!("oscillation {n}"), oscillates, &(kind == "cycle"))?;
            let lambda = &reference["lambda"];
            if !lambda.is_null() && distance(multipliers, &numbers(lambda)) > 1e-9 {
                return Err(format!(
                    "reference {n}: lambda {multipliers:?}, expected {lambda}"
                ));
            }
        }
    }
    Ok(())
}

fn lap_agrees(case: &Value) -> Result<(), String> {
    let fields = fields(&case["fields"]);
    let lap = Lap::around(&fields, [-1, -1]).ok_or("the fields do not rotate")?;
    let close = |name: &str, a: f64, b: &Value| {
        let b = b.as_f64().unwrap();
        let same = (a - b).abs() <= 1e-14 * b.abs();
        same.then_some(())
            .ok_or(format!("{name} = {a}, expected {b}"))
    };
    close("gamma", lap.gamma, &case["gamma"])?;
    close("duration", lap.duration, &case["kappa_lap"])?;
    // From distance delta to the end of all laps.
    let length = case["delta"].as_f64().unwrap() / (1.0 - lap.gamma);
    close("time", length * lap.duration, &case["zeno_time"])?;
    for n in 0..4 {
        close("lap time", lap.times[n], &case["lap_times_per_delta"][n])?;
        let share = lap.times[n] / lap.duration;
        close("share", share, &case["zeno_weights"][n])?;
        expect(
            "region",
            &lap.regions[n].to_vec(),
            &integers(&case["regions"][n]),
        )?;
    }
    let root = newton(&fields, &numbers(&case["root"])).ok_or("no root")?;
    let off = distance(&root, &numbers(&case["root"]));
    (off < 1e-12)
        .then_some(())
        .ok_or(format!("root off by {off}"))
}

/// Relays by the hidden dynamics from u = 0, and by the decision at a start.
fn relay_agrees(case: &Value) -> Result<(), String> {
    let fields = fields(&case["fields"]);
    let m = fields.m();
    let expected = continuation(&case["expected"]);
    let multipliers: Vec<f64> = numbers(&case["s"])
        .into_iter()
        .filter(|s| s.abs() < 1.0 - 1e-9)
        .collect();
    for kappa in [
        vec![1.0; m],
        (0..m).map(|i| 7.0_f64.powi(i as i32)).collect(),
    ] {
        let outcome = limit_of_hidden_dynamics(&fields, &vec![0.0; m], &kappa);
        expect("limit", &of_outcome(&outcome), &expected)?;
    }
    let found = resolve(&fields, &Incoming::Start, &vec![1.0; m]).map_err(|e| e.to_string())?;
    expect("mode", &Some(found.chosen), &expected)?;
    expect("unique", &found.unique, &true)?;
    let off = distance(&found.multipliers, &multipliers);
    (off < 1e-8)
        .then_some(())
        .ok_or(format!("lambda off by {off}"))
}

fn admissible_agrees(case: &Value) -> Result<(), String> {
    for (fields_key, key) in [
        ("fields", "admissible"),
        ("fields_after", "admissible_after"),
    ] {
        let Some(expected) = case[key].as_array() else {
            continue;
        };
        let found = admissible(&fields(&case[fields_key]));
        let found: Vec<Continuation> = found.into_iter().map(|a| a.continuation).collect();
        let expected: Vec<Continuation> = expected.iter().filter_map(continuation).collect();
        same_set(key, &found, &expected)?;
    }
    Ok(())
}

fn multipliers_agree(found: &Resolution, expected: &Value) -> Result<(), String> {
    if expected.is_null() {
        return Ok(());
    }
    let expected = numbers(expected);
    let off = distance(&found.multipliers, &expected);
    (off < 1e-12).then_some(()).ok_or(format!(
        "lambda {:?}, expected {expected:?}",
        found.multipliers
    ))
}

fn same_candidates(found: &[Continuation], expected: &Value) -> Result<(), String> {
    let expected = expected.as_array().unwrap().iter();
    let expected: Vec<Continuation> = expected.filter_map(continuation).collect();
    same_set("candidates", found, &expected)
}

fn same_set(name: &str, found: &[Continuation], expected: &[Continuation]) -> Result<(), String> {
    let same = found.len() == expected.len() && expected.iter().all(|e| found.contains(e));
    same.then_some(())
        .ok_or(format!("{name} {found:?}, expected {expected:?}"))
}

fn expect<T: PartialEq + std::fmt::Debug>(
    name: &str,
    found: &T,
    expected: &T,
) -> Result<(), String> {
    (found == expected)
        .then_some(())
        .ok_or(format!("{name} {found:?}, expected {expected:?}"))
}

fn of_outcome(outcome: &HiddenOutcome) -> Option<Continuation> {
    match outcome {
        HiddenOutcome::Region(mode) | HiddenOutcome::Sliding { mode, .. } => {
            Some(Continuation::Mode(mode.clone()))
        }
        HiddenOutcome::OutwardSpiral { .. } => Some(Continuation::OutwardSpiral),
        HiddenOutcome::AtRest | HiddenOutcome::Unknown => None,
    }
}

fn continuation(value: &Value) -> Option<Continuation> {
    match value {
        Value::String(name) if name == "spiral-out" => Some(Continuation::OutwardSpiral),
        Value::Array(_) => Some(Continuation::mode(&integers(value))),
        _ => None,
    }
}

fn fields(value: &Value) -> NormalFields {
    let map = value.as_object().unwrap();
    let m = map.values().next().unwrap().as_array().unwrap().len();
    let mut values = vec![f64::NAN; m << m];
    for (pattern, components) in map {
        let signs = pattern.split(',').enumerate();
        let index: usize = signs.map(|(i, sign)| usize::from(sign == "1") << i).sum();
        values[index * m..(index + 1) * m].copy_from_slice(&numbers(components));
    }
    NormalFields::new(m, values).unwrap()
}

/// A vector, or one number.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(entries) => entries.iter().map(|v| v.as_f64().unwrap()).collect(),
        _ => vec![value.as_f64().unwrap()],
    }
}

fn integers(value: &Value) -> Vec<i8> {
    let entries = value.as_array().unwrap().iter();
    entries.map(|v| v.as_i64().unwrap() as i8).collect()
}

/// Largest difference; infinite if the lengths differ.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    a.iter().zip(b).fold(0.0, |m, (x, y)| m.max((x - y).abs()))
}
