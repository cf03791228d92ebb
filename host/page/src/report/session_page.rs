//! The page of a session: its results as a whole, its maps, and the table of its trials.

use super::facts::files;
use super::heat_map::{self, Map, Point};
use super::repeats;
use super::text::{clip, count, number, plain};
use super::trial_section::{answer, test, tile, warnings};
use super::view::{ModelRobot, View};
use biflag_log::LinkStats;
use maud::{Markup, html};
use std::path::Path;
use study::plan::Plan;
use study::run::model::note_on_phases;
use study::statistics::each_once;
use study::text::{capitalised, word};
use study::trial::{AtSpeeds, mean_of_repeats, scatter_of_repeats};
use study::twin::SessionComparison;

/// Largest number of trials of a session whose page opens the first of them.
pub(super) const OPENS_FIRST: usize = 8;

/// A trial of a session.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// Its name in the plan.
    pub name: String,
    pub speeds_rpm: [f64; 2],
    pub state: RowState,
}

/// State of a trial on the page.
#[derive(Clone, Debug)]
pub(super) enum RowState {
    /// It is on the page.
    Shown(Box<View>),
    /// It has no log yet.
    Missing,
    /// Its log cannot be read, for this reason.
    Unreadable(String),
}

impl Row {
    pub fn view(&self) -> Option<&View> {
        if let RowState::Shown(view) = &self.state { Some(view) } else { None }
    }
}

/// Returns the anchor of the `i`-th trial.
pub(super) fn anchor(i: usize) -> String {
    format!("trial-{}", i + 1)
}

/// Describes in a few words whether a trial differs from the other side of its comparison.
fn verdict(view: &View, session: Option<&SessionComparison>) -> Option<&'static str> {
    let trial = session?.trials.iter().find(|trial| trial.name == view.name)?;
    match (trial.differences.is_empty(), trial.transients_agree()) {
        (false, _) if trial.is_beyond_chance => Some("differs, beyond chance"),
        (false, _) => Some("differs"),
        (true, false) => Some("transient differs"),
        (true, true) => None,
    }
}

/// The session as a whole: in a session of few trials below the trial that is open, otherwise above it.
#[derive(Clone, Copy)]
pub(super) struct Session<'a> {
    pub folder: &'a Path,
    pub plan: &'a Plan,
    pub rows: &'a [Row],
    pub comparison: Option<&'a SessionComparison>,
    pub has_charts: bool,
}

