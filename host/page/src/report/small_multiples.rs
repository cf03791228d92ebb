//! The yaw of every trial of a session, side by side on the same axes: small pictures that link to their trials.

use super::rows::{Row, anchor, verdict};
use super::text::{clip, number};
use super::view::View;
use maud::{Markup, html};
use study::twin::SessionComparison;

/// The most pictures.
const MOST_TRIALS: usize = 60;

const WIDTH: f64 = 150.0;
const HEIGHT: f64 = 64.0;
/// Room at the edges of a picture, so that lines are not cut.
const EDGE: f64 = 2.0;

/// Returns the pictures of a session of two trials or more.
pub(super) fn section(rows: &[Row], comparison: Option<&SessionComparison>) -> Markup {
    let shown: Vec<(usize, &Row, &View)> =
        rows.iter().enumerate().filter_map(|(i, row)| Some((i, row, row.view()?))).collect();
    let pictures = &shown[..shown.len().min(MOST_TRIALS)];
    let all = || pictures.iter().flat_map(|(_, _, view)| &view.curve);
    let most = |values: &mut dyn Iterator<Item = f64>| values.filter(|v| v.is_finite()).fold(0.0_f64, f64::max);
    let end_s = most(&mut all().map(|point| point[0]));
    let high = most(&mut all().flat_map(|point| [point[1], point[2]]));
    let low = -most(&mut all().flat_map(|point| [-point[1], -point[2]]));
    if pictures.len() < 2 || end_s <= 0.0 || high <= low {
        return html! {};
    }
    let x = |time: f64| EDGE + time / end_s * (WIDTH - 2.0 * EDGE);
    let y = |deg: f64| EDGE + (high - deg) / (high - low) * (HEIGHT - 2.0 * EDGE);
    let path = |curve: &[[f64; 3]], k: usize| -> String {
        let points = curve.iter().filter(|point| point[k].is_finite());
        let drawn = points
            .enumerate()
            .map(|(i, point)| format!("{}{:.1} {:.1}", if i == 0 { 'M' } else { 'L' }, x(point[0]), y(point[k])));
        drawn.collect()
    };
    html! {
        p.meta {
            "Yaw over the run of each trial, on the same axes: " (number(low, 0)) "° to " (number(high, 0)) "°, "
            (number(end_s, 0)) " s."
            @if pictures.len() < shown.len() { " The first " (pictures.len()) " trials." }
        }
        ul.multiples {
            @for (i, row, view) in pictures {
                @let differs = verdict(view, comparison);
                li {
                    a href=[(!view.data.is_null()).then(|| format!("#{}", anchor(*i)))] {
                        svg viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } aria-hidden="true" {
                            path.zero d={ "M0 " (format!("{:.1}", y(0.0))) "H" (WIDTH) } {}
                            path.own d=(path(&view.curve, 1)) {}
                            path.other d=(path(&view.curve, 2)) {}
                        }
                        (clip(&row.name, 40))
                        @if let Some(differs) = differs { " " b { (differs) } }
                    }
                }
            }
        }
    }
}
