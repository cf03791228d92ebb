//! Maps of a quantity over two others: cells and contours where the points lie on a grid, and dots elsewhere.
//!
//! Contours are straight between neighbouring nodes. On a coarse grid they would show the grid, so that only grids of
//! [`CONTOUR_NODES`] along both axes have them.

use super::panel::{Axis, Panel, tick_text};
use super::sheet::{FONT_PT, INK, MM, Sheet, Stroke, short, straight};
use crate::swept::CONTOUR_NODES;
use crate::viridis::colour;
use study::statistics::distinct;

/// Largest number of cells along an axis: more are too small to see.
const MAX_CELLS: usize = 80;

/// A value at a point of both axes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Point {
    pub at: [f64; 2],
    /// With its sign; the map shows the magnitude.
    pub value: f64,
    /// Whether the value settled and is the same for all starting phases.
    pub is_settled: bool,
}

/// A sign on a map, which its legend explains.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Mark {
    /// A cross in the colour of its value: a point over a surface, for instance a measured one.
    Cross,
    /// A point that is not settled.
    Ring,
    /// A point without a known value.
    Square,
}

impl Mark {
    /// Draws the sign in two colours, so that one of them is visible on any colour of the scale.
    fn draw(self, sheet: &mut Sheet, [x, y]: [f64; 2], colour: &str) {
        match self {
            Self::Cross => {
                for (half, width, colour) in [(2.9, 2.4, "#ffffff"), (2.6, 1.7, INK), (2.2, 0.9, colour)] {
                    let (x, y, size) = (short(x - half), short(y - half), short(2.0 * half));
                    sheet.path(&format!("M{x} {y}l{size} {size}m-{size} 0l{size} -{size}"), Stroke(colour, width, ""));
                }
            }
            Self::Ring => sheet.dot([x, y], 0.9, "#ffffff", Stroke(INK, 0.4, "")),
            Self::Square => {
                let (x, y, size) = (short(x - SQUARE_PT), short(y - SQUARE_PT), short(2.0 * SQUARE_PT));
                sheet.path(&format!("M{x} {y}h{size}v{size}h-{size}Z"), Stroke(INK, 0.5, ""));
            }
        }
    }
}

/// One map: a surface, for instance of the model, and points over it, for instance measured ones.
#[derive(Clone, Debug)]
pub(super) struct Map<'a> {
    pub title: &'a str,
    pub surface: Vec<Point>,
    pub points: Vec<Point>,
    /// Places of points without a known value.
    pub unknown: &'a [[f64; 2]],
}

/// Half the width of a square, pt.
const SQUARE_PT: f64 = 1.1;

/// Least length of a contour with a label, in widths of the label, which would hide too much of a shorter one.
const SEEN: f64 = 3.0;

/// Values on a grid: `values[j][i]` at `xs[i]` and `ys[j]`; NaN is a missing value.
#[derive(Clone, PartialEq, Debug)]
struct Grid {
    xs: Vec<f64>,
    ys: Vec<f64>,
    values: Vec<Vec<f64>>,
}

/// Draws maps over the same axes, two in a row, with the legend and the lines of `under_all` below them.
pub(super) fn draw(
    maps: &[Map],
    labels: [&str; 2],
    legend: &[(Mark, String)],
    under_all: &[String],
    width_mm: f64,
) -> String {
    let mut sheet = Sheet::new(width_mm);
    let (left, right, top, under) = (8.5 * MM, 8.5 * MM, 5.0 * MM, 8.0 * MM);
    let column = 0.5 * sheet.width;
    let width = column - left - right;
    let height = width * 0.9;
    for (i, map) in maps.iter().enumerate() {
        let cells = || map.surface.iter().map(|point| point.at).chain(map.unknown.iter().copied());
        let all = || cells().chain(map.points.iter().map(|point| point.at));
        let [x, y] = [0, 1].map(|k| extent(cells().map(|at| at[k]), all().map(|at| at[k]), labels[k]));
        let panel = Panel {
            x,
            y,
            left: left + (i % 2) as f64 * column,
            top: top + (i / 2) as f64 * (top + height + under),
            width,
            height,
        };
        one(&mut sheet, map, &panel);
    }
    let rows = maps.len().div_ceil(2) as f64;
    let mut bottom = rows * (top + height + under);
    for (mark, line) in legend {
        bottom += 1.2 * FONT_PT;
        mark.draw(&mut sheet, [left + 2.2, bottom - 0.35 * FONT_PT], "#ffffff");
        sheet.text(left + 7.0, bottom, "start", line);
    }
    for line in under_all {
        bottom += 1.2 * FONT_PT;
        sheet.text(left, bottom, "start", line);
    }
    sheet.svg(bottom + 1.0 * MM)
}

