//! Order conditions of Rodas5P and of its continuous extension, its stability, and its steps.

use super::super::coefficients_rodas5p::{A, C, EXTENSION, GAMMA, NODES, TIME_SHARES};
use super::super::{Attempt, ErrorScale, Rodas5p, Stepper};
use super::trees::{dot, trees};
use crate::error::FieldError;
use crate::motion::SmoothField;
use crate::sparse::SparseRows;
use crate::system::Linearisation;

type Square = Vec<Vec<f64>>;

/// The method in the variables k: U = Gamma k.
struct Method {
    /// Gamma.
    gamma: Square,
    /// alpha_ij.
    alpha: Square,
    /// alpha_ij + gamma_ij.
    beta: Square,
}

fn product(a: &Square, b: &Square) -> Square {
    let entry = |row: &Vec<f64>, j: usize| row.iter().zip(b).map(|(v, b)| v * b[j]).sum();
    a.iter()
        .map(|row| (0..b[0].len()).map(|j| entry(row, j)).collect())
        .collect()
}

/// a_ij with the sums of increments of the stages 7 and 8.
fn rows_of_a() -> Square {
    let mut rows = vec![vec![0.0; 8]];
    for i in 1..8 {
        let mut row = A[i.min(5) - 1].to_vec();
        row.extend((5..8).map(|j| if j < i { 1.0 } else { 0.0 }));
        rows.push(row);
    }
    rows
}

#[allow(clippy::needless_range_loop)] // the indices of the formulas
fn method() -> Method {
    // Gamma^-1 = diag(1/gamma) - C is lower triangular.
    let mut inverse = vec![vec![0.0; 8]; 8];
    for i in 0..8 {
        inverse[i][i] = 1.0 / GAMMA;
        for j in 0..i {
            inverse[i][j] = -C[i - 1][j];
        }
    }
    let mut gamma = vec![vec![0.0; 8]; 8];
    for j in 0..8 {
        for i in j..8 {
            let unit = if i == j { 1.0 } else { 0.0 };
            let known: f64 = (j..i).map(|k| inverse[i][k] * gamma[k][j]).sum();
            gamma[i][j] = (unit - known) / inverse[i][i];
        }
    }
    let alpha = product(&rows_of_a(), &gamma);
    let sum = |(a, g): (&Vec<f64>, &Vec<f64>)| a.iter().zip(g).map(|(a, g)| a + g).collect();
    let beta = alpha.iter().zip(&gamma).map(sum).collect();
    Method { gamma, alpha, beta }
}

/// Weights of k from those of U.
fn weights(of_increments: &[f64], method: &Method) -> Vec<f64> {
    product(&vec![of_increments.to_vec()], &method.gamma).remove(0)
}

/// Weights of the end, and of the embedded end, which leaves out the last increment.
fn ends() -> [Vec<f64>; 2] {
    let mut end = A[4].to_vec();
    end.extend([1.0; 3]);
    let mut embedded = end.clone();
    embedded[7] = 0.0;
    [end, embedded]
}

#[test]
fn rows_sum_to_nodes_and_to_shares_of_the_derivative_in_time() {
    let method = method();
    for i in 0..8 {
        assert!((method.alpha[i].iter().sum::<f64>() - NODES[i]).abs() < 1e-12);
        assert!((method.gamma[i].iter().sum::<f64>() - TIME_SHARES[i]).abs() < 1e-12);
    }
}

#[test]
fn the_end_has_order_five_and_the_embedded_one_order_four() {
    let method = method();
    let [end, embedded] = ends().map(|increments| weights(&increments, &method));
    let mut misses = 0.0_f64;
    for tree in trees(5) {
        let phi = tree.weights(&method.alpha, &method.beta);
        let exact = 1.0 / tree.density();
        assert!((dot(&end, &phi) - exact).abs() < 1e-12, "{tree:?}");
        let miss = (dot(&embedded, &phi) - exact).abs();
        if tree.order() <= 4 {
            assert!(miss < 1e-12, "{tree:?}");
        } else {
            misses = misses.max(miss);
        }
    }
    // Order five is not reached by the embedded weights, or the estimate would be empty.
    assert!(misses > 1e-5);
}

