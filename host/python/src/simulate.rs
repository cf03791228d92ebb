//! One trial: its samples as arrays, its log and its page.

use crate::failure::Failure;
use crate::interrupt::interruptible;
use crate::log::page_of_log;
use crate::robot::Robot;
use crate::{json, names, speeds};
use biflag_log::{Method, SteadyMeta};
use numpy::IntoPyArray;
use numpy::ndarray::{Array1, Array2, Array3, Array4};
use protocol::Settings;
use protocol::units::CentiRpm;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sim::body::closure::Closure;
use sim::contact::history::BundlingHistory;
use sim::trial::Options;
use sim::trial::quantity::{FLAGELLA, columns as quantities, sample_columns};
use sim::trial::sample::Sample;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use study::plan::{BoardSettings, Phases, Plan, Trial};
use study::run::model::{Model, Motion, write_log};

/// A computed trial, or the last period or window of its final motion.
#[pyclass(frozen, module = "biflag._biflag")]
pub struct Simulated {
    robot: Py<Robot>,
    model: Model,
    /// Speeds at its end.
    rpm: [f64; 2],
    /// Angles of the flagella at its start.
    phase_deg: [f64; 2],
    /// Its duration.
    run_s: f64,
    samples: Vec<Sample>,
    steady: SteadyMeta,
}

/// Simulates a trial. `speeds`: see `speeds::profile`.
#[pyfunction]
#[pyo3(signature = (robot, speeds, duration, closure, method, rate_hz, shapes, phase_deg))]
#[allow(clippy::too_many_arguments)]
pub fn simulate(
    py: Python<'_>,
    robot: Py<Robot>,
    speeds: &Bound<'_, PyAny>,
    duration: Option<f64>,
    closure: &str,
    method: &str,
    rate_hz: f64,
    shapes: bool,
    phase_deg: [f64; 2],
) -> PyResult<Simulated> {
    let (closure, method) = (names::closure(closure)?, names::method(method)?);
    let angles = phase_deg.map(f64::to_radians);
    let (profile, constant) = speeds::profile(speeds, duration, angles)?;
    if method == Method::Steady && constant.is_none() {
        let reason = "\"steady\" needs constant speeds: give two numbers as `speeds`";
        return Err(Failure::parameter("method", reason).into());
    }
    let model = model(&robot.get().params, closure, method, Options { rate_hz, shapes });
    let rpm = constant.unwrap_or_else(|| profile.target().map(rpm));
    let (samples, steady, duration_s) = interruptible(py, |stop| {
        let goes_on = |_| !stop.load(Ordering::Relaxed);
        let (mut samples, mut history) = (Vec::new(), BundlingHistory::default());
        let motion = run(Motion::new(&model, &profile, rpm, angles, &goes_on)?, stop, |sample| {
            history.push(sample.time_s, sample.bundling);
            samples.push(sample);
        })?;
        Ok((samples, motion.steady(history.changes), motion.duration_s()))
    })?;
    let run_s = duration_s.unwrap_or(profile.end());
    Ok(Simulated { robot, model, rpm, phase_deg, run_s, samples, steady })
}

/// Returns the model of a robot, with a board whose settings do not matter.
pub fn model(robot: &sim::params::Robot, closure: Closure, method: Method, options: Options) -> Model {
    Model::new(robot.clone(), Settings::DEFAULT, closure, method, options)
}

/// Runs a motion to its end, or until `stop` is set, and returns it; `keep` gets its samples.
///
/// # Errors
/// A step that the solver cannot take.
pub fn run(mut motion: Motion, stop: &AtomicBool, mut keep: impl FnMut(Sample)) -> Result<Motion, Failure> {
    for sample in motion.by_ref() {
        keep(sample?);
        if stop.load(Ordering::Relaxed) {
            break;
        }
    }
    Ok(motion)
}

