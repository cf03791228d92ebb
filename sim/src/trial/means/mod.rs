//! The steady state of a run: means over both motor angles, amplitudes at its end, and when the attitude settled.
//!
//! Two rules give the means:
//!
//! - [`SteadyCollector::steady`], for a model: the constant term of the double Fourier series over both motor angles, with
//!   its standard error ([`series`]), from the second half of the run, at most [`STRETCH`]. The run is settled when twice the
//!   standard errors of yaw, pitch, roll and thrusts are within [`Limits`]. The means of a run that is not settled are the
//!   values that a slow approach has reached, with the standard errors of its end. No standard error is below the solver's,
//!   and flagella that mesh have one for their variation over minutes. At speeds whose ratio is nearly simple
//!   ([`ratio::slips`]) the means cover only the phases that have passed, and have no standard errors. A run shorter than two
//!   windows of [`WINDOW`] shows no slow approach; it has the means of the other rule, without standard errors.
//! - [`SteadyCollector::window`], for a measured trial, whose sensor drifts, and for a motion that repeats: the mean over
//!   time in the window, by the trapezoidal rule. The run is settled when yaw, pitch and roll of the window agree with those
//!   of the window before.
//!
//! The window is the end of the run. Its length is at most [`WINDOW`], and as near as possible to whole revolutions of both
//! motors ([`whole_turns`]): the attitude swings with both, and a part of a revolution would bias its mean. Window and
//! stretch begin after the last reversal of a motor: a mean over both directions is no steady state. An amplitude is half the
//! range over the window. The settling time is the end of the last block of about 2 s whose mean yaw or pitch is not yet near
//! the final one.
//!
//! The slow mode of a pair of flagella decays in 10 to 18 s; some modes of two flagella that do not touch need minutes.

mod least;
pub mod ratio;
pub mod series;
mod window;

pub use window::{WINDOW, whole_turns};

use crate::functions::exp;
use serde::{Deserialize, Serialize};
use series::Cell;
use std::collections::VecDeque;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Longest stretch for means over both motor angles, s.
pub const STRETCH: f64 = 300.0;

/// Largest uncertainties (95 %) of the means of a settled run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Of yaw, pitch and roll, rad.
    pub angle: f64,
    /// Of both thrusts, as a share of the larger one.
    pub thrust: f64,
}

/// Limits of a run in whose stretch the flagella do not touch.
pub const FREE: Limits = Limits { angle: 0.1 * PI / 180.0, thrust: 0.01 };

/// Limits of a run in whose stretch the flagella touch.
pub const TOUCHING: Limits = Limits { angle: 0.3 * PI / 180.0, thrust: 0.03 };

/// Longest time constant of the slow mode of a pair of flagella, s.
const SLOWEST_S: f64 = 18.0;

/// A difference below this share of a run's length is rounding.
const ROUNDING: f64 = 1e-6;

/// A thrust below this, N, counts as zero.
const NO_THRUST: f64 = 1e-5;

/// Cells in a revolution of the faster motor.
const CELLS: f64 = 12.0;

/// Longest cell, s.
const LONGEST_CELL: f64 = 0.25;

/// Approximate length of the blocks for the settling time, s.
const BLOCK: f64 = 2.0;

/// An angle is near its final value within this, degrees, or within this share of the value.
const NEAR_DEG: f64 = 1.0;
const NEAR_SHARE: f64 = 0.05;

/// Number of quantities: yaw, pitch, roll (rad), force of flagellum 1 and 2 on the base (N,
/// body axes), reaction torques about the shafts (N m).
pub const CHANNELS: usize = 11;

/// Mean of a quantity, and half its range over the window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// Mean.
    pub mean: f64,
    /// Half the range: (largest - smallest)/2.
    pub amplitude: f64,
    /// Standard error of the mean; `None` where it is unknown.
    #[serde(default)]
    pub standard_error: Option<f64>,
}