impl Session<'_> {
    fn views(&self) -> Vec<&View> {
        self.rows.iter().filter_map(Row::view).collect()
    }

    /// Returns whether the page opens the first trial.
    pub fn opens_first(&self) -> bool {
        self.has_charts && self.views().len() <= OPENS_FIRST
    }

    /// Returns title and answer. The results and the table of a session of many trials follow; a session of few trials continues
    /// with its first trial, so that the page opens on the robot.
    pub fn header(&self) -> Markup {
        let Self { folder, plan, rows, comparison, .. } = *self;
        let first = self.views().first().copied();
        html! {
            @if self.opens_first() { a.skip href="#trials" { "Skip to the table of the trials" } }
            h1 { (clip(&plan.name, 200)) }
            p.meta {
                span { "session of " (count(rows.len(), "trial", "trials")) }
                @if !plan.operator.is_empty() { span { (clip(&plan.operator, 200)) } }
                span { "robot " (clip(&plan.robot.name, 200)) }
                @if let Some(ModelRobot { robot, model, .. }) = first.and_then(|view| view.model_robot.as_ref()) {
                    span { "compared with the model of robot " (clip(&robot.name, 200)) ", closure " (word(&model.closure)) }
                }
                span { (folder.display()) }
            }
            @if !plan.note.is_empty() { p.note { (clip(&plan.note, 4_000)) } }
            @if let Some(comparison) = comparison {
                (answer(&comparison.headline(), comparison.agrees()))
                // The verdict on a single trial is below.
                @if comparison.trials.len() > 1 { (test(&comparison.verdict)) }
            }
            @if !self.opens_first() {
                h2.unseen { "The session" }
                (self.summary())
                (self.distribution())
                (self.trials())
            }
        }
    }

    /// Returns the table of all trials. On paper it comes before the trials: `page.js` moves it there.
    fn trials(&self) -> Markup {
        html! {
            section.overview aria-labelledby="trials" {
                h2 #trials { "Trials" }
                (table(self.rows, self.comparison, self.has_charts))
            }
        }
    }

    /// Returns the part below the open trial: table and results of a session of few trials, and files and parameters.
    pub fn rest(&self) -> Markup {
        html! {
            @if self.opens_first() { (self.trials()) h2 { "The session" } (self.summary()) (self.distribution()) }
            @if let Some(view) = self.views().first() { (files(view)) }
        }
    }

    /// Returns the session in a few numbers, its problems, and remarks.
    fn summary(&self) -> Markup {
        let (problems, mut remarks) = notes(self.rows, self.comparison, self.has_charts);
        if self.comparison.is_none() && !self.views().is_empty() && self.views().iter().all(|view| view.is_model()) {
            let note = note_on_phases(&self.plan.trials, std::iter::empty());
            remarks.extend(note.map(|note| format!("{}.", capitalised(&note))));
        }
        html! {
            (tiles(&self.views(), self.rows.len(), self.comparison))
            (warnings(true, problems.iter().map(String::as_str)))
            (warnings(false, remarks.iter().map(String::as_str)))
        }
    }

    /// Returns these maps over the speeds, and the scatter of repeats.
    fn distribution(&self) -> Markup {
        let (views, maps) = (self.views(), maps(self.rows));
        html! {
            @if !maps.is_empty() {
                h2 { "Steady attitude over both speeds" }
                div.maps { @for map in &maps { (map) } }
            }
            (repeats::section(&scatter_of_repeats(views.iter().filter_map(|view| view.repeat.as_ref()))))
        }
    }
}

fn tiles(views: &[&View], trials: usize, comparison: Option<&SessionComparison>) -> Markup {
    let mut link = LinkStats::default();
    views.iter().for_each(|view| link += view.link);
    let complete = views.iter().filter(|view| view.is_complete).count();
    let error = |value: Option<f64>| number(value.unwrap_or(f64::NAN), 2) + "°";
    html! {
        dl.tiles {
            (tile("Trials complete", &complete.to_string(), &html! { "of " (trials) }))
            @if let Some(comparison) = comparison {
                (tile("RMS error, yaw", &error(comparison.yaw_rmse_deg), &html! { "over the runs of " (count(comparison.trials.len(), "trial", "trials")) }))
                (tile("RMS error, pitch", &error(comparison.pitch_rmse_deg), &html! { "roll " (error(comparison.roll_rmse_deg)) }))
                @if let Some(steady) = comparison.steady_rms_error_deg {
                    (tile("Steady error, yaw", &error(Some(steady[0])), &html! { "pitch " (error(Some(steady[1]))) ", RMS over the trials" }))
                }
            }
            @if views.iter().any(|view| view.is_recorded()) {
                (tile("Frames lost", &link.lost.to_string(), &html! { "of " (link.samples + link.lost) " frames; " (count(link.retries, "retry", "retries")) }))
            } @else if views.iter().all(|view| view.is_model()) {
                (tile("Samples", &link.samples.to_string(), &html! { "computed by the model" }))
            }
        }
    }
}

