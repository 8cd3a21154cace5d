//! The systems as Python objects.

use std::sync::{Arc, Mutex, PoisonError};

use filippov::derivative::Extension;
use filippov::motion::{SlidingField, SmoothField};
use filippov::{
    field_off_surfaces, surfaces_of_rounding, Definition, Error, FieldError, Law, Laws, Mode,
    OffSurfaces, PiecewiseSystem, Rules, Setting, SignStructure,
};
use filippov_expr::regularized::Ramp;
use filippov_expr::{Backend, Names, Regions};
use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::black_boxes::{OpaqueSystem, SignedSystem};
use crate::builder::{n_rows_without_number, Builder};
use crate::laws::{read_law, LawRow};

pub type Array<'py> = PyReadonlyArray1<'py, f64>;
pub type Output<'py> = Bound<'py, PyArray1<f64>>;
type SignsAndField<'py> = (Output<'py>, Output<'py>);

/// Hands an exception of a user's function back.
pub fn raised(error: FieldError) -> PyErr {
    match error.0.downcast::<PyErr>() {
        Ok(error) => *error,
        Err(_) => PyRuntimeError::new_err("a function of the system failed"),
    }
}

/// What the core refuses.
pub fn refused(error: Error) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A system of the core that can be run by threads.
pub type CoreSystem = Arc<dyn PiecewiseSystem + Send + Sync>;

/// The system of the core behind a Python object, with these parameter values, and its discrete states at a start
/// at (t, x).
pub fn core_of(
    system: &Bound<'_, PyAny>,
    p: &[f64],
    t: f64,
    x: &[f64],
) -> PyResult<(CoreSystem, Vec<f64>)> {
    if let Ok(traced) = system.cast::<TracedSystem>() {
        let (system, q) = traced.get().at(p, t, x)?;
        return Ok((Arc::new(system), q));
    }
    if let Ok(opaque) = system.cast::<OpaqueSystem>() {
        return Ok((Arc::clone(&opaque.get().system) as _, Vec::new()));
    }
    if let Ok(signed) = system.cast::<SignedSystem>() {
        return Ok((Arc::clone(&signed.get().system) as _, Vec::new()));
    }
    Err(PyTypeError::new_err(
        "system: a TracedSystem, OpaqueSystem or SignedSystem is needed",
    ))
}

/// How many of the surfaces of a system a user sees.
pub fn n_visible_of(system: &Bound<'_, PyAny>, core: &dyn PiecewiseSystem) -> usize {
    match system.cast::<TracedSystem>() {
        Ok(traced) => traced.get().n_visible(),
        Err(_) => core.n_surfaces(),
    }
}

/// The signs of all surfaces at a place from those that a user sees.
pub fn all_signs(
    system: &Bound<'_, PyAny>,
    (core, q): (&dyn PiecewiseSystem, &[f64]),
    t: f64,
    x: &[f64],
    seen: &[f64],
) -> PyResult<Vec<f64>> {
    match system.cast::<TracedSystem>() {
        Ok(traced) => traced
            .get()
            .all_signs((core, q), t, x, seen)
            .map_err(raised),
        Err(_) => Ok(seen.to_vec()),
    }
}

/// The entries of a mode for all surfaces at a place from those that a user sees.
pub fn all_entries(
    system: &Bound<'_, PyAny>,
    of: (&dyn PiecewiseSystem, &[f64]),
    t: f64,
    x: &[f64],
    seen: Vec<i8>,
) -> PyResult<Mode> {
    let signs: Vec<f64> = seen.into_iter().map(f64::from).collect();
    let all = all_signs(system, of, t, x, &signs)?;
    Ok(Mode::new(all.into_iter().map(|sign| sign as i8).collect()))
}

pub fn field_of<'py>(
    py: Python<'py>,
    (system, q): (&dyn PiecewiseSystem, &[f64]),
    t: f64,
    x: &Array<'py>,
    signs: &Array<'py>,
) -> PyResult<Output<'py>> {
    let (x, signs) = checked(system, x, signs)?;
    let mut dx = vec![0.0; system.n_states()];
    let place = Setting::new(signs, q).at(t, x);
    system.field(&place, &mut dx).map_err(raised)?;
    Ok(PyArray1::from_vec(py, dx))
}

