//! Phase planes.

use super::models::{ask, ball, friction, oscillator, quadratic_drag, sliding, two_nodes, Reply};

fn parts(reply: &Reply, kind: &str) -> Vec<Vec<[f64; 2]>> {
    let all = reply.header["parts"].as_array().unwrap().iter();
    let points = reply.array("points");
    all.filter(|part| part["kind"] == kind)
        .map(|part| {
            let first = part["first"].as_u64().unwrap() as usize;
            let last = part["last"].as_u64().unwrap() as usize;
            let of_part = points[2 * first..2 * last + 2].chunks_exact(2);
            of_part.map(|point| [point[0], point[1]]).collect()
        })
        .collect()
}

#[test]
fn sticking_ends_where_the_spring_is_as_strong_as_friction() {
    let request = r#"{"kind": "portrait", "box": [-2, 2.1, -1, 1.3], "cells": 30}"#;
    let reply = ask(&friction(), request);
    let attracting = parts(&reply, "attracting");
    assert_eq!(attracting.len(), 1);
    let (first, last) = (attracting[0][0], attracting[0][attracting[0].len() - 1]);
    let ends = [first[0].min(last[0]), first[0].max(last[0])];
    // The normal components are linear along the surface, so the tangencies are exact.
    assert!(
        (ends[0] + 0.5).abs() < 1e-12 && (ends[1] - 0.5).abs() < 1e-12,
        "{ends:?}"
    );
    assert!(attracting[0].iter().all(|point| point[1].abs() < 1e-9));
    assert_eq!(parts(&reply, "crossing").len(), 2);
    // The whole sliding segment is at rest: no equilibrium is isolated.
    assert_eq!(reply.header["equilibria"], serde_json::json!([]));
    let field = reply.array("field");
    assert_eq!(field.len(), 4 * 400);
    for arrow in field.chunks_exact(4) {
        let [y, v, dy, dv] = *arrow else {
            unreachable!()
        };
        assert_eq!(dy, v);
        assert!((dv + y + 0.5 * v.signum()).abs() < 1e-12);
    }
}

#[test]
fn a_pseudo_equilibrium_is_found_with_its_stability() {
    let request = r#"{"kind": "portrait", "box": [-4, 4, -2, 2]}"#;
    let reply = ask(&sliding(), request);
    let found = reply.header["equilibria"].as_array().unwrap();
    let on_surface: Vec<_> = found.iter().filter(|e| e["surfaces"][0] == "y").collect();
    assert_eq!(on_surface.len(), 1, "{found:?}");
    // lambda = a = 1/4, and b - x - 2 lambda = 0.
    let at = &on_surface[0]["y"];
    assert!((at[0].as_f64().unwrap() - 0.5).abs() < 1e-9, "{at}");
    assert!(at[1].as_f64().unwrap().abs() < 1e-9);
    // Along the surface x' = a - lambda = a - (b - x) / 2 grows with x.
    assert_eq!(on_surface[0]["stable"], false);
    assert_eq!(on_surface[0]["admissible"], true);
}

#[test]
fn equilibria_on_a_kink_are_those_of_both_sides() {
    let request = r#"{"kind": "portrait", "box": [-2, 2, -2, 2]}"#;
    let reply = ask(&quadratic_drag(), request);
    let found = reply.header["equilibria"].as_array().unwrap();
    let mut known: Vec<_> = found
        .iter()
        .map(|e| (e["y"][0].as_f64().unwrap(), &e["stable"], &e["admissible"]))
        .collect();
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert_eq!(known.len(), 3, "{found:?}");
    for ((x, stable, admissible), expected) in known.into_iter().zip([-1.0, 0.0, 1.0]) {
        assert!((x - expected).abs() < 1e-9);
        // Linear terms do not decide about the centres.
        let decided = serde_json::json!((expected == 0.0).then_some(false));
        assert_eq!((stable, admissible), (&decided, &serde_json::json!(true)));
    }
}

#[test]
fn equilibria_of_regions_are_admissible_or_virtual() {
    let request = r#"{"kind": "portrait", "box": [-2, 2, -1.5, 1], "cells": 16}"#;
    let reply = ask(&two_nodes(), request);
    let found = reply.header["equilibria"].as_array().unwrap();
    let nodes: Vec<_> = found
        .iter()
        .filter(|e| e["surfaces"] == serde_json::json!([]))
        .collect();
    assert_eq!(nodes.len(), 2, "{found:?}");
    for node in nodes {
        assert!((node["y"][0].as_f64().unwrap().abs() - 1.0).abs() < 1e-9);
        assert_eq!(
            (&node["stable"], &node["admissible"]),
            (&true.into(), &true.into())
        );
    }
    // Between them x = 0 repels.
    assert_eq!(parts(&reply, "repelling").len(), 1);
    let middle: Vec<_> = found.iter().filter(|e| e["surfaces"][0] == "x").collect();
    assert_eq!(middle.len(), 1);
    assert_eq!(middle[0]["stable"], false);
}

#[test]
fn a_forced_field_has_no_equilibria_and_says_so() {
    let reply = ask(
        &oscillator(),
        r#"{"kind": "portrait", "box": [-2, 2, -2, 2], "t": 1}"#,
    );
    assert_eq!(reply.header["equilibria"], serde_json::json!([]));
    assert!(reply.header["note"].as_str().unwrap().contains("time"));
}

#[test]
fn a_surface_with_an_impact_is_no_matter_of_fields() {
    let request = r#"{"kind": "portrait", "box": [-1, 1, -1, 1], "cells": 7}"#;
    let reply = ask(&ball(), request);
    assert_eq!(parts(&reply, "unknown").len(), 1);
    assert_eq!(reply.header["parts"].as_array().unwrap().len(), 1);
}