/// Problems of the session as a whole, and remarks.
fn notes(rows: &[Row], comparison: Option<&SessionComparison>, has_charts: bool) -> (Vec<String>, Vec<String>) {
    let all = count(rows.len(), "trial", "trials");
    let note = |what: &str, n: usize, more: &str| (n > 0).then(|| format!("{what}: {n} of {all}.{more}"));
    let views = || rows.iter().filter_map(Row::view);
    let skipped = comparison.map_or(0, |comparison| comparison.skipped.len());
    let problems = [
        note("No log yet", rows.iter().filter(|row| matches!(row.state, RowState::Missing)).count(), ""),
        note("Unreadable log", rows.iter().filter(|row| matches!(row.state, RowState::Unreadable(_))).count(), ""),
        note("Not complete", views().filter(|view| !view.is_complete).count(), ""),
        note("Not compared", skipped, " The reasons are in the table."),
    ];
    let more = " Their angles are averages, not steady values.";
    let charts =
        "The session has too many trials for charts on a page. `biflag report LOG` draws the charts of one trial.";
    let other = capitalised(views().find_map(|view| Some(view.comparison.as_ref()?.other)).unwrap_or_default());
    let remarks = [
        note("Not settled", views().filter(|view| !view.is_settled(false)).count(), more),
        note(&format!("{other} not settled"), views().filter(|view| !view.is_settled(true)).count(), more),
        (!has_charts).then(|| charts.to_owned()),
    ];
    (problems.into_iter().flatten().collect(), remarks.into_iter().flatten().collect())
}

/// The maps of a session: the index in [`AtSpeeds::magnitudes_deg`], its name and its symbol.
pub(super) const MAPS: [(usize, &str, &str); 4] =
    [(0, "Steady yaw", "|ψ|"), (1, "Steady pitch", "|θ|"), (2, "Steady roll", "|φ|"), (3, "Steady tilt", "β")];

/// Returns the maps of a session, measured and modelled; none if its speeds make no map.
fn maps(rows: &[Row]) -> Vec<Markup> {
    let means = [false, true].map(|modelled| {
        let trial = |(i, row): (usize, &Row)| {
            let view = row.view().filter(|view| view.is_complete)?;
            // A model without angles has overturned.
            let own = || view.steady_deg().or_else(|| view.is_model().then_some([f64::NAN; 3]));
            let angles = if modelled { view.comparison.as_ref()?.modelled_deg() } else { own()? };
            let anchor = (!view.data.is_null()).then(|| anchor(i));
            Some(AtSpeeds::of_trial(row.speeds_rpm, angles, view.is_settled(modelled), anchor))
        };
        mean_of_repeats(rows.iter().enumerate().filter_map(trial))
    });
    let points = |angle: usize, modelled: bool| -> Vec<Point> {
        let means = means[usize::from(modelled)].iter();
        let point = |mean: &AtSpeeds<Option<String>>| Point {
            speeds_rpm: mean.speeds_rpm,
            value_deg: mean.magnitudes_deg()[angle],
            is_settled: mean.is_settled,
            anchor: mean.first.clone(),
        };
        means.map(point).collect()
    };
    if !heat_map::is_map(&points(0, false)) {
        return Vec::new();
    }
    let views = || rows.iter().filter_map(Row::view);
    let own = views().next().map_or("measured", View::own_name);
    let other = views().find_map(View::other_name).unwrap_or("model");
    let has_repeats = means[0].iter().any(|mean| mean.trials > 1);
    let of_repeats = if has_repeats { " Repeated trials: the magnitude of their mean." } else { "" };
    let map = |(angle, name, symbol): (usize, &str, &str)| {
        let both = [points(angle, false), points(angle, true)];
        // The maps of an angle share their colour scale.
        let scale_deg = both.iter().map(|points| heat_map::largest(points)).fold(0.0, f64::max);
        let there = both.into_iter().zip([own, other]).filter(|(points, _)| !points.is_empty());
        let drawn = there.map(|(points, whose)| {
            let title = format!("{name} {symbol}, {whose}");
            let map = Map { title: &title, symbol, points: &points, scale_deg };
            html! {
                figure {
                    div.head { h3 { (title) } }
                    (map.svg())
                    figcaption { (map.caption()) (of_repeats) }
                }
            }
        });
        drawn.collect::<Vec<Markup>>()
    };
    MAPS.into_iter().flat_map(map).collect()
}

