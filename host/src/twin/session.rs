//! Comparisons of whole sessions: trials side by side, a few at a time in memory.

use super::replay::pool;
use super::{Allow, Comparison, Replays, SessionComparison, Skipped, Source, TwinError, compare_logs};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Holds the trials of a source against their replays in the session at `folder`.
///
/// # Errors
/// [`TwinError`] where nothing can be compared.
pub fn compare_replays(
    source: &Source,
    folder: &Path,
    replays: &Replays,
    allow: Allow,
    jobs: usize,
) -> Result<SessionComparison, TwinError> {
    let mut skipped = replays.skipped.clone();
    let mut pairs = Vec::new();
    for replayed in &replays.trials {
        let name = replayed.trial.name.clone();
        match &replayed.result {
            Ok(_) => pairs.push(Pair { name, logs: [replayed.source.clone(), replayed.log.clone()] }),
            Err(reason) => skipped.push(Skipped { name, reason: format!("its replay did not end: {reason}") }),
        }
    }
    compare_pairs([&source.path, folder], pairs, skipped, allow, jobs)
}

/// Holds the trials of a session, or one log, against those of another at the same speeds, repeat by repeat.
///
/// # Errors
/// [`TwinError`] where nothing can be compared.
pub fn compare_sessions(a: &Path, b: &Path, allow: Allow, jobs: usize) -> Result<SessionComparison, TwinError> {
    // Two logs are told what is wrong with them by name.
    if a.is_file() && b.is_file() {
        let name = a.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let logs = [a.to_owned(), b.to_owned()];
        return compare_pairs([a, b], vec![Pair { name, logs }], Vec::new(), allow, jobs);
    }
    let (measured, modelled) = (Source::open(a)?, Source::open(b)?);
    let mut skipped = measured.skipped.clone();
    let mut pairs = Vec::new();
    for (trial, log) in &measured.logs {
        let at_speeds =
            modelled.logs.iter().filter(|(other, _)| other.speeds == trial.speeds && other.reverse == trial.reverse);
        // A model needs no repeats: one stands for all.
        let other = at_speeds.clone().find(|(other, _)| other.repeat == trial.repeat).or(at_speeds.clone().next());
        match other {
            Some((_, other)) => pairs.push(Pair { name: trial.name.clone(), logs: [log.clone(), other.clone()] }),
            None => {
                let reason =
                    format!("{} has no such trial: none at its speeds, or none that reverses alike", b.display());
                skipped.push(Skipped { name: trial.name.clone(), reason });
            }
        }
    }
    if pairs.is_empty() {
        return Err(TwinError::Incomparable {
            measured: a.to_owned(),
            modelled: b.to_owned(),
            reason: "they have no common trials".to_owned(),
            help: "name sessions with trials at the same speeds",
        });
    }
    compare_pairs([a, b], pairs, skipped, allow, jobs)
}

struct Pair {
    name: String,
    logs: [PathBuf; 2],
}

/// A pair that cannot be compared is left out and said, unless none can.
fn compare_pairs(
    [measured, modelled]: [&Path; 2],
    pairs: Vec<Pair>,
    mut skipped: Vec<Skipped>,
    allow: Allow,
    jobs: usize,
) -> Result<SessionComparison, TwinError> {
    let compare = |pair: &Pair| compare_logs(&pair.logs[0], &pair.logs[1], allow);
    let results: Vec<_> = pool(jobs)?.install(|| pairs.par_iter().map(compare).collect());
    let mut trials = Vec::new();
    let mut failed = None;
    for (pair, result) in pairs.into_iter().zip(results) {
        match result {
            Ok(comparison) => trials.push(comparison),
            Err(error) => {
                skipped.push(Skipped { name: pair.name, reason: error.to_string() });
                failed.get_or_insert(error);
            }
        }
    }
    match failed {
        Some(error) if trials.is_empty() => Err(error),
        // What two sessions differ in goes for all of their trials.
        Some(error @ TwinError::Incomparable { .. }) if allow == Allow::Alike => Err(error),
        _ => Ok(summed_up([measured, modelled], trials, skipped)),
    }
}

fn summed_up([a, b]: [&Path; 2], trials: Vec<Comparison>, skipped: Vec<Skipped>) -> SessionComparison {
    let rms = |of: &dyn Fn(&Comparison) -> f64| {
        let sum: f64 = trials.iter().map(|trial| of(trial).powi(2)).sum();
        (!trials.is_empty()).then(|| (sum / trials.len() as f64).sqrt())
    };
    let steady = [
        rms(&|trial| trial.steady_yaw_error_deg),
        rms(&|trial| trial.steady_pitch_error_deg),
        rms(&|trial| trial.steady_roll_error_deg),
    ];
    SessionComparison {
        measured: a.to_owned(),
        modelled: b.to_owned(),
        yaw_rmse_deg: rms(&|trial| trial.yaw_rmse_deg),
        pitch_rmse_deg: rms(&|trial| trial.pitch_rmse_deg),
        roll_rmse_deg: rms(&|trial| trial.roll_rmse_deg),
        steady_rms_error_deg: match steady {
            [Some(yaw), Some(pitch), Some(roll)] => Some([yaw, pitch, roll]),
            _ => None,
        },
        verdict: verdict(&trials),
        trials,
        skipped,
    }
}

/// What most of the trials have in common.
fn verdict(trials: &[Comparison]) -> String {
    let differing = trials.iter().filter(|trial| !trial.findings.is_empty()).count();
    if differing == 0 {
        return format!("none of {} trials differs by more than noise allows", trials.len());
    }
    let mut text = format!("{differing} of {} trials differ by more than noise allows", trials.len());
    for angle in ["yaw", "pitch", "roll"] {
        let found: Vec<_> = trials.iter().flat_map(|trial| &trial.findings).filter(|f| f.angle == angle).collect();
        if let Some(worst) = found.iter().max_by(|a, b| a.error_deg.abs().total_cmp(&b.error_deg.abs())) {
            text += &format!("; {angle} in {}, by up to {:.2} deg", found.len(), worst.error_deg.abs());
        }
    }
    text
}
