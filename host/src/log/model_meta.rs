//! The metadata of a trial with a model in it: what it was computed with, and what it came to.

use serde::{Deserialize, Serialize};
use sim::body::closure::Closure;
use sim::contact::bundling::Bundling;
use sim::contact::history::BundlingChange;
use sim::params::Robot;
use sim::trial::Summary;

/// What a trial was computed with.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct ModelMeta {
    /// How the flagella act on the base.
    pub closure: Closure,
    /// Samples a second.
    pub rate_hz: f64,
    /// Whether the shapes of the flagella are in the log.
    pub shapes: bool,
    /// Every parameter in force, as a robot's file.
    pub parameters: String,
}

impl ModelMeta {
    /// The parameters in force.
    pub fn robot(&self) -> Option<Robot> {
        toml::from_str(&self.parameters).ok()
    }
}

/// What sets the emulated board's sensor apart from an ideal one that sits on the simulated robot. Its scale factors and
/// axes are exact.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct SensorMeta {
    /// What it was drawn by.
    pub seed: u64,
    /// Bias of the gyroscope at 25 °C.
    pub gyro_bias_dps: [f64; 3],
    /// Its change with temperature.
    pub gyro_drift_dps_per_c: [f64; 3],
    /// Bias of the accelerometer at 25 °C.
    pub accel_bias_g: [f64; 3],
    /// Its change with temperature.
    pub accel_drift_g_per_c: [f64; 3],
    /// How much warmer than the base it becomes.
    pub warming_c: f64,
}

/// What a modelled trial came to, from the unrounded numbers. Means are over the end of the run.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct SteadyMeta {
    /// Mean yaw, unwrapped.
    pub yaw_deg: f64,
    /// Mean pitch.
    pub pitch_deg: f64,
    /// Mean roll.
    pub roll_deg: f64,
    /// Length of the means.
    pub window_s: f64,
    /// Whether the means of the attitude agree with those of the window before.
    pub settled: bool,
    /// Time from the start of the run after which yaw and pitch stay near their means.
    pub settle_s: f64,
    /// Mean force of flagellum 1 on the base, body axes, contact included.
    pub force1_n: [f64; 3],
    /// The same of flagellum 2.
    pub force2_n: [f64; 3],
    /// Mean reaction torques on the base about the shafts.
    pub axial_torque_nm: [f64; 2],
    /// Least distance of the flagella's surfaces in the whole trial, negative where they overlap.
    pub min_gap_m: f64,
    /// Largest overlap.
    pub max_penetration_m: f64,
    /// The closest state that the flagella reached.
    pub bundling: Bundling,
    /// What state they were in from when on, in the order of time.
    pub bundling_changes: Vec<BundlingChange>,
    /// Share of the run with contact.
    pub contact_share: f64,
    /// Sweeps of the solver's iteration.
    pub newton_iterations: u64,
    /// Length of the trial.
    pub simulated_s: f64,
}

impl SteadyMeta {
    /// From what the solver came to, and the states of the flagella over the trial.
    pub fn new(summary: &Summary, bundling_changes: Vec<BundlingChange>) -> Self {
        let steady = &summary.steady;
        let [yaw_deg, pitch_deg, roll_deg] = steady.attitude.map(|level| level.mean.to_degrees());
        let [force1_n, force2_n] = steady.force.map(|force| force.map(|level| level.mean));
        Self {
            yaw_deg,
            pitch_deg,
            roll_deg,
            window_s: steady.window_s,
            settled: steady.settled,
            settle_s: steady.settle_s,
            force1_n,
            force2_n,
            axial_torque_nm: steady.axial_torque.map(|level| level.mean),
            min_gap_m: summary.min_gap_m,
            max_penetration_m: summary.max_penetration_m,
            bundling: summary.bundling,
            bundling_changes,
            contact_share: summary.contact_share,
            newton_iterations: summary.newton_iterations,
            simulated_s: summary.simulated_s,
        }
    }
}