/// Returns an axis over all values: half a cell beyond the outermost.
fn extent(cells: impl Iterator<Item = f64>, all: impl Iterator<Item = f64>, label: &str) -> Axis {
    let [cells, all] = [distinct(cells), distinct(all)];
    let [low, high] = [all[0], all[all.len() - 1]];
    let room = if cells.len() > 1 && cells.len() <= MAX_CELLS {
        0.5 * (cells[cells.len() - 1] - cells[0]) / (cells.len() - 1) as f64
    } else {
        0.05 * (high - low)
    };
    let room = if room > 0.0 { room } else { 0.5 };
    Axis::new(low - room, high + room, label)
}

fn one(sheet: &mut Sheet, map: &Map, panel: &Panel) {
    let values = map.surface.iter().chain(&map.points).map(|point| point.value.abs()).filter(|value| value.is_finite());
    let most = values.fold(0.0, f64::max);
    let scale = Axis::new(0.0, if most > 0.0 { most } else { 1.0 }, "");
    let shade = |value: f64| colour(value.abs() / scale.high);
    let levels = scale.ticks(4.0);
    sheet.text(panel.left, panel.top - 0.5 * FONT_PT, "start", map.title);
    let marked = map.surface.iter().filter(|point| !point.is_settled).chain(&map.points);
    let marks: Vec<[f64; 2]> =
        (marked.map(|point| point.at).chain(map.unknown.iter().copied())).map(|[x, y]| panel.at(x, y)).collect();
    let grid = Grid::of(&map.surface);
    match &grid {
        Some(grid) => {
            grid.cells(sheet, panel, &shade);
            if grid.xs.len().min(grid.ys.len()) >= CONTOUR_NODES {
                contours(sheet, panel, grid, &levels, &marks);
            }
        }
        None => {
            for Point { at: [x, y], value, .. } in &map.surface {
                sheet.dot(panel.at(*x, *y), 1.7, &shade(*value), Stroke("none", 0.0, ""));
            }
        }
    }
    for Point { at: [x, y], value, .. } in &map.points {
        Mark::Cross.draw(sheet, panel.at(*x, *y), &shade(*value));
    }
    for Point { at: [x, y], .. } in map.surface.iter().chain(&map.points).filter(|point| !point.is_settled) {
        Mark::Ring.draw(sheet, panel.at(*x, *y), "");
    }
    for [x, y] in map.unknown {
        Mark::Square.draw(sheet, panel.at(*x, *y), "");
    }
    frame(sheet, panel, grid.as_ref());
    colour_bar(sheet, panel, &scale, &levels, &shade);
}

/// Draws the contours of the positive levels, each labelled with its value if there is room and the label covers none of `marks`.
fn contours(sheet: &mut Sheet, panel: &Panel, grid: &Grid, levels: &[f64], marks: &[[f64; 2]]) {
    let at = |[x, y]: [f64; 2]| panel.at(x, y);
    let lines: Vec<(f64, Vec<[[f64; 2]; 2]>)> = (levels.iter().filter(|level| **level > 0.0))
        .map(|level| (*level, grid.contour(*level).into_iter().map(|ends| ends.map(at)).collect()))
        .collect();
    for (_, segments) in &lines {
        sheet.path(&segments.iter().copied().map(straight).collect::<String>(), Stroke("#ffffff", 0.7, ""));
    }
    let mut labels: Vec<[f64; 2]> = Vec::new();
    for (level, segments) in &lines {
        let text = tick_text(*level, levels);
        let half = 0.26 * FONT_PT * text.chars().count() as f64;
        let length: f64 = segments.iter().map(|[[x0, y0], [x1, y1]]| (x1 - x0).hypot(y1 - y0)).sum();
        if length < SEEN * 2.0 * half {
            continue;
        }
        let right = panel.left + panel.width;
        // Room between a label and the frame, a mark or another label, negative if they overlap.
        let room = |[x, y]: [f64; 2]| {
            let of_frame = [x - panel.left, right - x].map(|room| room - half);
            let of_height = [y - panel.top, panel.bottom() - y].map(|room| room - 0.5 * FONT_PT);
            let between =
                |u: f64, v: f64, [width, height]: [f64; 2]| ((x - u).abs() - width).max((y - v).abs() - height);
            let of_marks = marks.iter().map(|[u, v]| between(*u, *v, [half + SQUARE_PT, 0.5 * FONT_PT + SQUARE_PT]));
            let of_labels = labels.iter().map(|[u, v]| between(*u, *v, [2.5 * half, FONT_PT]));
            of_frame.into_iter().chain(of_height).chain(of_marks).chain(of_labels).fold(f64::INFINITY, f64::min)
        };
        let middles = segments.iter().map(|[[x0, y0], [x1, y1]]| [0.5 * (x0 + x1), 0.5 * (y0 + y1)]);
        let best = middles.map(|middle| (room(middle), middle)).max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((room, [x, y])) = best
            && room > 0.5
        {
            sheet.haloed(x, y + 0.35 * FONT_PT, &text);
            labels.push([x, y]);
        }
    }
}

