//! A sensor without errors.

use super::{AXES, Estimate, MeasuredSensor};
use protocol::Settings;

impl MeasuredSensor {
    /// Returns the file of a sensor for which all measured errors are exactly zero.
    pub fn exact() -> Self {
        let mut file = Self::new(&Settings::DEFAULT);
        for i in AXES {
            for table in ["gyro_scale", "accel_scale", "mounting_deg"] {
                file.set(table, i, Estimate::default());
            }
            for j in AXES {
                let pair = format!("{i}{j}");
                file.set("gyro_g_dps", &pair, Estimate::default());
                if i != j {
                    file.set("gyro_cross", &pair, Estimate::default());
                    file.set("accel_cross", &pair, Estimate::default());
                }
            }
        }
        file
    }
}
