//! Requests and models that are refused, by name.

use super::models::{oscillator, Reply};
use filippov_web::{answer, pack, Model};

fn refused(request: &str) -> String {
    let reply = Reply::new(&answer(&oscillator(), request.as_bytes()));
    assert_eq!(reply.header["ok"], false, "{request}: {}", reply.header);
    reply.header["error"].as_str().unwrap().to_owned()
}

#[test]
fn what_is_wrong_is_named() {
    let cases = [
        ("{", "no JSON"),
        ("[]", "JSON object"),
        ("{}", "kind: is missing"),
        (r#"{"kind": "dance"}"#, "describe, run"),
        (r#"{"kind": "run", "y0": [1]}"#, "y0: 2 numbers"),
        (
            r#"{"kind": "run", "y0": [1, "2"]}"#,
            "y0: a list of finite numbers",
        ),
        (r#"{"kind": "run", "t_span": [0]}"#, "t_span: 2 numbers"),
        (r#"{"kind": "run", "t_span": [1, 0]}"#, "t_span[1]"),
        (
            r#"{"kind": "run", "params": {"G": 1}}"#,
            "params.G: no such parameter; there are F",
        ),
        (r#"{"kind": "run", "params": {"F": null}}"#, "params.F"),
        (r#"{"kind": "run", "params": [1]}"#, "params: an object"),
        (r#"{"kind": "run", "rtol": -1}"#, "rtol"),
        (
            r#"{"kind": "run", "method": "RK45"}"#,
            "method: \"RK45\" is none of auto",
        ),
        (
            r#"{"kind": "run", "max_steps": 1.5}"#,
            "max_steps: a whole number",
        ),
        (r#"{"kind": "run", "tolerance": 0}"#, "tolerance"),
        (r#"{"kind": "sample"}"#, "times: is missing"),
        (
            r#"{"kind": "sample", "times": [61]}"#,
            "times: 61 is outside",
        ),
        (r#"{"kind": "section"}"#, "section: is missing"),
        (
            r#"{"kind": "section", "section": {}}"#,
            "section: give a surface",
        ),
        (
            r#"{"kind": "section", "section": {"surface": "w"}}"#,
            "section.surface: \"w\" is none of v",
        ),
        (
            r#"{"kind": "section", "section": {"surface": 1}}"#,
            "section.surface: 1 is none of v",
        ),
        (
            r#"{"kind": "section", "section": {"period": 0}}"#,
            "section.period: must be positive",
        ),
        (
            r#"{"kind": "diagram", "section": {"period": 1}}"#,
            "parameter: is missing",
        ),
        (r#"{"kind": "portrait"}"#, "box: is missing"),
        (r#"{"kind": "portrait", "box": [1, 0, 0, 1]}"#, "box: [x0"),
        (
            r#"{"kind": "portrait", "box": [0, 1, 0, 1], "axes": [0, 0]}"#,
            "axes: two different",
        ),
        (
            r#"{"kind": "basins", "box": [0, 1, 0, 1], "targets": [[1]]}"#,
            "targets",
        ),
    ];
    for (request, part) in cases {
        let error = refused(request);
        assert!(error.contains(part), "{request}: {error}");
    }
}

#[test]
fn damaged_models_and_pages_are_refused() {
    let refusal = |bytes: &[u8]| Model::from_bytes(bytes).err().unwrap().text;
    assert!(!refusal(b"").is_empty());
    assert!(!refusal(&[0; 100]).is_empty());
    assert!(pack(b"FLP", "{}").is_err());
}

#[test]
fn any_bytes_get_a_reply() {
    let model = oscillator();
    let whole = br#"{"kind":"run","y0":[1,2],"t_span":[0,1],"params":{"F":0.4},"max_steps":50}"#;
    for cut in 0..whole.len() {
        let reply = Reply::new(&answer(&model, &whole[..cut]));
        assert_eq!(reply.header["ok"], false, "{cut}");
        let mut changed = whole.to_vec();
        changed[cut] = b'9';
        assert!(Reply::new(&answer(&model, &changed)).header["ok"].is_boolean());
    }
}
