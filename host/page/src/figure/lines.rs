//! A result of a sweep over one input, a curve for each value of another.

use super::panel::{Axis, LEFT_MM, Panel};
use super::sheet::{FONT_PT, MM, Sheet, Stroke};

const PANEL_MM: f64 = 52.0;

/// The colours of Okabe and Ito, for any colour vision; later curves are dashed.
const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#5a6570"];
const DASHES: [&str; 3] = ["", "3 1.5", "1 1.2"];

/// Largest number of curves with distinct colours and dashes.
pub(super) const MOST: usize = COLOURS.len() * DASHES.len();

/// A curve: its points in the order of x.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Curve {
    pub name: String,
    pub points: Vec<Point>,
}

/// A point of a curve.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Point {
    pub x: f64,
    pub y: f64,
    /// Half the height of the band; NaN if it is unknown.
    pub half: f64,
    /// Whether the value is of a steady state; other points have an empty mark.
    pub is_steady: bool,
}

/// Draws the curves. `by`: the quantity that distinguishes them; `under`: lines of text below the axis.
pub(super) fn draw(curves: &[Curve], [x, y]: [&str; 2], by: &str, under: &[String], width_mm: f64) -> String {
    let mut sheet = Sheet::new(width_mm);
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let ends = |point: &Point| [point.y - point.half.max(0.0), point.y + point.half.max(0.0)];
    let values: Vec<f64> = points().flat_map(ends).collect();
    let xs: Vec<f64> = points().map(|point| point.x).collect();
    let rows = legend(&mut sheet, curves, by);
    let top = 2.0 * MM + rows * 1.5 * FONT_PT;
    let panel = Panel::across(&mut sheet, axis(&xs, x), axis(&values, y), top, PANEL_MM, true);
    for (k, curve) in curves.iter().enumerate() {
        let Stroke(colour, ..) = stroke(k);
        let band: Vec<[f64; 3]> =
            curve.points.iter().map(|point| [point.x, point.y - point.half, point.y + point.half]).collect();
        panel.band(&mut sheet, &band, colour);
        let line: Vec<[f64; 2]> = curve.points.iter().map(|point| [point.x, point.y]).collect();
        panel.curve(&mut sheet, &line, stroke(k));
        for point in curve.points.iter().filter(|point| point.y.is_finite()) {
            let fill = if point.is_steady { colour } else { "#ffffff" };
            sheet.dot(panel.at(point.x, point.y), 1.3, fill, Stroke(colour, 0.6, ""));
        }
    }
    let mut bottom = panel.bottom() + 3.0 * FONT_PT;
    for line in under {
        bottom += 1.2 * FONT_PT;
        sheet.text(panel.left, bottom, "start", line);
    }
    sheet.svg(bottom + 0.6 * FONT_PT)
}

/// Returns an axis over values of any unit. For equal values it spans a tenth of their size.
fn axis(values: &[f64], label: &str) -> Axis {
    let largest = values.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    Axis::about(values.iter().copied(), if largest > 0.0 { 0.1 * largest } else { 1.0 }, label)
}

fn stroke(k: usize) -> Stroke<'static> {
    Stroke(COLOURS[k % COLOURS.len()], 0.9, DASHES[(k / COLOURS.len()).min(DASHES.len() - 1)])
}

/// Draws the legend of the curves; returns its number of rows.
fn legend(sheet: &mut Sheet, curves: &[Curve], by: &str) -> f64 {
    if by.is_empty() {
        return 0.0;
    }
    let longest = curves.iter().map(|curve| curve.name.chars().count()).max().unwrap_or(1) as f64;
    let each = 24.0 + 0.56 * FONT_PT * longest;
    let in_row = ((sheet.width - LEFT_MM * MM) / each).floor().max(1.0) as usize;
    sheet.text(LEFT_MM * MM, 3.2 * MM, "start", by);
    for (k, curve) in curves.iter().enumerate() {
        let (x, y) = (LEFT_MM * MM + (k % in_row) as f64 * each, 3.2 * MM + (1 + k / in_row) as f64 * 1.4 * FONT_PT);
        sheet.legend(x, y, &[(stroke(k), curve.name.as_str())]);
    }
    (1 + curves.len().div_ceil(in_row)) as f64
}
