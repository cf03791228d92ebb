//! One trial: its samples as arrays.

use crate::closure;
use crate::failure::Failure;
use crate::interrupt::interruptible;
use crate::json;
use crate::page;
use crate::robot::Robot;
use crate::speeds;
use biflag_log::SteadyMeta;
use numpy::IntoPyArray;
use numpy::ndarray::{Array1, Array2, Array3, Array4};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sim::body::closure::Closure;
use sim::contact::history::{BundlingChange, BundlingHistory};
use sim::profile::SpeedProfile;
use sim::sample::Sample;
use sim::trial::{Options, Summary, Trial};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// A trial that was computed.
#[pyclass(frozen, module = "biflag._biflag")]
pub struct Simulated {
    pub robot: Py<Robot>,
    pub closure: Closure,
    pub options: Options,
    pub profile: SpeedProfile,
    pub samples: Vec<Sample>,
    pub summary: Summary,
    bundling: Vec<BundlingChange>,
}

/// Simulates a trial. `speeds`: see `speeds::profile`.
#[pyfunction]
#[pyo3(signature = (robot, speeds, duration, closure, rate_hz, shapes, phase_deg))]
#[allow(clippy::too_many_arguments)]
pub fn simulate(
    py: Python<'_>,
    robot: Py<Robot>,
    speeds: &Bound<'_, PyAny>,
    duration: Option<f64>,
    closure: &str,
    rate_hz: f64,
    shapes: bool,
    phase_deg: [f64; 2],
) -> PyResult<Simulated> {
    let closure = closure::parse(closure)?;
    let (profile, _) = speeds::profile(speeds, duration, phase_deg.map(f64::to_radians))?;
    let options = Options { rate_hz, shapes };
    let params = &robot.get().params;
    let (samples, summary, bundling) =
        interruptible(py, |stop| run(Trial::new(params, closure, profile.clone(), options)?, stop))?;
    Ok(Simulated { robot, closure, options, profile, samples, summary, bundling })
}

/// Runs a trial to its end, or until `stop` is set.
fn run(mut trial: Trial, stop: &AtomicBool) -> Result<(Vec<Sample>, Summary, Vec<BundlingChange>), Failure> {
    let (mut samples, mut history) = (Vec::new(), BundlingHistory::default());
    for sample in trial.by_ref() {
        let sample = sample?;
        history.push(sample.time_s, sample.bundling);
        samples.push(sample);
        if stop.load(Ordering::Relaxed) {
            break;
        }
    }
    Ok((samples, trial.summary(), history.changes))
}

/// Returns the steady state of a trial, without its samples.
///
/// # Errors
/// A step that the solver cannot take.
pub fn steady(mut trial: Trial, stop: &AtomicBool) -> Result<SteadyMeta, Failure> {
    for sample in trial.by_ref() {
        sample?;
        if stop.load(Ordering::Relaxed) {
            break;
        }
    }
    Ok(SteadyMeta::new(&trial.summary(), Vec::new()))
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

    /// Returns the steady state as a dictionary.
    fn steady<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::object(py, &json::value(&SteadyMeta::new(&self.summary, self.bundling.clone()))?)
    }

    /// Writes the log of the trial.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        interruptible(py, |_| self.write(&path))
    }

    /// Returns the page of the trial.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        interruptible(py, |_| page::html(self))
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
