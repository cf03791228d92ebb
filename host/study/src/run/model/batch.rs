//! Computes trials in parallel, in the order of the plan.

use super::{Course, Model, ModelError, trial};
use crate::plan::{Plan, Trial};
use crate::progress::Progress;
use crate::session::{Session, UNFINISHED};
use biflag_log::atomic_file::sync_folder_of;
use biflag_log::{LogError, SteadyMeta};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// A trial to compute.
pub struct Job<'a> {
    /// The trial.
    pub trial: &'a Trial,
    /// Its schedule and speeds.
    pub course: Course,
    /// The model that computes it.
    pub model: &'a Model,
    /// The plan for its log: the session's plan, possibly with another robot.
    pub plan: &'a Plan,
}

/// Computes the trials of a session.
pub struct Batch<'a> {
    /// The session that the logs are written to.
    session: &'a Session,
    /// Shows the simulated time of all trials together.
    progress: &'a Progress,
    /// Set when the user interrupts the program.
    interrupted: &'a AtomicBool,
    simulated_ms: AtomicU64,
}

/// A computed trial.
#[derive(Debug)]
pub struct ModelRun {
    /// The trial.
    pub trial: Trial,
    /// Its log.
    pub log: PathBuf,
    /// Wall time, s.
    pub wall_s: f64,
    /// Its steady state, or the failure of the solver.
    pub result: Result<SteadyMeta, ModelError>,
}

impl<'a> Batch<'a> {
    /// Creates a batch without computing anything.
    pub fn new(session: &'a Session, progress: &'a Progress, interrupted: &'a AtomicBool) -> Self {
        Self { session, progress, interrupted, simulated_ms: AtomicU64::new(0) }
    }

    /// Computes trials on `threads` threads and returns them in the plan's order. Prints each trial's `line` when the
    /// trial ends. If the solver fails in one trial, the others are still computed. The result leaves out interrupted
    /// trials.
    ///
    /// # Errors
    /// If a log cannot be written, or a trial cannot be started.
    pub fn run(
        &self,
        jobs: &[Job],
        threads: usize,
        line: &(dyn Fn(&ModelRun) -> String + Sync),
    ) -> Result<Vec<ModelRun>, ModelError> {
        let one = |job: &Job| match self.compute(job, line) {
            Err(ModelError::Interrupted) => None,
            result => Some(result),
        };
        // A bridge hands out the trials one by one, so an interruption leaves the first trials of the plan complete.
        let runs: Result<Vec<_>, _> = pool(threads)?.install(|| jobs.iter().par_bridge().filter_map(one).collect());
        let mut runs = runs?;
        runs.sort_by_key(|run| run.trial.index);
        Ok(runs)
    }

    /// Computes one trial, on this thread.
    ///
    /// # Errors
    /// [`ModelError::Interrupted`], and if the log cannot be written or the trial cannot be started.
    pub fn compute(&self, job: &Job, line: &(dyn Fn(&ModelRun) -> String + Sync)) -> Result<ModelRun, ModelError> {
        let trial = job.trial;
        let begun = Instant::now();
        let (attempt, log) = self.session.next_attempt(trial)?;
        let unfinished = log.with_extension(&UNFINISHED[1..]);
        remove(&unfinished)?;
        let reached_ms = AtomicU64::new(0);
        let watch = |time_s: f64| {
            let now_ms = (time_s * 1e3) as u64;
            self.advance(now_ms - reached_ms.swap(now_ms, Ordering::Relaxed));
            !self.interrupted.load(Ordering::Relaxed)
        };
        let result = trial::run(job.model, job.plan, trial, &job.course, (attempt, &unfinished), &watch);
        match result {
            Ok(_) | Err(ModelError::Step { .. }) => {
                put_in_place(&unfinished, &log)?;
                let run = ModelRun { trial: trial.clone(), log, wall_s: begun.elapsed().as_secs_f64(), result };
                self.progress.line(&line(&run));
                Ok(run)
            }
            Err(ModelError::Log(LogError::Write { source, .. })) => {
                remove(&unfinished)?;
                Err(LogError::Write { path: log, kept: 0, source }.into())
            }
            Err(error) => {
                remove(&unfinished)?;
                Err(error)
            }
        }
    }

    /// Counts a trial of `trial_s` seconds as done without computing it.
    pub fn pass(&self, trial_s: f64) {
        self.advance((trial_s * 1e3) as u64);
    }

    fn advance(&self, passed_ms: u64) {
        let all_ms = self.simulated_ms.fetch_add(passed_ms, Ordering::Relaxed) + passed_ms;
        self.progress.within(all_ms as f64 * 1e-3);
    }
}

/// Returns a pool of threads.
pub(crate) fn pool(threads: usize) -> Result<rayon::ThreadPool, ModelError> {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(ModelError::Threads)
}

/// Gives a finished log its name, and syncs the folder.
fn put_in_place(unfinished: &Path, log: &Path) -> Result<(), ModelError> {
    system::file::rename(unfinished, log).map_err(|source| ModelError::Place { path: log.to_owned(), source })?;
    sync_folder_of(log);
    Ok(())
}

/// Removes the unfinished log of a killed or interrupted run, if there is one.
fn remove(unfinished: &Path) -> Result<(), ModelError> {
    match std::fs::remove_file(unfinished) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            Err(ModelError::Place { path: unfinished.to_owned(), source })
        }
        _ => Ok(()),
    }
}
