//! `sensor.toml`: the measurements of one sensor, quantity by quantity. The data sheet gives all other quantities.
//!
//! All quantities are the sensor's own errors in body axes, as in [`Sensor`](super::Sensor), before any correction by
//! the board. Uncertainties are standard uncertainties. After few repeats they are enlarged, so that ±1.96 of them
//! contain 95 % ([`expanded`](super::least_squares::expanded)).

use super::{AxesError, Estimate, Sensor};
use crate::attitude::BiasNoise;
use crate::plan::board::axis_map;
use crate::plan::error::PlanError;
use crate::plan::source::{Exactly, FileKind, Source, number};
use crate::plan::{self, Plan, robot};
use biflag_log::{MeasuredSensorMeta, atomic_file};
use protocol::Settings;
use protocol::units::AxisMap;
use serde::Deserialize;
use sim::functions::{hypot, log10, powi};
use std::collections::BTreeMap;
use std::f64::consts::SQRT_2;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// The name of the file unless the user says otherwise.
pub const FILE_NAME: &str = "sensor.toml";

/// The names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// Measured values by the name of their axis, such as `x`, or of two axes, such as `xy`: effect of y on x.
pub type Table = BTreeMap<String, Estimate>;

/// The measured errors of one sensor.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct MeasuredSensor {
    /// The id of its board; 0 for a board without an id.
    pub board_id: u16,
    /// The day of the last measurement, such as `2026-11-24`.
    pub date: String,
    /// The axes settings that the values hold for: gyroscope, accelerometer.
    pub axes: [AxisMap; 2],
    /// The measured values, by the name of their table in the file.
    tables: BTreeMap<&'static str, Table>,
}

/// A table of the file.
struct Kind {
    name: &'static str,
    keys: Keys,
    /// The largest absolute value for a working sensor.
    limit: f64,
    /// Description for the reader of the file.
    comment: &'static str,
}

/// The keys of a table.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Keys {
    /// x, y, z.
    Axes,
    /// Two axes that differ.
    Cross,
    /// Any two axes.
    Pairs,
}

macro_rules! kinds {
    ($($name:ident, $keys:ident, $limit:literal, $comment:literal;)*) => {
        /// The tables of a file.
        const KINDS: &[Kind] =
            &[$(Kind { name: stringify!($name), keys: Keys::$keys, limit: $limit, comment: $comment }),*];

        const KIND: FileKind = FileKind {
            noun: "sensor file",
            example: "`biflag sensor turn z` writes one",
            tables: &[$(stringify!($name)),*],
            help,
        };

        /// A file as it is written.
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct File {
            board_id: u16,
            date: String,
            gyro_axes: Exactly<String, 3>,
            accel_axes: Exactly<String, 3>,
            $(#[serde(default)] $name: Table,)*
        }

        impl File {
            /// Returns the tables in the order of [`KINDS`].
            fn tables(self) -> [Table; KINDS.len()] {
                [$(self.$name),*]
            }
        }
    };
}

kinds! {
    gyro_scale, Axes, 0.5, "relative; positive if it reads too much";
    gyro_cross, Cross, 0.5, "xy: share of the rate about y that x reads";
    gyro_g_dps, Pairs, 5.0, "xy: rate that x reads per standard gravity along y, deg/s";
    accel_scale, Axes, 0.5, "relative; positive if it reads too much";
    accel_cross, Cross, 0.5, "xy: share of the force along y that x reads";
    accel_offset_g, Axes, 1.0, "in standard gravity";
    mounting_deg, Axes, 30.0, "rotation of the sensor in the body";
    angle_random_walk_deg_per_root_s, Axes, 10.0, "white noise of the gyroscope";
    bias_instability_dps, Axes, 10.0, "instability of the gyroscope's bias: flicker, whose Allan deviation is 0.664 of it";
    bias_walk_dps_per_root_s, Axes, 10.0, "random walk of the gyroscope's bias";
    bias_dps_per_kelvin, Axes, 10.0, "change of the gyroscope's bias with temperature";
}

impl Keys {
    fn has(self, key: &str) -> bool {
        let mut axes = key.chars().map(|axis| AXES.iter().position(|name| name.starts_with(axis)));
        match (self, axes.next(), axes.next(), axes.next()) {
            (Self::Axes, Some(Some(_)), None, None) | (Self::Pairs, Some(Some(_)), Some(Some(_)), None) => true,
            (Self::Cross, Some(Some(i)), Some(Some(j)), None) => i != j,
            _ => false,
        }
    }

    const fn example(self) -> &'static str {
        match self {
            Self::Axes => "write x, y or z",
            Self::Cross => "write two axes that differ, such as xy",
            Self::Pairs => "write two axes, such as xy or xx",
        }
    }
}

