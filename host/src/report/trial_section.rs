//! A trial on the page: its figures, the robot in space, its charts, and all that is known of how it was made.

use super::facts::facts;
use super::recording::Event;
use super::text::{clip, degrees, number, speeds, word};
use super::view::{Steady, View};
use crate::log::schema::biflag::event::Kind;
use crate::log::{Identity, Origin};
use maud::{Markup, html};

/// The longest note that is shown.
const LONGEST_NOTE: usize = 4_000;

/// Where the data of a trial is.
pub(super) fn data_id(id: &str) -> String {
    format!("{id}-data")
}

/// The trial as a section of the page, `id` its anchor. With `shared` what all trials of a session have in common is
/// left out.
pub(super) fn section(view: &View, id: &str, shared: bool) -> Markup {
    let has_data = !view.data.is_null();
    html! {
        section.trial id=(id) data-data=[has_data.then(|| data_id(id))] hidden[shared] aria-labelledby={ (id) "-title" } {
            @if shared {
                nav.tools aria-label="Trials" {
                    button.previous type="button" { "← Previous" }
                    button.next type="button" { "Next →" }
                    a href="#trials" { "All trials ↑" }
                }
                h2 id={ (id) "-title" } { (title(view)) }
            } @else {
                h1 id={ (id) "-title" } { (title(view)) }
            }
            (about(view, shared))
            (tiles(view))
            (warnings(view.warnings.iter().map(|warning| warning.text.as_str())))
            @if has_data {
                div.bench {
                    div.stage { (scene(view)) (player(view)) (readout(view)) }
                    div.charts { (charts(view)) }
                }
            }
            (events(view))
            (facts(view, shared))
        }
    }
}

pub(super) fn title(view: &View) -> String {
    let name = if view.name.is_empty() { "A trial" } else { &view.name };
    format!("{} at {}", clip(name, 120), speeds(view.speeds_rpm))
}

fn about(view: &View, shared: bool) -> Markup {
    let (plan, identity) = (&view.overview.plan, &view.overview.identity);
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
            span { (number(view.overview.duration_s, 1)) " s" }
        }
        @if let Some(plan) = plan && !shared && !plan.note.is_empty() { p.note { (clip(&plan.note, LONGEST_NOTE)) } }
    }
}

fn origin(origin: Origin) -> &'static str {
    match origin {
        Origin::Rig => "measured on the rig",
        Origin::VirtualRig => "measured on the emulated board",
        Origin::Model => "computed by the model",
    }
}

/// A figure with its name and what is to be said about it.
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
    let link = view.overview.link;
    let is_model = view.is_model();
    html! {
        dl.tiles {
            @if let Some(steady) = &view.steady {
                @for (i, name) in ["Steady yaw ψ", "Steady pitch θ", "Steady roll φ"].into_iter().enumerate() {
                    (steady_tile(name, steady, i))
                }
            }
            @if let Some(comparison) = &view.comparison {
                (tile("RMS error over the run", &degrees(comparison.yaw_rmse_deg, 2), &html! {
                    "yaw; pitch " (degrees(comparison.pitch_rmse_deg, 2)) ", roll " (degrees(comparison.roll_rmse_deg, 2))
                }))
            }
            @if let Some(model) = &view.overview.steady {
                (tile("Settled", &if model.settled { format!("{} s", number(model.settle_s, 0)) } else { "no".to_owned() },
                    &html! { "closest " (number(model.min_gap_m * 1e3, 1)) " mm, " (word(&model.bundling)) }))
            }
            @if !is_model {
                (tile("Frames lost", &link.lost.to_string(), &html! {
                    "of " (link.samples + link.lost) "; " (link.crc_errors) " CRC errors, " (link.retries) " retries"
                }))
            }
        }
        @if let Some(comparison) = &view.comparison && !comparison.verdict.is_empty() {
            p.verdict { (clip(&comparison.verdict, 600)) }
        }
    }
}

