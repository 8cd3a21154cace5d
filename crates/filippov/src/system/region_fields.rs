//! Fields of regions: what the signs alone make of them is computed once.

use filippov_expr::{Backend, Graph, NodeId};

use super::tiered::TieredProgram;
use super::{Place, Setting};

/// A system of whose field much is the same all over a region.
///
/// Duties of an implementer: [`eval`](Self::eval), with the values that [`settle`](Self::settle) wrote for the same signs and discrete
/// states, gives the bits of [`PiecewiseSystem::field`](super::PiecewiseSystem::field).
pub trait RegionFields {
    /// Computes the values that depend on the signs and the discrete states alone, and writes them to `values`.
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

#[cfg(test)]
mod tests {
    use filippov_expr::{Backend, Graph, Names};

    use crate::system::{PiecewiseSystem, Setting, TracedSystem};

    /// x' = (q + sum of p sign(x - k)) x, with as many levels.
    fn levels(n: usize) -> TracedSystem {
        let mut g = Graph::new();
        let (x, p, mut rate) = (g.state(0), g.parameter(0), g.parameter(1));
        for k in 0..n {
            let level = g.constant(k as f64);
            let h = g.sub(x, level);
            let sign = g.sign(h);
            let term = g.mul(p, sign);
            rate = g.add(rate, term);
        }
        let field = vec![g.mul(rate, x)];
        let system = TracedSystem::new(g, field, vec![0.3], Names::default(), Backend::Auto);
        system.expect("compiles").with_discrete(1)
    }

    #[test]
    fn the_field_of_a_region_is_the_field_to_the_bit() {
        let system = levels(20);
        let fields = system.region_fields().expect("40 operations");
        let mut values = Vec::new();
        for k in 0..=20 {
            let signs: Vec<f64> = (0..20).map(|j| if j < k { 1.0 } else { -1.0 }).collect();
            for q in [0.7, -0.1] {
                let q = [q];
                let setting = Setting::new(&signs, &q);
                fields.settle(setting, &mut values);
                for x in [0.1, 5.3, 19.7] {
                    let (x, mut dx, mut expected) = ([x], [f64::NAN], [0.0]);
                    let place = setting.at(0.0, &x);
                    fields.eval(&place, &values, &mut dx);
                    system.field(&place, &mut expected).expect("pure");
                    assert_eq!(dx, expected);
                }
            }
        }
    }

    #[test]
    fn a_field_of_few_operations_on_signs_is_computed_as_a_whole() {
        assert!(levels(3).region_fields().is_none());
    }
}
