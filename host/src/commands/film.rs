//! `biflag film`: the moving robot as an animated image or a video.

use super::answer::{Answer, Outcome, are_slight, lines_of_logs};
use super::options::{span, within};
use crate::film::{self, Options};
use crate::progress::Progress;
use std::path::PathBuf;

/// Write a film of a trial as an animated GIF or a WebM video: the moving robot over its yaw.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag film glycerin/001_w1+50_w2+10.mcap -o film.gif\n  \
    biflag film bundling/001_w1+90_w2+90.mcap --time 30,45 --speed 1 --width 720 -o film.webm\n\
    A log of `biflag simulate --shapes` shows how the flagella bend; in others, rigid helices turn with the motors. The dial \
    above the robot and the curve below it show the yaw.")]
pub struct Args {
    /// The log.
    log: PathBuf,
    /// The film to write (.gif; .webm needs the program `ffmpeg`).
    #[arg(short, long = "out", alias = "output", value_name = "FILE")]
    output: PathBuf,
    /// The time to show, in seconds from the start of the run; by default the run.
    #[arg(long, value_name = "FROM,TO", value_parser = span, allow_hyphen_values = true)]
    time: Option<[f64; 2]>,
    /// Seconds of the trial in a second of the film.
    #[arg(long, value_name = "FACTOR", default_value = "4", value_parser = within("a factor", 0.05..=100.0))]
    speed: f64,
    /// Width in pixels.
    #[arg(long, value_name = "PX", default_value = "360", value_parser = clap::value_parser!(u16).range(120..=1200))]
    width: u16,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let options = Options { time_s: args.time, speed: args.speed, width: args.width };
    let progress = Progress::new(1.0);
    let film = film::write(&args.log, &args.output, &options, &|drawn, all| match drawn {
        0 => progress.phase("film", "frames"),
        drawn => progress.within(drawn as f64 / all as f64),
    })?;
    progress.finish();
    let file = args.output.to_string_lossy();
    let shapes = if film.has_shapes { "" } else { "; the log has no shapes, so the helices are rigid" };
    let text =
        format!("{file}: {} frames, {:.1} s{shapes}{}", film.frames, film.duration_s, lines_of_logs(&film.findings));
    Ok(Answer::new(Outcome::of(are_slight(&film.findings)), &film, text)?.with("file", file))
}
