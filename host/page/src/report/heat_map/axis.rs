//! The axis of a map: a range of speeds, in the cells of a grid if they lie on one.

use super::Point;
use crate::ticks;
use protocol::units::CentiRpm;
use study::statistics::extremes;

/// Largest number of cells along an axis: more are too small to see.
const MAX_CELLS: usize = 40;

/// Room about the outermost dots, as a share of their range.
const MARGIN: f64 = 0.06;

/// Speeds from left to right, or from bottom to top.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Axis {
    from_rpm: f64,
    to_rpm: f64,
    /// Number of evenly spaced speeds, each in the middle of its cell; 0 if the speeds lie on no grid.
    pub nodes: usize,
}

impl Axis {
    /// Returns the axes of both flagella: a grid if all speeds lie on one that can be drawn, otherwise ranges.
    pub fn of_both(points: &[Point]) -> [Self; 2] {
        let speeds = [0, 1].map(|k| points.iter().map(|point| point.speeds_rpm[k]).collect::<Vec<_>>());
        match speeds.each_ref().map(|speeds| Self::grid(speeds)) {
            [Some(across), Some(down)] => [across, down],
            _ => speeds.map(|speeds| Self::range(&speeds)),
        }
    }

    fn range(speeds: &[f64]) -> Self {
        let [low, high] = extremes(speeds.iter().copied());
        let margin = MARGIN * (high - low).max(1.0);
        Self { from_rpm: low - margin, to_rpm: high + margin, nodes: 0 }
    }

    /// Returns the coarsest grid on which all speeds lie, from the lowest to the highest; `None` without two different
    /// speeds or with too many nodes. Speeds are multiples of 0.01 rpm, as the board takes them.
    fn grid(speeds_rpm: &[f64]) -> Option<Self> {
        let speeds: Vec<i64> = speeds_rpm.iter().map(|speed| i64::from(CentiRpm::from_rpm(*speed).0)).collect();
        let (first, last) = (*speeds.iter().min()?, *speeds.iter().max()?);
        let step = speeds.iter().fold(0, |step, speed| greatest_common_divisor(step, speed - first));
        let nodes = (last - first).checked_div(step)? as usize + 1;
        let [from_rpm, to_rpm] = [2 * first - step, 2 * last + step].map(|end| end as f64 / 200.0);
        (nodes <= MAX_CELLS).then_some(Self { from_rpm, to_rpm, nodes })
    }

    /// Returns the position of a speed, from 0 at the start of the axis to 1 at its end.
    pub fn share(self, speed_rpm: f64) -> f64 {
        (speed_rpm - self.from_rpm) / (self.to_rpm - self.from_rpm)
    }

    /// Returns the speeds to label on an axis of `length`, at least `spacing` apart; zero is among them if it is on the axis.
    pub fn ticks(self, length: f64, spacing: f64) -> Vec<f64> {
        let Self { from_rpm, to_rpm, nodes } = self;
        if nodes == 0 {
            return ticks::round(from_rpm, to_rpm, spacing / length * (to_rpm - from_rpm));
        }
        let every = (spacing * nodes as f64 / length).ceil().max(1.0) as usize;
        let node = |i: usize| from_rpm + (i as f64 + 0.5) * (to_rpm - from_rpm) / nodes as f64;
        let zero = (0..nodes).find(|i| node(*i).abs() < 1e-6).unwrap_or(0);
        (0..nodes).filter(|i| i % every == zero % every).map(node).collect()
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
        let grid = |from_rpm, to_rpm, nodes| Some(Axis { from_rpm, to_rpm, nodes });
        assert_eq!(Axis::grid(&[30.0, -90.0, 90.0, 70.0]), grid(-100.0, 100.0, 10));
        assert_eq!(Axis::grid(&[0.0, 10.0, 90.0, 10.0]), grid(-5.0, 95.0, 10));
        assert_eq!(Axis::grid(&[12.5, 15.0]), grid(11.25, 16.25, 2));
        assert_eq!([Axis::grid(&[5.0, 5.0]), Axis::grid(&[]), Axis::grid(&[0.0, 0.07, 90.0])], [None; 3]);
    }

    #[test]
    fn ticks_have_room_and_include_zero() {
        let grid = Axis { from_rpm: -25.0, to_rpm: 15.0, nodes: 4 };
        assert_eq!(grid.ticks(100.0, 34.0), [-20.0, 0.0]);
        assert_eq!(grid.ticks(400.0, 34.0), [-20.0, -10.0, 0.0, 10.0]);
        let range = Axis { from_rpm: -97.3, to_rpm: 88.1, nodes: 0 };
        assert_eq!(range.ticks(310.0, 34.0), [-50.0, 0.0, 50.0]);
        assert_eq!(range.ticks(310.0, 30.0), [-80.0, -60.0, -40.0, -20.0, 0.0, 20.0, 40.0, 60.0, 80.0]);
        assert_eq!(Axis { from_rpm: 0.1, to_rpm: 0.9, nodes: 0 }.ticks(310.0, 60.0).len(), 4);
    }
}
