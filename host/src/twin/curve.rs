//! The attitude of a trial from its zero: yaw, pitch and roll since the still phase before the run.

use super::Recording;
use crate::attitude::{Drift, Euler, Reading, Series, Track, levelling_deg, rotation};
use crate::log::Origin;
use nalgebra::{Quaternion, UnitQuaternion};
use std::ops::Range;

/// The yaw starts from its mean over the end of the still phase.
const START_S: f64 = 1.0;

/// The zero of the tilt is the mean over so much of the still phase's end, and its noise the scatter there: a robot that was
/// let go swings for some time, and the filter finds its level anew after the gyroscope was calibrated.
const TILT_ZERO_S: f64 = 10.0;

/// Blocks whose scatter tells how noisy a tilt is, s.
const BLOCK_S: f64 = 2.0;

/// Least 95 % uncertainty of a mean tilt of a rig, degrees.
///
/// Zeroing takes out the accelerometer's offsets, but not what changes as the sensor tilts: its axes differ in sensitivity
/// and are not quite square (2 % across axes, MPU-6000A data sheet, section 6.2), which is 0.1 degrees for a tilt of 5.
const TILT_FLOOR_DEG: f64 = 0.1;

/// A still phase at whose end the tilt strays further is not still, degrees.
const STILL_DEG: f64 = 0.5;

/// The attitude from its zero; times are those of the log.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    /// Yaw, pitch, roll in degrees, unwrapped, the drift taken off.
    pub angles: [Track; 3],
    /// What was taken off as the zero: yaw, pitch, roll.
    pub zero_deg: [f64; 3],
    /// The run.
    pub run: Range<f64>,
    /// When the yaw was zero, s.
    pub from_s: f64,
    /// Of the yaw; `None`: nothing tells it.
    pub drift: Option<Drift>,
    /// The tilt that was levelled away, degrees.
    levelled_deg: f64,
    /// Whether it is a model's, which has no noise.
    is_model: bool,
    /// Standard deviation of the means of blocks of the still phase, pitch and roll, and how many there were.
    tilt_scatter: Option<([f64; 2], usize)>,
    /// What whoever uses it should know.
    pub warnings: Vec<String>,
}

impl Curve {
    /// From a recording. `None` where there is no attitude in its run.
    pub fn new(recording: &Recording) -> Option<Self> {
        Self::with_end(recording, recording.times.decay.clone())
    }

    /// The same, but with the drift of the still phase before the run alone.
    pub fn from_rest(recording: &Recording) -> Option<Self> {
        Self::with_end(recording, recording.end_s..recording.end_s)
    }

    /// `after`: where the robot may be still again.
    fn with_end(recording: &Recording, after: Range<f64>) -> Option<Self> {
        let run = recording.times.run.clone();
        let readings = &recording.attitude;
        let (first, last) = (readings.first()?.0, readings.last()?.0);
        if last <= run.start || first >= run.end {
            return None;
        }
        let mut warnings = recording.warnings.clone();
        let is_model = recording.origin == Origin::Model;
        let still = recording.times.preroll.start.max(first)..run.start;
        let has_still = still.end - still.start >= START_S;
        let settled = (run.start - TILT_ZERO_S).max(still.start)..run.start;
        let (mean_over, tilt) = match (has_still, is_model) {
            (true, _) => (still.clone(), mean(readings, &settled)),
            // A model starts upright.
            (false, true) => (run.start..run.start, Some(UnitQuaternion::identity())),
            (false, false) => {
                let text = "there is no still phase before the run: the zero is the attitude at its start, and how well \
                            the yaw is known is not known";
                warnings.push(text.to_owned());
                (run.start..run.start, mean(readings, &(run.start - 0.1..run.start + 0.1)))
            }
        };
        let zero = Euler::of(&tilt.unwrap_or_default());
        // The sensor sits askew in the body: measured = true * askew. The yaw's zero is not the sensor's.
        let askew = UnitQuaternion::from_euler_angles(zero.roll_deg.to_radians(), zero.pitch_deg.to_radians(), 0.0);
        let mut series = Series::default();
        if let Some(settings) = recording.board.as_ref().and_then(|board| board.settings()) {
            series.filtered_with(&settings);
        }
        for (time, reading) in readings {
            let attitude = (rotation(reading.attitude) * askew.inverse()).into_inner().wxyz();
            series.push(*time, &Reading { attitude, ..*reading });
        }
        let drift = if is_model { None } else { Drift::seen(&series, still.clone(), after) };
        let start = (run.start - START_S).max(mean_over.start)..run.start;
        let from_s = 0.5 * (start.start + start.end);
        let yaw_zero = if is_model && !has_still { 0.0 } else { series.yaw.mean(start)? };
        let level =
            |time: &f64, yaw: &f64| yaw - yaw_zero - drift.as_ref().map_or(0.0, |drift| drift.between(from_s, *time));
        let yaw = Track {
            value: series.yaw.time_s.iter().zip(&series.yaw.value).map(|(t, yaw)| level(t, yaw)).collect(),
            time_s: series.yaw.time_s,
        };
        let tilt_scatter = has_still.then(|| scatter([&series.pitch, &series.roll], &settled)).flatten();
        if let Some(strayed) = has_still.then(|| strayed([&series.pitch, &series.roll], &settled)).flatten()
            && strayed > STILL_DEG
        {
            warnings.push(format!("the robot was not still before the run: its tilt strayed by {strayed:.1} degrees"));
        }
        // Up in the body's axes is the last row of the attitude.
        let levelled = recording.level.as_ref().map_or([0.0; 2], |level| {
            let [x, y, z] = level.up;
            [-x.clamp(-1.0, 1.0).asin().to_degrees(), y.atan2(z).to_degrees()]
        });
        let zero_deg = [yaw_zero, zero.pitch_deg + levelled[0], zero.roll_deg + levelled[1]];
        let levelled_deg = recording.level.as_ref().map_or(0.0, |level| level.tilt_deg);
        let angles = [yaw, series.pitch, series.roll];
        Some(Self { angles, zero_deg, run, from_s, drift, levelled_deg, is_model, tilt_scatter, warnings })
    }

