//! Findings about the sensor of a recorded trial: its mounting, its file, its readings and the board's filter.

use super::{Rule, Section, axes, sensor_gap};
use crate::attitude::rotation;
use crate::sensor::MeasuredSensor;
use crate::text::count;
use crate::trial::data::Data;
use crate::trial::finding::FindingKind::{Conduct, Identity, Upright};
use crate::trial::zero::Zeroed;
use nalgebra::Vector3;
use protocol::Settings;
use protocol::units::CentiRpm;
use std::ops::Range;

/// Smallest gain of the board's filter with which the tilt has settled when the zero is taken, 1/s.
const LEAST_GAIN: f32 = 0.5;

/// Largest difference of a robot's rate from the readings before and after it, °/s: with flagella that do not touch, and with
/// flagella that may touch and snap. On the emulated board the largest were 0.9 and 12.5.
const JUMP_DPS: [f64; 2] = [3.0, 60.0];

/// Largest turn of the yaw by jumps that is not grave, as a share of its uncertainty.
const TURNED_SHARE: f64 = 0.1;

const JUMPS: &str = "check the sensor's wiring and supply, and keep its wires away from those of the motors";

const ONE_MOUNTING: &str = "set gyro_axes and accel_axes to the same mounting of the sensor, and repeat the trial";

pub(super) const SECTION: Section = Section { is_judged: is_of_robot, rules: RULES };

static RULES: &[Rule] = &[
    Rule::warning(
        Upright,
        "set accel_axes and gyro_axes to the mounting of the sensor, let the robot hang freely, and repeat the trial",
        |data, _| {
            let level = data.records.level.as_ref().filter(|level| !level.used);
            let text = |deg| format!("tilt at rest of {deg:.1} degrees, too large for an offset of the accelerometer");
            level.map(|level| text(level.tilt_deg))
        },
    ),
    Rule::warning(
        Identity,
        "measure this sensor with `biflag sensor`, name its file in the plan, and repeat the trial",
        |data, _| other_sensor(data),
    ),
    Rule::warning(Conduct, ONE_MOUNTING, |data, _| {
        let text = |[found_deg, allowed_deg]: [f64; 2]| {
            format!(
                "gyroscope and accelerometer contradict each other: in the first seconds of the run they differ by \
                 {found_deg:.1} degrees of tilt, where {allowed_deg:.1} are possible"
            )
        };
        axes::contradiction(data).map(text)
    }),
    Rule::warning(Conduct, "check the sensor's wiring and supply, and repeat the trial", |data, _| {
        let text = |Range { start, end }| {
            let length_s = end - start;
            format!(
                "the sensor had no reading for {length_s:.2} s, from {start:.2} s on: the board bridged it, and the yaw may be \
                 off from then on"
            )
        };
        sensor_gap::longest(data).map(text)
    }),
    Rule::warning(Conduct, JUMPS, |data, zeroed| jumped(data, zeroed, true)),
    Rule::note(Conduct, JUMPS, |data, zeroed| jumped(data, zeroed, false)),
    Rule::warning(Conduct, ONE_MOUNTING, |data, _| data.settings().and_then(two_mountings)),
    Rule::warning(Conduct, "set attitude_kp to 1, and repeat the trial", |data, _| {
        data.settings().and_then(slow_filter)
    }),
    Rule::warning(Conduct, "set attitude_ki to 0, and repeat the trial", |data, _| {
        data.settings().and_then(learning_filter)
    }),
];

/// Returns whether a trial is a recorded run of the robot. A sensor turned by hand may have any mounting.
fn is_of_robot(data: &Data) -> bool {
    data.is_recorded() && data.speeds() != [CentiRpm(0); 2] && data.times.has_run()
}

