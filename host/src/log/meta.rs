//! The metadata records of a log: what is known of the trial besides its messages.

use super::model_meta::{ModelMeta, SensorMeta, SteadyMeta};
use super::table::Meta;
use crate::plan::{BoardSettings, Plan, Trial};
use crate::stats::LinkStats;
use nalgebra::{UnitQuaternion, Vector3};
use protocol::{Info, Settings};
use serde::{Deserialize, Serialize};
use std::time::SystemTime;

/// Version of the log's layout. Raised when an older program could not make sense of a newer log.
pub const FORMAT: u32 = 1;

/// Where a trial was run.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// On the rig.
    #[default]
    Rig,
    /// On the emulated board.
    VirtualRig,
    /// In the model.
    Model,
}

/// What wrote the log. The first record.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct Identity {
    /// [`FORMAT`].
    pub format: u32,
    /// Version of the protocol between host and board.
    pub protocol: u8,
    /// Version of `biflag`.
    pub host_version: String,
    /// The commit that it was built from.
    pub host_git_hash: String,
    /// When the log was begun; empty for a modelled trial, whose log is the same whenever it is computed.
    pub created: String,
    /// Where the trial was run.
    pub origin: Origin,
}

/// The plan that the trial belongs to.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct PlanMeta {
    /// Name of the session.
    pub name: String,
    /// Who ran it.
    pub operator: String,
    /// What else was written down.
    pub note: String,
    /// How many trials it has.
    pub trials: usize,
    /// The whole file.
    pub text: String,
}

/// The trial.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct TrialMeta {
    /// Its name.
    pub name: String,
    /// Its place in the order, from 0.
    pub index: usize,
    /// Which repeat, from 1.
    pub repeat: u32,
    /// Which attempt at it, from 1.
    pub attempt: u32,
    /// Speed of flagellum 1.
    pub w1_rpm: f64,
    /// Speed of flagellum 2.
    pub w2_rpm: f64,
    /// Duration of the calibration.
    pub calibrate_s: f64,
    /// Duration of the still phase before the run.
    pub preroll_s: f64,
    /// Duration of the run.
    pub run_s: f64,
    /// Duration of the still phase after it.
    pub decay_s: f64,
    /// The motor that turned the other way from some moment of the run on, 1 or 2.
    pub reverse_motor: Option<u8>,
    /// That moment, from the start of the run.
    pub reverse_after_s: Option<f64>,
}

/// The robot's parameters.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct RobotMeta {
    /// `published`, or the file's name.
    pub name: String,
    /// The file.
    pub text: String,
}

/// The board.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct BoardMeta {
    /// Version of its protocol.
    pub protocol: u8,
    /// Version of its firmware.
    pub firmware: String,
    /// The commit that the firmware was built from, and `-dirty` where there were changes.
    pub firmware_git_hash: String,
    /// Number of the board.
    pub board_id: u16,
    /// The sensor's WHO_AM_I.
    pub imu_id: u8,
    /// Why the board started.
    pub reset_cause: String,
    /// How often it has started.
    pub boot_count: u16,
    /// The settings in force, as a file of `biflag settings`.
    pub settings: String,
}

/// Result of the gyroscope's calibration.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct CalibrationMeta {
    /// Whether the sensor lay still; if not, the bias is not in force.
    pub still: bool,
    /// Mean reading, counts, sensor axes.
    pub bias_counts: [f32; 3],
    /// Standard deviation of the readings, counts, largest axis.
    pub noise_counts: u16,
    /// Readings that were averaged.
    pub samples: u16,
}

/// What the accelerometer said of the vertical while the robot hung at rest before the run.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(default)]
pub struct LevelMeta {
    /// The direction of up, body axes.
    pub up: [f64; 3],
    /// How much it read there, over standard gravity.
    pub force_g: f64,
    /// How far it is off the robot's axis.
    pub tilt_deg: f64,
    /// Whether the attitude is corrected by it from there on.
    pub used: bool,
}

impl Default for LevelMeta {
    fn default() -> Self {
        Self { up: [0.0, 0.0, 1.0], force_g: 1.0, tilt_deg: 0.0, used: false }
    }
}

