//! The weights of Dieci and Lopez, rational functions of the normal components.

use super::{sign_of, RuleFailure};
use crate::cube::NormalFields;

/// The weights
///
/// ```text
/// w_i = mu_i / sum mu,   mu_i = P_i / (P_i + |y_i|_1),   P_i = (prod over j != i of |y_j|_1)^(1/(2^p - 1))
/// ```
///
/// of p surfaces, y_i the components of field i normal to the surfaces in units of their gradients. They combine
/// the *projected* fields: sum w_i f_i is in general not tangent.
///
/// # Errors
/// If the fields of two patterns have no normal component.
///
/// Reference: L. Dieci, L. Lopez, *SIAM J. Numer. Anal.* 47 (2009), formulas (4.19) and (4.20).
pub fn dieci_lopez(fields: &NormalFields) -> Result<Vec<f64>, RuleFailure> {
    let n = fields.n_patterns();
    let norm = |pattern| fields.at(pattern).iter().map(|y| y.abs()).sum();
    let norms: Vec<f64> = (0..n).map(norm).collect();
    let mean_of_others = |i: usize| {
        let others = norms.iter().enumerate().filter(|(j, _)| *j != i);
        let logarithms: f64 = others.map(|(_, norm)| norm.ln()).sum();
        (logarithms / (n - 1) as f64).exp()
    };
    let mu: Vec<f64> = (0..n)
        .map(|i| {
            let mean = mean_of_others(i);
            mean / (mean + norms[i])
        })
        .collect();
    let sum: f64 = mu.iter().sum();
    let weights: Vec<f64> = mu.iter().map(|mu| mu / sum).collect();
    if weights.iter().all(|w| w.is_finite()) {
        Ok(weights)
    } else {
        Err(RuleFailure::Undetermined)
    }
}

/// The slowest approach to surface `i` of a field on its side `end`, as a fraction of the fastest component:
/// positive if all of them point towards it.
pub fn smallest_approach(fields: &NormalFields, i: usize, end: i8) -> f64 {
    let side = f64::from(end);
    let patterns = (0..fields.n_patterns()).filter(|&k| sign_of(k, i) == side);
    let slowest = patterns.map(|k| -side * fields.at(k)[i]);
    slowest.fold(f64::INFINITY, f64::min) / fields.row_size(i)
}
