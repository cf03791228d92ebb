//! The attitude over a trial.

use super::{Euler, Reading, Unwrap, rotation};
use crate::log::LevelMeta;
use nalgebra::{UnitQuaternion, Vector3};
use protocol::Settings;
use std::ops::Range;

/// A quantity over time: `value[i]` at `time_s[i]`, which never goes back.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Track {
    /// Seconds.
    pub time_s: Vec<f64>,
    /// The quantity.
    pub value: Vec<f64>,
}

impl Track {
    /// Adds a value. One whose time goes back is left out.
    pub fn push(&mut self, time_s: f64, value: f64) {
        if self.time_s.last().is_none_or(|last| *last <= time_s) {
            self.time_s.push(time_s);
            self.value.push(value);
        }
    }

    /// From the first to the last time; empty where there is nothing.
    pub fn span(&self) -> Range<f64> {
        match (self.time_s.first(), self.time_s.last()) {
            (Some(first), Some(last)) => *first..*last,
            _ => 0.0..0.0,
        }
    }

    /// The value at a time, on the straight line between its neighbours; beyond the ends, that of the end.
    pub fn at(&self, time_s: f64) -> Option<f64> {
        let after = self.time_s.partition_point(|t| *t < time_s);
        let (Some(last), Some(before)) = (self.value.last(), after.checked_sub(1)) else {
            return self.value.first().copied();
        };
        let Some((t1, v1)) = self.time_s.get(after).zip(self.value.get(after)) else { return Some(*last) };
        let (t0, v0) = (self.time_s[before], self.value[before]);
        Some(if *t1 > t0 { v0 + (v1 - v0) * (time_s - t0) / (t1 - t0) } else { *v1 })
    }

    /// Mean over a range of time; each value counts as long as it lasts, so that lost frames do no harm.
    pub fn mean(&self, range: Range<f64>) -> Option<f64> {
        let inside = |time: &&f64| range.start < **time && **time < range.end;
        let times = std::iter::once(&range.start)
            .chain(self.time_s.iter().filter(inside))
            .chain(std::iter::once(&range.end))
            .copied();
        let points: Vec<_> = times.map(|time| Some((time, self.at(time)?))).collect::<Option<_>>()?;
        let area: f64 = points.windows(2).map(|pair| 0.5 * (pair[0].1 + pair[1].1) * (pair[1].0 - pair[0].0)).sum();
        let length = range.end - range.start;
        if length > 0.0 { Some(area / length) } else { self.at(range.start) }
    }

    /// Means over ranges of time that follow each other, as [`Track::mean`], in one pass.
    pub fn means(&self, ranges: impl Iterator<Item = Range<f64>>) -> Vec<f64> {
        let mut first = 0;
        let mean = |range: Range<f64>| {
            while self.time_s.get(first + 1).is_some_and(|time| *time <= range.start) {
                first += 1;
            }
            let last = first + self.time_s[first..].partition_point(|time| *time < range.end) + 1;
            let part = first..last.min(self.time_s.len());
            let near = Self { time_s: self.time_s[part.clone()].to_vec(), value: self.value[part].to_vec() };
            near.mean(range).unwrap_or_default()
        };
        if self.time_s.is_empty() { Vec::new() } else { ranges.map(mean).collect() }
    }

    /// Change a second over a range of time.
    pub fn rate(&self, range: Range<f64>) -> Option<f64> {
        let length = range.end - range.start;
        if length > 0.0 { Some((self.at(range.end)? - self.at(range.start)?) / length) } else { None }
    }

    /// Change a second over a range of time, by least squares; each value counts alike.
    pub fn slope(&self, range: Range<f64>) -> Option<f64> {
        let part = self.time_s.partition_point(|t| *t < range.start)..self.time_s.partition_point(|t| *t <= range.end);
        let points = || self.time_s[part.clone()].iter().zip(&self.value[part.clone()]);
        let count = part.len() as f64;
        let (t, v) = points().fold((0.0, 0.0), |(t, v), (time, value)| (t + time / count, v + value / count));
        let (across, along) = points().fold((0.0, 0.0), |(across, along), (time, value)| {
            (across + (time - t) * (value - v), along + (time - t).powi(2))
        });
        (along > 0.0).then(|| across / along)
    }
}

/// A time that is shorter does not tell the bias about x and y, s.
const LEAST_LATERAL_S: f64 = 4.0;

/// The attitude over a trial, as it comes.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Yaw, degrees, unwrapped.
    pub yaw: Track,
    /// Pitch, degrees.
    pub pitch: Track,
    /// Roll, degrees.
    pub roll: Track,
    /// Temperature of the sensor, °C.
    pub temperature: Track,
    learns_bias: bool,
    /// Integrals of the rates about the body's x and y less roll and pitch, degrees: of a robot that hangs upright they grow
    /// with the bias. Empty where the frames have no rates.
    slip: [Track; 2],
    /// The tilt that was taken off the attitude of the robot at rest, degrees.
    pub levelled_deg: f64,
    turned_lateral_deg: [f64; 2],
    unwrap: Unwrap,
    last: Option<UnitQuaternion<f64>>,
    turned: Vector3<f64>,
}

