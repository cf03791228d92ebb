//! Many trials side by side: their steady states as columns.

use crate::closure;
use crate::failure::Failure;
use crate::interrupt::interruptible;
use crate::robot::Robot;
use crate::simulate;
use crate::speeds;
use crate::steady::NUMBERS;
use biflag_log::SteadyMeta;
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use sim::trial::{Options, Trial};
use std::sync::atomic::{AtomicBool, Ordering};

/// Simulates trials at constant speeds on `threads` threads, all cores if it is `None`, and returns columns by their
/// names. A trial that the solver cannot end has NaN in its row, and the reason.
#[pyfunction]
#[pyo3(signature = (robot, speeds, duration, closure, rate_hz, phase_deg, threads))]
#[allow(clippy::too_many_arguments)]
pub fn simulate_batch<'py>(
    py: Python<'py>,
    robot: &Bound<'py, Robot>,
    speeds: &Bound<'py, PyAny>,
    duration: f64,
    closure: &str,
    rate_hz: f64,
    phase_deg: [f64; 2],
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyDict>> {
    let closure = closure::parse(closure)?;
    let params = &robot.get().params;
    let pairs = speeds::pairs(speeds)?;
    let options = Options { rate_hz, shapes: false };
    let angles = phase_deg.map(f64::to_radians);
    // What is wrong with the arguments is wrong for all trials.
    let profiles = pairs.iter().map(|rpm| speeds::constant(*rpm, duration, angles)).collect::<Result<Vec<_>, _>>()?;
    let one = |profile: &_, stop: &AtomicBool| -> Result<SteadyMeta, Failure> {
        let trial = Trial::new(params, closure, Clone::clone(profile), options)?;
        simulate::steady(trial, stop)
    };
    let pool = pool(threads)?;
    let results: Vec<Result<SteadyMeta, Failure>> = interruptible(py, |stop| {
        let all = || {
            profiles.par_iter().map(|profile| {
                if stop.load(Ordering::Relaxed) { Ok(SteadyMeta::default()) } else { one(profile, stop) }
            })
        };
        Ok(pool.install(|| all().with_max_len(1).collect()))
    })?;
    columns(py, &pairs, &results)
}

/// Returns a pool of threads, one for each core if the number is not given.
///
/// # Errors
/// A number that is not possible.
pub fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Failure> {
    if threads == Some(0) {
        return Err(Failure::parameter("threads", "must be at least 1"));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    pool.map_err(|error| Failure::parameter("threads", error.to_string()))
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
    for (name, value) in NUMBERS {
        let column = results.iter().map(|result| result.as_ref().map_or(f64::NAN, value));
        table.set_item(name, column.collect::<Vec<_>>().into_pyarray(py))?;
    }
    let of = |flag: &dyn Fn(&SteadyMeta) -> bool| {
        results.iter().map(|result| result.as_ref().is_ok_and(flag)).collect::<Vec<_>>().into_pyarray(py)
    };
    table.set_item("settled", of(&|steady| steady.settled))?;
    let iterations = results.iter().map(|result| result.as_ref().map_or(0, |steady| steady.newton_iterations));
    table.set_item("newton_iterations", iterations.collect::<Vec<_>>().into_pyarray(py))?;
    let texts =
        |text: &dyn Fn(&Result<SteadyMeta, Failure>) -> String| -> Vec<String> { results.iter().map(text).collect() };
    let bundling =
        texts(&|result| result.as_ref().map_or(String::new(), |s| format!("{:?}", s.bundling).to_lowercase()));
    table.set_item("bundling", bundling)?;
    table.set_item("error", texts(&|result| result.as_ref().err().map_or(String::new(), Failure::to_string)))?;
    Ok(table)
}
