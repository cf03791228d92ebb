//! A map of an angle over both speeds, as SVG: it needs no script, prints, and each of its cells leads to its trial.

use super::text::{degrees, number, plain};
use maud::{Markup, html};

/// A trial's place on the map.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    pub speeds_rpm: [f64; 2],
    /// The size of the angle, degrees.
    pub value_deg: f64,
    /// Anchor of the trial, where the page has it.
    pub anchor: Option<String>,
}

/// Viridis (van der Walt and Smith, matplotlib), every tenth of its length: even in lightness, and for any colour vision.
const VIRIDIS: [[u8; 3]; 11] = [
    [68, 1, 84],
    [72, 36, 117],
    [65, 68, 135],
    [53, 95, 141],
    [42, 120, 142],
    [33, 145, 140],
    [34, 168, 132],
    [68, 191, 112],
    [122, 209, 81],
    [189, 223, 38],
    [253, 231, 37],
];

const WIDTH: f64 = 430.0;
const LEFT: f64 = 44.0;
const BAR: f64 = 74.0;

/// Whether trials lie on a grid that makes a map: at least two speeds of each flagellum, and most of their pairs.
pub(super) fn is_grid(cells: &[Cell]) -> bool {
    let [columns, rows] = [0, 1].map(|i| axis(cells, i).len());
    columns > 1 && rows > 1 && 2 * cells.len() > columns * rows && cells.len() > 5
}

/// Repeats of a pair of speeds as one cell: their mean, and the anchor of the first.
pub(super) fn without_repeats(trials: impl Iterator<Item = Cell>) -> Vec<Cell> {
    let mut cells: Vec<(Cell, f64)> = Vec::new();
    for trial in trials {
        match cells.iter_mut().find(|(cell, _)| cell.speeds_rpm == trial.speeds_rpm) {
            Some((cell, count)) => {
                *count += 1.0;
                cell.value_deg += (trial.value_deg - cell.value_deg) / *count;
            }
            None => cells.push((trial, 1.0)),
        }
    }
    cells.into_iter().map(|(cell, _)| cell).collect()
}

/// The largest value, to share a scale among maps.
pub(super) fn largest(cells: &[Cell]) -> f64 {
    cells.iter().map(|cell| cell.value_deg).filter(|value| value.is_finite()).fold(0.0, f64::max)
}

/// The map; its colours go from 0 to `scale_deg`.
pub(super) fn svg(title: &str, cells: &[Cell], scale_deg: f64) -> Markup {
    let (columns, rows) = (axis(cells, 0), axis(cells, 1));
    let scale = if scale_deg > 0.0 { scale_deg } else { 1.0 };
    let across = (WIDTH - LEFT - BAR) / columns.len() as f64;
    let down = across.clamp(14.0, 40.0);
    let bottom = 8.0 + down * rows.len() as f64;
    let place = |cell: &Cell| {
        let column = columns.iter().position(|speed| *speed == cell.speeds_rpm[0]).unwrap_or(0);
        let row = rows.iter().position(|speed| *speed == cell.speeds_rpm[1]).unwrap_or(0);
        (LEFT + column as f64 * across, bottom - (row + 1) as f64 * down)
    };
    let column_labels = labelled(&columns, (34.0 / across).ceil() as usize);
    let row_labels = labelled(&rows, (14.0 / down).ceil() as usize);
    let bar = WIDTH - BAR + 18.0;
    html! {
        svg viewBox={ "0 0 " (WIDTH) " " (bottom + 40.0) } role="group" aria-label=(title) {
            @for cell in cells {
                @let (x, y) = place(cell);
                @let text = format!("w1 {}, w2 {} rpm: {}", plain(cell.speeds_rpm[0]), plain(cell.speeds_rpm[1]), degrees(cell.value_deg, 2));
                @let square = html! {
                    rect x=(short(x)) y=(short(y)) width=(short(across - 1.0)) height=(short(down - 1.0))
                        fill=(colour(cell.value_deg / scale)) { title { (text) } }
                };
                @match &cell.anchor {
                    Some(anchor) => { a href={ "#" (anchor) } aria-label=(text) { (square) } }
                    None => { (square) }
                }
            }
            @for (i, speed) in column_labels {
                text x=(short(LEFT + (i as f64 + 0.5) * across)) y=(short(bottom + 14.0)) text-anchor="middle" { (plain(speed)) }
            }
            @for (i, speed) in row_labels {
                text x=(short(LEFT - 6.0)) y=(short(bottom - (i as f64 + 0.5) * down + 4.0)) text-anchor="end" { (plain(speed)) }
            }
            text x=(short(LEFT + 0.5 * across * columns.len() as f64)) y=(short(bottom + 32.0)) text-anchor="middle" { "w1, rpm" }
            text transform={ "translate(11 " (short(0.5 * (bottom + 8.0))) ") rotate(-90)" } text-anchor="middle" { "w2, rpm" }
            @for i in 0..50 {
                rect x=(short(bar)) y=(short(8.0 + (49 - i) as f64 * (bottom - 8.0) / 50.0)) width="12"
                    height=(short((bottom - 8.0) / 50.0 + 0.5)) fill=(colour((f64::from(i) + 0.5) / 50.0)) {}
            }
            @for share in [0.0, 0.5, 1.0] {
                text x=(short(bar + 17.0)) y=(short(bottom - share * (bottom - 18.0))) { (number(share * scale, if scale < 10.0 { 1 } else { 0 })) "°" }
            }
        }
    }
}