/// The steady state of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Steady {
    /// Length of the stretch that the means are taken from, s.
    pub window_s: f64,
    /// Yaw (unwrapped), pitch, roll in rad.
    pub attitude: [Level; 3],
    /// Force of flagellum 1 and 2 on the base, body axes, N.
    pub force: [[Level; 3]; 2],
    /// Reaction torques about the shafts, N m.
    pub axial_torque: [Level; 2],
    /// Target speeds of the motors at the end of the run, rad/s: an input, which is not stored with the results.
    #[serde(skip, default = "unknown")]
    pub speeds_rad_s: [f64; 2],
    /// Whether the means are known and reached, by the rules in the documentation of [`crate::trial::means`].
    pub settled: bool,
    /// Time from the start of the run, s, after which all block means of yaw and pitch are within 1 degree or 5 % of the
    /// final mean, whichever is larger.
    pub settle_s: f64,
}

/// Returns the distance from its final value, degrees, within which a yaw or pitch counts as settled.
pub fn settled_within_deg(final_deg: f64) -> f64 {
    NEAR_DEG.max(NEAR_SHARE * final_deg.abs())
}

/// Returns whether an angle is near its final value, both rad.
fn is_near(angle: f64, last: f64) -> bool {
    (angle - last).to_degrees().abs() <= settled_within_deg(last.to_degrees())
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Entry {
    time: f64,
    values: [f64; CHANNELS],
}

/// Computes the steady state of a run value by value. It keeps the values of two windows, the means of the cells of at most
/// one [`STRETCH`], and the mean yaw and pitch of each block.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SteadyCollector {
    start: f64,
    /// From here on no motor reverses.
    from: f64,
    speeds: [f64; 2],
    window: f64,
    recent: VecDeque<Entry>,
    block: f64,
    block_end: f64,
    blocks: Vec<(f64, [f64; 2])>,
    cell: f64,
    cell_end: f64,
    /// Integral of the values over the present cell so far.
    sums: [f64; CHANNELS],
    /// Whether the flagella have touched in it.
    touched: bool,
    cells: VecDeque<Cell>,
    /// Whether flagella that touch mesh.
    #[serde(default)]
    mesh: bool,
}

impl SteadyCollector {
    /// Returns the collector of a run from `start` to `end` (s) whose motors have these speeds (rad/s) at its end.
    pub fn new(start: f64, end: f64, speeds_rad_s: [f64; 2]) -> Self {
        Self::after_reversal(start, start, end, speeds_rad_s)
    }

    /// Returns the collector of a run in which a motor reverses; no motor does after the time `from` (s).
    pub fn after_reversal(start: f64, from: f64, end: f64, speeds_rad_s: [f64; 2]) -> Self {
        let from = from.clamp(start, end.max(start));
        let window = whole_turns(speeds_rad_s, end - from);
        // Whole blocks make a window.
        let block = window / (window / BLOCK).round().max(1.0);
        let fastest = speeds_rad_s[0].abs().max(speeds_rad_s[1].abs());
        let cell = LONGEST_CELL.min(TAU / fastest / CELLS);
        Self {
            start,
            from,
            speeds: speeds_rad_s,
            window,
            block,
            block_end: from + block,
            cell,
            cell_end: from + cell,
            ..Self::default()
        }
    }

    /// Sets whether the flagella mesh where they touch.
    pub fn meshing(self, mesh: bool) -> Self {
        Self { mesh, ..self }
    }

    /// Copies the first values of another collector if this one has none.
    pub(crate) fn begin_with(&mut self, other: &Self) {
        if self.recent.is_empty() {
            self.recent.extend(other.recent.front().filter(|first| first.time >= self.from));
        }
    }

    /// Adds values at a time of the run (s), and whether a flagellum touches the other or itself. Times must not decrease;
    /// values before the start, or the last reversal, are ignored.
    pub fn push(&mut self, time: f64, values: [f64; CHANNELS], touching: bool) {
        if time < self.from {
            return;
        }
        let entry = Entry { time, values };
        if let Some(before) = self.recent.back().copied() {
            self.add_to_cells(before, entry, touching);
        }
        self.recent.push_back(entry);
        while self.recent.get(1).is_some_and(|e| e.time < time - 2.0 * self.window) {
            self.recent.pop_front();
        }
        // A run without a duration has no blocks.
        while self.block > 0.0 && time >= self.block_end {
            let levels = self.levels(self.block_end - self.block, self.block_end);
            self.blocks.push((self.block_end, [levels[0].mean, levels[1].mean]));
            self.block_end += self.block;
        }
    }