fn steady_tile(name: &str, steady: &Steady, i: usize) -> Markup {
    let angle = steady.angles_deg[i];
    let uncertainty = if i == 0 { steady.yaw_uncertainty_deg.filter(|deg| *deg > 0.0) } else { None };
    let spread = uncertainty.map(|deg| format!("± {} (95 %)", degrees(deg, 2)));
    tile(
        name,
        &degrees(angle, 2),
        &html! {
            @if let Some(spread) = &spread { (spread) }
            @if let Some(modelled) = steady.modelled_deg {
                @if spread.is_some() { br; }
                b { "model " (degrees(modelled[i], 2)) } ", error " (degrees(modelled[i] - angle, 2))
            } @else if spread.is_none() { "mean at the end of the run" }
        },
    )
}

/// Warnings, where there are any.
pub(super) fn warnings<'a>(texts: impl IntoIterator<Item = &'a str>) -> Markup {
    let mut texts = texts.into_iter().peekable();
    html! {
        @if texts.peek().is_some() {
            ul.warnings aria-label="Warnings" { @for text in texts { li { (text) } } }
        }
    }
}

fn scene(view: &View) -> Markup {
    let whose = if view.borrowed_shapes { "the model’s log" } else { "the log" };
    let steady = if view.comparison.is_some() {
        "The blue pointer is the measured yaw, the orange one the model’s."
    } else {
        "The blue pointer is the yaw."
    };
    html! {
        figure.scene {
            canvas tabindex="0" role="img"
                aria-label="The robot in space: base, motors and both flagella at the time shown. Arrow keys turn the view, plus and minus bring it nearer, Home puts it back, space plays." {}
            div.tools role="group" aria-label="View" {
                button.nearer type="button" aria-label="Nearer" { "+" }
                button.farther type="button" aria-label="Farther" { "−" }
                button.home type="button" { "From the front" }
            }
            figcaption {
                @if view.shapes_per_s > 0.0 {
                    "Flagella as in " (whose) ", " (number(view.shapes_per_s, 1)) " shapes a second, between them turned with their shafts. "
                } @else {
                    "No shapes are in the log: the flagella are drawn as rigid helices that turn with their shafts. "
                }
                (steady) " Drag to turn; arrow keys, + and − do the same."
            }
        }
    }
}

fn player(view: &View) -> Markup {
    html! {
        div.player {
            button.play type="button" aria-label="Play" {}
            input.scrub type="range" min="0" max=(view.overview.duration_s) step="0.01" value="0" aria-label="Time";
            select.rate aria-label="Speed of playing" {
                @for rate in ["0.25", "1", "2", "5", "10"] { option value=(rate) selected[rate == "1"] { (rate) "×" } }
            }
        }
    }
}

/// What the trial's own angles are called, beside those of the model.
fn own_name(view: &View) -> &'static str {
    match (view.is_model(), view.comparison.is_some()) {
        (false, _) => "measured",
        (true, false) => "model",
        (true, true) => "this log",
    }
}

fn readout(view: &View) -> Markup {
    let own = own_name(view);
    let out = |what: &str| html! { td data-out=(what) { "–" } };
    html! {
        table.readout {
            thead { tr {
                th scope="col" { span data-out="time" {} " " span.meta data-out="phase" {} }
                th scope="col" { (own) }
                @if view.comparison.is_some() { th scope="col" { "model" } }
                @if view.has_truth { th scope="col" { "truth" } }
            } }
            tbody {
                @for (name, column) in [("Yaw ψ, °", "yaw"), ("Pitch θ, °", "pitch"), ("Roll φ, °", "roll")] {
                    tr {
                        th scope="row" { (name) }
                        (out(&format!("attitude {column} 2")))
                        @if view.comparison.is_some() { (out(&format!("attitude model_{column} 2"))) }
                        @if view.has_truth { (out(&format!("attitude true_{column} 2"))) }
                    }
                }
                @for i in 1..=2 {
                    tr {
                        th scope="row" { span class={ "key c-flagellum" (i) } {} "Flagellum " (i) ", rpm" }
                        (out(&format!("motors speed{i} 1")))
                        @if view.comparison.is_some() { td {} }
                        @if view.has_truth { td {} }
                    }
                }
            }
        }
    }
}

