//! `biflag info`: shows the content of a log or a session.

use super::answer::{Answer, Outcome, finding_line};
use crate::plan::{HandTurn, Plan};
use crate::session::{Attempt, Session, TrialState, is_being_recorded, recorded};
use crate::text::{self, count, decimal, word};
use crate::trial::{
    AngleTerm, Angles, Budget, Data, Finding, Judged, Records, Repeat, Repeats, Want, Zeroed, scatter_of_repeats,
};
use biflag_log::{Condition, End, LinkStats, LogError, Origin, Summary};
use rayon::prelude::*;
use serde_json::json;
use sim::trial::quantity::{MIN_GAP, SETTLE};
use std::fmt::{Display, Write};
use std::path::{Path, PathBuf};

/// Smallest share of the variance for which a cause is shown.
const LEAST_SHARE: f64 = 0.02;

/// Show the content of a log or a session: trials, steady angles, link errors, damage.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  biflag info glycerin/001_w1+50_w2+10.mcap\n  \
    biflag info glycerin")]
pub struct Args {
    /// A log, or a session folder.
    path: PathBuf,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    if args.path.is_dir() { session(&args.path) } else { log(&args.path) }
}

fn log(path: &Path) -> miette::Result<Answer> {
    let Judged { data, angles: zeroed, findings, not_judged } = Attempt::of_log(path).read(Want::default())?;
    let angles = zeroed.angles();
    let clean = data.condition.is_whole();
    let records = &data.records;
    let body = json!({
        "channels": data.channels,
        "duration_s": data.duration_s,
        "samples": data.link.samples,
        "lost": data.link.lost,
        "clean": clean,
        "rewritten_by": data.rewritten_by,
        "crc_errors": data.link.crc_errors,
        "resyncs": data.link.resyncs,
        "retries": data.link.retries,
        "losses": data.losses.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "origin": records.identity.as_ref().map(|identity| identity.origin.name()),
        "created": records.identity.as_ref().map(|identity| &identity.created),
        "trial": records.trial.as_ref().map(|_| data.trial()),
        "end": records.summary.as_ref().map(|summary| summary.end),
        "run_start_s": data.times.run_s().map(|[start, _]| start),
        "run_end_s": data.times.run_s().map(|[_, end]| end),
        "angle_deg": records.board.as_ref().and_then(|board| board.angle_deg),
        "angles": angles,
        "budget": budget_of(angles.as_ref()),
        "notes": data.notes().map(|(time_s, text)| json!({ "time_s": time_s, "text": text })).collect::<Vec<_>>(),
        "findings": findings,
        "not_judged": not_judged,
        "model": records.model,
        "steady": records.steady,
    });
    let is_sound = clean && !findings.iter().any(|finding| finding.grave);
    // A log that is being recorded has no end yet.
    let is_open = data.condition == Condition::CutOff && is_being_recorded(path);
    let mut text = describe(path, &data, &zeroed, is_open);
    // Writing to a string cannot fail.
    let shown = findings.iter().filter(|_| !is_open);
    shown.for_each(|finding| _ = writeln!(text, "{}", finding_line(None, finding)));
    not_judged.iter().filter(|_| !is_open).for_each(|why| _ = writeln!(text, "not judged: {why}"));
    Answer::new(Outcome::of(is_sound), &body, text)
}

/// Lines with a name and a value. Lines without a value are left out.
#[derive(Default)]
struct Lines(String);

impl Lines {
    fn add(&mut self, name: &str, value: impl Display) {
        let value = value.to_string();
        if !value.is_empty() {
            // A note may have several lines. Writing to a string cannot fail.
            let value = text::printable(value.trim_end()).replace('\n', "\n             ");
            let _ = writeln!(self.0, "{name:<12} {value}");
        }
    }
}