impl LevelMeta {
    /// Biases and scale of an MPU6050 make no more of gravity than this (data sheet PS-MPU-6000A, section 6.2: 80 mg and 3 %).
    const LARGEST_ERROR_G: f64 = 0.11;

    /// What the accelerometer reads too much, g, body axes.
    pub(super) fn bias_g(&self) -> Vector3<f64> {
        let is_gravity = (self.force_g - 1.0).abs() < Self::LARGEST_ERROR_G;
        Vector3::from(self.up) * if is_gravity { self.force_g } else { 1.0 } - Vector3::z()
    }

    /// An attitude of rest, body to world, less what the accelerometer's bias makes of it.
    pub fn levelled(&self, attitude: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        if self.used { Self::without(attitude, self.bias_g()) } else { attitude }
    }

    /// An attitude, body to world, without what a bias of the accelerometer (g, body axes) makes of it.
    ///
    /// The attitude's up is the direction of true up and the bias together. How far it is from the bias's point to the sphere
    /// of true directions follows from its length, 1 g.
    pub(super) fn without(attitude: UnitQuaternion<f64>, bias: Vector3<f64>) -> UnitQuaternion<f64> {
        let seen = attitude.inverse() * Vector3::z();
        let along = seen.dot(&bias);
        let length = along + (along * along - bias.norm_squared() + 1.0).max(0.0).sqrt();
        let up = attitude * (seen * length - bias);
        UnitQuaternion::rotation_between(&up, &Vector3::z()).map_or(attitude, |correction| correction * attitude)
    }
}

/// The board's clock against the host's: a line through the pings.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug, Default)]
#[serde(default)]
pub struct ClockFit {
    /// Pings that were used.
    pub pings: u32,
    /// Host time when the board's clock was zero, ns since 1970.
    pub offset_ns: i64,
    /// How much faster the board's clock runs, parts per million.
    pub drift_ppm: f64,
    /// Standard deviation of the pings about the line, µs.
    pub residual_us: f64,
}

/// How a trial ended.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// All phases were gone through.
    Complete,
    /// The user ended it.
    Aborted,
    /// The board latched a fault.
    Faulted,
    /// The host could not go on: the port went, the disk was full.
    #[default]
    Failed,
}

/// What a trial came to. The last record.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct Summary {
    /// How it ended.
    pub end: End,
    /// Why, where it is not complete.
    pub reason: String,
    /// How well the link worked.
    #[serde(flatten)]
    pub link: LinkStats,
    /// Steady yaw, unwrapped, corrected for the gyroscope's drift.
    pub yaw_deg: Option<f64>,
    /// Its 95 % uncertainty.
    pub yaw_uncertainty_deg: Option<f64>,
    /// Steady pitch.
    pub pitch_deg: Option<f64>,
    /// Steady roll.
    pub roll_deg: Option<f64>,
}

/// What a log was recovered from.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct RecoveryMeta {
    /// The damaged file's name.
    pub source: String,
    /// What was lost, in words.
    pub lost: String,
}

/// What a replay was made from.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
#[serde(default)]
pub struct ReplayMeta {
    /// The log whose measured speeds drove the model: its file's name.
    pub source: String,
    /// SHA-256 of that file, in hexadecimal.
    pub source_sha256: String,
}

macro_rules! names {
    ($($type:ty: $name:literal),* $(,)?) => {
        $(impl Meta for $type {
            const NAME: &'static str = $name;
        })*
    };
}

names! {
    Identity: "biflag", PlanMeta: "plan", TrialMeta: "trial", RobotMeta: "robot", BoardMeta: "board",
    CalibrationMeta: "calibration", LevelMeta: "level", ClockFit: "clock", Summary: "summary", RecoveryMeta: "recovery",
    ModelMeta: "model", SensorMeta: "sensor", SteadyMeta: "steady", ReplayMeta: "replay",
}

