//! Sweeps: tables of steady states over speeds, parameters and groups.

use crate::failure::Failure;
use crate::interrupt::{counted, interruptible};
use crate::table::{self, About};
use crate::threads;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use study::export::table::Table;
use study::plan::{PlanError, robot};
use study::sweep::{Folder, Merged, Missing, Record, Shard, SweepPlan, read_table};

/// The columns of a table, their descriptions, and warnings for the user.
type Answer<'py> = (Bound<'py, PyDict>, About, Vec<String>);

/// Computes the points of a plan that a folder does not have yet, writes the table of all points there, and returns it. `plan`:
/// the text of a plan if it has several lines, otherwise its path or its name inside the program; `progress` is called with the
/// numbers of finished points and of all points.
#[pyfunction]
#[pyo3(signature = (plan, out, threads, progress))]
pub fn sweep<'py>(
    py: Python<'py>,
    plan: PathBuf,
    out: PathBuf,
    threads: Option<usize>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Answer<'py>> {
    let jobs = threads::count(threads)?;
    let plan = read_plan(&plan).map_err(Failure::from)?;
    let (folder, before) = interruptible(py, |_| {
        let folder = Folder::of_plan(&out, plan)?;
        let before = folder.counts(Shard::ALL)?.done;
        Ok((folder, before))
    })?;
    let points = [before.count(), folder.sweep.plan.points()];
    let answer = counted(py, progress, points, |stop, done| {
        if before.count() < folder.sweep.plan.points() {
            let count = |_: &Record| _ = done.fetch_add(1, Ordering::Relaxed);
            folder.work(Shard::ALL, &before, jobs, stop, &count)?;
        }
        if stop.load(Ordering::Relaxed) {
            return Err(Failure::interrupted());
        }
        folder.merge(Missing::Refused)?;
        of_folder(&folder)
    })?;
    to_python(py, answer)
}

/// Returns the table of all points of a sweep's folder that are done, or reads the file of a table.
#[pyfunction]
pub fn read_sweep(py: Python<'_>, path: PathBuf) -> PyResult<Answer<'_>> {
    let answer = interruptible(py, |_| {
        if !path.is_dir() {
            return Ok((read_table(&path)?, Vec::new()));
        }
        of_folder(&Folder::open(&path)?)
    })?;
    to_python(py, answer)
}

fn read_plan(plan: &Path) -> Result<SweepPlan, PlanError> {
    match plan.to_str().filter(|text| text.contains('\n')) {
        Some(text) => SweepPlan::parse(text, "plan", &|name| robot::load(Path::new(name))),
        None => SweepPlan::load(plan),
    }
}

/// Returns the table of the points that are done, and warnings.
fn of_folder(folder: &Folder) -> Result<(Table, Vec<String>), Failure> {
    let (table, merged) = folder.table()?;
    Ok((table, warnings(folder, &merged)))
}

/// Returns warnings about points that are missing or have different results.
fn warnings(folder: &Folder, merged: &Merged) -> Vec<String> {
    let (points, Merged { done, different, .. }) = (folder.sweep.plan.points(), merged);
    let folder = folder.path.display();
    let mut warnings = Vec::new();
    if *done < points {
        warnings.push(format!("{folder}: {done} of {points} points are done"));
    }
    if *different > 0 {
        warnings.push(format!(
            "{folder}: {different} points were computed twice with different results, which is an error: one is kept"
        ));
    }
    warnings
}

fn to_python(py: Python<'_>, (rows, warnings): (Table, Vec<String>)) -> PyResult<Answer<'_>> {
    Ok((table::columns(py, &rows)?, table::about(&rows), warnings))
}
