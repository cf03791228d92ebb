//! Metadata of a modelled or simulated trial: parameters, sensor errors, and steady state.

use serde::{Deserialize, Serialize};
use sim::body::closure::Closure;
use sim::contact::bundling::Bundling;
use sim::contact::history::BundlingChange;
use sim::params::Robot;
use sim::rod::spin::LEAST_SPIN_DRAG;
use sim::steady::{Kind, Method};
use sim::trial::Summary;
use sim::trial::quantity::Values;
use std::borrow::Cow;

/// The model that computed a trial.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct ModelMeta {
    /// The closure: how the flagella act on the base.
    pub closure: Closure,
    /// Method. With [`Method::Steady`] the log contains one period of the repeating motion or, if none was found, the
    /// last simulated window.
    pub method: Method,
    /// Samples per second.
    pub rate_hz: f64,
    /// Whether the shapes of the flagella are in the log.
    pub shapes: bool,
    /// All parameters in use, in the format of a robot's file.
    pub parameters: String,
}

impl ModelMeta {
    /// Returns the parameters in use; `None` if they cannot be parsed.
    pub fn robot(&self) -> Option<Robot> {
        toml::from_str(&self.current_parameters()).ok()
    }

    /// Returns the parameters in use with the meaning of this version.
    ///
    /// Versions without a `[head]` table had a drag in its place and a separate step for contact. Their
    /// `fluid.spin_drag` only acted on changes of the spin, by default with a share of [`LEAST_SPIN_DRAG`], which every
    /// robot has now.
    pub fn current_parameters(&self) -> Cow<'_, str> {
        let Ok(mut table) = self.parameters.parse::<toml::Table>() else { return Cow::Borrowed(&self.parameters) };
        if self.parameters.is_empty() || table.contains_key("head") {
            return Cow::Borrowed(&self.parameters);
        }
        let head = toml::Table::from_iter([("shape".to_owned(), toml::Value::String("local".to_owned()))]);
        table.insert("head".to_owned(), toml::Value::Table(head));
        if let Some(solver) = table.get_mut("solver").and_then(toml::Value::as_table_mut) {
            solver.remove("contact_step_rad");
        }
        let spin_drag = table.get_mut("fluid").and_then(|fluid| fluid.get_mut("spin_drag"));
        if let Some(share) = spin_drag
            && share.as_float() == Some(LEAST_SPIN_DRAG)
        {
            *share = toml::Value::Float(0.0);
        }
        Cow::Owned(table.to_string())
    }
}

/// Errors of the emulated board's sensor and clock.
///
/// With rate and force the body's rate and specific force in the sensor's axes, and j ≠ i in the sums over `cross`, the
/// readings are
///
/// ```text
/// rate_read[i]  = (1 + gyro_scale[i]) rate[i]   + Σ gyro_cross[i][j] rate[j]   + Σ gyro_g_dps[i][j] force[j] + bias + noise
/// force_read[i] = (1 + accel_scale[i]) force[i] + Σ accel_cross[i][j] force[j]                               + bias + noise
/// ```
///
/// Logs of older versions had scales, axes and clocks without error, and do not state the noise.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct SensorMeta {
    /// Seed of the random errors.
    pub seed: u64,
    /// Source of the errors: `ideal`, `typical` or `file`; empty in older logs, which are `ideal`.
    pub kind: String,
    /// Relative scale error of the gyroscope about each axis; positive if the reading is too large.
    pub gyro_scale: [f64; 3],
    /// `[i][j]`: share of the rate about axis j in the reading of axis i.
    pub gyro_cross: [[f64; 3]; 3],
    /// `[i][j]`: change of the rate read about axis i per standard gravity along axis j, °/s/g.
    pub gyro_g_dps: [[f64; 3]; 3],
    /// Bias of the gyroscope at 25 °C.
    pub gyro_bias_dps: [f64; 3],
    /// Temperature coefficient of the gyroscope's bias.
    pub gyro_drift_dps_per_c: [f64; 3],
    /// One-sided density of the gyroscope's white noise, °/s/√Hz.
    pub gyro_noise_dps_per_rt_hz: f64,
    /// Random walk of the gyroscope's bias, °/s/√s.
    pub gyro_walk_dps_per_rt_s: f64,
    /// Flicker noise of the gyroscope: the floor of its Allan deviation.
    pub gyro_flicker_dps: [f64; 3],
    /// Relative scale error of the accelerometer along each axis.
    pub accel_scale: [f64; 3],
    /// `[i][j]`: share of the force along axis j in the reading of axis i.
    pub accel_cross: [[f64; 3]; 3],
    /// Bias of the accelerometer at 25 °C.
    pub accel_bias_g: [f64; 3],
    /// Temperature coefficient of the accelerometer's bias.
    pub accel_drift_g_per_c: [f64; 3],
    /// One-sided density of the accelerometer's white noise, g/√Hz.
    pub accel_noise_g_per_rt_hz: f64,
    /// Rotation vector that turns the body axes into the sensor's.
    pub mounting_deg: [f64; 3],
    /// Final temperature of the sensor above the base's.
    pub warming_c: f64,
    /// Time constant with which the thermometer follows the sensor's temperature.
    pub thermometer_lag_s: f64,
    /// Relative error of the sensor's oscillator; positive if it is fast.
    pub sample_clock_error: f64,
    /// Relative error of the board's clock; positive if it is fast.
    pub board_clock_error: f64,
}

