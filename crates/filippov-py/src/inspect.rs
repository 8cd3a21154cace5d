//! Inspection of points: the field of a mode, what happens at a point, its hidden dynamics.

use filippov::switching::{HiddenOutcome, NormalFields};
use filippov::{Classification, Inspection, Mode};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::systems::{all_entries, core_of, n_visible_of, raised};

type Array<'py> = PyReadonlyArray1<'py, f64>;
type FieldAndMultipliers<'py> = (Bound<'py, PyArray1<f64>>, Vec<f64>);

/// The field of a mode with two and more zero entries and its multipliers; None if there are none.
#[pyfunction]
#[pyo3(signature = (system, t, x, mode, p, near))]
pub fn intersection_field<'py>(
    py: Python<'py>,
    system: &Bound<'py, PyAny>,
    t: f64,
    x: Array<'py>,
    mode: Vec<i8>,
    p: Array<'py>,
    near: Vec<f64>,
) -> PyResult<Option<FieldAndMultipliers<'py>>> {
    let x = x.as_slice()?;
    let (core, q) = core_of(system, p.as_slice()?, t, x)?;
    if x.len() != core.n_states() || mode.len() != n_visible_of(system, &*core) {
        return Err(PyValueError::new_err("x or mode has a wrong length"));
    }
    let mode = all_entries(system, (&*core, &q), t, x, mode)?;
    let value = filippov::intersection_field(&*core, (t, x), &q, &mode, &near);
    let value = value.map_err(raised)?;
    Ok(value.map(|value| (PyArray1::from_vec(py, value.dx), value.multipliers)))
}

/// What happens at a point; None if something is not finite. `how` are the distance that counts as met, the scaling of the
/// surfaces, and the mode before.
#[pyfunction]
#[pyo3(signature = (system, t, x, p, how))]
pub fn classify<'py>(
    py: Python<'py>,
    system: &Bound<'py, PyAny>,
    t: f64,
    x: Array<'py>,
    p: Array<'py>,
    how: (f64, Vec<f64>, Option<Vec<i8>>),
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let (reach, kappa, before) = how;
    let x = x.as_slice()?;
    let (core, q) = core_of(system, p.as_slice()?, t, x)?;
    let n_visible = n_visible_of(system, &*core);
    if x.len() != core.n_states() {
        return Err(PyValueError::new_err("x has a wrong length"));
    }
    if before
        .as_ref()
        .is_some_and(|before| before.len() != n_visible)
    {
        return Err(PyValueError::new_err("before has a wrong length"));
    }
    let before = before.map(|entries| all_entries(system, (&*core, &q), t, x, entries));
    let before = before.transpose()?;
    let how = Inspection {
        reach,
        kappa: &kappa,
        before: before.as_ref(),
        q: &q,
    };
    if let Some(mode) = &before {
        if let Some(j) = filippov::contradicts(&*core, t, x, how).map_err(raised)? {
            let (name, entry) = (
                core.surface_name(j),
                ["-", "0", "+"][(mode.entries()[j] + 1) as usize],
            );
            return Err(PyValueError::new_err(format!(
                "before: no motion whose entry is {entry} for {name} is at this point"
            )));
        }
    }
    let point = filippov::classify(&*core, t, x, how).map_err(raised)?;
    point.map(|point| as_dict(py, point, n_visible)).transpose()
}

fn as_dict(py: Python<'_>, point: Classification, n_visible: usize) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    let mode = |mode: &Mode| PyTuple::new(py, &mode.entries()[..n_visible]);
    dict.set_item("kind", point.kind.name())?;
    dict.set_item("surfaces", PyTuple::new(py, &point.surfaces)?)?;
    dict.set_item("mode", point.mode.as_ref().map(mode).transpose()?)?;
    dict.set_item("multipliers", PyTuple::new(py, &point.multipliers)?)?;
    let candidates: PyResult<Vec<_>> = point.candidates.iter().map(mode).collect();
    dict.set_item("candidates", PyTuple::new(py, candidates?)?)?;
    dict.set_item("unique", point.unique)?;
    dict.set_item("spirals", point.spirals)?;
    dict.set_item("leaf", point.leaf)?;
    dict.set_item("rule", point.rule)?;
    dict.set_item("reason", point.reason)?;
    dict.set_item("components", PyArray1::from_vec(py, point.components))?;
    let leading = point
        .leading
        .map(|sides| sides.map(|side| (side.order, side.value)));
    dict.set_item("leading", leading.map(Vec::from))?;
    Ok(dict)
}

/// Rest points, incoming state and outcome of the hidden dynamics of m surfaces.
#[pyfunction]
#[pyo3(signature = (components, before, kappa))]
pub fn hidden_dynamics<'py>(
    py: Python<'py>,
    components: Array<'py>,
    before: Option<Vec<i8>>,
    kappa: Vec<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let wrong = |text: String| PyValueError::new_err(text);
    let fields = NormalFields::new(kappa.len(), components.as_slice()?.to_vec())
        .map_err(|e| wrong(e.to_string()))?;
    if before
        .as_ref()
        .is_some_and(|before| before.len() != kappa.len())
    {
        return Err(wrong("before has a wrong length".into()));
    }
    let found = filippov::hidden_dynamics(&fields, before.map(Mode::new).as_ref(), &kappa);
    let dict = PyDict::new(py);
    let roots: Vec<_> = found
        .roots
        .into_iter()
        .map(|root| (root.lambda, root.is_stable))
        .collect();
    dict.set_item("roots", roots)?;
    dict.set_item("incoming", found.incoming)?;
    let (outcome, mode) = match found.outcome {
        None => ("not arriving", None),
        Some(HiddenOutcome::Region(mode)) => ("region", Some(mode)),
        Some(HiddenOutcome::Sliding {
            mode, oscillates, ..
        }) => (
            if oscillates { "oscillation" } else { "sliding" },
            Some(mode),
        ),
        Some(HiddenOutcome::OutwardSpiral { .. }) => ("spiral", None),
        Some(HiddenOutcome::AtRest) => ("at rest", None),
        Some(HiddenOutcome::Unknown) => ("unknown", None),
    };
    dict.set_item("outcome", outcome)?;
    let mode = mode.map(|mode| PyTuple::new(py, mode.entries()));
    dict.set_item("mode", mode.transpose()?)?;
    Ok(dict)
}
