//! The picture at the head of a session of many trials: the robot of the trial that shows most, moving.

use super::rows::{Row, anchor};
use super::text::{clip, degrees, speeds};
use super::trial_section::data_id;
use super::view::View;
use maud::{Markup, html};

/// Returns the trial to show, and why: it has the largest error of the steady yaw, or the largest steady yaw if the session is
/// not compared.
fn chosen(rows: &[Row]) -> Option<(usize, &View, String)> {
    let shown = || {
        rows.iter().enumerate().filter_map(|(i, row)| Some((i, row.view()?))).filter(|(_, view)| !view.data.is_null())
    };
    let largest = |of: fn(&View) -> Option<f64>| {
        let with = shown().filter_map(|(i, view)| Some((i, view, of(view).filter(|deg| deg.is_finite())?)));
        with.max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()))
    };
    if let Some((i, view, deg)) =
        largest(|view| view.comparison.as_ref().map(|comparison| comparison.angles()[0].error_deg))
    {
        return Some((i, view, format!("the largest error of the steady yaw, {}", degrees(deg, 1))));
    }
    let (i, view, deg) = largest(|view| view.steady.map(|steady| steady.angles_deg[0]))?;
    Some((i, view, format!("the largest steady yaw, {}", degrees(deg, 1))))
}

/// Returns the picture; nothing if no trial has data on the page.
pub(super) fn figure(rows: &[Row]) -> Markup {
    let Some((i, view, why)) = chosen(rows) else { return html! {} };
    let id = anchor(i);
    html! {
        figure.scene.hero data-data=(data_id(&id)) {
            canvas.view3d role="img" aria-label={ "The robot of trial " (clip(&view.name, 120)) " over its run" } {}
            figcaption {
                button.play type="button" aria-label="Play" {}
                span { a href={ "#" (id) } { (clip(&view.name, 120)) } " at " (speeds(view.speeds_rpm)) ": " (why) "." }
            }
        }
    }
}
