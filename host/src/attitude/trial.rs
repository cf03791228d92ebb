//! What a trial came to: its steady angles, and how well the yaw is known.

use super::drift::Drift;
use super::series::Series;
use crate::log::Summary;
use protocol::units::CentiRpm;
use serde::Serialize;
use std::ops::Range;

/// Steady values are means over this long, or as much of it as whole turns allow.
const STEADY_S: f64 = 12.0;

/// The yaw starts from its mean over the end of the phase before the run.
const START_S: f64 = 1.0;

/// When the phases of a trial were, on the clock of its [`Series`]. A phase that did not come is empty.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Times {
    /// At rest before the run.
    pub preroll: Range<f64>,
    /// The motors turn.
    pub run: Range<f64>,
    /// After the run.
    pub decay: Range<f64>,
}

/// The phases of a trial as they come, one after the other, on the clock of its [`Series`]; so that a trial that is
/// being recorded and its log are cut alike.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct PhaseTimes {
    /// Names and beginnings.
    begun: Vec<(String, f64)>,
    /// The last moment of the trial so far.
    last_s: f64,
}

impl PhaseTimes {
    /// A phase begins.
    pub fn begin(&mut self, name: &str, time_s: f64) {
        self.begun.push((name.to_owned(), time_s));
    }

    /// The trial has come so far.
    pub fn go_on(&mut self, time_s: f64) {
        self.last_s = self.last_s.max(time_s);
    }

    /// How far the trial has come.
    pub fn last_s(&self) -> f64 {
        self.last_s
    }

    /// When the phases were: a phase lasts until the next begins, the last one as long as the trial.
    pub fn times(&self) -> Times {
        let phase = |name: &str| {
            let Some(at) = self.begun.iter().position(|(phase, _)| phase == name) else { return 0.0..0.0 };
            let end = self.begun.get(at + 1).map_or(self.last_s, |(_, next)| *next);
            self.begun[at].1..end
        };
        Times { preroll: phase("preroll"), run: phase("run"), decay: phase("decay") }
    }
}

/// The angles of a trial.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Angles {
    /// Steady yaw from where the robot was before the run, corrected for drift.
    pub yaw_deg: f64,
    /// 95 % uncertainty of the yaw from drift and noise of the gyroscope, and from the levelling; `None` where no still phase
    /// tells it.
    pub yaw_uncertainty_deg: Option<f64>,
    /// Steady pitch.
    pub pitch_deg: f64,
    /// Steady roll.
    pub roll_deg: f64,
    /// The drift that was taken off the yaw.
    pub drift_deg: f64,
    /// How long the robot was still after the run.
    pub still_after_s: f64,
    /// The values are means over this long.
    pub steady_s: f64,
    /// Angle turned about each body axis over the whole trial.
    pub turned_deg: [f64; 3],
}

impl Angles {
    /// The angles of a trial at these speeds; `None` where nothing came of its run.
    pub fn of(series: &Series, times: &Times, speeds: [CentiRpm; 2]) -> Option<Self> {
        let span = series.yaw.span();
        let run = times.run.start.max(span.start)..times.run.end.min(span.end);
        if run.start >= run.end {
            return None;
        }
        let window = steady_window(run.clone(), speeds);
        let start = (run.start - START_S).max(times.preroll.start).max(span.start)..run.start;
        let middle = |range: &Range<f64>| 0.5 * (range.start + range.end);
        let (from, to) = (middle(&start), middle(&window));
        let yaw = series.yaw.mean(window.clone())? - series.yaw.mean(start)?;
        let drift = Drift::seen(series, times.preroll.clone(), times.decay.clone());
        let drift_deg = drift.as_ref().map_or(0.0, |drift| drift.between(from, to));
        let after = drift.iter().flat_map(|drift| &drift.still).find(|still| still.start >= run.end);
        let (pitch_deg, roll_deg) = (series.pitch.mean(window.clone())?, series.roll.mean(window.clone())?);
        let levelling = levelling_deg(series.levelled_deg, pitch_deg, roll_deg);
        Some(Self {
            yaw_deg: yaw - drift_deg,
            yaw_uncertainty_deg: drift.as_ref().map(|drift| drift.uncertainty(from, to).hypot(levelling)),
            pitch_deg,
            roll_deg,
            drift_deg,
            still_after_s: after.map_or(0.0, |still| still.end - still.start),
            steady_s: window.end - window.start,
            turned_deg: series.turned_deg(),
        })
    }

