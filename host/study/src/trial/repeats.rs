//! Steady angles over the speeds of both flagella.

use crate::attitude::tilt_deg;

/// The steady angles at a pair of speeds: the mean of its trials.
#[derive(Clone, PartialEq, Debug)]
pub struct AtSpeeds<T> {
    /// Speeds of the flagella.
    pub speeds_rpm: [f64; 2],
    /// Means of yaw, pitch and roll, with their signs.
    pub angles_deg: [f64; 3],
    /// Mean of the tilts. The mean attitude would hide tilts to different sides, as with different starting phases.
    pub tilt_deg: f64,
    /// Number of trials.
    pub trials: usize,
    /// Whether all of them settled.
    pub is_settled: bool,
    /// The first trial's data.
    pub first: T,
}

impl<T> AtSpeeds<T> {
    /// Returns a single trial.
    pub fn of_trial(speeds_rpm: [f64; 2], angles_deg: [f64; 3], is_settled: bool, first: T) -> Self {
        Self { speeds_rpm, angles_deg, tilt_deg: tilt_deg(angles_deg[1], angles_deg[2]), trials: 1, is_settled, first }
    }

    /// Returns the magnitudes of the mean yaw, pitch and roll, and the mean tilt, degrees.
    pub fn magnitudes_deg(&self) -> [f64; 4] {
        let [yaw, pitch, roll] = self.angles_deg;
        [yaw.abs(), pitch.abs(), roll.abs(), self.tilt_deg]
    }
}

/// Returns the mean of the trials at each pair of speeds, ordered by the first trial of each pair.
pub fn mean_of_repeats<T>(trials: impl Iterator<Item = AtSpeeds<T>>) -> Vec<AtSpeeds<T>> {
    let mut means: Vec<AtSpeeds<T>> = Vec::new();
    for trial in trials {
        match means.iter_mut().find(|mean| mean.speeds_rpm == trial.speeds_rpm) {
            Some(mean) => {
                mean.trials += 1;
                mean.is_settled &= trial.is_settled;
                mean.tilt_deg += (trial.tilt_deg - mean.tilt_deg) / mean.trials as f64;
                for (mean_deg, deg) in mean.angles_deg.iter_mut().zip(trial.angles_deg) {
                    *mean_deg += (deg - *mean_deg) / mean.trials as f64;
                }
            }
            None => means.push(trial),
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_have_one_mean_whose_magnitude_is_taken_last_and_a_mean_of_tilts() {
        let trial = |w1: f64, pitch: f64, name| AtSpeeds::of_trial([w1, 0.0], [-90.0, pitch, 0.0], name != "c", name);
        let trials = [trial(1.0, 2.0, "a"), trial(2.0, 9.0, "b"), trial(1.0, -4.0, "c"), trial(1.0, 2.0, "d")];
        let means = mean_of_repeats(trials.into_iter());
        assert_eq!(means.iter().map(|mean| (mean.first, mean.trials)).collect::<Vec<_>>(), [("a", 3), ("b", 1)]);
        assert!(!means[0].is_settled && means[1].is_settled, "one of three did not settle");
        let [yaw, pitch, roll, tilt] = means[0].magnitudes_deg();
        assert_eq!([yaw, pitch, roll], [90.0, 0.0, 0.0]);
        assert!((tilt - 8.0 / 3.0).abs() < 1e-9, "{tilt}");
        assert!((means[1].magnitudes_deg()[3] - 9.0).abs() < 1e-9);
    }
}