/// `is_open`: whether the log is being recorded.
fn describe(path: &Path, data: &Data, zeroed: &Zeroed, is_open: bool) -> String {
    let records = &data.records;
    let mut lines = Lines::default();
    lines.add("log", path.display());
    describe_setup(&mut lines, data);
    lines.add("duration", format!("{:.3} s", data.duration_s));
    let link = Some(data.link).filter(|_| data.origin() != Origin::Imported);
    lines.add("link", link.map_or_else(String::new, |link| link.to_string()));
    describe_results(&mut lines, data, zeroed);
    let notes: Vec<_> = data.notes().map(|(time_s, text)| format!("{time_s:.2} s: {text}")).collect();
    lines.add("notes", notes.join("\n"));
    let counts: Vec<_> = data.channels.iter().map(|(topic, count)| format!("{topic} {count}")).collect();
    lines.add("channels", counts.join(", "));
    lines.add("ended", records.summary.as_ref().map_or_else(|| "without a summary".to_owned(), ending));
    if let Some(recovery) = &records.recovery {
        lines.add("recovered", format!("from {}; lost: {}", recovery.source, recovery.lost));
    }
    lines.add("condition", condition(data, is_open));
    for loss in data.losses.iter().filter(|_| !is_open) {
        lines.add("  lost", loss);
    }
    lines.0
}

/// Adds the recorder of the log, and the task of the trial.
fn describe_setup(lines: &mut Lines, data: &Data) {
    let records = &data.records;
    if let Some(identity) = &records.identity {
        lines.add("created", &identity.created);
        let program = format!("biflag {} ({})", identity.host_version, identity.host_git_hash);
        lines.add("by", format!("{program}, protocol {}, {}", identity.protocol, identity.origin.name()));
    }
    if let Some(plan) = &records.plan {
        lines.add("session", format!("{}, {}", plan.name, count(plan.trials, "trial")));
        lines.add("operator", &plan.operator);
        lines.add("note", &plan.note);
    }
    if let Some(t) = records.trial.as_ref().map(|_| data.trial()) {
        let speeds = format!("{} and {} rpm", t.w1_rpm, t.w2_rpm);
        lines.add("trial", format!("{}, {speeds}, repeat {}, attempt {}", t.name, t.repeat, t.attempt));
        // Times of an imported trial are differences of its clock.
        let [calibrate, preroll, run, decay] =
            [t.calibrate_s, t.preroll_s, t.run_s, t.decay_s].map(|s| (s * 1e3).round() / 1e3);
        lines.add("starts at", t.phase_deg.map_or(String::new(), |[one, two]| format!("{one}° and {two}°")));
        lines.add("phases", format!("calibrate {calibrate} s, preroll {preroll} s, run {run} s, decay {decay} s"));
    }
    lines.add("robot", records.robot.as_ref().map_or("", |robot| &robot.name));
    lines.add("rest", records.rest.as_ref().map_or_else(String::new, text::rest));
    if let Some(model) = &records.model {
        let shapes = if model.shapes { ", with shapes" } else { "" };
        lines.add("model", format!("closure {}, {} samples per second{shapes}", word(&model.closure), model.rate_hz));
    } else if let Some(board) = &records.board {
        let (id, imu) = (board.board_id, board.imu_id);
        let firmware = format!("firmware {} ({})", board.firmware, board.firmware_git_hash);
        lines.add("board", format!("{id}, {firmware}, IMU {imu:#04x}, start {}", board.boot_count));
        let angles = board.angle_deg.map(|[one, two]| format!("{one:.1}° and {two:.1}° from their marks"));
        lines.add("flagella at", angles.unwrap_or_default());
    }
    lines.add("clock", records.clock.as_ref().map_or_else(String::new, text::clock));
}

/// Adds the steady state of a model, and the steady angles.
fn describe_results(lines: &mut Lines, data: &Data, zeroed: &Zeroed) {
    let records = &data.records;
    if let Some(steady) = &records.steady {
        match steady.kind {
            Some(kind) => lines.add("motion", kind.name().replace('_', " ")),
            None if steady.settled => lines.add("settled", format!("after {:.0} s", steady.values.get(&SETTLE))),
            None => lines.add("settled", "no"),
        }
        let gap_mm = steady.values.get(&MIN_GAP) * 1e3;
        let over = steady.gap_of();
        lines.add("flagella", format!("{}, smallest gap {gap_mm:.2} mm in the {over}", word(&steady.bundling)));
    }
    let Some(angles) = zeroed.angles() else { return };
    if let Some(turn) = hand_turn(records) {
        lines.add("hand turn", turn.verdict(angles.turned_deg).0);
    } else {
        lines.add("steady", &angles);
        if !data.is_model() {
            lines.add("swings at", &angles.measured);
        }
        let budget = zeroed.steady.as_ref().and_then(|steady| steady.budgets[0].as_ref());
        lines.add("of the yaw's ±", budget.map_or_else(String::new, shares));
    }
    let [x, y, z] = angles.turned_deg.map(|deg| decimal(deg, 1));
    lines.add("net angle", format!("{x}°, {y}°, {z}° about the body's x, y, z, over the whole log"));
}

