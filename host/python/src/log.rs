//! The content of a log, with the values that all commands and pages show.

use crate::failure::Failure;
use crate::interrupt::interruptible;
use crate::json;
use crate::robot::Robot;
use crate::table::{About, about, columns};
use numpy::IntoPyArray;
use numpy::ndarray::Array4;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use serde_json::json;
use std::ffi::CString;
use std::path::{Path, PathBuf};
use study::export::session::{self, Summary};
use study::export::trial;
use study::plan::RobotFile;
use study::session::{Attempt, Session, SessionError, TrialState};
use study::trial::{Judged, Repeat, Want, scatter_of_repeats};

/// Largest number of shapes of the flagella that are read: a quarter of an hour.
const SHAPES: usize = 15_000;

/// A page has a tenth of the largest size, so that a notebook of some pages stays small.
const PAGES: usize = 10;

/// Reads a log, even a damaged one, and returns its content as a dictionary.
#[pyfunction]
pub fn read_log(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let want = Want { forces: true, frames: true, shapes: SHAPES, hash: false };
    let read = |_: &_| {
        let trial = Attempt::of_log(&path).read(want).map_err(|error| Failure::of_file(&path, &error))?;
        let rows = trial::table(&trial);
        Ok((trial, rows))
    };
    let (Judged { data, angles: zeroed, findings: found, not_judged }, rows) = interruptible(py, read)?;
    let (trial, run_s) = (data.trial(), data.times.run.start);
    let dict = PyDict::new(py);
    dict.set_item("name", trial.name)?;
    dict.set_item("speeds_rpm", (trial.w1_rpm, trial.w2_rpm))?;
    dict.set_item("origin", data.origin().name())?;
    dict.set_item("complete", data.is_complete())?;
    dict.set_item("warnings", found.iter().map(ToString::to_string).collect::<Vec<_>>())?;
    dict.set_item("findings", json::record(py, &found)?)?;
    dict.set_item("not_judged", not_judged)?;
    dict.set_item("columns", columns(py, &rows)?)?;
    dict.set_item("about", about(&rows))?;
    dict.set_item("notes", &rows.header)?;
    let mut steady = json::value(&zeroed.angles())?;
    if let (Some(steady), Some(own)) = (steady.as_object_mut(), &zeroed.steady) {
        steady.insert("settle_s".to_owned(), json!(own.settle_s));
        steady.insert("budget".to_owned(), json!(own.budget()));
    }
    dict.set_item("steady", json::object(py, &steady)?)?;
    let phases = [("preroll", &data.times.preroll), ("run", &data.times.run), ("decay", &data.times.decay)];
    let phases = phases.map(|(name, range)| (name, (range.start - run_s, range.end - run_s)));
    dict.set_item("phases", phases.to_vec())?;
    let kind = |event: &study::trial::Event| format!("{:?}", event.kind).to_lowercase();
    let events = data.events.iter().map(|event| (event.time_s - run_s, kind(event), event.text.clone()));
    dict.set_item("events", events.collect::<Vec<_>>())?;
    dict.set_item("link", json::record(py, &data.link)?)?;
    let file = RobotFile::of_log(data.records.robot.clone());
    let robot = data.robot().ok().map(|params| match &data.records.model {
        Some(_) => Robot::of_params(params, &file.name),
        None => Robot { params, file },
    });
    dict.set_item("robot", robot.map(|robot| Py::new(py, robot)).transpose()?)?;
    let records = json!({
        "identity": data.records.identity,
        "plan": data.records.plan,
        "board": data.records.board,
        "model": data.records.model,
        "calibration": data.records.calibration,
        "level": data.records.level,
        "replay": data.records.replay,
        "summary": data.records.summary,
    });
    dict.set_item("records", json::object(py, &records)?)?;
    let shapes = &data.shapes.all;
    if let Some(nodes) = shapes.first().map(|shape| shape.lines[0].len()) {
        let times: Vec<f64> = shapes.iter().map(|shape| shape.time_s - run_s).collect();
        let flat: Vec<f64> = shapes.iter().flat_map(|shape| shape.lines.iter().flatten().flatten().copied()).collect();
        let shapes = Array4::from_shape_vec((times.len(), 2, nodes, 3), flat)
            .map_err(|error| Failure::parameter("shapes", error.to_string()))?;
        dict.set_item("shapes", shapes.into_pyarray(py))?;
        dict.set_item("shape_times", times.into_pyarray(py))?;
    }
    Ok(dict)
}

