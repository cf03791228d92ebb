//! Findings about the sensor of a recorded trial: its mounting, its file, its readings and the board's filter.

use super::{Rule, Section, axes, sensor_gap};
use crate::sensor::MeasuredSensor;
use crate::trial::data::Data;
use crate::trial::finding::FindingKind::{Conduct, Identity, Upright};
use protocol::Settings;
use protocol::units::CentiRpm;
use std::ops::Range;

/// Smallest gain of the board's filter with which the tilt has settled when the zero is taken, 1/s.
const LEAST_GAIN: f32 = 0.5;

const ONE_MOUNTING: &str = "set gyro_axes and accel_axes to the same mounting of the sensor, and repeat the trial";

pub(super) const SECTION: Section = Section { is_judged: is_of_robot, rules: &RULES };

static RULES: [Rule; 7] = [
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

/// Returns what shows that the sensor's file gives a wrong gravity: its errors are removed from the angles.
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
    use protocol::units::{Axis, AxisMap};

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
