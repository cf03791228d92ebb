//! The robot of a trial on the page: the view with its buttons, the player, and the values at the selected time.

use super::text::number;
use super::view::View;
use maud::{Markup, html};

/// Returns the robot's part of a trial.
pub(super) fn stage(view: &View) -> Markup {
    html! {
        div.stage { (scene(view)) (player(view)) (readout(view)) }
    }
}

/// The views of the robot, with the labels of their buttons.
const LOOKS: [(&str, &str); 5] =
    [("perspective", "3-D"), ("tank", "Tank"), ("top", "Top"), ("front", "Front"), ("side", "Side")];

/// Returns the buttons that choose the view of the robot. Only a robot file with a tank has a view of the tank.
pub(super) fn looks(has_tank: bool) -> Markup {
    html! {
        @for (look, name) in LOOKS.into_iter().filter(|(look, _)| has_tank || *look != "tank") {
            button type="button" data-look=(look) { (name) }
        }
    }
}

/// Returns the buttons that zoom.
pub(super) fn zoom() -> Markup {
    html! {
        span.pair {
            button.view-in type="button" aria-label="Zoom in" { "+" }
            button.view-out type="button" aria-label="Zoom out" { "−" }
        }
    }
}

fn scene(view: &View) -> Markup {
    let whose = if view.borrowed_shapes { "the model’s log" } else { "the log" };
    let compared = view.comparison.is_some();
    let robots = match (compared, view.is_model()) {
        (true, false) => "Solid: the measured attitude; ghost: the attitude of the model. ",
        (true, true) => "Solid: the attitude of this log; ghost: that of the other one. ",
        (false, _) => "",
    };
    let forces = if view.borrowed_forces { "the model’s forces" } else { "the forces" };
    html! {
        figure.scene {
            canvas.view3d tabindex="0" role="img"
                aria-label="The robot: base, motors and both flagella at the selected time. Arrow keys rotate the view, plus and minus zoom, Home resets it, space plays." {}
            div.tools role="group" aria-label="View" {
                (looks(view.curves.has_tank))
                @if let Some(other) = view.other_name() { button type="button" aria-pressed="true" data-show="ghost" { (study::text::capitalised(other)) } }
                @if view.curves.has_forces { button type="button" aria-pressed="true" data-show="forces" { "Forces" } }
                button type="button" aria-pressed="true" data-show="trails" { "Trails" }
                button type="button" aria-pressed="false" data-camera="follow" { "Follow" }
                button type="button" aria-pressed="false" data-camera="fly" { "Fly-by" }
                (zoom())
            }
            figcaption {
                (robots)
                @if view.curves.shapes_per_s > 0.0 {
                    "Shapes of the flagella from " (whose) ", " (number(view.curves.shapes_per_s, 1)) " per second, interpolated in the frame of the shaft. "
                } @else {
                    "The log has no shapes: the flagella are drawn as rigid helices that turn with their shafts. "
                }
                @if view.curves.has_forces { "Arrows: " (forces) " of the flagella on the base. " }
                @if view.curves.has_forces && view.curves.shapes_per_s > 0.0 { "Yellow light: the flagella touch. " }
                "Lines behind the tips: their last two seconds. "
                (if view.curves.has_tank { "The box is the tank of the robot file. " } else { "The robot file has no tank: the box only shows up and down. " })
                "The pointers on the ring show the yaw." span.screen { " Drag to rotate, or use the arrow keys, + and −." }
            }
        }
    }
}

fn player(view: &View) -> Markup {
    html! {
        div.player {
            button.play type="button" aria-label="Play" {}
            input.scrub type="range" min="0" max=(view.duration_s) step="0.01" value="0" aria-label="Time";
            select.rate aria-label="Playback speed" {
                @for rate in ["0.25", "1", "2", "5", "10"] { option value=(rate) selected[rate == "1"] { (rate) "×" } }
            }
        }
    }
}

fn readout(view: &View) -> Markup {
    let (is_compared, truth) = (view.comparison.is_some(), view.has_truth);
    let heads: Vec<&str> =
        [view.own_name()].into_iter().chain(view.other_name()).chain(truth.then_some("truth")).collect();
    // Values of the trial alone are empty in the columns of the other side and of the truth.
    let beside = |own: String| [Some(own)].into_iter().chain(is_compared.then_some(None)).chain(truth.then_some(None));
    let mut rows = Vec::new();
    for (name, column) in [("Yaw ψ, °", "yaw"), ("Pitch θ, °", "pitch"), ("Roll φ, °", "roll")] {
        let sides =
            [(true, ""), (is_compared, "model_"), (truth, "true_")].into_iter().filter(|(is_there, _)| *is_there);
        rows.push((name, "", sides.map(|(_, side)| Some(format!("attitude {side}{column} 2"))).collect()));
    }
    rows.extend(SPEEDS.map(|(name, key, column)| (name, key, beside(format!("motors {column} 1")).collect())));
    for (name, column) in THRUSTS.into_iter().filter(|_| view.curves.has_forces) {
        let mut outs: Vec<_> = beside(format!("forces {column} 2")).collect();
        if view.borrowed_forces {
            outs.swap(0, 1);
        }
        rows.push((name, "", outs));
    }
    values(&heads, &rows)
}

/// The speeds of the flagella at the selected time: their names, the classes of their keys, and their columns.
pub(super) const SPEEDS: [(&str, &str, &str); 2] =
    [("Flagellum 1, rpm", "key c-flagellum1", "speed1"), ("Flagellum 2, rpm", "key c-flagellum2", "speed2")];

const THRUSTS: [(&str, &str); 3] =
    [("Thrust of flagellum 1, mN", "z1"), ("Thrust of flagellum 2, mN", "z2"), ("Smallest gap, mm", "gap")];

/// A row of values: its name, the classes of its key, and what the page's script writes under each head.
pub(super) type Values = (&'static str, &'static str, Vec<Option<String>>);

/// Returns the table of the values at the selected time.
pub(super) fn values(heads: &[&str], rows: &[Values]) -> Markup {
    html! {
        table.readout {
            thead { tr {
                th scope="col" { span data-out="time" {} " " span.meta data-out="phase" {} }
                @for head in heads { th scope="col" { (head) } }
            } }
            tbody { @for (name, key, outs) in rows {
                tr {
                    th scope="row" { @if !key.is_empty() { span class=(key) {} } (name) }
                    @for out in outs { @if let Some(out) = out { td data-out=(out) { "–" } } @else { td {} } }
                }
            } }
        }
    }
}