impl Series {
    /// Adds what the sensor said at a time.
    pub fn push(&mut self, time_s: f64, reading: &Reading) {
        let attitude = rotation(reading.attitude);
        let passed_s = self.yaw.time_s.last().map_or(0.0, |before| (time_s - before).max(0.0));
        let Euler { yaw_deg, pitch_deg, roll_deg } = Euler::of(&attitude);
        self.yaw.push(time_s, self.unwrap.next(yaw_deg));
        self.pitch.push(time_s, pitch_deg);
        self.roll.push(time_s, roll_deg);
        self.temperature.push(time_s, reading.temperature_c);
        if let Some(rates) = reading.lateral_dps {
            for (i, angle) in [roll_deg, pitch_deg].into_iter().enumerate() {
                self.turned_lateral_deg[i] += rates[i] * passed_s;
                self.slip[i].push(time_s, self.turned_lateral_deg[i] - angle);
            }
        }
        if let Some(last) = self.last.replace(attitude) {
            // From body to body: the axis is in body axes.
            self.turned += (last.inverse() * attitude).scaled_axis();
        }
    }

    /// What the board's filter does: with a gain for it, it learns the gyroscope's bias itself.
    pub fn filtered_with(&mut self, settings: &Settings) {
        self.learns_bias = settings.attitude_ki != 0.0;
    }

    /// Forgets the attitude so far.
    pub fn restart(&mut self) {
        *self = Self { learns_bias: self.learns_bias, ..Self::default() };
    }

    /// The attitudes that follow are levelled. Those before are levelled alike, so that the step is no motion.
    pub fn level(&mut self, level: &LevelMeta) {
        if !level.used {
            return;
        }
        for i in 0..self.yaw.value.len() {
            let [roll, pitch, yaw] = [&mut self.roll, &mut self.pitch, &mut self.yaw].map(|track| &mut track.value[i]);
            let [x, y, z] = [*roll, *pitch, *yaw].map(f64::to_radians);
            let levelled = Euler::of(&level.levelled(UnitQuaternion::from_euler_angles(x, y, z)));
            (*roll, *pitch) = (levelled.roll_deg, levelled.pitch_deg);
            *yaw = levelled.yaw_deg + 360.0 * ((*yaw - levelled.yaw_deg) / 360.0).round();
        }
        self.last = self.last.map(|last| level.levelled(last));
        self.levelled_deg = level.tilt_deg;
    }

    /// Bias about the body's x and y while it hung upright, °/s; `None` where the time is too short, or the log does not
    /// tell it.
    pub(super) fn lateral_bias(&self, range: Range<f64>) -> Option<[f64; 2]> {
        if self.learns_bias || range.end - range.start < LEAST_LATERAL_S {
            return None;
        }
        let [x, y] = self.slip.each_ref().map(|slip| slip.slope(range.clone()));
        Some([x?, y?])
    }

    /// Angle turned about each body axis so far, degrees: the integral of the body's angular velocity.
    pub fn turned_deg(&self) -> [f64; 3] {
        self.turned.map(f64::to_degrees).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levelling_is_no_motion() {
        let mut series = Series::default();
        let askew = UnitQuaternion::from_euler_angles(0.05, -0.06, 3.1);
        let up = (askew.inverse() * Vector3::z()).into();
        let level = LevelMeta { up, tilt_deg: 4.5, used: true, ..LevelMeta::default() };
        for i in 0..10 {
            let attitude = if i < 5 { askew } else { level.levelled(askew) };
            if i == 5 {
                series.level(&level);
            }
            let q = attitude.into_inner();
            series.push(f64::from(i), &Reading { attitude: [q.w, q.i, q.j, q.k], ..Reading::default() });
        }
        let step = series.yaw.value[9] - Euler::of(&askew).yaw_deg;
        assert!(step.abs() > 0.05, "{step}");
        for (angle, expected) in [(&series.yaw, series.yaw.value[9]), (&series.pitch, 0.0), (&series.roll, 0.0)] {
            assert!(angle.value.iter().all(|deg| (deg - expected).abs() < 1e-9), "{angle:?}");
        }
        assert!(series.turned_deg().iter().all(|turned| turned.abs() < 1e-9), "{:?}", series.turned_deg());
        assert_eq!(series.levelled_deg, 4.5);
    }

    #[test]
    fn means_of_many_ranges_are_those_of_each() {
        let mut track = Track::default();
        for i in 0..1000 {
            let time = f64::from(i) * 0.013;
            track.push(time, (time * 1.7).sin() + time);
        }
        let ranges: Vec<_> = (-2..30).map(|i| f64::from(i) * 0.5..f64::from(i) * 0.5 + 0.5).collect();
        for (range, mean) in ranges.iter().zip(track.means(ranges.iter().cloned())) {
            assert!((track.mean(range.clone()).unwrap() - mean).abs() < 1e-12, "{range:?}");
        }
    }
}
