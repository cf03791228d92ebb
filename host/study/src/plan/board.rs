//! The board's settings in a file: the `[board]` table of a plan, and the file that `biflag settings` reads and writes.

use super::PlanError;
use super::source::{FileKind, Source, number, optional_array};
use crate::text::hex;
use biflag_log::BoardMeta;
use miette::Diagnostic;
use protocol::units::{AccelRange, Axis, AxisMap, EncoderCounts, GyroRange};
use protocol::{Bridge, Info, Settings, SpeedFrom};
use serde::{Deserialize, Serialize};
use std::fmt::{Display, LowerExp};
use std::ops::RangeInclusive;
use std::path::Path;
use thiserror::Error;

/// Settings to apply; a missing setting keeps its value. Units and meanings are those of [`Settings`].
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(deny_unknown_fields, default)]
pub struct BoardSettings {
    /// A number that identifies the board.
    pub board_id: Option<u16>,
    /// 250, 500, 1000 or 2000 °/s.
    pub gyro_range_dps: Option<u16>,
    /// 2, 4, 8 or 16 g.
    pub accel_range_g: Option<u8>,
    /// 0 (260 Hz) to 6 (5 Hz).
    pub low_pass: Option<u8>,
    /// The sensor axis that measures along each body axis, such as `["-x", "+y", "+z"]`.
    #[serde(deserialize_with = "optional_array")]
    pub gyro_axes: Option<[String; 3]>,
    /// The same for the accelerometer.
    #[serde(deserialize_with = "optional_array")]
    pub accel_axes: Option<[String; 3]>,
    /// Mean reading at rest, counts, sensor axes.
    #[serde(deserialize_with = "optional_array")]
    pub gyro_bias_counts: Option<[f32; 3]>,
    /// 1/s.
    pub attitude_kp: Option<f32>,
    /// 1/s².
    pub attitude_ki: Option<f32>,
    /// Duty steps per rpm.
    pub speed_kp: Option<f32>,
    /// Duty steps per rpm and second.
    pub speed_ki: Option<f32>,
    /// Encoder counts per revolution of a flagellum.
    pub counts_per_turn: Option<f32>,
    /// Whether a positive duty turns motors 1 and 2 backwards.
    #[serde(deserialize_with = "optional_array")]
    pub motor_reversed: Option<[bool; 2]>,
    /// Whether the encoders of motors 1 and 2 count backwards.
    #[serde(deserialize_with = "optional_array")]
    pub encoder_reversed: Option<[bool; 2]>,
    /// Longest silence of the host while the motors turn, ms.
    pub deadline_ms: Option<u16>,
    /// Duties above which motors 1 and 2 turn unless blocked, out of 255.
    #[serde(deserialize_with = "optional_array")]
    pub moving_duty: Option<[u8; 2]>,
    /// The chip's reference voltage, mV.
    pub bandgap_mv: Option<u16>,
    /// `enable` or `in-in`.
    pub bridge: Option<String>,
    /// `encoders` or `duty`.
    pub speed_from: Option<String>,
}

const BRIDGES: [(&str, Bridge); 2] = [("enable", Bridge::Enable), ("in-in", Bridge::InIn)];
const SPEEDS_FROM: [(&str, SpeedFrom); 2] = [("encoders", SpeedFrom::Encoders), ("duty", SpeedFrom::Duty)];

fn name_of<T: PartialEq>(names: &[(&str, T)], value: &T) -> Option<String> {
    names.iter().find(|(_, named)| named == value).map(|(name, _)| (*name).to_owned())
}

/// Sets a setting to the value of a name, if a name is given.
fn set_named<T: Copy>(
    key: &'static str,
    setting: &mut T,
    name: Option<&String>,
    names: &[(&str, T)],
) -> Result<(), BoardSettingsError> {
    let Some(name) = name else { return Ok(()) };
    let found = names.iter().find(|(known, _)| known == name);
    let (_, value) = found.ok_or_else(|| BoardSettingsError { key, value: format!("{name:?}") })?;
    *setting = *value;
    Ok(())
}

