//! A gap in the sensor's readings during a run, without a gap in the board's frames: the sensor's wiring or supply
//! failed for a moment. The board bridges the gap with the rates before and after and their slopes, and reports a fault
//! after 0.2 s.

use crate::attitude::Reading;
use crate::trial::data::Data;
use std::ops::Range;

/// Longest time between two readings that does not count, s: the board's attitude is then wrong by up to 0.05 degrees
/// for a robot that swings by 5 degrees at 90 rpm.
const BRIDGED_S: f64 = 0.14;

/// The same if other readings are missing just before or after the gap, s: the board then has no slopes.
const BRIDGED_ALONE_S: f64 = 0.05;

/// Successive readings from which the board computes a slope.
const SLOPE_READINGS: usize = 4;

/// Interval of the board's frames, s.
pub(super) const FRAME_S: f64 = 0.005;

/// Returns the longest such gap after the start of the run.
pub(super) fn longest(data: &Data) -> Option<Range<f64>> {
    let frames = &data.motors.time_s;
    let has_frames = |gap: &Range<f64>| {
        let within = frames.partition_point(|t| *t < gap.end) - frames.partition_point(|t| *t <= gap.start);
        within as f64 > 0.5 * (gap.end - gap.start) / FRAME_S
    };
    let readings = &data.readings[data.readings.partition_point(|(time_s, _)| *time_s < data.times.run.start)..];
    let is_missing = |pair: &[(f64, Reading)]| pair[1].0 - pair[0].0 > 1.5 * FRAME_S;
    let gaps = (0..readings.len().saturating_sub(1)).filter_map(|first| {
        let gap = readings[first].0..readings[first + 1].0;
        let before = &readings[first.saturating_sub(SLOPE_READINGS - 1)..=first];
        let after = &readings[first + 1..readings.len().min(first + 1 + SLOPE_READINGS)];
        let is_alone = ![before, after].iter().any(|beside| beside.windows(2).any(is_missing));
        let bridged_s = if is_alone { BRIDGED_S } else { BRIDGED_ALONE_S };
        (gap.end - gap.start > bridged_s + 0.5 * FRAME_S && has_frames(&gap)).then_some(gap)
    });
    gaps.max_by(|a, b| (a.end - a.start).total_cmp(&(b.end - b.start)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::data::Records;
    use crate::trial::{Collector, Want};
    use biflag_log::FORMAT;
    use biflag_log::schema::biflag::event::Kind;
    use biflag_log::schema::biflag::{Motor, Quaternion, Telemetry};
    use std::path::Path;

    /// Returns a trial of 4 s with a run from 1 s on, without readings, or without frames, in some gaps.
    fn trial(gaps: &[Range<f64>], has_frames: bool) -> Data {
        let mut collector = Collector::new(Want::default(), FORMAT);
        collector.event(1.0, Kind::Phase, "run");
        for tick in 0..800 {
            let time_s = FRAME_S * f64::from(tick);
            let imu_fresh = !gaps.iter().any(|gap| gap.contains(&time_s));
            if !imu_fresh && !has_frames {
                continue;
            }
            let attitude = Some(Quaternion { w: 1.0, x: 0.0, y: 0.0, z: 0.0 });
            let target_rpm = if time_s < 1.0 { 0.0 } else { 50.0 };
            let motor = Some(Motor { target_rpm, ..Motor::default() });
            collector.telemetry(&Telemetry {
                time_s,
                imu_fresh,
                attitude,
                motor1: motor,
                motor2: motor,
                ..Telemetry::default()
            });
        }
        collector.event(3.9, Kind::Phase, "end");
        collector.finish(Path::new("a.mcap"), Records::default())
    }

    #[test]
    fn a_gap_counts_in_the_run_and_among_frames_if_the_board_cannot_bridge_it() {
        let found = longest(&trial(&[2.0..2.16], true)).expect("a gap of 160 ms");
        assert!((found.start - 1.995).abs() < 1e-9 && (found.end - 2.16).abs() < 1e-9, "{found:?}");
        for (gap, has_frames) in [(2.0..2.12, true), (0.5..0.8, true), (2.0..2.4, false)] {
            assert_eq!(longest(&trial(std::slice::from_ref(&gap), has_frames)), None, "{gap:?}");
        }
    }

    #[test]
    fn a_gap_beside_another_one_counts_sooner() {
        for (other, counts) in [(2.113..2.12, true), (1.982..1.988, true), (2.2..2.21, false)] {
            assert_eq!(longest(&trial(&[2.0..2.1, other.clone()], true)).is_some(), counts, "{other:?}");
        }
    }
}
