//! Many trials in parallel: their steady states as columns.

use crate::failure::Failure;
use crate::interrupt::counted;
use crate::robot::Robot;
use crate::{names, simulate, speeds, threads};
use biflag_log::SteadyMeta;
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use sim::steady::Kind;
use sim::trial::Options;
use sim::trial::quantity::{FLAGELLA, Shape, columns as quantities};
use std::sync::atomic::{AtomicBool, Ordering};
use study::run::model::{Model, Motion};

/// Simulates trials at constant speeds, of one robot or of one robot per row, and returns columns by their names. It uses
/// `threads` threads, or all cores if this is `None`, and calls `progress` with the numbers of finished trials and of all trials.
/// The method "steady" solves for the final states of the trials. A trial that the solver cannot complete has NaN in its row, and
/// the reason.
#[pyfunction]
#[pyo3(signature = (robots, speeds, duration, closure, method, rate_hz, phase_deg, threads, progress))]
#[allow(clippy::too_many_arguments)]
pub fn simulate_batch<'py>(
    py: Python<'py>,
    robots: Vec<Py<Robot>>,
    speeds: &Bound<'py, PyAny>,
    duration: f64,
    closure: &str,
    method: &str,
    rate_hz: f64,
    phase_deg: [f64; 2],
    threads: Option<usize>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (closure, method) = (names::closure(closure)?, names::method(method)?);
    let pairs = speeds::pairs(speeds)?;
    let model =
        |robot: &Py<Robot>| simulate::model(&robot.get().params, closure, method, Options { rate_hz, shapes: false });
    let models: Vec<Model> = robots.iter().map(model).collect();
    if models.len() != pairs.len() && models.len() != 1 {
        let reason = format!("{} robots for {} rows of speeds; give one, or one a row", models.len(), pairs.len());
        return Err(Failure::parameter("robot", reason).into());
    }
    let angles = phase_deg.map(f64::to_radians);
    // Wrong arguments would fail in all trials.
    let profiles = pairs.iter().map(|rpm| speeds::constant(*rpm, duration, angles)).collect::<Result<Vec<_>, _>>()?;
    let one = |i: usize, stop: &AtomicBool| -> Result<SteadyMeta, Failure> {
        let goes_on = |_| !stop.load(Ordering::Relaxed);
        let model = &models[i % models.len()];
        let motion = simulate::run(Motion::new(model, &profiles[i], pairs[i], angles, &goes_on)?, stop, drop)?;
        Ok(motion.steady(Vec::new()))
    };
    let pool = threads::pool(threads)?;
    let results: Vec<Result<SteadyMeta, Failure>> = counted(py, progress, [0, pairs.len() as u64], |stop, done| {
        let row = |i| {
            let result = if stop.load(Ordering::Relaxed) { Err(Failure::interrupted()) } else { one(i, stop) };
            done.fetch_add(1, Ordering::Relaxed);
            result
        };
        let all = || (0..pairs.len()).into_par_iter().map(row);
        Ok(pool.install(|| all().with_max_len(1).collect()))
    })?;
    let table = columns(py, &pairs, &results)?;
    let kind = |steady: &SteadyMeta| steady.kind.map_or("", Kind::name);
    let kinds = results.iter().map(|result| result.as_ref().map_or("", kind));
    table.set_item("kind", kinds.collect::<Vec<_>>())?;
    Ok(table)
}

fn columns<'py>(
    py: Python<'py>,
    pairs: &[[f64; 2]],
    results: &[Result<SteadyMeta, Failure>],
) -> PyResult<Bound<'py, PyDict>> {
    let table = PyDict::new(py);
    for (k, name) in ["w1_rpm", "w2_rpm"].into_iter().enumerate() {
        table.set_item(name, pairs.iter().map(|pair| pair[k]).collect::<Vec<_>>().into_pyarray(py))?;
    }
    for (i, column) in quantities(FLAGELLA).enumerate() {
        let values = results.iter().map(|result| result.as_ref().map_or(f64::NAN, |steady| steady.values.numbers[i]));
        if column.quantity.shape == Shape::Count {
            table.set_item(column.name, values.map(|count| count as u64).collect::<Vec<_>>().into_pyarray(py))?;
        } else {
            table.set_item(column.name, values.collect::<Vec<_>>().into_pyarray(py))?;
        }
    }
    let settled = results.iter().map(|result| result.as_ref().is_ok_and(|steady| steady.settled));
    table.set_item("settled", settled.collect::<Vec<_>>().into_pyarray(py))?;
    let texts =
        |text: &dyn Fn(&Result<SteadyMeta, Failure>) -> String| -> Vec<String> { results.iter().map(text).collect() };
    let bundling =
        texts(&|result| result.as_ref().map_or(String::new(), |s| format!("{:?}", s.bundling).to_lowercase()));
    table.set_item("bundling", bundling)?;
    table.set_item("error", texts(&|result| result.as_ref().err().map_or(String::new(), Failure::to_string)))?;
    Ok(table)
}
