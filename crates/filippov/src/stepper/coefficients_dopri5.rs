//! Coefficients of DOPRI5(4) and of its continuous extensions.
//!
//! Pair and free extension of order 4: Dormand, Prince (1980); Hairer, Norsett, Wanner (1993),
//! sections II.5 and II.6. Extra stages of the extension of order 5: Calvo, Montijano, Randez
//! (1990), JCAM 29, 91-100. `tests.rs` checks the order conditions of all of them.
#![allow(clippy::excessive_precision)]

/// The end of the region of stability on the negative axis: the product of step and rate at which stability limits the step
/// (Hairer, Wanner 1996, section IV.2).
pub(super) const STABILITY_END: f64 = 3.25;

pub(super) const C: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];

pub(super) const A2: [f64; 1] = [0.2];
pub(super) const A3: [f64; 2] = [3.0 / 40.0, 9.0 / 40.0];
pub(super) const A4: [f64; 3] = [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0];
pub(super) const A5: [f64; 4] = [
    19372.0 / 6561.0,
    -25360.0 / 2187.0,
    64448.0 / 6561.0,
    -212.0 / 729.0,
];
pub(super) const A6: [f64; 5] = [
    9017.0 / 3168.0,
    -355.0 / 33.0,
    46732.0 / 5247.0,
    49.0 / 176.0,
    -5103.0 / 18656.0,
];

/// Weights of order 5; also the last row of A (the last stage is the first of the next step).
pub(super) const B: [f64; 6] = [
    35.0 / 384.0,
    0.0,
    500.0 / 1113.0,
    125.0 / 192.0,
    -2187.0 / 6784.0,
    11.0 / 84.0,
];

/// Difference of the weights of order 5 and 4.
pub(super) const E: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Weights of the quartic term of the free extension of order 4.
pub(super) const D: [f64; 7] = [
    -12715105075.0 / 11282082432.0,
    0.0,
    87487479700.0 / 32700410799.0,
    -10690763975.0 / 1880347072.0,
    701980252875.0 / 199316789632.0,
    -1453857185.0 / 822651844.0,
    69997945.0 / 29380423.0,
];

/// Extra stage at c = 1/5 for the extension of order 5.
pub(super) const A8: [f64; 7] = [
    5207.0 / 48000.0,
    0.0,
    92.0 / 795.0,
    -79.0 / 960.0,
    53217.0 / 848000.0,
    -11.0 / 300.0,
    4.0 / 125.0,
];
pub(super) const C8: f64 = 0.2;

/// Extra stage at c = 1/2 for the extension of order 5.
pub(super) const A9: [f64; 7] = [
    613.0 / 6144.0,
    0.0,
    125.0 / 318.0,
    -125.0 / 3072.0,
    8019.0 / 108544.0,
    -11.0 / 192.0,
    1.0 / 32.0,
];
pub(super) const C9: f64 = 0.5;