/// Describes a wrong gravity by the sensor's file, whose errors are removed from the angles.
fn other_sensor(data: &Data) -> Option<String> {
    let file = data.records.measured_sensor.as_ref()?;
    let level = data.records.level.as_ref()?;
    let reading_g = level.up.map(|part| part * level.force_g);
    let gravity = MeasuredSensor::of(file)?.gravity(reading_g)?;
    ((gravity.value - 1.0).abs() > 2.0 * gravity.u).then(|| {
        format!(
            "by the sensor's file {}, the accelerometer read {:.3} of gravity at rest, where {:.3} is possible: the file is of \
             another sensor, or the sensor has changed",
            file.name,
            gravity.value,
            1.0 + (2.0 * gravity.u).copysign(gravity.value - 1.0)
        )
    })
}

/// Describes readings of the gyroscope that jump, which the board has added to its attitude: their number and the turn of the
/// yaw, either a grave or a slight one.
fn jumped(data: &Data, zeroed: &Zeroed, is_grave: bool) -> Option<String> {
    let turns_as_planned = data.reverse().is_none() && data.records.steer.is_none();
    let speeds = data.speeds().map(CentiRpm::rpm);
    let is_apart = turns_as_planned && data.robot().is_ok_and(|robot| !robot.flagellum.mesh(speeds));
    let jump_dps = JUMP_DPS[usize::from(!is_apart)];
    let (jumps, turned_deg) = jumps(data, jump_dps);
    let u_deg = zeroed.angles().and_then(|angles| angles.yaw_uncertainty_deg);
    let matters = u_deg.is_none_or(|u_deg| turned_deg > TURNED_SHARE * u_deg);
    (jumps > 0 && matters == is_grave).then(|| {
        format!(
            "{} of the gyroscope differ from those before and after by more than the {jump_dps} °/s that a robot can: they turn \
             the yaw by up to {turned_deg:.2} degrees",
            count(jumps, "reading")
        )
    })
}

/// Returns the number of readings that differ from those before and after by more than this rate, and the sum of their turns
/// about the vertical, degrees. Two in a row may be one sample that the board has used twice.
fn jumps(data: &Data, jump_dps: f64) -> (usize, f64) {
    let readings = &data.readings[data.calibrated.min(data.readings.len())..];
    let (mut count, mut turned_deg, mut i) = (0, 0.0, 1);
    let rates = |i: usize| Some(Vector3::from(readings.get(i)?.1.rates_dps?));
    while i + 1 < readings.len() {
        let excess = |n: usize| {
            let (before, after, mut turned_deg) = (rates(i - 1)?, rates(i + n)?, 0.0);
            for (_, now) in &readings[i..i + n] {
                let (rise, fall) = (Vector3::from(now.rates_dps?) - before, Vector3::from(now.rates_dps?) - after);
                (0..3).find(|axis| {
                    rise[*axis] * fall[*axis] > 0.0 && rise[*axis].abs().min(fall[*axis].abs()) > jump_dps
                })?;
                let up = rotation(now.attitude).inverse() * Vector3::z();
                turned_deg += (0.5 * (rise + fall)).dot(&up).abs() * sensor_gap::FRAME_S;
            }
            let is_whole = readings[i + n].0 - readings[i - 1].0 < (n as f64 + 1.5) * sensor_gap::FRAME_S;
            is_whole.then_some((n, turned_deg))
        };
        let (n, deg) = excess(1).or_else(|| excess(2)).unwrap_or((0, 0.0));
        (count, turned_deg, i) = (count + n, turned_deg + deg, i + n.max(1));
    }
    (count, turned_deg)
}

fn two_mountings(Settings { gyro_axes, accel_axes, .. }: Settings) -> Option<String> {
    let [gyro, accel] = [gyro_axes, accel_axes].map(|axes| axes.0.map(|axis| axis.to_string()).join(", "));
    (gyro_axes != accel_axes).then(|| {
        format!(
            "gyro_axes ({gyro}) and accel_axes ({accel}) differ, and in an MPU6050 gyroscope and accelerometer have the same axes"
        )
    })
}

