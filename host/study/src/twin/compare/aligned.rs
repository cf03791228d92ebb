//! Two attitudes on a common clock, which is zero when the motors start.

use super::pair::{Pair, Side};
use super::shift::{self, RATE_HZ};
use std::ops::Range;

/// Shortest common time of two runs that can be compared, s.
const SHORTEST_S: f64 = 1.0;

/// Largest difference between the lengths of two runs without a warning, s.
const SAME_LENGTH_S: f64 = 0.5;

/// Both attitudes at the same times.
pub(super) struct Aligned {
    /// Times from the start of the runs, s.
    pub times_s: Vec<f64>,
    /// Measured yaw, pitch and roll; NaN in a gap of the log.
    pub measured_deg: Vec<[f64; 3]>,
    /// The same for the model.
    pub modelled_deg: Vec<[f64; 3]>,
    /// Indices of the points in the run.
    pub in_run: Range<usize>,
    /// Length of the shorter run, s.
    pub common_s: f64,
    /// Lengths of both runs, if they differ, s.
    pub lengths_s: Option<[f64; 2]>,
    /// Time by which the model is moved, s.
    pub shift_s: f64,
}

impl Aligned {
    /// Returns both attitudes from the still phase to the end of their common time; `None` if the runs do not overlap.
    pub fn new(pair: &Pair) -> Option<Self> {
        let Pair { measured, modelled } = pair;
        let lengths_s = [measured.run_s(), modelled.run_s()];
        let common_s = lengths_s[0].min(lengths_s[1]);
        let start = measured.span().start.max(modelled.span().start);
        let end = measured.span().end.min(modelled.span().end);
        if common_s < SHORTEST_S || end - start < SHORTEST_S || start >= common_s {
            return None;
        }
        let grid = (start * RATE_HZ).ceil() as i64..=(end * RATE_HZ).floor() as i64;
        let times_s: Vec<f64> = grid.map(|i| i as f64 / RATE_HZ).collect();
        let in_run = times_s.partition_point(|t| *t < 0.0)..times_s.partition_point(|t| *t <= common_s);
        let mut measured_deg = angles(measured, &times_s, 0.0);
        let mut modelled_deg = angles(modelled, &times_s, 0.0);
        let shift_s =
            if pair.is_replay() || pair.has_steady_state() { 0.0 } else { shift::of(&measured_deg, &modelled_deg) };
        if shift_s != 0.0 {
            modelled_deg = angles(modelled, &times_s, shift_s);
        }
        leave_out_gaps(&mut measured_deg, measured, &times_s, 0.0);
        leave_out_gaps(&mut modelled_deg, modelled, &times_s, shift_s);
        let is_same_length = (lengths_s[0] - lengths_s[1]).abs() <= SAME_LENGTH_S;
        let lengths_s = (!is_same_length).then_some(lengths_s);
        let aligned = Self { times_s, measured_deg, modelled_deg, in_run, common_s, lengths_s, shift_s };
        (aligned.share() > 0.0).then_some(aligned)
    }

    /// Returns the errors of an angle (0 to 2: yaw, pitch, roll) over the run, without gaps.
    pub fn errors(&self, angle: usize) -> impl Iterator<Item = f64> {
        let error = move |i: usize| self.modelled_deg[i][angle] - self.measured_deg[i][angle];
        self.in_run.clone().map(error).filter(|error| error.is_finite())
    }

    /// Returns the root mean square of the errors.
    pub fn rmse_deg(&self, angle: usize) -> f64 {
        (self.errors(angle).map(|error| error * error).sum::<f64>() / self.errors(angle).count() as f64).sqrt()
    }

    /// Returns the share of the run in which both attitudes are known.
    pub fn share(&self) -> f64 {
        self.errors(0).count() as f64 / self.in_run.len().max(1) as f64
    }
}

fn angles(side: &Side, times_s: &[f64], shift_s: f64) -> Vec<[f64; 3]> {
    times_s.iter().map(|time| side.zeroed.at(time - shift_s + side.start_s)).collect()
}

fn leave_out_gaps(angles: &mut [[f64; 3]], side: &Side, times_s: &[f64], shift_s: f64) {
    let on_clock = times_s.iter().map(|time| time - shift_s + side.start_s);
    let seen = side.zeroed.angles_deg.are_seen(on_clock);
    angles.iter_mut().zip(seen).filter(|(_, is_seen)| !is_seen).for_each(|(row, _)| *row = [f64::NAN; 3]);
}