fn condition(data: &Data, is_open: bool) -> String {
    match (data.condition, &data.rewritten_by) {
        _ if is_open => "being recorded".to_owned(),
        (Condition::Rewritten, Some(program)) => format!("rewritten by {program}, whole"),
        (Condition::Clean | Condition::Rewritten, _) => "log clean".to_owned(),
        (Condition::CutOff, _) => "cut off; `biflag recover` writes an intact log from it".to_owned(),
        (Condition::Damaged, _) => {
            "damaged; `biflag recover` writes an intact log from the part that can be read".to_owned()
        }
    }
}

fn ending(summary: &Summary) -> String {
    let reason = if summary.reason.is_empty() { String::new() } else { format!(": {}", summary.reason) };
    word(&summary.end) + &reason
}

/// Returns the turn by hand that the plan of a trial asks for.
fn hand_turn(records: &Records) -> Option<HandTurn> {
    let plan = records.plan.as_ref()?;
    Plan::parse(&plan.text, &plan.name).ok()?.hand_turn
}

fn budget_of(angles: Option<&Angles>) -> &[AngleTerm] {
    angles.map_or(&[], |angles| &angles.budget)
}

/// Formats the largest causes of an uncertainty as one line.
fn shares(budget: &Budget) -> String {
    let mut terms: Vec<_> = budget.terms().filter(|term| term.share >= LEAST_SHARE).collect();
    terms.sort_by(|a, b| b.share.total_cmp(&a.share));
    terms.iter().map(|term| format!("{} {:.0} %", term.name, 100.0 * term.share)).collect::<Vec<_>>().join(", ")
}

fn session(folder: &Path) -> miette::Result<Answer> {
    let session = Session::open(folder)?;
    let rows: Vec<_> = session.states()?.into_par_iter().map(Row::read).collect::<Result<_, _>>()?;
    let recorded = recorded(folder, rows.iter().map(|row| &row.state));
    let recorded = recorded.as_deref();
    let complete = rows.iter().filter(|row| row.state.complete().is_some()).count();
    let mut link = LinkStats::default();
    let trials = count(rows.len(), "trial");
    let mut text = format!("{}: {complete} of {trials} complete\n", text::line(&session.plan().name));
    let mut trials = Vec::new();
    for row in &rows {
        let (state, attempt) = (&row.state, row.state.best());
        // The angles as judged now replace those of the log's summary, whose uncertainties may be too small.
        let mut summary = attempt.and_then(|attempt| attempt.summary.clone());
        match (&mut summary, &row.angles) {
            (Some(summary), Some(angles)) => angles.fill(summary),
            (Some(summary), None) => summary.yaw_uncertainty_deg = None,
            (None, _) => {}
        }
        link += row.link;
        let [w1_rpm, w2_rpm] = state.trial.speeds.map(|speed| speed.rpm());
        trials.push(json!({
            "name": state.trial.name,
            "w1_rpm": w1_rpm,
            "w2_rpm": w2_rpm,
            "log": attempt.map(|attempt| attempt.path.to_string_lossy()),
            "origin": row.origin.map(Origin::name),
            "attempts": state.attempts.len(),
            "complete": state.complete().is_some(),
            "losses": attempt.map(|attempt| &attempt.losses),
            "summary": summary,
            "angles": row.angles,
            "budget": budget_of(row.angles.as_ref()),
            "findings": row.findings,
            "not_judged": row.not_judged,
            "left_out": state.left_out,
        }));
        let _ = writeln!(text, "  {:<28} {}", state.trial.name, line(row, session.plan().hand_turn, recorded));
        let left_out = state.left_out.iter().map(|of_log| &of_log.finding);
        // A log that is being recorded has no end yet.
        let open = attempt.is_some_and(|attempt| recorded == Some(attempt.path.as_path()));
        let own = if open { &[][..] } else { &row.findings };
        let grave = own.iter().chain(left_out).filter(|finding| finding.grave);
        text.extend(grave.map(|finding| format!("    {}\n", finding_line(None, finding))));
    }
    let repeats = scatter_of_repeats(rows.iter().filter_map(|row| row.repeat.as_ref()));
    repeats.iter().for_each(|set| text += &scatter(set));
    let _ = writeln!(text, "{link}");
    let clean = complete == rows.len();
    let body = json!({
        "session": folder.to_string_lossy(),
        "samples": link.samples,
        "lost": link.lost,
        "clean": clean,
        "trials": trials,
        "repeats": repeats,
    });
    let is_sound = |row: &Row| row.state.left_out.is_empty() && !row.findings.iter().any(|finding| finding.grave);
    let is_sound = clean && rows.iter().all(is_sound);
    Answer::new(Outcome::of(is_sound), &body, text)
}

