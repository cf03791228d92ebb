//! Start and end of a trial's phases.

use super::data::{Data, Times};
use biflag_log::{End, Origin, TrialMeta};

/// Returns the phases of a trial, from the phases and the records of its log. On a rig, the run begins when the motors get their
/// target speeds, at `ordered_s`, shortly after the start of the phase, and ends with the first `fault`. If the event of a
/// phase is lost, the planned times are used. Reasons for a shortened run are added to the warnings.
pub(super) fn times(data: &mut Data, ordered_s: Option<f64>, fault: Option<&(f64, String)>) -> Times {
    let Data { phases, records, duration_s: end_s, warnings, .. } = data;
    let (trial, summary, end_s) = (records.trial.as_ref(), records.summary.as_ref(), *end_s);
    let is_model = records.origin() == Origin::Model;
    let at = |name: &str| phases.iter().position(|(phase, _)| phase == name);
    let start = |i: usize| phases[i].1;
    let next = |i: usize| phases.get(i + 1).map(|(_, next)| *next);
    let run_start = match (at("run").map(start), ordered_s) {
        (Some(run), _) if is_model => run,
        (Some(run), ordered) => ordered.unwrap_or(run),
        (None, Some(ordered)) => {
            let after = |name: &str, planned: fn(&TrialMeta) -> f64| Some(start(at(name)?) + planned(trial?));
            let planned = after("preroll", |trial| trial.preroll_s)
                .or_else(|| after("calibrate", |trial| trial.calibrate_s + trial.preroll_s))
                // The clock of a model starts with its trial.
                .or_else(|| trial.filter(|_| is_model).map(|trial| trial.calibrate_s + trial.preroll_s));
            let (used, start) = match planned {
                Some(planned) => ("the planned one", planned.min(ordered)),
                None => ("the first reading with a target speed", ordered),
            };
            warnings.push(format!("the start of the run is lost; {used} is used"));
            start
        }
        (None, None) => return Times::default(),
    };
    let later = |name: &str| at(name).map(start).filter(|start| *start >= run_start);
    // Without the event of the decay, the end of the trial is not the end of the run.
    let planned_end = trial.filter(|trial| trial.decay_s > 0.0).map(|trial| run_start + trial.run_s);
    let after = later("decay").or_else(|| later("end").map(|end| planned_end.map_or(end, |run| run.min(end))));
    // A model's run lasts longer than its samples.
    let last = after.map_or(end_s, |after| if is_model { after } else { after.min(end_s) });
    let mut run_end = last;
    if let Some((time, fault)) = fault
        && *time < run_end
    {
        warnings.push(format!("the board stopped at {time:.1} s ({fault}); the run is used up to there"));
        run_end = *time;
    } else if after.is_none() {
        let reason = match summary {
            None => "the log ends without a summary",
            Some(summary) if summary.end == End::Aborted => "it was interrupted",
            Some(summary) if summary.reason.is_empty() => "the log ends during the run",
            Some(summary) => &summary.reason,
        };
        warnings.push(format!("the trial is not complete: {reason}; its run is used up to {run_end:.1} s"));
    }
    let calibrated = || Some(start(at("calibrate")?) + trial?.calibrate_s);
    let preroll = at("preroll").map(start).or_else(calibrated).unwrap_or(run_start).min(run_start)..run_start;
    let decay = match at("decay") {
        Some(i) => start(i)..next(i).unwrap_or(end_s).min(end_s),
        None => last..later("end").unwrap_or(last).min(end_s).max(last),
    };
    Times { preroll, run: run_start..run_end.max(run_start), decay }
}

#[cfg(test)]
mod tests {
    use super::super::data::Records;
    use super::*;
    use biflag_log::{Identity, Summary};

    /// Returns the phases of a complete trial of the rig with one lost event.
    fn without(lost: &str) -> (Times, Vec<String>) {
        let trial = TrialMeta { calibrate_s: 5.0, preroll_s: 20.0, run_s: 60.0, decay_s: 30.0, ..TrialMeta::default() };
        let all = [("calibrate", 0.0), ("preroll", 5.02), ("run", 25.04), ("decay", 85.06), ("end", 115.08)];
        let phases: Vec<_> =
            all.into_iter().filter(|(name, _)| *name != lost).map(|(name, time)| (name.to_owned(), time)).collect();
        // The frames near the lost event are lost too.
        let ordered_s = Some(if lost == "run" { 26.8 } else { 25.05 });
        let summary = Some(Summary { end: End::Complete, ..Summary::default() });
        let records = Records { trial: Some(trial), summary, ..Records::default() };
        let mut data = Data { phases, records, duration_s: 115.08, ..Data::default() };
        (times(&mut data, ordered_s, None), data.warnings)
    }

    /// A model's run is found without the event of its start, and lasts beyond the last sample to its planned end.
    #[test]
    fn run_of_a_model_has_its_planned_start_and_its_whole_length() {
        let identity = Some(Identity { origin: Origin::Model, ..Identity::default() });
        let trial = Some(TrialMeta { run_s: 6.9, ..TrialMeta::default() });
        let records = Records { identity, trial, ..Records::default() };
        let mut data = Data { phases: vec![("end".to_owned(), 6.9)], records, duration_s: 6.0, ..Data::default() };
        assert_eq!(times(&mut data, Some(4.0), None).run, 0.0..6.9);
        assert_eq!(data.warnings, ["the start of the run is lost; the planned one is used"]);
        data.records.trial = None;
        assert_eq!(times(&mut data, Some(4.0), None).run, 4.0..6.9);
        assert_eq!(data.warnings[1], "the start of the run is lost; the first reading with a target speed is used");
    }

    #[test]
    fn planned_times_replace_a_lost_event() {
        let (intact, warnings) = without("");
        assert_eq!(intact, Times { preroll: 5.02..25.05, run: 25.05..85.06, decay: 85.06..115.08 });
        assert!(warnings.is_empty());
        for lost in ["calibrate", "preroll", "run", "decay", "end"] {
            let (times, warnings) = without(lost);
            let bounds =
                |times: &Times| [&times.preroll, &times.run, &times.decay].map(|range| [range.start, range.end]);
            for (found, expected) in bounds(&times).as_flattened().iter().zip(bounds(&intact).as_flattened()) {
                assert!((found - expected).abs() < 0.1, "without {lost}: {times:?}");
            }
            assert_eq!(warnings.len(), usize::from(lost == "run"), "{warnings:?}");
        }
    }
}
