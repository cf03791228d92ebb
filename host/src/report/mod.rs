//! One page of HTML about a trial or a session: whole in one file, to be opened from disk, sent, and printed.
//!
//! The charts are drawn by [uPlot](https://github.com/leeoniya/uPlot) 1.6.32 (MIT), which stands in `assets` as published:
//! 51 kB, where a page may hold a hundred trials. (The script that the `plotly` crate carries is 4.7 MB, half of what a page may
//! weigh.) The view of the robot is drawn on a plain canvas, which needs no WebGL and prints.
//!
//! Whatever text a log or a plan holds is escaped; see `document::page` for what holds beyond that.

mod document;
mod facts;
mod heat_map;
mod recording;
mod session_page;
mod shapes;
mod table;
mod text;
mod trial_section;
mod view;

use crate::atomic_file;
use crate::log::LogError;
use crate::session::{Session, SessionError, TrialState};
use crate::twin::{Comparison, SessionComparison, Skipped};
use maud::{Markup, PreEscaped, html};
use miette::Diagnostic;
use rayon::prelude::*;
use recording::Recording;
use session_page::{Row, RowState};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;
use view::{Room, View, Warning};

/// What the data of all trials may take of a page, bytes. With the scripts and the texts a page stays below 10 MB.
const DATA_BYTES: usize = 7_500_000;

/// Why there is no page.
#[derive(Error, Diagnostic, Debug)]
pub enum ReportError {
    /// Something else bears the page's name.
    #[error("{}: exists already, and is no report of biflag", path.display())]
    #[diagnostic(code(wrong_use), help("name another file with --out"))]
    NotOurs {
        /// The file.
        path: PathBuf,
    },
    /// It could not be written.
    #[error("{}: cannot be written", path.display())]
    #[diagnostic(help("check that the folder exists, may be written, and has room"))]
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
    /// The session does not read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Session(#[from] SessionError),
}

/// A page that was written.
#[derive(Clone, PartialEq, Debug)]
pub struct Written {
    /// The file.
    pub html: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// How many trials it shows.
    pub trials: usize,
    /// Warnings that stand on it.
    pub warnings: usize,
}

/// The page of a log or of a session's folder, beside what it was compared with, at `out`: by default beside the log, or
/// `report.html` in the session's folder.
///
/// # Errors
/// [`ReportError`].
pub fn write(path: &Path, comparison: Option<&SessionComparison>, out: Option<&Path>) -> Result<Written, ReportError> {
    if path.is_dir() {
        return of_session(&Session::open(path)?, comparison, out);
    }
    let compared = comparison.and_then(|comparison| comparison.trials.iter().find(|trial| trial.measured == path));
    of_log(path, compared, out)
}

fn of_log(log: &Path, comparison: Option<&Comparison>, out: Option<&Path>) -> Result<Written, ReportError> {
    let out = out.map_or_else(|| log.with_extension("html"), Path::to_owned);
    check(&out)?;
    let view = view(log, comparison.cloned(), Room::of(DATA_BYTES, 1))?;
    let id = session_page::anchor(0);
    let body = html! {
        main { (trial_section::section(&view, &id, false)) }
        (footer(&view))
    };
    let page = document::page(&trial_section::title(&view), "one", &body, &data(&view, &id));
    put(&out, &page, 1, view.warnings.len())
}