/// Returns a cell with a number and its sorting key.
fn cell(value: Option<f64>, decimals: usize) -> Markup {
    html! { td data-key=[value.filter(|value| value.is_finite())] { (value.map_or("–".to_owned(), |value| number(value, decimals))) } }
}

/// The optional columns of the table.
#[derive(Clone, Copy)]
struct Columns {
    charts: bool,
    uncertainty: bool,
    /// Whether the trials are compared with others.
    compared: bool,
    link: bool,
}

fn table(rows: &[Row], comparison: Option<&SessionComparison>, has_charts: bool) -> Markup {
    let any = |what: fn(&View) -> bool| rows.iter().filter_map(Row::view).any(what);
    let columns = Columns {
        charts: has_charts,
        uncertainty: any(|view| view.uncertainties_deg()[0].is_some()),
        compared: any(|view| view.comparison.is_some()),
        link: any(View::is_recorded),
    };
    let head = |text: &str| html! { th scope="col" { button type="button" { (text) } } };
    html! {
        div.scroll.long[rows.len() > OPENS_FIRST] tabindex="0" role="region" aria-label="Table of the trials" {
            table.trials {
                thead { tr {
                    th scope="col" { button type="button" { "Trial" } }
                    (head("w1, rpm")) (head("w2, rpm"))
                    (head("ψ, °")) @if columns.uncertainty { (head("± 95 % of ψ")) } (head("θ, °")) (head("φ, °"))
                    @if columns.compared {
                        // A verdict refers to these columns; the other side's own angles are on the page of the trial.
                        @for head_of in ["error", "RMS"] { @for angle in ["ψ", "θ", "φ"] { (head(&format!("{head_of} {angle}"))) } }
                    }
                    @if columns.link { (head("lost")) }
                    th.text scope="col" { "Notes" }
                } }
                tbody { @for (i, row) in rows.iter().enumerate() { (line(row, i, comparison, columns)) } }
            }
        }
    }
}

/// Returns the verdict and the warnings of a trial in a few words each, without repetitions.
fn briefs(view: &View, verdict: Option<&'static str>) -> String {
    each_once(verdict.into_iter().chain(view.warnings.iter().map(|warning| warning.brief.as_str()))).join(", ")
}

fn line(row: &Row, i: usize, session: Option<&SessionComparison>, columns: Columns) -> Markup {
    let anchor = anchor(i);
    let view = row.view();
    let angle = |k: usize| Some(view?.steady_deg()?[k]);
    let comparison = view.and_then(|view| view.comparison.as_ref());
    html! {
        tr data-trial=(anchor) {
            td data-key=(i) {
                @if columns.charts && view.is_some() { a href={ "#" (anchor) } { (clip(&row.name, 80)) } } @else { (clip(&row.name, 80)) }
            }
            td data-key=(row.speeds_rpm[0]) { (plain(row.speeds_rpm[0])) }
            td data-key=(row.speeds_rpm[1]) { (plain(row.speeds_rpm[1])) }
            (cell(angle(0), 2))
            @if columns.uncertainty { (cell(view.and_then(|view| view.uncertainties_deg()[0]), 2)) }
            (cell(angle(1), 2)) (cell(angle(2), 2))
            @if columns.compared {
                @for k in 0..3 { (cell(comparison.map(|c| c.angles[k].error_deg), 2)) }
                @for k in 0..3 { (cell(comparison.map(|c| c.angles[k].rmse_deg), 2)) }
            }
            @if columns.link { (cell(view.map(|view| view.link.lost as f64), 0)) }
            td.text {
                @match &row.state {
                    RowState::Shown(view) => { (briefs(view, verdict(view, session))) }
                    RowState::Missing => { "no log yet" }
                    RowState::Unreadable(why) => { (clip(why, 300)) }
                }
            }
        }
    }
}
