//! `biflag figure`: writes figures for a paper.

use super::answer::{Answer, Outcome, are_slight, lines_of_logs};
use super::options::{named, span, within};
use crate::colour;
use crate::figure::{self, COLUMN_MM, Format, MOMENTS, WIDTHS_MM};
use crate::text::printable;
use clap::Subcommand;
use clap::builder::{PathBufValueParser, TypedValueParser};
use serde_json::json;
use std::path::PathBuf;

/// Write a figure for a paper as SVG, PDF or PNG: a trial, its forces, a film strip, a map, a sweep, a
/// fit, or predictions against measurements.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag figure trial glycerin/001_w1+50_w2+10.mcap --against glycerin-replay/001_w1+50_w2+10.mcap -o trial.pdf\n  \
    biflag figure trial glycerin 1 --against glycerin-replay -o trial.pdf\n  \
    biflag figure forces glycerin-replay/001_w1+50_w2+10.mcap --time 50,56 -o forces.pdf\n  \
    biflag figure contact bundling 1 -o bundling.pdf\n  \
    biflag figure strip bundling 1 --moments 8 --width-mm 180 -o strip.pdf\n  \
    biflag figure map glycerin --against map -o map.pdf\n  \
    biflag figure lines softer --value tilt_deg --over group_stiffness_relative --by w2_rpm -o softer.pdf\n  \
    biflag figure fit fitted.toml -o fit.pdf\n  \
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
        #[command(flatten)]
        trial: OneTrial,
        /// A log of the same trial, usually its replay in the model.
        #[arg(long, value_name = "LOG|SESSION")]
        against: Option<PathBuf>,
        /// Draw trials of different robots, closures or speeds together.
        #[arg(long)]
        anyway: bool,
        #[command(flatten)]
        paper: Paper,
    },
    /// Draw the forces of both flagella on the base over a trial of the model.
    Forces(Panels),
    /// Draw gap and winding of the flagella over a trial of the model, and when they touch.
    Contact(Panels),
    /// Draw the robot at some moments of a trial, side by side.
    Strip {
        #[command(flatten)]
        trial: OneTrial,
        /// Number of moments, evenly spaced over the time range.
        #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u16).range(MOMENTS))]
        moments: u16,
        #[command(flatten)]
        paper: Paper,
    },
    /// Draw a result of a sweep over an input, a curve for each value of another.
    Lines {
        /// The folder of the sweep, or its table.
        #[arg(value_name = "SWEEP")]
        sweep: PathBuf,
        /// The result, such as yaw_deg, tilt_deg or force1_z_n.
        #[arg(long, value_name = "COLUMN", default_value = "yaw_deg")]
        value: String,
        /// The input along the axis.
        #[arg(long, value_name = "COLUMN", default_value = "w1_rpm")]
        over: String,
        /// The input that distinguishes the curves.
        #[arg(long, value_name = "COLUMN")]
        by: Option<String>,
        /// The value of another input, such as w2_rpm=10; may be repeated. By default the one that most points have.
        #[arg(long, value_name = "COLUMN=VALUE", value_parser = fixed)]
        at: Vec<(String, f64)>,
        #[command(flatten)]
        paper: Paper,
    },
    /// Draw maps of |yaw|, |pitch|, |roll| and tilt over both speeds.
    ///
    /// Contours are straight between neighbouring speeds; a grid of fewer than 8 speeds of a flagellum has none.
    Map {
        /// The session or the sweep.
        #[arg(value_name = "SESSION|SWEEP")]
        session: PathBuf,
        /// A session or sweep whose map is drawn behind the points of the first.
        #[arg(long, value_name = "SESSION|SWEEP")]
        against: Option<PathBuf>,
        /// Draw maps of different robots or closures together.
        #[arg(long)]
        anyway: bool,
        /// The value of another input of a sweep, such as fluid_viscosity_pa_s=0.8; may be repeated. By default the one that
        /// most points have.
        #[arg(long, value_name = "COLUMN=VALUE", value_parser = fixed)]
        at: Vec<(String, f64)>,
        #[command(flatten)]
        paper: Paper,
    },
    /// Draw the 95 % intervals of fitted parameters, of one robot file or of several.
    Fit {
        /// The robot files that `biflag calibrate` wrote.
        #[arg(value_name = "ROBOT", required = true)]
        robots: Vec<PathBuf>,
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

/// A trial, and the part of it that is drawn.
#[derive(clap::Args, Debug)]
struct OneTrial {
    /// The log, or a session folder with the number of the trial.
    #[arg(value_name = "LOG|SESSION")]
    log: PathBuf,
    /// The number of the trial in the session, from 1.
    #[arg(value_name = "N")]
    number: Option<usize>,
    /// The time range to show, in seconds from the start of the run; by default the whole trial.
    #[arg(long, value_name = "FROM,TO", value_parser = span, allow_hyphen_values = true)]
    time: Option<[f64; 2]>,
}

// A figure of one trial without further options.
#[derive(clap::Args, Debug)]
struct Panels {
    #[command(flatten)]
    trial: OneTrial,
    #[command(flatten)]
    paper: Paper,
}

impl OneTrial {
    fn subject(&self) -> figure::Subject<'_> {
        figure::Subject { path: &self.log, number: self.number }
    }
}