fn help(key: &str) -> Option<&'static str> {
    Some(match key {
        "board_id" => "give a whole number from 0 to 65535",
        "date" => "give the day in quotes, such as \"2026-11-24\"",
        "gyro_axes" | "accel_axes" => {
            "name each axis of the sensor once with its sign, such as [\"-x\", \"+y\", \"+z\"]"
        }
        "value" => "give the measured value as a number",
        "u" => "give the standard uncertainty as a number, 0 or more",
        key if Keys::Axes.has(key) || Keys::Pairs.has(key) => {
            "give the value and its standard uncertainty, such as { value = -0.021, u = 0.0005 }"
        }
        _ => return None,
    })
}

impl Sensor {
    /// Returns the sensor of a plan or a log: the values of its file, and the data sheet for all others.
    pub fn of(file: Option<&MeasuredSensorMeta>) -> Self {
        file.and_then(MeasuredSensor::of).map_or_else(Self::of_data_sheet, |measured| measured.known())
    }
}

impl MeasuredSensor {
    /// Returns the measured errors from the sensor file stored in a plan or a log; `None` if the text is not a sensor
    /// file.
    pub fn of(file: &MeasuredSensorMeta) -> Option<Self> {
        Self::parse(&file.text, &file.name).ok()
    }

    /// Returns a sensor without measured errors, on a board with these settings.
    pub fn new(settings: &Settings) -> Self {
        Self { board_id: settings.board_id, axes: [settings.gyro_axes, settings.accel_axes], ..Self::default() }
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn load(path: &Path) -> Result<Self, PlanError> {
        Self::parse(&KIND.read(path)?, &path.display().to_string())
    }

    /// Reads the text of a file; errors call the file `name`.
    ///
    /// # Errors
    /// [`PlanError::Invalid`].
    pub fn parse(text: &str, name: &str) -> Result<Self, PlanError> {
        let source = Source { kind: &KIND, text, name };
        let mut file: File = source.read()?;
        let axes = |key, names: &mut Exactly<String, 3>| {
            let Exactly(names) = names;
            axis_map(names).ok_or_else(|| {
                source.error_at([key], format!("{key} cannot be {names:?}"), help(key).unwrap_or_default())
            })
        };
        let axes = [axes("gyro_axes", &mut file.gyro_axes)?, axes("accel_axes", &mut file.accel_axes)?];
        let (board_id, date) = (file.board_id, std::mem::take(&mut file.date));
        let mut tables = BTreeMap::new();
        for (kind, table) in KINDS.iter().zip(file.tables()) {
            for (key, estimate) in &table {
                check(kind, key, *estimate, &source)?;
            }
            if !table.is_empty() {
                tables.insert(kind.name, table);
            }
        }
        Ok(Self { board_id, date, axes, tables })
    }

    /// Returns a measured value: `key` in the table `table`.
    pub fn get(&self, table: &str, key: &str) -> Option<Estimate> {
        self.tables.get(table)?.get(key).copied()
    }

    /// Sets a measured value.
    ///
    /// # Panics
    /// If the file has no such key.
    pub fn set(&mut self, table: &str, key: &str, estimate: Estimate) {
        let kind = KINDS.iter().find(|kind| kind.name == table && kind.keys.has(key));
        let Some(kind) = kind else { panic!("no {key} in {table}") };
        self.tables.entry(kind.name).or_default().insert(key.to_owned(), estimate);
    }

    /// Returns the tables with their values, in the order of the file.
    pub fn tables(&self) -> impl Iterator<Item = (&'static str, &Table)> {
        KINDS.iter().filter_map(|kind| Some((kind.name, self.tables.get(kind.name)?)))
    }

    /// Describes the difference between the file's board and a board with these settings.
    pub fn mismatch(&self, settings: &Settings) -> Option<String> {
        if self.board_id != settings.board_id {
            return Some(format!("it is of board {}, and this is board {}", self.board_id, settings.board_id));
        }
        let now = [settings.gyro_axes, settings.accel_axes];
        let changed = (0..2).find(|sensor| self.axes[*sensor] != now[*sensor])?;
        let key = ["gyro_axes", "accel_axes"][changed];
        let [was, is] = [self.axes[changed], now[changed]].map(listed);
        Some(format!("it holds for {key} = {was}, and the board has {key} = {is}"))
    }

    /// Returns the sensor: the measured values, and the data sheet for all others.
    pub fn known(&self) -> Sensor {
        let mut prior = self.prior();
        for (i, axis) in AXES.iter().enumerate() {
            let put = |table: &str, key: &str, estimate: &mut Estimate| {
                *estimate = self.get(table, key).unwrap_or(*estimate);
            };
            put("gyro_scale", axis, &mut prior.gyro_scale[i]);
            put("accel_scale", axis, &mut prior.accel_scale[i]);
            put("mounting_deg", axis, &mut prior.mounting_deg[i]);
            // Root mean squares, because a short rest hardly determines the values.
            if let Some(walk) = self.get("bias_walk_dps_per_root_s", axis) {
                let flicker = self.get("bias_instability_dps", axis).unwrap_or_default();
                prior.bias_noise[i] = BiasNoise {
                    walk_dps_per_root_s: hypot(walk.value, walk.u),
                    instability_dps: hypot(flicker.value, flicker.u),
                };
            }
            for j in 0..3 {
                let pair = pair(i, j);
                put("gyro_cross", &pair, &mut prior.gyro_cross[i][j]);
                put("gyro_g_dps", &pair, &mut prior.gyro_g_dps[i][j]);
                put("accel_cross", &pair, &mut prior.accel_cross[i][j]);
            }
        }
        prior.axes = self.axes_error();
        prior.angle_walk_z_deg_per_root_s = self.get("angle_random_walk_deg_per_root_s", AXES[2]);
        prior
    }

    fn axes_error(&self) -> AxesError {
        let mut error = AxesError::default();
        let sheet = self.prior();
        for (k, u) in error.u.iter_mut().enumerate() {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let [one, other] = [(i, j), (j, i)].map(|(i, j)| self.get("accel_cross", &pair(i, j)));
            // Only poses measure both as one value.
            let Some(one) = one.filter(|one| Some(*one) == other) else { continue };
            *u = one.u;
            for (i, j) in [(i, j), (j, i)] {
                // A turn combines its measurement with the data sheet, which removes this part of the uncertainty.
                let measured = self.get("gyro_cross", &pair(i, j));
                error.of_gyro[i][j] =
                    measured.map_or(0.0, |measured| (1.0 - powi(measured.u / sheet.gyro_cross[i][j].u, 2)).max(0.0));
            }
        }
        error
    }

    /// Returns the data sheet in the axes of this sensor. Poses define the mounting so that the cross-axis terms of the
    /// accelerometer are symmetric. If they are asymmetric within the package, the gyroscope's axes are turned by the
    /// asymmetry.
    pub(super) fn prior(&self) -> Sensor {
        let mut sheet = Sensor::of_data_sheet();
        if self.tables.contains_key("mounting_deg") {
            for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).filter(|(i, j)| i != j) {
                let turned = sheet.accel_cross[i][j].u / SQRT_2;
                sheet.gyro_cross[i][j].u = hypot(sheet.gyro_cross[i][j].u, turned);
            }
        }
        sheet
    }