    /// Adds the values between two times to the means of cells.
    fn add_to_cells(&mut self, a: Entry, b: Entry, touching: bool) {
        let mut left = a;
        while left.time < b.time {
            let time = b.time.min(self.cell_end);
            let share = (time - a.time) / (b.time - a.time);
            let right =
                Entry { time, values: std::array::from_fn(|c| a.values[c] + (b.values[c] - a.values[c]) * share) };
            self.touched |= touching;
            for c in 0..CHANNELS {
                self.sums[c] += 0.5 * (left.values[c] + right.values[c]) * (right.time - left.time);
            }
            if time == self.cell_end {
                let values = self.sums.map(|sum| sum / self.cell);
                self.cells.push_back(Cell { time: self.cell_end - 0.5 * self.cell, values, touched: self.touched });
                if self.cells.len() as f64 * self.cell > STRETCH {
                    self.cells.pop_front();
                }
                (self.sums, self.touched) = ([0.0; CHANNELS], false);
                self.cell_end += self.cell;
            }
            left = right;
        }
    }

    /// Returns means and amplitudes between two times (s), by the trapezoidal rule with values interpolated at the ends.
    fn levels(&self, from: f64, to: f64) -> [Level; CHANNELS] {
        let mut sums = [0.0; CHANNELS];
        let mut low = [f64::INFINITY; CHANNELS];
        let mut high = [f64::NEG_INFINITY; CHANNELS];
        let mut length = 0.0;
        for (a, b) in self.recent.iter().zip(self.recent.iter().skip(1)) {
            let (left, right) = (a.time.max(from), b.time.min(to));
            if right <= left {
                continue;
            }
            length += right - left;
            let share = |t: f64| (t - a.time) / (b.time - a.time);
            for c in 0..CHANNELS {
                let at = |t: f64| a.values[c] + (b.values[c] - a.values[c]) * share(t);
                let (x, y) = (at(left), at(right));
                sums[c] += 0.5 * (x + y) * (right - left);
                low[c] = low[c].min(x).min(y);
                high[c] = high[c].max(x).max(y);
            }
        }
        std::array::from_fn(|c| {
            if length > 0.0 {
                Level { mean: sums[c] / length, amplitude: 0.5 * (high[c] - low[c]), standard_error: None }
            } else {
                Level { mean: self.recent.back().map_or(0.0, |e| e.values[c]), ..Level::default() }
            }
        })
    }

    /// Returns the steady state of the run so far: means over both motor angles, from its second half.
    pub fn steady(&self) -> Steady {
        let end = self.end();
        let mut levels = self.levels(end - self.window, end);
        let from = (0.5 * (self.from + end)).max(end - STRETCH);
        let first = self.cells.partition_point(|cell| cell.time < from);
        let cells: Vec<Cell> = self.cells.range(first..).copied().collect();
        // Two windows, except for rounding.
        let is_long = end - self.from >= 2.0 * WINDOW * (1.0 - ROUNDING);
        let Some(means) = is_long.then(|| series::means(&cells, self.cell, self.speeds)).flatten() else {
            return Steady { settled: false, ..self.window() };
        };
        for (level, mean) in levels.iter_mut().zip(&means) {
            (level.mean, level.standard_error) = (mean.mean, Some(mean.standard_error));
        }
        let touches = cells.iter().any(|cell| cell.touched);
        let limits = if touches { TOUCHING } else { FREE };
        let stretch_s = cells.len() as f64 * self.cell;
        if ratio::slips(self.speeds, stretch_s, touches) {
            // The phases that have passed do not show how far they are from the mean over all phases.
            levels.iter_mut().for_each(|level| level.standard_error = None);
            return self.state(stretch_s, levels, false);
        }
        let with_errors = |levels| {
            let mut steady = self.state(stretch_s, levels, false);
            steady.raise_errors(touches);
            if touches && self.mesh {
                steady.add_errors_of_meshing();
            }
            steady
        };
        let mut steady = with_errors(levels);
        steady.settled = steady.is_known_within(&limits);
        if steady.settled {
            return steady;
        }
        // The end of an approach is not known well: the means are the values that it has reached.
        for (level, mean) in levels.iter_mut().zip(&means) {
            level.mean = mean.mean - mean.to_come;
        }
        with_errors(levels)
    }

