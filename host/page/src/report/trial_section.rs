//! A trial on the page: its results, the view of the robot, its charts, its events and its provenance.

use super::facts::facts;
use super::stage::stage;
use super::text::{clip, count, degrees, number, speeds};
use super::view::View;
use super::{errors, ribbon};
use biflag_log::schema::biflag::event::Kind;
use biflag_log::{Identity, SteadyMeta};
use maud::{Markup, html};
use sim::trial::quantity::{MIN_GAP, SETTLE};
use study::text::{origin, word};

/// The longest note that is shown.
const LONGEST_NOTE: usize = 4_000;

/// Returns the id of the element with the data of a trial.
pub(super) fn data_id(id: &str) -> String {
    format!("{id}-data")
}

/// Returns the view of the robot and the charts, whose data come from the page's script.
pub(super) fn bench(view: &View) -> Markup {
    html! { (stage(view)) div.charts { (charts(view)) } }
}

/// Returns the section of a trial with the anchor `id`. On the page of a session, it leaves out the parts common to all trials,
/// the session's own sentence about its comparison, and the [`bench`], of which it has the number.
pub(super) fn section(view: &View, id: &str, session: Option<(&str, usize)>) -> Markup {
    let (has_data, shared) = (!view.data.is_null(), session.is_some());
    html! {
        section.trial id=(id) data-data=[has_data.then(|| data_id(id))] aria-labelledby={ (id) "-title" } {
            @if shared {
                nav.tools aria-label="Trials" {
                    button.previous type="button" { "← Previous" }
                    button.next type="button" { "Next →" }
                    a href="#trials" { "All trials" }
                }
                h2 id={ (id) "-title" } { (title(view)) }
            } @else {
                h1 id={ (id) "-title" } { (title(view)) }
            }
            (about(view, shared))
            @if let Some(comparison) = &view.comparison {
                @let headline = comparison.headline();
                @if session.is_none_or(|(said, _)| said != headline) { (answer(&headline, comparison.agrees())) }
                (test(&comparison.verdict))
            }
            @let said = |grave: bool| {
                let texts = view.warnings.iter().filter(|warning| warning.is_grave == grave);
                warnings(grave, texts.map(|warning| warning.text.as_str()))
            };
            (said(true))
            @if has_data {
                @match session {
                    Some((_, number)) => { div.bench data-bench=(number) {} }
                    // Below the title of a page, the view and the charts are a part of their own.
                    None => { div.bench { h2.unseen { "Over time" } (bench(view)) } }
                }
            }
            (tiles(view))
            (said(false))
            @if let Some(comparison) = &view.comparison { (errors::table(comparison)) }
            (events(view))
            (facts(view, shared))
        }
    }
}

pub(super) fn title(view: &View) -> String {
    let name = if view.name.is_empty() { "Trial" } else { &view.name };
    format!("{} at {}", clip(name, 120), speeds(view.speeds_rpm))
}

fn about(view: &View, shared: bool) -> Markup {
    let (plan, identity) = (&view.records.plan, &view.records.identity);
    let reversal = view.records.trial.as_ref().and_then(|trial| trial.reverse_motor.zip(trial.reverse_after_s));
    html! {
        p.meta {
            @if let Some(identity) = identity { span { (origin(identity.origin)) } }
            @if let Some(plan) = plan && !shared {
                span { "session " (clip(&plan.name, 200)) }
                @if !plan.operator.is_empty() { span { (clip(&plan.operator, 200)) } }
            }
            @if let Some(Identity { created, .. }) = identity && !created.is_empty() {
                span { (clip(created.split('.').next().unwrap_or(created), 40).replace('T', " ")) }
            }
            span { (number(view.duration_s, 1)) " s" }
            // A trial of a session has no tiles, so on paper these values are only here.
            @let known = ["ψ", "θ", "φ"].into_iter().zip(view.uncertainties_deg()).filter_map(|(name, deg)| Some((name, deg?)));
            @if shared { @for (name, deg) in known { span.paper-only { (name) " ± " (degrees(deg, 2)) } } }
            @if let Some((motor, after_s)) = reversal {
                span { "motor " (motor) " reverses " (number(after_s, 1)) " s after the start of the run" }
            }
        }
        @if let Some(plan) = plan && !shared && !plan.note.is_empty() { p.note { (clip(&plan.note, LONGEST_NOTE)) } }
    }
}

/// Returns a result with its name and a remark.
pub(super) fn tile(name: &str, big: &str, small: &Markup) -> Markup {
    html! {
        div.tile {
            dt { (name) }
            dd.big { (big) }
            dd.small { (small) }
        }
    }
}