/// The sliding field on one surface, and the normal components of both sides.
pub fn sliding_field_of<'py>(
    py: Python<'py>,
    (system, q): (&dyn PiecewiseSystem, &[f64]),
    t: f64,
    x: &Array<'py>,
    signs: &Array<'py>,
    surface: usize,
) -> PyResult<(Output<'py>, f64, f64)> {
    let (x, signs) = checked(system, x, signs)?;
    if surface >= signs.len() {
        return Err(PyValueError::new_err(format!("no surface {surface}")));
    }
    let mut field = SlidingField::new(system, surface, Setting::new(signs, q));
    let mut dx = vec![0.0; x.len()];
    field.eval(t, &mut x.to_vec(), &mut dx).map_err(raised)?;
    let a = field.last();
    Ok((PyArray1::from_vec(py, dx), a.minus, a.plus))
}

pub fn surface_values_of<'py>(
    py: Python<'py>,
    (system, q): (&dyn PiecewiseSystem, &[f64]),
    t: f64,
    x: &Array<'py>,
    signs: &Array<'py>,
) -> PyResult<Output<'py>> {
    let (x, signs) = checked(system, x, signs)?;
    let mut h = vec![0.0; system.n_surfaces()];
    let place = Setting::new(signs, q).at(t, x);
    system.surfaces(&place, &mut h).map_err(raised)?;
    Ok(PyArray1::from_vec(py, h))
}

fn checked<'a>(
    system: &dyn PiecewiseSystem,
    x: &'a Array<'_>,
    signs: &'a Array<'_>,
) -> PyResult<(&'a [f64], &'a [f64])> {
    let (x, signs) = (x.as_slice()?, signs.as_slice()?);
    if x.len() != system.n_states() {
        let text = format!(
            "x has length {}, but the system has {} states",
            x.len(),
            system.n_states()
        );
        return Err(PyValueError::new_err(text));
    }
    if signs.len() != system.n_surfaces() {
        let text = format!(
            "signs has length {}, but the system has {} surfaces",
            signs.len(),
            system.n_surfaces()
        );
        return Err(PyValueError::new_err(text));
    }
    Ok((x, signs))
}

/// Extensions of a system that are remembered.
const MOST_EXTENSIONS: usize = 8;

/// A system given by a traced expression graph.
#[pyclass(frozen, module = "filippov._core")]
pub struct TracedSystem {
    pub system: filippov::TracedSystem,
    /// What it has beside the field.
    rules: Rules,
    /// Its extensions by parameters, those asked for last.
    extensions: Mutex<Vec<(Vec<usize>, Arc<Extension>)>>,
    /// The laws of its discrete states, whose number is that of the last parameters' names.
    pub laws: Arc<Laws>,
    n_visible: usize,
}

impl TracedSystem {
    pub fn build(definition: Definition) -> PyResult<Self> {
        let rules = definition.rules.clone();
        definition.check().map_err(refused)?;
        let n_visible = definition.n_visible();
        let (system, laws) = definition.build(Backend::Auto).map_err(refused)?;
        Ok(TracedSystem {
            system,
            laws: Arc::new(laws),
            rules,
            extensions: Mutex::default(),
            n_visible,
        })
    }

    /// The system with these parameters as further states; made once.
    pub fn extension(&self, parameters: &[usize]) -> PyResult<Arc<Extension>> {
        let mut known = self
            .extensions
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = known.iter().find(|entry| entry.0 == parameters) {
            return Ok(Arc::clone(found));
        }
        let made = Extension::new(&self.system, &self.rules, parameters).map_err(refused)?;
        let made = Arc::new(made);
        if known.len() == MOST_EXTENSIONS {
            known.remove(0);
        }
        known.push((parameters.to_vec(), Arc::clone(&made)));
        Ok(made)
    }

    /// Everything that it was made of.
    pub fn definition(&self) -> Definition {
        Definition::of(&self.system, &self.rules)
    }

    /// The system with these parameter values.
    pub fn with(&self, p: &[f64]) -> filippov::TracedSystem {
        self.system.with_parameters(p.to_vec())
    }

