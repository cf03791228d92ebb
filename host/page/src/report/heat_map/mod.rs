//! Maps of an angle over the speeds of both flagella, as SVG: they need no script, they print, and each point is a link to
//! its trial.
//!
//! Speeds on a grid are drawn as its cells, and cells without a trial stay empty. Other speeds are drawn as dots.

mod axis;

use super::text::{degrees, number, plain, short};
use crate::viridis::colour;
use axis::Axis;
use maud::{Markup, html};

/// A trial on the map.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub speeds_rpm: [f64; 2],
    /// Magnitude of the angle.
    pub value_deg: f64,
    /// Whether all trials at these speeds settled; a ring marks the others.
    pub is_settled: bool,
    /// Anchor of the trial, if it is on the page.
    pub anchor: Option<String>,
}

/// The map of one angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Map<'a> {
    pub title: &'a str,
    /// Symbol of the angle, such as `|ψ|`.
    pub symbol: &'a str,
    pub points: &'a [Point],
    /// Value at the upper end of the colour scale, which begins at zero.
    pub scale_deg: f64,
}

/// Fewest points of a map.
const LEAST_POINTS: usize = 6;

const WIDTH: f64 = 430.0;
const LEFT: f64 = 46.0;
const TOP: f64 = 20.0;
/// Width of the colour scale with its labels.
const SCALE: f64 = 74.0;
const DOT_RADIUS: f64 = 6.5;

/// Returns whether the points make a map: there are enough of them, and both flagella have more than one speed.
pub(super) fn is_map(points: &[Point]) -> bool {
    let differs = |k: usize| points.iter().any(|point| point.speeds_rpm[k] != points[0].speeds_rpm[k]);
    points.len() >= LEAST_POINTS && differs(0) && differs(1)
}

/// Returns the largest value, for a scale that several maps share.
pub(super) fn largest(points: &[Point]) -> f64 {
    points.iter().map(|point| point.value_deg).filter(|value| value.is_finite()).fold(0.0, f64::max)
}

impl Map<'_> {
    /// Draws the map with its axes and its colour scale.
    pub fn svg(&self) -> Markup {
        let [across, down] = Axis::of_both(self.points);
        let plot = Plot::new(across, down);
        let scale = if self.scale_deg > 0.0 { self.scale_deg } else { 1.0 };
        html! {
            svg viewBox={ "0 0 " (WIDTH) " " (short(plot.bottom + 42.0)) } role="group" aria-label=(self.title)
                data-x="w1_rpm" data-y="w2_rpm" data-value={ (self.symbol) "_deg" } {
                (plot.background())
                @for point in self.points { (mark(point, scale, &plot)) }
                (plot.labels())
                (colour_scale(scale, self.symbol, plot.bottom))
            }
        }
    }

    /// Describes the map in words.
    pub fn caption(&self) -> String {
        let values = || self.points.iter().map(|point| point.value_deg).filter(|value| value.is_finite());
        let least = values().fold(f64::INFINITY, f64::min);
        let span = format!("{} from {} to {}.", self.symbol, degrees(least, 2), degrees(largest(self.points), 2));
        let shown = values().count();
        let unsettled = self.points.iter().filter(|point| !point.is_settled).count();
        let marked = if unsettled > 0 { format!(" {unsettled} with a ring: not settled.") } else { String::new() };
        let [across, down] = Axis::of_both(self.points);
        let points = match across.nodes * down.nodes {
            0 => format!("{shown} pairs of speeds, one dot each. {span}"),
            all if shown < all => {
                format!("{shown} of the {all} pairs of speeds of the grid; empty cells have no value. {span}")
            }
            _ => format!("{shown} pairs of speeds. {span}"),
        };
        points + &marked
    }
}

/// The axes on the drawing.
struct Plot {
    across: Axis,
    down: Axis,
    bottom: f64,
}

impl Plot {
    fn new(across: Axis, down: Axis) -> Self {
        let height = match across.nodes {
            0 => 250.0,
            nodes => ((WIDTH - LEFT - SCALE) / nodes as f64).clamp(14.0, 40.0) * down.nodes as f64,
        };
        Self { across, down, bottom: TOP + height }
    }

    fn right(&self) -> f64 {
        WIDTH - SCALE
    }

    fn x(&self, speed_rpm: f64) -> f64 {
        LEFT + self.across.share(speed_rpm) * (self.right() - LEFT)
    }

    fn y(&self, speed_rpm: f64) -> f64 {
        self.bottom - self.down.share(speed_rpm) * (self.bottom - TOP)
    }

