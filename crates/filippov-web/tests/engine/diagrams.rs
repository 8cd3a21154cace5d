//! Sections and diagrams.

use super::models::{ask, oscillator};

const PERIOD: f64 = 6.0 * std::f64::consts::PI;

#[test]
fn returns_at_the_period_of_the_force() {
    let request = format!(
        r#"{{"kind": "section", "section": {{"period": {PERIOD}}}, "skip": 20, "count": 2, "t_span": [0, 1000]}}"#
    );
    let reply = ask(&oscillator(), &request);
    assert_eq!(reply.header["reason"], "returned");
    assert_eq!(reply.header["returns"], 22);
    assert!((reply.array("y")[3] - 0.3570302433858536).abs() < 1e-5);
    assert!((reply.array("t")[0] - 21.0 * PERIOD).abs() < 1e-9);
}

#[test]
fn returns_to_a_surface_and_to_a_value() {
    let model = oscillator();
    let run = ask(&model, r#"{"kind": "run"}"#);
    let switches = run.header["switches"].as_array().unwrap();
    let arrivals = switches.iter().filter(|s| s["from"] != "0");
    let times: Vec<f64> = arrivals.map(|s| s["t"].as_f64().unwrap()).collect();
    let reply = ask(
        &model,
        r#"{"kind": "section", "section": {"surface": "v"}}"#,
    );
    assert_eq!(reply.array("t"), times);
    let request = r#"{"kind": "section", "section": {"state": "y", "value": 0.5, "direction": 1}}"#;
    let reply = ask(&model, request);
    assert!(!reply.array("t").is_empty());
    for y in reply.array("y").chunks_exact(2) {
        assert!((y[0] - 0.5).abs() < 1e-12 && y[1] > 0.0, "{y:?}");
    }
}

#[test]
fn a_diagram_has_the_returns_of_each_value() {
    let model = oscillator();
    let common = format!(r#""section": {{"period": {PERIOD}}}, "skip": 10, "count": 3"#);
    let request = format!(
        r#"{{"kind": "diagram", {common}, "parameter": "F", "values": [0.1, 0.4, 0.7], "coordinate": "v"}}"#
    );
    let reply = ask(&model, &request);
    assert_eq!(reply.header["done"], 3);
    assert_eq!(reply.header["status"], serde_json::json!([1, 1, 1]));
    assert_eq!(
        reply.array("index"),
        [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0]
    );
    assert_eq!(reply.array("value")[3..6], [0.4; 3]);
    let request =
        format!(r#"{{"kind": "section", {common}, "t_span": [0, 1000], "params": {{"F": 0.7}}}}"#);
    let alone = ask(&model, &request);
    let alone: Vec<f64> = alone
        .array("y")
        .iter()
        .skip(1)
        .step_by(2)
        .copied()
        .collect();
    assert_eq!(reply.array("y")[6..], alone);
}

#[test]
fn a_diagram_carries_its_state_on() {
    let model = oscillator();
    let request = format!(
        r#"{{"kind": "diagram", "section": {{"period": {PERIOD}}}, "skip": 0, "count": 1,
            "parameter": "F", "values": [0.4, 0.4, 0.4], "coordinate": 1, "carry": true}}"#
    );
    let carried = ask(&model, &request);
    let request = format!(
        r#"{{"kind": "section", "section": {{"period": {PERIOD}}}, "count": 3, "t_span": [0, 100]}}"#
    );
    let one_run = ask(&model, &request);
    let one_run = one_run.array("y").iter().skip(1).step_by(2);
    for (carried, one_run) in carried.array("y").iter().zip(one_run) {
        assert!((carried - one_run).abs() < 1e-6, "{carried} {one_run}");
    }
}

#[test]
fn the_next_request_goes_on_where_the_last_one_ended() {
    let model = oscillator();
    let diagram = |section: &str, from: f64, start: &[f64], values: &[f64]| {
        let until = from + 200.0;
        let request = format!(
            r#"{{"kind": "diagram", "section": {section}, "count": 2, "t_span": [{from}, {until}], "y0": {start:?},
                "parameter": "F", "values": {values:?}, "coordinate": 0, "carry": true}}"#
        );
        ask(&model, &request)
    };
    for section in [&format!(r#"{{"period": {PERIOD}}}"#), r#"{"surface": "v"}"#] {
        let whole = diagram(section, 0.0, &[1.0, 2.0], &[0.4, 0.3, 0.2]);
        let first = diagram(section, 0.0, &[1.0, 2.0], &[0.4, 0.3]);
        let t = first.header["t"].as_f64().unwrap();
        let second = diagram(section, t, first.array("end"), &[0.2]);
        assert_eq!(whole.array("y")[..4], *first.array("y"));
        assert_eq!(whole.array("y")[4..], *second.array("y"));
        assert_eq!(whole.array("end"), second.array("end"));
    }
}

#[test]
fn a_value_that_fails_is_a_gap_with_its_reason() {
    let request = format!(
        r#"{{"kind": "diagram", "section": {{"period": {PERIOD}}}, "count": 2, "max_steps": 3,
            "parameter": 0, "values": [0.4]}}"#
    );
    let reply = ask(&oscillator(), &request);
    assert_eq!(reply.header["status"], serde_json::json!([-1]));
    let message = reply.header["messages"][0]["message"].as_str().unwrap();
    assert!(message.contains("max_steps"), "{message}");
}