    /// Returns the steady state of the run so far: means over time in the window.
    pub fn window(&self) -> Steady {
        let [before, last] = self.windows();
        let end = self.end();
        // A window without a length, after a reversal at the very end, shows no state.
        let enough = self.window > 0.0 && end - self.from >= 1.999 * self.window;
        let agree = |a: f64, b: f64| (a - b).abs() <= 0.5f64.to_radians().max(0.01 * b.abs());
        let settled = enough && (0..3).all(|c| agree(before[c].mean, last[c].mean));
        self.state(self.window, last, settled)
    }

    /// Returns means and amplitudes of the window before the last one, and of the last one.
    fn windows(&self) -> [[Level; CHANNELS]; 2] {
        let end = self.end();
        [2.0, 1.0].map(|n| self.levels(end - n * self.window, end - (n - 1.0) * self.window))
    }

    /// Returns by how much a slow approach may still change the mean yaw, pitch and roll of the window, rad, from the
    /// difference of two windows and a time constant of 18 s.
    pub fn to_come(&self) -> [f64; 3] {
        let [before, last] = self.windows();
        let left = exp(-self.window / SLOWEST_S);
        [0, 1, 2].map(|c| (last[c].mean - before[c].mean).abs() * left / (1.0 - left))
    }

    /// Returns the state, with an attitude of NaN if the base turned over: its axis pointed below the horizontal, so the roll
    /// was more than a right angle.
    pub(crate) fn unless_overturned(&self, steady: Steady) -> Steady {
        let (cells, recent) = (self.cells.iter().map(|c| c.values[2]), self.recent.iter().map(|e| e.values[2]));
        if cells.chain(recent).all(|roll| roll.abs() <= FRAC_PI_2) {
            return steady;
        }
        let attitude = [Level { mean: f64::NAN, ..Level::default() }; 3];
        Steady { attitude, settled: false, ..steady }
    }

    fn end(&self) -> f64 {
        self.recent.back().map_or(self.from, |e| e.time)
    }

    fn state(&self, window_s: f64, levels: [Level; CHANNELS], settled: bool) -> Steady {
        let unsettled =
            (self.blocks.iter()).rev().find(|(_, means)| !(0..2).all(|c| is_near(means[c], levels[c].mean)));
        let vector = |c: usize| [levels[c], levels[c + 1], levels[c + 2]];
        Steady {
            window_s,
            attitude: vector(0),
            force: [vector(3), vector(6)],
            axial_torque: [levels[9], levels[10]],
            speeds_rad_s: self.speeds,
            settled,
            settle_s: unsettled.map_or(self.from, |(time, _)| *time) - self.start,
        }
    }
}

fn unknown() -> [f64; 2] {
    [f64::NAN; 2]
}

impl Level {
    /// Returns the 95 % uncertainty of the mean; infinite where it is unknown.
    pub fn uncertainty(&self) -> f64 {
        2.0 * self.standard_error.unwrap_or(f64::INFINITY)
    }
}

impl Steady {
    /// Returns whether the robot has turned over.
    pub fn is_overturned(&self) -> bool {
        self.attitude[0].mean.is_nan()
    }

