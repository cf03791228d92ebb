//! Tables of the library as numpy arrays.

use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use study::export::table::{Table, Values};

/// Names and descriptions of columns.
pub type About = Vec<(String, String)>;

/// Returns the columns of a table by their names.
///
/// # Errors
/// An exception of Python.
pub fn columns<'py>(py: Python<'py>, table: &Table) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for column in &table.columns {
        match &column.values {
            Values::Real(values) | Values::Exact(values) => {
                dict.set_item(&*column.name, values.clone().into_pyarray(py))?
            }
            Values::Int(values) => dict.set_item(&*column.name, values.clone().into_pyarray(py))?,
            Values::Text(values) => dict.set_item(&*column.name, values)?,
        }
    }
    Ok(dict)
}

/// Returns the names and descriptions of a table's columns.
pub fn about(table: &Table) -> About {
    table.columns.iter().map(|column| (column.name.to_string(), column.about.to_string())).collect()
}
