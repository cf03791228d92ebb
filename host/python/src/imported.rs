//! Trials that other instruments measured, from arrays.

use crate::failure::Failure;
use crate::interrupt::interruptible;
use crate::robot::Robot;
use biflag_log::ImportMeta;
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use std::path::PathBuf;
use study::import::{Conditions, State, States, write};
use study::plan::board_speed;

/// The conditions of a trial that its arrays do not contain.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Known {
    speeds: Option<[f64; 2]>,
    run: Option<[f64; 2]>,
    uncertainty: Option<[f64; 2]>,
    temperature: Option<f64>,
    note: String,
}

/// Writes the log of a trial. Each row has time, yaw, pitch and roll, and then, if `motion` is given, the speeds (`rpm`) or
/// turns (`turns`) of both motors. Rows with a NaN are left out.
#[pyfunction]
pub fn write_states(
    py: Python<'_>,
    path: PathBuf,
    rows: PyReadonlyArray2<'_, f64>,
    motion: Option<&str>,
    robot: &Robot,
    known: Known,
) -> PyResult<()> {
    let all = rows.as_array();
    let kept: Vec<usize> = (0..all.nrows()).filter(|i| all.row(*i).iter().all(|value| !value.is_nan())).collect();
    let states = kept.iter().map(|i| {
        let row = all.row(*i);
        let two = |kind: &str| (motion == Some(kind)).then(|| [row[4], row[5]]);
        State { time_s: row[0], angles_deg: [row[1], row[2], row[3]], speed_rpm: two("rpm"), turns: two("turns") }
    });
    let states: Vec<State> = states.collect();
    let speed = |rpm: f64| board_speed(rpm).map_err(|(what, _)| Failure::parameter("speeds", what));
    let speeds = known.speeds.map(|[one, two]| Ok::<_, Failure>([speed(one)?, speed(two)?])).transpose()?;
    let conditions = Conditions {
        speeds,
        run_s: known.run.map(|[from, to]| from..to),
        reverse: None,
        robot: robot.file.clone(),
        uncertainty_deg: known.uncertainty,
        temperature_c: known.temperature,
        note: known.note,
    };
    let left_out = (all.nrows() - kept.len()) as u64;
    drop(rows);
    interruptible(py, |_| {
        let write = || {
            let states = States::new(states.clone(), "arrays", |row| format!("row {}", kept[row]))?;
            let columns = "time:s,yaw:deg,pitch:deg,roll:deg".to_owned();
            let about = ImportMeta { left_out, columns, ..states.about };
            write(&States { about, ..states }, &conditions, "arrays", &path)
        };
        write().map(drop).map_err(|error| Failure::of_file(&path, &error))
    })
}
