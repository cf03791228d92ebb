//! The metadata records of a log: the trial, its plan, the robot, the board, and the result.

use super::model_meta::{ModelMeta, SensorMeta, SteadyMeta};
use super::stats::LinkStats;
use super::table::Meta;
use serde::{Deserialize, Serialize};

/// Version of the log's layout. It is raised when older programs cannot read newer logs correctly.
///
/// 1: the attitude in `/telemetry` is levelled from the start of the run, and the flagella are in `/flagella` only.
/// 2: `/telemetry` holds the attitude as the board sent it, and `/nodes` holds the flagella.
pub const FORMAT: u32 = 2;

/// Where a trial was run.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// On the rig.
    #[default]
    Rig,
    /// On the emulated board.
    VirtualRig,
    /// In the simulator.
    Model,
    /// On another rig, measured by other instruments.
    Imported,
}

impl Origin {
    /// Returns its name in tables and in JSON. Logs have other names for some origins, for older programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rig => "rig",
            Self::VirtualRig => "emulated",
            Self::Model => "model",
            Self::Imported => "import",
        }
    }

    /// Returns whether a board recorded the trial: real or emulated, with its sensor.
    pub fn is_recorded(self) -> bool {
        matches!(self, Self::Rig | Self::VirtualRig)
    }
}

/// The program that wrote the log: the first record.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct Identity {
    /// [`FORMAT`].
    pub format: u32,
    /// Version of the protocol between host and board.
    pub protocol: u8,
    /// Version of `biflag`.
    pub host_version: String,
    /// Commit that `biflag` was built from.
    pub host_git_hash: String,
    /// Time at which the log was started; empty for a modelled trial, whose log does not depend on the date.
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
    /// Operator.
    pub operator: String,
    /// Note.
    pub note: String,
    /// Number of trials.
    pub trials: usize,
    /// Text of the plan's file.
    pub text: String,
}

/// The trial.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct TrialMeta {
    /// Name of the trial.
    pub name: String,
    /// Position in the plan, from 0.
    pub index: usize,
    /// Repeat, from 1.
    pub repeat: u32,
    /// Attempt, from 1.
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
    /// The motor that reverses during the run, 1 or 2.
    pub reverse_motor: Option<u8>,
    /// Time of the reversal, from the start of the run.
    pub reverse_after_s: Option<f64>,
    /// Angles of flagella 1 and 2 from their marks at the start of the trial, if the plan sets them.
    pub phase_deg: Option<[f64; 2]>,
}

/// The attitude that a steered trial is to reach and hold. Its speeds follow from observations; the speeds in its
/// [`TrialMeta`] are the feed-forward.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct SteerMeta {
    /// Wanted yaw.
    pub yaw_deg: f64,
    /// Wanted pitch.
    pub pitch_deg: f64,
    /// Observations and set-points per second.
    pub rate_hz: f64,
    /// The command of the policy; empty for the built-in controller.
    pub policy: String,
}

/// The robot's parameters.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct RobotMeta {
    /// `physical`, `published`, or the name of the robot's file.
    pub name: String,
    /// Text of the robot's file.
    pub text: String,
}

/// The sensor's errors, measured before the trial.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
#[serde(default)]
pub struct MeasuredSensorMeta {
    /// Name of the sensor's file, as in the plan.
    pub name: String,
    /// Text of the file.
    pub text: String,
}

/// The board.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct BoardMeta {
    /// Version of the board's protocol.
    pub protocol: u8,
    /// Version of the firmware.
    pub firmware: String,
    /// Commit that the firmware was built from, with `-dirty` if the working tree had changes.
    pub firmware_git_hash: String,
    /// Identifier of the board.
    pub board_id: u16,
    /// The sensor's WHO_AM_I.
    pub imu_id: u8,
    /// Cause of the board's last reset.
    pub reset_cause: String,
    /// Number of times the board has started.
    pub boot_count: u16,
    /// The settings in use, in the format of `biflag settings`.
    pub settings: String,
    /// Angles of flagella 1 and 2 from their marks before the trial, 0 to 360; `None` if the board does not know them.
    pub angle_deg: Option<[f64; 2]>,
    /// The board's fault log before the trial, the latest entry first.
    pub faults: Vec<FaultMeta>,
}