fn frame(sheet: &mut Sheet, panel: &Panel, grid: Option<&Grid>) {
    panel.border(sheet);
    let across = ticks(&panel.x, grid.map(|grid| &*grid.xs), 4.0);
    let up = ticks(&panel.y, grid.map(|grid| &*grid.ys), 5.0);
    let bottom = panel.bottom();
    for value in &across {
        let [x, _] = panel.at(*value, panel.y.low);
        sheet.path(&format!("M{} {}v2", short(x), short(bottom)), Stroke(INK, 0.5, ""));
        sheet.text(x, bottom + 1.35 * FONT_PT, "middle", &tick_text(*value, &across));
    }
    for value in &up {
        let [_, y] = panel.at(panel.x.low, *value);
        sheet.path(&format!("M{} {}h-2", short(panel.left), short(y)), Stroke(INK, 0.5, ""));
        sheet.text(panel.left - 3.0, y + 0.35 * FONT_PT, "end", &tick_text(*value, &up));
    }
    sheet.text(panel.left + 0.5 * panel.width, bottom + 2.5 * FONT_PT, "middle", &panel.x.label);
    sheet.upright(panel.left - 16.0, panel.top + 0.5 * panel.height, &panel.y.label);
}

/// Returns the values of an axis that have labels: the nodes of a grid if they are few, even and whole, or round values. Nothing
/// is known beyond the outermost points, though their cells reach further.
fn ticks(axis: &Axis, nodes: Option<&[f64]>, most: f64) -> Vec<f64> {
    let Some(nodes @ [first, second, ..]) = nodes else { return axis.ticks(most) };
    let (span, step) = (nodes[nodes.len() - 1] - first, second - first);
    let room = 0.5 * span / (nodes.len() - 1) as f64;
    let seen = Axis::new(axis.low + room, axis.high - room, "");
    let are_even =
        nodes.windows(2).all(|pair| pair[1] - pair[0] == step) && first.fract() == 0.0 && step.fract() == 0.0;
    let is_all = seen.high - seen.low < span + room;
    if nodes.len() <= 5 && are_even && is_all { nodes.to_vec() } else { seen.ticks(most) }
}

fn colour_bar(sheet: &mut Sheet, panel: &Panel, scale: &Axis, levels: &[f64], shade: &dyn Fn(f64) -> String) {
    const STEPS: usize = 64;
    let (left, width) = (panel.left + panel.width + 3.0, 5.0);
    let step = panel.height / STEPS as f64;
    for i in 0..STEPS {
        let value = scale.low + (i as f64 + 0.5) / STEPS as f64 * (scale.high - scale.low);
        sheet.rect([left, panel.bottom() - (i + 1) as f64 * step], [width, step + 0.3], &shade(value));
    }
    for level in levels {
        let y = panel.bottom() - (level - scale.low) / (scale.high - scale.low) * panel.height;
        sheet.path(&format!("M{} {}h{width}", short(left), short(y)), Stroke("#ffffff", 0.5, ""));
        sheet.text(left + width + 1.5, y + 0.35 * FONT_PT, "start", &tick_text(*level, levels));
    }
}

