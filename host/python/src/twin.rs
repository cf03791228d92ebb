//! Comparison of recordings with the model, and fits of its parameters.

use crate::failure::Failure;
use crate::interrupt::interruptible;
use crate::robot::Robot;
use crate::{json, names, threads};
use numpy::IntoPyArray;
use numpy::ndarray::Array2;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use sim::trial::Options;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use study::plan::RobotFile;
use study::session::Attempt;
use study::trial::{Judged, Want};
use study::twin::calibrate::{FitTrial, Parameter, Request, calibrate as fit_trials, to_toml};
use study::twin::{self, Compared, OnMismatch, Pairs, Source};

/// Compares the trials of a log or session with their replays in the model, or with the trials of another session. Returns the
/// comparison and, by the names of the trials, both attitudes over time.
#[pyfunction]
#[pyo3(signature = (measured, modelled, robot, closure, anyway, jobs))]
pub fn compare<'py>(
    py: Python<'py>,
    measured: PathBuf,
    modelled: Option<PathBuf>,
    robot: Option<&Bound<'py, Robot>>,
    closure: Option<&str>,
    anyway: bool,
    jobs: Option<usize>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyDict>)> {
    let closure = closure.map(names::closure).transpose()?;
    let robot = robot.map(|robot| robot.get().file.clone());
    let jobs = threads::count(jobs)?;
    let on_mismatch = OnMismatch::of(robot.is_some() || closure.is_some(), anyway);
    if modelled.is_some() && (robot.is_some() || closure.is_some()) {
        let reason = "leave it out: the other session has a model of its own";
        return Err(Failure::parameter(if robot.is_some() { "robot" } else { "closure" }, reason).into());
    }
    let (comparison, points) = interruptible(py, |stop| {
        let (want, points) = (Want::default(), |_: &Judged, _: &Judged, compared: &Compared| compared.points.clone());
        if let Some(modelled) = &modelled {
            let pairs = Pairs::of(&measured, modelled)?;
            return Ok(twin::compare_pairs(&pairs, want, on_mismatch, jobs, &points)?);
        }
        let options = Options { rate_hz: twin::REPLAY_HZ, shapes: false };
        let settings = twin::Settings { closure, robot, options, any_rate: true, jobs, quiet: true };
        let source = Source::open(&measured)?;
        let replays = twin::compare_replays(&source, &settings, want, on_mismatch, stop, &points)?;
        Ok(replays.sum_up([&source.path, &source.replay_folder()], on_mismatch)?)
    })?;
    let series = PyDict::new(py);
    for (trial, points) in comparison.trials.iter().zip(points) {
        let columns = PyDict::new(py);
        let one = |value: &dyn Fn(&twin::Point) -> f64| points.iter().map(value).collect::<Vec<_>>().into_pyarray(py);
        let angles = |value: &dyn Fn(&twin::Point) -> [f64; 3]| {
            Array2::from(points.iter().map(value).collect::<Vec<_>>()).into_pyarray(py)
        };
        columns.set_item("time", one(&|point| point.time_s))?;
        columns.set_item("measured", angles(&|point| point.measured_deg))?;
        columns.set_item("modelled", angles(&|point| point.modelled_deg))?;
        columns.set_item("yaw_uncertainty", one(&|point| point.yaw_uncertainty_deg))?;
        series.set_item(&trial.name, columns)?;
    }
    Ok((json::record(py, &comparison)?, series))
}

/// Fits parameters of a robot to logs. Returns the fit, the fitted robot and the text of its file.
#[pyfunction]
#[pyo3(signature = (logs, fit, robot, closure, jobs))]
pub fn calibrate<'py>(
    py: Python<'py>,
    logs: Vec<PathBuf>,
    fit: Vec<String>,
    robot: Option<&Bound<'py, Robot>>,
    closure: Option<&str>,
    jobs: Option<usize>,
) -> PyResult<(Bound<'py, PyAny>, Robot, String)> {
    let parse = |name: &String| name.parse::<Parameter>().map_err(|reason| Failure::parameter("fit", reason));
    let parameters = fit.iter().map(parse).collect::<Result<_, _>>()?;
    let robot = robot.map(|robot| robot.get().params.clone());
    let closure = closure.map(names::closure).transpose()?;
    let request = Request { robot, closure, parameters, jobs: threads::count(jobs)? };
    let calibration = interruptible(py, |stop| {
        let (mut files, mut left_out) = (Vec::new(), Vec::new());
        for path in &logs {
            let (of_path, without_trial) = twin::logs(path).map_err(|error| Failure::of_file(path, &error))?;
            files.extend(of_path);
            left_out.extend(without_trial);
        }
        let read = |log: &Attempt| FitTrial::read(log).map_err(|error| Failure::of_file(&log.path, &error));
        let trials = files.par_iter().map(read).collect::<Result<Vec<_>, _>>()?;
        let goes_on = || !stop.load(Ordering::Relaxed);
        let mut calibration = fit_trials(trials, &request, &goes_on)?;
        calibration.findings.extend(left_out);
        Ok(calibration)
    })?;
    let text = to_toml(&calibration);
    // The text has the standard errors of the parameters.
    let file = RobotFile { name: "fitted".to_owned(), text: text.clone() };
    let fitted = Robot { params: calibration.robot.clone(), file };
    Ok((json::record(py, &calibration)?, fitted, text))
}
