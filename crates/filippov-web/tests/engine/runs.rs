//! Descriptions, runs and samples.

use super::models::{ask, ball, oscillator, stiffening, Reply};
use filippov_web::Model;

#[test]
fn a_model_describes_itself() {
    let header = ask(&oscillator(), r#"{"kind": "describe"}"#).header;
    assert_eq!(header["n"], 2);
    assert_eq!(header["states"], serde_json::json!(["y", "v"]));
    let params = serde_json::json!([{"name": "F", "value": 0.4}]);
    assert_eq!(header["params"], params);
    assert_eq!(header["surfaces"], serde_json::json!(["v"]));
    assert_eq!(header["page"]["title"], "friction");
    let header = ask(&ball(), r#"{"kind": "describe"}"#).header;
    assert_eq!(header["actions"], serde_json::json!(["impact"]));
}

#[test]
fn the_friction_oscillator_sticks_and_slips() {
    let reply = ask(
        &oscillator(),
        r#"{"kind": "run", "t_span": [0, 188.49555921538757]}"#,
    );
    let switches = reply.header["switches"].as_array().unwrap();
    assert_eq!(switches.len(), 42);
    let sticks = switches.iter().filter(|s| s["kind"] == "enter_sliding");
    assert_eq!(sticks.count(), 20);
    assert_eq!(reply.header["status"], 0);
    for (k, switch) in switches.iter().enumerate() {
        assert_eq!(switch["surfaces"], serde_json::json!(["v"]));
        let piece = &reply.header["pieces"][k + 1];
        assert_eq!(switch["to"], piece["mode"], "switch {k}");
    }
}

/// The pieces tile the span, have two points each at least, and the polyline stays near the states in between.
fn check_curve(model: &Model, reply: &Reply, span: &str, tolerance: f64) -> usize {
    let (t, y) = (reply.array("t"), reply.array("y"));
    let n = y.len() / t.len();
    let pieces = reply.header["pieces"].as_array().unwrap();
    let mut expected_first = 0;
    for piece in pieces {
        let first = piece["first"].as_u64().unwrap() as usize;
        let last = piece["last"].as_u64().unwrap() as usize;
        assert_eq!(first, expected_first);
        assert!(last > first, "{piece}");
        expected_first = last + 1;
    }
    assert_eq!(expected_first, t.len());
    let extents: Vec<f64> = (0..n)
        .map(|i| {
            let values = || y.iter().skip(i).step_by(n);
            let high = values().fold(f64::NEG_INFINITY, |a, &b| a.max(b));
            high - values().fold(f64::INFINITY, |a, &b| a.min(b))
        })
        .collect();
    // Uneven places, so that they are none that the engine tries itself.
    let (mut times, mut at) = (Vec::new(), Vec::new());
    for k in 1..t.len() {
        for share in [0.13, 0.37, 0.61, 0.91] {
            let time = t[k - 1] + share * (t[k] - t[k - 1]);
            if t[k - 1] < time && time < t[k] {
                times.push(time);
                at.push((k, share));
            }
        }
    }
    let request =
        format!(r#"{{"kind": "sample", "t_span": {span}, "y0": [1, 2], "times": {times:?}}}"#);
    let exact = ask(model, &request);
    assert_eq!(exact.array("t"), times);
    for ((k, share), exact) in at.into_iter().zip(exact.array("y").chunks_exact(n)) {
        for i in 0..n {
            let (from, to) = (y[(k - 1) * n + i], y[k * n + i]);
            let distance = (from + share * (to - from) - exact[i]).abs();
            assert!(
                distance <= 1.05 * tolerance * extents[i],
                "state {i} between points {} and {k}: {distance:e}",
                k - 1
            );
        }
    }
    t.len()
}

#[test]
fn the_curve_is_within_the_tolerance() {
    let model = oscillator();
    let mut counts = Vec::new();
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let request = format!(r#"{{"kind": "run", "tolerance": {tolerance}}}"#);
        let reply = ask(&model, &request);
        counts.push(check_curve(&model, &reply, "[0, 60]", tolerance));
    }
    // The error of chords falls with the square of their lengths: over two digits their number would be ten times as
    // large, but for the ends of steps, which are there at any tolerance.
    assert!(counts.is_sorted(), "{counts:?}");
    assert!(counts[2] > 6 * counts[0], "{counts:?}");
    assert!(counts[1] < 600, "{counts:?}");
}

#[test]
fn a_run_of_ten_thousand_segments_is_within_it_too() {
    let model = stiffening();
    let request = r#"{"kind": "run", "t_span": [0, 32000], "y0": [1, 2], "tolerance": 0.01}"#;
    let reply = ask(&model, request);
    let pieces = reply.header["pieces"].as_array().unwrap().len();
    assert!(pieces > 10_000, "{pieces}");
    let count = check_curve(&model, &reply, "[0, 32000]", 0.01);
    assert!(count < 20 * pieces, "{count} points for {pieces} pieces");
}

#[test]
fn samples_are_those_of_the_run() {
    let model = oscillator();
    let run = ask(&model, r#"{"kind": "run"}"#);
    let t = run.array("t");
    let (first, last) = (t[0], t[t.len() - 1]);
    let request = format!(r#"{{"kind": "sample", "times": [{first}, {last}]}}"#);
    let sample = ask(&model, &request);
    let y = run.array("y");
    assert_eq!(sample.array("y")[..2], y[..2]);
    assert_eq!(sample.array("y")[2..], y[y.len() - 2..]);
    let end: Vec<f64> = serde_json::from_value(run.header["end"].clone()).unwrap();
    assert_eq!(end, y[y.len() - 2..]);
}

#[test]
fn an_action_is_in_the_table_with_both_states() {
    let reply = ask(
        &ball(),
        r#"{"kind": "run", "t_span": [0, 5], "y0": [1, 0], "params": {"e": 0.6}}"#,
    );
    let switches = reply.header["switches"].as_array().unwrap();
    let first = &switches[0];
    assert_eq!(
        (&first["kind"], &first["note"]),
        (&"reset".into(), &"impact".into())
    );
    let (before, after) = (&first["before"][1], &first["y"][1]);
    let ratio = after.as_f64().unwrap() / before.as_f64().unwrap();
    assert!((ratio + 0.6).abs() < 1e-12);
    assert_eq!(switches.last().unwrap()["kind"], "accumulation");
}

#[test]
fn a_run_that_is_cut_short_has_its_beginning() {
    let reply = ask(&oscillator(), r#"{"kind": "run", "max_steps": 5}"#);
    assert_eq!(
        (&reply.header["status"], &reply.header["reason"]),
        (&(-1).into(), &"max_steps".into())
    );
    assert_eq!(reply.header["success"], false);
    let t = reply.array("t");
    assert!(t[t.len() - 1] < 60.0 && t[t.len() - 1] > 0.0);
}
