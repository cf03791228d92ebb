//! `biflag recover`: writes an intact log from one that is cut off or damaged, and rebuilds a session's manifest.

use super::answer::{Answer, Outcome, wrong_use};
use super::options::written_as;
use crate::session::{self, Rebuilt, SessionError};
use crate::text::count;
use biflag_log::{check, recover};
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use system::file::full_path;

/// Write an intact log from one that is cut off or damaged, or rebuild a session.toml that is lost or damaged.
///
/// The damaged log is not changed. If the log is intact, nothing is written unless -o names a file. The session.toml of a
/// folder is rebuilt from its logs, which hold the plan and the robot. Nothing is recovered while the session is recorded.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag recover glycerin/001_w1+50_w2+10.mcap\n  \
    biflag recover glycerin")]
pub struct Args {
    /// A log, or a session folder.
    #[arg(value_name = "LOG|SESSION")]
    path: PathBuf,
    /// The log to write, which must not exist yet [default: LOG with .recovered.mcap].
    #[arg(short, long = "out", alias = "output", value_parser = written_as(&["mcap"]))]
    output: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    match &args.output {
        None if args.path.is_dir() => session(&args.path),
        Some(_) if args.path.is_dir() => {
            let help = "name one of its logs, or leave out -o to rebuild its session.toml";
            Err(wrong_use(format!("{}: is a folder, not a log", args.path.display()), help))
        }
        _ => log(args),
    }
}

fn session(folder: &Path) -> miette::Result<Answer> {
    let Rebuilt { session, written, kept, logs, unreadable } = session::rebuild(folder)?;
    let body = json!({
        "session": folder.to_string_lossy(),
        "rebuilt": written,
        "kept": kept.as_ref().map(|kept| kept.to_string_lossy()),
        "trials": session.plan().trials.len(),
        "logs": logs,
        "unreadable": unreadable,
    });
    let manifest = folder.join(session::MANIFEST);
    let (trials, logs) = (count(session.plan().trials.len(), "trial"), count(logs, "log"));
    let mut text = match written {
        true => format!("{}: rebuilt, {trials}, from {logs}\n", manifest.display()),
        false => format!("{}: intact, nothing to rebuild; `biflag info` lists damaged logs\n", manifest.display()),
    };
    // Writing to a string cannot fail.
    if let Some(kept) = kept {
        let _ = writeln!(text, "  the damaged one is kept as {}", kept.display());
    }
    text.extend(unreadable.iter().map(|reason| format!("  not used: {reason}\n")));
    Answer::new(Outcome::of(unreadable.is_empty()), &body, text)
}

/// Returns the folder of a log. A link to a log is followed, because its target is what may be recorded.
fn folder_of(log: &Path) -> PathBuf {
    let target = full_path(log).unwrap_or_else(|_| log.to_owned());
    target.parent().unwrap_or(Path::new("")).to_owned()
}

fn log(args: &Args) -> miette::Result<Answer> {
    if args.output.is_none() && check(&args.path)?.is_empty() {
        let body = json!({ "log": args.path.to_string_lossy(), "recovered": null, "clean": true, "losses": [] });
        return Answer::new(Outcome::Done, &body, format!("{}: intact, nothing to recover", args.path.display()));
    }
    if session::is_in_use(&folder_of(&args.path)) {
        return Err(SessionError::BeingRecorded { path: args.path.clone() }.into());
    }
    let output = args.output.clone().unwrap_or_else(|| args.path.with_extension("recovered.mcap"));
    let recovery = recover(&args.path, &output)?;
    let clean = recovery.losses.is_empty();
    let losses: Vec<_> = recovery.losses.iter().map(ToString::to_string).collect();
    let body = json!({
        "log": args.path.to_string_lossy(),
        "recovered": output.to_string_lossy(),
        "clean": clean,
        "messages": recovery.messages,
        "losses": losses,
    });
    let mut text = format!("{}: {} messages\n", output.display(), recovery.messages);
    text.extend(losses.iter().map(|loss| format!("  lost: {loss}\n")));
    if recovery.strays > 0 {
        let _ = writeln!(text, "  lost: {} messages of unknown channels", recovery.strays);
    }
    Answer::new(Outcome::of(clean), &body, text)
}