/// A setting with a value out of its range.
#[derive(Error, Diagnostic, Clone, PartialEq, Debug)]
#[error("{key} cannot be {value}")]
#[diagnostic(code(wrong_use), help("{}", help(key).unwrap_or_default()))]
pub struct BoardSettingsError {
    /// The key in the file.
    pub key: &'static str,
    /// Its value.
    pub value: String,
}

const KIND: FileKind = FileKind { noun: "settings file", example: "`biflag settings` prints one", tables: &[], help };

/// Returns the range and the meaning of a setting.
pub(super) fn help(key: &str) -> Option<&'static str> {
    Some(match key {
        "board_id" => "give a whole number from 0 to 65535",
        "gyro_range_dps" => "give 250, 500, 1000 or 2000 (°/s)",
        "accel_range_g" => "give 2, 4, 8 or 16 (g)",
        "low_pass" => "give a whole number from 0 (260 Hz) to 6 (5 Hz)",
        "gyro_axes" | "accel_axes" => {
            "name each axis of the sensor once with its sign, such as [\"-x\", \"+y\", \"+z\"]"
        }
        "gyro_bias_counts" => "give three readings in counts, each from -32768 to 32767, such as [594.6, 5.6, 147.0]",
        "attitude_kp" | "attitude_ki" | "speed_kp" | "speed_ki" => "give a number from 0 to 1000",
        "counts_per_turn" => "give a number from 1 to 100000",
        "motor_reversed" | "encoder_reversed" => "give true or false for motors 1 and 2, such as [false, true]",
        "deadline_ms" => "give a whole number of milliseconds from 50 to 5000",
        "moving_duty" => "give a whole number from 1 to 255 for motors 1 and 2, such as [60, 70]",
        "bandgap_mv" => "give a whole number of millivolts from 1000 to 1200",
        "bridge" => "give \"enable\" (TB6612, L298N, L293D) or \"in-in\" (DRV8833, DRV8871, MX1508)",
        "speed_from" => "give \"encoders\", or \"duty\" for motors without encoders",
        _ => return None,
    })
}

/// Reads and checks a file of settings.
///
/// # Errors
/// [`PlanError`].
pub fn load(path: &Path) -> Result<BoardSettings, PlanError> {
    let text = KIND.read(path)?;
    let source = Source { kind: &KIND, text: &text, name: &path.display().to_string() };
    let settings: BoardSettings = source.read()?;
    settings.check(&source, &[])?;
    Ok(settings)
}

impl BoardSettings {
    /// Returns all settings of the board.
    pub fn all(settings: &Settings) -> Self {
        let names = |axes: AxisMap| axes.0.map(|axis| axis.to_string());
        Self {
            board_id: Some(settings.board_id),
            gyro_range_dps: Some(settings.gyro_range.full_scale_dps()),
            accel_range_g: Some(settings.accel_range.full_scale_g()),
            low_pass: Some(settings.low_pass),
            gyro_axes: Some(names(settings.gyro_axes)),
            accel_axes: Some(names(settings.accel_axes)),
            gyro_bias_counts: Some(settings.gyro_bias),
            attitude_kp: Some(settings.attitude_kp),
            attitude_ki: Some(settings.attitude_ki),
            speed_kp: Some(settings.speed_kp),
            speed_ki: Some(settings.speed_ki),
            counts_per_turn: Some(settings.counts_per_turn),
            motor_reversed: Some(settings.motor_reversed),
            encoder_reversed: Some(settings.encoder_reversed),
            deadline_ms: Some(settings.deadline_ms),
            moving_duty: Some(settings.moving_duty),
            bandgap_mv: Some(settings.bandgap.0),
            bridge: name_of(&BRIDGES, &settings.bridge),
            speed_from: name_of(&SPEEDS_FROM, &settings.speed_from),
        }
    }

    /// Returns the file with these settings.
    pub fn to_toml(&self) -> String {
        // Numbers, flags, text and short lists all have a form in TOML.
        toml::to_string(self).unwrap_or_default()
    }

    /// Returns the settings that affect the measurement: all except the board's protection.
    pub fn of_the_data(&self) -> Self {
        Self { deadline_ms: None, moving_duty: None, bandgap_mv: None, ..self.clone() }
    }