fn tiles(view: &View) -> Markup {
    let link = view.link;
    html! {
        dl.tiles {
            @if let Some(angles_deg) = view.steady_deg() {
                @for (i, name) in ["Steady yaw ψ", "Steady pitch θ", "Steady roll φ"].into_iter().enumerate() {
                    (steady_tile(name, view, angles_deg[i], i))
                }
            }
            @if let Some(comparison) = &view.comparison {
                (tile("RMS error over the run", &degrees(comparison.angles[0].rmse_deg, 2), &html! {
                    "yaw; pitch " (degrees(comparison.angles[1].rmse_deg, 2)) ", roll " (degrees(comparison.angles[2].rmse_deg, 2))
                }))
            }
            @if let Some(model) = &view.records.steady {
                (settling(model, &html! { "flagella " (word(&model.bundling)) ", smallest gap " (number(model.values.get(&MIN_GAP) * 1e3, 1)) " mm in the " (model.gap_of()) }))
            }
            @if view.is_recorded() {
                (tile("Frames lost", &link.lost.to_string(), &html! {
                    "of " (link.samples + link.lost) " frames; " (count(link.crc_errors, "CRC error", "CRC errors")) ", " (count(link.retries, "retry", "retries"))
                }))
            }
        }
    }
}

/// Returns the tile of the settling time, or of the kind of motion for a solved steady state.
fn settling(model: &SteadyMeta, note: &Markup) -> Markup {
    match model.kind {
        Some(kind) => tile("Motion", &kind.name().replace('_', " "), note),
        None if model.settled => tile("Settling time", &format!("{} s", number(model.values.get(&SETTLE), 0)), note),
        None => tile("Settling time", "not settled", note),
    }
}

/// Returns the result of a comparison in one plain sentence.
pub(super) fn answer(headline: &str, agrees: bool) -> Markup {
    html! { p.answer.agrees[agrees].differs[!agrees] { (minus(headline)) } }
}

/// Returns the statistical test behind the result.
pub(super) fn test(verdict: &str) -> Markup {
    html! { @if !verdict.is_empty() { p.test { (clip(&minus(&format!("{verdict}.")), 1_000)) } } }
}

/// Returns text with proper minus signs.
fn minus(text: &str) -> String {
    text.replace(" -", " −").replace("(-", "(−")
}

fn steady_tile(name: &str, view: &View, angle: f64, i: usize) -> Markup {
    let spread = view.uncertainties_deg()[i].map(|deg| format!("± {} (95 %)", degrees(deg, 2)));
    tile(
        name,
        &degrees(angle, 2),
        &html! {
            @if let Some(spread) = &spread { (spread) }
            @if let Some(comparison) = &view.comparison {
                @let modelled = comparison.modelled_deg()[i];
                @if spread.is_some() { br; }
                b { (comparison.sides.names()[1]) " " (degrees(modelled, 2)) } ", error " (degrees(modelled - angle, 2))
            } @else if spread.is_none() { "mean at the end of the run" }
        },
    )
}

/// Returns a list of problems (`are_grave`) or of remarks, if there are any.
pub(super) fn warnings<'a>(are_grave: bool, texts: impl IntoIterator<Item = &'a str>) -> Markup {
    let mut texts = texts.into_iter().peekable();
    html! {
        @if texts.peek().is_some() {
            ul.warnings.notices[!are_grave] aria-label=(if are_grave { "Warnings" } else { "Notes" }) {
                @for text in texts { li { (text) } }
            }
        }
    }
}

/// An entry of a legend: the classes of its key, its text, and the curve that it shows and hides.
pub(super) struct Entry(&'static str, String, &'static str);

impl Entry {
    pub fn new(look: &'static str, text: &str, curve: &'static str) -> Self {
        Self(look, text.to_owned(), curve)
    }

    fn range(width_s: Option<f64>) -> Option<Self> {
        width_s.map(|width_s| Self("block c-range", format!("range of {} s (line: mean)", number(width_s, 2)), ""))
    }
}

fn charts(view: &View) -> Markup {
    html! {
        div.tools role="group" aria-label="Time axis" {
            button.zoom-in type="button" aria-label="Zoom in" { "+" }
            button.zoom-out type="button" aria-label="Zoom out" { "−" }
            button.zoom-all type="button" { "Whole trial" }
        }
        (ribbon::figure(&view.data))
        @for (name, error, title) in [
            ("yaw", "error_yaw", "Yaw ψ from the start of the run, ° counter-clockwise"),
            ("pitch", "error_pitch", "Pitch θ, °"),
            ("roll", "error_roll", "Roll φ, °"),
        ] {
            @let charts = if view.comparison.is_some() { vec![name, error] } else { vec![name] };
            (chart(&charts, title, &angle_entries(view, name == "yaw")))
        }
        @let motors: Vec<_> = speed_entries().into_iter().chain(Entry::range(view.curves.motors_range_s)).collect();
        (chart(&["motors"], "Speed of the flagella, rpm", &motors))
        @if view.curves.has_forces { (force_charts(view)) }
        @if view.is_recorded() { (link_chart(view)) }
        p.meta.small {
            @if view.curves.attitude_range_s.is_some() || view.curves.motors_range_s.is_some() {
                "A shaded band is the range of the values in each interval of the length in the legend; the line is \
                 their mean. The values beside the robot are interpolated between samples "
                (number(view.curves.sample_s, 2)) " s apart."
            } @else {
                "The charts show every sample."
            }
            span.screen {
                " Drag across a chart to zoom in, double-click to see the whole trial, click to select a time. \
                 Click an entry of a legend to hide its curve. Tab goes from one group of buttons to the next, arrow \
                 keys go on within a group. The address of the page stores the view."
            }
        }
    }
}