/// An entry of the board's fault log.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct FaultMeta {
    /// [`BoardMeta::boot_count`] of the board's start before the fault.
    pub boot: u16,
    /// Time since that start, s. The board's clock wraps after 71.6 minutes.
    pub time_s: f64,
    /// Name of the fault.
    pub fault: String,
    /// Duties of the motors' bridges, -255 to 255.
    pub duty: [i16; 2],
    /// Measured speeds of the flagella; `None` without encoders.
    pub speed_rpm: Option<[f64; 2]>,
    /// Where the firmware hung: the address in flash; 0 for other faults.
    pub program_counter: u16,
}

/// Result of the gyroscope's calibration.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct CalibrationMeta {
    /// Whether the sensor lay still; if not, the board keeps its previous bias.
    pub still: bool,
    /// Mean reading, counts, sensor axes.
    pub bias_counts: [f32; 3],
    /// Standard deviation of the readings, counts, largest axis.
    pub noise_counts: u16,
    /// Number of readings averaged.
    pub samples: u16,
}

/// The wait for a still robot before the trial.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug, Default)]
#[serde(default)]
pub struct RestMeta {
    /// Whether it was still at the end of the wait.
    pub still: bool,
    /// Time that the recorder waited.
    pub waited_s: f64,
    /// Longest time that it would have waited.
    pub at_most_s: f64,
    /// Upper bound on the rate of the yaw at the end of the wait; `None` if the wait was too short for a bound.
    pub yaw_dps: Option<f64>,
    /// The same for the tilt.
    pub tilt_dps: Option<f64>,
}

/// The vertical measured by the accelerometer while the robot hung at rest before the run.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(default)]
pub struct LevelMeta {
    /// Direction of up, a unit vector in body axes.
    pub up: [f64; 3],
    /// Magnitude of the mean specific force, in units of standard gravity.
    pub force_g: f64,
    /// Angle between that direction and the robot's axis.
    pub tilt_deg: f64,
    /// Whether the tilt is small enough to be the sensor's bias, which is then removed from the attitude.
    pub used: bool,
}

impl Default for LevelMeta {
    fn default() -> Self {
        Self { up: [0.0, 0.0, 1.0], force_g: 1.0, tilt_deg: 0.0, used: false }
    }
}

/// The board's clock relative to the host's: a line fitted to the pings.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug, Default)]
#[serde(default)]
pub struct ClockMeta {
    /// Number of pings used.
    pub pings: u32,
    /// Host time when the board's clock was zero, ns since 1970.
    pub offset_ns: i64,
    /// Rate error of the board's clock, parts per million; positive if it runs fast.
    pub drift_ppm: f64,
    /// Standard deviation of the pings about the line, µs.
    pub residual_us: f64,
}

/// How a trial ended.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// All phases were completed.
    Complete,
    /// The user interrupted it.
    Aborted,
    /// The board latched a fault.
    Faulted,
    /// The host failed, for example because the port disappeared or the disk was full.
    #[default]
    Failed,
}

/// How a trial ended, and its result: the last record.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct Summary {
    /// How the trial ended.
    pub end: End,
    /// The reason, if it is not complete.
    pub reason: String,
    /// Link statistics.
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

/// The damaged log that a log was recovered from.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct RecoveryMeta {
    /// Name of the damaged file.
    pub source: String,
    /// The losses, in words.
    pub lost: String,
}

/// The table that an imported trial was made from.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct ImportMeta {
    /// Name of the file; empty if the values came from a program.
    pub source: String,
    /// SHA-256 of that file, in hexadecimal.
    pub source_sha256: String,
    /// The mapping of columns to quantities, as text.
    pub columns: String,
    /// Time at which the log begins, s: by the table's clock, or by the clock of the recording with which it was aligned.
    pub start_s: f64,
    /// Rows left out because of a missing value.
    pub left_out: u64,
    /// Quantities that were not measured: they have one value in all rows.
    pub constant: Vec<String>,
    /// Whether the speeds or turns of the motors were measured: by the table, or by the recording of the same trial.
    pub has_motors: bool,
    /// 95 % uncertainty of the instrument's yaw, degrees.
    pub yaw_uncertainty_deg: Option<f64>,
    /// The same for its pitch and roll.
    pub tilt_uncertainty_deg: Option<f64>,
    /// Temperature of the fluid, °C.
    pub temperature_c: Option<f64>,
    /// File name of the recording of the same trial that provided clock and motors; empty without one.
    pub trial: String,
    /// SHA-256 of that file, in hexadecimal.
    pub trial_sha256: String,
    /// 95 % uncertainty of the yaw of that recording, degrees.
    pub trial_yaw_uncertainty_deg: Option<f64>,
    /// Time of that recording at the table's time zero, s.
    pub clock_offset_s: Option<f64>,
    /// Relative rate by which that recording's time passes faster than the table's, 10⁻⁶.
    pub clock_rate_ppm: Option<f64>,
    /// Difference between the table's and the recorded yaw after removing clock, zero and drift, degrees RMS.
    pub clock_rms_deg: Option<f64>,
}