#[pymethods]
impl Simulated {
    /// Returns the samples as arrays by their names.
    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let samples = &self.samples;
        let count = samples.len();
        let one = |value: &dyn Fn(&Sample) -> f64| Array1::from_iter(samples.iter().map(value)).into_pyarray(py);
        let two = |value: &dyn Fn(&Sample) -> [f64; 2]| table(samples.iter().map(value)).into_pyarray(py);
        let vectors = |value: &dyn Fn(&Sample) -> [[f64; 3]; 2]| {
            let flat: Vec<f64> = samples.iter().flat_map(|s| value(s).into_iter().flatten()).collect();
            Ok::<_, PyErr>(shaped(Array3::from_shape_vec((count, 2, 3), flat))?.into_pyarray(py))
        };
        let arrays = PyDict::new(py);
        arrays.set_item("time", one(&|s| s.time_s))?;
        arrays.set_item("yaw", one(&|s| s.yaw_rad.to_degrees()))?;
        arrays.set_item("pitch", one(&|s| s.pitch_rad.to_degrees()))?;
        arrays.set_item("roll", one(&|s| s.roll_rad.to_degrees()))?;
        arrays.set_item("attitude", table(samples.iter().map(|s| s.attitude)).into_pyarray(py))?;
        arrays.set_item("rates", table(samples.iter().map(|s| s.rate_rad_s.map(f64::to_degrees))).into_pyarray(py))?;
        arrays.set_item("speeds", two(&|s| s.motor_speed_rad_s.map(rpm)))?;
        arrays.set_item("turns", two(&|s| s.motor_angle_rad.map(|angle| angle / std::f64::consts::TAU)))?;
        arrays.set_item("forces", vectors(&|s| s.force_n)?)?;
        arrays.set_item("contact_forces", vectors(&|s| s.contact_force_n)?)?;
        arrays.set_item("torques", two(&|s| s.axial_torque_nm))?;
        arrays.set_item("gap", one(&|s| s.min_gap_m))?;
        arrays.set_item("winding", one(&|s| s.winding_turns))?;
        let lines: Vec<_> = samples.iter().filter_map(|s| s.shapes_m.as_ref()).collect();
        if let Some(nodes) = lines.first().map(|line| line[0].len()) {
            let flat: Vec<f64> = lines.iter().flat_map(|both| both.iter().flatten().flatten().copied()).collect();
            let shapes = shaped(Array4::from_shape_vec((lines.len(), 2, nodes, 3), flat))?;
            arrays.set_item("shapes", shapes.into_pyarray(py))?;
        }
        Ok(arrays)
    }

    /// Returns the samples as columns, with the names of an export.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        let put = |name: String, value: &dyn Fn(&Sample) -> f64| {
            columns.set_item(name, Array1::from_iter(self.samples.iter().map(value)).into_pyarray(py))
        };
        put("time_s".to_owned(), &|s| s.time_s)?;
        put("yaw_deg".to_owned(), &|s| s.yaw_rad.to_degrees())?;
        put("pitch_deg".to_owned(), &|s| s.pitch_rad.to_degrees())?;
        put("roll_deg".to_owned(), &|s| s.roll_rad.to_degrees())?;
        for k in 0..FLAGELLA {
            put(format!("speed{}_rpm", k + 1), &|s| rpm(s.motor_speed_rad_s[k]))?;
            put(format!("turns{}", k + 1), &|s| s.motor_angle_rad[k] / std::f64::consts::TAU)?;
        }
        for column in sample_columns(FLAGELLA) {
            put(column.name.clone(), &|s| column.of_sample(s))?;
        }
        Ok(columns)
    }

    /// Returns the steady state as a dictionary.
    fn steady<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let steady = json::record(py, &self.steady)?;
        // Angles of a robot that overturned are NaN, which JSON does not have.
        let mut angles = quantities(FLAGELLA).filter(|column| column.is_angle());
        angles.try_for_each(|angle| steady.set_item(&angle.name, self.steady.values.numbers[angle.index()]))?;
        Ok(steady)
    }

    /// Writes the log of the trial.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        interruptible(py, |_| self.write(&path))
    }

    /// Returns the page of the trial.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        interruptible(py, |_| {
            let folder = tempfile::tempdir().map_err(|error| Failure::parameter("page", error.to_string()))?;
            page_of_log(&self.write_into(folder.path())?)
        })
    }
}

impl Simulated {
    fn name(&self) -> String {
        let [w1, w2] = self.rpm.map(|rpm| (rpm * 100.0).round() / 100.0);
        format!("w1{w1:+}_w2{w2:+}")
    }

    /// Writes the log into a folder, and returns its path.
    pub fn write_into(&self, folder: &Path) -> Result<PathBuf, Failure> {
        let path = folder.join(format!("{}.mcap", self.name()));
        self.write(&path)?;
        Ok(path)
    }

    /// Writes the log to `path`, which must not exist.
    fn write(&self, path: &Path) -> Result<(), Failure> {
        let trial = Trial {
            name: self.name(),
            index: 0,
            repeat: 1,
            speeds: self.rpm.map(CentiRpm::from_rpm),
            phases: Phases::of_run(self.run_s),
            reverse: None,
            phase_deg: (self.phase_deg != [0.0; 2]).then_some(self.phase_deg),
        };
        let plan = Plan {
            name: "python".to_owned(),
            operator: String::new(),
            note: "simulated from Python".to_owned(),
            robot: self.robot.get().file.clone(),
            sensor: None,
            seed: None,
            trials: vec![trial.clone()],
            board: BoardSettings::default(),
            hand_turn: None,
            method: self.model.meta().method,
            text: String::new(),
        };
        write_log(&self.model, &plan, &trial, (&self.samples, &self.steady), path)
            .map_err(|error| Failure::of_file(path, &error))
    }
}

fn rpm(speed_rad_s: f64) -> f64 {
    speed_rad_s * 30.0 / std::f64::consts::PI
}

fn table<const N: usize>(rows: impl Iterator<Item = [f64; N]>) -> Array2<f64> {
    Array2::from(rows.collect::<Vec<_>>())
}

/// Returns an array whose shape was computed from its values.
fn shaped<A>(array: Result<A, numpy::ndarray::ShapeError>) -> Result<A, Failure> {
    array.map_err(|error| Failure::parameter("shape", error.to_string()))
}