    /// Returns width and height of a cell, if the map has cells.
    fn cell(&self) -> Option<[f64; 2]> {
        let [across, down] = [self.across.nodes, self.down.nodes].map(|nodes| nodes as f64);
        (across > 0.0).then(|| [(self.right() - LEFT) / across, (self.bottom - TOP) / down])
    }

    /// Draws the outlines of all cells, or the frame of a map of dots with the lines of its ticks.
    fn background(&self) -> Markup {
        let mut lines = String::new();
        let (right, bottom) = (self.right(), self.bottom);
        if let Some([width, height]) = self.cell() {
            let mut x = LEFT;
            while x < right + 0.5 * width {
                lines += &format!("M{} {}V{}", short(x), short(TOP), short(bottom));
                x += width;
            }
            let mut y = TOP;
            while y < bottom + 0.5 * height {
                lines += &format!("M{} {}H{}", short(LEFT), short(y), short(right));
                y += height;
            }
        } else {
            lines += &format!("M{LEFT} {TOP}H{right}V{}H{LEFT}Z", short(bottom));
            let (across, down) = (self.across.ticks(right - LEFT, 34.0), self.down.ticks(bottom - TOP, 22.0));
            lines.extend(across.iter().map(|w1| format!("M{} {TOP}V{}", short(self.x(*w1)), short(bottom))));
            lines.extend(down.iter().map(|w2| format!("M{LEFT} {}H{right}", short(self.y(*w2)))));
        }
        html! { path class="empty" d=(lines) {} }
    }

    fn labels(&self) -> Markup {
        let middle = 0.5 * (LEFT + self.right());
        html! {
            @for speed in self.across.ticks(self.right() - LEFT, 34.0) {
                text x=(short(self.x(speed))) y=(short(self.bottom + 15.0)) text-anchor="middle" { (plain(speed)) }
            }
            @for speed in self.down.ticks(self.bottom - TOP, 14.0) {
                text x=(short(LEFT - 6.0)) y=(short(self.y(speed) + 4.0)) text-anchor="end" { (plain(speed)) }
            }
            text x=(short(middle)) y=(short(self.bottom + 34.0)) text-anchor="middle" { "speed of flagellum 1 (w1), rpm" }
            text transform={ "translate(11 " (short(0.5 * (self.bottom + TOP))) ") rotate(-90)" } text-anchor="middle" { "flagellum 2 (w2), rpm" }
        }
    }
}

/// Draws a point as a cell or a dot, which links to its trial.
fn mark(point: &Point, scale_deg: f64, plot: &Plot) -> Markup {
    let [w1, w2] = point.speeds_rpm;
    let doubt = if point.is_settled { "" } else { ", not settled" };
    let text = format!("w1 {}, w2 {} rpm: {}{doubt}", plain(w1), plain(w2), degrees(point.value_deg, 2));
    let at = format!("{w1},{w2},{:.6}", point.value_deg);
    let (x, y, fill) = (plot.x(w1), plot.y(w2), colour(point.value_deg / scale_deg));
    let shape = match plot.cell() {
        Some([width, height]) => html! {
            rect data-at=(at) x=(short(x - 0.5 * width + 0.5)) y=(short(y - 0.5 * height + 0.5)) width=(short(width - 1.0))
                height=(short(height - 1.0)) fill=(fill) { title { (text) } }
        },
        None => {
            html! { circle data-at=(at) cx=(short(x)) cy=(short(y)) r=(DOT_RADIUS) fill=(fill) { title { (text) } } }
        }
    };
    let marked = html! {
        @if point.value_deg.is_finite() { (shape) }
        @if !point.is_settled { circle.odd cx=(short(x)) cy=(short(y)) r="2.2" {} }
    };
    match &point.anchor {
        Some(anchor) => html! { a href={ "#" (anchor) } aria-label=(text) { (marked) } },
        None => marked,
    }
}

