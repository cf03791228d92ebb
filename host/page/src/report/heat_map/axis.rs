//! The axis of a map: the nodes of a grid, or a range of speeds.

use super::Point;
use crate::ticks;
use protocol::units::CentiRpm;

/// The most cells along an axis: more are too small to see.
const MAX_CELLS: usize = 40;

/// Room about the outermost dots, as a share of their range.
const MARGIN: f64 = 0.06;

/// Speeds from left to right, or from bottom to top.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Axis {
    Grid(Nodes),
    Range { from_rpm: f64, to_rpm: f64 },
}

/// Evenly spaced speeds.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Nodes {
    pub first_rpm: f64,
    pub step_rpm: f64,
    pub count: usize,
}

impl Axis {
    /// Returns the axes of both flagella: a grid where all speeds lie on one that can be drawn, else ranges.
    pub fn of_both(points: &[Point]) -> [Self; 2] {
        let speeds = [0, 1].map(|k| points.iter().map(|point| point.speeds_rpm[k]).collect::<Vec<_>>());
        match speeds.each_ref().map(|speeds| Nodes::of(speeds)) {
            [Some(across), Some(down)] => [Self::Grid(across), Self::Grid(down)],
            _ => speeds.map(|speeds| Self::range(&speeds)),
        }
    }

    fn range(speeds: &[f64]) -> Self {
        let low = speeds.iter().copied().fold(f64::INFINITY, f64::min);
        let high = speeds.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let margin = MARGIN * (high - low).max(1.0);
        Self::Range { from_rpm: low - margin, to_rpm: high + margin }
    }

    /// Where a speed lies, from 0 at the start of the axis to 1 at its end; on a grid, the middle of its cell.
    pub fn share(self, speed_rpm: f64) -> f64 {
        match self {
            Self::Grid(Nodes { first_rpm, step_rpm, count }) => {
                ((speed_rpm - first_rpm) / step_rpm + 0.5) / count as f64
            }
            Self::Range { from_rpm, to_rpm } => (speed_rpm - from_rpm) / (to_rpm - from_rpm),
        }
    }

    /// Returns the speeds to label on an axis of `length`, at least `spacing` apart; zero is among them if it is on the axis.
    pub fn ticks(self, length: f64, spacing: f64) -> Vec<f64> {
        match self {
            Self::Grid(Nodes { first_rpm, step_rpm, count }) => {
                let every = (spacing * count as f64 / length).ceil().max(1.0) as usize;
                let node = |i: usize| first_rpm + i as f64 * step_rpm;
                let zero = (0..count).find(|i| node(*i).abs() < 1e-6).unwrap_or(0);
                (0..count).filter(|i| i % every == zero % every).map(node).collect()
            }
            Self::Range { from_rpm, to_rpm } => ticks::round(from_rpm, to_rpm, spacing / length * (to_rpm - from_rpm)),
        }
    }
}

impl Nodes {
    /// Returns the coarsest grid on which all speeds lie, from the lowest to the highest; `None` without two different
    /// speeds or with too many nodes. Speeds are multiples of 0.01 rpm, as the board takes them.
    fn of(speeds_rpm: &[f64]) -> Option<Self> {
        let speeds: Vec<i64> = speeds_rpm.iter().map(|speed| i64::from(CentiRpm::from_rpm(*speed).0)).collect();
        let (first, last) = (*speeds.iter().min()?, *speeds.iter().max()?);
        let step = speeds.iter().fold(0, |step, speed| greatest_common_divisor(step, speed - first));
        let count = (last - first).checked_div(step)? as usize + 1;
        (count <= MAX_CELLS).then_some(Self { first_rpm: first as f64 / 100.0, step_rpm: step as f64 / 100.0, count })
    }
}

fn greatest_common_divisor(a: i64, b: i64) -> i64 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_is_the_one_that_the_speeds_span() {
        let nodes = |first_rpm, step_rpm, count| Some(Nodes { first_rpm, step_rpm, count });
        assert_eq!(Nodes::of(&[30.0, -90.0, 90.0, 70.0]), nodes(-90.0, 20.0, 10));
        assert_eq!(Nodes::of(&[0.0, 10.0, 90.0, 10.0]), nodes(0.0, 10.0, 10));
        assert_eq!(Nodes::of(&[12.5, 15.0]), nodes(12.5, 2.5, 2));
        assert_eq!([Nodes::of(&[5.0, 5.0]), Nodes::of(&[]), Nodes::of(&[0.0, 0.07, 90.0])], [None; 3]);
    }

    #[test]
    fn ticks_have_room_and_include_zero() {
        let grid = Axis::Grid(Nodes { first_rpm: -20.0, step_rpm: 10.0, count: 4 });
        assert_eq!(grid.ticks(100.0, 34.0), [-20.0, 0.0]);
        assert_eq!(grid.ticks(400.0, 34.0), [-20.0, -10.0, 0.0, 10.0]);
        let range = Axis::Range { from_rpm: -97.3, to_rpm: 88.1 };
        assert_eq!(range.ticks(310.0, 34.0), [-50.0, 0.0, 50.0]);
        assert_eq!(range.ticks(310.0, 30.0), [-80.0, -60.0, -40.0, -20.0, 0.0, 20.0, 40.0, 60.0, 80.0]);
        assert_eq!(Axis::Range { from_rpm: 0.1, to_rpm: 0.9 }.ticks(310.0, 60.0).len(), 4);
    }
}
