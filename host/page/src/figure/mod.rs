//! Figures for a paper: drawn as SVG at the printed width, with all text of 7 pt.
//!
//! This module draws figures itself. They need two linear axes, curves, bands, dots and cells, and exact sizes on paper, which
//! the plotting libraries for Rust do not offer (they place text by pixels).

mod contact;
mod fit;
mod forces;
mod lines;
mod map;
mod panel;
mod print;
mod provenance;
mod scatter;
mod sheet;
mod strip;
mod sweep;
mod trial;

pub use print::Format;
use sweep::Steady;
pub use sweep::{Lines, lines};

use crate::{PageError, swept};
use biflag_log::Origin;
use biflag_log::similar::did_you_mean;
use map::{Map, Mark, Point};
use protocol::units::CentiRpm;
use provenance::Provenance;
use rayon::prelude::*;
use sim::steady::phase::Ratio;
use std::io::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use study::output::replace;
use study::plan::robot;
use study::run::model::has_phases;
use study::session::{Attempt, Session, TrialState};
use study::trial::{AtSpeeds, FindingKind, Judged, LogFinding, Want, mean_of_repeats};
use study::twin::{self, Compared, Maker, OnMismatch, Pairs, Source};

/// Width of a column in many journals, mm.
pub const COLUMN_MM: f64 = 88.0;

/// Possible widths, mm.
pub const WIDTHS_MM: RangeInclusive<f64> = 60.0..=400.0;

/// Possible numbers of moments in a strip.
pub const MOMENTS: RangeInclusive<i64> = 2..=12;

/// A trial to draw: its log, or its number in a session.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// The log, or the session.
    pub path: &'a Path,
    /// Number of the trial in the session, from 1; `None` for a log.
    pub number: Option<usize>,
}

impl Subject<'_> {
    fn log(self) -> Result<Attempt, PageError> {
        let path = self.path;
        match self.number {
            None if path.is_dir() => {
                let help = "name the trial by its number, such as `biflag figure trial SESSION 1`, or name its log";
                Err(PageError::wrong_use(path, "is a session, and the figure shows one trial", help))
            }
            None => Ok(Attempt::of_log(path)),
            Some(_) if !path.is_dir() => {
                let help = did_you_mean(path, "leave the number out, or name the session's folder");
                Err(PageError::wrong_use(path, "is no session folder, so that its trials have no numbers", help))
            }
            Some(number) => {
                let states = Session::open(path)?.intact_states()?;
                let state = number.checked_sub(1).and_then(|index| states.into_iter().nth(index));
                let log = state.and_then(|state| state.best().cloned());
                let help = || format!("`biflag info {}` lists its trials", path.display());
                log.ok_or_else(|| PageError::wrong_use(path, format!("has no log of trial {number}"), help()))
            }
        }
    }
}

/// Returns how to handle two sessions of different robots, closures or speeds. Replays are accepted, because the user requested
/// any other robot.
fn of_sessions(session: &Path, other: &Path, anyway: bool) -> Result<OnMismatch, PageError> {
    let are_replays = swept::table_of(session).is_none() && *other == Source::open(session)?.replay_folder();
    Ok(OnMismatch::of(are_replays, anyway))
}

/// A figure that was drawn.
#[derive(Clone, Debug)]
pub struct Figure {
    svg: String,
    provenance: Provenance,
    /// Findings, warnings and notes about it.
    pub remarks: Remarks,
}

impl Figure {
    /// Replaces a part of the names of its logs, in its provenance and in its remarks.
    pub fn rename_logs(&mut self, from: &str, to: &str) {
        let of_findings = self.remarks.findings.iter_mut().map(|of_log| &mut of_log.log);
        self.provenance.logs.iter_mut().chain(of_findings).for_each(|name| *name = name.replace(from, to));
    }

    /// Returns the content of its file, with its provenance.
    ///
    /// # Errors
    /// [`PageError`].
    pub fn content(&self, format: Format) -> Result<Vec<u8>, PageError> {
        self.provenance.add(print::convert(&self.svg, format)?, format)
    }

    /// Writes its file.
    ///
    /// # Errors
    /// [`PageError`].
    pub fn write(&self, path: &Path) -> Result<(), PageError> {
        let content = self.content(Format::of(path)?)?;
        Ok(replace(path, |file| file.write_all(&content))?)
    }
}

/// Findings, warnings and notes about a figure.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Remarks {
    /// Findings about the logs that it shows, and about those that it leaves out.
    pub findings: Vec<LogFinding>,
    /// Warnings about trials that are drawn together.
    pub warnings: Vec<String>,
    /// Notes on the content of the figure.
    pub notes: Vec<String>,
}

