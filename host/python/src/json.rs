//! Records of the library as Python objects.

use crate::failure::Failure;
use pyo3::prelude::*;
use serde::Serialize;
use serde_json::Value;

/// Returns a record as a Python object.
///
/// # Errors
/// A record that JSON cannot hold, and an exception of Python.
pub fn record<'py>(py: Python<'py>, record: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    object(py, &value(record)?)
}

/// Returns a record as JSON.
///
/// # Errors
/// A record that JSON cannot hold.
pub fn value(record: &impl Serialize) -> Result<Value, Failure> {
    serde_json::to_value(record).map_err(|error| Failure::parameter("record", error.to_string()))
}

/// Returns the Python object of a JSON value: dictionaries, lists, numbers, texts, flags and `None`.
///
/// # Errors
/// An exception of Python.
pub fn object<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (value.to_string(),))
}