    /// Returns the text of the file.
    pub fn to_toml(&self) -> String {
        let [gyro, accel] = self.axes.map(listed);
        let mut text = format!(
            "# Errors of a sensor, measured by `biflag sensor`: values with standard uncertainties (u), body axes.\n\
             board_id = {}\ndate = {}\ngyro_axes = {gyro}\naccel_axes = {accel}\n",
            self.board_id,
            toml::Value::String(self.date.clone()),
        );
        for (kind, table) in KINDS.iter().filter_map(|kind| Some((kind, self.tables.get(kind.name)?))) {
            let _ = writeln!(text, "\n[{}]  # {}", kind.name, kind.comment);
            for (key, Estimate { value, u }) in table {
                let _ = writeln!(text, "{key} = {{ value = {}, u = {} }}", digits(*value, *u), digits(*u, *u));
            }
        }
        text
    }

    /// Writes the file, or replaces it as a whole.
    ///
    /// # Errors
    /// The file cannot be written; an existing one is unchanged.
    pub fn save(&self, path: &Path) -> std::io::Result<()> {
        atomic_file::replace(path, |file| file.write_all(self.to_toml().as_bytes()))
    }
}

impl Plan {
    /// Reads and checks a plan and the robot and sensor files that it names: files on disk, or files inside the program
    /// ([`plan::Shipped`]).
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn load(path: &Path) -> Result<Self, PlanError> {
        let text = plan::file::KIND.read(path)?;
        let mut plan = Self::parse(&text, &path.display().to_string())?;
        plan.robot = robot::of_plan(path, &plan.robot.name)?;
        if let Some(sensor) = &mut plan.sensor {
            let beside = path.parent().unwrap_or(Path::new("")).join(&sensor.name);
            sensor.text = KIND.read(&beside)?;
            MeasuredSensor::parse(&sensor.text, &beside.display().to_string())?;
        }
        Ok(plan)
    }
}

