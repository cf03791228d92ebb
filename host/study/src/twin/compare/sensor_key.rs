//! Whether two recordings are of one sensor, so that its errors are the same in both.

use crate::trial::Data;
use protocol::units::AxisMap;

/// What the errors of a sensor depend on: the part, its axes in the body, and what was measured of it.
#[derive(Clone, PartialEq, Debug)]
pub struct SensorKey {
    /// 0 for a board that was never numbered.
    board_id: u16,
    /// Axes of gyroscope and accelerometer in the board's settings.
    axes: Option<[AxisMap; 2]>,
    /// The sensor's file.
    measured: Option<String>,
    /// The errors of an emulated sensor: boards of any number may have it.
    emulated: Option<Vec<f64>>,
}

impl SensorKey {
    /// Returns that of a recording; `None` for a model.
    pub fn of(data: &Data) -> Option<Self> {
        let errors = data.records.sensor.as_ref().map(|sensor| {
            [
                &sensor.gyro_scale[..],
                sensor.gyro_cross.as_flattened(),
                sensor.gyro_g_dps.as_flattened(),
                &sensor.accel_scale,
                sensor.accel_cross.as_flattened(),
                &sensor.accel_drift_g_per_c,
                &sensor.mounting_deg,
                &[sensor.board_clock_error],
            ]
            .concat()
        });
        (!data.is_model()).then(|| Self {
            board_id: data.records.board.as_ref().map_or(0, |board| board.board_id),
            axes: data.settings().map(|settings| [settings.gyro_axes, settings.accel_axes]),
            measured: data.records.measured_sensor.as_ref().map(|file| file.text.clone()),
            emulated: errors,
        })
    }

    /// Returns whether a recording of another session is of the same sensor for certain. Boards that were never numbered may
    /// be two.
    pub fn is_certainly(&self, other: &Self) -> bool {
        self == other && (self.board_id != 0 || self.emulated.is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boards_without_a_number_may_be_two() {
        let key =
            |board_id: u16, emulated: Option<Vec<f64>>| SensorKey { board_id, axes: None, measured: None, emulated };
        assert!(key(3, None).is_certainly(&key(3, None)));
        assert!(!key(3, None).is_certainly(&key(4, None)) && !key(0, None).is_certainly(&key(0, None)));
        assert!(key(0, Some(vec![0.02])).is_certainly(&key(0, Some(vec![0.02]))));
        assert!(!key(0, Some(vec![0.02])).is_certainly(&key(0, Some(vec![0.01]))));
        let measured = SensorKey { measured: Some("a".to_owned()), ..key(3, None) };
        assert!(!measured.is_certainly(&key(3, None)), "what is left of the errors differs");
    }
}