    /// Puts the angles into a summary.
    pub fn fill(&self, summary: &mut Summary) {
        summary.yaw_deg = Some(self.yaw_deg);
        summary.yaw_uncertainty_deg = self.yaw_uncertainty_deg;
        summary.pitch_deg = Some(self.pitch_deg);
        summary.roll_deg = Some(self.roll_deg);
    }
}

/// What the levelling may have done to the yaw, degrees.
///
/// A tilt at rest is taken for the accelerometer's bias. As much of it as is the sensor's mounting turns the gyroscope too,
/// and then the yaw of a robot that leans is off by up to the tilt times the sine of the lean.
pub(crate) fn levelling_deg(levelled_deg: f64, pitch_deg: f64, roll_deg: f64) -> f64 {
    let upright = pitch_deg.to_radians().cos() * roll_deg.to_radians().cos();
    levelled_deg * (1.0 - upright * upright).max(0.0).sqrt()
}

/// The end of the run that is averaged: 12 s, or the most of it in which both flagella make whole turns, where there is
/// such a time; and not more than the run.
pub fn steady_window(run: Range<f64>, speeds: [CentiRpm; 2]) -> Range<f64> {
    let longest = STEADY_S.min(run.end - run.start);
    let [a, b] = speeds.map(|speed| speed.0.unsigned_abs());
    // Both make whole turns in 60 s over the greatest common divisor of their speeds in rpm.
    let common = match gcd(a, b) {
        0 => longest,
        divisor => 6000.0 / f64::from(divisor),
    };
    let times = (longest / common + 1e-9).floor();
    let length = if times >= 1.0 { times * common } else { longest };
    run.end - length..run.end
}

fn gcd(a: u16, b: u16) -> u16 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::super::Reading;
    use super::*;

    fn length(w1: f64, w2: f64, run_s: f64) -> f64 {
        let window = steady_window(20.0..20.0 + run_s, [w1, w2].map(CentiRpm::from_rpm));
        assert_eq!(window.end, 20.0 + run_s);
        window.end - window.start
    }

    #[test]
    fn steady_values_are_means_over_whole_turns_where_there_are_any() {
        assert!((length(50.0, 10.0, 120.0) - 12.0).abs() < 1e-9);
        assert!((length(0.0, 45.0, 120.0) - 12.0).abs() < 1e-9);
        assert!((length(-90.0, 70.0, 120.0) - 12.0).abs() < 1e-9);
        assert!((length(0.0, 35.0, 120.0) - 12.0).abs() < 1e-9);
        assert!((length(0.0, 7.0, 120.0) - 60.0 / 7.0).abs() < 1e-9);
        assert!((length(13.0, 7.0, 120.0) - 12.0).abs() < 1e-9, "no whole turns within 12 s");
        assert!((length(0.0, 0.0, 120.0) - 12.0).abs() < 1e-9);
        assert!((length(60.0, 60.0, 3.5) - 3.0).abs() < 1e-9);
        assert!((length(1.0, 0.0, 5.0) - 5.0).abs() < 1e-9);
    }

    #[test]
    fn a_turn_is_counted_across_its_wraps_and_about_the_bodys_axes() {
        let mut series = Series::default();
        for i in 0..=7200 {
            let half = (f64::from(i) * 0.1).to_radians() / 2.0;
            let attitude = [half.cos(), 0.0, 0.0, half.sin()];
            series.push(f64::from(i) * 0.005, &Reading { attitude, ..Reading::default() });
        }
        assert!((series.yaw.at(36.0).unwrap() - 720.0).abs() < 1e-9);
        let turned = series.turned_deg();
        assert!(turned[0].abs() < 1e-9 && turned[1].abs() < 1e-9 && (turned[2] - 720.0).abs() < 1e-9);
        let times = Times { preroll: 0.0..0.0, run: 0.0..36.0, decay: 36.0..36.0 };
        let angles = Angles::of(&series, &times, [CentiRpm(0); 2]).unwrap();
        assert!((angles.yaw_deg - 600.0).abs() < 1e-9);
        assert_eq!(angles.yaw_uncertainty_deg, None);
        assert_eq!(Angles::of(&series, &Times::default(), [CentiRpm(0); 2]), None);
    }
}