/// The paper that a figure is for.
#[derive(clap::Args, Debug)]
struct Paper {
    /// The file to write; its extension selects the format: .svg, .pdf or .png.
    #[arg(short, long = "out", alias = "output", value_name = "FILE", value_parser = PathBufValueParser::new().try_map(|file| named(file, Format::ENDINGS)))]
    output: PathBuf,
    /// Printed width.
    #[arg(long, value_name = "MM", default_value_t = COLUMN_MM, value_parser = within("millimetres", WIDTHS_MM))]
    width_mm: f64,
}

fn fixed(text: &str) -> Result<(String, f64), String> {
    let form = || "give a column and its value, such as w2_rpm=10".to_owned();
    let (name, value) = text.split_once('=').ok_or_else(form)?;
    Ok((name.to_owned(), value.parse().map_err(|_| form())?))
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let (paper, figure) = match &args.subject {
        Subject::Trial { trial, against, anyway, paper } => {
            let (subject, against) = (trial.subject(), against.as_deref());
            (paper, figure::trial(subject, against, *anyway, trial.time, paper.width_mm)?)
        }
        Subject::Forces(Panels { trial, paper }) => {
            (paper, figure::forces(trial.subject(), trial.time, paper.width_mm)?)
        }
        Subject::Contact(Panels { trial, paper }) => {
            (paper, figure::contact(trial.subject(), trial.time, paper.width_mm)?)
        }
        Subject::Strip { trial, moments, paper } => {
            let moments = usize::from(*moments);
            (paper, figure::strip(trial.subject(), trial.time, moments, paper.width_mm)?)
        }
        Subject::Lines { sweep, value, over, by, at, paper } => {
            let lines = figure::Lines { value, over, by: by.as_deref(), at };
            (paper, figure::lines(sweep, lines, paper.width_mm)?)
        }
        Subject::Map { session, against, anyway, at, paper } => {
            (paper, figure::map(session, against.as_deref(), *anyway, at, paper.width_mm)?)
        }
        Subject::Fit { robots, paper } => (paper, figure::fit(robots, paper.width_mm)?),
        Subject::Scatter { session, against, anyway, paper } => {
            (paper, figure::scatter(session, against, *anyway, paper.width_mm)?)
        }
    };
    figure.write(&paper.output)?;
    let (file, remarks) = (paper.output.to_string_lossy(), figure.remarks);
    let is_sound = are_slight(&remarks.findings) && remarks.warnings.is_empty();
    let mut said = lines_of_logs(&remarks.findings);
    remarks.warnings.iter().for_each(|warning| said += &format!("\nwarning: {warning}"));
    remarks.notes.iter().for_each(|note| said += &format!("\nnote: {note}"));
    // A script takes the name of the file from stdout.
    if !said.is_empty() {
        colour::eprint(&printable(&format!("{}\n", said.trim_start())));
    }
    let body = json!({ "files": [file], "findings": remarks.findings, "warnings": remarks.warnings });
    Answer::new(Outcome::of(is_sound), &body, file.to_string())
}
