//! Checks whether a file belongs to a sensor: a reading at rest must give standard gravity.
//!
//! Scale and offset of the accelerometer differ from part to part by some hundredths of gravity, and the file knows them to a
//! thousandth. A board's number identifies it only if the user has assigned one.

use super::{AXES, Estimate, MeasuredSensor};
use sim::functions::powi;

/// Largest temperature difference between the file's measurement and now, °C, in the same room.
const ROOM_C: f64 = 5.0;

impl MeasuredSensor {
    /// Returns the specific force of a mean reading, corrected by this file, both in body axes, g; `None` if the offset of an
    /// axis was not measured.
    pub fn force_g(&self, reading_g: [f64; 3]) -> Option<[f64; 3]> {
        let known = self.known();
        let mut found_g = reading_g;
        for (i, axis) in AXES.iter().enumerate() {
            let cross: f64 = (0..3).map(|j| known.accel_cross[i][j].value * reading_g[j]).sum();
            let offset = self.get("accel_offset_g", axis)?;
            found_g[i] = reading_g[i] - offset.value - known.accel_scale[i].value * reading_g[i] - cross;
        }
        Some(found_g)
    }

    /// Returns the gravity, relative to the standard, of a mean reading at rest (body axes, g), corrected by this file; `None` if
    /// scale or offset of an axis was not measured.
    pub fn gravity(&self, reading_g: [f64; 3]) -> Option<Estimate> {
        let found_g = self.force_g(reading_g)?;
        let known = self.known();
        let force = reading_g.iter().map(|force| force * force).sum::<f64>().sqrt();
        let mut variance = 0.0;
        for (i, axis) in AXES.iter().enumerate() {
            let offset = self.get("accel_offset_g", axis)?;
            let scale = self.get("accel_scale", axis)?;
            // Share of the force along this axis.
            let share = reading_g[i] / force;
            let mut add = |u: f64| variance += powi(share * u, 2);
            add(offset.u);
            add(scale.u * reading_g[i]);
            add(known.accel_drift_g_per_c[i].u * ROOM_C);
            (0..3).for_each(|j| add(known.accel_cross[i][j].u * reading_g[j]));
        }
        let square: f64 = found_g.iter().map(|force| powi(*force, 2)).sum();
        Some(Estimate { value: square.sqrt(), u: variance.sqrt() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::file::pair;
    use protocol::Settings;

    #[test]
    fn file_of_another_sensor_finds_another_gravity() {
        let mut file = MeasuredSensor::new(&Settings::DEFAULT);
        assert_eq!(file.gravity([0.0, 0.0, 1.0]), None);
        for (axis, [scale, offset_g]) in AXES.iter().zip([[-0.0045, 0.0064], [0.0282, 0.0139], [0.0036, -0.0054]]) {
            file.set("accel_scale", axis, Estimate { value: scale, u: 0.0005 });
            file.set("accel_offset_g", axis, Estimate { value: offset_g, u: 0.0002 });
        }
        for (i, j) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
            file.set("accel_cross", &pair(i, j), Estimate { value: 0.004, u: 0.005 });
        }
        // Readings at level: of the file's sensor, and of another one.
        let own = file.gravity([0.01042, 0.01846, 0.99831]).unwrap();
        assert!((own.value - 1.0).abs() < 1e-4 && (0.004..0.007).contains(&own.u), "{own:?}");
        let other = file.gravity([-0.0488, 0.0047, 1.0077]).unwrap();
        assert!(other.value - 1.0 > 1.5 * other.u, "{other:?}");
    }
}
