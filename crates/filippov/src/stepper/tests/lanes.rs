//! Sums in wide registers: the same bits as one state after the other.

use super::super::lanes::{squared_error, stage, ANY};
use super::super::ErrorScale;

fn rows(n: usize) -> [Vec<f64>; 4] {
    std::array::from_fn(|r| {
        let value = |i: usize| ((1 + i) as f64 * (0.7 + r as f64)).sin() * 10.0_f64.powi(r as i32);
        (0..n).map(value).collect()
    })
}

#[test]
fn stages_of_many_states_are_those_of_each() {
    for n in [5, 31, 32, 33, 100] {
        let [y, k1, k2, k3] = rows(n);
        let (dt, a) = (0.03, [0.3, -1.7, 0.11]);
        let mut out = vec![0.0; n];
        stage::<ANY, 3>(&mut out, &y, dt, a, [&k1, &k2, &k3]);
        for i in 0..n {
            let sum = a[0] * k1[i] + a[1] * k2[i] + a[2] * k3[i];
            assert_eq!(out[i], y[i] + dt * sum);
        }
    }
}

#[test]
fn the_error_of_many_states_is_summed_in_blocks() {
    for n in [5, 31, 32, 33, 100] {
        let [y, y1, k1, k2] = rows(n);
        let (dt, e) = (0.03, [0.3, -1.7]);
        let scale = ErrorScale::new(1e-6, &[1e-8], n);
        let found = squared_error::<ANY, 2>(&scale, [&y, &y1], dt, e, [&k1, &k2]);
        let square = |i: usize| {
            let ratio = dt * (e[0] * k1[i] + e[1] * k2[i]) / scale.of(i, y[i], y1[i]);
            ratio * ratio
        };
        let in_blocks = n / 32 * 32;
        let mut sums = [0.0; 32];
        (0..in_blocks).for_each(|i| sums[i % 32] += square(i));
        let blocks = sums.iter().sum();
        assert_eq!(found, (in_blocks..n).fold(blocks, |sum, i| sum + square(i)));
    }
}