    /// The system with these parameter values, and its discrete states at a start at (t, x).
    pub fn at(&self, p: &[f64], t: f64, x: &[f64]) -> PyResult<(filippov::TracedSystem, Vec<f64>)> {
        let system = self.with(p);
        let q = match x.len() == system.n_states() {
            true => self.laws.start(&system, t, x).map_err(raised)?,
            false => Vec::new(),
        };
        Ok((system, q))
    }

    /// The names of the discrete states.
    pub fn law_names(&self) -> Vec<String> {
        let names = &self.system.names().parameters;
        names[names.len() - self.rules.laws.len()..].to_vec()
    }

    /// How many surfaces a user sees: those that no motion crosses and those of the laws come after them.
    pub fn n_visible(&self) -> usize {
        self.n_visible
    }

    /// The signs of all surfaces at a place from those that a user sees: those of laws are positive, and the others follow
    /// from the discrete states.
    fn all_signs(
        &self,
        (core, q): (&dyn PiecewiseSystem, &[f64]),
        t: f64,
        x: &[f64],
        seen: &[f64],
    ) -> Result<Vec<f64>, FieldError> {
        let (n, n_of_laws) = (core.n_surfaces(), self.rules.n_hidden);
        let mut signs = seen.to_vec();
        if signs.len() != self.n_visible || x.len() != core.n_states() {
            return Ok(signs);
        }
        signs.resize(n, 1.0);
        if self.n_visible < n - n_of_laws {
            let mut h = vec![0.0; n];
            let place = Setting::new(&signs, q).at(t, x);
            core.surfaces(&place, &mut h)?;
            for j in self.n_visible..n - n_of_laws {
                signs[j] = if h[j] < 0.0 { -1.0 } else { 1.0 };
            }
        }
        Ok(signs)
    }

    /// The same as an array.
    fn complete<'py>(
        &self,
        py: Python<'py>,
        of: (&dyn PiecewiseSystem, &[f64]),
        t: f64,
        x: &Array<'py>,
        seen: &Array<'py>,
    ) -> PyResult<Array<'py>> {
        let all = self.all_signs(of, t, x.as_slice()?, seen.as_slice()?);
        let all = all.map_err(raised)?;
        Ok(PyArray1::from_vec(py, all).readonly())
    }
}

