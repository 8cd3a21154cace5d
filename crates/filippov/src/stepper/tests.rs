//! Order conditions of DOPRI5 and of its continuous extensions; those of the other methods in their own files.

mod dop853;
mod lanes;
mod rodas5p;
mod trees;

use super::coefficients_dopri5::{A2, A3, A4, A5, A6, A8, A9, B, C, C8, C9, D, E};
use super::{Attempt, Dopri5, ErrorScale};
use crate::error::FieldError;
use crate::motion::SmoothField;

type Row = [f64; 9];

fn matrix() -> [Row; 9] {
    let rows: [&[f64]; 9] = [&[], &A2, &A3, &A4, &A5, &A6, &B, &A8, &A9];
    rows.map(|row| std::array::from_fn(|j| row.get(j).copied().unwrap_or(0.0)))
}

/// Elementary weights Phi(tree) per stage, with order and density, of the 17 trees up to order 5.
fn trees() -> Vec<(Row, i32, f64)> {
    let a = matrix();
    let apply = |v: &Row| -> Row { std::array::from_fn(|i| (0..9).map(|j| a[i][j] * v[j]).sum()) };
    let times = |u: &Row, v: &Row| -> Row { std::array::from_fn(|i| u[i] * v[i]) };
    let one = [1.0; 9];
    let c = apply(&one);
    let (ac, c2) = (apply(&c), times(&c, &c));
    let (ac2, c3, aac) = (apply(&c2), times(&c2, &c), apply(&ac));
    vec![
        (one, 1, 1.0),
        (c, 2, 2.0),
        (c2, 3, 3.0),
        (ac, 3, 6.0),
        (c3, 4, 4.0),
        (times(&c, &ac), 4, 8.0),
        (ac2, 4, 12.0),
        (aac, 4, 24.0),
        (times(&c3, &c), 5, 5.0),
        (times(&c2, &ac), 5, 10.0),
        (times(&ac, &ac), 5, 20.0),
        (times(&c, &ac2), 5, 15.0),
        (times(&c, &aac), 5, 30.0),
        (apply(&c3), 5, 20.0),
        (apply(&times(&c, &ac)), 5, 40.0),
        (apply(&ac2), 5, 60.0),
        (apply(&aac), 5, 120.0),
    ]
}

fn weigh(b: &Row, phi: &Row) -> f64 {
    b.iter().zip(phi).map(|(b, p)| b * p).sum()
}

#[test]
fn rows_sum_to_the_nodes() {
    let c: Vec<f64> = matrix().iter().map(|row| row.iter().sum()).collect();
    for (sum, node) in c.iter().zip(C.iter().chain(&[C8, C9])) {
        assert!((sum - node).abs() < 1e-14);
    }
}

#[test]
fn weights_have_order_five_and_the_embedded_ones_order_four() {
    let pad = |w: &[f64]| -> Row { std::array::from_fn(|j| w.get(j).copied().unwrap_or(0.0)) };
    let (b, e) = (pad(&B), pad(&E));
    for (phi, order, density) in trees() {
        assert!((weigh(&b, &phi) - 1.0 / density).abs() < 1e-14);
        if order <= 4 {
            assert!(weigh(&e, &phi).abs() < 1e-14);
        }
    }
    // Order five is not reached by the embedded weights, or the estimate would be empty.
    assert!(trees()
        .iter()
        .any(|(phi, order, _)| *order == 5 && weigh(&e, phi).abs() > 1e-5));
}

/// Weights b_i(theta) of an extension whose unit derivatives are the stages.
fn extension_weights(theta: f64, order5: bool) -> Row {
    std::array::from_fn(|i| {
        let b = B.get(i).copied().unwrap_or(0.0);
        let unit = |j: usize| f64::from(u8::from(i == j));
        let r1 = b;
        let r2 = unit(0) - r1;
        let r3 = r1 - unit(6) - r2;
        let (mut r4, mut r5) = (D.get(i).copied().unwrap_or(0.0), 0.0);
        if order5 {
            r5 = 16.0 * (unit(8) - (r1 + 0.25 * r3));
            r4 = (unit(7) - (r1 + 0.6 * r2 + 0.28 * r3) - 0.0256 * r5) / 0.192 - 0.2 * r5;
        }
        let u = 1.0 - theta;
        theta * (r1 + u * (r2 + theta * (r3 + u * (r4 + theta * r5))))
    })
}

#[test]
fn extensions_have_their_order_at_every_theta() {
    for theta in [0.1, 0.37, 0.5, 0.83, 1.0, 1.3] {
        for (phi, order, density) in trees() {
            let exact = f64::powi(theta, order) / density;
            assert!((weigh(&extension_weights(theta, true), &phi) - exact).abs() < 1e-13);
            if order <= 4 {
                assert!((weigh(&extension_weights(theta, false), &phi) - exact).abs() < 1e-13);
            }
        }
    }
}

struct Decay;

impl SmoothField for Decay {
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        dx[0] = -x[0] * t;
        Ok(())
    }
    fn n_evaluations(&self) -> u64 {
        0
    }
}

/// Error of one step of x' = -t x and of its extension at theta, for dt and dt/2.
fn local_errors(theta: f64) -> [f64; 2] {
    [0.2, 0.1].map(|dt| {
        let mut stepper = Dopri5::new(1);
        let (t, mut y) = (0.3, [1.0]);
        stepper.restart(&mut Decay, t, &mut y).unwrap();
        let scale = ErrorScale::new(1e-6, &[1e-6], 1);
        let attempt = stepper
            .attempt_along(&mut Decay, |_| {}, t, &y, dt, &scale)
            .unwrap();
        assert!(matches!(attempt, Attempt::Error(_)));
        let mut out = [0.0];
        stepper
            .extend_order5(&mut Decay, &y)
            .unwrap()
            .at(theta, &mut out);
        let end = t + theta * dt;
        (out[0] - (-(end * end - t * t) / 2.0).exp()).abs()
    })
}

#[test]
fn the_extension_of_order_five_has_local_order_six() {
    for theta in [0.3, 0.7, 1.0, 1.2] {
        let [coarse, fine] = local_errors(theta);
        let order = (coarse / fine).log2();
        assert!(order > 5.6, "theta {theta}: order {order}");
    }
}