/// The recording that a replay was made from.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
#[serde(default)]
pub struct ReplayMeta {
    /// File name of the log whose measured speeds drove the model.
    pub source: String,
    /// SHA-256 of that file, in hexadecimal.
    pub source_sha256: String,
}

macro_rules! names {
    ($($type:ty: $name:literal),* $(,)?) => {
        $(impl Meta for $type {
            const NAME: &'static str = $name;
        })*

        /// The names of all metadata records of biflag.
        pub(super) const NAMES: &[&str] = &[$($name),*];
    };
}

names! {
    Identity: "biflag", PlanMeta: "plan", TrialMeta: "trial", RobotMeta: "robot", BoardMeta: "board",
    CalibrationMeta: "calibration", RestMeta: "rest", LevelMeta: "level", ClockMeta: "clock", Summary: "summary", RecoveryMeta: "recovery",
    MeasuredSensorMeta: "measured_sensor", ModelMeta: "model", SteerMeta: "steer", SensorMeta: "sensor", SteadyMeta: "steady", ReplayMeta: "replay",
    ImportMeta: "import",
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{from_table, is_intact, to_table};
    use sim::steady::Kind;

    #[test]
    fn metadata_record_round_trips_as_text() {
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
    fn fault_log_round_trips_and_older_logs_have_none() {
        let fault =
            FaultMeta { boot: 3, time_s: 1.5, fault: "Hang".to_owned(), program_counter: 0x1a2c, ..Default::default() };
        let board = BoardMeta { board_id: 7, faults: vec![fault; 2], ..BoardMeta::default() };
        let mut table = to_table(&board);
        assert_eq!(from_table(&table), Some(board.clone()));
        table.remove("faults");
        assert_eq!(from_table(&table), Some(BoardMeta { faults: Vec::new(), ..board }));
    }

    #[test]
    fn kind_of_a_steady_state_round_trips_and_is_left_out_of_a_trial() {
        for kind in [None, Some(Kind::Steady), Some(Kind::Beating), Some(Kind::NotFound), Some(Kind::Overturned)] {
            let steady = SteadyMeta { kind, ..SteadyMeta::default() };
            let table = to_table(&steady);
            assert_eq!(table.get("kind").map(String::as_str), kind.map(Kind::name));
            assert_eq!(from_table::<SteadyMeta>(&table).unwrap().kind, kind);
        }
    }

    #[test]
    fn quantities_of_a_steady_state_round_trip_and_older_logs_have_fewer() {
        let mut table = to_table(&SteadyMeta::default());
        assert!(
            from_table::<SteadyMeta>(&table).unwrap().values.angles_deg()[0].is_nan(),
            "an unknown value is no number"
        );
        for (key, value) in
            [("yaw_deg", "-63.7"), ("yaw_se_deg", "0.25"), ("force2_n", "[1e-4,0.0,2e-5]"), ("sweeps", "12")]
        {
            assert!(table.insert(key.to_owned(), value.to_owned()).is_some(), "{key}");
        }
        let read: SteadyMeta = from_table(&table).unwrap();
        assert_eq!((read.values.angles_deg()[0], read.values.angle_uncertainties_deg()[0]), (-63.7, Some(0.5)));
        assert_eq!(to_table(&read)["force2_n"], "[0.0001,0.0,0.00002]");
        // Their name in older logs.
        table.remove("sweeps");
        table.insert("newton_iterations".to_owned(), "12".to_owned());
        assert_eq!(to_table(&from_table::<SteadyMeta>(&table).unwrap())["sweeps"], "12");
    }

    #[test]
    fn changed_value_fails_the_crc_and_missing_value_takes_its_default() {
        let mut table = to_table(&ClockMeta { pings: 9, ..ClockMeta::default() });
        table.insert("pings".to_owned(), "8".to_owned());
        assert!(!is_intact("clock", &table));
        table.remove("pings");
        assert_eq!(from_table(&table), Some(ClockMeta::default()));
    }
}