fn colour_scale(scale_deg: f64, symbol: &str, bottom: f64) -> Markup {
    let (left, height) = (WIDTH - SCALE + 18.0, bottom - TOP);
    let decimals = if scale_deg < 1.0 { 2 } else { 1 };
    html! {
        text x=(short(left)) y="12" { (symbol) ", °" }
        @for i in 0..50 {
            rect x=(short(left)) y=(short(TOP + f64::from(49 - i) * height / 50.0)) width="12"
                height=(short(height / 50.0 + 0.5)) fill=(colour((f64::from(i) + 0.5) / 50.0)) {}
        }
        @for share in [0.0, 0.5, 1.0] {
            text x=(short(left + 17.0)) y=(short(bottom - share * (height - 9.0))) { (number(share * scale_deg, decimals)) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(columns: i32, rows: i32) -> Vec<Point> {
        let point = |i: i32, k: i32| Point {
            speeds_rpm: [f64::from(i) * 10.0, f64::from(k) * 15.0],
            value_deg: f64::from(i * k),
            is_settled: true,
            anchor: None,
        };
        (0..columns).flat_map(|i| (0..rows).map(move |k| point(i, k))).collect()
    }

    fn map(points: &[Point]) -> (String, String) {
        let map = Map { title: "<map>", symbol: "|ψ|", points, scale_deg: largest(points) };
        (map.svg().into_string(), map.caption())
    }

    #[test]
    fn few_points_and_points_along_an_axis_make_no_map() {
        assert!(is_map(&points(4, 3)) && is_map(&points(2, 3)));
        assert!(!is_map(&points(12, 1)) && !is_map(&points(1, 12)) && !is_map(&points(2, 2)) && !is_map(&[]));
    }

    #[test]
    fn every_trial_of_a_grid_has_its_cell_and_the_ends_of_the_scale_their_colours() {
        let (map, caption) = map(&points(4, 3));
        assert_eq!((map.matches("<title>").count(), map.matches("<circle").count()), (12, 0));
        assert!(map.contains("aria-label=\"&lt;map&gt;\"") && map.contains("w1 30, w2 30 rpm: 6.00°"));
        assert!(map.contains("#440154") && map.contains("#fde725"));
        assert_eq!(caption, "12 pairs of speeds. |ψ| from 0.00° to 6.00°.");
        assert_eq!(colour(f64::NAN), "#999999");
    }

    #[test]
    fn part_of_a_grid_keeps_its_cells_in_place_and_leaves_the_others_empty() {
        let whole = points(19, 10);
        let part: Vec<_> =
            whole.iter().enumerate().filter(|(i, _)| i % 5 < 2 || *i == 189).map(|(_, p)| p.clone()).collect();
        let ((whole, _), (part_map, caption)) = (map(&whole), map(&part));
        assert!(
            caption.starts_with("77 of the 190 pairs of speeds of the grid; empty cells have no value."),
            "{caption}"
        );
        assert_eq!(part_map.matches("<title>").count(), 77);
        let outline = |map: &str| map.split("<path").nth(1).unwrap().split('>').next().unwrap().to_owned();
        assert_eq!(outline(&part_map), outline(&whole));
        // A cell has the same place and colour as on the whole map.
        let cell = |map: &str| map.split("<rect").find(|rect| rect.contains("w1 100, w2 75 rpm")).unwrap().to_owned();
        assert_eq!(cell(&part_map), cell(&whole));
    }

    #[test]
    fn scattered_speeds_are_dots_at_their_place() {
        let points: Vec<Point> = (0..9)
            .map(|i| Point {
                speeds_rpm: [f64::from(i * i) * 1.13, 90.0 - f64::from(i) * 7.01],
                value_deg: f64::from(i),
                is_settled: i != 4,
                anchor: Some(format!("trial-{i}")),
            })
            .collect();
        let (map, caption) = map(&points);
        assert_eq!((map.matches("<circle data-at").count(), map.matches("<a href").count()), (9, 9));
        assert_eq!((map.matches("circle class=\"odd\"").count(), map.matches("°, not settled").count()), (1, 2));
        assert_eq!(caption, "9 pairs of speeds, one dot each. |ψ| from 0.00° to 8.00°. 1 with a ring: not settled.");
        let place = |name: &str| -> Vec<f64> {
            let marks = map.split("<circle data-at").skip(1);
            marks
                .map(|mark| {
                    mark.split(&format!("{name}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
                })
                .collect()
        };
        let (x, y) = (place("cx"), place("cy"));
        assert!(x.is_sorted() && y.is_sorted(), "w2 falls as w1 rises");
        // Places are proportional to the speeds.
        let share = |values: &[f64], i: usize| (values[i] - values[0]) / (values[8] - values[0]);
        let speeds: Vec<f64> = points.iter().map(|point| point.speeds_rpm[0]).collect();
        assert!((0..9).all(|i| (share(&x, i) - share(&speeds, i)).abs() < 0.002));
        assert!(
            x.iter().all(|x| (LEFT..WIDTH - SCALE).contains(x)) && y.iter().all(|y| (TOP..TOP + 250.0).contains(y))
        );
    }
}
