//! Means of yaw and pitch over whole turns of the flagella, while they turn.

use crate::attitude::Columns;
use sim::trial::means::whole_turns;
use std::f64::consts::PI;

/// Longest averaging time, s: one turn at 10 rpm. A longer mean delays the controller; a shorter one removes less of
/// the swing.
pub const LONGEST_S: f64 = 6.0;

/// Yaw and pitch over time, and their means.
#[derive(Clone, Debug, Default)]
pub struct Means(Columns<2>);

impl Means {
    /// Adds yaw and pitch at a time, s.
    pub fn push(&mut self, time_s: f64, yaw_pitch: [f64; 2]) {
        self.0.push(time_s, yaw_pitch);
    }

    /// Returns the means up to the last time, over whole turns of flagella at these speeds, or over all times if the
    /// record is shorter.
    pub fn over_turns(&self, rpm: [f64; 2]) -> [f64; 2] {
        let span = self.0.span();
        let length_s = whole_turns(rpm.map(|rpm| rpm * PI / 30.0), LONGEST_S);
        let over = (span.end - length_s).max(span.start)..span.end;
        self.0.tracks().map(|track| track.mean(over.clone()).unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn swing_of_both_flagella_is_not_in_the_means() {
        let mut means = Means::default();
        for i in 0..=400 {
            let time_s = 0.05 * f64::from(i);
            let swing = |rpm: f64| (TAU * rpm / 60.0 * time_s).sin();
            means.push(time_s, [20.0 + 3.0 * swing(50.0), 4.0 + swing(50.0) - 2.0 * swing(10.0)]);
        }
        let [yaw, pitch] = means.over_turns([50.0, 10.0]);
        // The trapezium rule with 24 intervals per turn.
        assert!((yaw - 20.0).abs() < 1e-9 && (pitch - 4.0).abs() < 1e-9, "{yaw} {pitch}");
        let [_, other] = means.over_turns([37.0, 0.0]);
        assert!((other - 4.0).abs() > 0.1, "other turns leave a part: {other}");
    }
}