/// Returns the page of a log, in a few hundred kilobytes.
///
/// # Errors
/// A file that is not a log.
pub fn page_of_log(path: &Path) -> Result<String, Failure> {
    page::report::html(path, PAGES).map_err(|error| Failure::of_file(path, &error))
}

/// Returns the page of a log.
#[pyfunction]
pub fn html(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    interruptible(py, |_| page_of_log(&path))
}

fn opened(path: &Path) -> Result<(Session, Vec<TrialState>), Failure> {
    let of = |error: SessionError| Failure::of_file(path, &error);
    let session = Session::open(path).map_err(of)?;
    let states = session.intact_states().map_err(of)?;
    Ok((session, states))
}

/// Reads a session folder, and returns its name, its plan and its trials with their logs.
#[pyfunction]
pub fn read_session(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let (session, states) = interruptible(py, |_| opened(&path))?;
    let plan = session.plan();
    let dict = PyDict::new(py);
    dict.set_item("name", &plan.name)?;
    dict.set_item("plan", &plan.text)?;
    let trials = PyDict::new(py);
    for state in &states {
        let log = state.best().map(|attempt| (attempt.path.clone(), state.complete().is_some()));
        trials.set_item(&state.trial.name, log)?;
    }
    dict.set_item("trials", trials)?;
    let left_out: Vec<_> = states.iter().flat_map(|state| &state.left_out).collect();
    dict.set_item("left_out", json::record(py, &left_out)?)?;
    Ok(dict)
}

/// Returns the table of the trials of a session that have a log, with the steady angles.
#[pyfunction]
pub fn session_table(py: Python<'_>, path: PathBuf) -> PyResult<(Bound<'_, PyDict>, About)> {
    let (rows, unreadable) = interruptible(py, |stop| {
        let (session, states) = opened(&path)?;
        let read = |state: &TrialState| {
            let attempt = state.best().filter(|_| !stop.load(std::sync::atomic::Ordering::Relaxed))?;
            let judged = attempt.read(Want::default()).map_err(|error| format!("{}: {error}", state.trial.name));
            Some(judged.map(|judged| Summary::new(&state.trial, judged, String::new())))
        };
        let read: Vec<_> = states.par_iter().filter_map(read).collect();
        let unreadable: Vec<String> = read.iter().filter_map(|one| one.as_ref().err().cloned()).collect();
        let summaries: Vec<_> = read.into_iter().flatten().collect();
        Ok((session::table(&session.plan().name, &summaries), unreadable))
    })?;
    for text in unreadable {
        let text = CString::new(format!("a trial is left out of the table: {text}").replace('\0', ""))?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 2)?;
    }
    let columns = columns(py, &rows)?;
    columns.del_item("file")?;
    Ok((columns, about(&rows)))
}

/// Returns the scatter of the repeats of a session beside their budget.
#[pyfunction]
pub fn session_repeats(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyAny>> {
    let repeats = interruptible(py, |_| {
        let (_, states) = opened(&path)?;
        let read = |state: &TrialState| Repeat::new(&state.complete()?.read(Want::default()).ok()?);
        let trials: Vec<Repeat> = states.par_iter().filter_map(read).collect();
        Ok(scatter_of_repeats(trials.iter()))
    })?;
    json::record(py, &repeats)
}
