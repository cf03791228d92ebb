//! `biflag info`: what a log or a session holds.

use super::{Answer, Outcome};
use crate::log::{Condition, End, Summary};
use crate::overview::Overview;
use crate::session::{Attempt, Session, TrialState};
use crate::stats::LinkStats;
use serde_json::json;
use std::fmt::{Display, Write};
use std::path::{Path, PathBuf};

/// What a log, or a session's folder, holds.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag info glycerin/001_w1+50_w2+10.mcap\n\
    Exit code 3: a log is cut off or damaged, or a session has trials that are not complete.")]
pub struct Args {
    /// A log, or a session's folder.
    path: PathBuf,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    if args.path.is_dir() { session(&args.path) } else { log(&args.path) }
}

fn log(path: &Path) -> miette::Result<Answer> {
    let overview = Overview::read(path)?;
    let clean = overview.condition == Condition::Clean;
    let body = json!({
        "channels": overview.channels,
        "duration_s": overview.duration_s,
        "samples": overview.link.samples,
        "lost": overview.link.lost,
        "clean": clean,
        "crc_errors": overview.link.crc_errors,
        "resyncs": overview.link.resyncs,
        "retries": overview.link.retries,
        "losses": overview.losses.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "origin": overview.identity.as_ref().map(|identity| identity.origin),
        "created": overview.identity.as_ref().map(|identity| &identity.created),
        "trial": overview.trial,
        "end": overview.summary.as_ref().map(|summary| summary.end),
        "angles": overview.angles,
        "model": overview.model,
        "steady": overview.steady,
    });
    Answer::new(if clean { Outcome::Done } else { Outcome::WithLoss }, &body, describe(path, &overview))
}

/// Lines of a name and what it stands for; lines that stand for nothing are left out.
#[derive(Default)]
struct Lines(String);

impl Lines {
    fn add(&mut self, name: &str, value: impl Display) {
        let value = value.to_string();
        if !value.is_empty() {
            // Writing to a string cannot fail.
            let _ = writeln!(self.0, "{name:<12} {value}");
        }
    }
}

fn describe(path: &Path, overview: &Overview) -> String {
    let mut lines = Lines::default();
    lines.add("log", path.display());
    if let Some(identity) = &overview.identity {
        lines.add("created", &identity.created);
        let program = format!("biflag {} ({})", identity.host_version, identity.host_git_hash);
        lines.add("by", format!("{program}, protocol {}, {}", identity.protocol, word(&identity.origin)));
    }
    if let Some(plan) = &overview.plan {
        lines.add("session", format!("{}, {} trials", plan.name, plan.trials));
        lines.add("operator", &plan.operator);
        lines.add("note", &plan.note);
    }
    if let Some(t) = &overview.trial {
        let speeds = format!("{} and {} rpm", t.w1_rpm, t.w2_rpm);
        lines.add("trial", format!("{}, {speeds}, repeat {}, attempt {}", t.name, t.repeat, t.attempt));
        let (calibrate, preroll, run, decay) = (t.calibrate_s, t.preroll_s, t.run_s, t.decay_s);
        lines.add("phases", format!("calibrate {calibrate} s, preroll {preroll} s, run {run} s, decay {decay} s"));
    }
    if let Some(model) = &overview.model {
        let shapes = if model.shapes { ", with shapes" } else { "" };
        lines.add("model", format!("closure {}, {} samples a second{shapes}", word(&model.closure), model.rate_hz));
    } else if let Some(board) = &overview.board {
        let (id, imu) = (board.board_id, board.imu_id);
        let firmware = format!("firmware {} ({})", board.firmware, board.firmware_git_hash);
        lines.add("board", format!("{id}, {firmware}, IMU {imu:#04x}, start {}", board.boot_count));
    }
    if let Some(clock) = &overview.clock {
        // The emulated board may run several times as fast as real time.
        let rate = match clock.drift_ppm {
            drift if drift.abs() < 1e4 => format!("{drift:.1} ppm"),
            drift => format!("{:.2} times real time", 1.0 + drift * 1e-6),
        };
        lines.add("clock", format!("{rate}, residual {:.0} µs, {} pings", clock.residual_us, clock.pings));
    }
    lines.add("duration", format!("{:.3} s", overview.duration_s));
    lines.add("link", overview.link);
    if let Some(steady) = &overview.steady {
        let settled = if steady.settled { format!("after {:.0} s", steady.settle_s) } else { "no".to_owned() };
        lines.add("settled", settled);
        lines.add("flagella", format!("{}, {:.2} mm apart at least", word(&steady.bundling), steady.min_gap_m * 1e3));
    }
    if let Some(angles) = &overview.angles {
        lines.add("steady", steady(Some(angles.yaw_deg), angles.yaw_uncertainty_deg, Some(angles.pitch_deg)));
        let [x, y, z] = angles.turned_deg;
        lines.add("turned", format!("{x:.1}, {y:.1}, {z:.1} deg about x, y, z"));
    }
    let counts: Vec<_> = overview.channels.iter().map(|(topic, count)| format!("{topic} {count}")).collect();
    lines.add("channels", counts.join(", "));
    lines.add("ended", overview.summary.as_ref().map_or_else(|| "without a summary".to_owned(), ending));
    if let Some(recovery) = &overview.recovery {
        lines.add("recovered", format!("from {}; lost: {}", recovery.source, recovery.lost));
    }
    lines.add(
        "condition",
        match overview.condition {
            Condition::Clean => "clean",
            Condition::CutOff => "cut off; `biflag recover` makes a clean log of it",
            Condition::Damaged => "damaged; `biflag recover` makes a clean log of what reads",
        },
    );
    for loss in &overview.losses {
        lines.add("  lost", loss);
    }
    lines.0
}

