//! Speeds for an attitude.

use crate::failure::Failure;
use crate::interrupt::interruptible;
use crate::robot::Robot;
use crate::{json, threads};
use pyo3::prelude::*;
use sim::step::InversesAtRest;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;
use study::aim::{Aimed, Columns, Known, Model, Table, Target, load, of_columns, plan, shipped};
use study::output;

/// A table that proposes speeds.
#[derive(FromPyObject)]
pub enum Proposals {
    File(PathBuf),
    Columns(Columns),
}

/// The answer for a target.
#[pyclass(frozen, module = "biflag._biflag")]
pub struct Answer {
    robot: Py<Robot>,
    target: Target,
    aimed: Aimed,
}

/// Finds the speeds at which a robot takes an attitude.
#[pyfunction]
#[pyo3(signature = (robot, yaw, pitch, roll, tilt, thrust, table, seconds, threads))]
#[allow(clippy::too_many_arguments)]
pub fn aim(
    py: Python<'_>,
    robot: Py<Robot>,
    yaw: Option<f64>,
    pitch: Option<f64>,
    roll: Option<f64>,
    tilt: Option<f64>,
    thrust: Option<f64>,
    table: Option<Proposals>,
    seconds: f64,
    threads: Option<usize>,
) -> PyResult<Answer> {
    let target = Target::of([yaw, pitch, roll, tilt, thrust]).map_err(Failure::from)?;
    let longest = Duration::try_from_secs_f64(seconds).ok().filter(|longest| !longest.is_zero());
    let longest = longest.ok_or_else(|| Failure::parameter("seconds", format!("{seconds} is no time above 0 s")))?;
    let Robot { params, file } = robot.get();
    let pool = threads::pool(threads)?;
    let aimed = interruptible(py, |stop| {
        let table: Table = match &table {
            None => shipped()?,
            Some(Proposals::File(path)) => load(path, params)?,
            Some(Proposals::Columns(columns)) => of_columns(columns, params)?,
        };
        let goes_on = || !stop.load(Ordering::Relaxed);
        let at_rest = InversesAtRest::default();
        let model = Model { robot: params, at_rest: &at_rest, goes_on: &goes_on, until: None, solved: &|| {} };
        let known = Known::new(params, file.fit()?);
        Ok(pool.install(|| study::aim::aim(&model, &known, &table, &target, longest))?)
    })?;
    Ok(Answer { robot, target, aimed })
}

#[pymethods]
impl Answer {
    /// Returns the answer as a dictionary.
    fn record<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::record(py, &self.aimed)
    }

    /// Returns the target as text.
    fn target(&self) -> String {
        self.target.to_string()
    }

    /// Writes a plan of the solutions, which must not exist. A robot without a file gets one beside the plan.
    fn save_plan(&self, path: PathBuf) -> Result<(), Failure> {
        if !self.aimed.reachable {
            return Err(Failure::new("plan", format!("no speeds were found for {}", self.target)));
        }
        output::ending(&path, &["toml"])?;
        output::check_new(&path)?;
        let robot = self.robot_file(&path)?;
        Ok(output::write_new(&path, &plan(&path, &robot, &self.target, &self.aimed.solutions))?)
    }
}

impl Answer {
    /// Returns the name of the built-in robot, or the path of the robot's file, which is written beside the plan if there is
    /// none.
    fn robot_file(&self, plan: &Path) -> Result<PathBuf, Failure> {
        let file = &self.robot.get().file;
        let own = PathBuf::from(&file.name);
        if file.text.is_empty() || std::fs::read_to_string(&own).is_ok_and(|text| text == file.text) {
            return Ok(own);
        }
        let stem = plan.file_stem().unwrap_or_default().to_string_lossy();
        let beside = plan.with_file_name(format!("{stem}-robot.toml"));
        output::write_new(&beside, &file.text)?;
        Ok(beside)
    }
}
