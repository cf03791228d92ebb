//! `biflag simulate --from`: replays recorded trials in the model.

use super::super::answer::{Answer, are_slight, lines_of_logs};
use super::super::options::cores;
use super::Args;
use super::output::{Row, Simulated, SimulatedTrial, ended};
use crate::plan::robot;
use crate::session::{Session, Sharing};
use crate::signals::interruption;
use crate::trial::{LogFinding, Want};
use crate::twin::{self, Replayed, Replays, Source};
use sim::trial::Options;
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

    let trials: Vec<_> = replays.trials.iter().map(|(trial, ())| SimulatedTrial::from(trial)).collect();
    let findings = findings(&replays);
    let is_sound = replays.skipped.is_empty() && are_slight(&findings);
    let (outcome, real_time_factor, replayed) = ended("replayed", begun, &trials, replays.interrupted, is_sound);
    let mut lines = format!("session {}: {replayed}", folder.display());
    lines += &lines_of_logs(&findings);
    lines.extend(replays.skipped.iter().map(|trial| format!("\nskipped: {}: {}", trial.name, trial.reason)));
    let notes = replays.notes();
    lines.extend(notes.iter().map(|note| format!("\nnote: {note}")));
    let trials = trials.into_iter().map(Row::One).collect();
    let simulated = Simulated { session: folder, real_time_factor, trials, notes };
    Ok(Answer::new(outcome, &simulated, lines)?.with("skipped", replays.skipped).with("findings", findings))
}