impl Grid {
    /// Returns the grid of points if most of its nodes have one; `None` for scattered points.
    fn of(points: &[Point]) -> Option<Self> {
        let [xs, ys] = [0, 1].map(|k| distinct(points.iter().map(|point| point.at[k])));
        let nodes = xs.len() * ys.len();
        if xs.len() < 2 || ys.len() < 2 || xs.len() > MAX_CELLS || ys.len() > MAX_CELLS || 2 * points.len() < nodes {
            return None;
        }
        let mut values = vec![vec![f64::NAN; xs.len()]; ys.len()];
        for Point { at: [x, y], value, .. } in points {
            let (j, i) = (ys.partition_point(|other| other < y), xs.partition_point(|other| other < x));
            values[j][i] = *value;
        }
        Some(Self { xs, ys, values })
    }

    /// Fills the cell of each node. Borders are midway between nodes, and equally far beyond the outermost ones.
    fn cells(&self, sheet: &mut Sheet, panel: &Panel, shade: &dyn Fn(f64) -> String) {
        let borders = |nodes: &[f64], axis: &Axis| -> Vec<f64> {
            let between: Vec<f64> = nodes.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
            let last = nodes.len() - 1;
            let (low, high) = (2.0 * nodes[0] - between[0], 2.0 * nodes[last] - between[last - 1]);
            [vec![low.max(axis.low)], between, vec![high.min(axis.high)]].concat()
        };
        let (across, up) = (borders(&self.xs, &panel.x), borders(&self.ys, &panel.y));
        for (j, row) in self.values.iter().enumerate() {
            for (i, value) in row.iter().enumerate().filter(|(_, value)| value.is_finite()) {
                let ([left, bottom], [right, top]) = (panel.at(across[i], up[j]), panel.at(across[i + 1], up[j + 1]));
                // Cells overlap a little, so that no background shows between them.
                sheet.rect([left, top], [right - left + 0.15, bottom - top + 0.15], &shade(*value));
            }
        }
    }

    /// Returns the line of one positive level as straight pieces. A magnitude has a corner where its value changes sign, possibly
    /// between nodes, so the lines of both signed values are used.
    fn contour(&self, level: f64) -> Vec<[[f64; 2]; 2]> {
        [level, -level].into_iter().flat_map(|level| self.line(level)).collect()
    }

