//! Compares sessions trial by trial, in parallel, with a few trials in memory at a time.

mod comparison;
mod together;
mod verdict;

pub use comparison::{Chance, SessionAngle, SessionComparison, Skipped};

use super::{
    AngleComparison, Compared, Comparison, OnMismatch, Replayed, Replays, Settings, Source, TwinError, compare, replay,
};
use crate::plan::Trial;
use crate::run::model::pool;
use crate::session::{Attempt, Session, Sharing};
use crate::trial::{Judged, LogFinding, Want};
use rayon::prelude::*;
use sim::functions::powi;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Pairs of trials to compare.
#[derive(Clone, Debug)]
pub struct Pairs {
    /// The measured session or log, and the other one.
    pub paths: [PathBuf; 2],
    pairs: Vec<Pair>,
    skipped: Vec<Skipped>,
    left_out: Vec<LogFinding>,
}

#[derive(Clone, Debug)]
struct Pair {
    name: String,
    logs: [Attempt; 2],
}

impl Pairs {
    /// Pairs the trials of two sessions or logs at the same speeds, repeat by repeat.
    ///
    /// # Errors
    /// [`TwinError`] if there are none.
    pub fn of(a: &Path, b: &Path) -> Result<Self, TwinError> {
        let paths = [a.to_owned(), b.to_owned()];
        // Errors about single logs name the logs.
        if a.is_file() && b.is_file() {
            let name = a.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let logs = paths.each_ref().map(|path| Attempt::of_log(path));
            return Ok(Self { pairs: vec![Pair { name, logs }], paths, skipped: Vec::new(), left_out: Vec::new() });
        }
        let (measured, modelled) = (Source::open(a)?, Source::open(b)?);
        let left_out = [measured.left_out.clone(), modelled.left_out.clone()].concat();
        let mut skipped = measured.skipped.clone();
        let mut pairs = Vec::new();
        for (trial, log) in &measured.logs {
            let at_speeds = modelled
                .logs
                .iter()
                .filter(|(other, _)| other.speeds == trial.speeds && other.reverse == trial.reverse);
            // A model has no repeats: one trial is compared with all repeats. A rig has no planned starting phases.
            let phase = |trial: &Trial| trial.phase_deg.unwrap_or_default();
            let likeness = |other: &Trial| (phase(other) == phase(trial), other.repeat == trial.repeat);
            let other = at_speeds.rev().max_by_key(|(other, _)| likeness(other));
            match other {
                Some((_, other)) => pairs.push(Pair { name: trial.name.clone(), logs: [log.clone(), other.clone()] }),
                None => {
                    let reason = format!("{} has no trial at its speeds with the same reversal", b.display());
                    skipped.push(Skipped { name: trial.name.clone(), reason });
                }
            }
        }
        if pairs.is_empty() {
            let reason = "they have no common trials".to_owned();
            return Err(TwinError::incomparable([a, b], reason, "name sessions with trials at the same speeds"));
        }
        Ok(Self { paths, pairs, skipped, left_out })
    }
}

/// Compares pairs of trials. `want` lists the optional parts of the logs to read; `then` is called with each comparison
/// and both trials. A pair that cannot be compared is skipped, unless no pair can be compared.
///
/// # Errors
/// [`TwinError`] if no pair can be compared.
pub fn compare_pairs<T: Send>(
    pairs: &Pairs,
    want: Want,
    on_mismatch: OnMismatch,
    jobs: usize,
    then: &(dyn Fn(&Judged, &Judged, &Compared) -> T + Sync),
) -> Result<(SessionComparison, Vec<T>), TwinError> {
    let one = |Pair { name, logs: [a, b] }: &Pair| {
        let compared = || {
            let (a, b) = (a.read(Want { hash: true, ..want })?, b.read(want)?);
            let compared = compare(&a, &b, on_mismatch)?;
            let made = then(&a, &b, &compared);
            Ok((compared.comparison, made))
        };
        (name.clone(), compared())
    };
    let results = pool(jobs)?.install(|| pairs.pairs.par_iter().map(one).collect());
    let paths = pairs.paths.each_ref().map(PathBuf::as_path);
    sum_up(paths, results, (pairs.skipped.clone(), pairs.left_out.clone()), on_mismatch)
}

/// Replays, each with its comparison and the caller's result for it.
pub type ComparedReplays<T> = Replays<Result<(Comparison, T), TwinError>>;

