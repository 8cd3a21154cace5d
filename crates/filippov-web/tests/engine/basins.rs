//! Basins.

use super::models::{ask, two_nodes};

#[test]
fn every_cell_has_the_label_of_its_end() {
    let request =
        r#"{"kind": "basins", "box": [-2, 2, -1, 1], "cells": 8, "t_span": [0, 40], "y0": [0, 0]}"#;
    let reply = ask(&two_nodes(), request);
    let label = reply.array("label");
    assert_eq!(
        reply.header["arrays"]["label"][1],
        serde_json::json!([8, 8])
    );
    for row in label.chunks_exact(8) {
        assert_eq!(row[..4], [0.0; 4]);
        assert_eq!(row[4..], [1.0; 4]);
    }
    let labels = reply.header["labels"].as_array().unwrap();
    assert_eq!(labels.len(), 2);
    assert!(
        labels[0].as_str().unwrap().contains("x = -1.0000"),
        "{labels:?}"
    );
}

#[test]
fn targets_name_the_labels() {
    let request = r#"{"kind": "basins", "box": [-2, 2, -1, 1], "cells": 4, "t_span": [0, 40], "y0": [0, 0],
        "targets": [[1, 0], [-1, 0]]}"#;
    let reply = ask(&two_nodes(), request);
    for row in reply.array("label").chunks_exact(4) {
        assert_eq!(*row, [1.0, 1.0, 0.0, 0.0]);
    }
}

#[test]
fn a_cell_whose_run_fails_has_no_label() {
    let request = r#"{"kind": "basins", "box": [-2, 2, -1, 1], "cells": 3, "t_span": [0, 40], "y0": [0, 0],
        "max_steps": 1}"#;
    let reply = ask(&two_nodes(), request);
    assert!(reply.array("label").iter().all(|&label| label == -1.0));
    assert_eq!(reply.header["failed"], 9);
}