#[pymethods]
impl TracedSystem {
    #[new]
    #[pyo3(signature = (builder, field, n_states, parameters, states=None, watched=Vec::new(), laws=Vec::new(), n_hidden=0, sticking=Vec::new(), beside=Vec::new()))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        builder: Py<Builder>,
        field: Vec<u32>,
        n_states: usize,
        parameters: Vec<String>,
        states: Option<Vec<String>>,
        watched: Vec<usize>,
        laws: Vec<LawRow>,
        n_hidden: usize,
        sticking: Vec<(usize, u32)>,
        beside: Vec<usize>,
    ) -> PyResult<Self> {
        if field.len() != n_states {
            let text = format!(
                "field: {n_states} expressions are needed, one per state, not {}",
                field.len()
            );
            return Err(PyValueError::new_err(text));
        }
        let graph = builder.borrow(py).graph().clone();
        let field = field
            .into_iter()
            .map(|id| Builder::node(&graph, id))
            .collect::<PyResult<Vec<_>>>()?;
        let names = Names {
            states: states.unwrap_or_default(),
            parameters,
        };
        let laws = laws.iter().map(|row| read_law(&graph, row));
        let sticking = sticking
            .iter()
            .map(|&(surface, ratio)| Ok((surface, Builder::node(&graph, ratio)?)));
        let rules = Rules {
            watched,
            laws: laws.collect::<PyResult<_>>()?,
            n_hidden,
            sticking: sticking.collect::<PyResult<_>>()?,
            beside,
        };
        let definition = Definition {
            graph,
            field,
            names,
            rules,
        };
        Self::build(definition)
    }

    #[getter]
    fn n_states(&self) -> usize {
        self.system.n_states()
    }

    #[getter]
    fn n_surfaces(&self) -> usize {
        self.n_visible()
    }

    #[getter]
    fn n_laws(&self) -> usize {
        self.laws.list().len()
    }

    /// The indices of the laws that a run does not follow, since nothing reads their discrete states.
    fn idle_laws(&self) -> Vec<usize> {
        self.laws.idle()
    }

    fn surfaces(&self) -> Vec<String> {
        (0..self.n_visible())
            .map(|j| self.system.surface_name(j))
            .collect()
    }

    /// The names of the discrete states that actions set.
    fn discrete(&self) -> Vec<String> {
        self.law_names()[..self.laws.n_named()].to_vec()
    }

    fn field<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        x: Array<'py>,
        signs: Array<'py>,
        p: Array<'py>,
    ) -> PyResult<Output<'py>> {
        let (system, q) = self.at(p.as_slice()?, t, x.as_slice()?)?;
        let signs = self.complete(py, (&system, &q), t, &x, &signs)?;
        field_of(py, (&system, &q), t, &x, &signs)
    }

    fn surface_values<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        x: Array<'py>,
        signs: Array<'py>,
        p: Array<'py>,
    ) -> PyResult<Output<'py>> {
        let (system, q) = self.at(p.as_slice()?, t, x.as_slice()?)?;
        let signs = self.complete(py, (&system, &q), t, &x, &signs)?;
        let all = surface_values_of(py, (&system, &q), t, &x, &signs)?;
        let visible = all.readonly().as_slice()?[..self.n_visible()].to_vec();
        Ok(PyArray1::from_vec(py, visible))
    }

    /// The field and behind it the switching functions at several places, a row for each.
    fn right_hand_sides<'py>(
        &self,
        py: Python<'py>,
        times: Array<'py>,
        states: PyReadonlyArray2<'py, f64>,
        signs: PyReadonlyArray2<'py, f64>,
        p: Array<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let system = self.with(p.as_slice()?);
        let (n, n_visible) = (system.n_states(), self.n_visible());
        let (times, places) = (times.as_slice()?, [states.shape(), signs.shape()]);
        if places != [[times.len(), n], [times.len(), n_visible]] {
            let text = format!("states and signs have the shapes {places:?}");
            return Err(PyValueError::new_err(text));
        }
        let (states, signs) = (states.as_slice()?, signs.as_slice()?);
        let mut h = vec![0.0; system.n_surfaces()];
        let mut rows = Vec::with_capacity(times.len());
        for (k, &t) in times.iter().enumerate() {
            let x = &states[k * n..][..n];
            let q = self.laws.start(&system, t, x).map_err(raised)?;
            let seen = &signs[k * n_visible..][..n_visible];
            let all = self.all_signs((&system, &q), t, x, seen).map_err(raised)?;
            let place = Setting::new(&all, &q).at(t, x);
            let mut row = vec![0.0; n];
            system.field(&place, &mut row).map_err(raised)?;
            system.surfaces(&place, &mut h).map_err(raised)?;
            row.extend_from_slice(&h[..n_visible]);
            rows.push(row);
        }
        Ok(PyArray2::from_vec2(py, &rows)?)
    }

    /// The signs and the field at a point on no surface: see `field_off_surfaces` of the core.
    fn off_surfaces<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        x: Array<'py>,
        p: Array<'py>,
    ) -> PyResult<Option<SignsAndField<'py>>> {
        let x = x.as_slice()?;
        if x.len() != self.system.n_states() {
            return Err(PyValueError::new_err("x: one entry per state is needed"));
        }
        let (system, q) = self.at(p.as_slice()?, t, x)?;
        let complete = |seen: &[f64]| self.all_signs((&system, &q), t, x, seen);
        let found = field_off_surfaces(&system, self.n_visible(), complete, &q, (t, x));
        let as_arrays = |OffSurfaces { signs, field }| {
            (PyArray1::from_vec(py, signs), PyArray1::from_vec(py, field))
        };
        Ok(found.map_err(raised)?.map(as_arrays))
    }

    /// The surfaces whose functions are nothing but rounding at a point: see `surfaces_of_rounding` of the core.
    fn surfaces_of_rounding(&self, t: f64, x: Array<'_>, p: Array<'_>) -> PyResult<Vec<usize>> {
        let x = x.as_slice()?;
        let (system, q) = self.at(p.as_slice()?, t, x)?;
        let complete = |seen: &[f64]| self.all_signs((&system, &q), t, x, seen);
        surfaces_of_rounding(&system, self.n_visible(), complete, &q, (t, x)).map_err(raised)
    }

    #[allow(clippy::too_many_arguments)]
    fn sliding_field<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        x: Array<'py>,
        signs: Array<'py>,
        p: Array<'py>,
        surface: usize,
    ) -> PyResult<(Output<'py>, f64, f64)> {
        let (system, q) = self.at(p.as_slice()?, t, x.as_slice()?)?;
        let signs = self.complete(py, (&system, &q), t, &x, &signs)?;
        sliding_field_of(py, (&system, &q), t, &x, &signs, surface)
    }

    fn active(&self, signs: Array<'_>) -> PyResult<Vec<bool>> {
        let mut active = vec![true; self.system.n_surfaces()];
        if signs.as_slice()?.len() != self.n_visible() {
            return Err(PyValueError::new_err(
                "signs: one entry per surface is needed",
            ));
        }
        let mut all = signs.as_slice()?.to_vec();
        all.resize(active.len(), 1.0);
        self.system.active(&all, &[], &mut active);
        active.truncate(self.n_visible());
        Ok(active)
    }

    fn switches_at(&self, surface: usize) -> bool {
        surface < self.system.n_surfaces() && self.system.switches_at(surface)
    }

    /// How many of the first rows of parameters leave no switching function a number that moves for others.
    fn n_rows_without_number(&self, table: PyReadonlyArray2<'_, f64>) -> PyResult<usize> {
        let graph = self.system.graph();
        let surfaces = (0..self.n_visible()).map(|j| graph.surface(j as u32));
        let moving: Vec<_> = surfaces.filter(|&h| graph.depends_on_motion(h)).collect();
        n_rows_without_number(graph, (&moving, &[]), &table)
    }

    /// Whether the field may jump at a surface in a mode; if not, the field has a kink there, or is smooth.
    fn jumps_across(&self, surface: usize, mode: Array<'_>) -> PyResult<bool> {
        let mode = mode.as_slice()?;
        if mode.len() != self.n_visible() || surface >= mode.len() {
            return Err(PyValueError::new_err(
                "mode: one entry per surface is needed",
            ));
        }
        let sliding: Vec<usize> = (0..mode.len()).filter(|&j| mode[j] == 0.0).collect();
        let mut signs = mode.to_vec();
        signs.resize(self.system.n_surfaces(), 1.0);
        Ok(self.system.jumps_across(surface, &signs, &sliding))
    }

    /// The combinations of signs of all surfaces that points have, as far as that is known; none if there are more than `most`.
    fn sign_combinations(&self, most: usize) -> Option<Vec<Vec<f64>>> {
        // The values of the parameters are left open.
        Regions::new(self.system.graph().clone(), Vec::new(), Vec::new()).combinations(most)
    }

    fn is_native(&self) -> bool {
        self.system.is_native()
    }

    /// Which discrete states are those of relays with two thresholds.
    fn relays(&self) -> Vec<usize> {
        let laws = self.laws.list().iter().enumerate();
        let relays = laws.filter(|(_, law)| matches!(law, Law::Hysteresis { .. }));
        relays.map(|(index, _)| index).collect()
    }

    /// The names of all discrete states, those of laws included.
    fn laws(&self) -> Vec<String> {
        self.law_names()
    }

    /// The system in which a function of `kappa[j] * h_j / eps` replaces every sign; `eps` is its last parameter.
    fn regularized(&self, eps: &str, kappa: Vec<f64>, is_linear: bool) -> PyResult<Self> {
        if kappa.len() != self.system.n_surfaces() || !self.law_names().is_empty() {
            return Err(PyValueError::new_err(
                "a number per surface, and no laws, are needed",
            ));
        }
        if !self.rules.sticking.is_empty() {
            return Err(PyValueError::new_err(
                "static friction above kinetic has no smooth twin",
            ));
        }
        let ramp = if is_linear { Ramp::Linear } else { Ramp::Tanh };
        let twin = self.definition().regularized(eps, &kappa, ramp);
        let entangled = "a function contains more signs than can be smoothed together";
        Self::build(twin.ok_or_else(|| PyValueError::new_err(entangled))?)
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.definition().to_bytes())
    }

    #[staticmethod]
    fn from_bytes(data: &[u8]) -> PyResult<Self> {
        Self::build(Definition::from_bytes(data).map_err(refused)?)
    }
}
