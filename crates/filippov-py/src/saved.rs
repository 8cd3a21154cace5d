//! Traced systems as bytes: with the values of their parameters, and with their actions.

use filippov::action::{Clock, Trigger};
use filippov::{SavedAction, SavedSystem};
use filippov_web::unpack;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::systems::{refused, TracedSystem};

/// When, numbers that say so, the map unless it is a function of Python, and the name of an action.
type SavedRow = (String, Vec<f64>, Option<Py<TracedSystem>>, String);

/// The system, its names of states, the names and the default values of its parameters, the values for which alone it
/// holds, and its actions.
type Loaded = (
    TracedSystem,
    Vec<String>,
    Vec<String>,
    Vec<f64>,
    Option<Vec<f64>>,
    Vec<SavedRow>,
);

/// A system with everything that belongs to it, as bytes.
#[pyfunction]
pub fn save_system<'py>(
    py: Python<'py>,
    system: Bound<'py, TracedSystem>,
    defaults: Vec<f64>,
    valid_for: Option<Vec<f64>>,
    actions: Vec<SavedRow>,
) -> PyResult<Bound<'py, PyBytes>> {
    let action = |(when, numbers, map, name): SavedRow| {
        Ok(SavedAction {
            trigger: read_trigger(&when, &numbers)?,
            map: map.map(|map| map.get().definition()),
            name,
        })
    };
    let saved = SavedSystem {
        definition: system.get().definition(),
        defaults,
        valid_for,
        actions: actions
            .into_iter()
            .map(action)
            .collect::<PyResult<Vec<_>>>()?,
    };
    saved.check().map_err(refused)?;
    Ok(PyBytes::new(py, &saved.to_bytes()))
}

/// What [`save_system`] wrote, with the section of a page behind it or without.
#[pyfunction]
pub fn load_system(py: Python<'_>, data: &[u8]) -> PyResult<Loaded> {
    let (saved, _) = unpack(data).map_err(refused)?;
    let actions = saved.actions.into_iter().map(|action| {
        let (when, numbers) = trigger_row(action.trigger);
        let map = action.map.map(TracedSystem::build);
        let map = map.transpose()?.map(|map| Py::new(py, map)).transpose()?;
        Ok((when.to_owned(), numbers, map, action.name))
    });
    let actions = actions.collect::<PyResult<Vec<_>>>()?;
    let names = &saved.definition.names;
    let states = names.states.clone();
    let parameters = names.parameters[..saved.definition.n_parameters()].to_vec();
    let system = TracedSystem::build(saved.definition)?;
    Ok((
        system,
        states,
        parameters,
        saved.defaults,
        saved.valid_for,
        actions,
    ))
}

/// When an action happens, from its name and numbers: the surface, the direction and the side of a start, the times, or the period and the
/// phase of a clock, and 0 if a tick at the start of the run does not count.
pub fn read_trigger(when: &str, numbers: &[f64]) -> PyResult<Trigger> {
    let ticks = |period, phase, at_start| Trigger::Clock {
        clock: Clock { period, phase },
        at_start,
    };
    Ok(match (when, numbers) {
        ("surface", &[index, direction, side]) => Trigger::Surface {
            index: index as usize,
            direction: direction as i8,
            side: if side < 0.0 { -1 } else { 1 },
        },
        ("times", times) => Trigger::Times(times.to_vec()),
        ("jump", []) => Trigger::Jump,
        ("clock", &[period, phase]) => ticks(period, phase, true),
        ("clock", &[period, phase, at_start]) => ticks(period, phase, at_start != 0.0),
        _ => return Err(PyValueError::new_err(format!("unknown trigger {when:?}"))),
    })
}

/// The opposite of [`read_trigger`].
fn trigger_row(trigger: Trigger) -> (&'static str, Vec<f64>) {
    match trigger {
        Trigger::Surface {
            index,
            direction,
            side,
        } => (
            "surface",
            vec![index as f64, f64::from(direction), f64::from(side)],
        ),
        Trigger::Times(times) => ("times", times),
        Trigger::Jump => ("jump", Vec::new()),
        Trigger::Clock {
            clock: Clock { period, phase },
            at_start: true,
        } => ("clock", vec![period, phase]),
        Trigger::Clock {
            clock: Clock { period, phase },
            at_start: false,
        } => ("clock", vec![period, phase, 0.0]),
    }
}
