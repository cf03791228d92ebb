//! The common period of both motors.

use crate::trial::means::WINDOW;
use std::f64::consts::TAU;

/// A motor below this speed, rad/s, stands still.
const STANDING: f64 = 1e-6;
/// Largest deviation of the slower motor from whole turns in a common period, in turns: rounding alone.
const EXACT: f64 = 1e-6;
/// Shortest period of the map, s: all modes outside its coordinates decay within it.
const SHORTEST: f64 = 2.0;

/// Returns the shortest time between 2 s and [`WINDOW`] in which both motors make whole turns, s; `None` where there is none.
pub fn common(speeds_rad_s: [f64; 2]) -> Option<f64> {
    let mut periods: Vec<f64> = speeds_rad_s.iter().filter(|s| s.abs() > STANDING).map(|s| TAU / s.abs()).collect();
    periods.sort_by(f64::total_cmp);
    let Some(&fast) = periods.first() else { return Some(SHORTEST) };
    let slow = periods.get(1).copied();
    let missed = |time: f64| slow.map_or(0.0, |slow| (time / slow - (time / slow).round()).abs());
    // The slower motor must make at least one turn.
    let turns = |time: f64| slow.is_none_or(|slow| time > 0.5 * slow);
    let (first, last) = ((SHORTEST / fast).ceil().max(1.0) as usize, ((WINDOW + 1e-9) / fast).floor() as usize);
    (first..=last).map(|n| n as f64 * fast).find(|time| missed(*time) < EXACT && turns(*time))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn periods_hold_whole_turns_of_both_motors() {
        let of = |w1: f64, w2: f64| common([w1, w2].map(|rpm| rpm * PI / 30.0));
        for (w1, w2, seconds) in [
            (50.0, 10.0, 6.0),
            (90.0, 90.0, 2.0),
            (-90.0, 80.0, 6.0),
            (0.0, 45.0, 8.0 / 3.0),
            (0.0, 0.0, SHORTEST),
            (5.0, 0.0, 12.0),
            (-60.0, 90.0, 2.0),
        ] {
            assert!(of(w1, w2).is_some_and(|time| (time - seconds).abs() < 1e-9), "{w1} {w2}: {:?}", of(w1, w2));
        }
        // (37, 53): 10 turns and 6.98 in 11.3 s.
        for (w1, w2) in [(37.0, 53.0), (1.0, 90.0), (4.0, 0.0), (0.001, 45.0), (1.0, 2.0)] {
            assert_eq!(of(w1, w2), None, "{w1} {w2}");
        }
    }
}
