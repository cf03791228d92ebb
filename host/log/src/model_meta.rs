//! Metadata of a modelled or simulated trial: parameters, sensor errors, and steady state.

use serde::{Deserialize, Deserializer, Serialize};
use sim::body::closure::Closure;
use sim::contact::bundling::Bundling;
use sim::contact::history::BundlingChange;
use sim::params::Robot;
use sim::rod::spin::LEAST_SPIN_DRAG;
use sim::steady::Kind;
use sim::steady::Method;
use sim::trial::Summary;
use sim::trial::means::Level;
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
    /// Mean yaw, unwrapped; NaN for a robot that overturned, which is `null` in JSON.
    #[serde(deserialize_with = "number_or_null")]
    pub yaw_deg: f64,
    /// Mean pitch.
    #[serde(deserialize_with = "number_or_null")]
    pub pitch_deg: f64,
    /// Mean roll.
    #[serde(deserialize_with = "number_or_null")]
    pub roll_deg: f64,
    /// Standard error of the mean yaw; `None` if it is unknown: in a run shorter than 24 s, and in logs of older versions.
    pub yaw_se_deg: Option<f64>,
    /// The same for the mean pitch.
    pub pitch_se_deg: Option<f64>,
    /// The same for the mean roll.
    pub roll_se_deg: Option<f64>,
    /// Length of the averaging window at the end of the run.
    pub window_s: f64,
    /// Whether the means are known, and reached, within the limits of [`sim::trial::means`].
    pub settled: bool,
    /// Time from the start of the run after which yaw and pitch stay near their means; 0 with [`Method::Steady`].
    pub settle_s: f64,
    /// Mean force of flagellum 1 on the base, body axes, including contact.
    pub force1_n: [f64; 3],
    /// The same for flagellum 2.
    pub force2_n: [f64; 3],
    /// Standard errors of `force1_n`, like `yaw_se_deg`.
    pub force1_se_n: Option<[f64; 3]>,
    /// The same for `force2_n`.
    pub force2_se_n: Option<[f64; 3]>,
    /// Mean reaction torques on the base about the shafts.
    pub axial_torque_nm: [f64; 2],
    /// Their standard errors.
    pub axial_torque_se_nm: Option<[f64; 2]>,
    /// Smallest distance between the flagella's surfaces in the log; negative if they overlap.
    pub min_gap_m: f64,
    /// Largest overlap.
    pub max_penetration_m: f64,
    /// The closest bundling state that the flagella reached.
    pub bundling: Bundling,
    /// Changes of the bundling state, in order of time.
    pub bundling_changes: Vec<BundlingChange>,
    /// Fraction of the run in which the flagella touch each other.
    pub contact_share: f64,
    /// Number of sweeps of the solver for the log.
    pub newton_iterations: u64,
    /// Simulated time, including the search.
    pub simulated_s: f64,
    /// The kind of motion, with [`Method::Steady`], and of a robot that overturned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<Kind>,
}

impl SteadyMeta {
    /// Converts the solver's summary.
    pub fn new(summary: &Summary, bundling_changes: Vec<BundlingChange>) -> Self {
        let steady = &summary.steady;
        let [yaw_deg, pitch_deg, roll_deg] = steady.attitude.map(|level| level.mean.to_degrees());
        let [yaw_se_deg, pitch_se_deg, roll_se_deg] =
            steady.attitude.map(|level| level.standard_error.map(f64::to_degrees));
        let [force1_n, force2_n] = steady.force.map(|force| force.map(|level| level.mean));
        let [force1_se_n, force2_se_n] = steady.force.map(|force| errors(&force));
        Self {
            yaw_deg,
            pitch_deg,
            roll_deg,
            yaw_se_deg,
            pitch_se_deg,
            roll_se_deg,
            window_s: steady.window_s,
            settled: steady.settled,
            settle_s: steady.settle_s,
            force1_n,
            force2_n,
            force1_se_n,
            force2_se_n,
            axial_torque_nm: steady.axial_torque.map(|level| level.mean),
            axial_torque_se_nm: errors(&steady.axial_torque),
            min_gap_m: summary.min_gap_m,
            max_penetration_m: summary.max_penetration_m,
            bundling: summary.bundling,
            bundling_changes,
            contact_share: summary.contact_share,
            newton_iterations: summary.sweeps,
            simulated_s: summary.simulated_s,
            kind: steady.is_overturned().then_some(Kind::Overturned),
        }
    }

    /// Returns whether the robot overturned, so that it has no steady attitude.
    pub fn is_overturned(&self) -> bool {
        self.kind == Some(Kind::Overturned)
    }
}

fn number_or_null<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// Returns the standard errors of some levels; `None` unless all are known.
fn errors<const N: usize>(levels: &[Level; N]) -> Option<[f64; N]> {
    let known: Vec<f64> = levels.iter().filter_map(|level| level.standard_error).collect();
    known.try_into().ok()
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
