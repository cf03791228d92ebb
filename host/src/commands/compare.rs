//! `biflag compare`: compares experiment and model.

use super::answer::{Answer, Outcome, WRONG_USE, finding_line};
use super::options::{closure, cores, written_as};
use crate::plan::robot;
use crate::report::{self, Kind, View};
use crate::signals::interruption;
use crate::text::{count, decimal, signed};
use crate::trial::Judged;
use crate::twin::{self, AngleComparison, Comparison, OnMismatch, Pairs, SessionAngle, SessionComparison, Source};
use serde_json::json;
use sim::body::closure::Closure;
use sim::trial::Options;
use std::fmt::Write;
use std::path::PathBuf;

/// Compare a log or a session with its replay in the model, or with another log or session.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag compare glycerin\n  \
    biflag compare glycerin --robot fitted.toml\n  \
    biflag compare glycerin glycerin-model\n\
    Missing and outdated replays are simulated first, into the folder SESSION-replay.\n\
    The page is compare.html in the session folder, or LOG.compare.html beside the log.")]
pub struct Args {
    /// The measurement: a log, or a session folder.
    a: PathBuf,
    /// The log or session to compare it with; by default the replay of A in the model.
    b: Option<PathBuf>,
    /// Compare despite different robots, closures or speeds.
    #[arg(long)]
    anyway: bool,
    /// Replay with this robot (a robot file, `physical` or `published`) instead of the robot in the log.
    #[arg(long, value_name = "FILE|NAME", conflicts_with = "b")]
    robot: Option<PathBuf>,
    /// Replay with this closure; by default the closure of the log's model, or `full`.
    #[arg(long, value_parser = closure(), conflicts_with = "b")]
    closure: Option<Closure>,
    /// The page to write; by default compare.html in the session folder, or LOG.compare.html.
    #[arg(short, long, value_name = "FILE", value_parser = written_as(&["html"]))]
    out: Option<PathBuf>,
    /// Number of parallel trials; by default the number of cores.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
}

/// Largest number of trials whose replays contain the shapes of the flagella, because the size of the page is limited.
const SHAPES_UP_TO: usize = 8;

pub fn run(args: &Args) -> miette::Result<Answer> {
    let jobs = args.jobs.map_or_else(cores, usize::from);
    let on_mismatch = OnMismatch::of(args.robot.is_some() || args.closure.is_some(), args.anyway);
    let budget = report::budget(&args.a)?;
    let want = report::want(budget);
    let view = |a: &Judged, b: &Judged, compared: &_| View::new(a, Some((compared, b)), budget);
    let (comparison, views, notes) = match &args.b {
        Some(b) => {
            let pairs = Pairs::of(&args.a, b)?;
            let (comparison, views) = twin::compare_pairs(&pairs, want, on_mismatch, jobs, &view)?;
            (comparison, views, Vec::new())
        }
        None => {
            let interrupted = interruption()?;
            let source = Source::open(&args.a)?;
            let settings = twin::Settings {
                closure: args.closure,
                robot: args.robot.as_deref().map(robot::load).transpose()?,
                options: Options { rate_hz: twin::REPLAY_HZ, shapes: source.logs.len() <= SHAPES_UP_TO },
                any_rate: true,
                jobs,
                quiet: false,
            };
            let replays = twin::compare_replays(&source, &settings, want, on_mismatch, &interrupted, &view)?;
            let folder = source.replay_folder();
            if replays.interrupted {
                let text = format!("interrupted; the complete replays are in {}", folder.display());
                let body = json!({ "trials": [], "report": null, "notes": [] });
                return Answer::new(Outcome::Interrupted, &body, text);
            }
            let notes = replays.notes();
            let (comparison, views) = replays.sum_up([&source.path, &folder], on_mismatch)?;
            (comparison, views, notes)
        }
    };
    if comparison.trials.is_empty() {
        let found = comparison.findings.iter().map(|of_log| of_log.finding.text.as_str());
        let reasons: Vec<_> = comparison.skipped.iter().map(|trial| trial.reason.as_str()).chain(found).collect();
        return Err(miette::miette!(code = WRONG_USE, "nothing could be compared: {}", reasons.join("; ")));
    }
    // The results are printed even if the page cannot be written.
    let (report, page) = match report::write(&args.a, Kind::Comparison, Some(&comparison), views, args.out.as_deref()) {
        Ok(written) => {
            (Some(written.html.to_string_lossy().into_owned()), format!("report: {}\n", written.html.display()))
        }
        Err(error) => (None, format!("no report: {error}\n")),
    };
    let noted: String = notes.iter().map(|note| format!("note: {note}\n")).collect();
    let text = describe(&comparison) + &noted + &page;
    let outcome = Outcome::of(comparison.is_sound() && report.is_some());
    Ok(Answer::new(outcome, &comparison, text)?.with("report", report).with("notes", notes))
}

