//! Figures for a paper: drawn as SVG at the printed width, with all text of 7 pt.
//!
//! Figures are drawn by own functions. They need two linear axes, curves, bands, dots and cells, and exact sizes on
//! paper, which the plotting libraries for Rust do not offer (they place text by pixels).

mod forces;
mod map;
mod output;
mod panel;
#[cfg(feature = "print")]
mod print;
#[cfg(not(feature = "print"))]
mod print {
    //! Stands for the converter in a program that was built without it.

    use super::{FigureError, Format};

    pub(super) fn convert(_svg: &str, _format: Format) -> Result<Vec<u8>, FigureError> {
        Err(FigureError::NotBuilt)
    }
}
mod scatter;
mod sheet;
mod trial;

pub use output::Format;

use biflag_log::LogError;
use map::{Map, Point};
use miette::Diagnostic;
use protocol::units::CentiRpm;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use study::output::OutputError;
use study::session::{Session, SessionError};
use study::trial::{AtSpeeds, Data, Want, Zeroed, mean_of_repeats};
use study::twin::{self, OnMismatch, Pairs, TwinError};
use thiserror::Error;

/// Width of a column in many journals, mm.
pub const COLUMN_MM: f64 = 88.0;

/// Why a figure was not drawn.
#[derive(Error, Diagnostic, Debug)]
pub enum FigureError {
    /// The file's name has no known ending.
    #[error("{}: no format ends like this", path.display())]
    #[diagnostic(code(wrong_use), help("end the file's name with .svg, .pdf or .png"))]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// The log has no forces.
    #[error("{}: contains no forces", path.display())]
    #[diagnostic(code(wrong_use), help("name a log of the model: `biflag simulate --from LOG` replays a recording"))]
    NoForces {
        /// The log.
        path: PathBuf,
    },
    /// The trial has no data in the time range.
    #[error("{}: nothing to draw in this time", path.display())]
    #[diagnostic(code(wrong_use), help("name a time within the trial, counted from the start of its run"))]
    Nothing {
        /// The log.
        path: PathBuf,
    },
    /// A map needs points at different speeds.
    #[error("{}: no map: fewer than two speeds of a flagellum have steady angles", path.display())]
    #[diagnostic(code(wrong_use), help("name a session whose trials differ in the speeds of both flagella"))]
    NoMap {
        /// The session.
        path: PathBuf,
    },
    /// It could not be converted.
    #[error("the figure cannot be converted: {reason}")]
    #[diagnostic(help("write it as .svg, or narrower"))]
    Convert {
        /// Why.
        reason: String,
    },
    /// The program has no converter.
    #[error("this biflag was built without PDF and PNG, as `make demo` does")]
    #[diagnostic(help("build it with `make build`, or write the figure as .svg"))]
    NotBuilt,
    /// Its file cannot be written.
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

/// Writes the angles of a trial over time, beside those of `against` with their residuals. `time_s`: the time to show,
/// from the start of the run; by default all of it.
///
/// # Errors
/// [`FigureError`].
pub fn trial(
    log: &Path,
    against: Option<&Path>,
    time_s: Option<[f64; 2]>,
    width_mm: f64,
    out: &Path,
) -> Result<(), FigureError> {
    Format::of(out)?;
    let data = Data::read(log, Want { hash: true, ..Want::default() })?;
    let compared = match against {
        Some(other) => Some(twin::compare(&data, &Data::read(other, Want::default())?, OnMismatch::Accept)?),
        None => None,
    };
    output::write(&trial::draw(&data, compared.as_ref(), time_s, width_mm)?, out)
}

/// Writes the forces of both flagella on the base over a trial of the model; `time_s` as in [`trial`].
///
/// # Errors
/// [`FigureError`].
pub fn forces(log: &Path, time_s: Option<[f64; 2]>, width_mm: f64, out: &Path) -> Result<(), FigureError> {
    Format::of(out)?;
    let data = Data::read(log, Want { forces: true, ..Want::default() })?;
    output::write(&forces::draw(&data, time_s, width_mm)?, out)
}

/// Writes maps of |yaw|, |pitch|, |roll| and tilt over both speeds: of `session`, or its points over the map of
/// `surface`. A pair of speeds has the mean of its trials; trials that did not end as planned are left out.
///
/// # Errors
/// [`FigureError`].
pub fn map(session: &Path, surface: Option<&Path>, width_mm: f64, out: &Path) -> Result<(), FigureError> {
    Format::of(out)?;
    let (surface, points) = match surface {
        Some(surface) => (steady(surface)?, steady(session)?),
        None => (steady(session)?, Vec::new()),
    };
    let differs = |k: usize| surface.iter().chain(&points).any(|trial| trial.speeds_rpm[k] != surface[0].speeds_rpm[k]);
    if surface.is_empty() || !differs(0) || !differs(1) {
        return Err(FigureError::NoMap { path: session.to_owned() });
    }
    let titles = ["|ψ| (°)", "|θ| (°)", "|φ| (°)", "tilt (°)"];
    let values = |trials: &[AtSpeeds<()>], k: usize| -> Vec<Point> {
        trials.iter().map(|trial| Point { at: trial.speeds_rpm, value: trial.magnitudes_deg()[k] }).collect()
    };
    let maps: Vec<_> = (0..titles.len()).map(|k| (values(&surface, k), values(&points, k))).collect();
    let maps: Vec<Map> =
        titles.iter().zip(&maps).map(|(title, (surface, points))| Map { title, surface, points }).collect();
    output::write(&map::draw(&maps, ["ω₁ (rpm)", "ω₂ (rpm)"], width_mm), out)
}

/// Writes the predicted against the measured steady angles of a session.
///
/// # Errors
/// [`FigureError`].
pub fn scatter(measured: &Path, predicted: &Path, width_mm: f64, out: &Path) -> Result<(), FigureError> {
    Format::of(out)?;
    let pairs = Pairs::of(measured, predicted)?;
    let jobs = rayon::current_num_threads();
    let (comparison, _) = twin::compare_pairs(&pairs, Want::default(), OnMismatch::Accept, jobs, &|_, _, _| ())?;
    output::write(&scatter::draw(&comparison.trials, width_mm), out)
}

/// Returns the steady angles of the trials of a session that ended as planned, by their speeds.
fn steady(session: &Path) -> Result<Vec<AtSpeeds<()>>, FigureError> {
    let states = Session::open(session)?.intact_states()?;
    let logs: Vec<_> = states.iter().filter_map(|state| Some((state.trial.speeds, &state.complete()?.path))).collect();
    let one = |(speeds, log): &([CentiRpm; 2], &PathBuf)| -> Result<_, FigureError> {
        let angles = Zeroed::new(&Data::read(log, Want::default())?).angles();
        Ok(angles.map(|a| (speeds.map(CentiRpm::rpm), [a.yaw_deg, a.pitch_deg, a.roll_deg], ())))
    };
    let trials: Result<Vec<_>, _> = logs.par_iter().map(one).collect();
    Ok(mean_of_repeats(trials?.into_iter().flatten()))
}
