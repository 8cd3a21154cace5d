//! The canopy: products of the shares of each surface.

use super::sign_of;

/// The weights prod_i (1 + k_i lambda_i)/2 of all patterns k.
///
/// Reference: M. Jeffrey, Dynamics at a switching intersection, *SIAM J. Appl. Dyn. Syst.* 13 (2014).
pub fn product_weights(lambda: &[f64]) -> Vec<f64> {
    let weight = |pattern: usize| {
        let factors = lambda.iter().enumerate();
        factors.fold(1.0, |product, (i, lambda)| {
            product * 0.5 * (1.0 + sign_of(pattern, i) * lambda)
        })
    };
    (0..1 << lambda.len()).map(weight).collect()
}