    /// Returns whether nothing is set.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Returns `base` with these settings in place of its own.
    ///
    /// # Errors
    /// The first setting that is out of its range.
    pub fn apply(&self, base: Settings) -> Result<Settings, BoardSettingsError> {
        let mut settings = base;
        let wrong = |key, value: String| BoardSettingsError { key, value };
        set(&mut settings.board_id, self.board_id);
        if let Some(dps) = self.gyro_range_dps {
            let range = GyroRange::ALL.into_iter().find(|range| range.full_scale_dps() == dps);
            settings.gyro_range = range.ok_or_else(|| wrong("gyro_range_dps", dps.to_string()))?;
        }
        if let Some(g) = self.accel_range_g {
            let range = AccelRange::ALL.into_iter().find(|range| range.full_scale_g() == g);
            settings.accel_range = range.ok_or_else(|| wrong("accel_range_g", g.to_string()))?;
        }
        set_within("low_pass", &mut settings.low_pass, self.low_pass, 0..=6)?;
        for (key, names, axes) in [
            ("gyro_axes", &self.gyro_axes, &mut settings.gyro_axes),
            ("accel_axes", &self.accel_axes, &mut settings.accel_axes),
        ] {
            if let Some(names) = names {
                *axes = axis_map(names).ok_or_else(|| wrong(key, format!("{names:?}")))?;
            }
        }
        set(&mut settings.gyro_bias, self.gyro_bias_counts);
        if settings.gyro_bias.iter().any(|bias| !(-32768.0..=32767.0).contains(bias)) {
            return Err(wrong("gyro_bias_counts", format!("[{}]", settings.gyro_bias.map(number).join(", "))));
        }
        set_within("attitude_kp", &mut settings.attitude_kp, self.attitude_kp, 0.0..=1000.0)?;
        set_within("attitude_ki", &mut settings.attitude_ki, self.attitude_ki, 0.0..=1000.0)?;
        set_within("speed_kp", &mut settings.speed_kp, self.speed_kp, 0.0..=1000.0)?;
        set_within("speed_ki", &mut settings.speed_ki, self.speed_ki, 0.0..=1000.0)?;
        set_within("counts_per_turn", &mut settings.counts_per_turn, self.counts_per_turn, 1.0..=100_000.0)?;
        set(&mut settings.motor_reversed, self.motor_reversed);
        set(&mut settings.encoder_reversed, self.encoder_reversed);
        set_within("deadline_ms", &mut settings.deadline_ms, self.deadline_ms, 50..=5000)?;
        set(&mut settings.moving_duty, self.moving_duty);
        if settings.moving_duty.contains(&0) {
            return Err(wrong("moving_duty", format!("{:?}", settings.moving_duty)));
        }
        set_within("bandgap_mv", &mut settings.bandgap.0, self.bandgap_mv, 1000..=1200)?;
        set_named("bridge", &mut settings.bridge, self.bridge.as_ref(), &BRIDGES)?;
        set_named("speed_from", &mut settings.speed_from, self.speed_from.as_ref(), &SPEEDS_FROM)?;
        Ok(settings)
    }

    /// Checks every value; `table` is the path of the settings' table in the file.
    pub(super) fn check(&self, source: &Source, table: &[&str]) -> Result<(), PlanError> {
        self.apply(Settings::DEFAULT).map(|_| ()).map_err(|error| {
            let cure = help(error.key).unwrap_or_default();
            source.error_at(table.iter().copied().chain([error.key]), error.to_string(), cure)
        })
    }
}

fn set<T: Copy>(setting: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *setting = value;
    }
}

/// Sets a number if there is a value for it. The range is checked even if the number does not change.
fn set_within<T: Into<f64> + Copy + Display + LowerExp + PartialOrd>(
    key: &'static str,
    setting: &mut T,
    value: Option<T>,
    range: RangeInclusive<T>,
) -> Result<(), BoardSettingsError> {
    set(setting, value);
    if range.contains(setting) { Ok(()) } else { Err(BoardSettingsError { key, value: number(*setting) }) }
}

