//! Identifies the sensor of a recording. Recordings of one sensor share its errors, in comparisons and in fits.

use crate::trial::Data;
use protocol::units::AxisMap;

/// Everything that determines the errors of a sensor: the device, its axes in the body, and its measured errors.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct SensorKey {
    /// 0 for a board that was never numbered.
    board_id: u16,
    /// Axes of gyroscope and accelerometer in the board's settings.
    axes: Option<[AxisMap; 2]>,
    /// The sensor's file.
    measured: Option<String>,
    /// The errors of an emulated sensor, which may be on boards with any number.
    emulated: Option<Vec<f64>>,
}

impl SensorKey {
    /// Returns the key of a recording; `None` for a model or an imported trial.
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
        data.is_recorded().then(|| Self {
            board_id: data.records.board.as_ref().map_or(0, |board| board.board_id),
            axes: data.settings().map(|settings| [settings.gyro_axes, settings.accel_axes]),
            measured: data.records.measured_sensor.as_ref().map(|file| file.text.clone()),
            emulated: errors,
        })
    }

    /// Returns the key of a board with a number.
    #[cfg(test)]
    pub fn of_board(board_id: u16) -> Self {
        Self { board_id, ..Self::default() }
    }

    /// Returns the part of the key that distinguishes devices, without their measured errors. Boards without a number count as
    /// one.
    pub fn board(&self) -> (u16, Option<&[f64]>) {
        (self.board_id, self.emulated.as_deref())
    }

    /// Returns whether a recording of another session is certainly from the same sensor. Boards without numbers may be
    /// different.
    pub fn is_certainly(&self, other: &Self) -> bool {
        self == other && (self.board_id != 0 || self.emulated.is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Collector, Records, Want};
    use biflag_log::{FORMAT, Identity, Origin, SensorMeta};

    #[test]
    fn boards_without_a_number_may_be_two() {
        let key = |board_id: u16, emulated: Option<Vec<f64>>| SensorKey { emulated, ..SensorKey::of_board(board_id) };
        assert!(key(3, None).is_certainly(&key(3, None)));
        assert!(!key(3, None).is_certainly(&key(4, None)) && !key(0, None).is_certainly(&key(0, None)));
        assert!(key(0, Some(vec![0.02])).is_certainly(&key(0, Some(vec![0.02]))));
        assert!(!key(0, Some(vec![0.02])).is_certainly(&key(0, Some(vec![0.01]))));
        let measured = SensorKey { measured: Some("a".to_owned()), ..key(3, None) };
        assert!(!measured.is_certainly(&key(3, None)), "what is left of the errors differs");
    }

    /// Two different files of an emulated sensor may have the same seed.
    #[test]
    fn emulated_sensors_are_told_apart_by_their_errors() {
        let of = |gyro_scale: [f64; 3], seed: u64| {
            let sensor = SensorMeta { seed, kind: "file".to_owned(), gyro_scale, ..SensorMeta::default() };
            let identity = Some(Identity { origin: Origin::VirtualRig, ..Identity::default() });
            let records = Records { identity, sensor: Some(sensor), ..Records::default() };
            SensorKey::of(&Collector::new(Want::default(), FORMAT).finish("log".as_ref(), records))
        };
        assert_ne!(of([0.01, 0.0, 0.0], 1), of([0.02, 0.0, 0.0], 1));
        assert_eq!(of([0.01, 0.0, 0.0], 1), of([0.01, 0.0, 0.0], 2));
    }
}
