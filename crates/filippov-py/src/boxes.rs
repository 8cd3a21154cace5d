//! Bounds of fields over boxes of states and multipliers.

use filippov_expr::{Enclosure, EnclosureProgram, Interval, Motion, NodeId};
use numpy::{PyArray2, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::systems::TracedSystem;

/// The field of a mode and the switching functions, over boxes. The unknowns are the states and behind them the multipliers of the
/// surfaces slid on, on which the field is the canopy of those around.
#[pyclass(frozen, module = "filippov._core")]
pub struct ModeBounds {
    program: EnclosureProgram,
    signs: Vec<f64>,
    n_unknowns: usize,
    n_outputs: usize,
}

/// A box, of which one unknown moves.
struct StateBox<'b> {
    low: &'b [f64],
    high: &'b [f64],
    moving: usize,
}

impl Motion for StateBox<'_> {
    fn time(&self) -> Interval {
        Interval::ZERO
    }

    fn state(&self, index: usize) -> Enclosure {
        Enclosure {
            value: Interval::hull(self.low[index], self.high[index]),
            rate: Interval::point(f64::from(index == self.moving)),
        }
    }
}

#[pymethods]
impl ModeBounds {
    /// The bounds for a mode, one entry per surface.
    #[new]
    fn new(system: &TracedSystem, mode: Vec<i8>) -> PyResult<Self> {
        let wrong = |e: filippov_expr::ExprError| PyValueError::new_err(e.to_string());
        let own = &system.system;
        let mut graph = own.graph().clone();
        let n_surfaces = graph.n_surfaces();
        if mode.len() != n_surfaces {
            return Err(PyValueError::new_err("mode: one entry per surface"));
        }
        let functions = (0..n_surfaces as u32).map(|j| graph.surface(j));
        let roots: Vec<NodeId> = own.field_nodes().iter().copied().chain(functions).collect();
        let sliding: Vec<usize> = (0..n_surfaces).filter(|&j| mode[j] == 0).collect();
        let n = own.field_nodes().len();
        // Of the canopy the last surface is folded first.
        let mut corners: Vec<Vec<NodeId>> = (0..1_usize << sliding.len())
            .map(|corner| {
                let side = |j: usize| match sliding.iter().position(|&k| k == j) {
                    Some(place) if corner >> place & 1 == 1 => 1.0,
                    Some(_) => -1.0,
                    None => f64::from(mode[j]),
                };
                let signs: Vec<Option<f64>> = (0..n_surfaces).map(|j| Some(side(j))).collect();
                graph.at_signs(&roots, &signs)
            })
            .collect();
        for place in (0..sliding.len()).rev() {
            let multiplier = graph.state((n + place) as u32);
            let above = corners.split_off(corners.len() / 2);
            for (minus, plus) in corners.iter_mut().zip(above) {
                for (minus, plus) in minus.iter_mut().zip(plus) {
                    if *minus != plus {
                        *minus = graph.between(multiplier, plus, *minus);
                    }
                }
            }
        }
        let outputs = corners.swap_remove(0);
        Ok(ModeBounds {
            program: EnclosureProgram::compile(&graph, &outputs).map_err(wrong)?,
            signs: mode.iter().map(|&entry| f64::from(entry)).collect(),
            n_unknowns: n + sliding.len(),
            n_outputs: outputs.len(),
        })
    }

    /// Bounds of the field and of all switching functions over a box, a row of both ends for each; and those of their derivatives by
    /// the unknowns, lower ones and upper ones.
    #[allow(clippy::type_complexity)]
    fn over<'py>(
        &self,
        py: Python<'py>,
        low: PyReadonlyArray1<'_, f64>,
        high: PyReadonlyArray1<'_, f64>,
        p: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<(
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
    )> {
        let (low, high, p) = (low.as_slice()?, high.as_slice()?, p.as_slice()?);
        if low.len() != self.n_unknowns || high.len() != self.n_unknowns {
            return Err(PyValueError::new_err("a number per unknown is needed"));
        }
        let (m, k) = (self.n_outputs, self.n_unknowns);
        let mut values = vec![vec![0.0; 2]; m];
        let (mut below, mut above) = (vec![vec![0.0; k]; m], vec![vec![0.0; k]; m]);
        let mut out = vec![Enclosure::UNKNOWN; m];
        for moving in 0..k {
            let place = StateBox { low, high, moving };
            self.program.eval(&place, &self.signs, p, &mut out);
            for (r, found) in out.iter().enumerate() {
                values[r] = vec![found.value.lo, found.value.hi];
                (below[r][moving], above[r][moving]) = (found.rate.lo, found.rate.hi);
            }
        }
        let array = |rows: &[Vec<f64>]| PyArray2::from_vec2(py, rows);
        Ok((array(&values)?, array(&below)?, array(&above)?))
    }
}
