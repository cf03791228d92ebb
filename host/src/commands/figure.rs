//! `biflag figure`: writes figures for a paper.

use super::findings::{are_slight, lines_of_logs};
use super::options::span;
use super::{Answer, Outcome};
use crate::colour;
use crate::figure::{self, COLUMN_MM};
use crate::text::printable;
use clap::Subcommand;
use serde_json::json;
use std::path::PathBuf;

/// Write a figure for a paper as SVG, PDF or PNG: a trial, its forces, a map, or predictions against measurements.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag figure trial glycerin/001_w1+50_w2+10.mcap --against glycerin-replay/001_w1+50_w2+10.mcap -o trial.pdf\n  \
    biflag figure trial glycerin 1 --against glycerin-replay -o trial.pdf\n  \
    biflag figure forces glycerin-replay/001_w1+50_w2+10.mcap --time 50,56 -o forces.pdf\n  \
    biflag figure map glycerin --against map -o map.pdf\n  \
    biflag figure scatter glycerin --against glycerin-replay -o scatter.svg\n\
    Text is 7 pt at the printed width. A PNG has 600 pixels per inch.")]
pub struct Args {
    #[command(subcommand)]
    subject: Subject,
}

#[derive(Subcommand, Debug)]
enum Subject {
    /// Draw yaw, pitch and roll over a trial, with the 95 % band and the residuals of a model.
    Trial {
        /// The log, or a session folder with the number of the trial.
        #[arg(value_name = "LOG|SESSION")]
        log: PathBuf,
        /// The number of the trial in the session, from 1.
        #[arg(value_name = "N")]
        number: Option<usize>,
        /// A log of the same trial, usually its replay in the model.
        #[arg(long, value_name = "LOG|SESSION")]
        against: Option<PathBuf>,
        /// Draw trials of different robots, closures or speeds together.
        #[arg(long)]
        anyway: bool,
        /// The time range to show, in seconds from the start of the run; by default the whole trial.
        #[arg(long, value_name = "FROM,TO", value_parser = span, allow_hyphen_values = true)]
        time: Option<[f64; 2]>,
        #[command(flatten)]
        paper: Paper,
    },
    /// Draw the forces of both flagella on the base over a trial of the model.
    Forces {
        /// The log, or a session folder with the number of the trial.
        #[arg(value_name = "LOG|SESSION")]
        log: PathBuf,
        /// The number of the trial in the session, from 1.
        #[arg(value_name = "N")]
        number: Option<usize>,
        /// The time range to show, in seconds from the start of the run; by default the whole trial.
        #[arg(long, value_name = "FROM,TO", value_parser = span, allow_hyphen_values = true)]
        time: Option<[f64; 2]>,
        #[command(flatten)]
        paper: Paper,
    },
    /// Draw maps of |yaw|, |pitch|, |roll| and tilt over both speeds.
    Map {
        /// The session.
        #[arg(value_name = "SESSION")]
        session: PathBuf,
        /// A session whose map is drawn behind the points of the first.
        #[arg(long, value_name = "SESSION")]
        against: Option<PathBuf>,
        #[command(flatten)]
        paper: Paper,
    },
    /// Draw predicted against measured steady angles, with error bars.
    Scatter {
        /// The measured session.
        #[arg(value_name = "SESSION")]
        session: PathBuf,
        /// The session of the model.
        #[arg(long, value_name = "SESSION")]
        against: PathBuf,
        /// Draw trials of different robots or closures together.
        #[arg(long)]
        anyway: bool,
        #[command(flatten)]
        paper: Paper,
    },
}

/// The paper that a figure is for.
#[derive(clap::Args, Debug)]
struct Paper {
    /// The file to write; its extension selects the format: .svg, .pdf or .png.
    #[arg(short, long = "out", alias = "output", value_name = "FILE")]
    output: PathBuf,
    /// Printed width.
    #[arg(long, value_name = "MM", default_value_t = COLUMN_MM, value_parser = width)]
    width_mm: f64,
}

fn width(text: &str) -> Result<f64, String> {
    let width: f64 = text.parse().map_err(|_| "give millimetres as a number, such as 88".to_owned())?;
    if (60.0..=400.0).contains(&width) { Ok(width) } else { Err("must be between 60 and 400 mm".to_owned()) }
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let subject = |path, number: &Option<usize>| figure::Subject { path, number: *number };
    let (paper, remarks) = match &args.subject {
        Subject::Trial { log, number, against, anyway, time, paper } => {
            let (subject, against) = (subject(log, number), against.as_deref());
            (paper, figure::trial(subject, against, *anyway, *time, paper.width_mm, &paper.output)?)
        }
        Subject::Forces { log, number, time, paper } => {
            (paper, figure::forces(subject(log, number), *time, paper.width_mm, &paper.output)?)
        }
        Subject::Map { session, against, paper } => {
            (paper, figure::map(session, against.as_deref(), paper.width_mm, &paper.output)?)
        }
        Subject::Scatter { session, against, anyway, paper } => {
            (paper, figure::scatter(session, against, *anyway, paper.width_mm, &paper.output)?)
        }
    };
    let file = paper.output.to_string_lossy();
    let is_sound = are_slight(&remarks.findings) && remarks.warnings.is_empty();
    let mut said = lines_of_logs(&remarks.findings);
    remarks.warnings.iter().for_each(|warning| said += &format!("\nwarning: {warning}"));
    // A script takes the name of the file from stdout.
    if !said.is_empty() {
        colour::eprint(&printable(&format!("{}\n", said.trim_start())));
    }
    let body = json!({ "files": [file], "findings": remarks.findings, "warnings": remarks.warnings });
    Answer::new(if is_sound { Outcome::Done } else { Outcome::WithLoss }, &body, file.to_string())
}