    /// When there are angles.
    pub fn span(&self) -> Range<f64> {
        self.angles[0].span()
    }

    /// 95 % uncertainty of the yaw at a time after its zero, degrees; `None` where nothing tells it.
    pub fn yaw_uncertainty(&self, time_s: f64) -> Option<f64> {
        if self.is_model {
            return Some(0.0);
        }
        let drift = self.drift.as_ref()?.uncertainty(self.from_s, time_s.max(self.from_s));
        Some(drift.hypot(self.levelling(time_s)))
    }

    /// What the levelling may have done to the yaw at a time, degrees; 95 %.
    pub fn levelling(&self, time_s: f64) -> f64 {
        let [_, pitch, roll] = self.angles.each_ref().map(|track| track.at(time_s).unwrap_or_default());
        levelling_deg(self.levelled_deg, pitch, roll)
    }

    /// Standard deviation of what the sensor's warming since the still phase may have done to the yaw at a time, degrees.
    pub fn warming(&self, time_s: f64) -> f64 {
        self.drift.as_ref().map_or(0.0, |drift| drift.warming(self.from_s, time_s))
    }

    /// Angle random walk of the yaw (°/√s), length of the still phase that told its bias (s), variances of the zeros of
    /// pitch and roll (degrees²); `None` where no still phase tells them. A model is taken for a quiet sensor.
    pub fn noise(&self) -> Option<(f64, f64, [f64; 2])> {
        if self.is_model {
            return Some((1e-4, 20.0, [1e-8; 2]));
        }
        let drift = self.drift.as_ref()?;
        let still = drift.still.first()?;
        let (scatter, count) = self.tilt_scatter?;
        // The filter's noise lasts about a second, so that blocks know a little of their neighbours.
        let independent = 0.5 * (count as f64).min(TILT_ZERO_S / BLOCK_S);
        // The floor is of 95 %; a robot that still swings back a little is within it.
        let zero = |deg: f64| deg * deg / independent + (0.5 * TILT_FLOOR_DEG).powi(2);
        Some((drift.angle_walk, still.end - still.start, scatter.map(zero)))
    }

    /// Drift that was taken off the yaw up to a time, degrees.
    pub fn yaw_drift(&self, time_s: f64) -> f64 {
        self.drift.as_ref().map_or(0.0, |drift| drift.between(self.from_s, time_s))
    }

    /// 95 % uncertainty of mean pitch and roll over `window_s`, degrees; `None` where nothing tells it.
    pub fn tilt_uncertainty(&self, window_s: f64) -> Option<[f64; 2]> {
        if self.is_model {
            return Some([0.0; 2]);
        }
        let (scatter, count) = self.tilt_scatter?;
        let means = BLOCK_S / window_s.max(BLOCK_S) + 1.0 / (count as f64).min(TILT_ZERO_S / BLOCK_S);
        // Student's two-sided 95 % quantile for the blocks of a short still phase is near 2.5.
        Some(scatter.map(|deg| (2.5 * deg * means.sqrt()).hypot(TILT_FLOOR_DEG)))
    }
}

/// `[w, x, y, z]`.
trait Parts {
    fn wxyz(self) -> [f64; 4];
}

impl Parts for Quaternion<f64> {
    fn wxyz(self) -> [f64; 4] {
        [self.w, self.i, self.j, self.k]
    }
}

/// Mean attitude over a range of time. Attitudes within a few degrees of each other.
fn mean(readings: &[(f64, Reading)], range: &Range<f64>) -> Option<UnitQuaternion<f64>> {
    let mut inside = readings.iter().filter(|(time, _)| range.contains(time)).map(|(_, r)| rotation(r.attitude));
    let first = inside.next()?;
    let sum =
        inside.fold(
            *first.quaternion(),
            |sum, q| {
                if q.dot(&first) < 0.0 { sum - q.into_inner() } else { sum + q.into_inner() }
            },
        );
    Some(UnitQuaternion::from_quaternion(sum))
}

