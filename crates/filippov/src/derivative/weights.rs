//! By what time and states are measured: states by their size, or by their tolerance if they are small.

use crate::options::Options;
use crate::vectors::dot;

/// How wrong states are, in units of their tolerance.
const ERROR: f64 = 0.1;

/// By what time and states are measured in the condition of an instant.
pub(super) struct Weights {
    /// When the run starts.
    pub start: f64,
    /// How long it was meant to be.
    pub span: f64,
    pub rtol: f64,
    pub atol: Vec<f64>,
}

impl Weights {
    /// Those of a run of this length from a time on.
    pub fn new(start: f64, span: f64, options: &Options) -> Self {
        Weights {
            start,
            span,
            rtol: options.rtol,
            atol: options.atol.clone(),
        }
    }

    fn of(&self, i: usize, x: f64) -> f64 {
        let atol = self.atol.get(i).or(self.atol.first()).copied();
        x.abs() + atol.unwrap_or(0.0) / self.rtol
    }

    /// The length of a gradient: how much a function changes if the time does so by a unit, and states by their size.
    pub fn length(&self, x: &[f64], (by_time, gradient): (f64, &[f64]), unit: f64) -> f64 {
        let pairs = x.iter().zip(gradient).enumerate();
        let by_state = pairs.map(|(i, (x, g))| (g * self.of(i, *x)).powi(2));
        ((by_time * unit).powi(2) + by_state.sum::<f64>()).sqrt()
    }

    /// What a function with this gradient may be wrong by: what is nearer to zero may be on either side of it.
    pub fn error(&self, x: &[f64], gradient: &[f64]) -> f64 {
        ERROR * self.rtol * self.length(x, (0.0, gradient), 1.0)
    }

    /// How many sizes of the states a motion goes in a time.
    fn speed(&self, x: &[f64], field: &[f64]) -> f64 {
        let all = field.iter().zip(x).enumerate();
        let moving = all.filter(|(_, (f, _))| **f != 0.0);
        let parts = moving.map(|(i, (f, x))| (f / self.of(i, *x)).powi(2));
        parts.fold(0.0, |sum, part| sum + part).sqrt()
    }

    /// In what time states change by their size; of a motion at rest, the time until then. However long the run was meant to be.
    pub fn time_of_change(&self, t: f64, x: &[f64], field: &[f64]) -> f64 {
        let so_far = if t > self.start {
            t - self.start
        } else {
            self.span
        };
        self.span.min(so_far).min(1.0 / self.speed(x, field))
    }

    /// 1 / |cos| of the angle between a gradient and a motion, in this unit of time.
    pub fn condition(&self, x: &[f64], gradient: (f64, &[f64]), field: &[f64], unit: f64) -> f64 {
        let rate = gradient.0 + dot(gradient.1, field);
        let speed = (unit.powi(-2) + self.speed(x, field).powi(2)).sqrt();
        self.length(x, gradient, unit) * speed / rate.abs()
    }
}
