//! `biflag simulate --from`: replays recorded trials in the model.

use super::super::answer::{Answer, Outcome, are_slight, lines_of_logs};
use super::super::options::cores;
use super::Args;
use super::output::{Row, Simulated, SimulatedTrial, real_time, tally};
use crate::plan::robot;
use crate::session::{Session, Sharing};
use crate::signals::interruption;
use crate::trial::{LogFinding, Want};
use crate::twin::{self, Replayed, Replays, Source};
use sim::trial::Options;
use sim::trial::quantity::SIMULATED;
use std::path::Path;
use std::time::Instant;

/// Returns the findings about the recordings, also those that belong to no trial.
fn findings(replays: &Replays<()>) -> Vec<LogFinding> {
    let of_trial = |(trial, ()): &(Replayed, ())| LogFinding::all_of(&trial.source, trial.findings.iter().cloned());
    replays.trials.iter().flat_map(of_trial).chain(replays.left_out.iter().cloned()).collect()
}

pub fn run(args: &Args, from: &Path) -> miette::Result<Answer> {
    let begun = Instant::now();
    let interrupted = interruption()?;
    let source = Source::open(from)?;
    let settings = twin::Settings {
        closure: args.closure,
        robot: args.robot.as_deref().map(robot::load).transpose()?,
        options: Options { rate_hz: args.rate, shapes: args.shapes },
        any_rate: false,
        jobs: args.jobs.map_or_else(cores, usize::from),
        quiet: false,
    };
    let folder = args.out.clone().unwrap_or_else(|| source.replay_folder());
    let session =
        if args.resume { Session::resume(&folder, &source.plan)? } else { Session::create(&folder, &source.plan)? };
    let _lock = session.lock(Sharing::Alone)?;
    let line = |run: &_| SimulatedTrial::from(run).to_string();
    let replays = twin::replay(&source, &session, &settings, Want::default(), &interrupted, &line, &|_, _| ())?;

    let replayed = || replays.trials.iter().map(|(trial, ())| trial);
    let computed = replayed().filter(|trial| trial.wall_s.is_some());
    let simulated_s: f64 =
        computed.clone().filter_map(|trial| Some(trial.result.as_ref().ok()?.values.get(&SIMULATED))).sum();
    let (real_time_factor, speed) = real_time(begun, simulated_s);
    let settled = |trial: &Replayed| trial.result.as_ref().is_ok_and(|steady| steady.settled);
    let findings = findings(&replays);
    let outcome = if replayed().any(|trial| trial.result.is_err()) {
        Outcome::Failed
    } else if replays.interrupted {
        Outcome::Interrupted
    } else {
        Outcome::of(replays.skipped.is_empty() && replayed().all(settled) && are_slight(&findings))
    };
    let rest = if replays.interrupted { "; interrupted, continue with --resume" } else { "" };
    let replays_made = tally("replayed", computed.map(|trial| trial.result.is_ok()));
    let mut lines = format!("session {}: {replays_made}{speed}{rest}", folder.display());
    lines += &lines_of_logs(&findings);
    lines.extend(replays.skipped.iter().map(|trial| format!("\nskipped: {}: {}", trial.name, trial.reason)));
    let notes = replays.notes();
    lines.extend(notes.iter().map(|note| format!("\nnote: {note}")));
    let row = |trial: &Replayed| {
        Row::One(SimulatedTrial {
            wall_s: trial.wall_s,
            error: trial.result.as_ref().err().cloned(),
            steady: trial.result.as_ref().ok().cloned(),
            ..SimulatedTrial::new(&trial.trial, &trial.log)
        })
    };
    let trials = replayed().map(row).collect();
    let simulated = Simulated { session: folder, real_time_factor, trials, notes };
    Ok(Answer::new(outcome, &simulated, lines)?.with("skipped", replays.skipped).with("findings", findings))
}
