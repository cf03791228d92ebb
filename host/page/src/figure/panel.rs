//! Axes, and a panel with two of them.

use super::sheet::{FONT_PT, GRID, INK, MM, Sheet, Stroke, short};
use crate::ticks;
use study::statistics::extremes;
use study::text::decimal;

/// Room beside a panel that is as wide as the sheet.
pub(super) const LEFT_MM: f64 = 13.0;
pub(super) const RIGHT_MM: f64 = 3.0;

/// A linear axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub low: f64,
    pub high: f64,
    pub label: String,
}

impl Axis {
    /// Creates an axis from `low` to `high`.
    pub fn new(low: f64, high: f64, label: &str) -> Self {
        Self { low, high, label: label.to_owned() }
    }

    /// Creates an axis over all finite values with a margin, and with at least the span `least`, so that noise is not
    /// enlarged to fill it.
    pub fn about(values: impl Iterator<Item = f64>, least: f64, label: &str) -> Self {
        let [low, high] = extremes(values.filter(|value| value.is_finite()));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
        let room = 0.5 * (least - (high - low)).max(0.0) + 0.06 * (high - low).max(least);
        Self::new(low - room, high + room, label)
    }

    /// Returns round values, at most about `most`.
    pub fn ticks(&self, most: f64) -> Vec<f64> {
        ticks::round(self.low, self.high, (self.high - self.low) / most.max(1.0))
    }

    fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }
}

/// Returns a tick's label, with as few decimals as distinguish the ticks.
pub(super) fn tick_text(value: f64, ticks: &[f64]) -> String {
    let step = ticks.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    let decimals = if step.is_finite() { (-step.log10() - 1e-6).ceil().clamp(0.0, 6.0) as usize } else { 0 };
    decimal(value, decimals).replace('-', "−")
}

/// A rectangle with axes.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub x: Axis,
    pub y: Axis,
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

impl Panel {
    /// Draws a panel across the sheet with the labels of its axes, of the x axis only with `has_x`.
    pub fn across(sheet: &mut Sheet, x: Axis, y: Axis, top: f64, height_mm: f64, has_x: bool) -> Self {
        let width = sheet.width - (LEFT_MM + RIGHT_MM) * MM;
        let panel = Self { x, y, left: LEFT_MM * MM, top, width, height: height_mm * MM };
        panel.frame(sheet, has_x);
        sheet.upright(3.2 * MM, top + 0.5 * panel.height, &panel.y.label);
        panel
    }

    /// Returns the position of a point on the sheet.
    pub fn at(&self, x: f64, y: f64) -> [f64; 2] {
        [self.left + self.x.share(x) * self.width, self.top + (1.0 - self.y.share(y)) * self.height]
    }

    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// Draws grid lines and frame, the ticks of the y axis, and with `has_x` the ticks of the x axis.
    pub fn frame(&self, sheet: &mut Sheet, has_x: bool) {
        let (right, bottom) = (self.left + self.width, self.bottom());
        let (across, up) = (self.x.ticks(self.width / 26.0), self.y.ticks(self.height / 13.0));
        for value in &across {
            let [x, _] = self.at(*value, self.y.low);
            sheet.path(&format!("M{} {}V{}", short(x), short(self.top), short(bottom)), Stroke(GRID, 0.4, ""));
            if has_x {
                sheet.text(x, bottom + 1.25 * FONT_PT, "middle", &tick_text(*value, &across));
            }
        }
        for value in &up {
            let [_, y] = self.at(self.x.low, *value);
            sheet.path(&format!("M{} {}H{}", short(self.left), short(y), short(right)), Stroke(GRID, 0.4, ""));
            sheet.text(self.left - 2.5, y + 0.35 * FONT_PT, "end", &tick_text(*value, &up));
        }
        self.border(sheet);
        if has_x {
            sheet.text(self.left + 0.5 * self.width, bottom + 2.6 * FONT_PT, "middle", &self.x.label);
        }
    }

    /// Draws the frame alone.
    pub fn border(&self, sheet: &mut Sheet) {
        let (left, top) = (short(self.left), short(self.top));
        let d = format!("M{left} {top}h{}v{}h-{}z", short(self.width), short(self.height), short(self.width));
        sheet.path(&d, Stroke(INK, 0.5, ""));
    }

