//! Speeds of both motors as users give them: two numbers, an array over time, or a function of time.

use crate::failure::Failure;
use numpy::{PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use sim::trial::profile::{Phases, SpeedProfile};
use study::plan::board_speed;

/// Interval at which a function of time is evaluated, s.
const INTERVAL_S: f64 = 0.01;

/// Longest trial, s: longer ones are a mistake in the unit.
const LONGEST_S: f64 = 1e6;

/// Returns the profile of the motors from time 0 on, which start at `angles_rad`, and the speeds (rpm) if they are constant.
///
/// # Errors
/// [`Failure`] for impossible speeds or an impossible duration, and any exception of a function.
pub fn profile(
    speeds: &Bound<'_, PyAny>,
    duration_s: Option<f64>,
    angles_rad: [f64; 2],
) -> PyResult<(SpeedProfile, Option<[f64; 2]>)> {
    if speeds.is_callable() {
        let points = evaluated(speeds, required(duration_s)?)?;
        return Ok((of_points(&points, angles_rad)?, None));
    }
    let array = array(speeds)?;
    let shape = array.shape().to_vec();
    let values = array.as_array();
    let profile = match shape[..] {
        [2] => {
            let rpm = [values[[0]], values[[1]]];
            return Ok((constant(rpm, required(duration_s)?, angles_rad)?, Some(rpm)));
        }
        [count, 2] if count > 1 => {
            let interval = required(duration_s)? / (count - 1) as f64;
            let point = |i: usize| (i as f64 * interval, [values[[i, 0]], values[[i, 1]]]);
            of_points(&(0..count).map(point).collect::<Vec<_>>(), angles_rad)?
        }
        [count, 3] if count > 1 => {
            if duration_s.is_some() {
                let reason = "leave it out: the first column of `speeds` has the times";
                return Err(Failure::parameter("duration", reason).into());
            }
            let first = values[[0, 0]];
            let point = |i: usize| (values[[i, 0]] - first, [values[[i, 1]], values[[i, 2]]]);
            of_points(&(0..count).map(point).collect::<Vec<_>>(), angles_rad)?
        }
        _ => {
            let reason = format!(
                "give two numbers (rpm), an array of shape (n, 2) over the duration, an array of shape (n, 3) with times \
                 (s) in its first column, or a function of time, not an array of shape {shape:?}"
            );
            return Err(Failure::parameter("speeds", reason).into());
        }
    };
    Ok((profile, None))
}

/// Returns constant speeds (rpm). The motors reach them as in a trial of a plan.
///
/// # Errors
/// An impossible speed or duration.
pub fn constant(rpm: [f64; 2], duration_s: f64, angles_rad: [f64; 2]) -> Result<SpeedProfile, Failure> {
    check([rpm])?;
    let phases = Phases { run: checked(duration_s)?, ..Phases::default() };
    Ok(SpeedProfile::phases(&phases, rpm)?.from_angles(angles_rad))
}

/// Returns pairs of speeds from anything that numpy takes for an array of shape (n, 2).
///
/// # Errors
/// Another shape, or speeds at which no robot turns.
pub fn pairs(speeds: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 2]>> {
    let array = array(speeds)?;
    let values = array.as_array();
    match array.shape() {
        [count, 2] => {
            let pairs: Vec<_> = (0..*count).map(|i| [values[[i, 0]], values[[i, 1]]]).collect();
            check(pairs.iter().copied())?;
            Ok(pairs)
        }
        shape => {
            let reason = format!("give an array of shape (n, 2) in rpm, not {shape:?}");
            Err(Failure::parameter("speeds", reason).into())
        }
    }
}

/// Refuses the speeds of a step, of shape (n, 2), at which no robot turns.
#[pyfunction]
pub fn check_speeds(speeds: &Bound<'_, PyAny>) -> PyResult<()> {
    pairs(speeds).map(drop)
}

/// Refuses what a plan refuses, except speeds between the steps of the board, which are possible in the model.
fn check(rpm: impl IntoIterator<Item = [f64; 2]>) -> Result<(), Failure> {
    let one = |rpm: f64| board_speed((rpm * 100.0).round() / 100.0).map(drop);
    let mut all = rpm.into_iter().flatten();
    all.try_for_each(one).map_err(|(what, cure)| Failure::parameter("speeds", format!("{what}; {cure}")))
}

fn array<'py>(speeds: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let numpy = speeds.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (speeds, "float64")).map_err(|error| {
        let failure: PyErr = Failure::parameter("speeds", "is not an array of numbers").into();
        failure.set_cause(speeds.py(), Some(error));
        failure
    })?;
    Ok(array.cast_into::<numpy::PyArrayDyn<f64>>()?.readonly())
}

fn evaluated(function: &Bound<'_, PyAny>, duration_s: f64) -> PyResult<Vec<(f64, [f64; 2])>> {
    let intervals = (duration_s / INTERVAL_S).ceil().max(1.0) as usize;
    let point = |i: usize| {
        let time_s = duration_s * i as f64 / intervals as f64;
        let rpm = function.call1((time_s,))?;
        let two = || -> PyResult<[f64; 2]> { Ok([rpm.get_item(0)?.extract()?, rpm.get_item(1)?.extract()?]) };
        let rpm = two().map_err(|_| {
            let reason = format!("the function gives {rpm} at {time_s} s instead of two speeds in rpm");
            Failure::parameter("speeds", reason)
        })?;
        Ok((time_s, rpm))
    };
    (0..=intervals).map(point).collect()
}

fn of_points(points: &[(f64, [f64; 2])], angles_rad: [f64; 2]) -> Result<SpeedProfile, Failure> {
    check(points.iter().map(|(_, rpm)| *rpm))?;
    let profile = SpeedProfile::from_points(points)?;
    checked(profile.end() - profile.start())?;
    Ok(profile.from_angles(angles_rad))
}

fn required(duration_s: Option<f64>) -> Result<f64, Failure> {
    checked(duration_s.ok_or_else(|| Failure::parameter("duration", "give the duration of the trial in seconds"))?)
}

fn checked(duration_s: f64) -> Result<f64, Failure> {
    if duration_s > 0.0 && duration_s <= LONGEST_S {
        Ok(duration_s)
    } else {
        Err(Failure::parameter("duration", format!("{duration_s} s must be above 0 and at most {LONGEST_S} s")))
    }
}
