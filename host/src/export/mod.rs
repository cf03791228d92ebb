//! A log in other formats.

mod columns;
#[cfg(feature = "parquet")]
mod parquet;

use crate::atomic_file;
use crate::log::{Body, Condition, LogError, Message, Reader};
use miette::Diagnostic;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A format that a log can be exported to.
#[derive(clap::ValueEnum, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Format {
    /// A table of the telemetry, one row a frame, units in the names of the columns.
    Csv,
    /// The attitude as a trajectory: time, position (zero), quaternion x y z w, as the TUM tools read it.
    Tum,
    /// The same table as CSV, as Apache Parquet.
    #[cfg(feature = "parquet")]
    Parquet,
}

impl Format {
    /// What its files' names end in.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Tum => "tum",
            #[cfg(feature = "parquet")]
            Self::Parquet => "parquet",
        }
    }
}

/// Why an export did not succeed.
#[derive(Error, Diagnostic, Debug)]
pub enum ExportError {
    /// The file is there already.
    #[error("{}: exists already", path.display())]
    #[diagnostic(code(wrong_use), help("name another file with -o, or replace it with --force"))]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// It is the log itself.
    #[error("{}: is the log itself", path.display())]
    #[diagnostic(code(wrong_use), help("name another file with -o"))]
    Itself {
        /// The file.
        path: PathBuf,
    },
    /// It could not be written.
    #[error("{}: cannot be written", path.display())]
    #[diagnostic(help("check that the folder exists and has room"))]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The log does not read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
}

/// What came of an export.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Exported {
    /// Rows that were written.
    pub rows: u64,
    /// How the log is.
    pub condition: Condition,
}

/// Something that takes the telemetry a frame at a time.
trait Sink {
    fn row(&mut self, message: &Message) -> std::io::Result<bool>;
    fn finish(self: Box<Self>) -> std::io::Result<()>;
}

/// Writes the log at `log` to `output`, which must not exist unless it is to be replaced.
///
/// # Errors
/// [`ExportError`].
pub fn export(log: &Path, output: &Path, format: Format, replace: bool) -> Result<Exported, ExportError> {
    let mut reader = Reader::open(log)?;
    let failed = |source: std::io::Error| {
        let path = output.to_owned();
        match source.kind() {
            std::io::ErrorKind::AlreadyExists => ExportError::Exists { path },
            _ => ExportError::Write { path, source },
        }
    };
    if is_same(log, output) {
        return Err(ExportError::Itself { path: output.to_owned() });
    }
    // What is to be replaced stays until all of the new is there.
    let draft = atomic_file::draft(output);
    let target = if replace { &draft } else { output };
    let file = if replace { atomic_file::create(target) } else { File::create_new(target) }.map_err(failed)?;
    let written = write(&mut reader, file, format, failed).and_then(|rows| {
        if replace {
            std::fs::rename(target, output).map_err(failed)?;
        }
        Ok(rows)
    });
    if written.is_err() {
        // A part would pass for the whole. The error that is on its way says more than one of the removal could.
        let _ = std::fs::remove_file(target);
    }
    Ok(Exported { rows: written?, condition: reader.condition().unwrap_or(Condition::Damaged) })
}

/// Writes every row; answers how many.
fn write(
    reader: &mut Reader,
    file: File,
    format: Format,
    failed: impl Fn(std::io::Error) -> ExportError,
) -> Result<u64, ExportError> {
    let file = BufWriter::new(file);
    let mut sink: Box<dyn Sink> = match format {
        Format::Csv => Box::new(Csv::new(file).map_err(&failed)?),
        Format::Tum => Box::new(Tum(file)),
        #[cfg(feature = "parquet")]
        Format::Parquet => Box::new(parquet::Table::new(file).map_err(&failed)?),
    };
    let mut rows = 0;
    for message in reader.by_ref() {
        rows += u64::from(sink.row(&message?).map_err(&failed)?);
    }
    sink.finish().map_err(failed)?;
    Ok(rows)
}

/// Whether two paths name one file, through links too.
fn is_same(one: &Path, other: &Path) -> bool {
    let id = |path: &Path| std::fs::metadata(path).map(|meta| (meta.dev(), meta.ino()));
    matches!((id(one), id(other)), (Ok(one), Ok(other)) if one == other)
}

struct Csv<W: Write>(csv::Writer<W>);

impl<W: Write> Csv<W> {
    fn new(target: W) -> std::io::Result<Self> {
        let mut writer = csv::Writer::from_writer(target);
        writer.write_record(columns::COLUMNS.iter().map(|column| column.name))?;
        Ok(Self(writer))
    }
}

impl<W: Write> Sink for Csv<W> {
    fn row(&mut self, message: &Message) -> std::io::Result<bool> {
        let Body::Telemetry(telemetry) = &message.body else { return Ok(false) };
        self.0.write_record(columns::COLUMNS.iter().map(|column| (column.cell)(message, telemetry).to_string()))?;
        Ok(true)
    }

    fn finish(mut self: Box<Self>) -> std::io::Result<()> {
        self.0.flush()
    }
}

struct Tum<W: Write>(W);

impl<W: Write> Sink for Tum<W> {
    fn row(&mut self, message: &Message) -> std::io::Result<bool> {
        let Body::Telemetry(telemetry) = &message.body else { return Ok(false) };
        let Some(q) = &telemetry.attitude else { return Ok(false) };
        let (seconds, nanos) = (message.log_time_ns / 1_000_000_000, message.log_time_ns % 1_000_000_000);
        writeln!(self.0, "{seconds}.{nanos:09} 0 0 0 {:.9} {:.9} {:.9} {:.9}", q.x, q.y, q.z, q.w)?;
        Ok(true)
    }

    fn finish(mut self: Box<Self>) -> std::io::Result<()> {
        self.0.flush()
    }
}
