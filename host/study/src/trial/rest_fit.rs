//! The noise of a robot's tilt at rest, and its return to rest, both at the input of the board's filter.
//!
//! The filter follows the accelerometer with a time constant T, and the gyroscope without delay: θ' = (a - θ)/T + ω. So
//! θ + T θ' is the accelerometer's tilt, with the gyroscope's noise and bias. Unlike the tilt's, its noise is white, so
//! even one second gives a good estimate, and it is free of the filter's settling. A robot that returns to rest has θ =
//! A exp(-t/τ), and the input is (1 - T/τ) times this: a straight-line fit of the input against the exponential gives
//! A, with its uncertainty.

use crate::attitude::Track;
use crate::statistics::Line;
use sim::functions::{exp, exp_m1, powi, sinh};
use std::ops::Range;

/// Length of the blocks in which a tilt at rest may not change, and of the blocks for the noise over time, s.
pub const BLOCK_S: f64 = 2.0;

/// The zero of the tilt is its mean over this duration at the end of the still phase, but at most over its second half,
/// s: earlier the robot may still swing, and the filter may still settle after the gyroscope's calibration.
const TILT_ZERO_S: f64 = 10.0;

/// Returns the mean of each block of a range, counted from its end.
pub(super) fn blocks(track: Track, range: &Range<f64>) -> Vec<f64> {
    let count = ((range.end - range.start) / BLOCK_S + 1e-6).floor() as usize;
    (0..count)
        .filter_map(|i| track.mean(range.end - (i + 1) as f64 * BLOCK_S..range.end - i as f64 * BLOCK_S))
        .collect()
}

/// Returns the part of a still phase that shows the tilt's zero and noise.
pub(super) fn end_of(still: &Range<f64>) -> Range<f64> {
    (still.end - TILT_ZERO_S).max(still.start)..still.end
}

/// Length of the means of the input, s, for a filter of 1 s. Over shorter times the attitude's resolution, 0.0035°,
/// would matter.
const MEAN_S: f64 = 0.2;

/// Longest fitted rest, s: over minutes, the accelerometer's reading changes with its temperature.
const LONGEST_S: f64 = 60.0;

/// Shortest time constant of a return, s.
const SHORTEST_RETURN_S: f64 = 1.0;

/// Excess scatter of blocks above which noise is not white, standard deviations. White noise exceeds it in one of
/// thirty rests.
const SLOW: f64 = 1.9;

/// Smallest share of a return to rest in the input: a filter as slow as the robot hides the return.
const LEAST_SHARE: f64 = 0.05;

/// Noise and motion of a tilt at rest.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct RestFit {
    /// Variance of a mean of the input, times the length of the mean, degrees² s.
    pub density: f64,
    /// Its degrees of freedom.
    pub freedom: f64,
    /// Remaining tilt of the return to rest in the mean over the zero, degrees, and its standard uncertainty.
    pub left_deg: [f64; 2],
}

impl RestFit {
    /// Fits a still phase whose last part, `zero`, gives the zero; returns `None` if it is too short. The board's
    /// filter has the time constant `filter_s`, the return to rest `return_s`. Early in a long phase the robot may
    /// swing: if noise and return do not explain the whole phase, only its end is fitted.
    pub fn of(tilt: Track, still: &Range<f64>, zero: &Range<f64>, filter_s: f64, return_s: f64) -> Option<Self> {
        let return_s = return_s.max(SHORTEST_RETURN_S);
        let late = (still.end - LONGEST_S).max(still.start)..still.end;
        let whole = Input::of(tilt, &late, filter_s)?.fit(zero, return_s)?;
        let end = || Input::of(tilt, &end_of(still), filter_s)?.fit(zero, return_s);
        let (fit, _) = if whole.1 { whole } else { end().unwrap_or(whole) };
        Some(fit)
    }

