//! Order conditions of DOP853 and of its continuous extension.

use super::super::coefficients_dop853::{A, D, E3, E5, NODES};
use super::super::{Attempt, Dop853, ErrorScale, Stepper};
use super::trees::{dot, trees};
use super::Decay;
use crate::motion::SmoothField;

/// The matrix of all stages; row 12 has the weights of the end of the step.
fn matrix() -> Vec<Vec<f64>> {
    let mut rows = vec![vec![0.0; 16]];
    for sparse in A {
        let mut row = vec![0.0; 16];
        sparse.iter().for_each(|&(j, weight)| row[j] = weight);
        rows.push(row);
    }
    rows
}

#[test]
fn rows_sum_to_the_nodes() {
    for (row, node) in matrix().iter().zip(NODES) {
        assert!((row.iter().sum::<f64>() - node).abs() < 1e-14);
    }
}

#[test]
fn the_end_has_order_eight_and_the_estimates_order_five_and_three() {
    let matrix = matrix();
    let mut misses = [0.0_f64; 2];
    for tree in trees(8) {
        let phi = tree.weights(&matrix, &matrix);
        let exact = 1.0 / tree.density();
        assert!((dot(&matrix[12], &phi) - exact).abs() < 1e-13, "{tree:?}");
        for (weights, order, miss) in [(E5, 5, 0), (E3, 3, 1)] {
            let difference = dot(&weights, &phi).abs();
            if tree.order() <= order {
                assert!(difference < 1e-13, "{tree:?}");
            } else if tree.order() == order + 1 {
                misses[miss] = misses[miss].max(difference);
            }
        }
    }
    // The estimates are not of higher order, or they would be empty.
    assert!(misses.iter().all(|miss| *miss > 1e-6));
}

#[test]
fn the_extension_has_order_seven_at_every_theta() {
    let matrix = matrix();
    for theta in [0.1_f64, 0.37, 0.5, 0.83, 1.0] {
        let u = 1.0 - theta;
        let weights: Vec<f64> = (0..16)
            .map(|i| {
                let unit = |j: usize| if i == j { 1.0 } else { 0.0 };
                let end = matrix[12][i];
                let [f3, f4, f5, f6] = D.map(|row| row[i]);
                let (f1, f2) = (unit(0) - end, 2.0 * end - unit(12) - unit(0));
                let inner = f2 + u * (f3 + theta * (f4 + u * (f5 + theta * f6)));
                theta * (end + u * (f1 + theta * inner))
            })
            .collect();
        for tree in trees(7) {
            let phi = tree.weights(&matrix, &matrix);
            let exact = theta.powi(tree.order() as i32) / tree.density();
            assert!(
                (dot(&weights, &phi) - exact).abs() < 1e-12,
                "{tree:?} at {theta}"
            );
        }
    }
}

#[test]
fn steps_have_local_order_nine_and_their_extension_eight() {
    let errors = [0.4, 0.2].map(|dt| {
        let mut stepper = Dop853::new(1);
        let (t, y) = (0.3, [1.0]);
        Decay
            .eval(t, &mut y.clone(), stepper.start_derivative_mut())
            .unwrap();
        let scale = ErrorScale::new(1e-2, &[1e-2], 1);
        let attempt = stepper
            .attempt_along(&mut Decay, |_| {}, t, &y, dt, &scale)
            .unwrap();
        assert!(matches!(attempt, Attempt::Error(error) if error <= 1.0));
        [0.4, 1.0].map(|theta| {
            let mut out = [0.0];
            stepper.step().interpolant.at(theta, &mut out);
            let end = t + theta * dt;
            (out[0] - (-(end * end - t * t) / 2.0_f64).exp()).abs()
        })
    });
    let order = |k: usize| (errors[0][k] / errors[1][k]).log2();
    assert!(order(0) > 7.5, "{}", order(0));
    assert!(order(1) > 8.5, "{}", order(1));
}
