//! `biflag recover`: writes an intact log from one that is cut off or damaged.

use super::{Answer, Outcome};
use biflag_log::{Condition, check, recover};
use serde_json::json;
use std::fmt::Write;
use std::path::PathBuf;

/// Write an intact log from one that is cut off or damaged.
///
/// The damaged log is not changed. If the log is intact, nothing is written unless -o names a file.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag recover glycerin/001_w1+50_w2+10.mcap")]
pub struct Args {
    /// The log.
    log: PathBuf,
    /// The log to write, which must not exist [default: LOG with .recovered.mcap].
    #[arg(short, long)]
    output: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    if args.output.is_none() && check(&args.log)?.is_empty() {
        let body = json!({ "log": args.log, "recovered": null, "clean": true, "losses": [] });
        return Answer::new(Outcome::Done, &body, format!("{}: intact, nothing to recover", args.log.display()));
    }
    let output = args.output.clone().unwrap_or_else(|| args.log.with_extension("recovered.mcap"));
    let recovery = recover(&args.log, &output)?;
    let clean = recovery.condition == Condition::Clean;
    let losses: Vec<_> = recovery.losses.iter().map(ToString::to_string).collect();
    let body = json!({
        "log": args.log,
        "recovered": output,
        "clean": clean,
        "messages": recovery.messages,
        "losses": losses,
    });
    let mut text = format!("{}: {} messages\n", output.display(), recovery.messages);
    for loss in &losses {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  lost: {loss}");
    }
    if recovery.strays > 0 {
        let _ = writeln!(text, "  lost: {} messages of unknown channels", recovery.strays);
    }
    Answer::new(if clean { Outcome::Done } else { Outcome::WithLoss }, &body, text)
}
