//! The window at the end of a run: whole revolutions of both motors, as nearly as possible.

use std::f64::consts::TAU;

/// Longest window, s.
pub const WINDOW: f64 = 12.0;

/// Shortest window, as a share of the longest: a shorter window would average over too few values.
const SHORTEST: f64 = 0.6;

/// Fraction of a revolution of the slower motor by which the window may miss a whole number.
const WHOLE: f64 = 1e-6;

/// Returns the length of the steady window, s, for motors at these speeds in a run of `run_s`.
///
/// The length is a whole number of revolutions of the faster motor, between 60 % and 100 % of [`WINDOW`], or of the run
/// if that is shorter. Among these lengths it is the one at which the slower motor is nearest to a whole number of
/// revolutions; among equally good ones, the longest. A motor that makes no full revolution in that time is ignored. If
/// both are ignored, the length is [`WINDOW`] or the run.
pub fn whole_turns(speeds_rad_s: [f64; 2], run_s: f64) -> f64 {
    let longest = WINDOW.min(run_s);
    let mut periods: Vec<f64> = speeds_rad_s.iter().filter(|s| s.abs() > 1e-6).map(|s| TAU / s.abs()).collect();
    periods.sort_by(f64::total_cmp);
    let Some(&fast) = periods.first().filter(|p| **p <= longest) else {
        return longest;
    };
    let Some(&slow) = periods.get(1).filter(|p| **p <= longest) else {
        return fast * (longest / fast + 1e-9).floor();
    };
    let mismatch = |length: f64| (length / slow - (length / slow).round()).abs();
    let most = (longest / fast + 1e-9).floor() as usize;
    let least = ((SHORTEST * longest / fast).ceil() as usize).clamp(1, most);
    (least..=most)
        .rev()
        .map(|turns| turns as f64 * fast)
        .min_by(|a, b| (mismatch(*a) - WHOLE).max(0.0).total_cmp(&(mismatch(*b) - WHOLE).max(0.0)))
        .unwrap_or(longest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn windows_hold_whole_revolutions_of_both_motors() {
        let rad = |rpm: f64| rpm * PI / 30.0;
        for (rpm, window) in [([90.0, 90.0], 12.0), ([50.0, 10.0], 12.0), ([0.0, 45.0], 12.0), ([-70.0, 30.0], 12.0)] {
            assert!((whole_turns(rpm.map(rad), 120.0) - window).abs() < 1e-6, "{rpm:?}");
        }
        let odd = whole_turns([rad(37.0), rad(53.0)], 120.0);
        assert!(odd > 7.0 && odd <= 12.0);
        assert_eq!(whole_turns([0.0, 0.0], 5.0), 5.0);
    }
}
