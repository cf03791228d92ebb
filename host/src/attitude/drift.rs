//! The gyroscope's drift in yaw, seen while the robot is still before and after a run, and how well it is known.
//!
//! Gravity says nothing of yaw, so a bias of the gyroscope that the calibration left over, or that came since, turns the
//! yaw away. While the robot is still the yaw's rate is that bias, plus noise. Model of the measured yaw's error:
//!
//! - angle random walk, of standard deviation N √t after a time t. N is estimated from the still phases themselves: from
//!   the scatter of the mean rates of 2 s blocks, which takes in whatever slow noise there is up to some seconds. It is not
//!   taken below the sensor's data sheet. After a run the robot swings back, and its swing is told from the bias (see
//!   [`super::rest`]).
//! - a bias that changes slowly. Between the middles of the two still phases it is taken to lie on a straight line, which
//!   is right for any steady drift, such as warming. For what strays from the line, the bias is allowed to walk at random
//!   by as much as it was seen to change: the variance of the integral of a random walk that is held at both ends of a
//!   time T and moves by Δ in between is Δ² T² / 12.
//!
//! With one still phase alone the bias is that phase's, and may walk by [`BIAS_WALK`] from then on.
//!
//! The uncertainty is that of 95 %, by Student's distribution, because N comes from a few blocks.

use super::rest::{Phase, after_run, noise};
use super::series::Track;
use std::ops::Range;

/// Random walk of the bias where nothing was seen of it, °/s/√s. A lying MPU6050 (655 s) shows about a third of this.
pub(crate) const BIAS_WALK: f64 = 3e-4;

/// The drift, and how well the yaw is known.
#[derive(Clone, PartialEq, Debug)]
pub struct Drift {
    /// The still phases that were used.
    pub still: Vec<Range<f64>>,
    /// Middle and rate of each, s and °/s.
    points: Vec<(f64, f64)>,
    /// Variance of each rate over that of the angle random walk, 1/s.
    unknown: Vec<f64>,
    /// Angle random walk, °/√s.
    pub angle_walk: f64,
    freedom: f64,
}

impl Drift {
    /// The drift from the still phase before a run, and from whatever part of the phase after it is still. `None` where
    /// neither says anything.
    pub fn seen(yaw: &Track, before: Range<f64>, after: Range<f64>) -> Option<Self> {
        let before = Phase::still(yaw, before);
        let after = match &before {
            Some(before) => after_run(yaw, after, before),
            // Without a phase before, nothing tells the robot that swings back from a gyroscope that drifts.
            None => None,
        };
        let phases: Vec<_> = before.into_iter().chain(after).collect();
        let (angle_walk, freedom) = noise(&phases)?;
        Some(Self {
            points: phases.iter().map(|phase| (phase.middle(), phase.rate)).collect(),
            unknown: phases.iter().map(|phase| phase.unknown).collect(),
            still: phases.into_iter().map(|phase| phase.range).collect(),
            angle_walk,
            freedom,
        })
    }

    /// Rate of the drift at a time, °/s.
    pub fn rate(&self, time_s: f64) -> f64 {
        match self.points.as_slice() {
            [(t1, r1), (t2, r2), ..] => r1 + (r2 - r1) * (time_s - t1) / (t2 - t1),
            [(_, rate)] => *rate,
            [] => 0.0,
        }
    }

    /// Drift from one time to another, degrees.
    pub fn between(&self, from_s: f64, to_s: f64) -> f64 {
        // The rate is a straight line.
        self.rate(0.5 * (from_s + to_s)) * (to_s - from_s)
    }

    /// 95 % uncertainty of a turn measured from one time to another, degrees.
    pub fn uncertainty(&self, from_s: f64, to_s: f64) -> f64 {
        let length = to_s - from_s;
        let middle = 0.5 * (from_s + to_s);
        let walk = self.angle_walk.powi(2);
        let variance = match self.points.as_slice() {
            [(t1, r1), (t2, r2), ..] => {
                let apart = t2 - t1;
                let second = (middle - t1) / apart;
                let unknown = (1.0 - second).powi(2) * self.unknown[0] + second.powi(2) * self.unknown[1];
                walk * (length + length.powi(2) * unknown) + ((r2 - r1) * apart).powi(2) / 12.0
            }
            [(t1, _)] => {
                let reach = (to_s - t1).abs().max((from_s - t1).abs());
                walk * (length + length.powi(2) * self.unknown[0]) + BIAS_WALK.powi(2) * reach.powi(3) / 3.0
            }
            [] => return f64::INFINITY,
        };
        student_95(self.freedom) * variance.sqrt()
    }
}

/// Two-sided 95 % quantile of Student's distribution (Abramowitz and Stegun 26.7.5; within 1 % from 4 degrees of freedom
/// on).
pub(crate) fn student_95(freedom: f64) -> f64 {
    let z = 1.959_964_f64;
    let terms = [
        (z.powi(3) + z) / 4.0,
        (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0,
        (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0,
    ];
    let f = freedom.max(1.0);
    z + terms[0] / f + terms[1] / f.powi(2) + terms[2] / f.powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn students_quantile_is_that_of_the_tables() {
        for (freedom, expected) in [(4.0, 2.776), (8.0, 2.306), (23.0, 2.069), (1000.0, 1.962)] {
            assert!((student_95(freedom) / expected - 1.0).abs() < 0.01, "{freedom}");
        }
    }

    #[test]
    fn a_steady_change_of_the_bias_is_taken_out_whole() {
        let mut yaw = Track::default();
        for i in 0..=34_000 {
            let t = f64::from(i) * 0.005;
            yaw.push(t, 0.02 * t + 0.5 * 1e-4 * t * t);
        }
        let drift = Drift::seen(&yaw, 0.0..20.0, 140.0..170.0).unwrap();
        assert_eq!(drift.still.len(), 2);
        let measured = yaw.at(140.0).unwrap() - yaw.at(20.0).unwrap();
        // But for what the second phase is weighed down by: its noise is never taken for none.
        assert!((measured - drift.between(20.0, 140.0)).abs() < 1e-3);
    }

    #[test]
    fn too_little_says_nothing() {
        let mut yaw = Track::default();
        assert_eq!(Drift::seen(&yaw, 0.0..20.0, 140.0..170.0), None);
        yaw.push(0.0, 1.0);
        yaw.push(5.0, 1.0);
        assert_eq!(Drift::seen(&yaw, 0.0..5.0, 5.0..5.0), None);
    }
}