impl Identity {
    pub(super) fn now(origin: Origin, time: SystemTime) -> Self {
        let created = match origin {
            Origin::Model => String::new(),
            Origin::Rig | Origin::VirtualRig => jiff::Timestamp::try_from(time).unwrap_or_default().to_string(),
        };
        Self {
            format: FORMAT,
            protocol: protocol::VERSION,
            host_version: env!("CARGO_PKG_VERSION").to_owned(),
            host_git_hash: env!("BIFLAG_GIT_HASH").to_owned(),
            created,
            origin,
        }
    }

    /// Whether this very program wrote the log, and would compute the same again.
    pub fn is_of_this_program(&self) -> bool {
        self.host_version == env!("CARGO_PKG_VERSION") && self.host_git_hash == env!("BIFLAG_GIT_HASH")
    }
}

impl From<&Plan> for PlanMeta {
    fn from(plan: &Plan) -> Self {
        Self {
            name: plan.name.clone(),
            operator: plan.operator.clone(),
            note: plan.note.clone(),
            trials: plan.trials.len(),
            text: plan.text.clone(),
        }
    }
}

impl TrialMeta {
    pub(super) fn new(trial: &Trial, attempt: u32) -> Self {
        let [w1_rpm, w2_rpm] = trial.speeds.map(|speed| speed.rpm());
        let crate::plan::Phases { calibrate_s, preroll_s, run_s, decay_s } = trial.phases;
        let Trial { name, index, repeat, reverse, .. } = trial.clone();
        Self {
            name,
            index,
            repeat,
            attempt,
            w1_rpm,
            w2_rpm,
            calibrate_s,
            preroll_s,
            run_s,
            decay_s,
            reverse_motor: reverse.map(|reverse| reverse.motor),
            reverse_after_s: reverse.map(|reverse| reverse.after_s),
        }
    }
}

impl BoardMeta {
    /// What a board said of itself, with its settings in force.
    pub fn new(info: &Info, settings: &Settings) -> Self {
        let [major, minor, patch] = info.firmware;
        let hash: String = info.git_hash.iter().map(|byte| format!("{byte:02x}")).collect();
        Self {
            protocol: info.protocol,
            firmware: format!("{major}.{minor}.{patch}"),
            firmware_git_hash: hash + if info.git_dirty { "-dirty" } else { "" },
            board_id: info.board_id,
            imu_id: info.imu_id,
            reset_cause: format!("{:?}", info.reset_cause),
            boot_count: info.boot_count,
            settings: BoardSettings::all(settings).to_toml(),
        }
    }

    /// The settings in force.
    pub fn settings(&self) -> Option<Settings> {
        let file: BoardSettings = toml::from_str(&self.settings).ok()?;
        file.apply(Settings::DEFAULT).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::table::{from_table, is_intact, to_table};

    #[test]
    fn a_record_is_plain_text_and_reads_back() {
        let summary = Summary {
            end: End::Aborted,
            reason: "123".to_owned(),
            link: LinkStats { samples: 24_000, lost: 3, ..LinkStats::default() },
            yaw_deg: Some(-180.25),
            ..Summary::default()
        };
        let table = to_table(&summary);
        assert_eq!(table["end"], "aborted");
        assert_eq!(table["samples"], "24000");
        assert_eq!(table["yaw_deg"], "-180.25");
        assert!(is_intact("summary", &table) && !is_intact("clock", &table));
        assert_eq!(from_table(&table), Some(summary));
    }

    #[test]
    fn a_changed_value_is_noticed_and_a_missing_one_takes_its_default() {
        let mut table = to_table(&ClockFit { pings: 9, ..ClockFit::default() });
        table.insert("pings".to_owned(), "8".to_owned());
        assert!(!is_intact("clock", &table));
        table.remove("pings");
        assert_eq!(from_table(&table), Some(ClockFit::default()));
    }

    #[test]
    fn the_boards_settings_read_back() {
        let settings = Settings { gyro_bias: [-595.5, 6.25, 147.0], deadline_ms: 300, ..Settings::DEFAULT };
        let board: BoardMeta = from_table(&to_table(&BoardMeta::new(&Info::default(), &settings))).unwrap();
        assert_eq!(board.settings(), Some(settings));
        assert_eq!(board.firmware_git_hash, "00000000");
    }
}