/// Draws the angles of a trial over time, beside those of `against` with their residuals. `time_s`: the time to show,
/// from the start of the run; by default all of it.
///
/// # Errors
/// [`PageError`].
pub fn trial(
    subject: Subject,
    against: Option<&Path>,
    anyway: bool,
    time_s: Option<[f64; 2]>,
    width_mm: f64,
) -> Result<Figure, PageError> {
    let own = subject.log()?.read(Want { hash: true, ..Want::default() })?;
    let mut logs = vec![Provenance::log(&own.data)];
    let compared = match against {
        Some(path) => {
            let other = Subject { path, number: subject.number.filter(|_| path.is_dir()) };
            let other = other.log()?.read(Want { hash: true, ..Want::default() })?;
            logs.push(Provenance::log(&other.data));
            // The user may have replayed the trial with another robot.
            let on_mismatch = OnMismatch::of(twin::is_replay_of(&other.data, &own.data), anyway);
            Some(twin::compare(&own, &other, on_mismatch)?)
        }
        None => None,
    };
    let remarks = match &compared {
        Some(Compared { comparison, .. }) => {
            Remarks { findings: comparison.findings.clone(), warnings: comparison.warnings.clone(), notes: Vec::new() }
        }
        None => Remarks::of(&own),
    };
    let provenance = Provenance::new(format!("Yaw, pitch and roll of trial {}", own.data.trial().name), logs);
    Ok(Figure { svg: trial::draw(&own, compared.as_ref(), time_s, width_mm)?, provenance, remarks })
}

impl Remarks {
    fn of(trial: &Judged) -> Self {
        Self { findings: trial.log_findings(), ..Self::default() }
    }
}

/// Draws the forces of both flagella on the base over a trial of the model; `time_s` as in [`trial`].
///
/// # Errors
/// [`PageError`].
pub fn forces(subject: Subject, time_s: Option<[f64; 2]>, width_mm: f64) -> Result<Figure, PageError> {
    let title = "Forces of both flagella in trial";
    of_trial(subject, Want { forces: true, ..Want::default() }, title, |own| forces::draw(&own.data, time_s, width_mm))
}

/// Draws gap and winding of the flagella of a modelled trial, and when they touch; `time_s` as in [`trial`].
///
/// # Errors
/// [`PageError`].
pub fn contact(subject: Subject, time_s: Option<[f64; 2]>, width_mm: f64) -> Result<Figure, PageError> {
    let title = "Gap and winding of the flagella in trial";
    of_trial(subject, Want { forces: true, ..Want::default() }, title, |own| contact::draw(&own.data, time_s, width_mm))
}

/// Draws the robot at `moments` times of a trial, side by side; `time_s` as in [`trial`], by default the run.
///
/// # Errors
/// [`PageError`].
pub fn strip(subject: Subject, time_s: Option<[f64; 2]>, moments: usize, width_mm: f64) -> Result<Figure, PageError> {
    let title = format!("The robot at {moments} moments of trial");
    let mut has_shapes = true;
    let mut figure = of_trial(subject, Want { shapes: usize::MAX, ..Want::default() }, &title, |own| {
        has_shapes = !own.data.shapes.is_empty();
        strip::draw(own, time_s, moments, width_mm)
    })?;
    if !has_shapes {
        figure.remarks.warnings.push(
            "the log has no shapes of the flagella: rigid helices turn with the motors; `biflag simulate --shapes` writes shapes"
                .to_owned(),
        );
    }
    Ok(figure)
}

/// Draws a trial that is read with `want`; the title ends with its name.
fn of_trial(
    subject: Subject,
    want: Want,
    title: &str,
    draw: impl FnOnce(&Judged) -> Result<String, PageError>,
) -> Result<Figure, PageError> {
    let own = subject.log()?.read(Want { hash: true, ..want })?;
    let title = format!("{title} {}", own.data.trial().name);
    let provenance = Provenance::new(title, [Provenance::log(&own.data)]);
    Ok(Figure { svg: draw(&own)?, provenance, remarks: Remarks::of(&own) })
}

