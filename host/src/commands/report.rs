//! `biflag report`: writes an HTML page about a trial or a session.

use super::answer::{Answer, Outcome, are_slight, lines_of_logs};
use super::options::{cores, written_as};
use crate::report::{self, Kind, View};
use crate::text;
use crate::twin::{self, OnMismatch, Pairs};
use std::path::PathBuf;

/// Write an HTML page about a log, a session or a sweep's table: charts, a 3-D view of the robot, results, maps.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag report glycerin/001_w1+50_w2+10.mcap\n  \
    biflag report glycerin --against glycerin-model --out glycerin.html\n\
    The page is a single self-contained file. An existing page is replaced, any other file is not.\n\
    `biflag compare` writes a page that compares a trial with its replay in the model.")]
pub struct Args {
    /// A log, a session folder, the folder of a sweep, or its table (.parquet, .csv).
    #[arg(value_name = "LOG|SESSION|SWEEP")]
    path: PathBuf,
    /// A log or session to show for comparison: a model, or other trials at the same speeds.
    #[arg(long, value_name = "LOG|SESSION")]
    against: Option<PathBuf>,
    /// The page to write; by default LOG.html or SESSION/report.html, with --against LOG.compare.html or
    /// SESSION/compare.html.
    #[arg(short, long, value_name = "FILE", value_parser = written_as(&["html"]))]
    out: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let written = match &args.against {
        None => report::write(&args.path, Kind::Report, None, Vec::new(), args.out.as_deref())?,
        Some(other) => {
            let budget = report::budget(&args.path)?;
            let pairs = Pairs::of(&args.path, other)?;
            let (comparison, views) = twin::compare_pairs(
                &pairs,
                report::want(budget),
                OnMismatch::default(),
                cores(),
                &|a, b, compared| View::new(a, Some((compared, b)), budget),
            )?;
            report::write(&args.path, Kind::Comparison, Some(&comparison), views, args.out.as_deref())?
        }
    };
    let is_sound = written.warnings == 0 && are_slight(&written.findings);
    let notes = written.findings.iter().filter(|of_log| !of_log.finding.grave).count();
    let counts = [(written.warnings, "warning"), (notes, "note")].into_iter().filter(|(number, _)| *number > 0);
    let with: String = counts.map(|(number, what)| format!(", {}", text::count(number, what))).collect();
    let text = format!("{}: {:.1} MB{with}", written.html.display(), written.bytes as f64 * 1e-6)
        + &lines_of_logs(&written.findings);
    Ok(Answer::new(Outcome::of(is_sound), &written, text)?.with("notes", notes))
}