    /// Returns the variance of a mean of the tilt over `length_s`, degrees².
    pub fn variance(&self, length_s: f64, filter_s: f64) -> f64 {
        let lengths = length_s / filter_s;
        // The filter reduces the noise further.
        self.density / length_s * (1.0 + exp_m1(-lengths) / lengths)
    }
}

/// Means of the input of the filter.
struct Input {
    filter_s: f64,
    /// Length of a mean, s.
    mean_s: f64,
    /// Middles, s, and means, degrees.
    means: Vec<(f64, f64)>,
}

impl Input {
    fn of(tilt: Track, range: &Range<f64>, filter_s: f64) -> Option<Self> {
        let mean_s = MEAN_S * filter_s.clamp(1.0, 5.0);
        let count = ((range.end - range.start) / mean_s + 1e-6) as usize;
        let mean = |i: usize| {
            let end = range.end - (count - i - 1) as f64 * mean_s;
            let change = tilt.at(end)? - tilt.at(end - mean_s)?;
            Some((end - 0.5 * mean_s, tilt.mean(end - mean_s..end)? + filter_s * change / mean_s))
        };
        Some(Self { filter_s, mean_s, means: (0..count).map(mean).collect::<Option<_>>()? })
    }

    /// Returns the fit, and whether its noise is white.
    fn fit(&self, zero: &Range<f64>, return_s: f64) -> Option<(RestFit, bool)> {
        let group = (BLOCK_S / self.mean_s).round() as usize;
        let (count, groups) = (self.means.len() as f64, self.means.len() / group);
        if groups < 3 {
            return None;
        }
        // Per degree of the return's mean over the zero.
        let middle = 0.5 * (zero.start + zero.end);
        let share = (1.0 - self.filter_s / return_s).abs().max(LEAST_SHARE)
            / mean_of_return(zero.end - zero.start, return_s)
            * mean_of_return(self.mean_s, return_s);
        let points = self.means.iter().map(|(time, mean)| (share * exp(-(time - middle) / return_s), *mean));
        let line = Line::through(points.clone());
        let off: Vec<f64> = points.map(|point| line.off(point)).collect();
        // Level and amplitude are fitted.
        let scatter = |of: f64, length_s: f64, count: f64| (of * length_s / (count - 2.0), count - 2.0);
        let own = scatter(line.squares, self.mean_s, count);
        // Over longer times, flicker and random walk exceed the white noise.
        let of_group = |part: &[f64]| powi(part.iter().sum::<f64>() / group as f64, 2);
        let slow = scatter(off.rchunks_exact(group).map(of_group).sum(), group as f64 * self.mean_s, groups as f64);
        let is_white = slow.0 <= own.0 * (1.0 + SLOW * (2.0 / slow.1).sqrt());
        let (density, freedom) = if is_white { own } else { slow };
        let left_u_deg = (density / self.mean_s / line.spread).sqrt();
        Some((RestFit { density, freedom, left_deg: [line.slope, left_u_deg] }, is_white))
    }
}

