//! Step size control.

/// The weights of the error norm: atol_i + rtol max(|y0_i|, |y1_i|).
#[derive(Clone, Debug)]
pub struct ErrorScale {
    rtol: f64,
    atol: Vec<f64>,
}

impl ErrorScale {
    /// Tolerances for n components; `atol` holds one entry or n.
    pub fn new(rtol: f64, atol: &[f64], n: usize) -> Self {
        let atol = if atol.len() == 1 { vec![atol[0]; n] } else { atol.to_vec() };
        ErrorScale { rtol, atol }
    }

    /// The scale of component `i`.
    #[inline]
    pub fn of(&self, i: usize, y0: f64, y1: f64) -> f64 {
        // Not `f64::max`: a NaN must survive, and one comparison is cheaper.
        let (a, b) = (y0.abs(), y1.abs());
        self.atol[i] + self.rtol * if b < a { a } else { b }
    }

    /// Root mean square of `v` in units of the scale at `y`.
    pub fn norm(&self, v: &[f64], y: &[f64]) -> f64 {
        let sum: f64 =
            v.iter().zip(y).enumerate().map(|(i, (v, y))| (v / self.of(i, *y, *y)).powi(2)).sum();
        (sum / v.len() as f64).sqrt()
    }
}

/// The PI controller of DOPRI5 (Hairer, Norsett, Wanner, section IV.2): after an accepted step
///
///   dt <- dt * 0.9 err^-alpha err_old^beta,  beta = 0.04, alpha = 1/5 - 0.75 beta,
///
/// kept within [0.2, 5], without growth right after a rejection.
#[derive(Clone, Debug)]
pub struct Controller {
    old_error: f64,
    rejected: bool,
}

const SAFETY: f64 = 0.9;
const BETA: f64 = 0.04;
const ALPHA: f64 = 0.2 - 0.75 * BETA;
const SHRINK: f64 = 0.2;
const GROW: f64 = 5.0;

impl Default for Controller {
    fn default() -> Self {
        Controller { old_error: 1e-4, rejected: false }
    }
}

impl Controller {
    /// The factor for the next step after one with this error was accepted.
    pub fn accept(&mut self, error: f64) -> f64 {
        // err^-alpha err_old^beta in one exponential.
        let error = error.max(1e-10);
        let factor = SAFETY * (BETA * self.old_error.ln() - ALPHA * error.ln()).exp();
        let limit = if self.rejected { 1.0 } else { GROW };
        self.old_error = error.max(1e-4);
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
