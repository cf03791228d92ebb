//! Compares sessions trial by trial, in parallel, with a few trials in memory at a time.

use super::replay::pool;
use super::{Compared, Comparison, OnMismatch, Replays, SessionComparison, Skipped, Source, TwinError, compare};
use crate::plan::Trial;
use crate::session::Attempt;
use crate::text;
use crate::trial::{Data, LogFinding, Want};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Pairs of trials to compare.
#[derive(Clone, Debug)]
pub struct Pairs {
    /// The measured session or log, and the one that it is compared with.
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
    /// Pairs the trials of two sessions or logs that have the same speeds, repeat by repeat.
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
            return Err(TwinError::Incomparable {
                measured: a.to_owned(),
                modelled: b.to_owned(),
                reason: "they have no common trials".to_owned(),
                help: "name sessions with trials at the same speeds",
            });
        }
        Ok(Self { paths, pairs, skipped, left_out })
    }
}

/// Compares pairs of trials. `want` lists the optional parts of the logs to read; `then` is called with each comparison
/// and both trials. A pair that cannot be compared is skipped, unless none can.
///
/// # Errors
/// [`TwinError`] if no pair can be compared.
pub fn compare_pairs<T: Send>(
    pairs: &Pairs,
    want: Want,
    on_mismatch: OnMismatch,
    jobs: usize,
    then: &(dyn Fn(&Data, &Data, &Compared) -> T + Sync),
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

/// The comparison of a trial, with the caller's result for it.
type Named<T> = (String, Result<(Comparison, T), TwinError>);

impl<T> Replays<Result<(Comparison, T), TwinError>> {
    /// Summarises comparisons of recordings with these replays. `paths`: the sessions of both.
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
        let sum: f64 = trials.iter().map(|trial| of(trial).powi(2)).sum();
        (!trials.is_empty()).then(|| (sum / trials.len() as f64).sqrt())
    };
    let steady = [
        rms(&|trial| trial.steady_yaw_error_deg),
        rms(&|trial| trial.steady_pitch_error_deg),
        rms(&|trial| trial.steady_roll_error_deg),
    ];
    let comparison = SessionComparison {
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
        findings: trials.iter().flat_map(|trial| &trial.findings).chain(&left_out).cloned().collect(),
        trials,
        skipped,
    };
    Ok((comparison, made))
}

/// Returns a summary of the differences of all trials.
fn verdict(trials: &[Comparison]) -> String {
    // Trials of a session may be of different kinds only after somebody has put logs into it.
    let sides = match trials.split_first() {
        Some((first, rest)) if rest.iter().all(|trial| trial.sides == first.sides) => first.sides.text(),
        _ => "both sides",
    };
    let differing = trials.iter().filter(|trial| !trial.differences.is_empty()).count();
    let is_unknown =
        |trial: &&Comparison| trial.yaw_uncertainty_deg.is_none() || trial.tilt_uncertainty_deg.contains(&None);
    let unknown = trials.iter().filter(is_unknown).count();
    let all = text::count(trials.len(), "trial");
    let of_unknown = match unknown {
        0 => String::new(),
        _ => format!("; the noise is unknown in {unknown} of {all}"),
    };
    if differing == 0 {
        return match trials.len() - unknown {
            0 => format!("the noise is unknown in all of {all}"),
            _ if unknown == 0 => format!("{sides} agree within noise in all trials"),
            known => format!("{sides} agree within noise in {known} of {all}{of_unknown}"),
        };
    }
    let mut verdict = format!("{differing} of {all} differ by more than the noise");
    for angle in ["yaw", "pitch", "roll"] {
        let found: Vec<_> = trials.iter().flat_map(|trial| &trial.differences).filter(|f| f.angle == angle).collect();
        if let Some(worst) = found.iter().max_by(|a, b| a.error_deg.abs().total_cmp(&b.error_deg.abs())) {
            let (found, worst) = (text::count(found.len(), "trial"), worst.error_deg.abs());
            verdict += &format!("; {angle} in {found}, by at most {worst:.2}°");
        }
    }
    verdict + &of_unknown
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Sides;

    #[test]
    fn agreement_is_claimed_only_where_the_noise_is_known() {
        let known = Comparison {
            yaw_uncertainty_deg: Some(1.0),
            tilt_uncertainty_deg: [Some(0.1); 2],
            ..Comparison::default()
        };
        let unknown = Comparison { yaw_uncertainty_deg: None, ..known.clone() };
        assert_eq!(verdict(&[known.clone(), known.clone()]), "model and measurement agree within noise in all trials");
        assert_eq!(verdict(&[unknown.clone(), unknown.clone()]), "the noise is unknown in all of 2 trials");
        let model = Comparison { sides: Sides::Models, ..known.clone() };
        assert_eq!(verdict(&[model.clone(), model.clone()]), "the two models agree within noise in all trials");
        assert_eq!(verdict(&[model, known.clone()]), "both sides agree within noise in all trials");
        assert_eq!(
            verdict(&[known, unknown]),
            "model and measurement agree within noise in 1 of 2 trials; the noise is unknown in 1 of 2 trials"
        );
    }
}