fn ending(summary: &Summary) -> String {
    let reason = if summary.reason.is_empty() { String::new() } else { format!(": {}", summary.reason) };
    word(&summary.end) + &reason
}

/// The name of a value in JSON, in words.
fn word(value: &impl serde::Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|name| Some(name.as_str()?.replace('_', " "))).unwrap_or_default()
}

/// Steady angles in a line.
fn steady(yaw: Option<f64>, uncertainty: Option<f64>, pitch: Option<f64>) -> String {
    let (Some(yaw), Some(pitch)) = (yaw, pitch) else { return String::new() };
    let uncertainty = uncertainty.map_or_else(|| "unknown".to_owned(), |deg| format!("±{deg:.2}"));
    format!("yaw {yaw:.2} deg ({uncertainty}, 95 %), pitch {pitch:.2} deg")
}

fn session(folder: &Path) -> miette::Result<Answer> {
    let session = Session::open(folder)?;
    let states = session.checked_states()?;
    let complete = states.iter().filter(|state| state.complete().is_some()).count();
    let mut link = LinkStats::default();
    let mut text = format!("{}: {complete} of {} trials complete\n", session.plan().name, states.len());
    let mut trials = Vec::new();
    for state in &states {
        let attempt = state.complete().or(state.attempts.last());
        let summary = attempt.and_then(|attempt| attempt.summary.as_ref());
        link += summary.map(|summary| summary.link).unwrap_or_default();
        let [w1_rpm, w2_rpm] = state.trial.speeds.map(|speed| speed.rpm());
        trials.push(json!({
            "name": state.trial.name,
            "w1_rpm": w1_rpm,
            "w2_rpm": w2_rpm,
            "log": attempt.map(|attempt| &attempt.path),
            "attempts": state.attempts.len(),
            "complete": state.complete().is_some(),
            "losses": attempt.map(|attempt| &attempt.losses),
            "summary": summary,
        }));
        let _ = writeln!(text, "  {:<28} {}", state.trial.name, line(state));
    }
    let _ = writeln!(text, "{link}");
    let clean = complete == states.len();
    let body = json!({
        "session": folder,
        "samples": link.samples,
        "lost": link.lost,
        "clean": clean,
        "trials": trials,
    });
    Answer::new(if clean { Outcome::Done } else { Outcome::WithLoss }, &body, text)
}

/// How far a trial of a session is.
fn line(state: &TrialState) -> String {
    match state.complete().or(state.attempts.last()) {
        None => "not yet".to_owned(),
        Some(Attempt { losses, .. }) if !losses.is_empty() => {
            format!("damaged, --resume repeats the trial; lost: {}", losses.join("; "))
        }
        Some(attempt) => match &attempt.summary {
            None => "cut off".to_owned(),
            Some(summary) if summary.end == End::Complete => {
                let angles = steady(summary.yaw_deg, summary.yaw_uncertainty_deg, summary.pitch_deg);
                format!("{} samples, {} lost{}{angles}", summary.link.samples, summary.link.lost, comma(&angles))
            }
            Some(summary) => ending(summary),
        },
    }
}

fn comma(text: &str) -> &'static str {
    if text.is_empty() { "" } else { ", " }
}
