//! Fields of regions: what the signs alone make of them is computed once.

use filippov_expr::{Backend, Graph, NodeId};

use super::tiered::TieredProgram;
use super::{Place, Setting};

/// A system of whose field much is the same all over a region.
///
/// Duties of an implementer: [`eval`](Self::eval), with the values that [`settle`](Self::settle) wrote for the same signs and discrete
/// states, gives the bits of [`PiecewiseSystem::field`](super::PiecewiseSystem::field).
pub trait RegionFields {
    /// Writes what follows from signs and discrete states.
    fn settle(&self, setting: Setting<'_>, values: &mut Vec<f64>);

    /// Writes f(t, x, s).
    fn eval(&self, place: &Place<'_>, values: &[f64], dx: &mut [f64]);
}

/// A traced field as a function of what signs and parameters alone make of it.
pub(super) struct RegionProgram {
    values: TieredProgram,
    field: TieredProgram,
    /// The parameters in front of the values.
    n_parameters: usize,
}

impl RegionProgram {
    /// `None` if that is little.
    pub fn new(graph: &Graph, field: &[NodeId], backend: Backend) -> Option<Self> {
        let settled = graph.settled(field).ok()??;
        Some(RegionProgram {
            values: TieredProgram::new(graph.clone(), settled.values, backend),
            field: TieredProgram::new(settled.graph, settled.outputs, backend),
            n_parameters: settled.n_parameters,
        })
    }

    /// Writes the parameters that the field reads, and behind them the values with these signs.
    pub fn settle(&self, signs: &[f64], parameters: &[f64], values: &mut Vec<f64>) {
        let (program, n) = (self.values.program(), self.n_parameters);
        values.clear();
        values.extend_from_slice(&parameters[..n]);
        values.resize(n + program.n_outputs(), 0.0);
        program.eval(f64::NAN, &[], signs, parameters, &[], &mut values[n..]);
    }

    /// Writes the field.
    #[inline]
    pub fn eval(&self, place: &Place<'_>, values: &[f64], dx: &mut [f64]) {
        let &Place { t, x, signs, .. } = place;
        let program = self.field.program();
        program.eval(t, x, signs, values, &[], dx);
    }
}
