//! The runs of an ensemble, kept in few bytes each where only their ends are.

use std::sync::{Mutex, PoisonError};

use filippov::{EndOnly, Solution};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::derivatives::{Failure, RunDerivatives};
use crate::prepared_run::PreparedRun;
use crate::run::{is_interruption, Run};

/// A run with the derivatives that were wanted of it.
pub type Outcome = Result<(Solution, Option<RunDerivatives>), Failure>;

/// The runs of an ensemble, in the order of its members.
#[pyclass(frozen, module = "filippov._core")]
#[derive(Default)]
pub struct Runs(Mutex<Members>);

#[derive(Default)]
struct Members {
    list: Vec<Member>,
    /// The systems of neighbouring members, each with the place of the first of them.
    systems: Vec<(usize, Py<PyAny>, f64)>,
}

enum Member {
    Whole(Py<Run>),
    /// The run is made again from its system and parameters when it is asked for.
    Lean(Box<Lean>),
}

/// What is left of a run, and what it is made again from.
struct Lean {
    end: EndOnly,
    p: Box<[f64]>,
    is_native: bool,
}

/// What a thread hands over of a run: where that is all that is kept, its end. The record goes where it was made, so that the next
/// run of the thread takes its place.
pub enum Finished {
    End(EndOnly),
    Whole(Box<Outcome>),
}

impl Finished {
    /// What is kept of the run of a prepared one.
    pub fn of(prepared: &PreparedRun, outcome: Outcome) -> Self {
        let end = match &outcome {
            Ok((solution, None)) if prepared.is_plain() => EndOnly::of(solution),
            _ => None,
        };
        end.map_or_else(|| Finished::Whole(Box::new(outcome)), Finished::End)
    }

    /// Was it stopped by an exception that asks for the end of all?
    pub fn is_interruption(&self) -> bool {
        let Finished::Whole(outcome) = self else {
            return false;
        };
        matches!(&**outcome, Ok((solution, _)) if is_interruption(solution))
    }
}

impl Runs {
    fn members(&self) -> std::sync::MutexGuard<'_, Members> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Members of this system follow, so many of them, from this time on.
    pub fn begin(&self, system: &Bound<'_, PyAny>, t0: f64, count: usize) {
        let mut members = self.members();
        let first = members.list.len();
        members.list.reserve_exact(count);
        members.systems.push((first, system.clone().unbind(), t0));
    }

    /// Adds a run of a prepared one, whose parameters are `p`.
    pub fn push(
        &self,
        py: Python<'_>,
        prepared: PreparedRun,
        finished: Finished,
        p: Vec<f64>,
    ) -> PyResult<()> {
        let member = match finished {
            Finished::End(end) => Member::Lean(Box::new(Lean {
                end,
                p: p.into(),
                is_native: prepared.is_native(),
            })),
            Finished::Whole(outcome) => {
                let (solution, derivatives) = (*outcome).map_err(PyErr::from)?;
                Member::Whole(Py::new(py, prepared.result(solution, derivatives))?)
            }
        };
        self.members().list.push(member);
        Ok(())
    }

    /// Was one of the runs from this one on stopped by the caller?
    pub fn was_interrupted(&self, first: usize) -> bool {
        let members = self.members();
        let mut later = members.list[first..].iter();
        later.any(|member| matches!(member, Member::Whole(run) if run.get().was_interrupted()))
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.members().list.len()
    }

    fn column<T>(&self, whole: impl Fn(&Run) -> T, lean: impl Fn(&EndOnly) -> T) -> Vec<T> {
        let members = self.members();
        let value = |member: &Member| match member {
            Member::Whole(run) => whole(run.get()),
            Member::Lean(kept) => lean(&kept.end),
        };
        members.list.iter().map(value).collect()
    }
}

#[pymethods]
impl Runs {
    #[new]
    fn new() -> Self {
        Runs::default()
    }

    fn __len__(&self) -> usize {
        self.len()
    }

    fn __getitem__(&self, py: Python<'_>, index: isize) -> PyResult<Py<Run>> {
        let members = self.members();
        let n = members.list.len();
        let place = if index < 0 { index + n as isize } else { index };
        let place = usize::try_from(place).ok().filter(|&place| place < n);
        let place = place.ok_or_else(|| PyIndexError::new_err("no such run"))?;
        match &members.list[place] {
            Member::Whole(run) => Ok(run.clone_ref(py)),
            Member::Lean(kept) => {
                let after = members
                    .systems
                    .partition_point(|(first, ..)| *first <= place);
                let (_, system, t0) = &members.systems[after - 1];
                let solution = kept.end.solution();
                let y0 = solution.first_state().to_vec();
                let system = system.bind(py);
                let mut prepared = PreparedRun::new(system, *t0, y0, kept.p.to_vec(), &[], &[])?;
                prepared.set_native(kept.is_native);
                Py::new(py, prepared.result(solution, None))
            }
        }
    }

    /// The last time of each run.
    #[getter]
    fn t_last<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.column(Run::last_time, EndOnly::t_last))
    }

    /// The states there, shape (runs, n).
    #[getter]
    fn y_last<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let states = self.column(Run::last_state, |end| end.last_state().to_vec());
        let shape = [states.len(), states.first().map_or(0, Vec::len)];
        PyArray1::from_vec(py, states.concat()).reshape(shape)
    }

    /// The status of each run.
    #[getter]
    fn status<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let status = self.column(|run| i64::from(run.status_code()), |_| 0);
        PyArray1::from_vec(py, status)
    }

    /// How many warnings each run has.
    #[getter]
    fn n_warnings<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_vec(py, self.column(|run| run.count_warnings() as i64, |_| 0))
    }
}
