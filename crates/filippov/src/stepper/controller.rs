//! Step size control.

use crate::powers::power;

/// The PI controller of DOPRI5 (Hairer, Norsett, Wanner, section IV.2): after an accepted step
///
///   dt <- dt * 0.9 err^-alpha err_old^beta,  beta = 0.04, alpha = 1/5 - 0.75 beta,
///
/// kept within [0.2, 5], without growth right after a rejection. After a restart err_old is err.
#[derive(Clone, Debug, Default)]
pub struct Controller {
    /// Binary logarithm of the error of the last accepted step.
    old_log: Option<f64>,
    rejected: bool,
}

const SAFETY: f64 = 0.9;
const BETA: f64 = 0.04;
const ALPHA: f64 = 0.2 - 0.75 * BETA;
/// Binary logarithm of 1e-4, the smallest error that counts as that of the step before.
const SMALLEST_OLD_LOG: f64 = -13.287_7;
const SHRINK: f64 = 0.2;
const GROW: f64 = 5.0;

impl Controller {
    /// The factor for the next step after one with this error was accepted.
    pub fn accept(&mut self, error: f64) -> f64 {
        // err^-alpha err_old^beta by logarithms; a step size needs no more than three digits.
        let log = rough_log2(error.max(1e-10));
        let old_log = self.old_log.unwrap_or(log);
        let factor = SAFETY * rough_exp2(BETA * old_log - ALPHA * log);
        let limit = if self.rejected { 1.0 } else { GROW };
        self.old_log = Some(log.max(SMALLEST_OLD_LOG));
        self.rejected = false;
        factor.clamp(SHRINK, limit)
    }

    /// The factor for another attempt after one with this error was rejected.
    pub fn reject(&mut self, error: f64) -> f64 {
        self.rejected = true;
        (SAFETY * power(error, -0.2)).clamp(SHRINK, SAFETY)
    }

    /// The step was not finite: no growth after the next one.
    pub fn not_finite(&mut self) {
        self.rejected = true;
    }

    /// Forgets the history, at a restart.
    pub fn restart(&mut self) {
        *self = Controller::default();
    }
}

/// log2 of a positive normal number to about 1e-3: exponent, and a cubic in the mantissa.
pub(super) fn rough_log2(x: f64) -> f64 {
    let bits = x.to_bits();
    let exponent = (bits >> 52) as i64 - 1023;
    let mantissa = f64::from_bits(bits & 0x000f_ffff_ffff_ffff | 0x3ff0_0000_0000_0000);
    let m = mantissa - 1.0;
    exponent as f64 + m * (1.4199 + m * (-0.5777 + m * 0.1578))
}

/// 2^x for |x| < 1000 to about 1e-3: the integer part as exponent, a cubic for the rest.
pub(super) fn rough_exp2(x: f64) -> f64 {
    // Rounded down by a conversion of a positive number: `f64::floor` is a call on many machines.
    let exponent = (x + 1023.0) as i64;
    let f = x + 1023.0 - exponent as f64;
    let power = f64::from_bits((exponent as u64) << 52);
    power * (1.0 + f * (0.6951 + f * (0.2276 + f * 0.0773)))
}

#[cfg(test)]
mod tests {
    use super::{rough_exp2, rough_log2};

    #[test]
    fn rough_functions_have_three_digits() {
        for k in -3000..3000 {
            let x = f64::from(k) * 0.01;
            assert!((rough_exp2(x) / x.exp2() - 1.0).abs() < 3e-3);
            assert!((rough_log2(x.exp2()) - x).abs() < 3e-3);
        }
    }
}
