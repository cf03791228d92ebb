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

/// Where the robot can be seen from, and what the buttons are called.
const LOOKS: [(&str, &str); 5] =
    [("perspective", "3-D"), ("tank", "Tank"), ("top", "Top"), ("front", "Front"), ("side", "Side")];

/// Returns the buttons that choose where the robot is seen from. Only a robot file with a tank has a view of it.
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
    let own = view.own_name();
    let out = |what: &str| html! { td data-out=(what) { "–" } };
    html! {
        table.readout {
            thead { tr {
                th scope="col" { span data-out="time" {} " " span.meta data-out="phase" {} }
                th scope="col" { (own) }
                @if let Some(other) = view.other_name() { th scope="col" { (other) } }
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
                @if view.curves.has_forces {
                    @for (name, column) in [("Thrust of flagellum 1, mN", "z1"), ("Thrust of flagellum 2, mN", "z2"), ("Smallest gap, mm", "gap")] {
                        tr {
                            th scope="row" { (name) }
                            @let (own, model) = (out(&format!("forces {column} 2")), html! { td {} });
                            @if view.borrowed_forces { (model) (own) } @else { (own) @if view.comparison.is_some() { (model) } }
                            @if view.has_truth { td {} }
                        }
                    }
                }
            }
        }
    }
}
