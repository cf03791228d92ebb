//! Detects a standing motor without encoder: the swing of its flagellum is missing.

use protocol::units::CentiRpm;
use protocol::{Settings, State, Telemetry};
use std::collections::VecDeque;
use std::f64::consts::TAU;
use study::swing::in_plane_dps;

/// Least swing of a turning motor, relative to the usual one.
const LEAST: f64 = 0.05;

/// Largest relative difference of a motor's speed from the commanded one.
const OFF: f64 = 0.1;

/// Shortest time after which a motor is judged if its winding bears the duty when blocked, s and in turns.
const SHORTEST_S: f64 = 10.0;
const TURNS: f64 = 2.0;

/// Duty that a blocked winding bears for ever, and the time constant of its heating, s: the board's own estimate.
const LASTING: f64 = 85.0;
const HEATING_S: f64 = 20.0;

/// Duty above which the heat of a blocked winding, not the swing, determines when a motor is judged.
const HOT: f64 = 137.0;

/// Interval between two checks, in frames.
const INTERVAL: u32 = 50;

/// The rates of the base since the last change of the commanded speeds.
#[derive(Debug)]
pub(super) struct Standing {
    settings: Settings,
    target: [CentiRpm; 2],
    /// Times (s) and rates about x and y (°/s) of the latest frames.
    rates: VecDeque<(f64, [f64; 2])>,
    frames: u32,
}

impl Standing {
    /// Returns a detector for the motors of a board with these settings.
    pub(super) fn new(settings: Settings) -> Self {
        Self { settings, target: [CentiRpm(0); 2], rates: VecDeque::new(), frames: 0 }
    }

    /// Takes a frame at a time of the board's clock, s. Returns the motor, 1 or 2, that stands, if one does.
    pub(super) fn frame(&mut self, frame: &Telemetry, time_s: f64) -> Option<usize> {
        if frame.state != State::Running || !frame.speed.contains(&CentiRpm::UNKNOWN) || frame.target != self.target {
            self.rates.clear();
            self.target = frame.target;
            return None;
        }
        let per_dps = f64::from(self.settings.gyro_range.counts_per_dps());
        let [x, y, _] = self.settings.gyro_axes.apply(frame.gyro.map(|counts| f64::from(counts.0) / per_dps));
        self.rates.push_back((time_s, [x, y]));
        self.frames += 1;
        if !self.frames.is_multiple_of(INTERVAL) {
            return None;
        }
        let longest = [0, 1].map(|motor| judged_after_s(self.target[motor].rpm(), frame.duty[motor].0.into()));
        let kept_s = longest.into_iter().fold(0.0, f64::max);
        while self.rates.front().is_some_and(|(first_s, _)| time_s - first_s > kept_s + 1.0) {
            self.rates.pop_front();
        }
        (0..2).find(|&motor| self.stands(motor, time_s, longest[motor])).map(|motor| motor + 1)
    }

    /// Returns whether a motor makes no swing in the latest `part_s`.
    fn stands(&self, motor: usize, now_s: f64, part_s: f64) -> bool {
        let [rpm, other] = [motor, 1 - motor].map(|k| self.target[k].rpm());
        // At nearly one speed the swings of both motors cancel each other now and then.
        let is_alone = (rpm - other).abs() > OFF * rpm.abs();
        if rpm == 0.0 || !is_alone || self.rates.front().is_none_or(|(first_s, _)| now_s - first_s < part_s) {
            return false;
        }
        let from = self.rates.partition_point(|(time_s, _)| *time_s < now_s - part_s);
        let part: Vec<(f64, [f64; 2])> = self.rates.range(from..).copied().collect();
        let mean = [0, 1].map(|axis| part.iter().map(|(_, rates)| rates[axis]).sum::<f64>() / part.len() as f64);
        let size = |hz: f64| {
            let (mut sum, mut weights) = ([0.0; 2], 0.0);
            for (time_s, [x, y]) in &part {
                let hann = 1.0 - (TAU * (time_s - now_s) / part_s).cos();
                let (s, c) = (TAU * hz * (time_s - now_s)).sin_cos();
                let (x, y) = (x - mean[0], y - mean[1]);
                sum[0] += hann * (x * c + y * s);
                sum[1] += hann * (y * c - x * s);
                weights += hann;
            }
            sum[0].hypot(sum[1]) / weights
        };
        let (hz, step) = (rpm / 60.0, 0.5 / part_s);
        let steps = (OFF * hz.abs() / step).ceil() as i32;
        let largest = (-steps..=steps).map(|i| size(hz + f64::from(i) * step)).fold(0.0, f64::max);
        largest < LEAST * in_plane_dps(rpm.abs())
    }
}

/// Returns the time after which a motor is judged, s.
fn judged_after_s(rpm: f64, duty: f64) -> f64 {
    if duty.abs() > HOT {
        -HEATING_S * (1.0 - (LASTING / duty).powi(2)).ln()
    } else {
        SHORTEST_S.max(TURNS * 60.0 / rpm.abs().max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::units::{Duty, SensorCounts};

    /// Returns the motor that is found to stand, and when, s after 20 s. Both motors swing the base by `swing_dps`; the swing of
    /// the motor `still` ends at 20 s.
    fn found(rpm: [f64; 2], duty: i16, swing_dps: [f64; 2], still: Option<usize>) -> Option<(usize, f64)> {
        let mut standing = Standing::new(Settings::DEFAULT);
        let target = rpm.map(CentiRpm::from_rpm);
        (0..200 * 40).find_map(|tick| {
            let time_s = f64::from(tick) * 0.005;
            let mut rates = [0.4, -0.2];
            for k in (0..2).filter(|k| still != Some(*k) || time_s < 20.0) {
                // Opposite swings.
                let (s, c) = (TAU * (rpm[k] / 60.0 * 1.03 * time_s + 0.5 * k as f64)).sin_cos();
                rates = [rates[0] + swing_dps[k] * c, rates[1] + swing_dps[k] * s];
            }
            let counts = |dps: f64| SensorCounts((dps * 131.0).round() as i16);
            let frame = Telemetry {
                state: State::Running,
                speed: [CentiRpm::UNKNOWN; 2],
                target,
                duty: [Duty(duty); 2],
                gyro: [counts(rates[0]), counts(rates[1]), SensorCounts(0)],
                ..Telemetry::default()
            };
            standing.frame(&frame, time_s).map(|motor| (motor, time_s - 20.0))
        })
    }

    #[test]
    fn motors_at_one_speed_whose_swings_cancel_each_other_do_not_stand() {
        for rpm in [[50.0, 50.0], [-33.0, -33.2]] {
            assert_eq!(found(rpm, 100, [4.0, 4.0], None), None, "{rpm:?}");
        }
    }

    #[test]
    fn a_motor_without_its_swing_is_found_in_the_time_that_it_may_stand() {
        for (rpm, duty, swing_dps, within_s) in [
            ([50.0, 10.0], 100, [4.0, 0.3], 14.0),
            ([-85.0, 60.0], 181, [9.0, 5.0], 5.5),
            ([90.0, -90.0], 255, [9.0, 9.0], 3.0),
        ] {
            assert_eq!(found(rpm, duty, swing_dps, None), None, "{rpm:?}");
            for motor in 0..2 {
                let (stands, after_s) = found(rpm, duty, swing_dps, Some(motor)).unwrap();
                assert!(stands == motor + 1 && (0.0..within_s).contains(&after_s), "{rpm:?}: {stands} {after_s}");
            }
        }
    }
}
