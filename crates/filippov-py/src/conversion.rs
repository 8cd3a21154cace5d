//! Conversions between Python objects and slices.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Reads a sequence or array of `n` numbers into `out`.
pub fn read_vector(value: &Bound<'_, PyAny>, out: &mut [f64], what: &str) -> PyResult<()> {
    if let Ok(tuple) = value.cast::<PyTuple>() {
        if tuple.len() == out.len() {
            for (slot, item) in out.iter_mut().zip(tuple.iter()) {
                *slot = item.extract()?;
            }
            return Ok(());
        }
    }
    if let Ok(array) = value.cast::<PyArray1<f64>>() {
        let array = array.readonly();
        if let Some(values) = array
            .as_slice()
            .ok()
            .filter(|values| values.len() == out.len())
        {
            out.copy_from_slice(values);
            return Ok(());
        }
    }
    let values: Vec<f64> = value.extract()?;
    if values.len() != out.len() {
        return Err(PyValueError::new_err(format!(
            "{what} returned {} values for a state of {}",
            values.len(),
            out.len()
        )));
    }
    out.copy_from_slice(&values);
    Ok(())
}

/// Reads one number, also from an array with one element.
pub fn read_scalar(value: &Bound<'_, PyAny>) -> PyResult<f64> {
    value
        .extract()
        .or_else(|_| value.call_method0("item")?.extract())
}

/// A (rows, columns) array from columns stored one after the other.
pub fn columns<'py>(py: Python<'py>, data: &[f64], n_rows: usize) -> Bound<'py, PyArray2<f64>> {
    let n_columns = data.len().checked_div(n_rows).unwrap_or(0);
    let array = PyArray2::zeros(py, [n_rows, n_columns], false);
    {
        let mut guard = array.readwrite();
        let mut view = guard.as_array_mut();
        for (c, column) in data.chunks_exact(n_rows.max(1)).enumerate() {
            for (r, value) in column.iter().enumerate() {
                view[[r, c]] = *value;
            }
        }
    }
    array
}