/// A log that does not read is shown as such.
fn of_session(
    session: &Session,
    comparison: Option<&SessionComparison>,
    out: Option<&Path>,
) -> Result<Written, ReportError> {
    let out = out.map_or_else(|| session.folder().join("report.html"), Path::to_owned);
    check(&out)?;
    let states = session.states()?;
    let room = Room::of(DATA_BYTES, states.len());
    let row = |state: &TrialState| {
        let trial = &state.trial;
        let attempt = state.complete().or(state.attempts.last());
        let compared = attempt
            .and_then(|attempt| comparison?.trials.iter().find(|compared| compared.measured == attempt.path).cloned());
        let skipped = comparison.and_then(|comparison| comparison.skipped.iter().find(|one| one.name == trial.name));
        let state = match attempt {
            None => RowState::Missing,
            Some(attempt) => match view(&attempt.path, compared, room) {
                Ok(mut view) => {
                    let why = |skipped: &Skipped| format!("Not compared: {}.", text::clip(&skipped.reason, 300));
                    view.warnings.extend(skipped.map(|skipped| Warning::new("not compared", why(skipped))));
                    RowState::Shown(Box::new(view))
                }
                Err(error) => RowState::Unreadable(error.to_string()),
            },
        };
        Row { name: trial.name.clone(), speeds_rpm: trial.speeds.map(|speed| speed.rpm()), state }
    };
    let rows: Vec<Row> = states.par_iter().map(row).collect();
    let shown = || rows.iter().enumerate().filter_map(|(i, row)| Some((session_page::anchor(i), row.view()?)));
    let body = html! {
        header { (session_page::overview(session.folder(), session.plan(), &rows, comparison, room.is_enough())) }
        main { @if room.is_enough() { @for (id, view) in shown() { (trial_section::section(view, &id, true)) } } }
        @if let Some((_, view)) = shown().next() { (footer(view)) }
    };
    let all_data = html! { @for (id, view) in shown() { (data(view, &id)) } };
    let page = document::page(&text::clip(&session.plan().name, 200), "session", &body, &all_data);
    put(&out, &page, shown().count(), shown().map(|(_, view)| view.warnings.len()).sum())
}

/// Reads what is to be shown of a log, and of the model's log that it was compared with.
fn view(log: &Path, comparison: Option<Comparison>, room: Room) -> Result<View, LogError> {
    let recording = Recording::read(log, room.frames())?;
    let other = match &comparison {
        // The comparison has the angles; only shapes can be missing.
        Some(comparison) if recording.shapes.is_empty() => Recording::read(&comparison.modelled, room.frames()).ok(),
        _ => None,
    };
    Ok(View::new(recording, other.as_ref(), comparison, room))
}

fn data(view: &View, id: &str) -> Markup {
    html! {
        @if !view.data.is_null() {
            script type="application/json" id=(trial_section::data_id(id)) { (PreEscaped(text::json_for_script(&view.data))) }
        }
    }
}

fn footer(view: &View) -> Markup {
    let zero = if view.comparison.is_some() {
        "Both attitudes start from that of the still phase before the run; errors are model less measured."
    } else {
        "Yaw is counted from the end of the phase before the run, less the drift of the gyroscope where still phases show it."
    };
    html! {
        footer {
            p {
                "Angles turn body axes into world axes: yaw ψ about the vertical, then pitch θ, then roll φ, counter-clockwise seen from \
                 above where positive. Steady values are means over the last 12 s of the run or as much of it as whole turns allow. "
                (zero)
            }
            p { "Written by " (document::GENERATOR) " (" (env!("BIFLAG_GIT_HASH")) "). Charts by uPlot 1.6.32, © 2022 Leon Sorokin, MIT licence." }
        }
    }
}

/// Whether a page may be written there: where nothing is, or an older page.
fn check(out: &Path) -> Result<(), ReportError> {
    let refused = || ReportError::NotOurs { path: out.to_owned() };
    match std::fs::symlink_metadata(out) {
        Err(_) => Ok(()),
        Ok(found) if !found.is_file() => Err(refused()),
        Ok(_) => {
            let mut head = Vec::new();
            let file = std::fs::File::open(out).map_err(|_| refused())?;
            file.take(400).read_to_end(&mut head).map_err(|_| refused())?;
            let head = String::from_utf8_lossy(&head);
            if head.contains(r#"<meta name="generator" content="biflag "#) { Ok(()) } else { Err(refused()) }
        }
    }
}

fn put(out: &Path, page: &Markup, trials: usize, warnings: usize) -> Result<Written, ReportError> {
    let text = &page.0;
    atomic_file::replace(out, |file| file.write_all(text.as_bytes()))
        .map_err(|source| ReportError::Write { path: out.to_owned(), source })?;
    Ok(Written { html: out.to_owned(), bytes: text.len() as u64, trials, warnings })
}

#[cfg(test)]
mod tests;