fn angle_entries(view: &View, is_yaw: bool) -> Vec<Entry> {
    let mut entries = vec![Entry::new("c-measured", view.own_name(), "own")];
    entries.extend(view.other_name().map(|other| Entry::new("dash c-model", other, "model")));
    entries.extend(view.has_truth.then(|| Entry::new("dots c-truth", "truth", "truth")));
    entries.extend(Entry::range(view.curves.attitude_range_s));
    if is_yaw && view.curves.has_uncertainty {
        entries.push(Entry::new("edges c-measured", "95 % uncertainty", "uncertainty"));
    }
    let below = |other: &str| Entry::new("c-model", &format!("below: {other} minus {}", view.own_name()), "");
    entries.extend(view.other_name().map(below));
    entries
}

pub(super) fn speed_entries() -> [Entry; 4] {
    [
        Entry::new("c-flagellum1", "flagellum 1", "speed1"),
        Entry::new("c-flagellum2", "flagellum 2", "speed2"),
        Entry::new("dash c-ink", "target 1", "target1"),
        Entry::new("dots c-ink", "target 2", "target2"),
    ]
}

fn force_charts(view: &View) -> Markup {
    let of_model = if view.borrowed_forces { ", model" } else { "" };
    let contact = || [Entry::new("block c-contact", "in contact", "")];
    let range = || Entry::range(view.curves.forces_range_s);
    let with = |curves: Vec<Entry>| -> Vec<Entry> { curves.into_iter().chain(contact()).chain(range()).collect() };
    let forces =
        vec![Entry::new("c-flagellum1", "flagellum 1", "force1"), Entry::new("c-flagellum2", "flagellum 2", "force2")];
    let title = format!("Forces on the base{of_model}: thrust z, below x and y (body axes), mN");
    html! {
        (chart(&["force_z", "force_x", "force_y"], &title, &with(forces)))
        (chart(&["gap"], &format!("Smallest gap of the flagella{of_model}, mm"), &with(vec![Entry::new("c-measured", "smallest gap", "gap")])))
        (chart(&["winding"], &format!("Winding of the flagella around each other{of_model}, turns"), &with(vec![Entry::new("c-measured", "winding", "winding")])))
    }
}

fn link_chart(view: &View) -> Markup {
    let seconds = view.data["link"]["width_s"].as_u64().unwrap_or(1);
    let per = if seconds > 1 { format!("{seconds} s") } else { "second".to_owned() };
    let entries = [
        Entry::new("c-measured", "samples received", "received"),
        Entry::new("block c-bad", "lost", "lost"),
        Entry::new("block c-model", "retries", "retries"),
        Entry::new("block c-flagellum1", "board errors", "board"),
    ];
    chart(&["link"], &format!("Link, count per {per}"), &entries)
}

pub(super) fn chart(names: &[&str], title: &str, entries: &[Entry]) -> Markup {
    html! {
        figure aria-label={ (title) ". The values at the selected time are in the table beside the robot." } {
            figcaption {
                h3 { (title) }
                div.legend {
                    @for Entry(look, text, curve) in entries {
                        @let key = html! { i class={ "key " (look) } {} span { (text) } };
                        @if curve.is_empty() { span { (key) } } @else {
                            button type="button" aria-pressed="true" data-curve=(curve) { (key) }
                        }
                        " "
                    }
                }
            }
            @for name in names { div data-chart=(name) aria-hidden="true" {} }
        }
    }
}

fn events(view: &View) -> Markup {
    let shown = &view.events;
    let bad = shown.iter().any(|event| matches!(event.kind, Kind::Fault | Kind::Warning));
    html! {
        @if !shown.is_empty() {
            details open[bad] {
                summary { "Events (" (shown.len() + view.more_events) ")" }
                table.facts {
                    @for event in shown {
                        tr {
                            th { button.seek type="button" data-seek=(event.time_s) { (number(event.time_s, 2)) " s" } }
                            td { (format!("{:?}", event.kind).to_lowercase()) }
                            td { (clip(&event.text, 300)) }
                        }
                    }
                }
                @if view.more_events > 0 { p.meta { "and " (view.more_events) " more" } }
            }
        }
    }
}