fn slow_filter(Settings { attitude_kp, .. }: Settings) -> Option<String> {
    let lags = match attitude_kp {
        enough if enough >= LEAST_GAIN => return None,
        0.0 => "does not follow gravity (attitude_kp 0): the tilt drifts".to_owned(),
        gain => format!("follows gravity in {:.1} s (attitude_kp {gain}): the tilt lags", 1.0 / gain),
    };
    Some(format!("the board's filter {lags}"))
}

/// Even a gain of 0.003 makes the yaw wrong by 2 degrees in a run of 70 s.
fn learning_filter(Settings { attitude_ki, .. }: Settings) -> Option<String> {
    (attitude_ki != 0.0).then(|| {
        format!(
            "the board's filter takes a part of the robot's motion for a bias of the gyroscope (attitude_ki {attitude_ki}): the \
             yaw drifts in the run"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Collector, Records, Want};
    use biflag_log::FORMAT;
    use biflag_log::schema::biflag::{Quaternion, Telemetry, Vector};
    use protocol::units::{Axis, AxisMap};

    /// A robot that swings by 18 °/s at 85 rpm, with readings that jump by 18.9 °/s.
    #[test]
    fn one_or_two_readings_that_jump_are_counted() {
        let of = |jumping: &[usize], lost: &[usize]| {
            let mut collector = Collector::new(Want::default(), FORMAT);
            for tick in (0..400).filter(|tick| !lost.contains(tick)) {
                let time_s = 0.005 * tick as f64;
                let swing = 18.0 * (8.9 * time_s).sin();
                let z = if jumping.contains(&tick) { swing - 18.9 } else { swing };
                let attitude = Some(Quaternion { w: 1.0, ..Quaternion::default() });
                let angular_velocity_dps = Some(Vector { x: swing, y: 0.0, z });
                let imu_fresh = true;
                collector.telemetry(&Telemetry {
                    time_s,
                    imu_fresh,
                    attitude,
                    angular_velocity_dps,
                    ..Default::default()
                });
            }
            jumps(&collector.finish("a.mcap".as_ref(), Records::default()), JUMP_DPS[0])
        };
        for (at, lost, count) in [
            (&[][..], &[][..], 0),
            (&[100], &[], 1),
            (&[100, 250], &[], 2),
            (&[100, 101], &[], 2),
            // A motion, and a rate that no reading beside it confirms.
            (&[100, 101, 102], &[], 0),
            (&[100], &[101], 0),
        ] {
            let (counted, turned_deg) = of(at, lost);
            assert_eq!(counted, count, "{at:?}");
            assert!((turned_deg - 18.9 * 0.005 * count as f64).abs() < 0.003, "{turned_deg} of {at:?}");
        }
    }

    #[test]
    fn settings_that_make_the_angles_wrong_are_found() {
        let of = |settings| [two_mountings, slow_filter, learning_filter].map(|test| test(settings));
        assert_eq!(of(Settings::DEFAULT), [None, None, None]);
        let gyro_axes = AxisMap([Axis::PlusX, Axis::PlusY, Axis::MinusZ]);
        let turned = AxisMap([Axis::PlusY, Axis::MinusX, Axis::PlusZ]);
        assert_eq!(of(Settings { gyro_axes: turned, accel_axes: turned, ..Settings::DEFAULT }), [None, None, None]);
        for (settings, said) in [
            (Settings { gyro_axes, ..Settings::DEFAULT }, "gyro_axes (+x, +y, -z) and accel_axes (+x, +y, +z) differ"),
            (Settings { attitude_kp: 0.49, ..Settings::DEFAULT }, "follows gravity in 2.0 s (attitude_kp 0.49)"),
            (Settings { attitude_kp: 0.0, ..Settings::DEFAULT }, "does not follow gravity"),
            (Settings { attitude_ki: 0.003, ..Settings::DEFAULT }, "bias of the gyroscope (attitude_ki 0.003)"),
        ] {
            let found = of(settings).into_iter().flatten().collect::<Vec<_>>();
            assert!(matches!(&found[..], [one] if one.contains(said)), "{found:?}");
        }
    }
}