/// Compares recordings with their replays, which are computed if they are missing or outdated. `then` as in [`compare_pairs`];
/// the replay has the shapes and the forces that `want` asks for if the recording has none.
///
/// # Errors
/// As [`replay`].
pub fn compare_replays<T: Send>(
    source: &Source,
    settings: &Settings,
    want: Want,
    on_mismatch: OnMismatch,
    interrupted: &AtomicBool,
    then: &(dyn Fn(&Judged, &Judged, &Compared) -> T + Sync),
) -> Result<ComparedReplays<T>, TwinError> {
    let session = Session::resume(&source.replay_folder(), &source.plan)?;
    let _lock = session.lock(Sharing::Alone)?;
    let compare = |replayed: &Replayed, a: Judged| {
        let shapes = if a.data.shapes.is_empty() { want.shapes } else { 0 };
        let forces = want.forces && a.data.forces.is_empty();
        let b = Judged::read(&replayed.log, Want { shapes, forces, ..want })?;
        let compared = compare(&a, &b, on_mismatch)?;
        let made = then(&a, &b, &compared);
        Ok((compared.comparison, made))
    };
    replay(source, &session, settings, want, interrupted, &|run| run.trial.name.clone(), &compare)
}

/// The comparison of a trial, with the caller's result for it.
type Named<T> = (String, Result<(Comparison, T), TwinError>);

impl<T> ComparedReplays<T> {
    /// Summarises comparisons of recordings with these replays. `paths`: both sessions.
    ///
    /// # Errors
    /// [`TwinError`] if no trial could be compared, or if the first reason applies to all trials.
    pub fn sum_up(self, paths: [&Path; 2], on_mismatch: OnMismatch) -> Result<(SessionComparison, Vec<T>), TwinError> {
        let (mut results, mut skipped) = (Vec::new(), self.skipped);
        for (replayed, compared) in self.trials {
            let name = replayed.trial.name;
            match replayed.result {
                Ok(_) => results.push((name, compared)),
                Err(reason) => skipped.push(Skipped { name, reason: format!("the solver failed: {reason}") }),
            }
        }
        sum_up(paths, results, (skipped, self.left_out), on_mismatch)
    }
}

/// Summarises the comparisons of a session.
fn sum_up<T>(
    [a, b]: [&Path; 2],
    results: Vec<Named<T>>,
    (mut skipped, left_out): (Vec<Skipped>, Vec<LogFinding>),
    on_mismatch: OnMismatch,
) -> Result<(SessionComparison, Vec<T>), TwinError> {
    let (mut trials, mut made) = (Vec::new(), Vec::new());
    let mut failed = None;
    for (name, result) in results {
        match result {
            Ok((comparison, one)) => {
                trials.push(comparison);
                made.push(one);
            }
            Err(error) => {
                skipped.push(Skipped { name, reason: error.to_string() });
                failed.get_or_insert(error);
            }
        }
    }
    match failed {
        Some(error) if trials.is_empty() => return Err(error),
        // A difference between two sessions applies to all of their trials.
        Some(error @ TwinError::Incomparable { .. }) if on_mismatch == OnMismatch::Reject => return Err(error),
        _ => {}
    }
    let rms = |of: &dyn Fn(&Comparison) -> f64| {
        let sum: f64 = trials.iter().map(|trial| powi(of(trial), 2)).sum();
        (!trials.is_empty()).then(|| (sum / trials.len() as f64).sqrt())
    };
    let rms_of = |of: fn(&AngleComparison) -> f64| [0, 1, 2].map(|k| rms(&|trial| of(&trial.angles[k])));
    let steady_rms_error_deg = match rms_of(|angle| angle.error_deg) {
        [Some(yaw), Some(pitch), Some(roll)] => Some([yaw, pitch, roll]),
        _ => None,
    };
    let [yaw_rmse_deg, pitch_rmse_deg, roll_rmse_deg] = rms_of(|angle| angle.rmse_deg);
    let chance = together::chance(&mut trials);
    let angles = together::angles(&trials);
    let comparison = SessionComparison {
        measured: a.to_owned(),
        modelled: b.to_owned(),
        yaw_rmse_deg,
        pitch_rmse_deg,
        roll_rmse_deg,
        steady_rms_error_deg,
        verdict: verdict::verdict(&trials, &angles, chance.as_ref()),
        angles,
        chance,
        findings: trials.iter().flat_map(|trial| &trial.findings).chain(&left_out).cloned().collect(),
        trials,
        skipped,
    };
    Ok((comparison, made))
}
