//! `biflag figure`: writes figures for a paper.

use super::options::pair;
use super::{Answer, Outcome};
use crate::figure::{self, COLUMN_MM};
use clap::Subcommand;
use serde_json::json;
use std::path::PathBuf;

/// Write a figure for a paper as SVG, PDF or PNG: a trial, its forces, a map, or predictions against measurements.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag figure trial glycerin/001_w1+50_w2+10.mcap --against glycerin-replay/001_w1+50_w2+10.mcap -o trial.pdf\n  \
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
        /// The log.
        #[arg(value_name = "LOG")]
        log: PathBuf,
        /// A log of the same trial, usually its replay in the model.
        #[arg(long, value_name = "LOG")]
        against: Option<PathBuf>,
        /// The time range to show, in seconds from the start of the run; by default the whole trial.
        #[arg(long, value_name = "FROM,TO", value_parser = span, allow_hyphen_values = true)]
        time: Option<[f64; 2]>,
        #[command(flatten)]
        paper: Paper,
    },
    /// Draw the forces of both flagella on the base over a trial of the model.
    Forces {
        /// The log.
        #[arg(value_name = "LOG")]
        log: PathBuf,
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
        #[command(flatten)]
        paper: Paper,
    },
}

/// The paper that a figure is for.
#[derive(clap::Args, Debug)]
struct Paper {
    /// The file to write; its extension selects the format: .svg, .pdf or .png.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Printed width.
    #[arg(long, value_name = "MM", default_value_t = COLUMN_MM, value_parser = width)]
    width_mm: f64,
}

fn span(text: &str) -> Result<[f64; 2], String> {
    let form = "give two times in seconds, the earlier one first, such as 50,56";
    let one = |text: &str| text.parse::<f64>().ok().filter(|time| time.is_finite()).ok_or_else(|| form.to_owned());
    pair(text, form, one).and_then(|[from, to]| if from < to { Ok([from, to]) } else { Err(form.to_owned()) })
}

fn width(text: &str) -> Result<f64, String> {
    let width: f64 = text.parse().map_err(|_| "give millimetres as a number, such as 88".to_owned())?;
    if (60.0..=400.0).contains(&width) { Ok(width) } else { Err("must be between 60 and 400 mm".to_owned()) }
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let paper = match &args.subject {
        Subject::Trial { log, against, time, paper } => {
            figure::trial(log, against.as_deref(), *time, paper.width_mm, &paper.output)?;
            paper
        }
        Subject::Forces { log, time, paper } => {
            figure::forces(log, *time, paper.width_mm, &paper.output)?;
            paper
        }
        Subject::Map { session, against, paper } => {
            figure::map(session, against.as_deref(), paper.width_mm, &paper.output)?;
            paper
        }
        Subject::Scatter { session, against, paper } => {
            figure::scatter(session, against, paper.width_mm, &paper.output)?;
            paper
        }
    };
    let file = paper.output.to_string_lossy();
    Answer::new(Outcome::Done, &json!({ "files": [file] }), file.to_string())
}
