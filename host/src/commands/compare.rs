//! `biflag compare`: experiment held against model.

use super::replay::interruption;
use super::simulate::{ClosureName, cores};
use super::{Answer, Outcome, WRONG_USE};
use crate::plan::robot;
use crate::report;
use crate::session::{Session, Sharing};
use crate::twin::{self, Allow, Comparison, SessionComparison, Source};
use serde::Serialize;
use sim::trial::Options;
use std::fmt::Write;
use std::path::PathBuf;

/// Hold a log or a session against its own replay in the model, or against another one.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag compare glycerin\n  \
    biflag compare glycerin --robot fitted.toml\n  \
    biflag compare glycerin glycerin-model\n\
    Replays that are missing or out of date are made in the folder of `biflag simulate --from`.\n\
    Exit code 3: a log is not whole, or a trial could not be compared.")]
pub struct Args {
    /// What was measured: a log, or a session's folder.
    a: PathBuf,
    /// What to hold it against; by default its own replay.
    b: Option<PathBuf>,
    /// Compare in spite of other robots, closures or speeds.
    #[arg(long)]
    anyway: bool,
    /// Replay with the robot in this file instead of the log's own.
    #[arg(long, value_name = "FILE", conflicts_with = "b")]
    robot: Option<PathBuf>,
    /// Replay with this closure; by default that of the log's own model, and `full` where it has none.
    #[arg(long, value_enum, conflicts_with = "b")]
    closure: Option<ClosureName>,
    /// Trials at a time; by default one on every core.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
}

/// The replays' rate. The slowest wobble worth seeing takes half a second.
const REPLAY_HZ: f64 = 20.0;

/// Replays of no more trials than this have the flagella's shapes, for the page's view of the robot: it has no room for more.
const SHAPES_UP_TO: usize = 8;

#[derive(Serialize)]
struct Compared<'a> {
    #[serde(flatten)]
    comparison: &'a SessionComparison,
    /// The page that shows it.
    report: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let jobs = args.jobs.map_or_else(cores, usize::from);
    let allow = if args.robot.is_some() || args.closure.is_some() {
        Allow::AsNamed
    } else if args.anyway {
        Allow::Anyway
    } else {
        Allow::Alike
    };
    let comparison = match &args.b {
        Some(b) => twin::compare_sessions(&args.a, b, allow, jobs)?,
        None => {
            let interrupted = interruption()?;
            let source = Source::open(&args.a)?;
            let settings = twin::Settings {
                closure: args.closure.map(Into::into),
                robot: args.robot.as_deref().map(robot::load).transpose()?,
                options: Options { rate_hz: REPLAY_HZ, shapes: source.logs.len() <= SHAPES_UP_TO },
                any_rate: true,
                jobs,
            };
            let folder = source.replay_folder();
            let session = Session::resume(&folder, &source.plan)?;
            let _lock = session.lock(Sharing::Alone)?;
            let replays = twin::replay(&source, &session, &settings, &interrupted, &|run| run.trial.name.clone())?;
            if replays.interrupted {
                let text = format!("interrupted; the replays that ended are in {}", folder.display());
                return Answer::new(Outcome::Interrupted, &serde_json::json!({ "trials": [], "report": null }), text);
            }
            twin::compare_replays(&source, &folder, &replays, allow, jobs)?
        }
    };
    if comparison.trials.is_empty() {
        let reasons: Vec<_> = comparison.skipped.iter().map(|trial| trial.reason.as_str()).collect();
        return Err(miette::miette!(code = WRONG_USE, "nothing could be compared: {}", reasons.join("; ")));
    }
    let is_whole = comparison.skipped.is_empty() && comparison.trials.iter().all(|trial| trial.warnings.is_empty());
    // Figures without a page are better than none.
    let (report, page) = match report::write(&args.a, Some(&comparison), None) {
        Ok(written) => (Some(written.html.clone()), format!("report: {}\n", written.html.display())),
        Err(error) => (None, format!("no report: {error}\n")),
    };
    let outcome = if is_whole && report.is_some() { Outcome::Done } else { Outcome::WithLoss };
    let text = describe(&comparison) + &page;
    Answer::new(outcome, &Compared { comparison: &comparison, report }, text)
}

fn describe(comparison: &SessionComparison) -> String {
    let mut text = format!("{} against {}\n", comparison.measured.display(), comparison.modelled.display());
    for trial in &comparison.trials {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", line(trial));
        for warning in &trial.warnings {
            let _ = writeln!(text, "  warning: {warning}");
        }
    }
    if comparison.trials.len() > 1 {
        let rmse = [comparison.yaw_rmse_deg, comparison.pitch_rmse_deg, comparison.roll_rmse_deg];
        let [yaw, pitch, roll] = rmse.map(Option::unwrap_or_default);
        let _ = writeln!(text, "all: RMSE yaw {yaw:.2}, pitch {pitch:.2}, roll {roll:.2} deg; {}", comparison.verdict);
    }
    for trial in &comparison.skipped {
        let _ = writeln!(text, "skipped: {}: {}", trial.name, trial.reason);
    }
    text
}

fn line(trial: &Comparison) -> String {
    let Comparison { name, yaw_rmse_deg, pitch_rmse_deg, roll_rmse_deg, verdict, .. } = trial;
    let [yaw, pitch, roll] = [trial.steady_yaw_error_deg, trial.steady_pitch_error_deg, trial.steady_roll_error_deg];
    let known = match trial.yaw_uncertainty_deg {
        Some(deg) => format!(" (known to {deg:.2})"),
        None => String::new(),
    };
    let settle = match trial.settle_ratio {
        Some(ratio) => format!(", settles in {ratio:.2} of the time"),
        None => String::new(),
    };
    let shift = match trial.time_shift_s {
        0.0 => String::new(),
        shift => format!(", shifted by {shift:+.2} s"),
    };
    format!(
        "{name}: RMSE yaw {yaw_rmse_deg:.2}, pitch {pitch_rmse_deg:.2}, roll {roll_rmse_deg:.2} deg; steady errors yaw \
         {yaw:+.2}{known}, pitch {pitch:+.2}, roll {roll:+.2} deg{settle}{shift}\n  {verdict}"
    )
}