/// A trial of a session after reading its complete log.
struct Row {
    state: TrialState,
    origin: Option<Origin>,
    angles: Option<Angles>,
    findings: Vec<Finding>,
    not_judged: Vec<&'static str>,
    link: LinkStats,
    /// The trial as one of several at its speeds.
    repeat: Option<Repeat>,
}

impl Row {
    /// Reads the log of the last complete attempt, then of earlier ones until one is intact.
    fn read(mut state: TrialState) -> Result<Self, LogError> {
        while let Some(attempt) = state.complete().cloned() {
            let losses = match attempt.read(Want::default()) {
                Ok(trial) if trial.data.losses.is_empty() => {
                    let (angles, repeat) = (trial.steady_angles(), Repeat::new(&trial));
                    return Ok(Self { angles, repeat, ..Self::of(state, Some(trial)) });
                }
                Ok(trial) => trial.data.losses.iter().map(ToString::to_string).collect(),
                Err(error) if error.is_of_reading() => return Err(error),
                Err(error) => vec![error.to_string()],
            };
            state.damaged(&attempt.path, &losses);
        }
        // Other commands also take the last attempt of a trial that is not complete, with its findings.
        match state.attempts.last().map(|last| last.read(Want::default())) {
            Some(Err(error)) if error.is_of_reading() => Err(error),
            last => Ok(Self::of(state, last.and_then(Result::ok))),
        }
    }

    /// Returns a trial without its angles.
    fn of(state: TrialState, trial: Option<Judged>) -> Self {
        let origin = trial.as_ref().map(|trial| trial.data.origin());
        let of = |Judged { data, findings, not_judged, .. }| (findings, not_judged, data.link);
        let (findings, not_judged, link) = trial.map(of).unwrap_or_default();
        Self { state, origin, angles: None, findings, not_judged, link, repeat: None }
    }
}

/// Formats the scatter of repeats as a line, with a line for each angle whose budget does not explain it.
fn scatter(repeats: &Repeats) -> String {
    let angles = repeats
        .angles
        .iter()
        .map(|one| format!("{} {:.2}° (budget {:.2}°)", one.angle, one.scatter_deg, one.budget_deg));
    let angles = match angles.collect::<Vec<_>>() {
        known if known.is_empty() => "their uncertainty is unknown".to_owned(),
        known => format!("scatter of {}", known.join(", ")),
    };
    let remarks = repeats.angles.iter().filter_map(|one| Some(format!("    {}\n", one.remark()?)));
    let trials = count(repeats.trials.len(), "repeat");
    format!("  {trials} at {}: {angles}\n{}", repeats.speeds(), remarks.collect::<String>())
}

/// Formats the state of a trial of a session, one log of which may be `recorded` at present.
fn line(row: &Row, hand_turn: Option<HandTurn>, recorded: Option<&Path>) -> String {
    match row.state.best() {
        None => "not run yet".to_owned(),
        Some(Attempt { path, .. }) if recorded == Some(path) => "being recorded".to_owned(),
        Some(Attempt { losses, .. }) if !losses.is_empty() => {
            format!("damaged, --resume repeats the trial; lost: {}", losses.join("; "))
        }
        Some(attempt) => match &attempt.summary {
            None => "cut off".to_owned(),
            Some(summary) if summary.end == End::Complete => {
                let angles = row.angles.as_ref().map_or_else(String::new, |angles| match hand_turn {
                    Some(turn) => format!(", {}", turn.verdict(angles.turned_deg).0),
                    None => format!(", {angles}"),
                });
                format!("{}, {} lost{angles}", count(summary.link.samples as usize, "sample"), summary.link.lost)
            }
            Some(summary) => ending(summary),
        },
    }
}