/// Means of each block of a range, from its end.
fn blocks(track: &Track, range: &Range<f64>) -> Vec<f64> {
    let count = ((range.end - range.start) / BLOCK_S + 1e-6).floor() as usize;
    (0..count)
        .filter_map(|i| track.mean(range.end - (i + 1) as f64 * BLOCK_S..range.end - i as f64 * BLOCK_S))
        .collect()
}

fn scatter(tilts: [&Track; 2], still: &Range<f64>) -> Option<([f64; 2], usize)> {
    let blocks = tilts.map(|tilt| blocks(tilt, still));
    let count = blocks[0].len();
    let deviation = |means: &Vec<f64>| {
        let mean = means.iter().sum::<f64>() / count as f64;
        (means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count as f64 - 1.0)).sqrt()
    };
    (count >= 3).then(|| (blocks.each_ref().map(deviation), count))
}

/// Largest difference between two blocks.
fn strayed(tilts: [&Track; 2], still: &Range<f64>) -> Option<f64> {
    let range = |values: Vec<f64>| {
        let low = values.iter().copied().reduce(f64::min)?;
        values.into_iter().reduce(f64::max).map(|high| high - low)
    };
    let [pitch, roll] = tilts.map(|tilt| range(blocks(tilt, still)));
    Some(pitch?.max(roll?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::Times;
    use crate::log::TrialMeta;
    use proptest::prelude::*;

    const STEP_S: f64 = 0.05;

    /// A rig that is still for 20 s and then turns to an attitude; `drift`: bias about its z, °/s.
    fn turned(askew: [f64; 3], from_yaw: f64, yaw: f64, tilt: [f64; 2], drift: f64) -> Recording {
        let share = |time: f64| ((time - 20.0) / 5.0).clamp(0.0, 1.0);
        let mut drifted = 0.0;
        let mut attitude = |time: f64| {
            let share = share(time);
            let rad = |deg: f64| (share * deg).to_radians();
            drifted += drift * STEP_S * rad(tilt[1]).cos() * rad(tilt[0]).cos();
            let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, (from_yaw + share * yaw + drifted).to_radians())
                * UnitQuaternion::from_euler_angles(rad(tilt[1]), rad(tilt[0]), 0.0)
                * UnitQuaternion::from_euler_angles(
                    askew[0].to_radians(),
                    askew[1].to_radians(),
                    askew[2].to_radians(),
                );
            Reading { attitude: turn.into_inner().wxyz(), ..Reading::default() }
        };
        Recording {
            path: "rig.mcap".into(),
            trial: TrialMeta::default(),
            origin: Origin::Rig,
            plan: None,
            board: None,
            model: None,
            replay: None,
            level: None,
            attitude: (0..=1000).map(|i| f64::from(i) * STEP_S).map(|time| (time, attitude(time))).collect(),
            turns: Vec::new(),
            phases: Vec::new(),
            times: Times { preroll: 0.0..20.0, run: 20.0..50.0, decay: 50.0..50.0 },
            end_s: 50.0,
            temperature_c: 20.0,
            warnings: Vec::new(),
            robot_meta: None,
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// Wherever the robot hung before, however its sensor sits and its gyroscope drifts: what is left is the motion.
        #[test]
        fn the_zero_and_the_drift_are_taken_off(
            askew in [-8.0..8.0f64, -8.0..8.0f64],
            from_yaw in -180.0..180.0f64,
            yaw in -400.0..400.0f64,
            tilt in [-20.0..20.0f64, -20.0..20.0f64],
            drift in -0.1..0.1f64,
        ) {
            let recording = turned([askew[0], askew[1], 0.0], from_yaw, yaw, tilt, drift);
            let curve = Curve::new(&recording).unwrap();
            let end = curve.angles.each_ref().map(|track| track.at(45.0).unwrap());
            prop_assert!((end[0] - yaw).abs() < 1e-3, "{end:?}");
            prop_assert!((end[1] - tilt[0]).abs() < 1e-3 && (end[2] - tilt[1]).abs() < 1e-3, "{end:?}");
            prop_assert!((curve.zero_deg[2] - askew[0]).abs() < 1e-3 && (curve.zero_deg[1] - askew[1]).abs() < 1e-3);
            let leant = tilt[1].to_radians().cos() * tilt[0].to_radians().cos();
            let drifted = curve.yaw_drift(45.0) - curve.yaw_drift(25.0);
            prop_assert!((drifted - drift * 20.0 * leant).abs() < 1e-3, "{drifted}");
            prop_assert!(curve.yaw_uncertainty(45.0).unwrap() < 1.0);
            prop_assert!(curve.warnings.is_empty());
        }
    }

    #[test]
    fn a_zero_that_is_not_known_is_said() {
        let mut recording = turned([0.0; 3], 0.0, 90.0, [0.0; 2], 0.0);
        recording.times.preroll = 20.0..20.0;
        let curve = Curve::new(&recording).unwrap();
        assert!(curve.warnings[0].contains("no still phase"), "{:?}", curve.warnings);
        assert_eq!((curve.yaw_uncertainty(45.0), curve.tilt_uncertainty(12.0)), (None, None));
        recording.attitude.truncate(300);
        assert!(Curve::new(&recording).is_none());
    }
}
