//! `biflag export`: a log in another format.

use super::{Answer, Outcome};
use crate::export::{Format, export};
use crate::log::Condition;
use serde_json::json;
use std::path::PathBuf;

/// Write a log's telemetry in another format.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag export glycerin/001_w1+50_w2+10.mcap --format csv\n\
    Exit code 3: the log is cut off or damaged; what reads of it is exported.")]
pub struct Args {
    /// The log.
    log: PathBuf,
    /// The format.
    #[arg(short, long, value_enum, default_value = "csv")]
    format: Format,
    /// The file to write [default: LOG with the format's ending].
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Replace the file if it exists.
    #[arg(long)]
    force: bool,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let output = args.output.clone().unwrap_or_else(|| args.log.with_extension(args.format.extension()));
    let exported = export(&args.log, &output, args.format, args.force)?;
    let clean = exported.condition == Condition::Clean;
    let body = json!({
        "log": args.log,
        "format": args.format.extension(),
        "output": output,
        "rows": exported.rows,
        "clean": clean,
    });
    let note = if clean { "" } else { "; the log is cut off or damaged, and this is what reads of it" };
    let text = format!("{}: {} rows{note}", output.display(), exported.rows);
    Answer::new(if clean { Outcome::Done } else { Outcome::WithLoss }, &body, text)
}