fn describe(comparison: &SessionComparison) -> String {
    let headline = comparison.headline();
    let mut text = format!("{headline}\n{} against {}\n", comparison.measured.display(), comparison.modelled.display());
    for trial in &comparison.trials {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", line(trial));
        for of_log in &trial.findings {
            let is_other = trial.measured.as_os_str() != of_log.log.as_str();
            let log = is_other.then(|| format!("{} {}", trial.other, of_log.log));
            let _ = writeln!(text, "  {}", finding_line(log.as_deref(), &of_log.finding));
        }
        text.extend(trial.warnings.iter().map(|warning| format!("  warning: {warning}\n")));
    }
    if comparison.trials.len() > 1 {
        let rmse = [comparison.yaw_rmse_deg, comparison.pitch_rmse_deg, comparison.roll_rmse_deg];
        let [yaw, pitch, roll] = rmse.map(Option::unwrap_or_default);
        let [yaw, pitch, roll] = [yaw, pitch, roll].map(|deg| decimal(deg, 2));
        let trials = count(comparison.trials.len(), "trial");
        let _ = writeln!(text, "{trials}: RMSE yaw {yaw}°, pitch {pitch}°, roll {roll}°{}", together(comparison));
        let _ = writeln!(text, "  {}.", comparison.verdict);
        let beyond = comparison.chance.iter().flat_map(|chance| &chance.beyond);
        text.extend(beyond.map(|name| format!("  beyond chance: {name}\n")));
    }
    let told = |log: &String| comparison.trials.iter().any(|trial| trial.findings.iter().any(|one| one.log == *log));
    let others = comparison.findings.iter().filter(|of_log| !told(&of_log.log));
    text.extend(others.map(|of_log| finding_line(Some(&of_log.log), &of_log.finding) + "\n"));
    text.extend(comparison.skipped.iter().map(|trial| format!("skipped: {}: {}\n", trial.name, trial.reason)));
    text
}

/// Formats the mean errors of the trials of a session.
fn together(comparison: &SessionComparison) -> String {
    let mean = |angle: &SessionAngle| {
        format!("{} {}° ± {:.2}°", angle.angle, signed(angle.mean_error_deg, 2), angle.mean_uncertainty_deg)
    };
    let means: Vec<_> = comparison.angles.iter().map(mean).collect();
    if means.is_empty() { String::new() } else { format!("; mean steady error {}", means.join(", ")) }
}

fn line(trial: &Comparison) -> String {
    let each = |of: &dyn Fn(&AngleComparison) -> String| {
        trial.angles.each_ref().map(|angle| format!("{} {}", angle.angle, of(angle))).join(", ")
    };
    let measured = each(&|angle| format!("{}°", decimal(angle.measured_deg, 2)));
    let error = each(&|angle| format!("{}°{}", signed(angle.error_deg, 2), parts(angle)));
    let rmse = each(&|angle| format!("{}°", decimal(angle.rmse_deg, 2)));
    let settle = trial.settling.ratio.map_or_else(String::new, |ratio| format!(", settling time ratio {ratio:.2}"));
    let (shift_s, share) = (trial.time_shift_s, trial.compared_share);
    let shift = if shift_s == 0.0 { String::new() } else { format!(", time shift {} s", signed(shift_s, 2)) };
    let gaps = if share < 0.999 { format!(", over {:.1} % of the run", 100.0 * share) } else { String::new() };
    format!("{}: steady {measured}; error {error}; RMSE {rmse}{gaps}{settle}{shift}\n  {}.", trial.name, trial.verdict)
}

/// Formats the uncertainty of a steady error by its parts, if there is any.
fn parts(angle: &AngleComparison) -> String {
    let model = angle.model_error_deg.map_or_else(String::new, |deg| format!(", model {deg:.2}°"));
    match angle.uncertainty {
        Some(all) if all.total_deg > 0.0 => {
            format!(" ± {:.2}° (noise {:.2}°, sensor {:.2}°{model})", all.total_deg, all.noise_deg, all.sensor_deg)
        }
        _ => String::new(),
    }
}
