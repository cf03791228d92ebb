//! The files that go into an archive: the session's, and those generated from it.

use super::reading;
use super::readme::{self, About};
use crate::export::{Format, export_session};
use crate::figure::{self, COLUMN_MM, Subject};
use crate::plan::Plan;
use crate::progress::Progress;
use crate::report::{self, Kind};
use crate::session::{MANIFEST, Session, TrialState};
use crate::text;
use crate::trial::LogFinding;
use page::PageError;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// A file in the archive.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Entry {
    /// Its name there, with `/` between folders.
    pub name: String,
    /// The file with its content.
    pub file: PathBuf,
    /// Its description.
    pub about: String,
}

impl Entry {
    /// Returns its media type.
    pub fn media_type(&self) -> &'static str {
        match self.extension() {
            "mcap" => "application/x-mcap",
            "toml" => "application/toml",
            "csv" => "text/csv",
            "svg" => "image/svg+xml",
            "html" => "text/html",
            "md" => "text/markdown",
            "txt" => "text/plain",
            "json" => "application/json",
            "jpg" | "jpeg" => "image/jpeg",
            "png" => "image/png",
            "pdf" => "application/pdf",
            _ => "application/octet-stream",
        }
    }

    /// Returns the part of its name behind the last point.
    pub fn extension(&self) -> &str {
        self.name.rsplit_once('.').map_or("", |(_, extension)| extension)
    }
}

/// The files, and the findings and notes about them.
#[derive(Debug, Default)]
pub(super) struct Content {
    /// Folder of the generated files.
    pub made: PathBuf,
    pub entries: Vec<Entry>,
    pub findings: Vec<LogFinding>,
    pub notes: Vec<String>,
    pub is_sound: bool,
}

impl Content {
    /// Makes the page, tables and figures of a session in the folder `made`, and lists all files.
    pub fn of(session: &Session, made: &Path, about: &About, progress: &Progress) -> miette::Result<Self> {
        let mut content = Self { made: made.to_owned(), is_sound: true, ..Self::default() };
        content.add_inputs(session.plan())?;
        content.add_session(session.folder())?;
        progress.phase("pack", "page");
        content.add_page(session.folder())?;
        progress.phase("pack", "tables");
        content.add_tables(session.folder())?;
        progress.phase("pack", "figures");
        let states = session.intact_states()?;
        content.add_figures(session.folder(), &states)?;
        let readme = readme::text(session, &states, about, &content.notes);
        content.add_text("README.md", &readme, "What this archive contains, and the results")?;
        if about.license.is_empty() {
            let note = "no licence is stated: repositories ask for one, such as --license CC-BY-4.0";
            content.notes.push(note.to_owned());
        }
        Ok(content)
    }

    /// Adds a file of this text.
    pub fn add_text(&mut self, name: &str, text: &str, about: &str) -> miette::Result<()> {
        let file = self.made.join(name);
        fs::write(&file, text).map_err(reading(&file))?;
        self.add(name, file, about);
        Ok(())
    }

    fn add(&mut self, name: impl Into<String>, file: PathBuf, about: impl Into<String>) {
        self.entries.push(Entry { name: name.into(), file, about: about.into() });
    }

    fn add_inputs(&mut self, plan: &Plan) -> miette::Result<()> {
        self.add_text("plan.toml", &plan.text, "The plan of the trials")?;
        let (robot, which) = (&plan.robot, text::line(&plan.robot.name));
        let text = match robot.text.as_str() {
            "" => toml::to_string(&robot.parse()?).unwrap_or_default(),
            text => text.to_owned(),
        };
        self.add_text("robot.toml", &text, &format!("Parameters of the robot: {which}"))?;
        match &plan.sensor {
            Some(sensor) => self.add_text("sensor.toml", &sensor.text, "What was measured of the sensor"),
            None => Ok(()),
        }
    }

    /// Adds the files in the session's folder. Folders are left out, and links, which may lead to any file.
    fn add_session(&mut self, folder: &Path) -> miette::Result<()> {
        let mut left_out = Vec::new();
        let mut files = BTreeMap::new();
        for file in fs::read_dir(folder).map_err(reading(folder))? {
            let file = file.map_err(reading(folder))?;
            let name = file.file_name().to_string_lossy().into_owned();
            let is_file = file.file_type().map_err(reading(&file.path()))?.is_file();
            if is_file { _ = files.insert(name, file.path()) } else { left_out.push(name) }
        }
        for (name, path) in files {
            let about = match name.as_str() {
                MANIFEST => "The session: its plan, and the program that started it",
                name if name.ends_with(".mcap") => "The log of a trial",
                _ => "A file in the session's folder",
            };
            self.add(format!("session/{name}"), path, about);
        }
        if !left_out.is_empty() {
            left_out.sort();
            self.notes.push(format!("left out, as no files: {}", text::listed(&left_out)));
        }
        Ok(())
    }

    fn add_page(&mut self, folder: &Path) -> miette::Result<()> {
        let file = self.made.join("report.html");
        let written = report::write(folder, Kind::Report, None, Vec::new(), Some(&file))?;
        self.is_sound = written.warnings == 0;
        self.findings = written.findings;
        self.add("report.html", file, "The session as a page to open in a browser");
        Ok(())
    }

    fn add_tables(&mut self, folder: &Path) -> miette::Result<()> {
        let tables = export_session(folder, &self.made.join("tables"), Format::Csv, false)?;
        let damaged = |log| format!("{log}: cut off or damaged; the table has what can be read");
        self.notes.extend(tables.damaged.iter().map(damaged));
        for file in tables.files {
            let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let about = match name.as_str() {
                "trials.csv" => "The steady angles of all trials with their uncertainties",
                "budget.csv" => "The causes of these uncertainties",
                _ => "A trial over time",
            };
            self.add(format!("tables/{name}"), file, about);
        }
        Ok(())
    }

    fn add_figures(&mut self, session: &Path, states: &[TrialState]) -> miette::Result<()> {
        let folder = self.made.join("figures");
        fs::create_dir(&folder).map_err(reading(&folder))?;
        for (state, log) in states.iter().filter_map(|state| Some((state, state.complete()?))) {
            let name = format!("{}.svg", state.trial.name);
            let subject = Subject { path: &log.path, number: None };
            let drawn = figure::trial(subject, None, false, None, COLUMN_MM);
            match drawn.and_then(|figure| figure.write(&folder.join(&name))) {
                Ok(()) => {
                    self.add(format!("figures/{name}"), folder.join(&name), "Yaw, pitch and roll of a trial over time")
                }
                Err(PageError::Nothing { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        let map = folder.join("map.svg");
        match figure::map(session, None, false, &[], COLUMN_MM).and_then(|figure| figure.write(&map)) {
            Ok(()) => self.add("figures/map.svg", map, "The steady angles over both speeds"),
            // Most sessions have too few speeds.
            Err(PageError::NoMap { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        Ok(())
    }
}
