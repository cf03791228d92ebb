//! Exports trials and sessions to other formats, with the same values as in all commands and pages.

pub(crate) mod csv;
pub(crate) mod parquet;
pub mod session;
pub mod table;
pub mod trial;

use crate::output::{self, OutputError};
use crate::session::{Attempt, Session, SessionError, TrialState};
use crate::trial::{Judged, LogFinding, Want, Zeroed};
use biflag_log::LogError;
use miette::Diagnostic;
use rayon::prelude::*;
use session::Summary;
use sim::body::attitude::of_euler_zyx;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use table::Table;
use thiserror::Error;

/// An export format.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Format {
    /// A CSV table with one row per frame. Header lines that begin with `#` state units and corrections.
    Csv,
    /// The same table as Apache Parquet.
    Parquet,
    /// The attitude as a trajectory in the TUM format: time, position (zero), quaternion x y z w.
    Tum,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 3] = [Self::Csv, Self::Parquet, Self::Tum];

    /// Returns a sentence about the format, for help texts.
    pub fn about(self) -> &'static str {
        match self {
            Self::Csv => {
                "A CSV table with one row per frame. Header lines that begin with `#` state units and corrections"
            }
            Self::Parquet => "The same table as Apache Parquet",
            Self::Tum => "The attitude as a trajectory in the TUM format: time, position (zero), quaternion x y z w",
        }
    }

    /// Returns the file extension.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Parquet => "parquet",
            Self::Tum => "tum",
        }
    }
}

/// Why an export failed.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum ExportError {
    /// The file or folder already exists.
    #[error("{}: already exists", path.display())]
    #[diagnostic(code(wrong_use), help("name another one with -o, or replace it with --force"))]
    Exists { path: PathBuf },
    /// The output file is the log itself.
    #[error("{}: is the log itself", path.display())]
    #[diagnostic(code(wrong_use), help("name another file with -o"))]
    Itself { path: PathBuf },
    /// A session cannot be exported to a format of single trials.
    #[error("a session cannot be exported as a trajectory")]
    #[diagnostic(code(wrong_use), help("export it as csv or parquet, or name a log"))]
    NotOfSessions,
    /// The file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Output(#[from] OutputError),
    /// The log cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
    /// The session cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Session(#[from] SessionError),
}

/// Result of an export.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Exported {
    /// The files written.
    pub files: Vec<PathBuf>,
    /// Name and origin of each trial.
    pub trials: Vec<(String, &'static str)>,
    /// Number of rows of all trials.
    pub rows: usize,
    /// Logs that are cut off or damaged, with their losses.
    pub damaged: Vec<String>,
    /// Findings about the trials.
    pub findings: Vec<LogFinding>,
}

impl Exported {
    fn add(&mut self, other: Self) {
        self.files.extend(other.files);
        self.trials.extend(other.trials);
        self.rows += other.rows;
        self.damaged.extend(other.damaged);
        self.findings.extend(other.findings);
    }
}

const ALL: Want = Want { forces: true, frames: true, shapes: 0, hash: true };

/// Exports a log to a file.
///
/// # Errors
/// [`ExportError`]; an existing file is kept unless `replace` is set, and an unfinished one is removed.
pub fn export_log(log: &Path, output: &Path, format: Format, replace: bool) -> Result<Exported, ExportError> {
    if system::file::is_same(log, output) {
        return Err(ExportError::Itself { path: output.to_owned() });
    }
    let trial = Attempt::of_log(log).read(ALL)?;
    let rows = write_trial(&trial, output, format, replace)?;
    let damaged = if trial.data.condition.is_whole() { Vec::new() } else { vec![log.display().to_string()] };
    let trials = vec![(trial.data.trial().name, trial.data.origin().name())];
    Ok(Exported { files: vec![output.to_owned()], trials, rows, damaged, findings: trial.log_findings() })
}

