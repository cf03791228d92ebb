//! `biflag report`: a trial or a session as one page of HTML.

use super::simulate::cores;
use super::{Answer, Outcome};
use crate::report;
use crate::twin::{self, Allow};
use serde_json::json;
use std::path::PathBuf;

/// Write one page of HTML about a log or a session: charts, the robot in space, figures, parameters.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag report glycerin/001_w1+50_w2+10.mcap\n  \
    biflag report glycerin --against glycerin-model --out glycerin.html\n\
    `biflag compare` writes the same page of a trial beside its replay in the model.\n\
    The page is whole in one file and needs no network. A page that is there already is replaced; another file is not.\n\
    Exit code 3: the page bears warnings.")]
pub struct Args {
    /// A log, or a session's folder.
    #[arg(value_name = "LOG|SESSION")]
    path: PathBuf,
    /// What to show beside it: the log or session of a model, or of other trials at the same speeds.
    #[arg(long, value_name = "LOG|SESSION")]
    against: Option<PathBuf>,
    /// The page; by default beside the log, or report.html in the session's folder.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let against = |other: &PathBuf| twin::compare_sessions(&args.path, other, Allow::default(), cores());
    let comparison = args.against.as_ref().map(against).transpose()?;
    let written = report::write(&args.path, comparison.as_ref(), args.out.as_deref())?;
    let outcome = if written.warnings > 0 { Outcome::WithLoss } else { Outcome::Done };
    let warnings = match written.warnings {
        0 => String::new(),
        1 => ", with a warning".to_owned(),
        count => format!(", with {count} warnings"),
    };
    let text = format!("{}: {:.1} MB{warnings}", written.html.display(), written.bytes as f64 * 1e-6);
    let body =
        json!({ "html": written.html, "bytes": written.bytes, "trials": written.trials, "warnings": written.warnings });
    Answer::new(outcome, &body, text)
}
