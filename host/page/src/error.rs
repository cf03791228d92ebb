//! Why a page, a figure or a film was not written.

use biflag_log::LogError;
use biflag_log::similar::did_you_mean;
use miette::Diagnostic;
use std::path::PathBuf;
use study::output::OutputError;
use study::plan::PlanError;
use study::session::SessionError;
use study::twin::TwinError;
use thiserror::Error;

/// Why a page, a figure or a film was not written.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum PageError {
    /// The log has no forces.
    #[error("{}: contains no forces", path.display())]
    #[diagnostic(code(wrong_use), help("name a log of the model: `biflag simulate --from LOG` replays a recording"))]
    NoForces { path: PathBuf },
    /// The trial has no data in the time range.
    #[error("{}: nothing to draw in this time", path.display())]
    #[diagnostic(code(wrong_use), help("name a time within the trial, counted from the start of its run"))]
    Nothing { path: PathBuf },
    /// A map needs points at different speeds.
    #[error("{}: no map: fewer than two speeds of a flagellum have steady angles{found}", path.display())]
    #[diagnostic(code(wrong_use), help("name a session whose trials differ in the speeds of both flagella"))]
    NoMap { path: PathBuf, found: String },
    /// The table of a sweep cannot be drawn so.
    #[error("{}: {reason}", path.display())]
    #[diagnostic(code(wrong_use), help("{help}"))]
    Swept { path: PathBuf, reason: String, help: String },
    /// A session has several trials.
    #[error("{}: is a session, and the figure shows one trial", path.display())]
    #[diagnostic(
        code(wrong_use),
        help("name the trial by its number, such as `biflag figure trial SESSION 1`, or name its log")
    )]
    WhichTrial { path: PathBuf },
    /// A log has one trial.
    #[error("{}: is no session folder, so that its trials have no numbers", path.display())]
    #[diagnostic(code(wrong_use), help("{}", did_you_mean(path, "leave the number out, or name the session's folder")))]
    NoNumber { path: PathBuf },
    /// The session has no log of the trial.
    #[error("{}: has no log of trial {number}", path.display())]
    #[diagnostic(code(wrong_use), help("`biflag info {}` lists its trials", path.display()))]
    NoTrial { path: PathBuf, number: usize },
    /// A robot file has no fit.
    #[error("{}: has no fit", path.display())]
    #[diagnostic(code(wrong_use), help("name a robot file of `biflag calibrate`"))]
    NoFit { path: PathBuf },
    /// There are too many fits.
    #[error("{count} fits: a figure tells at most {most} apart")]
    #[diagnostic(code(wrong_use), help("draw fewer"))]
    ManyFits { count: usize, most: usize },
    /// A film of this kind needs FFmpeg.
    #[error("{}: the program {program} is not installed, which encodes WebM", path.display())]
    #[diagnostic(help("install it (`sudo apt install ffmpeg`), or end the file's name with .gif"))]
    NoEncoder { path: PathBuf, program: &'static str },
    /// The trial has no data in the time of the film.
    #[error("{}: nothing to film in this time", path.display())]
    #[diagnostic(code(wrong_use), help("name a time within the trial, counted from the start of its run"))]
    NoFilm { path: PathBuf },
    /// The film would be too long.
    #[error("the film would have {frames} frames, more than {most}")]
    #[diagnostic(code(wrong_use), help("show less with --time, or faster with --speed"))]
    LongFilm { frames: usize, most: usize },
    /// The page would replace a file of another kind.
    #[error("{}: already exists and is not a report of biflag", path.display())]
    #[diagnostic(code(wrong_use), help("name another file with --out"))]
    NotOurs { path: PathBuf },
    /// The file is no table with two inputs and a result.
    #[error("{}: cannot be shown as a table: {reason}", path.display())]
    #[diagnostic(code(wrong_use), help("name a log, a session folder, or the table that `biflag sweep` writes"))]
    Table { path: PathBuf, reason: String },
    /// A robot file cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plan(#[from] PlanError),
    /// The figure could not be converted.
    #[error("the figure cannot be converted: {reason}")]
    #[diagnostic(help("write it as .svg, or narrower"))]
    Convert { reason: String },
    /// A file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Output(#[from] OutputError),
    /// A log cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
    /// A session cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Session(#[from] SessionError),
    /// The trials cannot be compared.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Twin(#[from] TwinError),
}