/// Draws maps of |yaw|, |pitch|, |roll| and tilt over both speeds, from `session`, which may be a sweep. With `surface`, draws
/// the points of `session` over the map of `surface`, which must be of the same robot unless `anyway`. A pair of speeds has the
/// mean of its trials; trials that did not end as planned are left out. `at` as in [`Lines`].
///
/// # Errors
/// [`PageError`].
pub fn map(
    session: &Path,
    surface: Option<&Path>,
    anyway: bool,
    at: &[(String, f64)],
    width_mm: f64,
) -> Result<Figure, PageError> {
    let (mut remarks, mut logs, mut under) = (Remarks::default(), Vec::new(), Vec::new());
    let mut read = |path: &Path| match swept::table_of(path) {
        Some(_) => sweep::steady(path, at, (&mut remarks, &mut logs, &mut under)),
        None => steady(path, &mut remarks, &mut logs),
    };
    let (of_surface, of_points) = match surface {
        Some(surface) => (read(surface)?, read(session)?),
        None => (read(session)?, Steady::default()),
    };
    if let Some(surface) = surface {
        let difference = match (&of_points.maker, &of_surface.maker) {
            (Some(a), Some(b)) => a.difference(b),
            _ => of_surface
                .varied
                .or(of_points.varied)
                .map(|at| format!("a sweep of several robots, here at {at}: nothing says that both are of one robot")),
        };
        remarks.warnings.extend(of_sessions(session, surface, anyway)?.warning(difference, [session, surface])?);
    }
    let (surface, points) = (of_surface.known, of_points.known);
    let unknown = [of_surface.unknown, of_points.unknown].concat();
    let differs = |k: usize| surface.iter().chain(&points).any(|trial| trial.speeds_rpm[k] != surface[0].speeds_rpm[k]);
    if surface.is_empty() || !differs(0) || !differs(1) {
        let grave = remarks.findings.iter().filter(|of_log| of_log.finding.grave);
        let found = grave.map(|of_log| format!("; {}: {}", of_log.log, of_log.finding)).collect();
        return Err(PageError::NoMap { path: session.to_owned(), found });
    }
    let titles = ["|ψ| (°)", "|θ| (°)", "|φ| (°)", "tilt (°)"];
    let values = |trials: &[AtSpeeds<()>], k: usize| -> Vec<Point> {
        let point = |trial: &AtSpeeds<()>| Point {
            at: trial.speeds_rpm,
            value: trial.angles_deg.get(k).copied().unwrap_or(trial.tilt_deg),
            is_settled: trial.is_settled,
        };
        trials.iter().map(point).collect()
    };
    let map = |(k, title)| Map { title, surface: values(&surface, k), points: values(&points, k), unknown: &unknown };
    let maps: Vec<Map> = titles.into_iter().enumerate().map(map).collect();
    let whose = of_points.measured.map_or_else(|| session.display().to_string(), str::to_owned);
    let unsettled = surface.iter().chain(&points).any(|trial| !trial.is_settled);
    let legend = [
        (Mark::Cross, !points.is_empty(), format!("{whose}, in the colours of the map")),
        (Mark::Ring, unsettled, "not settled, or more than 0.3° apart for other starting phases".to_owned()),
        (Mark::Square, !unknown.is_empty(), "mean not known: not settled, or overturned".to_owned()),
    ];
    let legend: Vec<(Mark, String)> =
        legend.into_iter().filter(|(_, is_there, _)| *is_there).map(|(mark, _, text)| (mark, text)).collect();
    let of_one_phase = surface.iter().filter(|point| Ratio::of(point.speeds_rpm).is_some()).count();
    if of_surface.one_phase && of_one_phase > 0 {
        let all = surface.len();
        under.push(format!("{of_one_phase} of {all} points hold for one starting phase of the flagella"));
    }
    let provenance = Provenance::new("Maps of |yaw|, |pitch|, |roll| and tilt over both speeds", logs);
    Ok(Figure { svg: map::draw(&maps, ["ω₁ (rpm)", "ω₂ (rpm)"], &legend, &under, width_mm), provenance, remarks })
}

/// Draws the 95 % intervals of the parameters of fitted robots.
///
/// # Errors
/// [`PageError`].
pub fn fit(robots: &[PathBuf], width_mm: f64) -> Result<Figure, PageError> {
    if robots.len() > fit::MOST_FITS {
        let what = format!("{} fits: a figure tells at most {} apart", robots.len(), fit::MOST_FITS);
        return Err(PageError::WrongUse { what, help: "draw fewer".to_owned() });
    }
    let (mut fits, mut files, mut remarks) = (Vec::new(), Vec::new(), Remarks::default());
    for path in robots {
        let file = robot::load(path)?;
        let no_fit = || PageError::wrong_use(path, "has no fit", "name a robot file of `biflag calibrate`");
        let fit = file.fit()?.ok_or_else(no_fit)?;
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let named = fit::Named { name, fit };
        let doubts = named.fit.parameters.iter().filter_map(|p| Some((&p.name, named.doubt(p)?)));
        remarks.warnings.extend(doubts.map(|(parameter, doubt)| format!("{}: {parameter}: {doubt}", path.display())));
        files.push(Provenance::file("robot file", path));
        fits.push(named);
    }
    if fits.windows(2).any(|pair| pair[0].fit.closure != pair[1].fit.closure) {
        remarks.warnings.push("the fits are of different closures".to_owned());
    }
    let provenance = Provenance::new("95 % intervals of fitted parameters", files);
    Ok(Figure { svg: fit::draw(&fits, width_mm), provenance, remarks })
}

