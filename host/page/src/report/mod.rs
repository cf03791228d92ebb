//! The report of a trial or a session: a single self-contained HTML file to open from disk, send and print.
//!
//! The charts are drawn by [uPlot](https://github.com/leeoniya/uPlot) 1.6.32 (MIT), which is in `assets` as published:
//! 51 kB of a page of at most 10 MB. The view of the robot is drawn by WebGL 2, or as lines in a browser without it.
//!
//! All text from a log or a plan is escaped; `document::page` describes the second defence.

mod budget;
mod curves;
mod document;
mod errors;
mod facts;
mod heat_map;
mod live_page;
mod parameters;
mod repeats;
mod ribbon;
mod scroll;
mod session_page;
pub(crate) mod shapes;
mod stage;
mod sweep_page;
mod sweep_plan;
mod table;
mod text;
mod trial_section;
mod view;

pub use budget::ByteBudget;
pub use live_page::{live_maps, live_page};
pub use view::View;

use crate::{PageError, swept};
use biflag_log::LogError;
use maud::{Markup, PreEscaped, html};
use rayon::prelude::*;
use serde::Serialize;
use session_page::{Row, RowState};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use study::output;
use study::program::GIT_HASH;
use study::session::{Attempt, Session, SessionError, TrialState};
use study::text::printable;
use study::trial::{LogFinding, Want};
use study::twin::{SessionComparison, Skipped};
use view::Warning;

/// Largest number of trials of a session that are all printed; of a larger session, only the open trial is printed.
const MAX_PRINTED: usize = 20;

/// A written page.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Written {
    /// The file.
    #[serde(serialize_with = "study::text::path")]
    pub html: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// Number of trials that it shows.
    pub trials: usize,
    /// Number of warnings that it shows, without its notes.
    pub warnings: usize,
    /// Findings about the logs that it shows, and about those that it leaves out.
    pub findings: Vec<LogFinding>,
}

/// The kind of a page. The two kinds have different names, so that neither page replaces the other.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// A log or a session by itself: `LOG.html`, or `report.html` in the session's folder.
    Report,
    /// Beside a model or another session: `LOG.compare.html`, or `compare.html` in the session's folder.
    Comparison,
}

impl Kind {
    /// Returns the page's default path.
    fn place(self, path: &Path) -> PathBuf {
        match (self, path.is_dir()) {
            (Self::Report, true) => path.join("report.html"),
            (Self::Comparison, true) => path.join("compare.html"),
            (Self::Report, false) => path.with_extension("html"),
            (Self::Comparison, false) => path.with_extension("compare.html"),
        }
    }
}

/// Returns what to read of a log for a page within this budget.
pub fn want(budget: ByteBudget) -> Want {
    Want { forces: true, shapes: budget.frames(), ..Want::default() }
}

/// Returns the budget of each trial on the page of a log or session.
///
/// # Errors
/// [`SessionError`].
pub fn budget(path: &Path) -> Result<ByteBudget, SessionError> {
    let trials = if path.is_dir() { with_logs(&Session::open(path)?.states()?) } else { 1 };
    Ok(ByteBudget::of_trials(trials))
}

fn with_logs(states: &[TrialState]) -> usize {
    states.iter().filter(|state| !state.attempts.is_empty()).count()
}

/// Writes the page of a log, of a session folder, or of the table of a sweep.
///
/// `comparison` and `views` are the results of a comparison, if there is one; other trials are read from their logs.
///
/// # Errors
/// [`PageError`].
pub fn write(
    path: &Path,
    kind: Kind,
    comparison: Option<&SessionComparison>,
    views: Vec<View>,
    out: Option<&Path>,
) -> Result<Written, PageError> {
    let out = out.map_or_else(|| kind.place(path), Path::to_owned);
    check(&out)?;
    if let Some(table) = swept::table_of(path) {
        let (page, trials) = sweep_page::page(&table)?;
        return put(&out, &page, [trials, 0], Vec::new());
    }
    if path.is_dir() { of_session(&Session::open(path)?, comparison, views, &out) } else { of_log(path, views, &out) }
}

fn of_log(log: &Path, views: Vec<View>, out: &Path) -> Result<Written, PageError> {
    let view = views.into_iter().next().map_or_else(|| view(&Attempt::of_log(log), ByteBudget::of_trials(1)), Ok)?;
    put(out, &page_of_log(&view), [1, graves(&view)], view.findings)
}

