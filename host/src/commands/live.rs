//! `biflag live`: serves a log or the stream of a board to Foxglove.

use super::answer::{Answer, Outcome};
use super::options::within;
use crate::link::{Link, LinkError};
use crate::live::{self, Live};
use crate::progress::Progress;
use crate::signals::interruption;
use crate::trial::{Judged, Want};
use serde_json::json;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Serve a log, or the stream of a board without recording it, to Foxglove.
#[derive(clap::Args, Debug)]
#[command(
    override_usage = "biflag live [OPTIONS] <LOG>\n       biflag live [OPTIONS] --port <PORT>",
    after_help = "Examples:\n  \
    biflag live glycerin/001_w1+50_w2+10.mcap --speed 2\n  \
    biflag live --port /dev/ttyUSB0\n\
    In Foxglove: Open connection, Foxglove WebSocket, ws://127.0.0.1:8765. A log starts to play when a viewer connects.\n\
    With a board, nothing is recorded, no speeds are sent, and no fault is cleared. To watch a trial while it is recorded, use \
    `biflag record PLAN --live`."
)]
pub struct Args {
    /// The log to play.
    #[arg(required_unless_present = "port", conflicts_with = "port")]
    log: Option<PathBuf>,
    /// The serial port of the board to watch.
    #[arg(long)]
    port: Option<String>,
    /// Playback speed relative to real time.
    #[arg(long, value_name = "F", default_value = "1", value_parser = within("a factor", 0.01..=1000.0), requires = "log")]
    speed: f64,
    /// The address that viewers connect to. Anyone who can reach it can watch.
    #[arg(long, value_name = "ADDR:PORT", default_value = live::ADDRESS)]
    listen: SocketAddr,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let interrupted = interruption()?;
    match (&args.log, &args.port) {
        (Some(log), _) => play(log, args, &interrupted),
        (None, Some(port)) => watch(port, args, &interrupted),
        (None, None) => unreachable!("clap requires one of them"),
    }
}

fn play(log: &Path, args: &Args, interrupted: &AtomicBool) -> miette::Result<Answer> {
    let data = Judged::read(log, Want::default())?.data;
    let live = Live::listen(args.listen)?;
    let progress = Progress::new(data.duration_s);
    progress.line(&live.invitation());
    progress.phase(&log.display().to_string(), "waiting for a viewer");
    let played = match live::wait_for_viewer(&live, interrupted) {
        true => live::play(log, args.speed, &live, &progress, interrupted)?,
        false => live::Played::default(),
    };
    progress.finish();
    let is_whole = data.condition.is_whole();
    let outcome = if played.complete { Outcome::of(is_whole) } else { Outcome::Interrupted };
    let text = format!("{:.1} s of {} played, {} messages", played.played_s, log.display(), played.messages);
    Answer::new(outcome, &json!({ "url": live.url(), "log": log.to_string_lossy(), "played": played }), text)
}

fn watch(port: &str, args: &Args, interrupted: &AtomicBool) -> miette::Result<Answer> {
    let live = Live::listen(args.listen)?;
    let link = match Link::open_unless(port, interrupted) {
        Err(LinkError::Interrupted) => return Answer::new(Outcome::Interrupted, &json!({}), "interrupted"),
        link => link?,
    };
    let settings = super::settings::read(&link)?;
    let progress = Progress::new(0.0);
    progress.line(&format!("listening to the board on {port}: nothing is recorded, and no speeds are sent"));
    progress.line(&live.invitation());
    let stats = live::watch(&link, settings, &live, interrupted)?;
    progress.finish();
    Answer::new(Outcome::Interrupted, &json!({ "url": live.url(), "link": stats }), stats.to_string())
}