/// Draws the predicted against the measured steady angles of a session.
///
/// # Errors
/// [`PageError`].
pub fn scatter(measured: &Path, predicted: &Path, anyway: bool, width_mm: f64) -> Result<Figure, PageError> {
    let pairs = Pairs::of(measured, predicted)?;
    let jobs = rayon::current_num_threads();
    let on_mismatch = of_sessions(measured, predicted, anyway)?;
    let want = Want { hash: true, ..Want::default() };
    let (comparison, logs) = twin::compare_pairs(&pairs, want, on_mismatch, jobs, &|a, b, _| {
        [a, b].map(|trial| Provenance::log(&trial.data))
    })?;
    let provenance = Provenance::new("Predicted against measured steady angles", logs.into_iter().flatten());
    let svg = scatter::draw(&comparison.trials, width_mm);
    let warned = comparison.trials.iter().flat_map(|trial| trial.warnings.iter().map(move |text| (&trial.name, text)));
    let skipped = comparison.skipped.iter().map(|skipped| (&skipped.name, &skipped.reason));
    let warnings = warned.chain(skipped).map(|(name, text)| format!("{name}: {text}")).collect();
    Ok(Figure { svg, provenance, remarks: Remarks { findings: comparison.findings, warnings, notes: Vec::new() } })
}

/// Returns the steady angles of the trials of a session that ended as planned, by their speeds. Adds the remarks about its logs,
/// and the logs.
fn steady(session: &Path, remarks: &mut Remarks, logs: &mut Vec<String>) -> Result<Steady, PageError> {
    let session = Session::open(session)?;
    let states = session.intact_states()?;
    remarks.findings.extend(states.iter().flat_map(|state| &state.left_out).cloned().chain(session.missing(&states)));
    let attempts: Vec<_> = states.iter().filter_map(|state| Some((state, state.best()?))).collect();
    let one = |(state, log): &(&TrialState, &Attempt)| -> Result<_, PageError> {
        let trial = match log.read(Want { hash: true, ..Want::default() }) {
            // A file that is not a log is not a point of the map either.
            Err(error) if state.complete().is_none() && !error.is_of_reading() => {
                return Ok((None, Vec::new(), None, None));
            }
            trial => trial?,
        };
        let (data, found) = (&trial.data, trial.log_findings());
        let speeds_rpm = state.trial.final_speeds().map(CentiRpm::rpm);
        // A trial that did not end as planned has no steady angles; its findings say so.
        let angles = trial.steady_angles().filter(|_| state.complete().is_some());
        let is_settled = !found.iter().any(|of_log| of_log.finding.kind == FindingKind::Window);
        let angles =
            angles.map(|a| AtSpeeds::of_trial(speeds_rpm, [a.yaw_deg, a.pitch_deg, a.roll_deg], is_settled, ()));
        let log = angles.is_some().then(|| Provenance::log(data));
        let maker = angles.as_ref().and_then(|_| Maker::of(data).ok());
        Ok((angles, found, log, maker.map(|maker| (maker, data.origin()))))
    };
    let (mut trials, mut unknown, mut first) = (Vec::new(), Vec::new(), None);
    let read = attempts.par_iter().map(one).collect::<Result<Vec<_>, _>>()?;
    for ((angles, found, log, maker), (state, _)) in read.into_iter().zip(&attempts) {
        unknown.extend(
            (angles.is_none() && state.complete().is_some()).then(|| state.trial.final_speeds().map(CentiRpm::rpm)),
        );
        trials.extend(angles);
        remarks.findings.extend(found);
        logs.extend(log);
        first = first.or(maker);
    }
    let known = mean_of_repeats(trials.into_iter());
    let (maker, origin) = first.unzip();
    let measured = match origin {
        Some(Origin::Rig | Origin::Imported) => Some("measured"),
        Some(Origin::VirtualRig) => Some("recorded on the emulated board"),
        Some(Origin::Model) | None => None,
    };
    let one_phase = origin == Some(Origin::Model) && !has_phases(&session.plan().trials);
    Ok(Steady { known, unknown, one_phase, measured, maker, varied: None })
}
