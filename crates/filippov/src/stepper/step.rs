//! What every method leaves of a step: its ends, the derivatives there, and its continuous extension.

use super::Interpolant;

/// A step that was attempted, or is about to be.
#[derive(Clone)]
pub struct Step {
    /// The derivative at the start.
    pub start_derivative: Vec<f64>,
    /// The end.
    pub end: Vec<f64>,
    /// The derivative at the end.
    pub end_derivative: Vec<f64>,
    /// The continuous extension, as far as it was computed.
    pub interpolant: Interpolant,
}

impl Step {
    /// Space for a step of n states.
    pub fn new(n: usize, interpolant: Interpolant) -> Self {
        Step {
            start_derivative: vec![0.0; n],
            end: vec![0.0; n],
            end_derivative: vec![0.0; n],
            interpolant,
        }
    }

    /// Makes the end the start of the next step.
    #[inline]
    pub fn accept(&mut self, y: &mut [f64]) {
        y.copy_from_slice(&self.end);
        std::mem::swap(&mut self.start_derivative, &mut self.end_derivative);
    }
}