/// Steady state of a modelled trial, from the solver's unrounded values. Means are taken over the end of the run
/// ([`sim::trial::means`]). With [`Method::Steady`] the run is the period or window in the log.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct SteadyMeta {
    /// Its quantities.
    #[serde(flatten)]
    pub values: Values,
    /// Whether the means are known, and reached, within the limits of [`sim::trial::means`].
    pub settled: bool,
    /// The closest bundling state that the flagella reached.
    pub bundling: Bundling,
    /// Changes of the bundling state, in order of time.
    pub bundling_changes: Vec<BundlingChange>,
    /// The kind of motion, with [`Method::Steady`], and of a robot that overturned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<Kind>,
}

impl SteadyMeta {
    /// Converts the solver's summary.
    pub fn new(summary: &Summary, bundling_changes: Vec<BundlingChange>) -> Self {
        Self {
            values: Values::of(summary),
            settled: summary.steady.settled,
            bundling: summary.bundling,
            bundling_changes,
            kind: summary.steady.is_overturned().then_some(Kind::Overturned),
        }
    }

    /// Returns the time range of the smallest gap, in words: a steady state from a solver has only its averaged period.
    pub fn gap_of(&self) -> &'static str {
        if matches!(self.kind, None | Some(Kind::Overturned)) { "run" } else { "averaged period" }
    }

    /// Returns the steady state that represents those of several starting phases: settled if all are, with the closest bundling
    /// state, the least steady kind, and no changes. There must be at least one.
    pub fn over_phases(phases: &[Self]) -> Self {
        Self {
            values: Values::over_phases(&phases.iter().map(|phase| phase.values.clone()).collect::<Vec<_>>()),
            settled: phases.iter().all(|phase| phase.settled),
            bundling: phases.iter().map(|phase| phase.bundling).max_by_key(|state| *state as u8).unwrap_or_default(),
            bundling_changes: Vec::new(),
            kind: phases.iter().filter_map(|phase| phase.kind).max(),
        }
    }

    /// Returns whether the robot overturned, so that it has no steady attitude.
    pub fn is_overturned(&self) -> bool {
        self.kind == Some(Kind::Overturned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{from_table, to_table};

    #[test]
    fn sensor_errors_round_trip_and_older_logs_have_fewer() {
        let sensor = SensorMeta {
            kind: "typical".to_owned(),
            gyro_cross: [[0.0, 0.01, -0.02], [0.003, 0.0, 0.0], [0.0, 1e-17, 0.0]],
            gyro_g_dps: [[0.1, 0.0, 0.0], [0.0, -0.05, 0.0], [0.0, 0.0, 1.0 / 3.0]],
            warming_c: 1.5,
            board_clock_error: -0.0031,
            ..SensorMeta::default()
        };
        let mut table = to_table(&sensor);
        assert_eq!(from_table(&table), Some(sensor.clone()));
        for key in ["kind", "gyro_cross", "gyro_g_dps", "board_clock_error"] {
            assert!(table.remove(key).is_some(), "{key}");
        }
        assert_eq!(from_table(&table), Some(SensorMeta { warming_c: 1.5, ..SensorMeta::default() }));
    }

    #[test]
    fn parameters_of_older_versions_keep_their_meaning() {
        let mut older = toml::Table::try_from(Robot::published()).unwrap();
        older.remove("head");
        older["fluid"]["spin_drag"] = toml::Value::Float(LEAST_SPIN_DRAG);
        older["solver"].as_table_mut().unwrap().insert("contact_step_rad".to_owned(), toml::Value::Float(0.25));
        let meta = |parameters| ModelMeta { parameters, ..ModelMeta::default() };
        assert_eq!(meta(older.to_string()).robot(), Some(Robot::published()));
        for robot in [Robot::published(), Robot::default()] {
            assert_eq!(meta(toml::to_string(&robot).unwrap()).robot(), Some(robot));
        }
        assert_eq!(meta("[fluid".to_owned()).robot(), None);
    }
}