/// A line of a chart: how it looks, and what it is.
struct Line(&'static str, &'static str);

fn charts(view: &View) -> Markup {
    let own = own_name(view);
    let angle_lines = |with_band: bool| {
        let mut lines = vec![Line("c-measured", own)];
        if with_band && view.has_yaw_band {
            lines.push(Line("block c-band", "95 % uncertainty"));
        }
        if view.comparison.is_some() {
            lines.push(Line("dash c-model", "model"));
        }
        if view.has_truth {
            lines.push(Line("dots c-truth", "truth"));
        }
        lines
    };
    let motors = vec![
        Line("c-flagellum1", "flagellum 1"),
        Line("c-flagellum2", "flagellum 2"),
        Line("dash c-ink", "asked of 1"),
        Line("dots c-ink", "asked of 2"),
    ];
    let link = vec![
        Line("c-measured", "samples a second"),
        Line("block c-bad", "lost"),
        Line("block c-model", "retries"),
        Line("block c-flagellum1", "counted by the board"),
    ];
    let seconds = view.data["link"]["width_s"].as_u64().unwrap_or(1);
    let link_name = if seconds > 1 { format!("Link, per {seconds} s") } else { "Link, per second".to_owned() };
    html! {
        div.tools role="group" aria-label="Time axis" {
            button.zoom-in type="button" aria-label="Show less time" { "+" }
            button.zoom-out type="button" aria-label="Show more time" { "−" }
            button.zoom-all type="button" { "Whole trial" }
        }
        (chart("yaw", "Yaw ψ from the start of the run", &angle_lines(true)))
        (chart("pitch", "Pitch θ", &angle_lines(false)))
        (chart("roll", "Roll φ", &angle_lines(false)))
        (chart("motors", "Speed of the flagella, rpm", &motors))
        @if !view.is_model() { (chart("link", &link_name, &link)) }
        p.meta.small {
            @if view.every_s > 0.0 {
                "Drawn through the smallest and the largest value of every " (number(view.every_s, 3)) " s."
            } @else {
                "Every sample is drawn."
            }
            " Drag across a chart to see less time, double-click for all of it, click to go there."
        }
    }
}

fn chart(name: &str, title: &str, lines: &[Line]) -> Markup {
    html! {
        figure role="group" aria-label={ (title) ": the figures stand beside the view at the time that is set there" } {
            figcaption {
                h3 { (title) }
                div.legend { @for Line(look, text) in lines { span { i class={ "key " (look) } {} span { (text) } } " " } }
            }
            div data-chart=(name) aria-hidden="true" {}
        }
    }
}

fn events(view: &View) -> Markup {
    let shown: Vec<&Event> = view.events.iter().collect();
    let bad = shown.iter().any(|event| matches!(event.kind, Kind::Fault | Kind::Warning));
    html! {
        @if !shown.is_empty() {
            details open[bad] {
                summary { "Events (" (shown.len() + view.more_events) ")" }
                table.facts {
                    @for event in shown {
                        tr {
                            th { button.seek type="button" data-seek=(event.time_s) { (number(event.time_s, 2)) " s" } }
                            td { (kind(event.kind)) }
                            td { (clip(&event.text, 300)) }
                        }
                    }
                }
                @if view.more_events > 0 { p.meta { "and " (view.more_events) " more" } }
            }
        }
    }
}

fn kind(kind: Kind) -> &'static str {
    match kind {
        Kind::Note => "note",
        Kind::Phase => "phase",
        Kind::State => "state",
        Kind::Fault => "fault",
        Kind::Retry => "retry",
        Kind::Calibration => "calibration",
        Kind::Clock => "clock",
        Kind::Warning => "warning",
    }
}