/// The speeds of a flagellum, ascending, each once.
fn axis(cells: &[Cell], which: usize) -> Vec<f64> {
    let mut speeds: Vec<f64> = cells.iter().map(|cell| cell.speeds_rpm[which]).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    speeds
}

/// Every so many of the speeds, with their places; zero among them where it is one.
fn labelled(speeds: &[f64], every: usize) -> Vec<(usize, f64)> {
    let every = every.max(1);
    let zero = speeds.iter().position(|speed| *speed == 0.0).unwrap_or(0);
    speeds.iter().copied().enumerate().filter(|(i, _)| i % every == zero % every).collect()
}

/// The colour of a share of the scale; grey where there is no value.
fn colour(share: f64) -> String {
    if !share.is_finite() {
        return "#999999".to_owned();
    }
    let place = share.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let i = (place as usize).min(VIRIDIS.len() - 2);
    let mix = |k: usize| {
        let (a, b) = (f64::from(VIRIDIS[i][k]), f64::from(VIRIDIS[i + 1][k]));
        (a + (b - a) * (place - i as f64)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

/// A coordinate to a tenth.
fn short(value: f64) -> String {
    format!("{}", (value * 10.0).round() / 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(columns: i32, rows: i32) -> Vec<Cell> {
        let cell = |i: i32, k: i32| Cell {
            speeds_rpm: [f64::from(i) * 10.0, f64::from(k) * 15.0],
            value_deg: f64::from(i * k),
            anchor: None,
        };
        (0..columns).flat_map(|i| (0..rows).map(move |k| cell(i, k))).collect()
    }

    #[test]
    fn a_list_of_points_is_no_grid() {
        assert!(is_grid(&cells(4, 3)));
        assert!(!is_grid(&cells(12, 1)) && !is_grid(&cells(2, 2)));
        let diagonal: Vec<_> = cells(8, 8).into_iter().filter(|c| c.speeds_rpm[0] * 1.5 == c.speeds_rpm[1]).collect();
        assert_eq!((diagonal.len(), is_grid(&diagonal)), (8, false));
    }

    #[test]
    fn repeats_share_a_cell() {
        let cell =
            |w1: f64, value_deg: f64| Cell { speeds_rpm: [w1, 0.0], value_deg, anchor: Some(format!("{value_deg}")) };
        let cells = without_repeats([cell(1.0, 2.0), cell(2.0, 9.0), cell(1.0, 4.0), cell(1.0, 6.0)].into_iter());
        let values: Vec<_> = cells.iter().map(|cell| (cell.value_deg, cell.anchor.as_deref())).collect();
        assert_eq!(values, [(4.0, Some("2")), (9.0, Some("9"))]);
    }

    #[test]
    fn every_trial_has_its_cell_and_the_ends_of_the_scale_their_colours() {
        let cells = cells(4, 3);
        let map = svg("<map>", &cells, largest(&cells)).into_string();
        assert_eq!(map.matches("<title>").count(), 12);
        assert!(map.contains("aria-label=\"&lt;map&gt;\"") && map.contains("w1 30, w2 30 rpm: 6.00°"));
        assert!(map.contains("#440154") && map.contains("#fde725"));
        assert_eq!(colour(f64::NAN), "#999999");
        assert_eq!(labelled(&[-20.0, -10.0, 0.0, 10.0], 2), [(0, -20.0), (2, 0.0)]);
    }
}
