//! The decision where both fields are tangent to one surface.
#![allow(clippy::unwrap_used)]

use filippov::switching::{decide, Arrival, Decision};
use filippov::{ClosureSystem, Place};

use Arrival::{Region, Start};

/// A two-fold at the origin of h = x: f- = (y, p, r) and f+ = (z, q, s), so that the second
/// derivatives of h along the fields are L-L-h = p, L+L-h = q, L-L+h = r, L+L+h = s.
fn two_fold(p: f64, q: f64, r: f64, s: f64, arrival: Arrival) -> Decision {
    let system = ClosureSystem::new(
        3,
        1,
        move |_t, x, signs, dx| {
            let field = if signs[0] > 0.0 {
                [x[2], q, s]
            } else {
                [x[1], p, r]
            };
            dx.copy_from_slice(&field);
        },
        |_t, x, h| h[0] = x[0],
    );
    decide(&system, 0, arrival, &Place::new(0.0, &[0.0; 3], &[1.0])).unwrap()
}

#[test]
fn two_folds() {
    // Invisible from both sides and attracting along every mixture: sliding begins.
    assert_eq!(two_fold(1.0, 0.5, -0.5, -1.0, Start).candidates[..], [0]);
    // Visible from both sides: two ways out, kept to where it comes from.
    let away = two_fold(-1.0, 0.5, -0.5, 1.0, Region(-1));
    assert_eq!(
        (away.entry, away.candidates.as_slice()),
        (-1, [-1, 1].as_slice())
    );
    assert_eq!(two_fold(-1.0, 0.5, -0.5, 1.0, Region(1)).entry, 1);
    // Visible from one side: that side.
    assert_eq!(
        two_fold(-1.0, -0.5, -0.5, -1.0, Region(-1)).candidates[..],
        [-1]
    );
    assert_eq!(two_fold(1.0, 0.5, 0.5, 1.0, Region(1)).candidates[..], [1]);
    // Invisible, but the mixture that keeps to the surface drifts into the repelling part: no sliding.
    assert!(!two_fold(1.0, -3.0, 3.0, -1.0, Start)
        .candidates
        .contains(&-1));
}

#[test]
fn two_folds_at_a_point_of_rest() {
    // f- is at rest, and sliding leads away with the share w of f+, where w = q / (q - s).
    let decision = two_fold(0.0, 1.0, 0.0, -3.0, Start);
    assert_eq!(
        (decision.entry, decision.candidates.as_slice()),
        (0, [-1, 0].as_slice())
    );
    let motion = decision.two_fold.unwrap();
    assert!((motion.weight - 0.25).abs() < 1e-9);
    assert!(motion.attracts());
    assert_eq!((motion.minus.order, motion.plus.order), (1, 1));
    // No mixture slides: rest is all there is.
    let decision = two_fold(0.0, -1.0, 0.0, -1.0, Start);
    assert_eq!(
        (decision.entry, decision.candidates.as_slice()),
        (-1, [-1].as_slice())
    );
}

#[test]
fn a_start_at_a_two_fold_follows_the_mean_of_both_fields() {
    // Visible from both sides; the mean leads to the side of the larger second derivative.
    assert_eq!(two_fold(-3.0, 0.0, 0.0, 1.0, Start).entry, -1);
    assert_eq!(two_fold(-1.0, 0.0, 0.0, 3.0, Start).entry, 1);
}
