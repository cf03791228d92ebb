//! `biflag recover`: a clean log of one that was cut off or damaged.

use super::{Answer, Outcome};
use crate::log::{Condition, check, recover};
use serde_json::json;
use std::fmt::Write;
use std::path::PathBuf;

/// Make a clean log of one that was cut off or damaged.
///
/// The log itself is left as it is. A clean log needs no recovery: then nothing is written, unless -o names a file.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag recover glycerin/001_w1+50_w2+10.mcap\n\
    Exit codes: 0 the log is clean, 3 recovered with loss, 1 nothing could be recovered.")]
pub struct Args {
    /// The log.
    log: PathBuf,
    /// The clean log, which must not exist [default: LOG with .recovered.mcap].
    #[arg(short, long)]
    output: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    if args.output.is_none() && check(&args.log)?.is_empty() {
        let body = json!({ "log": args.log, "recovered": null, "clean": true, "losses": [] });
        return Answer::new(Outcome::Done, &body, format!("{}: clean, nothing to recover", args.log.display()));
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
        let _ = writeln!(text, "  lost: {} messages whose channel is not known any more", recovery.strays);
    }
    Answer::new(if clean { Outcome::Done } else { Outcome::WithLoss }, &body, text)
}
