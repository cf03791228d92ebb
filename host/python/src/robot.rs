//! A robot: every parameter of the model, by the keys of a robot file.

use crate::failure::Failure;
use crate::json;
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyMapping, PySequence, PyString, PyTuple, PyType};
use sim::params;
use sim::return_to_rest::TimeConstants;
use std::path::PathBuf;
use study::plan::{PHYSICAL, PUBLISHED, RobotFile, robot, robot_keys, with_fit};
use toml::{Table, Value};

/// Parameters of a robot, its fluid and the solver. It never changes.
#[pyclass(frozen, module = "biflag")]
pub struct Robot {
    pub params: params::Robot,
    /// Name of a built-in robot or of a file, and its text, as stored in logs.
    pub file: RobotFile,
}

impl Robot {
    fn of_file(file: RobotFile) -> Result<Self, Failure> {
        Ok(Self { params: file.parse()?, file })
    }

    /// Returns the robot with computed parameters.
    pub fn of_params(params: params::Robot, name: &str) -> Self {
        let text = to_toml(&params);
        Self { params, file: RobotFile { name: name.to_owned(), text } }
    }

    /// Returns the text of a robot file with other parameters and this robot's fit.
    fn text_of(&self, params: &params::Robot) -> Result<String, Failure> {
        Ok(with_fit(params, self.file.fit()?.as_ref()))
    }

    /// Returns the parameters with other values.
    fn with(&self, changes: &[(String, Option<Value>)]) -> Result<params::Robot, Failure> {
        // Numbers, flags, names and short lists all have a form in TOML.
        let mut table = Table::try_from(&self.params).unwrap_or_default();
        for (key, value) in changes {
            put(&mut table, key, value.clone())?;
        }
        Value::Table(table).try_into().map_err(|error: toml::de::Error| match changes {
            [(key, _)] => Failure::parameter(key, error.message().trim()),
            // The error names the first change that is wrong by itself.
            changes => (changes.chunks(1).find_map(|one| self.with(one).err()))
                .unwrap_or_else(|| Failure::parameter("changes", error.message().trim())),
        })
    }
}

#[pymethods]
impl Robot {
    /// Returns the robot with the laboratory's choices, which reproduces the published angles.
    #[staticmethod]
    fn published() -> Result<Self, Failure> {
        Self::of_file(RobotFile::built_in(PUBLISHED))
    }

    /// Returns the robot in glycerin, the default.
    #[staticmethod]
    fn physical() -> Result<Self, Failure> {
        Self::of_file(RobotFile::built_in(PHYSICAL))
    }

    /// Reads a robot file, or returns the built-in robot of that name.
    #[staticmethod]
    fn load(path: PathBuf) -> Result<Self, Failure> {
        Self::of_file(robot::load(&path)?)
    }

    /// Returns the robot of the text of a robot file.
    #[staticmethod]
    fn from_toml(text: &str) -> Result<Self, Failure> {
        Self::of_file(RobotFile { name: "robot".to_owned(), text: text.to_owned() })
    }

    /// Returns a robot with other values of some parameters. `None` removes an optional one.
    fn replace(&self, changes: &Bound<'_, PyMapping>) -> PyResult<Self> {
        let mut values = Vec::new();
        for entry in changes.items()?.iter() {
            let (key, value): (String, Bound<'_, PyAny>) = entry.extract()?;
            let value = value_of(&key, &value)?;
            values.push((key, value));
        }
        let params = self.with(&values)?;
        params.validate().map_err(Failure::from)?;
        let base = self.file.name.trim_end_matches(" (changed)");
        let (name, text) = (format!("{base} (changed)"), self.text_of(&params)?);
        Ok(Self { params, file: RobotFile { name, text } })
    }

    /// Returns every parameter as the text of a robot file, with the uncertainties of fitted parameters.
    fn to_toml(&self) -> Result<String, Failure> {
        self.text_of(&self.params)
    }

    /// Returns every parameter as a dictionary of tables.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::record(py, &self.params)
    }