/// Returns the axes of these names; `None` if one is not an axis, or if two are the same.
pub(crate) fn axis_map(names: &[String; 3]) -> Option<AxisMap> {
    let [x, y, z] = names;
    let map = AxisMap([Axis::from_name(x)?, Axis::from_name(y)?, Axis::from_name(z)?]);
    map.is_permutation().then_some(map)
}

/// Returns the record of a board with these settings, without its fault log.
pub fn to_log(info: &Info, settings: &Settings) -> BoardMeta {
    let [major, minor, patch] = info.firmware;
    let hash = hex(&info.git_hash);
    BoardMeta {
        protocol: info.protocol,
        firmware: format!("{major}.{minor}.{patch}"),
        firmware_git_hash: hash + if info.git_dirty { "-dirty" } else { "" },
        board_id: info.board_id,
        imu_id: info.imu_id,
        reset_cause: format!("{:?}", info.reset_cause),
        boot_count: info.boot_count,
        settings: BoardSettings::all(settings).to_toml(),
        angle_deg: angles_deg(info, settings),
        faults: Vec::new(),
    }
}

/// Returns the angles of flagella 1 and 2 from their marks, 0 to 360°; `None` if the board does not know them.
pub fn angles_deg(info: &Info, settings: &Settings) -> Option<[f64; 2]> {
    let per_turn = f64::from(settings.counts_per_turn);
    let angle = |position: EncoderCounts| (f64::from(position.0) / per_turn).rem_euclid(1.0) * 360.0;
    info.angles_known.then(|| info.encoder.map(angle))
}

/// Returns the board's settings from its record in a log; `None` if they cannot be read.
pub fn of_log(board: &BoardMeta) -> Option<Settings> {
    let file: BoardSettings = toml::from_str(&board.settings).ok()?;
    file.apply(Settings::DEFAULT).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::units::Millivolts;

    #[test]
    fn settings_go_to_a_file_and_back() {
        let settings = Settings {
            board_id: 7,
            gyro_range: GyroRange::Dps500,
            accel_range: AccelRange::G8,
            gyro_axes: AxisMap([Axis::MinusX, Axis::PlusY, Axis::PlusZ]),
            gyro_bias: [-595.5, 6.25, 147.0],
            speed_ki: 0.1,
            motor_reversed: [true, false],
            moving_duty: [40, 255],
            bandgap: Millivolts(1060),
            bridge: Bridge::InIn,
            speed_from: SpeedFrom::Duty,
            ..Settings::DEFAULT
        };
        let text = BoardSettings::all(&settings).to_toml();
        assert!(text.contains("gyro_axes = [\"-x\", \"+y\", \"+z\"]") && text.contains("speed_ki = 0.1"), "{text}");
        let read: BoardSettings = toml::from_str(&text).unwrap();
        assert_eq!(read.apply(Settings::DEFAULT), Ok(settings));
    }

    #[test]
    fn missing_settings_are_unchanged_and_wrong_ones_are_named() {
        let base = Settings { deadline_ms: 300, ..Settings::DEFAULT };
        let some = BoardSettings { low_pass: Some(2), ..BoardSettings::default() };
        assert_eq!(some.apply(base), Ok(Settings { low_pass: 2, ..base }));
        assert!(BoardSettings::default().is_empty() && !some.is_empty());
        let wrong = BoardSettings { gyro_range_dps: Some(300), ..BoardSettings::default() };
        assert_eq!(wrong.apply(base).unwrap_err().key, "gyro_range_dps");
        let wrong = BoardSettings { moving_duty: Some([60, 0]), ..BoardSettings::default() };
        assert_eq!(wrong.apply(base).unwrap_err().to_string(), "moving_duty cannot be [60, 0]");
        let wrong = BoardSettings { bandgap_mv: Some(999), ..BoardSettings::default() };
        assert_eq!(wrong.apply(base).unwrap_err().key, "bandgap_mv");
    }

    #[test]
    fn the_settings_of_a_log_read_back() {
        let settings = Settings { gyro_bias: [-595.5, 6.25, 147.0], deadline_ms: 300, ..Settings::DEFAULT };
        let board = to_log(&Info::default(), &settings);
        assert_eq!(of_log(&board), Some(settings));
        assert_eq!(board.firmware_git_hash, "00000000");
    }
}