#[test]
fn the_extension_has_order_four_at_every_theta() {
    let method = method();
    let [end, _] = ends();
    for theta in [0.1_f64, 0.37, 0.5, 0.83, 1.0, 1.2] {
        let increments: Vec<f64> = (0..8)
            .map(|i| {
                let [k1, k2, k3] = EXTENSION.map(|row| row[i]);
                theta * (end[i] + (1.0 - theta) * (k1 + theta * (k2 + theta * k3)))
            })
            .collect();
        let b = weights(&increments, &method);
        for tree in trees(4) {
            let phi = tree.weights(&method.alpha, &method.beta);
            let exact = theta.powi(tree.order() as i32) / tree.density();
            assert!((dot(&b, &phi) - exact).abs() < 1e-11, "{tree:?} at {theta}");
        }
    }
}

/// R(z) = 1 + z b^T (I - z B)^-1 1 along the imaginary axis and far to the left.
#[test]
fn it_is_stable_for_stiff_decay() {
    let grow = |z: f64| {
        let (mut field, mut stepper) = (Decay { rate: z }, Rodas5p::new(1));
        let end = one_step(&mut field, &mut stepper, 1.0);
        end.abs()
    };
    for z in [-0.1, -1.0, -5.0, -30.0, -1e3, -1e6] {
        assert!(grow(z) < 1.0, "z = {z}");
    }
    assert!(grow(-1e8) < 1e-6);
}

/// x' = rate (x - cos t) - sin t: its solution from 1 is cos t, however stiff it is.
struct Decay {
    rate: f64,
}

impl SmoothField for Decay {
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        dx[0] = self.rate * (x[0] - t.cos()) - t.sin();
        Ok(())
    }
    fn n_evaluations(&self) -> u64 {
        0
    }
}

fn one_step(field: &mut Decay, stepper: &mut Rodas5p, dt: f64) -> f64 {
    // From 0, beside the solution: what is left of the distance 1 is R(z), but for the error of cos t.
    let y = [0.0];
    let exact = dt.cos();
    step(field, stepper, 0.0, &y, dt) - exact
}

fn step(field: &mut Decay, stepper: &mut Rodas5p, t: f64, y: &[f64], dt: f64) -> f64 {
    let mut matrix = SparseRows::new(1);
    matrix.push_row([(0, 0.0)]);
    stepper.restart(Linearisation::new(1, matrix, true));
    field
        .eval(t, &mut y.to_vec(), stepper.start_derivative_mut())
        .unwrap();
    let rate = field.rate;
    assert!(stepper.linearise(|out| out.fill(|values, time| {
        values[0] = -rate;
        time[0] = rate * t.sin() - t.cos();
    })));
    assert!(stepper.factor(dt));
    let scale = ErrorScale::new(1e-6, &[1e-6], 1);
    let attempt = stepper
        .attempt_along(field, |_| {}, t, y, dt, &scale)
        .unwrap();
    assert!(matches!(attempt, Attempt::Error(_)));
    stepper.step().end[0]
}

#[test]
fn steps_have_local_order_six_and_their_extension_five() {
    let errors = [0.2_f64, 0.1].map(|dt| {
        let (t, mut stepper) = (0.3_f64, Rodas5p::new(1));
        let end = step(&mut Decay { rate: -1.0 }, &mut stepper, t, &[t.cos()], dt);
        let mut middle = [0.0];
        stepper.step().interpolant.at(0.5, &mut middle);
        [
            (end - (t + dt).cos()).abs(),
            (middle[0] - (t + 0.5 * dt).cos()).abs(),
        ]
    });
    let order = |k: usize| (errors[0][k] / errors[1][k]).log2();
    assert!(order(0) > 5.6, "{}", order(0));
    assert!(order(1) > 4.6, "{}", order(1));
}