/// Exports a session to a folder: one file per trial with a log, a table of the trials, `trials.csv` or `trials.parquet`,
/// and one of the causes of their uncertainties, `budget.csv` or `budget.parquet`.
///
/// # Errors
/// [`ExportError`]; existing files are kept unless `replace` is set.
pub fn export_session(session: &Path, output: &Path, format: Format, replace: bool) -> Result<Exported, ExportError> {
    if format == Format::Tum {
        return Err(ExportError::NotOfSessions);
    }
    let session = Session::open(session)?;
    std::fs::create_dir_all(output).map_err(|source| {
        let path = output.to_owned();
        match source.kind() {
            ErrorKind::AlreadyExists | ErrorKind::NotADirectory => ExportError::Exists { path },
            _ => OutputError::new(&path, source).into(),
        }
    })?;
    let [table, budget] = ["trials", "budget"].map(|name| output.join(format!("{name}.{}", format.extension())));
    if let Some(path) = [&table, &budget].into_iter().find(|path| !replace && path.exists()) {
        return Err(ExportError::Exists { path: path.clone() });
    }
    let states = session.intact_states()?;
    let mut exported = Exported { findings: Vec::from_iter(session.missing(&states)), ..Exported::default() };
    let one = |state| export_trial(state, output, format, replace);
    let parts: Vec<Result<_, ExportError>> = states.par_iter().map(one).collect();
    let mut trials = Vec::new();
    for part in parts {
        let (part, summary) = part?;
        exported.add(part);
        trials.extend(summary);
    }
    let name = &session.plan().name;
    for (file, table) in [(table, session::table(name, &trials)), (budget, session::budget(name, &trials))] {
        write_table(&table, &file, format, replace)?;
        exported.files.push(file);
    }
    Ok(exported)
}

/// Exports a trial of a session into a folder. Returns what was written, and its row of the table of trials.
fn export_trial(
    state: &TrialState,
    folder: &Path,
    format: Format,
    replace: bool,
) -> Result<(Exported, Option<Summary>), ExportError> {
    let mut exported = Exported { findings: state.left_out.clone(), ..Exported::default() };
    let Some(attempt) = state.best() else { return Ok((exported, None)) };
    let trial = match attempt.read(ALL) {
        Ok(trial) => trial,
        Err(error) => {
            exported.damaged.push(error.to_string());
            return Ok((exported, None));
        }
    };
    if !trial.data.condition.is_whole() {
        exported.damaged.push(attempt.path.display().to_string());
    }
    let name = format!("{}.{}", state.trial.name, format.extension());
    let file = folder.join(&name);
    exported.rows = write_trial(&trial, &file, format, replace)?;
    exported.files.push(file);
    exported.trials.push((state.trial.name.clone(), trial.data.origin().name()));
    exported.findings.extend(trial.log_findings());
    Ok((exported, Some(Summary::new(&state.trial, trial, name))))
}

/// Writes a trial and returns the number of rows.
fn write_trial(trial: &Judged, output: &Path, format: Format, replace: bool) -> Result<usize, ExportError> {
    if format == Format::Tum {
        let mut rows = 0;
        write(output, replace, |file| {
            rows = tum(&trial.angles, file)?;
            Ok(())
        })?;
        return Ok(rows);
    }
    let table = trial::table(trial);
    write_table(&table, output, format, replace)?;
    Ok(table.rows())
}

fn write_table(table: &Table, output: &Path, format: Format, replace: bool) -> Result<(), ExportError> {
    write(output, replace, |file| match format {
        Format::Parquet => parquet::write(table, file),
        Format::Csv | Format::Tum => csv::write(table, file),
    })
}

/// Writes a file through a draft beside it, so that no partial file is left.
fn write(
    output: &Path,
    replace: bool,
    content: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<(), ExportError> {
    if !replace && output.symlink_metadata().is_ok() {
        return Err(ExportError::Exists { path: output.to_owned() });
    }
    Ok(output::replace(output, content)?)
}

/// Writes the corrected attitude over the trial's clock; returns the number of rows.
fn tum(zeroed: &Zeroed, target: &mut impl Write) -> std::io::Result<usize> {
    let angles = &zeroed.angles_deg;
    for (i, time_s) in angles.time_s.iter().enumerate() {
        let q = of_euler_zyx(angles.row(i).map(f64::to_radians));
        writeln!(target, "{time_s:.6} 0 0 0 {:.9} {:.9} {:.9} {:.9}", q.i, q.j, q.k, q.w)?;
    }
    Ok(angles.len())
}