    /// Returns whether the uncertainties of yaw, pitch, roll and both thrusts are within limits.
    pub fn is_known_within(&self, limits: &Limits) -> bool {
        let thrusts = self.force.map(|force| force[2]);
        let larger = thrusts[0].mean.abs().max(thrusts[1].mean.abs()).max(NO_THRUST);
        self.attitude.iter().all(|angle| angle.uncertainty() <= limits.angle)
            && thrusts.iter().all(|thrust| thrust.uncertainty() <= limits.thrust * larger)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_run_without_a_duration_ends() {
        let mut collector = SteadyCollector::new(3.0, 3.0, [0.0; 2]);
        collector.push(3.0, [0.5; CHANNELS], false);
        assert_eq!(collector.steady().attitude[0], Level { mean: 0.5, amplitude: 0.0, standard_error: None });
    }

    /// A motor turned the other way until 3 s before the end: no mean includes the attitude from before.
    #[test]
    fn a_window_begins_after_a_reversal() {
        let mut collector = SteadyCollector::after_reversal(5.0, 42.0, 45.0, [5.3, -7.1]);
        for i in 0..=4000 {
            let time = 5.0 + 0.01 * f64::from(i);
            collector.push(time, [if time < 42.0 { -1.0 } else { 2.0 }; CHANNELS], false);
        }
        let steady = collector.steady();
        assert_eq!(steady.attitude[0], Level { mean: 2.0, amplitude: 0.0, standard_error: None });
        assert!(steady.window_s <= 3.0 && !steady.settled, "{steady:?}");
        assert_eq!(steady.settle_s, 37.0);

        let mut collector = SteadyCollector::after_reversal(5.0, 45.7, 45.0, [5.3, -7.1]);
        collector.push(45.0, [0.5; CHANNELS], false);
        let steady = collector.window();
        assert!(steady.window_s == 0.0 && !steady.settled, "{steady:?}");
    }

    #[test]
    fn a_base_that_turns_over_has_no_attitude() {
        for (most, is_overturned) in [(89.0_f64, false), (91.0, true)] {
            let mut collector = SteadyCollector::new(0.0, 60.0, [1.0, 2.0]);
            for i in 0..=6000 {
                let mut values = [0.5; CHANNELS];
                values[2] = if (2000..2200).contains(&i) { -most.to_radians() } else { 0.0 };
                collector.push(0.01 * f64::from(i), values, false);
            }
            let steady = collector.unless_overturned(collector.steady());
            assert_eq!(steady.is_overturned(), is_overturned, "{steady:?}");
            assert!(!is_overturned || !steady.settled);
            assert_eq!(steady.force, collector.steady().force);
        }
    }

    /// Two motors whose phase slips by a turn in 33 minutes.
    #[test]
    fn a_phase_that_slips_slowly_has_no_known_mean() {
        let settled = |rpm: [f64; 2], touching: bool| {
            let mut collector = SteadyCollector::new(0.0, 120.0, rpm.map(|rpm| rpm * PI / 30.0));
            (0..=3000).for_each(|i| collector.push(f64::from(i) * 0.04, [0.5; CHANNELS], touching));
            let steady = collector.steady();
            (steady.settled, steady.attitude[0].standard_error.is_some())
        };
        assert_eq!(settled([45.5, -45.53], false), (false, false));
        assert_eq!(settled([45.5, -45.5], false), (true, true));
        // 4:3 with a slip of a turn in 1000 s, over which the thrusts of the robot `physical`, whose flagella touch, vary by
        // 5 %.
        assert_eq!(settled([84.02, 63.0], true), (false, false));
        assert_eq!(settled([84.0, 63.0], true), (true, true));
    }

    /// A short run does not show how meshing flagella vary over minutes.
    #[test]
    fn flagella_that_mesh_are_known_after_a_longer_run() {
        let settled = |mesh: bool, touching: bool, end: i32| {
            let speeds = [-4.1, -5.3];
            let mut collector = SteadyCollector::new(0.0, f64::from(end), speeds).meshing(mesh);
            (0..=25 * end).for_each(|i| collector.push(f64::from(i) * 0.04, [0.5; CHANNELS], touching));
            collector.steady().settled
        };
        assert!(!settled(true, true, 120) && settled(true, true, 300));
        assert!(settled(true, false, 120) && settled(false, true, 120));
    }

    #[test]
    fn a_decaying_turn_settles_when_it_should() {
        let mut collector = SteadyCollector::new(0.0, 120.0, [3.0 * PI, 3.0 * PI]);
        for i in 0..=3000 {
            let t = i as f64 * 0.04;
            let mut values = [0.0; CHANNELS];
            values[0] = 1.0 - (-t / 10.0).exp() + 0.1 * (3.0 * PI * t).cos();
            collector.push(t, values, false);
        }
        let steady = collector.steady();
        assert!((steady.attitude[0].mean - 1.0).abs() < 1e-4);
        assert!((steady.attitude[0].amplitude - 0.1).abs() < 2e-3);
        assert!(steady.settled);
        // The mean over the window lags by the rest of the approach: here less than with a time constant of 18 s.
        let [left, first] = [120.0, 108.0].map(|t: f64| (-t / 10.0).exp() * 10.0);
        let behind = 1.0 - collector.window().attitude[0].mean;
        assert!((behind - (first - left) / 12.0).abs() < 1e-6, "{behind}");
        assert!((1.0..3.0).contains(&(collector.to_come()[0] / behind)), "{:?}", collector.to_come());
        // 5 % of the final mean is reached after 3 time constants.
        assert!((steady.settle_s - 30.0).abs() < 3.0, "{}", steady.settle_s);
    }
}
