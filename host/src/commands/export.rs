//! `biflag export`: exports trials to other formats.

use super::answer::{Answer, Outcome, are_slight, lines_of_logs, wrong_use};
use crate::export::{Format, export_log, export_session};
use crate::output::{ending, has_ending};
use crate::text::count;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use serde_json::json;
use std::path::PathBuf;
use system::file::full_path;

/// Export a trial, or all trials of a session, as a table or a trajectory.
///
/// A table has one row per frame, with the same angles as in the other commands: relative to the zero before the run,
/// with the drift of the gyroscope removed. Its header has the budget of the steady angles. A session becomes a folder
/// with one file per trial, a table of the trials, and a table of their budgets.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag export glycerin/001_w1+50_w2+10.mcap\n  \
    biflag export glycerin --format parquet -o tables\n\
    In Python: pandas.read_csv(\"glycerin/001_w1+50_w2+10.csv\", comment=\"#\")")]
pub struct Args {
    /// A log, or a session folder.
    #[arg(value_name = "LOG|SESSION")]
    path: PathBuf,
    /// The format [default: by the output's name, or csv].
    #[arg(short, long, value_parser = formats())]
    format: Option<Format>,
    /// The file to write, or for a session the folder [default: LOG with the format's extension, or SESSION-export].
    #[arg(short, long = "out", alias = "output")]
    output: Option<PathBuf>,
    /// Replace existing files.
    #[arg(long)]
    force: bool,
}

fn formats() -> impl TypedValueParser<Value = Format> {
    let values = Format::ALL.map(|format| PossibleValue::new(format.extension()).help(format.about()));
    PossibleValuesParser::new(values)
        .try_map(|name| Format::ALL.into_iter().find(|format| format.extension() == name).ok_or("no such format"))
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let is_session = args.path.is_dir();
    let formats = args.format.map_or(Format::ALL.to_vec(), |format| vec![format]);
    let endings: Vec<_> = formats.iter().map(|format| format.extension()).collect();
    let named = args.output.as_deref().filter(|output| !is_session && has_ending(output));
    if let Some(file) = args.output.as_deref().filter(|output| is_session && ending(output, &endings).is_ok()) {
        let what = format!("{}: a session is exported into a folder, with a file for each trial", file.display());
        return Err(wrong_use(what, "name a folder, and choose the files' format with -f"));
    }
    let format = formats[named.map_or(Ok(0), |output| ending(output, &endings))?];
    let output = args.output.clone().unwrap_or_else(|| {
        if is_session {
            let folder = full_path(&args.path).unwrap_or_else(|_| args.path.clone());
            let mut name = folder.file_name().unwrap_or_default().to_owned();
            name.push("-export");
            folder.with_file_name(name)
        } else {
            args.path.with_extension(format.extension())
        }
    });
    let export = if is_session { export_session } else { export_log };
    let exported = export(&args.path, &output, format, args.force)?;
    let clean = exported.damaged.is_empty();
    let is_sound = clean && are_slight(&exported.findings);
    let body = json!({
        "log": args.path.to_string_lossy(),
        "format": format.extension(),
        "output": output.to_string_lossy(),
        "files": exported.files.iter().map(|file| file.to_string_lossy()).collect::<Vec<_>>(),
        "trials": exported.trials.iter().map(|(name, origin)| json!({ "name": name, "origin": origin })).collect::<Vec<_>>(),
        "rows": exported.rows,
        "clean": clean,
        "findings": exported.findings,
    });
    let files = if is_session { format!("{}, ", count(exported.files.len(), "file")) } else { String::new() };
    let mut text = format!("{}: {files}{}\n", output.display(), count(exported.rows, "row"));
    let damaged = |log| format!("warning: {log}: cut off or damaged; only what can be read was exported\n");
    text.extend(exported.damaged.iter().map(damaged));
    text += lines_of_logs(&exported.findings).trim_start();
    Answer::new(Outcome::of(is_sound), &body, text)
}
