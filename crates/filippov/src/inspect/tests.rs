//! Points whose answer is known.

use super::{classify, hidden_dynamics, intersection_field, Inspection, PointKind};
use crate::cube::NormalFields;
use crate::switching::HiddenOutcome;
use crate::{ClosureSystem, Mode};

/// x' = bias - 2 sign(x) componentwise, with z' = 1 - product of the signs.
fn relays(bias: [f64; 2]) -> impl crate::PiecewiseSystem {
    ClosureSystem::new(
        3,
        2,
        move |_, _, s, dx| {
            dx[0] = bias[0] - 2.0 * s[0];
            dx[1] = bias[1] - 2.0 * s[1];
            dx[2] = 1.0 - s[0] * s[1];
        },
        |_, x, h| h.copy_from_slice(&x[..2]),
    )
}

fn kind(bias: [f64; 2], x: [f64; 3]) -> Option<(PointKind, String)> {
    kind_within(0.0, bias, x)
}

fn kind_within(reach: f64, bias: [f64; 2], x: [f64; 3]) -> Option<(PointKind, String)> {
    let point = classify(
        &relays(bias),
        0.0,
        &x,
        Inspection {
            reach,
            ..Inspection::default()
        },
    )
    .ok()
    .flatten()?;
    let mode = point
        .mode
        .map_or_else(|| "none".into(), |mode| mode.to_string());
    Some((point.kind, mode))
}

#[test]
fn kinds_of_points() {
    let found = |kind, mode: &str| Some((kind, mode.to_string()));
    let inside = [0.5, 1.0];
    assert_eq!(
        kind(inside, [1.0, -1.0, 0.0]),
        found(PointKind::Region, "+-")
    );
    assert_eq!(
        kind(inside, [0.0, -1.0, 0.0]),
        found(PointKind::Sliding, "0-")
    );
    assert_eq!(
        kind([3.0, 1.0], [0.0, -1.0, 0.0]),
        found(PointKind::Crossing, "+-")
    );
    assert_eq!(
        kind(inside, [0.0, 0.0, 5.0]),
        found(PointKind::Intersection, "00")
    );
    let near = [1e-13, -1.0, 0.0];
    assert_eq!(kind(inside, near), found(PointKind::Region, "+-"));
    assert_eq!(
        kind_within(1e-12, inside, near),
        found(PointKind::Sliding, "0-")
    );
    assert_eq!(kind(inside, [f64::NAN, 0.0, 5.0]), None);
}

#[test]
fn field_of_an_intersection() {
    let (system, mode) = (relays([0.5, 1.0]), Mode::new(vec![0, 0]));
    let value =
        intersection_field(&system, (0.0, &[0.0; 3]), &[], &mode, &[]).expect("does not raise");
    let value = value.expect("slides");
    assert_eq!(value.multipliers, [0.25, 0.5]);
    assert_eq!(value.dx, [0.0, 0.0, 1.0 - 0.125]);
}

#[test]
fn hidden_dynamics_of_two_attractive_surfaces() {
    let fields = NormalFields::new(2, vec![1.5, 1.0, -0.5, 1.0, 1.5, -1.0, -0.5, -1.0]);
    let fields = fields.expect("fits");
    let before = Mode::new(vec![0, -1]);
    let found = hidden_dynamics(&fields, Some(&before), &[1.0, 1.0]);
    assert_eq!(found.incoming, Some(vec![0.5, -1.0]));
    assert_eq!(found.roots.len(), 1);
    assert!(found.roots[0].is_stable);
    let Some(HiddenOutcome::Sliding { multipliers, .. }) = found.outcome else {
        panic!("slides")
    };
    for (found, exact) in multipliers.iter().zip([0.5, 0.0]) {
        assert!((found - exact).abs() < 1e-15);
    }
}
