//! A time without a reading of the sensor in a run, though the board's frames came: the sensor's wiring or supply failed for a
//! moment. The board bridges it with the mean of the rates before and after, and names a fault after 0.2 s.

use super::data::Data;
use std::ops::Range;

/// Longest time between two readings that does not count, s: a robot that swings by 5 degrees at 90 rpm then turns by up to
/// 0.06 degrees from where the mean of the rates puts it.
const BRIDGED_S: f64 = 0.055;

/// Interval of the board's frames, s.
const FRAME_S: f64 = 0.005;

/// Returns the longest such time after the start of the run.
pub(super) fn longest(data: &Data) -> Option<Range<f64>> {
    let frames = &data.motors.time_s;
    let has_frames = |gap: &Range<f64>| {
        let within = frames.partition_point(|t| *t < gap.end) - frames.partition_point(|t| *t <= gap.start);
        within as f64 > 0.5 * (gap.end - gap.start) / FRAME_S
    };
    let readings = &data.readings[data.readings.partition_point(|(time_s, _)| *time_s < data.times.run.start)..];
    let gaps = readings.windows(2).map(|pair| pair[0].0..pair[1].0);
    gaps.filter(|gap| gap.end - gap.start > BRIDGED_S + 0.5 * FRAME_S && has_frames(gap))
        .max_by(|a, b| (a.end - a.start).total_cmp(&(b.end - b.start)))
}

#[cfg(test)]
mod tests {
    use super::super::{Collector, Want};
    use super::*;
    use crate::trial::data::Records;
    use biflag_log::FORMAT;
    use biflag_log::schema::biflag::event::Kind;
    use biflag_log::schema::biflag::{Motor, Quaternion, Telemetry};
    use std::path::Path;

    /// A trial of 4 s with a run from 1 s on, and no readings, or no frames, between two times.
    fn trial(gap: Range<f64>, has_frames: bool) -> Data {
        let mut collector = Collector::new(Want::default(), FORMAT);
        collector.event(1.0, Kind::Phase, "run");
        for tick in 0..800 {
            let time_s = FRAME_S * f64::from(tick);
            let imu_fresh = !gap.contains(&time_s);
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
        let found = longest(&trial(2.0..2.1, true)).expect("a gap of 100 ms");
        assert!((found.start - 1.995).abs() < 1e-9 && (found.end - 2.1).abs() < 1e-9, "{found:?}");
        for (gap, has_frames) in [(2.0..2.043, true), (0.5..0.8, true), (2.0..2.4, false)] {
            assert_eq!(longest(&trial(gap.clone(), has_frames)), None, "{gap:?}");
        }
    }
}