    /// Returns the keys of all parameters, each with its meaning, unit and source.
    #[staticmethod]
    fn keys(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let keys = PyDict::new(py);
        robot_keys().into_iter().try_for_each(|(key, about)| keys.set_item(key, about))?;
        Ok(keys)
    }

    /// Returns the time constants of the return to rest of yaw and tilt, s; infinite if nothing brings the robot back.
    fn time_constants(&self) -> Result<(f64, f64), Failure> {
        let constants = TimeConstants::of(&self.params).map_err(Failure::from)?;
        Ok((constants.yaw_s, constants.tilt_s))
    }

    /// Name of the built-in robot or of its file.
    #[getter]
    fn name(&self) -> &str {
        &self.file.name
    }

    fn __getitem__<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyAny>> {
        let table = json::value(&self.params)?;
        let found = key.split('.').try_fold(&table, |value, part| value.get(part));
        json::object(py, found.ok_or_else(|| PyKeyError::new_err(key.to_owned()))?)
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.params == other.params
    }

    fn __hash__(&self) -> u64 {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        to_toml(&self.params).hash(&mut hasher);
        hasher.finish()
    }

    fn __repr__(&self) -> String {
        let fluid = self.params.fluid.viscosity();
        format!("<biflag.Robot {}: {} edges a flagellum, {fluid} Pa s>", self.file.name, self.params.flagellum.edges())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let rebuild = PyType::new::<Self>(py).getattr("_of_file")?;
        let text = if self.file.text.is_empty() { String::new() } else { self.to_toml()? };
        Ok((rebuild, (self.file.name.as_str(), text).into_pyobject(py)?))
    }

    /// Returns the robot of a name and a text, as stored in logs.
    #[staticmethod]
    fn _of_file(name: String, text: String) -> Result<Self, Failure> {
        Self::of_file(RobotFile { name, text })
    }
}

/// Returns parameters as the text of a robot file.
pub fn to_toml(params: &params::Robot) -> String {
    toml::to_string(params).unwrap_or_default()
}

/// Sets or removes the value of a dotted key.
fn put(table: &mut Table, key: &str, value: Option<Value>) -> Result<(), Failure> {
    let mut parts: Vec<&str> = key.split('.').collect();
    let name = parts.pop().unwrap_or_default();
    let mut table = table;
    for part in parts {
        table = match table.entry(part).or_insert_with(|| Value::Table(Table::new())) {
            Value::Table(inner) => inner,
            _ => return Err(Failure::parameter(key, format!("{part} is not a table"))),
        };
    }
    match value {
        Some(value) => drop(table.insert(name.to_owned(), value)),
        None => drop(table.remove(name)),
    }
    Ok(())
}

/// Returns the value for a robot file. Integers and floats are distinct, because the reader of the robot file refuses a float in
/// place of an integer.
fn value_of(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Option<Value>> {
    let each = |value: &Bound<'_, PyAny>| value_of(key, value);
    Ok(Some(if value.is_none() {
        return Ok(None);
    } else if value.is_instance_of::<PyBool>() {
        Value::Boolean(value.extract()?)
    } else if value.is_instance_of::<PyInt>() {
        Value::Integer(value.extract()?)
    } else if value.is_instance_of::<PyFloat>() {
        Value::Float(value.extract()?)
    } else if value.is_instance_of::<PyString>() {
        Value::String(value.extract()?)
    } else if let Ok(mapping) = value.cast::<PyMapping>() {
        let mut table = Table::new();
        for entry in mapping.items()?.iter() {
            let (name, value): (String, Bound<'_, PyAny>) = entry.extract()?;
            put(&mut table, &name, value_of(key, &value)?)?;
        }
        Value::Table(table)
    } else if let Ok(list) = value.cast::<PySequence>() {
        let values: Vec<_> = list.try_iter()?.map(|item| each(&item?)).collect::<PyResult<_>>()?;
        Value::Array(values.into_iter().flatten().collect())
    } else if let Ok(plain) = value.call_method0("tolist") {
        // Numbers and arrays of numpy.
        return each(&plain);
    } else {
        let kind = value.get_type().name()?;
        return Err(Failure::parameter(key, format!("a {kind} is not a value; give a number, a text or a list")).into());
    }))
}