/// Returns the page of a log as text, within the budget of a page with `trials` trials.
///
/// # Errors
/// [`LogError`].
pub fn html(log: &Path, trials: usize) -> Result<String, LogError> {
    Ok(printable(&page_of_log(&view(&Attempt::of_log(log), ByteBudget::of_trials(trials))?).0))
}

fn page_of_log(view: &View) -> Markup {
    let id = session_page::anchor(0);
    let body = html! {
        main { (trial_section::section(view, &id, None)) }
        (footer(view))
    };
    document::page(&trial_section::title(view), "one", &body, &data(view, &id, None))
}

fn of_session(
    session: &Session,
    comparison: Option<&SessionComparison>,
    views: Vec<View>,
    out: &Path,
) -> Result<Written, PageError> {
    let states = session.intact_states()?;
    let budget = ByteBudget::of_trials(with_logs(&states));
    let row = |state: &TrialState| row(state, comparison, &views, budget);
    let rows: Vec<Row> = states.par_iter().map(row).collect();
    let shown = || rows.iter().enumerate().filter_map(|(i, row)| Some((session_page::anchor(i), row.view()?)));
    let of_session = session_page::Session {
        folder: session.folder(),
        plan: session.plan(),
        rows: &rows,
        comparison,
        has_charts: budget.is_enough(),
    };
    let body = html! {
        header {
            (of_session.header())
            @if shown().count() > MAX_PRINTED {
                p.meta.paper-only { "Of the trials, only one that is open on the screen is printed." }
            }
        }
        main {}
        aside { (of_session.rest()) }
        @if let Some((_, view)) = shown().next() { (footer(view)) }
    };
    let headline = comparison.map(SessionComparison::headline).unwrap_or_default();
    let mut benches: Vec<String> = Vec::new();
    let with_section = |(id, view): (String, &View)| {
        let bench = trial_section::bench(view).0;
        if !benches.contains(&bench) {
            benches.push(bench.clone());
        }
        let number = benches.iter().position(|other| *other == bench).unwrap_or_default();
        data(view, &id, Some((&headline, number)))
    };
    let with_sections: Vec<Markup> = shown().map(with_section).collect();
    let all_data = html! {
        script type="application/json" id="benches" { (PreEscaped(text::json_for_script(&benches.into()))) }
        @for data in with_sections { (data) }
    };
    let prints_all = if shown().count() <= MAX_PRINTED { " print-all" } else { "" };
    let opens_first = if of_session.opens_first() { " opens-first" } else { "" };
    let kind = format!("session{prints_all}{opens_first}");
    let page = document::page(&text::clip(&session.plan().name, 200), &kind, &body, &all_data);
    let unreadable = rows.iter().filter(|row| matches!(row.state, RowState::Unreadable(_))).count();
    let left_out = states.iter().flat_map(|state| &state.left_out).cloned();
    let of_views = shown().flat_map(|(_, view)| view.findings.clone());
    let mut findings: Vec<LogFinding> = of_views.chain(left_out).chain(session.missing(&states)).collect();
    // A model may be the other side of several repeats.
    let mut seen = std::collections::HashSet::new();
    findings.retain(|one| seen.insert((one.log.clone(), one.finding.to_string())));
    let warnings = unreadable + shown().map(|(_, view)| graves(view)).sum::<usize>();
    put(out, &page, [shown().count(), warnings], findings)
}

