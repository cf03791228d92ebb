//! The motion that is judged: rates about the body's axes at a regular interval.

use crate::attitude::Columns;
use sim::body::attitude::{of_euler_zyx, rotation_between};
use std::ops::Range;

/// Intervals of the readings after averaging, s: the first whose bins nearly all have a reading. With the first one, harmonics
/// of the fastest motor stay below the Nyquist frequency; with the second one, its own turn does.
const INTERVALS_S: [f64; 2] = [0.1, 0.2];

/// Length of the end of a run that is judged, s.
const LONGEST_S: f64 = 60.0;

/// Shortest part that can be judged, s.
const SHORTEST_S: f64 = 10.0;

/// Why there is no motion of a part.
pub const TOO_FEW: &str = "the run is too short or has too few readings";

/// Length of the pieces in which a stop is looked for, s.
pub const PIECE_S: f64 = 3.0;

/// Rates about x, y and z.
pub struct Motion {
    /// Times relative to the middle of the part, s.
    pub t: Vec<f64>,
    /// Interval of the times, s.
    pub interval_s: f64,
    /// Rates in °/s; a column is an axis.
    pub rates: [Vec<f64>; 3],
    /// Length of the part, s.
    pub length_s: f64,
    /// Variances of the noise of an averaged angle about x, y and z, °².
    pub variances: [f64; 3],
    /// Their mean, °².
    pub angle_variance: f64,
}

impl Motion {
    /// Averages a part of the readings of yaw, pitch and roll (°). Returns `None` if the part is too short or has too few
    /// readings.
    pub fn of(angles_deg: &Columns<3>, part_s: Range<f64>) -> Option<Self> {
        let start_s = part_s.start.max(part_s.end - LONGEST_S);
        let [first, end] = [start_s, part_s.end].map(|at_s| angles_deg.time_s.partition_point(|t| *t < at_s));
        let time_s = &angles_deg.time_s[first.min(end)..end];
        let turned = turned(angles_deg.values.each_ref().map(|angle| &angle[first.min(end)..end]));
        INTERVALS_S.into_iter().find_map(|interval_s| {
            let count = ((part_s.end - start_s) / interval_s).floor().max(0.0) as usize;
            if (count as f64) * interval_s < SHORTEST_S {
                return None;
            }
            let bins = Bins { time_s, start_s, interval_s, count };
            let [x, y, z] = turned.each_ref().map(|turned| bins.mean(turned));
            let rates = [x?, y?, z?].map(|turned| differences(&turned, interval_s));
            let count = rates[0].len();
            let t = (0..count).map(|i| (i as f64 - (count - 1) as f64 / 2.0) * interval_s).collect();
            let variances = rates.each_ref().map(|rate| noise(rate, interval_s));
            let angle_variance = variances.iter().sum::<f64>() / 3.0;
            Some(Self { t, interval_s, rates, length_s: count as f64 * interval_s, variances, angle_variance })
        })
    }

    /// Returns the time at which the swing falls below a fifth of its size and stays there, s from the start of the part.
    pub fn stops(&self) -> Option<f64> {
        let size = (PIECE_S / self.interval_s) as usize;
        let piece = |from: usize| -> f64 {
            let of_axis = |rate: &Vec<f64>| {
                // The median ignores a single slip of a marker.
                let mut changes: Vec<f64> =
                    rate[from..from + size].windows(4).map(|few| (few[3] - few[0]).abs()).collect();
                changes.sort_by(f64::total_cmp);
                changes[changes.len() / 2]
            };
            self.rates.iter().map(of_axis).sum()
        };
        let sizes: Vec<f64> = (0..self.rates[0].len() / size).map(|i| piece(i * size)).collect();
        let is_still = |i: usize| {
            let (before, after) = sizes.split_at(i);
            let mut before = before.to_vec();
            before.sort_by(f64::total_cmp);
            after.iter().all(|size| *size * 5.0 < before[before.len() / 2])
        };
        (1..sizes.len().saturating_sub(1)).find(|&i| is_still(i)).map(|i| i as f64 * PIECE_S)
    }
}

/// Returns how far a body has turned about its own axes, °, from its yaw, pitch and roll.
fn turned(angles_deg: [&[f64]; 3]) -> [Vec<f64>; 3] {
    let attitude = |i: usize| of_euler_zyx(angles_deg.map(|angle| angle[i].to_radians()));
    let mut all = [vec![0.0], vec![0.0], vec![0.0]];
    let attitudes: Vec<_> = (0..angles_deg[0].len()).map(attitude).collect();
    for (i, pair) in attitudes.windows(2).enumerate() {
        let step = rotation_between(&pair[0], &pair[1]);
        for (axis, column) in all.iter_mut().enumerate() {
            column.push(column[i] + step[axis].to_degrees());
        }
    }
    all
}

/// Returns rates from angles an interval apart.
fn differences(angles: &[f64], interval_s: f64) -> Vec<f64> {
    angles.windows(2).map(|pair| (pair[1] - pair[0]) / interval_s).collect()
}

/// Returns the variance of the noise of the angles that have these rates. Third differences of rates contain hardly any motion.
fn noise(rates: &[f64], interval_s: f64) -> f64 {
    let third: Vec<f64> = rates.windows(4).map(|r| (r[3] - 3.0 * r[2] + 3.0 * r[1] - r[0]) * interval_s).collect();
    let mut squares: Vec<f64> = third.iter().map(|x| x * x).collect();
    squares.sort_by(f64::total_cmp);
    // The median of a square of a normal variable is 0.455 of its mean; (1 - z)^4 has coefficients 1, 4, 6, 4, 1.
    squares.get(squares.len() / 2).map_or(0.0, |median| median / 0.455 / 70.0)
}

struct Bins<'a> {
    time_s: &'a [f64],
    start_s: f64,
    interval_s: f64,
    count: usize,
}

impl Bins<'_> {
    /// Returns the means of intervals. An interval without a reading is interpolated between its neighbours. Returns `None` if
    /// more than a tenth of the intervals have none.
    fn mean(&self, column: &[f64]) -> Option<Vec<f64>> {
        let (mut sums, mut counts) = (vec![0.0; self.count], vec![0.0; self.count]);
        for (t, value) in self.time_s.iter().zip(column) {
            // If the readings of a table are an interval apart, rounding would leave empty bins.
            let bin = ((t - self.start_s) / self.interval_s + 1e-6) as usize;
            if bin >= self.count {
                break;
            }
            if value.is_finite() {
                sums[bin] += value;
                counts[bin] += 1.0;
            }
        }
        let filled: Vec<usize> = (0..self.count).filter(|&bin| counts[bin] > 0.0).collect();
        if filled.len() * 10 < self.count * 9 {
            return None;
        }
        let mean = |bin: usize| sums[bin] / counts[bin];
        let between = |bin: usize| {
            let next = filled.partition_point(|&at| at < bin);
            match (next.checked_sub(1).map(|i| filled[i]), filled.get(next).copied()) {
                (_, Some(at)) if at == bin => mean(bin),
                (Some(a), Some(b)) => mean(a) + (mean(b) - mean(a)) * (bin - a) as f64 / (b - a) as f64,
                (Some(a), None) | (None, Some(a)) => mean(a),
                (None, None) => 0.0,
            }
        };
        Some((0..self.count).map(between).collect())
    }
}
