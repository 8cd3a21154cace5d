//! A clock that a caller advances, for runs that are to end at a limit of time in the same place on every computer.

use std::sync::Arc;
use std::time::Duration;

use filippov::Clock;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A clock that stands still unless it is advanced, by `advance` and by every look at it.
#[pyclass(frozen, module = "filippov._core")]
pub struct ManualClock(Arc<filippov::ManualClock>);

#[pymethods]
impl ManualClock {
    #[new]
    #[pyo3(signature = (per_look=0.0))]
    fn new(per_look: f64) -> PyResult<Self> {
        let per_look = duration("per_look", per_look)?;
        Ok(ManualClock(Arc::new(filippov::ManualClock::new(per_look))))
    }

    /// Advances it by some seconds.
    fn advance(&self, seconds: f64) -> PyResult<()> {
        self.0.advance(duration("seconds", seconds)?);
        Ok(())
    }

    /// How far it was advanced, in seconds.
    #[getter]
    fn seconds(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

impl ManualClock {
    /// The same clock, as an option of a run.
    pub fn as_clock(&self) -> Clock {
        Clock::Manual(Arc::clone(&self.0))
    }
}

fn duration(name: &str, seconds: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(seconds).map_err(|_| {
        PyValueError::new_err(format!(
            "{name}: must be finite and not negative, it is {seconds}"
        ))
    })
}