    /// Draws a curve through points in order of x; it breaks where a value is missing.
    pub fn curve(&self, sheet: &mut Sheet, points: &[[f64; 2]], stroke: Stroke) {
        let mut d = String::new();
        let mut pen = 'M';
        for [x, y] in self.thinned(points) {
            if !y.is_finite() {
                pen = 'M';
                continue;
            }
            let [x, y] = self.at(x, y);
            d += &format!("{pen}{} {}", short(x), short(y));
            pen = 'L';
        }
        sheet.clipped([self.left, self.top], [self.width, self.height], |sheet| sheet.path(&d, stroke));
    }

    /// Fills the area between two curves.
    pub fn band(&self, sheet: &mut Sheet, points: &[[f64; 3]], colour: &str) {
        let points: Vec<_> = points.iter().filter(|[_, low, high]| low.is_finite() && high.is_finite()).collect();
        let edge = |k: usize| points.iter().map(move |point| self.at(point[0], point[k]));
        let all: Vec<String> =
            edge(1).chain(edge(2).rev()).map(|[x, y]| format!("{} {}", short(x), short(y))).collect();
        if !all.is_empty() {
            let d = format!("M{}z", all.join("L"));
            sheet.clipped([self.left, self.top], [self.width, self.height], |sheet| sheet.fill(&d, colour, 0.22));
        }
    }

    /// Returns at most four points of each tenth of a point of the width: the first, the last and the extremes, so that
    /// every oscillation is kept and none is added.
    fn thinned(&self, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let column = |x: f64| (self.x.share(x) * self.width * 10.0).floor() as i64;
        let mut thin = Vec::new();
        for part in points.chunk_by(|a, b| column(a[0]) == column(b[0]) && a[1].is_finite() && b[1].is_finite()) {
            if part.len() <= 4 {
                thin.extend(part);
                continue;
            }
            let extreme =
                |sign: f64| (0..part.len()).max_by(|a, b| (sign * part[*a][1]).total_cmp(&(sign * part[*b][1])));
            let mut kept: Vec<usize> =
                [0, part.len() - 1].into_iter().chain(extreme(1.0)).chain(extreme(-1.0)).collect();
            kept.sort_unstable();
            kept.dedup();
            thin.extend(kept.into_iter().map(|i| part[i]));
        }
        thin
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_their_texts_differ() {
        let axis = Axis::new(-0.13, 0.21, "");
        let ticks = axis.ticks(4.0);
        let texts: Vec<_> = ticks.iter().map(|tick| tick_text(*tick, &ticks)).collect();
        assert_eq!(texts, ["−0.1", "0.0", "0.1", "0.2"]);
        assert_eq!(Axis::new(0.0, 120.0, "").ticks(6.0), [0.0, 20.0, 40.0, 60.0, 80.0, 100.0, 120.0]);
        assert_eq!(Axis::new(-0.4, 0.4, "").ticks(2.4), [-0.4, -0.2, 0.0, 0.2, 0.4], "no axis has one tick");
        assert_eq!(Axis::about([3.0, f64::NAN].into_iter(), 2.0, "").ticks(4.0), [2.0, 3.0, 4.0]);
    }

    #[test]
    fn thinning_keeps_every_extreme() {
        let panel = Panel {
            x: Axis::new(0.0, 60.0, ""),
            y: Axis::new(-1.0, 1.0, ""),
            left: 0.0,
            top: 0.0,
            width: 100.0,
            height: 50.0,
        };
        let points: Vec<_> = (0..60_000).map(|i| [f64::from(i) * 1e-3, (f64::from(i) * 0.37).sin()]).collect();
        let thin = panel.thinned(&points);
        assert!(thin.len() <= 4_004, "{}", thin.len());
        let most = |points: &[[f64; 2]]| points.iter().fold(0.0_f64, |most, point| most.max(point[1]));
        assert_eq!(most(&points), most(&thin));
        assert!(thin.is_sorted_by(|a, b| a[0] < b[0]));
        let gap = panel.thinned(&[[1.0, 0.0], [1.0001, f64::NAN], [1.0002, 0.5]]);
        assert_eq!(gap.len(), 3);
    }
}
