//! Many trials at once, each on a thread of its own, taken in the order of the plan.

use super::{Course, Model, ModelError, trial};
use crate::log::SteadyMeta;
use crate::plan::{Plan, Trial};
use crate::rig::Progress;
use crate::session::Session;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// A trial that is to be computed.
pub struct Job<'a> {
    /// The trial.
    pub trial: &'a Trial,
    /// What it goes through.
    pub course: Course,
    /// With what.
    pub model: &'a Model,
    /// The plan that its log names: the session's, but for the robot.
    pub plan: &'a Plan,
}

/// How the trials of a session are computed.
pub struct Batch<'a> {
    /// Where their logs go.
    pub session: &'a Session,
    /// Told how much is simulated, of all trials together.
    pub progress: &'a Mutex<Progress>,
    /// Set when the user wants to stop.
    pub interrupted: &'a AtomicBool,
    /// Trials at a time.
    pub jobs: usize,
}

/// A trial that was computed.
#[derive(Debug)]
pub struct TrialRun {
    /// The trial.
    pub trial: Trial,
    /// Its log.
    pub log: PathBuf,
    /// How long it took.
    pub wall_s: f64,
    /// What it came to, or why the solver could not end it.
    pub result: Result<SteadyMeta, ModelError>,
}

impl Batch<'_> {
    /// Computes trials; a line is printed as each of them ends: `line` says which. One that the solver cannot end does
    /// not keep the others from being computed. Those that an interruption ended, or kept from beginning, are left out.
    /// In the plan's order.
    ///
    /// # Errors
    /// Where a log cannot be written, or a trial cannot be begun.
    pub fn run(&self, jobs: &[Job], line: impl Fn(&TrialRun) -> String + Sync) -> Result<Vec<TrialRun>, ModelError> {
        let simulated_ms = AtomicU64::new(0);
        let one = |job: &Job| match self.trial(job, &simulated_ms) {
            Ok(run) => {
                self.progress().line(&line(&run));
                Some(Ok(run))
            }
            Err(ModelError::Interrupted) => None,
            Err(error) => Some(Err(error)),
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.jobs).build().map_err(ModelError::Threads)?;
        // A bridge hands out one trial after the other, so that what is done is a beginning of the plan.
        let runs: Result<Vec<_>, _> = pool.install(|| jobs.iter().par_bridge().filter_map(one).collect());
        let mut runs = runs?;
        runs.sort_by_key(|run| run.trial.index);
        Ok(runs)
    }

    /// What a thread that panicked left of it is good enough to go on with.
    fn progress(&self) -> MutexGuard<'_, Progress> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn trial(&self, job: &Job, simulated_ms: &AtomicU64) -> Result<TrialRun, ModelError> {
        let trial = job.trial;
        let begun = Instant::now();
        let (attempt, log) = self.session.next_attempt(trial)?;
        let unfinished = log.with_extension("mcap.unfinished");
        remove(&unfinished)?;
        let reached_ms = AtomicU64::new(0);
        let watch = |time_s: f64| {
            let now_ms = (time_s * 1e3) as u64;
            let passed = now_ms - reached_ms.swap(now_ms, Ordering::Relaxed);
            let all_ms = simulated_ms.fetch_add(passed, Ordering::Relaxed) + passed;
            self.progress().within(all_ms as f64 * 1e-3);
            !self.interrupted.load(Ordering::Relaxed)
        };
        let result = trial::run(job.model, job.plan, trial, &job.course, (attempt, &unfinished), &watch);
        match result {
            Ok(_) | Err(ModelError::Step { .. }) => {
                put_in_place(&unfinished, &log)?;
                Ok(TrialRun { trial: trial.clone(), log, wall_s: begun.elapsed().as_secs_f64(), result })
            }
            Err(error) => {
                remove(&unfinished)?;
                Err(error)
            }
        }
    }
}

/// Gives a finished log its name, on the disk on return.
fn put_in_place(unfinished: &Path, log: &Path) -> Result<(), ModelError> {
    std::fs::rename(unfinished, log).map_err(|source| ModelError::Place { path: log.to_owned(), source })?;
    let folder = log.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Not every file system can sync a folder.
    let _ = std::fs::File::open(folder).and_then(|folder| folder.sync_all());
    Ok(())
}

/// Removes what a killed or interrupted run left of a log, if anything.
fn remove(unfinished: &Path) -> Result<(), ModelError> {
    match std::fs::remove_file(unfinished) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            Err(ModelError::Place { path: unfinished.to_owned(), source })
        }
        _ => Ok(()),
    }
}