/// Returns the key for the effect of axis j on axis i.
pub fn pair(i: usize, j: usize) -> String {
    format!("{}{}", AXES[i], AXES[j])
}

fn check(kind: &Kind, key: &str, estimate: Estimate, source: &Source) -> Result<(), PlanError> {
    let name = kind.name;
    if !kind.keys.has(key) {
        let what = format!("unknown key `{key}` in {name}");
        return Err(source.error_at([name, key, "value"], what, kind.keys.example()));
    }
    let Estimate { value, u } = estimate;
    let limit = kind.limit;
    // NaN fails both tests.
    let is_possible = value.abs() <= limit && (0.0..=limit).contains(&u);
    if is_possible {
        return Ok(());
    }
    let what = format!("{name}.{key} cannot be {} with u = {}", number(value), number(u));
    let cure = format!("give a value from {} to {limit}, and a standard uncertainty from 0 to {limit}", -limit);
    let part = if value.abs() <= limit { "u" } else { "value" };
    Err(source.error_at([name, key, part], what, cure))
}

fn listed(axes: AxisMap) -> String {
    format!("[{}]", axes.0.map(|axis| format!("\"{axis}\"")).join(", "))
}

/// Formats a number to the third significant digit of its uncertainty.
fn digits(value: f64, u: f64) -> String {
    let places = if u > 0.0 { (2.0 - log10(u).floor()).clamp(0.0, 12.0) } else { 9.0 };
    let text = format!("{value:.*}", places as usize);
    // TOML distinguishes integers from decimal numbers.
    if text.contains('.') { text } else { text + ".0" }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor() -> MeasuredSensor {
        let mut sensor = MeasuredSensor { date: "2026-11-24".to_owned(), ..MeasuredSensor::new(&Settings::DEFAULT) };
        sensor.board_id = 7;
        sensor.set("gyro_scale", "z", Estimate { value: -0.0213, u: 0.00045 });
        sensor.set("gyro_cross", "xz", Estimate { value: 0.0071, u: 0.0035 });
        sensor.set("gyro_g_dps", "yy", Estimate { value: -0.0312, u: 0.00121 });
        sensor
    }

    #[test]
    fn what_is_written_is_read() {
        let text = sensor().to_toml();
        assert!(text.contains("[gyro_scale]") && text.contains("z = { value = -0.021300, u = 0.000450 }"), "{text}");
        assert_eq!(MeasuredSensor::parse(&text, "sensor.toml").unwrap(), sensor());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE_NAME);
        sensor().save(&path).unwrap();
        sensor().save(&path).unwrap();
        assert_eq!(MeasuredSensor::load(&path).unwrap(), sensor());
    }

    #[test]
    fn what_was_not_measured_is_of_the_data_sheet() {
        let sheet = Sensor::of_data_sheet();
        let known = sensor().known();
        assert_eq!(known.gyro_scale[2], Estimate { value: -0.0213, u: 0.00045 });
        assert_eq!(known.gyro_scale[0], sheet.gyro_scale[0]);
        assert_eq!(known.gyro_cross[0][2].value, 0.0071);
        assert_eq!(known.gyro_cross[2][0], sheet.gyro_cross[2][0]);
        assert_eq!(known.gyro_g_dps[1][1].u, 0.00121);
        assert_eq!(known.accel_cross, sheet.accel_cross);
    }

    #[test]
    fn another_board_and_other_axes_are_told() {
        let settings = Settings { board_id: 7, ..Settings::DEFAULT };
        assert_eq!(sensor().mismatch(&settings), None);
        let other = Settings { board_id: 8, ..settings };
        assert_eq!(sensor().mismatch(&other).unwrap(), "it is of board 7, and this is board 8");
        let flipped = axis_map(&["+x", "-y", "-z"].map(str::to_owned)).unwrap();
        let other = Settings { accel_axes: flipped, ..settings };
        let text = sensor().mismatch(&other).unwrap();
        assert!(text.contains("accel_axes = [\"+x\", \"-y\", \"-z\"]"), "{text}");
    }

    #[test]
    fn every_mistake_is_named_with_its_line_and_its_cure() {
        let head = "board_id = 7\ndate = \"2026-11-24\"\ngyro_axes = [\"+x\", \"+y\", \"+z\"]\naccel_axes = [\"+x\", \"+y\", \"+z\"]\n";
        for (text, message) in [
            ("[gyro_scale]\nz = { value = 0.01, u = -1 }\n", "s.toml:6:25: gyro_scale.z cannot be 0.01 with u = -1"),
            ("[gyro_scale]\nz = { value = nan, u = 0.1 }\n", "s.toml:6:15: gyro_scale.z cannot be NaN with u = 0.1"),
            ("[gyro_scale]\nz = 0.01\n", "s.toml:6:5: z cannot be 0.01"),
            ("[gyro_scale]\nz = { value = 0.01 }\n", "s.toml:6:5: the key `u` is missing"),
            ("[gyro_scale]\nz = { value = 0.01, u = 0.001, unit = 3 }\n", "s.toml:6:32: unknown key `unit`"),
            ("[gyro_scale]\nw = { value = 0.01, u = 0.001 }\n", "s.toml:6:15: unknown key `w` in gyro_scale"),
            ("[gyro_cross]\nxx = { value = 0.01, u = 0.001 }\n", "s.toml:6:16: unknown key `xx` in gyro_cross"),
            ("[gyro_skale]\n", "s.toml:5:2: unknown key `gyro_skale`"),
        ] {
            let error = MeasuredSensor::parse(&format!("{head}{text}"), "s.toml").unwrap_err().to_string();
            assert_eq!(error, message, "{text}");
        }
        let error = MeasuredSensor::parse(&head.replace("+z", "+y"), "s.toml").unwrap_err().to_string();
        assert!(error.starts_with("s.toml:3:13: gyro_axes cannot be"), "{error}");
        let error = MeasuredSensor::parse("board_id = 7\n", "s.toml").unwrap_err().to_string();
        assert!(error.contains("`date` is missing"), "{error}");
    }
}
