//! Steers the model.

use super::course::Expected;
use super::output::Ran;
use crate::plan::Plan;
use crate::progress::Progress;
use crate::run::model::{self, Model, ModelError, SteeredError};
use crate::session::{Session, Sharing};
use biflag_log::SteerMeta;
use sim::body::closure::Closure;
use sim::trial::Options;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use study::steer::{RATE_HZ, Steering};

/// Steers the model of the plan's robot. Returns the log.
///
/// # Errors
/// Failures before the run; a failure in the run is part of the result.
pub fn steer(
    plan: &Plan,
    folder: &Path,
    (steering, meta): (&mut Steering, &SteerMeta),
    expected: &Expected,
    interrupted: &AtomicBool,
) -> miette::Result<(PathBuf, Ran)> {
    let model = Model::of_plan(plan, Closure::Full, Options { rate_hz: RATE_HZ, shapes: false })?;
    let session = Session::create(folder, plan)?;
    let _lock = session.lock(Sharing::Alone)?;
    let trial = &plan.trials[0];
    let (attempt, path) = session.next_attempt(trial)?;
    let progress = Progress::new(trial.phases.run_s);
    expected.note().iter().for_each(|note| progress.line(&format!("note: {note}")));
    progress.phase(&trial.name, "model");
    let goes_on = |time_s: f64| {
        progress.within(time_s);
        !interrupted.load(Ordering::Relaxed)
    };
    let steered = model::steer(&model, plan, trial, (steering, meta), (attempt, &path), &goes_on)?;
    progress.finish();
    let interrupted = matches!(steered.error, Some(SteeredError::Model(ModelError::Interrupted)));
    let error = steered.error.filter(|_| !interrupted).map(Into::into);
    Ok((path, Ran { tally: steered.tally, notes: Vec::new(), error, interrupted }))
}
