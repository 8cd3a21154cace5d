//! Zeros found, not missed and not invented.

use super::certificate::Bound;
use super::filter::may_vanish;
use super::isolate::{first_zero, Evidence, Zero, PROBES};
use crate::locate::{refine, Bracket};
use filippov_expr::Interval;
use proptest::prelude::*;

fn find(g: impl Fn(f64) -> f64) -> Option<Zero> {
    first_zero(
        &mut |x| Ok(g(x)),
        0.0,
        1.0,
        1e-15,
        Evidence::Probes(&PROBES),
    )
    .unwrap()
    .zero
}

#[test]
fn a_double_crossing_inside_is_found() {
    for gap in [1e-1, 1e-3, 1e-5, 1e-7] {
        let Some(Zero::Crossing(bracket)) = find(|x| (x - 0.4) * (x - 0.4 - gap)) else {
            panic!("gap {gap}: no crossing")
        };
        let zero = refine(&mut |x| Ok((x - 0.4) * (x - 0.4 - gap)), bracket, 0.0)
            .unwrap()
            .theta;
        assert!((zero - 0.4).abs() < 1e-9, "gap {gap}: {zero}");
    }
}

#[test]
fn a_jump_is_located_among_points_that_are_as_near_to_zero() {
    let mut g = |x: f64| Ok(if x < 0.6 { 0.02 } else { -0.23 });
    let bracket = Bracket {
        lo: 0.5,
        hi: 0.75,
        g_lo: 0.02,
        g_hi: -0.23,
        guess: 0.53,
        slope: -1.0,
    };
    let zero = refine(&mut g, bracket, 1e-15).unwrap();
    assert!((zero.theta - 0.6).abs() < 1e-14, "{zero:?}");
}

#[test]
fn an_exact_touch_is_a_touch() {
    let Some(Zero::Touch(theta)) = find(|x| (x - 0.3_f64).powi(2)) else {
        panic!("no touch")
    };
    assert!((theta - 0.3).abs() < 1e-6);
}

#[test]
fn a_near_miss_is_none() {
    assert_eq!(find(|x| (x - 0.3).powi(2) + 1e-12), None);
    assert_eq!(find(|x| 1e-9 + x * (x - 0.5).powi(2)), None);
}

#[test]
fn an_identically_vanishing_function_has_no_zero() {
    assert_eq!(find(|_| 0.0), None);
}

/// The bounds of g(theta) = 1e-26 (1 + theta) know the motion to 1e-20 only: samples decide.
#[test]
fn bounds_wider_than_the_function_at_every_point_leave_it_to_the_samples() {
    let mut over = |a: f64, b: f64| {
        Some(Bound {
            value: Interval::around(1e-26 * (1.0 + 0.5 * (a + b)), 1e-20),
            slope: Interval::around(0.0, 1e-20),
        })
    };
    let mut search = |slope: f64| {
        let evidence = Evidence::Bounds {
            bounds: &mut over,
            divided: 0,
            patience: 0,
        };
        let g = |theta: f64| Ok(1e-26 * (1.0 + slope * theta));
        first_zero(&mut { g }, 0.0, 1.0, 1e-40, evidence).unwrap()
    };
    let free = search(1.0);
    assert!(free.zero.is_none() && !free.exhausted && !free.not_finite);
    let Some(Zero::Crossing(bracket)) = search(-1.7).zero else {
        panic!("no crossing")
    };
    assert!(bracket.lo < 1.0 / 1.7 && 1.0 / 1.7 < bracket.hi);
}

#[test]
fn many_oscillations_are_resolved() {
    let g = |x: f64| (60.0 * x).cos() + 0.5;
    let Some(Zero::Crossing(bracket)) = find(g) else {
        panic!("no crossing")
    };
    let zero = refine(&mut |x| Ok(g(x)), bracket, 0.0).unwrap().theta;
    assert!((zero - (2.0 * std::f64::consts::PI / 3.0) / 60.0).abs() < 1e-15);
}

proptest! {
    /// The first zero of a cubic with known zeros is the one found, and the filter let it pass.
    #[test]
    fn cubics(a in 0.05..0.95_f64, b in 0.05..1.5_f64, c in 1.1..3.0_f64) {
        prop_assume!((a - b).abs() > 1e-6);
        let g = |x: f64| -(x - a) * (x - b) * (x - c);
        let sign = if g(0.0) > 0.0 { 1.0 } else { -1.0 };
        let g = |x: f64| sign * g(x);
        let slope = |x: f64| (g(x + 1e-6) - g(x - 1e-6)) / 2e-6;
        prop_assert!(may_vanish(g(0.0), slope(0.0), g(1.0), slope(1.0)));
        let Some(Zero::Crossing(bracket)) = find(g) else { return Err(TestCaseError::fail("missed")) };
        let zero = refine(&mut |x| Ok(g(x)), bracket, 0.0).unwrap().theta;
        prop_assert!((zero - a.min(b)).abs() < 1e-9);
    }
}

#[test]
fn a_rise_from_near_zero_is_excluded() {
    // The second step after sliding ended: the end values differ much, and both slopes are positive.
    assert!(!may_vanish(3.08e-3, 8.79e-3, 1.815e-2, 2.13e-2));
    assert!(may_vanish(3.08e-3, -8.79e-3, 1.815e-2, 2.13e-2));
}

proptest! {
    /// The filter lets every sinusoid pass that vanishes, up to two radians a step.
    #[test]
    fn sinusoids(phase in 0.0..6.3_f64, rate in 0.1..2.0_f64, shift in -1.0..1.0_f64) {
        let g = |x: f64| shift + (phase + rate * x).sin();
        let slope = |x: f64| rate * (phase + rate * x).cos();
        let lowest = (0..=200).map(|k| g(f64::from(k) / 200.0)).fold(f64::INFINITY, f64::min);
        prop_assume!(lowest <= 0.0);
        prop_assert!(may_vanish(g(0.0), slope(0.0), g(1.0), slope(1.0)));
    }
}
