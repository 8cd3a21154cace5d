//! Gradients of its switching functions, without copies where they are constant.

use super::TracedSystem;
use crate::system::compiled::{CompiledGradient, GradientValues};
use crate::system::tiered::TieredProgram;
use crate::system::Place;

impl TracedSystem {
    /// Calls a function with the derivative of h_j in t and those by the listed states, in their order.
    #[inline(always)]
    pub(super) fn with_gradient<R>(
        &self,
        j: usize,
        place: &Place<'_>,
        f: impl FnOnce(f64, &[usize], &[f64]) -> R,
    ) -> R {
        let CompiledGradient { states, values } = self.model.gradient(j);
        let computed;
        let values = match values {
            GradientValues::Constant(values) => values,
            GradientValues::Computed(tiered) => {
                computed = self.computed_gradient(tiered, place);
                &computed
            }
        };
        f(values[0], states, &values[1..])
    }

    #[inline(never)]
    fn computed_gradient(&self, tiered: &TieredProgram, place: &Place<'_>) -> Vec<f64> {
        let program = tiered.program();
        let mut computed = vec![0.0; program.n_outputs()];
        self.eval(program, place, &[], &mut computed);
        computed
    }
}