/// Returns the mean of exp(-t/τ) over an interval centred on 0.
fn mean_of_return(length_s: f64, return_s: f64) -> f64 {
    let half = 0.5 * length_s / return_s;
    sinh(half) / half
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::Columns;
    use crate::trial::righting::left_deg;
    use crate::trial::tilt_zero::TiltZero;
    use biflag_log::RestMeta;
    use sim::split_mix::uniform;
    use std::f64::consts::TAU;

    const DT: f64 = 0.005;
    const STILL_S: f64 = 20.0;
    const RUN_S: f64 = 30.0;
    const ZERO: Range<f64> = 10.0..STILL_S;
    /// Standard deviation of the accelerometer's tilt, degrees: 400 µg/√Hz up to 100 Hz.
    const NOISE_DEG: f64 = 0.23;

    fn normal(seed: u64, i: usize) -> f64 {
        let [a, b] = [0, 1].map(|k| uniform(seed, 2 * i as u64 + k));
        (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
    }

    /// Returns the tilt of the board's filter over a rest and a run in which the robot is upright. `return_deg`: tilt
    /// of the robot at 10 s, which decays with `return_s`; `slow_deg`: standard deviation of a slow offset of the
    /// accelerometer, correlated over 8 s.
    fn tilt(seed: u64, return_deg: f64, return_s: f64, slow_deg: f64) -> Columns<1> {
        let left = |time: f64| if time < STILL_S { return_deg * (-(time - ZERO.start) / return_s).exp() } else { 0.0 };
        let (mut columns, mut filtered, mut slow) = (Columns::default(), 0.0, 0.0);
        let settling = 1000;
        for i in 0..settling + ((STILL_S + RUN_S) / DT) as usize {
            let time = (i as f64 - settling as f64) * DT;
            slow += slow_deg * (2.0 * DT / 8.0).sqrt() * normal(seed + 5000, i) - DT / 8.0 * slow;
            filtered += DT * (slow + NOISE_DEG * normal(seed, i) - filtered);
            if i >= settling {
                // Rounded to the resolution of the telemetry.
                columns.push(time, [((filtered + left(time)) / 0.0035).round() * 0.0035]);
            }
        }
        columns
    }

    /// Returns the share of intervals that contain the error of a run's mean, the standard deviation of the errors and
    /// the median uncertainty, degrees.
    fn covered(return_deg: f64, return_s: f64, slow_deg: f64) -> (f64, f64, f64) {
        let seeds = 100;
        let (mut inside, mut squares, mut stated) = (0, 0.0, Vec::new());
        for seed in 0..seeds {
            let columns = tilt(seed, return_deg, return_s, slow_deg);
            let track = columns.track(0);
            let zero = TiltZero::of([track; 2], &(0.0..STILL_S), &ZERO, [1.0, return_s], 0.0).unwrap();
            let budget = crate::trial::Budget::new(zero.terms([1.0, 0.0], RUN_S - 1.0));
            let error = track.mean(STILL_S + 1.0..STILL_S + RUN_S).unwrap() - track.mean(ZERO).unwrap();
            inside += u32::from(error.abs() < budget.uncertainty_deg());
            squares += error.powi(2) / seeds as f64;
            stated.push(budget.uncertainty_deg());
        }
        stated.sort_by(f64::total_cmp);
        (f64::from(inside) / seeds as f64, squares.sqrt(), stated[stated.len() / 2])
    }

    #[test]
    fn noise_of_a_mean_is_that_of_the_filtered_input() {
        let (mut known, mut squares, seeds) = (0.0, 0.0, 200);
        for seed in 0..seeds {
            let columns = tilt(seed, 0.0, 12.0, 0.0);
            let fit = RestFit::of(columns.track(0), &(0.0..STILL_S), &ZERO, 1.0, 12.0).unwrap();
            known += fit.variance(10.0, 1.0) / seeds as f64;
            squares += columns.track(0).mean(ZERO).unwrap().powi(2) / seeds as f64;
        }
        println!("{:.5}, of {:.5} degrees", known.sqrt(), squares.sqrt());
        assert!((0.8..1.25).contains(&(known / squares)), "{known}, {squares}");
    }

    /// The uncertainty includes motions that are too small to detect.
    #[test]
    fn intervals_contain_what_is_left_of_a_small_motion() {
        for return_s in [3.0, 7.0, 12.0, 45.0] {
            for return_deg in [0.0, 0.01, 0.02, 0.04, 0.1, 0.5] {
                let (inside, errors, stated) = covered(return_deg, return_s, 0.0);
                let percent = 100.0 * inside;
                println!("{return_s} s, {return_deg} degrees: {percent:.0} %, errors {errors:.4}, ± {stated:.4}");
                assert!(inside >= 0.9, "{return_s} s, {return_deg} degrees: {inside}");
            }
        }
    }

    /// The robot is disturbed after the recorder's wait, whose bound only covers the motion remaining from before.
    #[test]
    fn robot_that_is_touched_after_a_wait_has_a_wider_interval() {
        let return_s = 12.0;
        // The bound on the rate dates from 7 s before the still phase.
        let wait = RestMeta { waited_s: -7.0, tilt_dps: Some(0.008), ..RestMeta::default() };
        let waited_deg = left_deg(Some(&wait), return_s, &ZERO);
        let covered = |touched_s: f64, by_deg: f64| {
            let touch = |time: f64| {
                let is_after = (touched_s..STILL_S).contains(&time);
                if is_after { by_deg * (-(time - touched_s) / return_s).exp() } else { 0.0 }
            };
            let (mut inside, mut stated) = (0, Vec::new());
            for seed in 0..50 {
                let still = tilt(seed, 0.0, return_s, 0.0);
                let mut columns = Columns::default();
                still.time_s.iter().enumerate().for_each(|(i, time)| {
                    columns.push(*time, [still.row(i)[0] + touch(*time)]);
                });
                let track = columns.track(0);
                let zero = TiltZero::of([track; 2], &(0.0..STILL_S), &ZERO, [1.0, return_s], waited_deg).unwrap();
                let stated_deg = crate::trial::Budget::new(zero.terms([1.0, 0.0], RUN_S - 1.0)).uncertainty_deg();
                let error = track.mean(STILL_S + 1.0..STILL_S + RUN_S).unwrap() - track.mean(ZERO).unwrap();
                inside += u32::from(error.abs() < stated_deg);
                stated.push(stated_deg);
            }
            stated.sort_by(f64::total_cmp);
            (f64::from(inside) / 50.0, stated[25])
        };
        let (inside, untouched) = covered(0.0, 0.0);
        println!("untouched: {:.0} %, ± {untouched:.3}", 100.0 * inside);
        assert!(inside >= 0.9 && untouched < 0.03, "{inside}, {untouched}");
        for (touched_s, by_deg) in [(4.0, 0.4), (8.0, 0.3), (8.0, 0.4)] {
            let (inside, stated) = covered(touched_s, by_deg);
            println!("{by_deg} degrees at {touched_s} s: {:.0} %, ± {stated:.3}", 100.0 * inside);
            assert!(inside >= 0.9 && stated > 5.0 * untouched, "{by_deg} at {touched_s} s: {inside}, {stated}");
        }
    }

    /// If a motion would be detected, or be over, it adds little uncertainty.
    #[test]
    fn rest_without_a_motion_has_little_more_than_its_noise() {
        for (return_s, most) in [(3.0, 2.2), (7.0, 2.4), (12.0, 3.0)] {
            let (_, errors, stated) = covered(0.0, return_s, 0.0);
            println!("{return_s} s: errors {errors:.4}, ± {stated:.4}");
            assert!(stated < most * errors, "{return_s} s: {stated}, {errors}");
        }
    }

    #[test]
    fn long_rest_of_a_robot_that_returns_at_once_is_known() {
        let mut columns = Columns::default();
        (0..240_000).for_each(|i| columns.push(f64::from(i) * DT, [NOISE_DEG * normal(3, i as usize)]));
        for return_s in [0.1, 1.0, 2.0] {
            let fit = RestFit::of(columns.track(0), &(0.0..1199.0), &(1189.0..1199.0), 1.0, return_s).unwrap();
            assert!(fit.density.is_finite() && fit.left_deg.iter().all(|left| left.abs() < 1e-6), "{fit:?}");
        }
    }

    #[test]
    fn slow_noise_widens_the_interval() {
        let [(_, _, white), (inside, errors, slow)] = [0.0, 0.1].map(|slow_deg| covered(0.0, 12.0, slow_deg));
        println!("{:.0} % of errors of {errors:.3} within {slow:.3} degrees", 100.0 * inside);
        assert!(slow > 3.0 * white && inside > 0.85, "{white}, {slow}, {inside}");
    }
}