    /// Returns the line of one signed value, by linear interpolation between the nodes.
    fn line(&self, level: f64) -> Vec<[[f64; 2]; 2]> {
        let mut segments = Vec::new();
        for j in 0..self.ys.len() - 1 {
            for i in 0..self.xs.len() - 1 {
                let corner = |[di, dj]: [usize; 2]| ([self.xs[i + di], self.ys[j + dj]], self.values[j + dj][i + di]);
                let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(corner);
                if corners.iter().any(|(_, value)| !value.is_finite()) {
                    continue;
                }
                let crossing = |k: usize| {
                    let ((a, low), (b, high)) = (corners[k], corners[(k + 1) % 4]);
                    let share = (level - low) / (high - low);
                    ((low < level) != (high < level)).then(|| [0, 1].map(|axis| a[axis] + share * (b[axis] - a[axis])))
                };
                let mut crossings: Vec<[f64; 2]> = (0..4).filter_map(crossing).collect();
                let middle = corners.iter().map(|(_, value)| value).sum::<f64>() / 4.0;
                // At a saddle, the middle determines which corners belong together.
                if crossings.len() == 4 && (middle < level) == (corners[0].1 < level) {
                    crossings.rotate_left(1);
                }
                segments.extend(crossings.as_chunks::<2>().0);
            }
        }
        segments
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(value: impl Fn(f64, f64) -> f64) -> Vec<Point> {
        let node = |i: i32, j: i32| [f64::from(i) * 10.0, f64::from(j) * 5.0];
        let all = (0..9).flat_map(|i| (0..7).map(move |j| node(i, j)));
        let point = |at: [f64; 2]| Point { at, value: value(at[0], at[1]), is_settled: true };
        all.map(point).collect()
    }

    #[test]
    fn a_contour_of_a_plane_is_its_line() {
        let grid = Grid::of(&points(|x, y| x + 2.0 * y)).unwrap();
        let segments = grid.contour(33.0);
        assert!(segments.len() >= 6);
        for [x, y] in segments.as_flattened() {
            assert!((x + 2.0 * y - 33.0).abs() < 1e-9, "({x}, {y})");
        }
        assert!(grid.contour(1e3).is_empty());
        // Between the nodes at 40 and 50, the magnitude falls to zero and rises.
        let valley = Grid::of(&points(|x, _| x - 43.0)).unwrap().contour(5.0);
        assert!(valley.len() >= 12);
        for [x, _] in valley.as_flattened() {
            assert!((x - 38.0).abs().min((x - 48.0).abs()) < 1e-9, "{x}");
        }
    }

    #[test]
    fn a_contour_round_a_summit_closes() {
        let grid = Grid::of(&points(|x, y| 20.0 - ((x - 41.0) / 10.0).powi(2) - ((y - 14.0) / 5.0).powi(2))).unwrap();
        let mut ends = std::collections::BTreeMap::<String, u32>::new();
        for [x, y] in grid.contour(17.0).as_flattened() {
            *ends.entry(format!("{x:.6} {y:.6}")).or_default() += 1;
        }
        assert!(ends.len() > 8 && ends.values().all(|count| *count == 2), "{ends:?}");
    }

    #[test]
    fn only_fine_grids_have_contours_and_these_have_labels() {
        let drawn = |count: i32| {
            let all = (0..count).flat_map(|i| (0..count).map(move |j| [f64::from(i), f64::from(j)]));
            let surface: Vec<_> = all.map(|at| Point { at, value: at[0], is_settled: at[0] > 0.5 }).collect();
            let map = Map { title: "", surface, points: Vec::new(), unknown: &[[0.0, 0.0]] };
            draw(&[map], ["x", "y"], &[], &[], 88.0)
        };
        let (coarse, fine) = (drawn(CONTOUR_NODES as i32 - 1), drawn(CONTOUR_NODES as i32));
        let contours = |svg: &str| svg.matches("stroke=\"#ffffff\" stroke-width=\"0.7\"").count();
        let labels = |svg: &str| svg.matches("paint-order=\"stroke\"").count();
        assert_eq!((contours(&coarse), labels(&coarse)), (0, 0));
        assert!(contours(&fine) >= 3 && labels(&fine) == contours(&fine), "{fine}");
        // The first column is not settled, and one point is unknown.
        let marks = (coarse.matches("<circle").count(), coarse.matches("h2.2v2.2h-2.2Z").count());
        assert_eq!(marks, (CONTOUR_NODES - 1, 1));
    }

    #[test]
    fn a_point_outside_the_grid_leaves_the_cells_their_shape() {
        let nodes = points(|x, _| x);
        let of = |axes: [Axis; 2]| {
            let [x, y] = axes;
            let mut sheet = Sheet::new(88.0);
            let panel = Panel { x, y, left: 0.0, top: 0.0, width: 100.0, height: 100.0 };
            Grid::of(&nodes).unwrap().cells(&mut sheet, &panel, &|_| String::new());
            let svg = sheet.svg(100.0);
            // The first is the sheet.
            let widths = svg.split("<rect").skip(2).filter_map(|rect| rect.split("width=\"").nth(1)?.split('"').next());
            widths.filter_map(|width| width.parse().ok()).collect::<Vec<f64>>()
        };
        let of_cells = |k: usize| nodes.iter().map(move |point| point.at[k]);
        let x = extent(of_cells(0), of_cells(0).chain([43.0, 100.0]), "");
        let y = extent(of_cells(1), of_cells(1), "");
        assert_eq!([x.low, x.high, y.low, y.high], [-5.0, 105.0, -2.5, 32.5]);
        let widths = of([x, y]);
        assert!(widths.len() == 63 && widths.iter().all(|width| (width - widths[0]).abs() < 0.02), "{widths:?}");
    }

    #[test]
    fn scattered_points_are_no_grid() {
        let scattered: Vec<_> = (0..30)
            .map(|i| Point { at: [f64::from(i) * 1.1, f64::from(i * i % 17)], ..points(|_, _| 1.0)[0] })
            .collect();
        assert_eq!(Grid::of(&scattered), None);
        let mut holes = points(|x, _| x);
        holes.truncate(50);
        assert!(Grid::of(&holes).unwrap().values.iter().flatten().any(|value| value.is_nan()));
    }
}