/// Returns a trial as a row of its session's page.
fn row(state: &TrialState, comparison: Option<&SessionComparison>, views: &[View], budget: ByteBudget) -> Row {
    let trial = &state.trial;
    let skipped = comparison.and_then(|comparison| comparison.skipped.iter().find(|one| one.name == trial.name));
    let known = |attempt: &Attempt| views.iter().find(|view| view.log == attempt.path).cloned();
    let view = state.best().map(|attempt| known(attempt).map_or_else(|| view(attempt, budget), Ok));
    let state = match view {
        None if !state.left_out.is_empty() => RowState::Unreadable(
            state.left_out.iter().map(|of_log| of_log.finding.to_string()).collect::<Vec<_>>().join("; "),
        ),
        None => RowState::Missing,
        Some(Ok(mut view)) => {
            let why = |skipped: &Skipped| format!("Not compared: {}.", text::clip(&skipped.reason, 300));
            view.warnings.extend(skipped.map(|skipped| Warning::new("not compared", why(skipped))));
            view.warnings.extend(state.left_out.iter().map(|of_log| Warning::of(&of_log.finding, None)));
            RowState::Shown(Box::new(view))
        }
        Some(Err(error)) => RowState::Unreadable(error.to_string()),
    };
    let speeds_rpm = match &state {
        // The plan of a steered trial has only the feed-forward.
        RowState::Shown(view) if view.records.steer.is_some() => view.speeds_rpm,
        _ => trial.final_speeds().map(|speed| speed.rpm()),
    };
    Row { name: trial.name.clone(), speeds_rpm, state }
}

/// Reads a log for the page.
fn view(log: &Attempt, budget: ByteBudget) -> Result<View, LogError> {
    Ok(View::new(&log.read(want(budget))?, None, budget))
}

/// Returns the data of a trial. The section of a session's trial is stored as text: a browser needs longer for the elements of
/// many trials than for everything else, and the reader opens few of them.
fn data(view: &View, id: &str, session: Option<(&str, usize)>) -> Markup {
    if view.data.is_null() {
        return html! {};
    }
    let mut data = view.data.clone();
    if session.is_some() {
        data["section"] = trial_section::section(view, id, session).0.into();
    }
    html! {
        script type="application/json" id=(trial_section::data_id(id)) data-trial=[session.map(|_| id)] {
            (PreEscaped(text::json_for_script(&data)))
        }
    }
}

fn footer(view: &View) -> Markup {
    let zero = if let Some(comparison) = &view.comparison {
        let [own, other] = comparison.sides.names();
        &format!("Both attitudes are relative to the still phase before the run. Errors are {other} minus {own}.")
    } else if view.is_model() {
        "The robot of the model starts upright with a yaw of zero."
    } else if !view.is_recorded() {
        "Angles are relative to the last second before the run. Without a rest, the yaw is zero where the run starts."
    } else {
        "Yaw is zero at the end of the phase before the run. The drift of the gyroscope is removed if still \
         phases allow its estimation."
    };
    html! {
        footer {
            p {
                "The attitude is the rotation Rz(ψ) Ry(θ) Rx(φ) from body to world axes, with yaw ψ, pitch θ and roll \
                 φ; the tilt β is the angle between the robot’s axis and the vertical. Positive yaw is \
                 counter-clockwise seen from above. Steady values are means over whole turns of the flagella in about \
                 the last 12 s of the run. "
                (zero)
            }
            p { "Written by " (document::GENERATOR) " (" (GIT_HASH) "). Charts by uPlot 1.6.32, © 2022 Leon Sorokin, MIT licence." }
        }
    }
}

/// Checks that a page may be written to `out`: the path is free, or has an older page.
fn check(out: &Path) -> Result<(), PageError> {
    match std::fs::symlink_metadata(out) {
        Err(_) => Ok(()),
        Ok(found) if found.is_file() && is_page(out).unwrap_or(false) => Ok(()),
        Ok(_) => {
            let reason = "already exists and is not a report of biflag";
            Err(PageError::wrong_use(out, reason, "name another file with --out"))
        }
    }
}

fn is_page(path: &Path) -> std::io::Result<bool> {
    let mut head = Vec::new();
    std::fs::File::open(path)?.take(400).read_to_end(&mut head)?;
    Ok(String::from_utf8_lossy(&head).contains(r#"<meta name="generator" content="biflag "#))
}

fn graves(view: &View) -> usize {
    view.warnings.iter().filter(|warning| warning.is_grave).count()
}

/// Writes a page with these numbers of trials and warnings.
fn put(
    out: &Path,
    page: &Markup,
    [trials, warnings]: [usize; 2],
    findings: Vec<LogFinding>,
) -> Result<Written, PageError> {
    // Texts of plans and logs may contain any characters.
    let text = printable(&page.0);
    output::replace(out, |file| file.write_all(text.as_bytes()))?;
    Ok(Written { html: out.to_owned(), bytes: text.len() as u64, trials, warnings, findings })
}

#[cfg(test)]
mod tests;
