//! `biflag report`: a trial or a session as one page of HTML.

use super::{Answer, Outcome};
use crate::report;
use crate::session::Session;
use serde_json::json;
use std::path::PathBuf;

/// Write one page of HTML about a log or a session: charts, the robot in space, figures, parameters.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag report glycerin/001_w1+50_w2+10.mcap\n  \
    biflag report glycerin --out glycerin.html\n\
    The page is whole in one file and needs no network. A page that is there already is replaced; another file is not.\n\
    Exit code 3: the page bears warnings.")]
pub struct Args {
    /// A log, or a session's folder.
    #[arg(value_name = "LOG|SESSION")]
    path: PathBuf,
    /// The page; by default beside the log, or report.html in the session's folder.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let out = args.out.as_deref();
    let written = if args.path.is_dir() {
        report::of_session(&Session::open(&args.path)?, None, out)?
    } else {
        report::of_log(&args.path, None, out)?
    };
    let outcome = if written.warnings > 0 { Outcome::WithLoss } else { Outcome::Done };
    let warnings = match written.warnings {
        0 => String::new(),
        1 => ", with a warning".to_owned(),
        count => format!(", with {count} warnings"),
    };
    let text = format!("{}: {:.1} MB{warnings}", written.html.display(), written.bytes as f64 * 1e-6);
    let body = json!({ "html": written.html, "bytes": written.bytes, "trials": written.trials, "warnings": written.warnings });
    Answer::new(outcome, &body, text)
}
