//! Starting phases: the angles of the flagella at the start of a run.
//!
//! If one flagellum makes p turns while the other makes q, the phase q a1 - p a2 of their motor angles stays constant,
//! and so does the interaction of the flagella: other starting angles lead to another steady state. Two flagella at
//! equal speeds either never touch or touch in each turn, depending on their phase. A flagellum that stands still
//! beside a turning one tilts the robot in a direction that depends on its angle. If no small p and q approximate the
//! ratio of the speeds, all phases occur in turn, and the means do not depend on the starting phase.

use crate::trial::means::WINDOW;
use crate::trial::means::ratio::{gcd, ratios};
use std::fmt;

/// A simple ratio of speeds: the flagella make these numbers of turns in the same time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ratio {
    /// Turns of flagellum 1 and 2, without a common divisor; the first is not negative.
    pub turns: [i32; 2],
}

impl Ratio {
    /// Returns the exact or nearly simple ratio of two speeds (rpm). Nearly means that the phase changes by less than a
    /// turn within the longest steady window. `None` without such a ratio, and if neither flagellum turns.
    pub fn of(rpm: [f64; 2]) -> Option<Self> {
        let slip = |[p, q]: [i32; 2]| (f64::from(q) * rpm[0] - f64::from(p) * rpm[1]).abs() * WINDOW / 60.0;
        let turning = |rpm: f64| rpm.abs() * WINDOW / 60.0 >= 1.0;
        ratios()
            .filter(|turns| slip(*turns) < 1.0 && rpm.into_iter().any(turning))
            .min_by_key(|[p, q]| p + q.abs())
            .map(|turns| Self { turns })
    }

    /// Returns the number of the flagellum that stands still, 1 or 2.
    pub fn standing(self) -> Option<usize> {
        self.turns.iter().position(|turns| *turns == 0).map(|k| k + 1)
    }
}

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [p, q] = self.turns;
        write!(f, "{p}:{q}")
    }
}

/// Returns the starting angles of both motors (deg) of `count` runs at these speeds (rpm), evenly spaced over all distinct
/// phases. The starting angle of flagellum 2 varies over the part of a turn after which the phases repeat; if flagellum 1
/// stands still, its own angle varies instead.
pub fn starts(rpm: [f64; 2], count: usize) -> Vec<[f64; 2]> {
    let [p, q] = rpm.map(|rpm| (rpm.abs() * 100.0).round() as u32);
    let common = gcd(p, q);
    let which = usize::from(p > 0 || q == 0);
    // The steady window does not average over a longer pattern.
    let repeats = p > 0 && f64::from(common) * WINDOW / 6000.0 >= 1.0;
    let part = if repeats { 360.0 / f64::from(p / common) } else { 360.0 };
    (0..count)
        .map(|i| {
            let mut start = [0.0; 2];
            start[which] = part * i as f64 / count as f64;
            start
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratio(w1: f64, w2: f64) -> Option<[i32; 2]> {
        Ratio::of([w1, w2]).map(|ratio| ratio.turns)
    }

    #[test]
    fn equal_speeds_small_ratios_and_flagella_that_stand_have_a_simple_ratio() {
        for (w1, w2, turns) in [
            (90.0, 90.0, [1, 1]),
            (-90.0, 90.0, [1, -1]),
            (-90.0, -90.0, [1, 1]),
            (90.0, 45.0, [2, 1]),
            (-60.0, 90.0, [2, -3]),
            (0.0, 45.0, [0, 1]),
            (45.0, 0.0, [1, 0]),
            (0.0, -45.0, [0, 1]),
            // Too slow to come round in a steady window of 12 s.
            (88.0, 90.0, [1, 1]),
            (2.0, 90.0, [0, 1]),
        ] {
            assert_eq!(ratio(w1, w2), Some(turns), "{w1} {w2}");
        }
        for (w1, w2) in [(50.0, 10.0), (60.0, 80.0), (80.0, 90.0), (0.0, 0.0), (1.0, -2.0)] {
            assert_eq!(ratio(w1, w2), None, "{w1} {w2}");
        }
        let standing = |w1, w2| Ratio::of([w1, w2]).and_then(Ratio::standing);
        assert_eq!((standing(0.0, 45.0), standing(45.0, 0.0), standing(45.0, 45.0)), (Some(1), Some(2), None));
        assert_eq!(Ratio::of([-60.0, 90.0]).map(|ratio| ratio.to_string()).as_deref(), Some("2:-3"));
    }

    #[test]
    fn starts_are_even_over_the_phases_that_differ() {
        let last = |w1, w2| starts([w1, w2], 4)[3];
        assert_eq!(starts([90.0, 90.0], 4), [[0.0, 0.0], [0.0, 90.0], [0.0, 180.0], [0.0, 270.0]]);
        assert_eq!(last(90.0, 45.0), [0.0, 135.0]);
        assert_eq!(last(-50.0, 10.0), [0.0, 54.0]);
        assert_eq!(last(0.0, 45.0), [270.0, 0.0], "beside a flagellum that stands");
        assert_eq!(last(45.0, 0.0), [0.0, 270.0]);
        assert_eq!(last(88.0, 90.0), [0.0, 270.0], "beats longer than the steady window");
        assert_eq!(last(0.0, 0.0), [0.0, 270.0]);
        assert_eq!(starts([1.0, 2.0], 1), [[0.0, 0.0]]);
    }
}
