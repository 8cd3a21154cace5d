//! Step size control.

/// The weights of the error norm: atol_i + rtol max(|y0_i|, |y1_i|). A component that is zero at both ends and has no
/// absolute tolerance does not count: nothing tells its size.
#[derive(Clone, Debug)]
pub struct ErrorScale {
    rtol: f64,
    atol: Vec<f64>,
}

impl ErrorScale {
    /// Tolerances for n components; `atol` holds one entry or n.
    pub fn new(rtol: f64, atol: &[f64], n: usize) -> Self {
        let atol = if atol.len() == 1 {
            vec![atol[0]; n]
        } else {
            atol.to_vec()
        };
        // A tolerance of zero would be one that nothing keeps, and nothing can be divided by.
        let atol = atol.into_iter().map(|a| a.max(f64::MIN_POSITIVE)).collect();
        ErrorScale { rtol, atol }
    }

    /// The scale of component `i`; infinite where it does not count.
    #[inline]
    pub fn of(&self, i: usize, y0: f64, y1: f64) -> f64 {
        let tolerance = self.tolerance(i, y0, y1);
        if tolerance == f64::MIN_POSITIVE {
            f64::INFINITY
        } else {
            tolerance
        }
    }

    /// What component `i` may err by.
    #[inline]
    pub fn tolerance(&self, i: usize, y0: f64, y1: f64) -> f64 {
        // Not `f64::max`: a NaN must survive, and one comparison is cheaper.
        let (a, b) = (y0.abs(), y1.abs());
        self.atol[i] + self.rtol * if b < a { a } else { b }
    }

    /// The size of component `i` at `y`: its magnitude, or where that is small the one below which the absolute
    /// tolerance governs its error. Infinite where nothing tells it.
    pub fn size(&self, i: usize, y: f64) -> f64 {
        self.of(i, y, y) / self.rtol
    }

    /// The tolerance for a function with this gradient at `y`: the sum of what those of the components amount to.
    pub fn along(&self, gradient: &[f64], y: &[f64]) -> f64 {
        let components = gradient.iter().zip(y).enumerate();
        components
            .map(|(i, (g, y))| g.abs() * self.tolerance(i, *y, *y))
            .sum()
    }

    /// Largest component of `v` in units of the scale at `y`.
    pub fn largest(&self, v: &[f64], y: &[f64]) -> f64 {
        let components = v.iter().zip(y).enumerate();
        let ratios = components.map(|(i, (v, y))| v.abs() / self.of(i, *y, *y));
        ratios.fold(0.0, |most, ratio| if ratio > most { ratio } else { most })
    }

    /// Root mean square of `v` in units of the scale at `y`.
    pub fn norm(&self, v: &[f64], y: &[f64]) -> f64 {
        root_mean_square(v.len(), |i| v[i] / self.of(i, y[i], y[i]))
    }
}

/// Root mean square of n ratios; where their squares overflow, the largest of them.
#[inline(always)]
pub(super) fn root_mean_square(n: usize, ratio: impl Fn(usize) -> f64) -> f64 {
    let mut sum = 0.0;
    for i in 0..n {
        let ratio = ratio(i);
        sum += ratio * ratio;
    }
    if sum == f64::INFINITY {
        return (0..n).map(|i| ratio(i).abs()).fold(0.0, f64::max);
    }
    (sum / n as f64).sqrt()
}

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
        (SAFETY * error.powf(-0.2)).clamp(SHRINK, SAFETY)
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
